//! No process is left when a command is killed while a plugin hangs, and a step that does not return is named.

use flotor_record::{Ending, Recording};
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, Ran, Running, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required};
use flotor_tests::{TestSize, workspace_root};
use rustix::process::{Pid, Signal, kill_process, kill_process_group};
use serde_json::Value;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// A folder with a scene of a model that hangs in tick 70, and a test of it.
struct Hanging {
    folder: Scratch,
    model: PathBuf,
}

impl Hanging {
    /// `how` is a statement that does not return. The file `hangs` is there from the hang on.
    fn by(how: &str) -> Self {
        let folder = Scratch::default();
        let model = folder.path().join("libhangs.so");
        let mark = folder.path().join("hangs");
        let habit = format!("IN_STEP=if (input->tick == 70) {{ fclose(fopen({mark:?}, \"w\")); {how} }}");
        compile_c_file(&workspace_root().join("tests/c/model_that.c"), &[&habit], &model);
        let scene = format!(
            "duration_s = 0.2\n[device]\nplugin = \"simulated\"\n[[model]]\nname = \"jelly\"\nplugin = {model:?}\n"
        );
        let felt = format!("{scene}[[model]]\nplugin = \"spring\"\n");
        let _ = folder.file("scene.toml", scene);
        let _ = folder.file("felt.toml", felt);
        let _ = folder.file("program.sh", PROGRAM);
        let _ = folder.file(
            "hangs.test.toml",
            "scene = \"scene.toml\"\nvalidate = true\nstress = \"short\"\n[expect]\npeak_force_n = { min = 0 }\n",
        );
        Self { folder, model }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn flotor(&self, arguments: &[&str]) -> Flotor {
        self.numbered(arguments, 0)
    }

    /// `MODEL` stands for the model, and `DATA` for a folder of that number.
    fn numbered(&self, arguments: &[&str], number: usize) -> Flotor {
        let arguments = arguments.iter().map(|word| match *word {
            "MODEL" => self.model.display().to_string(),
            "DATA" => format!("data-{number}"),
            word => word.to_owned(),
        });
        Flotor::with(arguments).inside(self.path())
    }
}

/// Returns the processes in a folder: commands of a test and all that they have started.
fn processes_in(folder: &Path) -> Vec<String> {
    let own = folder.canonicalize().expect("it is there");
    let entries = std::fs::read_dir("/proc").expect("/proc is there").flatten();
    let inside = entries
        .filter(|process| std::fs::read_link(process.path().join("cwd")).is_ok_and(|folder| folder == own));
    // The command line of a process that has ended is empty.
    let words = inside.filter_map(|process| std::fs::read_to_string(process.path().join("cmdline")).ok());
    words.map(|words| words.replace('\0', " ")).filter(|words| !words.is_empty()).collect()
}

/// Waits until no process is in a folder; returns the time it took.
fn no_process_is_left_in(folder: &Path, what: &str) -> Duration {
    let since = Instant::now();
    loop {
        let left = processes_in(folder);
        if left.is_empty() {
            return since.elapsed();
        }
        assert!(since.elapsed() < FOR_EVER, "{what} left running: {left:#?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Time after which a process is taken for one that never ends.
const FOR_EVER: Duration = Duration::from_secs(120);

/// How a command ends.
#[derive(Clone, Copy, Debug)]
enum End {
    /// SIGKILL to the process that was started.
    Kill,
    /// SIGTERM to it.
    Term,
    /// Ctrl-C: SIGINT to its process group.
    Interrupt,
}

impl End {
    fn bring_about(self, command: &Running) {
        match self {
            Self::Kill => command.signal(Signal::KILL),
            Self::Term => command.signal(Signal::TERM),
            Self::Interrupt => kill_process_group(command.pid(), Signal::INT).expect("it is ours"),
        }
    }
}

/// A program that ignores every request to end, as its child and grandchild do: one waits, one spins.
const PROGRAM: &str =
    "trap '' TERM INT HUP\n(while :; do sleep 600; done) &\n: >hangs\nwhile :; do :; done\n";

/// Each would go on for minutes.
const COMMANDS: [&[&str]; 6] = [
    &["lend", "--api", "ml-api", "--listen", "127.0.0.1:0", "--", "sh", "program.sh"],
    &["run", "scene.toml", "--clock", "virtual"],
    &["test", "hangs.test.toml"],
    &["validate", "MODEL", "--timeout", "600s"],
    &["stress", "--model", "MODEL", "--timeout", "600s"],
    &["study", "jnd", "--scene", "felt.toml", "--out", "DATA"],
];

/// A spin, and a wait.
const HANGS: [&str; 2] = ["{ for (;;) {} }", "hang();"];

#[test]
fn nothing_is_left_of_a_command_that_is_killed_while_a_model_hangs() {
    if !required(Tool::Cc) {
        return;
    }
    take_interrupts();
    let kills = TestSize::of_this_run().pick(6, 200);
    std::thread::scope(|scope| {
        // As many commands at a time as a small machine has processors: half of them spin.
        for commands in COMMANDS.chunks(3) {
            scope.spawn(move || commands.iter().for_each(|command| kill_again_and_again(command, kills)));
        }
    });
}

/// Kills a command at instants spread over the time from its start to some time after its hang; expects no process afterwards.
fn kill_again_and_again(command: &[&str], kills: usize) {
    let hanging = HANGS.map(Hanging::by);
    let started = |scene: &Hanging, number| {
        scene.numbered(command, number).env("FLOTOR_STEP_LIMIT_S", "600").leading_a_group().start()
    };
    let ends = |scene: &Hanging, started: Running, end: End, what: &str| {
        end.bring_about(&started);
        let took = no_process_is_left_in(scene.path(), what);
        let ended = started.wait();
        assert_ne!(ended.code, Some(exit_code::CONFIGURATION), "{what}: {ended:?}");
        took
    };
    let since = Instant::now();
    let first = started(&hanging[0], kills);
    soon(&format!("{command:?} hangs"), || hanging[0].path().join("hangs").exists());
    let until_it_hangs = since.elapsed();
    assert!(processes_in(hanging[0].path()).len() > 1, "{command:?} has no process of its own");
    let mut slowest = ends(&hanging[0], first, End::Kill, &format!("{command:?}, hanging"));
    for number in 0..kills {
        let end = [End::Kill, End::Term, End::Interrupt][number % 3];
        let scene = &hanging[number / 3 % 2];
        let started = started(scene, number);
        // Spread evenly, without a period of its own: the golden section.
        let share = (number as f64 * 0.618_034).fract();
        std::thread::sleep(until_it_hangs.mul_f64(1.5 * share));
        slowest = slowest.max(ends(scene, started, end, &format!("{command:?} {end:?} after {share}")));
    }
    let name = command[0];
    println!(
        "{name}: hangs after {until_it_hangs:.2?}; 0 of {kills} kills left a process; the last one ended after {slowest:.2?} at most"
    );
}

/// Commands that run the plugin in a process of its own.
const ISOLATING: [&[&str]; 4] = [
    &["run", "isolated.toml", "--clock", "virtual"],
    &["test", "hangs.test.toml"],
    &["validate", "MODEL", "--timeout", "600s"],
    &["stress", "--model", "MODEL", "--timeout", "600s"],
];

/// Processes that a plugin has started end with the command, too, even if they ignore every request to end.
#[test]
fn nothing_is_left_of_a_plugin_that_starts_processes() {
    if !required(Tool::Cc) {
        return;
    }
    let hanging =
        Hanging::by("{ signal(SIGTERM, SIG_IGN); signal(SIGHUP, SIG_IGN); (void)!fork(); hang(); }");
    let scene = std::fs::read_to_string(hanging.path().join("scene.toml")).expect("it is written");
    let _ = hanging.folder.file("isolated.toml", scene + "isolation = \"process\"\n");
    for command in ISOLATING {
        let _ = std::fs::remove_file(hanging.path().join("hangs"));
        let started = hanging.flotor(command).env("FLOTOR_STEP_LIMIT_S", "600").leading_a_group().start();
        soon(&format!("{command:?} hangs"), || hanging.path().join("hangs").exists());
        End::Kill.bring_about(&started);
        no_process_is_left_in(hanging.path(), &format!("{command:?}"));
        assert_ne!(started.wait().code, Some(exit_code::CONFIGURATION), "{command:?}");
    }
}

/// Lets commands of this process take SIGINT, which it may have inherited as ignored itself: `exec` restores the default action of a
/// signal that has a handler.
fn take_interrupts() {
    let end = Arc::new(AtomicBool::new(true));
    signal_hook::flag::register_conditional_shutdown(Signal::INT.as_raw(), 130, end).expect("a handler");
}

/// A shell starts its commands in the background so.
#[test]
fn an_interrupt_ends_a_command_that_was_started_with_interrupts_ignored() {
    let scratch = Scratch::default();
    for command in [
        &["study", "jnd", "--out", "data"][..],
        &["stress", "--model", "spring"],
        &["bench"],
        &["run", "--clock", "virtual", "--duration", "10h"],
    ] {
        let flotor = Flotor::with(command).through_shell("trap '' INT\nexec \"$@\"");
        let mut started = flotor.inside(scratch.path()).leading_a_group().start();
        soon("interrupts are taken", || !ignores_interrupts(&started));
        End::Interrupt.bring_about(&started);
        soon(&format!("{command:?} has ended"), || started.try_wait().expect("it is ours").is_some());
    }
}

fn ignores_interrupts(process: &Running) -> bool {
    let status = std::fs::read_to_string(format!("/proc/{}/status", process.pid().as_raw_nonzero()));
    let status = status.expect("it runs");
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:")).expect("a line");
    let ignored = u64::from_str_radix(ignored.trim(), 16).expect("a set of signals");
    ignored >> (Signal::INT.as_raw() - 1) & 1 == 1
}

/// Waits until it is so.
fn soon(what: &str, mut is_so: impl FnMut() -> bool) {
    let since = Instant::now();
    while !is_so() {
        assert!(since.elapsed() < FOR_EVER, "not so: {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A stimulus may be felt for as long as one likes.
#[test]
fn a_request_to_stop_ends_a_study_in_the_middle_of_a_trial() {
    let scratch = Scratch::default();
    let study = ["study", "jnd", "--subjects", "1", "--feel", "1000000s", "--out", "data"];
    let mut started = Flotor::with(study).inside(scratch.path()).leading_a_group().start();
    let log = scratch.path().join("data/sourcedata");
    soon("the study has begun", || log.exists());
    started.signal(Signal::TERM);
    soon("the study has ended", || started.try_wait().expect("it is ours").is_some());
    let ran = started.wait();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("continue with --resume"), "{ran:?}");
}

/// A daemon is meant to go on; whoever ends the program has to know of it.
#[test]
fn a_process_that_leaves_the_group_of_a_lent_program_is_named() {
    let scratch = Scratch::default();
    let program = "setsid sh -c 'echo $$ >daemon.new; mv daemon.new daemon; exec sleep 600' >/dev/null 2>&1 &
                   until [ -e daemon ]; do sleep 0.01; done";
    let lend = ["lend", "--api", "ml-api", "--listen", "127.0.0.1:0", "--", "sh", "-c", program];
    let ran = Flotor::with(lend).inside(scratch.path()).run();
    let daemon = std::fs::read_to_string(scratch.path().join("daemon")).expect("it has started");
    let daemon = daemon.trim().parse().ok().and_then(Pid::from_raw).expect("a number");
    kill_process(daemon, Signal::KILL).expect("it goes on");
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let named = format!("`sleep` (process {}) has left the process group", daemon.as_raw_nonzero());
    assert!(ran.stderr.contains(&named), "{ran:?}");
}

/// A program that ignores every request to end and suspends the service: the child of `lend` that is not the guard of the program.
const SUSPENDS_ITS_SERVICE: &str = "trap '' TERM INT HUP
lend=$(cut -d ' ' -f 4 /proc/$PPID/stat)
for child in $(cat /proc/$lend/task/$lend/children); do
    [ \"$child\" = \"$PPID\" ] || kill -STOP \"-$child\"
done
echo >suspended
while :; do sleep 600; done
";

#[test]
fn a_service_that_does_not_end_is_killed_with_the_program_and_named() {
    let scratch = Scratch::default();
    let lend = ["lend", "--api", "ml-api", "--listen", "127.0.0.1:0", "--json", "run.json", "--"];
    let lend = lend.into_iter().chain(["sh", "-c", SUSPENDS_ITS_SERVICE]);
    let mut started = Flotor::with(lend).inside(scratch.path()).leading_a_group().start();
    soon("the service is suspended", || scratch.path().join("suspended").exists());
    started.signal(Signal::TERM);
    soon("lend has ended", || started.try_wait().expect("it is ours").is_some());
    let ran = started.wait();
    assert!(ran.stderr.contains("the service did not end in time after the request to stop"), "{ran:?}");
    let summary = std::fs::read_to_string(scratch.path().join("run.json")).expect("it is written");
    let summary: Value = serde_json::from_str(&summary).expect("it is JSON");
    assert!(summary["end"].as_str().is_some_and(|end| end.contains("was killed")), "{summary:#}");
    no_process_is_left_in(scratch.path(), "flotor lend");
}

#[test]
fn a_program_that_cannot_be_started_leaves_no_service_and_no_folder() {
    let scratch = Scratch::default();
    let program = scratch.file("program", "#!/no/such/interpreter\n");
    std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("it is ours");
    let temporary = scratch.path().join("temporary");
    std::fs::create_dir(&temporary).expect("an empty folder takes another");
    let lend = ["lend", "--api", "ml-api", "--listen", "127.0.0.1:0", "--", "./program"];
    let lend = Flotor::with(lend).inside(scratch.path()).env("TMPDIR", &temporary.display().to_string());
    let ran = lend.run();
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:?}");
    assert!(ran.stderr.contains("cannot be started"), "{ran:?}");
    no_process_is_left_in(scratch.path(), "flotor lend");
    let left = std::fs::read_dir(&temporary).expect("it is there").flatten();
    let left: Vec<_> = left.map(|entry| entry.file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().starts_with("flotor-lend")), "{left:?}");
}

#[test]
fn a_test_of_a_model_that_hangs_leaves_nothing_when_it_ends() {
    if !required(Tool::Cc) {
        return;
    }
    let hanging = Hanging::by(HANGS[0]);
    let test = ["test", "hangs.test.toml", "--timeout", "1s"];
    let ran = hanging.flotor(&test).env("FLOTOR_STEP_LIMIT_S", "600").run();
    assert_eq!(ran.code, Some(exit_code::OTHER), "{ran:#?}");
    assert!(ran.stdout.contains("the process did not end within 1 s, and was killed"), "{}", ran.stdout);
    no_process_is_left_in(hanging.path(), "flotor test");
}

// ---------------------------------------------------------------- a name

/// The line that names the step.
fn named(ran: &Ran, limit: &str) -> bool {
    ran.stderr.contains(&format!("`jelly` did not return from `step` in tick 70 within {limit}"))
}

#[test]
fn a_step_that_does_not_return_on_the_virtual_clock_is_named_and_costs_neither_recording_nor_summary() {
    if !required(Tool::Cc) {
        return;
    }
    for (how, limit) in
        HANGS.into_iter().zip(["0.1 s of processor time", "1 s, without measured use of a processor"])
    {
        let hanging = Hanging::by(how);
        let run = ["run", "scene.toml", "--clock", "virtual", "--record", "run.mcap", "--json", "run.json"];
        let ran = hanging.flotor(&run).env("FLOTOR_STEP_LIMIT_S", "0.1").run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
        assert!(named(&ran, limit), "{ran:#?}");
        let summary = std::fs::read_to_string(hanging.path().join("run.json")).expect("it is written");
        let summary: Value = serde_json::from_str(&summary).expect("it is JSON");
        assert_eq!(summary["end"], "watchdog", "{summary:#}");
        let mut recording = Recording::open(&hanging.path().join("run.mcap")).expect("a recording");
        let ticks: Vec<u64> = recording.by_ref().map(|record| record.expect("it is whole").tick).collect();
        assert_eq!(ticks, (0..70).collect::<Vec<_>>(), "every tick before that one");
        assert_eq!(recording.ending(), Ending::Finished);
    }
}

#[test]
fn a_test_and_the_judges_name_a_step_that_does_not_return() {
    if !required(Tool::Cc) {
        return;
    }
    let hanging = Hanging::by(HANGS[0]);
    let ran = |arguments: &[&str]| hanging.flotor(arguments).env("FLOTOR_STEP_LIMIT_S", "0.1").run();
    let tested = ran(&["test", "hangs.test.toml"]);
    assert_eq!(tested.code, Some(exit_code::OTHER), "{tested:#?}");
    for line in [
        "end: expected finished, got watchdog: `jelly` did not return from `step` in tick 70 within 0.1 s of processor time",
        // The shortest run that has the fault.
        "flotor run scene.toml --clock virtual --seed 1 --duration 0.07s",
        "rule reset-repeats: ",
    ] {
        assert!(tested.stdout.contains(line), "{line}: {}", tested.stdout);
    }
    let step = "`step` did not return in tick 70 within 0.1 s of processor time";
    let validated = ran(&["validate", "MODEL"]);
    assert_eq!(validated.code, Some(exit_code::PLUGIN_REFUSED), "{validated:#?}");
    assert!(validated.stdout.contains(step), "{}", validated.stdout);
    let stressed = ran(&["stress", "--model", "MODEL"]);
    assert_eq!(stressed.code, Some(exit_code::PLUGIN_REFUSED), "{stressed:#?}");
    assert!(stressed.stdout.contains("`step` did not return in tick"), "{}", stressed.stdout);
}

#[test]
fn a_study_names_a_step_that_does_not_return() {
    if !required(Tool::Cc) {
        return;
    }
    let hanging = Hanging::by(HANGS[0]);
    let study = ["study", "jnd", "--subjects", "1", "--scene", "felt.toml", "--out", "data"];
    let ran = hanging.flotor(&study).env("FLOTOR_STEP_LIMIT_S", "0.1").run();
    assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{ran:#?}");
    assert!(named(&ran, "0.1 s of processor time"), "{ran:#?}");
}

/// As Python runs a scene.
#[test]
fn a_run_inside_another_program_ends_with_the_name_of_the_step() {
    if !required(Tool::Cc) {
        return;
    }
    let hanging = Hanging::by(HANGS[0]);
    let scene = flotor_session::scene::Scene::load(&hanging.path().join("scene.toml")).expect("a scene");
    let recording = hanging.path().join("run.mcap");
    let registry =
        flotor_session::registry::Registry::search(&[flotor_tests::library::build_folder().join("deps")]);
    let ran =
        flotor_session::headless::run(&scene, &registry, 1, Some(&recording), flotor_hal::Demand::FORCE);
    let Err(error) = ran else { panic!("a model hangs, and the run ends well") };
    assert_eq!(
        error.to_string(),
        "`jelly` did not return from `step` in tick 70 within 1 s of processor time (set `FLOTOR_STEP_LIMIT_S` to raise the limit)"
    );
    assert!(Recording::open(&recording).expect("a recording").all(|record| record.is_ok()));
}
