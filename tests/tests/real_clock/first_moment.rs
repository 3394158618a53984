//! A thread of a plugin that ends the process while the run starts, before the host's own handlers stand: the command fails, and
//! says why.

use flotor_tests::TestSize;
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::side_by_side::show_each;
use flotor_tests::workspace_root;
use std::path::Path;

/// A run of 2 s whose model has a thread that ends the process so many milliseconds after the model is made.
fn run(scratch: &Scratch, library: &Path, death: &str, at_ms: u32, duration_s: f64) -> Ran {
    let scene = format!(
        "duration_s = {duration_s}\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"{}\"\nisolation = \"none\"\n",
        library.display()
    );
    let scene = scratch.file(&format!("{death}-{at_ms}.toml"), scene);
    let flotor = Flotor::with(["run".as_ref(), scene.as_os_str()]);
    flotor.env("FIXTURE_DEATH", death).env("FIXTURE_AT_MS", &at_ms.to_string()).run()
}

fn library(scratch: &Scratch) -> std::path::PathBuf {
    let library = scratch.path().join("libdies_early.so");
    compile_c_file(&workspace_root().join("tests/c/dies_early.c"), &[], &library);
    library
}

#[test]
fn a_thread_that_ends_the_process_at_the_start_never_passes_for_success() {
    let _turn = crate::among_idle_ones();
    let scratch = Scratch::default();
    let library = library(&scratch);
    let step_ms = TestSize::of_this_run().pick(35, 5);
    let deaths = ["exit", "_exit", "exec", "abort", "segv"];
    let cases: Vec<_> =
        (0..140).step_by(step_ms).flat_map(|at_ms| deaths.map(|death| (death, at_ms))).collect();
    show_each(&cases, |(death, at_ms)| {
        let ran = run(&scratch, &library, death, *at_ms, 2.0);
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{death} after {at_ms} ms: {ran:?}");
        let is_named = |line: &str| line.starts_with("error: ") && line.contains("ended");
        assert!(ran.stderr.lines().any(is_named), "{death} after {at_ms} ms: {ran:?}");
    });
}

#[test]
fn a_thread_that_ends_nothing_is_no_failure() {
    let _turn = crate::among_idle_ones();
    let scratch = Scratch::default();
    let library = library(&scratch);
    let ran = run(&scratch, &library, "none", 0, 0.2);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(!ran.stderr.contains("error: "), "{ran:?}");
}

#[test]
fn a_plugin_that_loops_at_the_end_of_the_process_delays_the_exit_code_and_does_not_change_it() {
    let _turn = crate::among_idle_ones();
    let scratch = Scratch::default();
    let library = library(&scratch);
    let ran = run(&scratch, &library, "atexit-loop", 0, 0.2);
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    assert!(ran.stdout.contains("digest"), "{ran:?}");
}
