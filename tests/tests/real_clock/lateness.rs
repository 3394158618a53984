//! A model in a process of its own that answers late now and then.

use flotor_tests::TestSize;
use flotor_tests::library::compile_c_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::workspace_root;
use serde_json::Value;

#[test]
fn a_late_answer_from_another_process_costs_a_tick_and_not_the_run() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let _turn = crate::alone();
    let scratch = Scratch::default();
    // Later than its budget and before the next tick, in one tick of fifty.
    let late = "IN_STEP=if (input->tick % 50 == 49) { usleep(9000); }";
    let library = scratch.path().join("liblate.so");
    compile_c_file(&workspace_root().join("tests/c/model_that.c"), &[late], &library);
    let scene = format!(
        "rate_hz = 100\nduration_s = 1.5\n[device]\nplugin = \"simulated\"\n[[model]]\nplugin = {library:?}\n\
         isolation = \"process\"\nbudget_us = 8000\n[limits]\nwatchdog_ms = 60000\n"
    );
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let ran = Flotor::with(["run", &scene, "--json", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let summary: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    let overruns = summary["events"]["model_overrun"].as_u64().unwrap_or(0);
    assert!((1..50).contains(&overruns), "each is counted: {overruns}");
}
