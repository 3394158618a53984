//! The program as `flotor emulate` starts it. With a test of its own cargo builds it beside the tests of `tests/tests/system/services.rs`.

use std::process::Command;

#[test]
fn the_program_names_its_ports() {
    let program = env!("CARGO_BIN_EXE_flotor-haply-service-emulator");
    let output = Command::new(program).arg("--help").output().expect("it starts");
    let help = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && help.contains("10001") && help.contains("10020"), "{help}");
}
