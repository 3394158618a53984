//! The program starts and says what it is. As an integration test of this crate it also makes `cargo test` build
//! the program, which the tests of the workspace then run from beside the plugins.

use std::process::Command;

#[test]
fn the_version_is_that_of_the_crate() {
    let output = Command::new(env!("CARGO_BIN_EXE_flotor-lend"))
        .arg("--version")
        .output()
        .expect("the program starts");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&output.stdout), concat!("flotor ", env!("CARGO_PKG_VERSION"), "\n"));
}
