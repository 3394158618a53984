//! The program starts and says what it is. As an integration test of this crate it also makes `cargo test` build
//! the program, which the tests of the workspace then run from beside the plugins.

use std::process::{Command, Output};

fn flotor(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_flotor")).args(arguments).output().expect("the program starts")
}

#[test]
fn the_version_is_that_of_the_crate() {
    let output = flotor(&["--version"]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stdout), concat!("flotor ", env!("CARGO_PKG_VERSION"), "\n"));
    assert!(output.stderr.is_empty());
}

#[test]
fn an_unknown_command_is_a_usage_error() {
    let output = flotor(&["levitate"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(output.stdout.is_empty());
    assert!(String::from_utf8_lossy(&output.stderr).contains("levitate"));
}
