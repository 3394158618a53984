//! What finds a planted fault, and what does not: `c/planted/` has each, the table below says who finds it, the tests
//! compare both, and the table is a page of the book.
//!
//! After a change: `FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests planted`.

use flotor_tests::library::{compile_c_file, plugin_file};
use flotor_tests::program::Flotor;
use flotor_tests::scratch::Scratch;
use flotor_tests::{TestSize, workspace_root};
use rayon::prelude::*;
use serde_json::Value;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// What `flotor validate` says.
#[derive(Clone, Copy)]
enum Validate {
    /// This rule is violated.
    By(&'static str),
    /// No rule is, for this reason.
    Never(&'static str),
}

use Validate::{By, Never};

/// A fault, in words, and what finds it before a run.
type Row = (&'static str, &'static str, Validate);

const MODEL: &[Row] = &[
    ("loop_step", "endless loop in `step`", By("finite-near-home")),
    ("loop_create", "endless loop in `create`", By("defaults")),
    ("loop_destroy", "endless loop in `destroy`", By("defaults")),
    ("loop_prepare", "endless loop in `prepare`", By("finite-near-home")),
    ("loop_param", "endless loop in `set_parameter`", By("live-parameters")),
    ("segv", "null write in `step`", By("finite-near-home")),
    ("stack", "recursion without end", By("finite-near-home")),
    ("abort", "`abort()`", By("finite-near-home")),
    ("exit0", "`exit(0)` in `step`", By("finite-near-home")),
    ("exit3", "`exit(3)` in `step`", By("finite-near-home")),
    ("_exit0", "`_exit(0)`", By("finite-near-home")),
    ("exec", "executes another program", By("finite-near-home")),
    ("pthread_exit", "`pthread_exit` in `step`", By("finite-near-home")),
    ("kill_term", "sends SIGTERM to the process", By("defaults")),
    ("kill_int3", "sends three SIGINT to the process", By("defaults")),
    ("sigstop", "stops the process", By("finite-near-home")),
    ("write_host_stack", "writes over the stack", By("finite-near-home")),
    ("munmap_self", "unmaps its own code", By("finite-near-home")),
    ("big_stack", "7 MB of stack", By("independent")),
    ("double_answer", "unknown call status", By("finite-near-home")),
    ("energy_nan", "energy minus infinity", By("finite-near-home")),
    ("neg_status", "unknown status", By("finite-near-home")),
    ("null_out", "`create` gives a null instance", By("defaults")),
    ("refuse_nomsg", "refuses without a message", By("defaults")),
    ("refuse_badutf", "refuses with a message that is no text", By("defaults")),
    ("destroy_segv", "crash in `destroy`", By("defaults")),
    ("destroy_exit", "`exit(0)` in `destroy`", By("defaults")),
    ("atexit_loop", "endless loop at the end of the process", By("defaults")),
    ("dtor_segv", "crash in a destructor of the library", By("defaults")),
    ("thread_exit0", "`exit(0)` from a thread of its own", By("no-threads")),
    ("late_writer", "a thread writes into an output of before", By("no-threads")),
    ("null_deref_thread", "a thread crashes later", By("no-threads")),
    ("spawn100", "100 threads that spin", By("no-threads")),
    ("thread_prepare", "a thread from `prepare`", By("no-threads")),
    ("thread_destroy", "a thread from `destroy`", By("no-threads")),
    ("sleep900", "sleeps 900 µs a step", By("no-system-calls")),
    ("sleep5", "sleeps 5 ms a step", By("no-system-calls")),
    ("alloc1g", "allocates 1 GB a step", By("no-system-calls")),
    ("late_alloc", "allocates in the second step, and never again", By("no-system-calls")),
    ("fork_step", "forks in the second step", By("no-system-calls")),
    ("stdout", "prints in `step`", By("no-system-calls")),
    ("sigaltered_step", "ignores a signal from `step` on", By("no-system-calls")),
    ("change_table", "changes its function table at run time", By("live-parameters")),
    ("heap", "writes past a block of its own", By("inside-memory")),
    ("heap_read", "reads past a block of its own", By("inside-memory")),
    ("use_after_free", "reads a block that it has freed", By("inside-memory")),
    ("overrun_out", "writes past its output", By("inside-memory")),
    ("write_input", "writes into its input", By("inside-memory")),
    ("free_host", "frees memory of the host", By("inside-memory")),
    ("sighandlers", "installs handlers for all signals", By("host-untouched")),
    ("sigblock", "blocks all signals", By("host-untouched")),
    ("ftz", "sets flush-to-zero", By("host-untouched")),
    ("rounding", "rounds upward", By("host-untouched")),
    ("fpe_trap", "enables floating-point traps", By("host-untouched")),
    ("fork", "forks in `create`", By("host-untouched")),
    ("setitimer", "starts a timer with SIGALRM", By("host-untouched")),
    ("timer", "starts a timer of an hour", By("host-untouched")),
    ("closefds", "closes files of the host", By("host-untouched")),
    ("chdir", "changes the current folder", By("host-untouched")),
    ("umask", "changes the umask", By("host-untouched")),
    ("affinity", "binds the thread to one processor", By("host-untouched")),
    ("rlimit", "limits the size of files to 0", By("host-untouched")),
    ("nice_idle", "lowers its thread to SCHED_IDLE", By("host-untouched")),
    ("ptrace", "has itself traced", By("host-untouched")),
    ("env", "changes the environment", By("host-untouched")),
    ("longmsg", "a message of 4 000 000 000 bytes", By("extensions")),
    ("freed_text", "the same, of freed memory", By("extensions")),
    ("crash_reach", "crash in `workspace-bounds`", By("extensions")),
    ("crash_activity", "crash in `active-region`", By("extensions")),
    ("crash_field", "crash in `linear-field`", By("extensions")),
    ("crash_centerline", "crash in `centerline`", By("extensions")),
    ("crash_shape", "crash in `shape`", By("extensions")),
    ("shape_corner", "a triangle with a corner that there is not", By("extensions")),
    ("crash_details", "crash in `details`", By("extensions")),
    ("field_nan", "NaN in its local linear model", By("extensions")),
    ("crash_contacts", "crash in `contact-set`", By("extensions")),
    ("contacts_gap", "a contact whose gap is not that of its points", By("extensions")),
];

const DEVICE: &[Row] = &[
    ("loop_open", "endless loop in `open`", By("defaults")),
    ("loop_caps", "... in `capabilities`", By("capabilities")),
    ("loop_activate", "... in `activate`", By("lifecycle")),
    ("loop_read", "... in `read`", By("lifecycle")),
    ("loop_write", "... in `write`", By("lifecycle")),
    ("loop_stop", "... in `safe_stop`", By("safe-stop")),
    ("loop_deactivate", "... in `deactivate`", By("lifecycle")),
    ("loop_close", "... in `close`", By("defaults")),
    ("segv_read", "crash in `read`", By("lifecycle")),
    ("segv_write", "crash in `write`", By("lifecycle")),
    ("segv_stop", "crash in `safe_stop`", By("safe-stop")),
    ("segv_close", "crash in `close`", By("defaults")),
    ("exit_read", "`exit(0)` in `read`", By("lifecycle")),
    ("exit_stop", "`exit(0)` in `safe_stop`", By("safe-stop")),
    ("nan_pose", "NaN in the pose", By("lifecycle")),
    ("inf_twist", "infinite twist", By("lifecycle")),
    ("zero_quat", "quaternion of zeros", By("lifecycle")),
    ("big_quat", "quaternion of 1e10", By("lifecycle")),
    ("far_pose", "z = -1e30 m", By("lifecycle")),
    ("deliver_nan", "delivered wrench NaN", By("lifecycle")),
    ("cond_junk", "unknown condition bits", By("lifecycle")),
    ("unknown_cycle", "unknown answer of `read`", By("lifecycle")),
    ("write_fault", "fault in `write`", By("lifecycle")),
    ("write_stale", "`write` never takes a command", By("lifecycle")),
    ("read_stale", "no sample after the first", By("lifecycle")),
    ("time_lie", "samples of the year 2554", By("lifecycle")),
    ("time_zero", "every sample of time 0", By("lifecycle")),
    ("time_back", "samples that go back in time", By("lifecycle")),
    ("activate_fail", "`activate` fails", By("lifecycle")),
    ("deactivate_fail", "`deactivate` fails", By("lifecycle")),
    ("sleep_read", "`read` takes 3 ms", By("device-time")),
    ("activate_busy3s", "`activate` takes 3 s", By("device-time")),
    ("stop_slow", "`safe_stop` takes 2 s", By("device-time")),
    ("sleep_write", "`write` takes 3 ms", By("device-time")),
    ("caps_nan", "a limit NaN", By("capabilities")),
    ("caps_neg", "a limit negative", By("capabilities")),
    ("caps_inf", "limits infinite", By("capabilities")),
    ("caps_huge", "limits 1e308", By("capabilities")),
    ("caps_zero", "limits zero on driven axes", By("capabilities")),
    ("caps_zero_slew", "slew limit zero", By("capabilities")),
    ("caps_rate_swapped", "rates in the wrong order", By("capabilities")),
    ("caps_axes_junk", "axis bits 0xffffffff", By("capabilities")),
    ("caps_range0", "range zero on sensed axes", By("capabilities")),
    ("caps_change", "capabilities that differ from call to call", By("capabilities")),
    ("heap", "writes past a block of its own", By("inside-memory")),
    ("sighandlers", "installs handlers for signals in `activate`", By("host-untouched")),
    ("rounding", "rounds upward from `read` on", By("host-untouched")),
    (
        "stuck",
        "a pose that never moves",
        Never("a handle may rest, and a device without noise repeats its bits"),
    ),
    ("buttons_all", "all buttons pressed", Never("any buttons may be pressed")),
];

/// The library of `c/planted/NAME.c`.
fn compiled(scratch: &Scratch, name: &str) -> PathBuf {
    let library = scratch.path().join(format!("libplanted_{name}.so"));
    compile_c_file(&workspace_root().join("tests/c/planted").join(name).with_extension("c"), &[], &library);
    library
}

/// The rules that are violated with a fault, of all or of one.
fn violated(library: &Path, fault: &str, only: Option<&str>) -> Vec<String> {
    let set = format!("fault={fault}");
    let mut arguments = vec!["validate".to_owned(), library.display().to_string(), "--json".to_owned()];
    arguments.extend(["--timeout", "1500ms", "--set", &set].map(str::to_owned));
    arguments.extend(only.into_iter().flat_map(|rule| ["--only".to_owned(), rule.to_owned()]));
    let ran = Flotor::with(&arguments).run();
    let findings: Vec<Value> =
        serde_json::from_str(&ran.stdout).unwrap_or_else(|_| panic!("{fault}: {ran:#?}"));
    for message in findings.iter().filter_map(|finding| finding["violation"].as_str()) {
        assert!(!is_debug_text(message), "{fault}: {message}");
    }
    let rules = findings.iter().filter(|finding| !finding["violation"].is_null());
    rules.filter_map(|finding| Some(finding["rule"].as_str()?.to_owned())).collect()
}

/// Whether a message has a value as Rust's `Debug` prints it: a name in CamelCase with fields, or a variant with a value.
fn is_debug_text(message: &str) -> bool {
    let words =
        message.split([' ', ',', '[', '"']).filter(|word| word.starts_with(|c: char| c.is_ascii_uppercase()));
    let opens = |word: &str, brace| message.contains(&format!("{word} {brace}"));
    let is_camel = |word: &str| {
        word.chars().all(|c| c.is_ascii_alphanumeric()) && word.chars().any(|c| c.is_ascii_lowercase())
    };
    words.into_iter().any(|word| {
        let variant = word.split_once('(').map(|(name, _)| name);
        is_camel(word) && opens(word, '{') || variant.is_some_and(|name| !name.is_empty() && is_camel(name))
    })
}

#[test]
fn text_of_debug_is_told_from_messages() {
    for text in ["at Pose { position: [0.0] }", "it returned Some(3)", "ended: EmergencyStop(Latch)"] {
        assert!(is_debug_text(text), "{text}");
    }
    for text in
        ["at [0, 0, 1] m it returned 3 N", "`FLOTOR_X` (see DESIGN)", "SIGINT (2)", "NaN (not a number)"]
    {
        assert!(!is_debug_text(text), "{text}");
    }
}

/// One processor is what a thread is bound to on a machine that has no other.
fn can_show(fault: &str) -> bool {
    fault != "affinity" || std::thread::available_parallelism().is_ok_and(|processors| processors.get() > 1)
}

/// What is tried: at quick size the last fault of each rule and of none, at full size all.
fn tried(rows: &[Row], size: TestSize) -> Vec<Row> {
    let rule = |row: &Row| match row.2 {
        By(rule) => Some(rule),
        Never(_) => None,
    };
    let is_last = |(at, row): &(usize, &Row)| rows.iter().skip(at + 1).all(|later| rule(later) != rule(row));
    let rows = rows.iter().enumerate().filter(|row| size == TestSize::Full || is_last(row));
    rows.map(|(_, row)| *row).filter(|(fault, ..)| can_show(fault)).collect()
}

fn assert_as_in_the_table(name: &str, rows: &[Row]) {
    let scratch = Scratch::default();
    let library = compiled(&scratch, name);
    let size = TestSize::of_this_run();
    let wrong: Vec<String> = tried(rows, size)
        .par_iter()
        .filter_map(|(fault, _, expected)| match expected {
            // The rule alone; at full size all of them, as an author runs it.
            By(rule) => {
                let only = (size < TestSize::Full).then_some(*rule);
                let found = violated(&library, fault, only);
                let is_stopped_before = only.is_none() && !found.is_empty();
                let is_found = found.iter().any(|found| found == rule) || is_stopped_before;
                (!is_found).then(|| format!("{fault}: not by {rule}, but by {found:?}"))
            }
            Never(_) => {
                let found = violated(&library, fault, None);
                (!found.is_empty()).then(|| format!("{fault}: by {found:?}"))
            }
        })
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
    assert_eq!(violated(&library, "none", None), Vec::<String>::new(), "without a fault");
}

#[test]
fn validate_finds_the_faults_of_models_that_the_table_says() {
    assert_as_in_the_table("model", MODEL);
}

#[test]
fn validate_finds_the_faults_of_devices_that_the_table_says() {
    assert_as_in_the_table("device", DEVICE);
}

/// A script in the background ignores Ctrl-C, and so does whatever it starts.
#[test]
fn a_model_that_sends_signals_is_found_where_the_shell_ignores_them() {
    let scratch = Scratch::default();
    let library = compiled(&scratch, "model").display().to_string();
    for fault in ["kill_int3", "kill_term"] {
        let set = format!("fault={fault}");
        let ran = Flotor::with(["validate", &library, "--only", "defaults", "--set", &set]);
        let ran = ran.through_shell("trap '' INT TERM; \"$@\"").run();
        assert!(ran.stdout.contains("the process died by signal"), "{fault}: {ran:#?}");
    }
}

/// The faults that a source of `c/planted/` knows: the words in `X(...)`.
fn planted(name: &str) -> BTreeSet<String> {
    let file = workspace_root().join("tests/c/planted").join(name).with_extension("c");
    let source = std::fs::read_to_string(file).expect("a source is text");
    let list = source.split("PLANTED_SCHEMA").next().unwrap_or_default();
    let words = list.split(" X(").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0.to_owned()));
    words.filter(|word| word != "none").collect()
}

#[test]
fn every_planted_fault_is_in_the_table_once() {
    for (name, rows) in [("model", MODEL), ("device", DEVICE)] {
        let told: BTreeSet<String> = rows.iter().map(|(fault, ..)| (*fault).to_owned()).collect();
        assert_eq!(told, planted(name), "{name}");
        assert_eq!(told.len(), rows.len(), "{name}: a fault is told twice");
    }
}

/// In Rust the boundary catches a panic: no crash, but an instance that answers nothing any more.
#[test]
fn a_panic_in_any_extension_is_found_with_its_message() {
    let library = plugin_file("fixture-panicking-model");
    assert_eq!(violated(&library, "none", None), Vec::<String>::new());
    for place in fixture_panicking_model::FAULTS.into_iter().filter(|place| *place != "none") {
        let set = format!("fault={place}");
        let library = library.display().to_string();
        let ran = Flotor::with(["validate", &library, "--only", "extensions", "--set", &set]).run();
        let says = if place == "reset" { "reset failed".to_owned() } else { format!("{place} gave up") };
        assert!(ran.stdout.contains("FAILED  extensions") && ran.stdout.contains(&says), "{place}: {ran:#?}");
    }
}

// ---------------------------------------------------------------- the page of the book

/// Faults whose end depends on the moment: a timer, a thread, memory of the machine.
const TIMED: [&str; 7] =
    ["alloc1g", "closefds", "null_deref_thread", "setitimer", "sleep5", "spawn100", "thread_exit0"];

/// How a short run with the fault ends, as the page says it.
fn in_a_run(scratch: &Scratch, name: &str, library: &Path, fault: &str) -> String {
    if TIMED.contains(&fault) {
        return "depends on the moment".to_owned();
    }
    let planted = format!("plugin = {library:?}\nparameters = {{ fault = \"{fault}\" }}\n");
    // A model is alone in its process, and nobody waits for a clock; a device is in the loop, on the machine's clock.
    let (scene, clock) = match name {
        "model" => (
            format!(
                "[device]\nplugin = \"simulated\"\n[[model]]\nname = \"planted\"\nisolation = \"process\"\n{planted}"
            ),
            "virtual",
        ),
        _ => (
            format!("[[model]]\nplugin = \"spring\"\n[limits]\nwatchdog_ms = 3000\n[device]\n{planted}"),
            "real",
        ),
    };
    let file = scratch.file(&format!("{name}-{fault}.toml"), scene).display().to_string();
    // A call before the run has a minute; here it has less.
    let run =
        Flotor::with(["run", &file, "--clock", clock, "--duration", "100ms"]).env("FLOTOR_CALL_LIMIT_S", "5");
    let ran = run.through_shell("timeout --signal=KILL 30 \"$@\"").run();
    // A device has its name in the scene; that nothing stops it if the host is killed is told in every run.
    let mut told = ran.stderr.lines().filter(|line| !line.starts_with("note:"));
    let is_named = told.any(|line| line.contains("planted") || line.contains("`device`"));
    match ran.code {
        Some(0) if is_named => "named, exit code 0".to_owned(),
        Some(0) => "no error".to_owned(),
        Some(137) => "hangs".to_owned(),
        Some(code @ 128..) => format!("dies by signal {}", code - 128),
        Some(code) if is_named => format!("named, exit code {code}"),
        Some(code) => format!("exit code {code}, not named"),
        None => "no exit code".to_owned(),
    }
}

fn table(name: &str, rows: &[Row], last: &str, run: impl Fn(&str) -> String + Sync) -> String {
    let mut text = format!("| Fault | | `flotor validate` | {last} |\n|---|---|---|---|\n");
    let lines: Vec<String> = rows
        .par_iter()
        .map(|(fault, words, expected)| {
            let found = match expected {
                By(rule) => format!("`{rule}`"),
                Never(reason) => format!("never: {reason}"),
            };
            format!("| `{fault}` | {words} | {found} | {} |", run(fault))
        })
        .collect();
    let _ = writeln!(text, "{}\n", lines.join("\n"));
    let found = rows.iter().filter(|(.., expected)| matches!(expected, By(_))).count();
    let _ = writeln!(text, "`validate` finds {found} of {} faults of a {name}.\n", rows.len());
    text
}

fn page(run: impl Fn(&str, &str) -> String + Sync) -> String {
    let model = table("model", MODEL, "In a run, in a process of its own", |fault| run("model", fault));
    let device = table("device", DEVICE, "In a run", |fault| run("device", fault));
    format!(
        "<!-- Made by `FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests planted`. -->\n\n\
         # Faults and what finds them\n\n\
         Faults that a plugin can have beside wrong numbers, each planted in a plugin (`tests/c/planted/`), and what finds it:\n\
         before a run `flotor validate`, by the [rule](plugin-contract.md) in the third column; in a run the host. The tests\n\
         compare both with this page.\n\n\
         *No error* means that the run ends as without the fault, at most with events in its report: what the plugin did stays\n\
         in its process, or changes nothing that a host can see. The [envelope](safety-envelope.md) limits every wrench whatever\n\
         a plugin does; the [safety case](safety-case.md) says what a process that dies leaves behind. A fault that comes after\n\
         minutes only, or at one pose of a million, is found by nobody before it comes.\n\n\
         ## Faults of a model\n\n{model}## Faults of a device\n\n{device}"
    )
}

const PAGE: &str = "docs/src/plugin-faults.md";

/// A line without its last column.
fn without_run(line: &str) -> &str {
    let line = line.strip_suffix(" |").unwrap_or(line);
    if line.starts_with("| `") { line.rsplit_once(" | ").map_or(line, |(kept, _)| kept) } else { line }
}

/// Every day the columns that this file says; at full size, and when the page is written, also what runs do.
#[test]
fn the_book_has_the_table() {
    let path = workspace_root().join(PAGE);
    let does_write = std::env::var_os("FLOTOR_WRITE_REFERENCE").is_some();
    let does_run = does_write || TestSize::of_this_run() == TestSize::Full;
    let scratch = Scratch::default();
    let libraries = ["model", "device"].map(|name| (name, compiled(&scratch, name)));
    let told = page(|name, fault| {
        let library = libraries.iter().find(|(of, _)| *of == name).map(|(_, library)| library);
        library.filter(|_| does_run).map_or(String::new(), |library| in_a_run(&scratch, name, library, fault))
    });
    if does_write {
        std::fs::write(&path, &told).expect("the book can be written");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let differs =
        |(was, is): &(&str, &str)| if does_run { was != is } else { without_run(was) != without_run(is) };
    let different: Vec<(&str, &str)> = committed.lines().zip(told.lines()).filter(differs).collect();
    let advice = "FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests planted";
    assert!(
        different.is_empty() && committed.lines().count() == told.lines().count(),
        "{advice}: {different:#?}"
    );
}
