//! Demand: a run computes what reaches the hand and what an observer asks for, and an observer changes nothing for the hand.

use crate::golden::NOT_VIRTUAL;
use fixture_faulty_model::{ENERGY_N, FORCE_N, TORQUE_N};
use flotor_core::demand::{DemandRequest, ObserverDemand};
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{DVec3, Demand};
use flotor_live::{Ask, Client, Directory, Event};
use flotor_record::{Recorder, Recording, TraceDigest};
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::run_description::describe;
use flotor_session::scene::Scene;
use flotor_session::summary::{RunFacts, RunSummary, Tally};
use flotor_session::telemetry::{ObservedRun, publish};
use flotor_session::{Observer, RunOptions, Session, headless};
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::prepared;
use flotor_tests::workspace_root;
use serde_json::Value;
use std::path::Path;
use std::time::{Duration, Instant};

const FORCE_AND_ENERGY: Demand = Demand::FORCE.with(Demand::ENERGY);
const OPTIONS: RunOptions = RunOptions { clock: Clock::Virtual, seed: 1 };

/// Keeps every record, and asks for outputs.
struct Asking {
    demand: Demand,
    records: Vec<TickRecord>,
    digest: TraceDigest,
}

impl Asking {
    fn for_outputs(demand: Demand) -> Self {
        Self { demand, records: Vec::new(), digest: TraceDigest::new() }
    }
}

impl Observer for Asking {
    fn observe(&mut self, record: &TickRecord) {
        self.digest.update(record);
        self.records.push(*record);
    }

    fn demand(&self) -> Demand {
        self.demand
    }
}

/// A handle at rest with `axes` driven, on a model that fails as `fault` says.
fn scene(axes: &str, fault: &str) -> String {
    let [device, model] =
        ["fixture-faulty-device", "fixture-faulty-model"].map(|name| plugin_file(name).display().to_string());
    format!(
        "duration_s = 0.05\n[limits]\nramp_s = 0\nforce_n = [0, 0, 10]\n[device]\nplugin = {device:?}\nparameters = {{ axes = {axes:?} }}\n\
         [[model]]\nname = \"model\"\nplugin = {model:?}\nparameters = {{ fault = {fault:?} }}\n"
    )
}

fn run(session: Session, demand: Demand) -> Asking {
    let mut asking = Asking::for_outputs(demand);
    session.run(&mut asking, &StopSwitch::default()).expect("it runs");
    asking
}

/// Force of the model that returns its demand, N.
fn force_of(demand: Demand) -> f64 {
    let parts = [(Demand::FORCE, FORCE_N), (Demand::TORQUE, TORQUE_N), (Demand::ENERGY, ENERGY_N)];
    parts.iter().filter(|(part, _)| demand.contains(*part)).map(|(_, force_n)| force_n).sum()
}

// ---------------------------------------------------------------- what is computed

#[test]
fn a_model_is_asked_for_what_the_device_gives_and_observers_want_and_no_more() {
    for (axes, felt) in [("one", Demand::FORCE), ("three", Demand::FORCE), ("six", Demand::WRENCH)] {
        for wanted in [Demand::FORCE, Demand::WRENCH, FORCE_AND_ENERGY, Demand::ALL] {
            let records = run(prepared(Clock::Virtual, &scene(axes, "returns-demand")), wanted).records;
            assert_eq!(records.len(), 50);
            for record in records {
                assert_eq!(record.model.computed(), felt.with(wanted), "{axes} axes");
                assert_eq!(record.model.force().z, force_of(felt.with(wanted)), "{axes} axes");
            }
        }
    }
}

#[test]
fn a_scene_without_torque_asks_for_none_on_a_device_that_gives_some() {
    for torque_nm in ["0", "[0, 0, 0]"] {
        let limits = format!("[limits]\ntorque_nm = {torque_nm}\n");
        let text = scene("six", "returns-demand").replace("[limits]\n", &limits);
        for record in run(prepared(Clock::Virtual, &text), Demand::FORCE).records {
            assert_eq!(record.model.computed(), Demand::FORCE, "torque_nm = {torque_nm}");
            assert_eq!(record.model.force().z, FORCE_N, "torque_nm = {torque_nm}");
        }
    }
}

#[test]
fn an_output_is_computed_from_the_request_to_its_end() {
    let session = prepared(Clock::Virtual, &scene("three", "returns-demand"));
    let observers = session.observers();
    let mut lockstep = session.into_lockstep().expect("it starts");
    let mut asking = Asking::for_outputs(Demand::FORCE);
    let mut request = None;
    for tick in 0..40 {
        request = match tick {
            10 => Some(observers.request(Demand::ALL)),
            20 => None,
            _ => request,
        };
        lockstep.advance(&mut asking, &StopSwitch::default());
    }
    for record in asking.records {
        let wanted = if (10..20).contains(&record.tick) { Demand::ALL } else { Demand::FORCE };
        assert_eq!(record.model.computed(), wanted, "tick {}", record.tick);
        assert_eq!(record.model.force().z, force_of(wanted), "tick {}", record.tick);
    }
}

// ---------------------------------------------------------------- what an observer cannot do

#[test]
fn an_output_for_observers_that_is_not_finite_is_marked_for_them_and_reaches_no_hand() {
    let coupled = {
        let [one, model] = ["fixture-faulty-device", "fixture-faulty-model"]
            .map(|name| plugin_file(name).display().to_string());
        format!(
            "duration_s = 0.05\n[limits]\nramp_s = 0\n\
             [[device]]\nname = \"left\"\nplugin = {one:?}\nparameters = {{ axes = \"three\" }}\n\
             [[device]]\nname = \"right\"\nplugin = {one:?}\nparameters = {{ axes = \"three\" }}\n\
             [[model]]\ndevice = \"left\"\nplugin = {model:?}\nparameters = {{ fault = \"nan-beside-force\" }}\n\
             [[coupling]]\nend = [{{ device = \"left\" }}, {{ device = \"right\" }}]\n"
        )
    };
    for text in [scene("three", "nan-beside-force"), scene("one", "nan-beside-force"), coupled] {
        let [bare, observed] =
            [Demand::FORCE, Demand::ALL].map(|demand| run(prepared(Clock::Virtual, &text), demand));
        assert_eq!(bare.digest.finish(), observed.digest.finish());
        assert!(observed.records.iter().any(|record| record.commanded.force() != DVec3::ZERO));
        for record in observed.records.iter().filter(|record| record.device == 0) {
            assert!(record.model.torque().is_some_and(DVec3::is_nan), "{record:?}");
            assert!(record.model.energy_j().is_some_and(f64::is_nan), "{record:?}");
            assert!(!record.events.intersects(Events::MODEL_FAULT) && record.model.force().is_finite());
        }
    }
}

#[test]
fn a_felt_output_that_is_not_finite_is_no_answer_whoever_observes() {
    for demand in [Demand::FORCE, Demand::ALL] {
        let records = run(prepared(Clock::Virtual, &scene("six", "nan-beside-force")), demand).records;
        assert!(records.iter().all(|record| record.events.intersects(Events::MODEL_FAULT)));
        assert!(records.iter().all(|record| record.model.force() == DVec3::ZERO));
    }
}

/// The shipped scenes that run on the virtual clock, by file.
fn shipped_scenes() -> Vec<Scene> {
    let folder = std::fs::read_dir(workspace_root().join("host/scenes")).expect("it is there");
    let files = folder.map(|file| file.expect("it can be read").path());
    let is_virtual = |file: &Path| {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.strip_suffix(".toml").filter(|stem| !stem.ends_with(".test"));
        stem.is_some_and(|stem| !NOT_VIRTUAL.contains(&stem))
    };
    let scenes = files.filter(|file| is_virtual(file));
    let mut scenes: Vec<Scene> = scenes.map(|file| Scene::load(&file).expect("the scene is right")).collect();
    // Two seconds: a hand has touched everything that it will.
    scenes.iter_mut().for_each(|scene| scene.duration_s = scene.duration_s.min(2.0));
    scenes
}

fn session(scene: &Scene) -> Session {
    let session = Session::prepare(scene, &Registry::search(&[]), &OPTIONS).expect("the scene starts");
    session.latched_in(&Directory::at("/dev/null/no-folder"))
}

/// Waits until somebody, or nobody, asks for more than force.
fn until_asked(observers: &ObserverDemand, demand: Demand) {
    let begun = Instant::now();
    while observers.now() != demand {
        assert!(begun.elapsed() < Duration::from_secs(20), "the request of a client stays or never comes");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Connects a client that watches every tick.
fn client(directory: &Directory) -> Client {
    let mut client = Client::find(directory).expect("the run is published");
    let number = client.request_client().ask(Ask::Watch { every: 1 }).expect("the host listens");
    loop {
        match client.next(Duration::from_secs(20)).expect("the host answers") {
            Some(Event::Answer(answer)) if answer.number == number => return client,
            Some(_) => {}
            None => panic!("no answer"),
        }
    }
}

/// The digest of a run with a client of the telemetry server that comes and goes, and the demands seen.
fn digest_with_a_client(scene: &Scene) -> (String, Vec<Demand>) {
    let scratch = Scratch::default();
    let directory = Directory::at(scratch.path().join("runs"));
    let (session, stop) = (session(scene), StopSwitch::default());
    let description = describe(scene, &OPTIONS, session.plugins());
    let publication = publish(&directory, scene, &description, &session, &stop).expect("it is published");
    let observers = session.observers();
    let mut watched =
        ObservedRun { observer: Asking::for_outputs(Demand::FORCE), publication: Some(publication) };
    let mut lockstep = session.into_lockstep().expect("it starts");
    let mut watching = None;
    for tick in 0_u64.. {
        match tick % 400 {
            100 => {
                watching = Some(client(&directory));
                until_asked(&observers, Demand::ALL);
            }
            300 => {
                watching = None;
                until_asked(&observers, Demand::FORCE);
            }
            _ => {}
        }
        if lockstep.advance(&mut watched, &stop).is_some() {
            break;
        }
    }
    drop(watching);
    let computed = watched.observer.records.iter().map(|record| record.model.computed()).collect();
    (watched.observer.digest.finish(), computed)
}

#[test]
fn a_scene_has_one_digest_bare_observed_recorded_and_watched() {
    let scenes = shipped_scenes();
    assert!(scenes.len() >= 8, "{} scenes", scenes.len());
    for scene in &scenes {
        let bare = run(session(scene), Demand::FORCE);
        assert!(bare.records.iter().all(|record| record.model.energy_j().is_none()));
        let bare = bare.digest.finish();
        assert_eq!(run(session(scene), Demand::ALL).digest.finish(), bare, "{}: observed", scene.title);
        let scratch = Scratch::default();
        let file = scratch.path().join("run.mcap");
        let registry = Registry::search(&[]);
        let recorded = headless::run(scene, &registry, OPTIONS.seed, Some(&file), Demand::FORCE);
        assert_eq!(recorded.expect("it runs").trace_digest, bare, "{}: recorded", scene.title);
        let mut recording = Recording::open(&file).expect("it was recorded");
        // A scene with a membrane or a world has no energy, whoever asks for it.
        let has_none = ["\"membrane\"", "\"world\""].iter().any(|model| scene.text.contains(model));
        let all = if has_none { Demand::WRENCH } else { Demand::ALL };
        assert!(
            recording.all(|record| record.expect("it is whole").model.computed() == all),
            "{}",
            scene.title
        );
        let (watched, computed) = digest_with_a_client(scene);
        assert_eq!(watched, bare, "{}: watched", scene.title);
        assert!(computed.contains(&all));
        assert!(computed.iter().any(|demand| *demand != Demand::ALL), "{}: watched for a while", scene.title);
    }
}

/// The summary, without wall times, of a run on `axes` that clients watch from before the first tick to the last.
fn summary_with_clients(axes: &str, clients: usize) -> Value {
    let scratch = Scratch::default();
    let directory = Directory::at(scratch.path().join("runs"));
    let scene = Scene::parse(Path::new("scene.toml"), &scene(axes, "none")).expect("it is right");
    let (session, stop) = (session(&scene), StopSwitch::default());
    let (plugins, observers) = (session.plugins().to_vec(), session.observers());
    let description = describe(&scene, &OPTIONS, &plugins);
    let publication = publish(&directory, &scene, &description, &session, &stop).expect("it is published");
    let observer = Asking::for_outputs(Demand::FORCE);
    let mut watched = ObservedRun { observer, publication: Some(publication) };
    let watching: Vec<Client> = (0..clients).map(|_| client(&directory)).collect();
    until_asked(&observers, if clients > 0 { Demand::ALL } else { Demand::FORCE });
    let mut lockstep = session.into_lockstep().expect("it starts");
    while lockstep.advance(&mut watched, &stop).is_none() {}
    drop(watching);
    let mut tally = Tally::default();
    watched.observer.records.iter().for_each(|record| tally.observe(record));
    let facts = RunFacts {
        scene: &scene,
        options: &OPTIONS,
        plugins: &plugins,
        requested: watched.observer.demand,
        carried: &[],
        trace_digest: String::new(),
    };
    let summary = RunSummary::new(facts, &lockstep.finish(), &tally);
    let mut summary = serde_json::to_value(summary).expect("it is JSON");
    for measured in ["compute_ns", "stages_ns", "wall_s"] {
        summary[measured].take();
    }
    summary
}

#[test]
fn a_client_that_watches_from_the_first_tick_to_the_last_changes_nothing_in_the_summary() {
    for (axes, names) in [("six", vec!["energy"]), ("three", vec!["torque", "energy"])] {
        let bare = summary_with_clients(axes, 0);
        assert_eq!(bare["not_computed"], Value::from(names), "{bare}");
        assert_eq!(summary_with_clients(axes, 2), bare, "{axes} axes");
    }
}

// ---------------------------------------------------------------- what was not computed is absent

/// Records what another observer asks for.
struct Recorded {
    recorder: Recorder,
    demand: Demand,
}

impl Observer for Recorded {
    fn observe(&mut self, record: &TickRecord) {
        self.recorder.record(record).expect("there is room");
    }

    fn demand(&self) -> Demand {
        self.demand
    }
}

#[test]
fn a_replay_asks_for_what_its_recording_holds_and_compares_that() {
    for axes in ["one", "three", "six"] {
        for demand in [Demand::FORCE, FORCE_AND_ENERGY, Demand::ALL] {
            let scratch = Scratch::default();
            let file = scratch.path().join("run.mcap");
            let text = scene(axes, "returns-demand");
            let session = prepared(Clock::Virtual, &text);
            let scene = Scene::parse(Path::new("scene.toml"), &text).expect("the scene is right");
            let run = describe(&scene, &OPTIONS, session.plugins());
            let mut recorded =
                Recorded { recorder: Recorder::create(&file, &run).expect("there is room"), demand };
            session.run(&mut recorded, &StopSwitch::default()).expect("it runs");
            recorded.recorder.finish().expect("there is room");
            // The model's force is its demand: another demand is another force.
            let folder = plugin_file("fixture-faulty-model").parent().expect("it is in a folder").to_owned();
            let replay = Flotor::with(["replay", &file.display().to_string(), "--json", "-"]);
            let replay = replay.searching(&[&folder]).run();
            assert_eq!(replay.code, Some(exit_code::OK), "{axes} axes, {demand:?}: {replay:?}");
            let report: Value = serde_json::from_str(&replay.stdout).expect("it is JSON");
            assert_eq!((&report["bit_exact"], &report["ticks"]), (&true.into(), &50.into()));
        }
    }
}

#[test]
fn a_replay_tells_another_energy_beside_the_same_force() {
    let scratch = Scratch::default();
    let file = scratch.path().join("run.mcap");
    let text = scene("six", "wrong-energy");
    let scene = Scene::parse(Path::new("scene.toml"), &text).expect("the scene is right");
    headless::run(&scene, &Registry::search(&[]), 1, Some(&file), Demand::FORCE).expect("it runs");
    let report = |set: &[&str]| -> Value {
        let recording = file.display().to_string();
        let replay = Flotor::with([&["replay", &recording, "--json", "-"], set].concat());
        let folder = plugin_file("fixture-faulty-model").parent().expect("it is in a folder").to_owned();
        let replay = replay.searching(&[&folder]).run();
        assert_eq!(replay.code, Some(exit_code::OK), "{replay:?}");
        serde_json::from_str(&replay.stdout).expect("it is JSON")
    };
    let same = report(&[]);
    assert_eq!((&same["bit_exact"], &same["max_energy_j"]), (&true.into(), &0.0.into()), "{same}");
    let other = report(&["--set", "model.fault=none"]);
    assert_eq!((&other["differing_ticks"], &other["max_force_n"]), (&50.into(), &0.0.into()), "{other}");
}

/// The sum is unknown as soon as one model does not give its energy: it is absent, and not what the others store.
#[test]
fn energy_that_a_model_does_not_give_is_absent_from_recording_picture_and_summary() {
    let printed_law =
        "[[model]]\nname = \"printed\"\nplugin = \"spring\"\nparameters = { variant = \"thesis\" }\n";
    let spring = "duration_s = 0.05\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";
    for (text, is_given) in [(spring.to_owned(), true), (format!("{spring}{printed_law}"), false)] {
        let scratch = Scratch::default();
        let file = scratch.file("scene.toml", &text).display().to_string();
        let [recording, picture] = ["run.mcap", "run.svg"].map(|name| scratch.path().join(name));
        let [record, plot] = [&recording, &picture].map(|path| path.display().to_string());
        let words = ["run", &file, "--clock", "virtual", "--json", "-", "--record", &record, "--plot", &plot];
        let ran = Flotor::with(words).run();
        assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
        let summary: Value = serde_json::from_str(&ran.stdout).expect("it is JSON");
        let names = if is_given { vec![] } else { vec!["energy"] };
        assert_eq!(summary["not_computed"], Value::from(names), "{summary}");
        let records =
            Recording::open(&recording).expect("it is a recording").map(|record| record.expect("whole"));
        let given: Vec<bool> = records.map(|record| record.model.energy_j().is_some()).collect();
        assert_eq!(given, [is_given; 50]);
        let picture = std::fs::read_to_string(picture).expect("it was drawn");
        assert_eq!(picture.contains("Stored energy"), is_given, "a panel");
    }
}

#[test]
fn a_summary_names_what_was_not_computed_and_has_no_number_that_needs_it() {
    let scratch = Scratch::default();
    let summary = |axes: &str, more: &[&str]| -> (Value, String) {
        let file = scratch.file("scene.toml", scene(axes, "none")).display().to_string();
        let text = Flotor::with(["run", &file, "--clock", "virtual"]).run();
        assert_eq!(text.code, Some(exit_code::OK), "{text:?}");
        let always = ["run", &file, "--clock", "virtual", "--json", "-"];
        let json = Flotor::with([&always, more].concat()).run();
        assert_eq!(json.code, Some(exit_code::OK), "{json:?}");
        (serde_json::from_str(&json.stdout).expect("it is JSON"), text.stdout)
    };
    for (axes, names) in [("six", vec!["energy"]), ("three", vec!["torque", "energy"])] {
        let (json, text) = summary(axes, &[]);
        assert_eq!(json["not_computed"], Value::from(names.clone()), "{json}");
        assert!(json["energy"].get("loop_generated_j").is_none(), "{json}");
        assert!(text.contains(&format!("  not computed: {}\n", names.join(", "))), "{text}");
    }
    let recording = scratch.path().join("run.mcap").display().to_string();
    for all in [&["--record", &recording][..], &["--compute", "torque", "--compute", "energy"]] {
        let (json, _) = summary("three", all);
        assert_eq!(json["not_computed"], Value::from(Vec::<&str>::new()), "{json}");
    }
    for (output, other) in [("torque", "energy"), ("energy", "torque")] {
        let (json, _) = summary("three", &["--compute", output]);
        assert_eq!(json["not_computed"], Value::from(vec![other]), "{json}");
    }
}

#[test]
fn an_expectation_asks_for_the_outputs_that_its_number_needs() {
    let scratch = Scratch::default();
    let scene = "duration_s = 0.2\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";
    let _ = scratch.file("scene.toml", scene);
    let test = |expectation: &str| {
        let text = format!("scene = \"scene.toml\"\n[expect]\n{expectation}\n");
        let file = scratch.file("one.test.toml", text).display().to_string();
        Flotor::with(["test", &file]).inside(scratch.path()).run()
    };
    let passed = test("\"energy.loop_generated_j\" = { min = 0, max = 1 }");
    assert_eq!(passed.code, Some(exit_code::OK), "{passed:?}");
    let failed = test("\"energy.loop_generated_j\" = { min = 1, max = 2 }");
    assert_eq!(failed.code, Some(exit_code::OTHER), "{failed:?}");
    assert!(failed.stdout.contains("energy.loop_generated_j: expected 1 to 2, got "), "{failed:?}");
}

/// A request is of no use to a run that is over, and does no harm.
#[test]
fn a_request_outlives_its_run() {
    let session = prepared(Clock::Virtual, &scene("six", "none"));
    let request: DemandRequest = session.observers().request(Demand::ALL);
    let records = run(session, Demand::FORCE).records;
    assert!(records.iter().all(|record| record.model.computed() == Demand::ALL));
    drop(request);
}
