//! The solid against tables made elsewhere, and against the laws no solid may break.

mod anywhere;
mod contact;
mod finer;
mod law;
mod mesh;
#[allow(unreachable_pub)] // shared with the other tests
#[path = "../../../tests/src/printed.rs"]
mod printed;
mod rows;
mod several;
mod solver;
#[path = "../../../tests/src/model_tables.rs"]
mod table;

use std::io::Write;

/// So many cases: at `FLOTOR_TEST_SIZE=full` all of them, else the first number.
fn cases(quick: usize, full: usize) -> usize {
    let is_full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
    if is_full { full } else { quick }
}

/// Whether a test that prepares a solid for seconds is left out; tells so, past the harness.
///
/// The variable is that of `flotor_tests::TestSize`; plugins depend on nothing else of the workspace, so it is read here.
fn leaves_out_long_tests() -> bool {
    let is_quick =
        !std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| ["daily", "full"].contains(&size.as_str()));
    if is_quick {
        let thread = std::thread::current();
        let _ = writeln!(
            std::io::stderr(),
            "skipped: {}: takes longer than others: `FLOTOR_TEST_SIZE=daily`, as in `.ci/run`, has it",
            thread.name().unwrap_or("a test")
        );
    }
    is_quick
}
