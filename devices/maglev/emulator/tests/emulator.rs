//! Emulator as a program: error messages for wrong arguments. (Tests with a host: `tests/tests/system/maglev.rs` of the
//! workspace.)

use std::process::{Command, Output};

fn run(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_flotor-maglev-emulator"));
    command.args(arguments).output().expect("the emulator starts")
}

#[test]
fn it_explains_itself() {
    let help = run(&["--help"]);
    assert!(help.status.success());
    let help = String::from_utf8(help.stdout).unwrap();
    for word in ["--transport", "--listen", "--pace", "--set", "Examples:"] {
        assert!(help.contains(word), "{word} is missing in {help}");
    }
}

#[test]
fn wrong_arguments_cost_one_line() {
    let output = run(&["--plant", "/no/such/plugin.so"]);
    assert_eq!(output.status.code(), Some(2));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(
        error.starts_with("error: ") && error.contains("/no/such/plugin.so") && error.lines().count() == 1
    );
}
