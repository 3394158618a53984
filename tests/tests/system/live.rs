//! Another program watches a run and talks to it; whatever it does, the run is the same.

use flotor_core::Change;
use flotor_core::trace::{RECORD_WORDS, TickRecord};
use flotor_live::{
    Answer, Ask, Client, Directory, Event, LiveError, Outcome as ChangeOutcome, Publication, SetValue,
    Subject,
};
use flotor_record::{Recording, TraceDigest};
use flotor_servo::RunEnd;
use flotor_servo::{Clock, EmergencySource, StopSwitch};
use flotor_session::run_description::describe;
use flotor_session::scene::Scene;
use flotor_session::{Observer, Outcome, RunOptions, Session};
use flotor_sync::Words;
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::prepared;
use rustix::process::Signal;
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::{Duration, Instant};

/// No test waits longer than this for anything.
const PATIENCE: Duration = Duration::from_secs(20);

const SCENE: &str = "duration_s = 2\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";

/// A run that is published, with its digest.
struct Published<'a> {
    publication: Publication,
    digest: TraceDigest,
    ticks: u64,
    /// Called after every tick.
    meanwhile: &'a mut dyn FnMut(&TickRecord),
}

impl Observer for Published<'_> {
    fn observe(&mut self, record: &TickRecord) {
        self.ticks += 1;
        self.digest.update(record);
        self.publication.observe(record);
        (self.meanwhile)(record);
    }

    fn change(&mut self, change: &Change) {
        self.publication.change(change);
    }
}

fn publish(session: &Session, directory: &Directory, stop: &StopSwitch) -> Publication {
    let scene = Scene::parse(Path::new("scene.toml"), SCENE).expect("the scene is right");
    let scene = Scene { title: "Test".to_owned(), ..scene };
    let run = describe(&scene, &RunOptions { clock: Clock::Virtual, seed: 1 }, session.plugins());
    let opened = flotor_session::telemetry::publish(directory, &scene, &run, session, stop);
    opened.expect("a scratch folder takes a socket")
}

/// Runs the scene published in a scratch folder; `before` meets the run before its first tick, `meanwhile` after every one.
fn run_watched<W>(
    clock: Clock,
    before: impl FnOnce(&Directory) -> W,
    mut meanwhile: impl FnMut(&mut W, &TickRecord),
) -> (String, u64, Outcome, W) {
    let scratch = Scratch::default();
    let directory = Directory::at(scratch.path().join("runs"));
    let (session, stop) = (prepared(clock, SCENE), StopSwitch::default());
    let publication = publish(&session, &directory, &stop);
    let mut watcher = before(&directory);
    let mut each = |record: &TickRecord| meanwhile(&mut watcher, record);
    let mut published = Published { publication, digest: TraceDigest::new(), ticks: 0, meanwhile: &mut each };
    let outcome = session.run(&mut published, &stop).expect("it runs");
    let Published { publication, digest, ticks, .. } = published;
    let started = Instant::now();
    publication.end("over", flotor_live::EndKind::InOrder);
    assert!(started.elapsed() < PATIENCE, "nobody holds up the end");
    (digest.finish(), ticks, outcome, watcher)
}

fn unwatched_digest() -> String {
    run_watched(Clock::Virtual, |_| (), |(), _| {}).0
}

fn connect(directory: &Directory) -> Client {
    Client::find(directory).unwrap_or_else(|error| panic!("the run can be watched: {error}"))
}

/// The answer to a request; ticks and the rest on the way are let go.
fn answer(client: &mut Client, ask: Ask) -> Answer {
    let number = client.request_client().ask(ask).expect("the host listens");
    let until = Instant::now() + PATIENCE;
    while Instant::now() < until {
        match client.next(Duration::from_millis(100)).expect("the host speaks") {
            Some(Event::Answer(answer)) if answer.number == number => return answer,
            _ => {}
        }
    }
    panic!("no answer to request {number}");
}

fn watch(directory: &Directory, every: u32) -> Client {
    let mut client = connect(directory);
    assert_eq!(answer(&mut client, Ask::Watch { every }).refused, None);
    client
}

fn watch_all(directory: &Directory) -> Client {
    watch(directory, 1)
}

fn set(plugin: &str, parameter: &str, value: &str) -> Ask {
    let [plugin, parameter, value] = [plugin, parameter, value].map(str::to_owned);
    Ask::Set { values: vec![SetValue { plugin, parameter, value }] }
}

/// Reads to the end of the run: records, dropped ones, other events.
fn rest(client: &mut Client) -> (Vec<TickRecord>, u64, Vec<Event>) {
    let (mut seen, mut lost, mut others) = (Vec::new(), 0, Vec::new());
    let until = Instant::now() + PATIENCE;
    while Instant::now() < until {
        match client.next(Duration::from_millis(100)) {
            Ok(Some(Event::Ticks { records, dropped })) => {
                seen.extend(records);
                lost = dropped;
            }
            Ok(Some(Event::End(end))) => {
                others.push(Event::End(end));
                return (seen, lost, others);
            }
            Ok(Some(event)) => others.push(event),
            Ok(None) => {}
            Err(error) => panic!("the host went without a word: {error}"),
        }
    }
    panic!("the end of the run was never told");
}

#[test]
fn a_client_sees_every_tick_or_knows_how_many_not() {
    let (digest, ticks, _, watcher) = run_watched(
        Clock::Virtual,
        |directory| {
            let mut client = watch_all(directory);
            std::thread::spawn(move || rest(&mut client))
        },
        |_, _| {},
    );
    let (seen, dropped, _) = watcher.join().expect("the watcher only watches");
    assert_eq!(seen.len() as u64 + dropped, ticks);
    assert!(seen.is_sorted_by(|a, b| a.tick < b.tick));
    assert_eq!(digest, unwatched_digest());
    if dropped == 0 {
        let mut of_watcher = TraceDigest::new();
        seen.iter().for_each(|record| of_watcher.update(record));
        assert_eq!(of_watcher.finish(), digest, "bit for bit");
    }
}

#[test]
fn a_frozen_a_killed_and_a_talkative_watcher_change_no_bit() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let frozen = run_watched(Clock::Virtual, watch_all, |_, _| {});
    assert_eq!(frozen.0, unwatched_digest(), "frozen: it never reads");

    let killed = run_watched(
        Clock::Virtual,
        |directory| Some(watch_all(directory)),
        |client, record| {
            if record.tick == 500 {
                client.take();
            }
        },
    );
    assert_eq!(killed.0, unwatched_digest(), "killed: it goes in the middle");

    let flooding = run_watched(
        Clock::Virtual,
        |directory| {
            let path = directory.runs().remove(0).path;
            let nonsense = UnixStream::connect(&path).expect("the socket is there");
            nonsense.set_write_timeout(Some(Duration::from_millis(10))).expect("a time-out is legal");
            (nonsense, watch_all(directory).request_client())
        },
        |(nonsense, request_client), record| {
            if record.tick % 10 == 0 {
                let _ = nonsense.write_all(&[0xff; 4096]); // a frame of 4 GiB: the host hangs up
                let _ = request_client.ask(set("spring", "no_such_parameter", "1"));
            }
        },
    );
    assert_eq!(flooding.0, unwatched_digest(), "flooding: malformed data, and requests that are refused");
}

#[test]
fn a_watcher_changes_parameters_and_is_told() {
    // Few enough ticks for the socket's own buffer: this watcher reads when all is over.
    let (_, _, _, (mut client, asked)) = run_watched(
        Clock::Virtual,
        |directory| {
            let mut client = watch(directory, 100);
            let bad = answer(&mut client, set("spring", "gamma", "20"));
            assert!(
                bad.refused.is_some_and(|reason| reason.contains("gamma_n")),
                "with the closest valid key"
            );
            let fixed = answer(&mut client, set("spring", "variant", "rod"));
            assert!(fixed.refused.is_some_and(|reason| reason.contains("while the loop runs")));
            let asked = answer(&mut client, set("spring", "gamma_n", "20"));
            (client, asked)
        },
        |_, _| {},
    );
    assert_eq!(asked.refused, None);
    let (_, _, others) = rest(&mut client);
    // Every step on the way there is told, the first before the second tick.
    let [Event::Change(first), .., Event::Change(change), Event::End(end)] = others.as_slice() else {
        panic!("{others:?}")
    };
    assert_eq!((change.parameter.as_str(), change.number), ("gamma_n", 20.0));
    assert_eq!((change.outcome, first.tick), (ChangeOutcome::Applied, 1));
    assert_eq!(end.words, "over");
}

#[test]
fn the_greeting_is_enough_for_a_panel_and_stays_true() {
    let (_, _, _, ()) = run_watched(
        Clock::Virtual,
        |directory| {
            let client = connect(directory);
            let greeting = client.greeting();
            assert_eq!((greeting.title.as_str(), greeting.process), ("Test", std::process::id()));
            assert_eq!(client.run().scene_toml, SCENE);
            let [device, spring] = greeting.plugins.as_slice() else { panic!("{greeting:?}") };
            assert_eq!((device.name.as_str(), spring.name.as_str()), ("device", "spring"));
            assert!(spring.file.is_file());
            let gamma = spring.parameters.iter().find(|known| known.id == "gamma_n").expect("it has one");
            assert!(
                gamma.live
                    && gamma.unit == "N"
                    && !gamma.doc.is_empty()
                    && gamma.value.parse::<f64>().is_ok()
            );
            assert!(
                greeting.limits.force_n.iter().all(Option::is_some),
                "the simulated flotor declares limits"
            );
        },
        |(), _| {},
    );
}

#[test]
fn the_emergency_stop_of_a_watcher_is_one() {
    let (_, ticks, outcome, _) = run_watched(
        Clock::Virtual,
        |directory| {
            let mut client = watch_all(directory);
            assert_eq!(answer(&mut client, Ask::EmergencyStop).refused, None);
            client
        },
        |_, _| {},
    );
    assert_eq!(outcome.end, RunEnd::EmergencyStop(EmergencySource::Watcher));
    assert_eq!(ticks, 1);
}

/// Of any program's making: it connects and says nothing.
fn idle(directory: &Directory) -> UnixStream {
    let run = directory.runs().into_iter().next().expect("there is a run");
    UnixStream::connect(run.path).expect("anybody may connect")
}

#[test]
fn who_only_occupies_the_socket_locks_no_emergency_stop_out() {
    let meet = |directory: &Directory| {
        let idle: Vec<UnixStream> = (0..40).map(|_| idle(directory)).collect();
        (idle, connect(directory), false)
    };
    let (_, ticks, outcome, _) = run_watched(Clock::Virtual, meet, |(_, client, pressed), _| {
        if !*pressed {
            *pressed = true;
            assert_eq!(answer(client, Ask::EmergencyStop).refused, None);
        }
    });
    assert_eq!(outcome.end, RunEnd::EmergencyStop(EmergencySource::Watcher));
    assert!(ticks < 2000, "{ticks}");
}

#[test]
fn one_watcher_too_many_is_told_and_can_still_press_the_emergency_stop() {
    let meet = |directory: &Directory| {
        let watching: Vec<Client> = (0..16).map(|_| watch(directory, 1000)).collect();
        let mut late = connect(directory);
        let refused = answer(&mut late, Ask::Watch { every: 1 }).refused.expect("sixteen are enough");
        assert_eq!(refused, "16 clients watch the run already, the maximum; close one of them");
        (watching, late, false)
    };
    let (_, _, outcome, _) = run_watched(Clock::Virtual, meet, |(_, client, pressed), _| {
        if !*pressed {
            *pressed = true;
            assert_eq!(answer(client, Ask::EmergencyStop).refused, None);
        }
    });
    assert_eq!(outcome.end, RunEnd::EmergencyStop(EmergencySource::Watcher));
}

#[test]
fn a_run_of_the_program_is_found_watched_and_stopped() {
    let scratch = Scratch::default();
    let runtime = scratch.path().display().to_string();
    let scene = scratch.patient_scene(flotor_session::scene::DEMO).display().to_string();
    let running = Flotor::with(["run", &scene, "--duration", "60s"]).env("XDG_RUNTIME_DIR", &runtime).start();
    let directory = Directory::at(scratch.path().join("flotor"));
    let mut client = patiently(|| Client::find(&directory).ok());
    assert_eq!(client.greeting().process, running.id());
    assert_eq!(answer(&mut client, Ask::Watch { every: 10 }).refused, None);
    let first = patiently(|| match client.next(Duration::from_millis(100)) {
        Ok(Some(Event::Ticks { records, .. })) => records.first().copied(),
        _ => None,
    });
    assert!(first.tick.is_multiple_of(10));
    assert_eq!(answer(&mut client, Ask::Stop).refused, None);
    let (_, _, others) = rest(&mut client);
    assert!(
        matches!(others.last(), Some(Event::End(end)) if end.words == "the run was stopped"),
        "{others:?}"
    );
    assert_eq!(running.wait().code, Some(exit_code::OK));
    assert_eq!(directory.runs(), [], "it cleans up after itself");
    assert!(matches!(Client::find(&directory), Err(LiveError::NoRun(_))));
}

#[test]
fn a_model_of_a_run_of_the_program_is_replaced_from_another_terminal() {
    let scratch = Scratch::default();
    let runtime = scratch.path().display().to_string();
    // A fade that outlasts the test: what comes after the first has to wait.
    let scene = scratch.patient_scene(&format!("{SCENE}[model.blend]\nfade_s = 60\n")).display().to_string();
    let running = Flotor::with(["run", &scene, "--duration", "60s"]).env("XDG_RUNTIME_DIR", &runtime).start();
    let directory = Directory::at(scratch.path().join("flotor"));
    let mut client = patiently(|| Client::find(&directory).ok());
    let swap = |arguments: &[&str]| {
        let arguments = ["swap"].iter().chain(arguments);
        Flotor::with(arguments).env("XDG_RUNTIME_DIR", &runtime).run()
    };
    let running_here = format!(
        "process 1 runs no session; give the process of a running session: {} \"untitled\"",
        client.greeting().process
    );
    for (arguments, told) in [
        (&["sprng"][..], "did you mean `spring`?"),
        (
            &["spring", "--set", "gama_n=3"],
            "--set gama_n: [spring] no parameter `gama_n`; did you mean `gamma_n`?",
        ),
        (&["spring", "--set", "gamma_n=zz"], "`gamma_n` must be a number in N, not `zz`"),
        (&["spring", "--plugin", "wal"], "--plugin: no model plugin `wal`; did you mean `wall`?"),
        (&["spring", "--run", "1"], &running_here),
    ] {
        let wrong = swap(arguments);
        assert_eq!(wrong.code, Some(exit_code::CONFIGURATION), "{wrong:?}");
        assert!(wrong.error().contains(told), "{wrong:?}");
    }
    let no_plugin = scratch.file("libmine.so", b"not a plugin").display().to_string();
    let refused = swap(&["spring", "--plugin", &no_plugin]);
    assert_eq!(refused.code, Some(exit_code::PLUGIN_REFUSED), "{refused:?}");
    let error = refused.error();
    assert!(error.starts_with("[spring] model unchanged: ") && error.contains("libmine.so"), "{error}");

    let swapped = swap(&["spring", "--plugin", "wall", "--set", "friction=0.2"]);
    assert_eq!(swapped.code, Some(exit_code::OK), "{swapped:?}");
    assert!(swapped.stdout.starts_with("`spring` is `wall` "), "{swapped:?}");
    let change = patiently(|| match client.next(Duration::from_millis(100)) {
        Ok(Some(Event::Change(change))) => Some(change),
        _ => None,
    });
    assert_eq!((change.subject, change.parameter.as_str()), (Subject::Plugin, "wall"));
    assert_eq!(change.settings, [("friction".to_owned(), "0.2".to_owned())]);
    assert!(swapped.stdout.ends_with(&format!("from tick {} on\n", change.tick)), "{swapped:?}");
    assert_eq!(answer(&mut client, set("spring", "stiffness_n_per_m", "500")).refused, None, "it is a wall");
    let busy = swap(&["spring"]);
    assert_eq!(busy.code, Some(exit_code::OTHER), "{busy:?}");
    assert!(busy.error().contains("still fading"), "{busy:?}");
    assert_eq!(answer(&mut client, Ask::Stop).refused, None);
    assert_eq!(running.wait().code, Some(exit_code::OK));
}

/// Who records a run that dies has what had come, and is told that it is not all.
#[test]
fn a_recording_of_a_run_that_is_killed_is_whole_so_far_and_ends_as_cut() {
    let scratch = Scratch::default();
    let runtime = scratch.path().display().to_string();
    let of_user = |flotor: Flotor| flotor.env("XDG_RUNTIME_DIR", &runtime).start();
    let scene = scratch.patient_scene(flotor_session::scene::DEMO).display().to_string();
    let running = of_user(Flotor::with(["run", &scene, "--duration", "60s"]));
    let directory = Directory::at(scratch.path().join("flotor"));
    patiently(|| Client::find(&directory).ok());
    let file = scratch.path().join("cut.mcap");
    let recording = of_user(Flotor::with(["record", "--out", &file.display().to_string()]));
    patiently(|| file.metadata().ok().filter(|file| file.len() > 200_000)); // schemas, scene, and some ticks
    running.signal_host(Signal::KILL);
    assert_eq!(running.wait().code, Some(exit_code::OTHER), "ended by a signal");
    let recorded = recording.wait();
    assert_eq!(recorded.code, Some(exit_code::OTHER), "{recorded:?}");
    assert!(
        recorded.stderr.contains("before the end of the run, so the recording is incomplete"),
        "{recorded:?}"
    );
    let ticks = Recording::open(&file).expect("it is finished").count();
    assert!(ticks > 0 && recorded.stdout.contains(&format!("{ticks} ticks")), "{ticks}: {recorded:?}");
}

#[test]
fn a_folder_that_cannot_be_used_costs_a_note_and_not_the_run() {
    let scratch = Scratch::default();
    std::fs::write(scratch.path().join("flotor"), "a file").expect("a scratch folder can be written to");
    let runtime = scratch.path().display().to_string();
    let ran = Flotor::with(["run", "--clock", "virtual", "--duration", "10ms"])
        .env("XDG_RUNTIME_DIR", &runtime)
        .run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stderr.contains("telemetry server not started"), "{ran:?}");
}

/// Memory does not grow while somebody who never reads is flooded with ticks.
#[test]
fn memory_is_bounded_while_a_frozen_watcher_is_fed() {
    let minutes = TestSize::of_this_run().pick(2, 60);
    let scratch = Scratch::default();
    let directory = Directory::at(scratch.path().join("runs"));
    let (session, stop) = (prepared(Clock::Virtual, SCENE), StopSwitch::default());
    let publication = publish(&session, &directory, &stop);
    let _frozen = watch_all(&directory);
    let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
    let feed = |seconds: usize, record: &mut TickRecord| {
        for _ in 0..seconds * 1000 {
            record.tick += 1;
            publication.observe(record);
        }
    };
    feed(10, &mut record);
    let before = resident_kib();
    feed(60 * minutes, &mut record);
    let grown = resident_kib().saturating_sub(before);
    // An hour of records is 1.1 GB; tests beside this one allocate in this process, too.
    assert!(grown < 64 * 1024, "{grown} KiB more after {minutes} minutes at 1 kHz");
}

fn resident_kib() -> u64 {
    let status = std::fs::read_to_string(Path::new("/proc/self/status")).expect("Linux tells");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("it has a size");
    line.trim().trim_end_matches("kB").trim().parse().expect("a number of KiB")
}

/// Tries until it works.
fn patiently<T>(mut attempt: impl FnMut() -> Option<T>) -> T {
    let until = Instant::now() + PATIENCE;
    while Instant::now() < until {
        if let Some(value) = attempt() {
            return value;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("it did not happen within {PATIENCE:?}");
}

/// Viewer and bridge are programs of their own; here both are scripts that write down what they were told.
#[test]
fn a_run_elsewhere_is_viewed_through_a_bridge_that_ends_with_the_viewer() {
    use std::os::unix::fs::PermissionsExt;
    let scratch = Scratch::default();
    let script = |name: &str, text: &str| {
        let file = scratch.file(name, format!("#!/bin/sh\ncd \"{}\"\n{text}\n", scratch.path().display()));
        std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o755)).expect("it is ours");
    };
    script("flotor-bridge", "echo $$ \"$@\" > bridge.new; mv bridge.new bridge\nexec sleep 60");
    script("flotor-viewer", "while ! [ -f bridge ]; do sleep 0.01; done\necho \"$@\" > viewer\nexit 3");
    let arguments =
        ["view", "zenoh/lab", "--connect", "tls/lab:7447", "--config", "ada.json5", "--look", "light"];
    let here = "cp \"$1\" \"$HERE/flotor\"; shift; exec \"$HERE/flotor\" \"$@\"";
    let ran =
        Flotor::with(arguments).env("HERE", &scratch.path().display().to_string()).through_shell(here).run();
    assert_eq!(ran.code, Some(3), "the viewer's own: {ran:?}");
    let told = |file: &str| std::fs::read_to_string(scratch.path().join(file)).expect("it was started");
    let bridge = told("bridge");
    let (process, for_bridge) = bridge.trim().split_once(' ').expect("a number and arguments");
    assert_eq!(for_bridge, "attach zenoh/lab --config ada.json5 --connect tls/lab:7447");
    assert_eq!(told("viewer").trim(), format!("--look light --run {process}"));
    assert!(!Path::new("/proc").join(process).exists(), "the bridge ends with the viewer");

    for [option, value] in
        [["--screenshot", "run.png"], ["--export", "run.csv"], ["--device", "left"], ["--at", "1"]]
    {
        let refused = Flotor::with(["view", "zenoh/lab", option, value]).run();
        assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{option}");
        assert!(refused.error().contains("flotor record zenoh/NAME"), "{refused:?}");
    }
}

#[test]
fn an_option_of_view_that_would_do_nothing_is_refused_before_the_viewer_starts() {
    let screen = ["--screenshot", "run.png", "--screen", "{}"];
    let traces = ["--export", "run.svg"];
    for (options, idle) in [
        (&traces[..], &["--at=1", "--scale=2", "--measure=5", "--arrow-force=20"][..]),
        (&screen, &["--traces=force", "--force-position=z", "--device=left", "--arrow-force=20"]),
    ] {
        for idle in idle {
            let words = [&["view", "missing.mcap", *idle], options].concat();
            let refused = Flotor::with(words).run();
            assert_eq!(refused.code, Some(exit_code::CONFIGURATION), "{idle}: {refused:?}");
            assert!(refused.stderr.contains("cannot be used with"), "{idle}: {refused:?}");
        }
    }
}

#[test]
fn files_made_of_a_recording_without_its_end_come_with_a_note() {
    let scratch = Scratch::default();
    let run = Flotor::with(["run", "--clock", "virtual", "--duration", "0.5s", "--record", "whole.mcap"]);
    assert_eq!(run.inside(scratch.path()).run().code, Some(0));
    let whole = std::fs::read(scratch.path().join("whole.mcap")).expect("it was recorded");
    let _ = scratch.file("cut.mcap", &whole[..whole.len() / 2]);
    for [option, out] in [["--export", "cut.csv"], ["--screenshot", "cut.png"]] {
        // The viewer itself may not have been built.
        let said = Flotor::with(["view", option, out, "cut.mcap"]).inside(scratch.path()).run();
        assert!(said.stderr.contains("the readable part"), "{option}: {said:?}");
        let said = Flotor::with(["view", option, out, "whole.mcap"]).inside(scratch.path()).run();
        assert!(!said.stderr.contains("the readable part"), "{option}: {said:?}");
    }
}
