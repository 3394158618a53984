//! Shared libraries for tests of the loader: plugins built by cargo, patched copies of their bytes, and libraries compiled from C
//! by the test.

use flotor_hal::abi::PluginKind;
use flotor_judge::validate::Check;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns cargo's output folder of this build, with the programs; libraries are in its subfolder `deps`.
///
/// # Panics
/// If the test program is not in the folder `deps` of cargo.
#[must_use]
pub fn build_folder() -> PathBuf {
    let own = std::env::current_exe().expect("a running test has a file");
    let deps = own.parent().expect("cargo runs tests from a folder");
    deps.parent().expect("and that folder is `deps`").to_path_buf()
}

/// Returns the number of rules that `flotor validate` checks for a device.
#[must_use]
pub fn rules_of_a_device() -> usize {
    Check::all().filter(|check| check.applies_to(PluginKind::Device)).count()
}

/// Returns the path of the library of a plugin crate of this workspace, which is a dependency of the tests and built with them.
///
/// # Panics
/// If the library is missing.
#[must_use]
pub fn plugin_file(package: &str) -> PathBuf {
    let name = format!(
        "{}{}{}",
        std::env::consts::DLL_PREFIX,
        package.replace('-', "_"),
        std::env::consts::DLL_SUFFIX
    );
    let file = build_folder().join("deps").join(name);
    assert!(file.is_file(), "{} is missing: is the crate a dev-dependency of flotor-tests?", file.display());
    file
}

/// Reads the library of a plugin crate and returns its bytes.
///
/// # Panics
/// If the library is missing or cannot be read.
#[must_use]
pub fn plugin_bytes(package: &str) -> Vec<u8> {
    std::fs::read(plugin_file(package)).expect("a library that is there can be read")
}

/// Returns `bytes` with the single occurrence of `old` replaced by `new`.
///
/// # Panics
/// If `old` does not occur exactly once, or the lengths differ: offsets in the file would become invalid.
#[must_use]
pub fn patched(mut bytes: Vec<u8>, old: &[u8], new: &[u8]) -> Vec<u8> {
    assert_eq!(old.len(), new.len(), "a patch keeps the length");
    let found: Vec<usize> =
        bytes.windows(old.len()).enumerate().filter(|(_, window)| *window == old).map(|(at, _)| at).collect();
    let [at] = found.as_slice() else { panic!("{old:?} occurs {} times", found.len()) };
    bytes.splice(*at..at + old.len(), new.iter().copied());
    bytes
}

/// Compiles C source text to the shared library `library` with `cc`; writes the source beside it.
///
/// # Panics
/// If the source cannot be written, there is no compiler, or it reports an error or a warning.
pub fn compile_c(source: &str, library: &Path) {
    let file = library.with_extension("c");
    std::fs::write(&file, source).expect("a scratch folder can be written to");
    compile_c_file(&file, &[], library);
}

/// Compiles the C file `file` to the shared library `library` with `cc`. `macros`: macros to define, `NAME` or `NAME=VALUE`.
///
/// # Panics
/// If there is no compiler, or it reports an error or a warning.
pub fn compile_c_file(file: &Path, macros: &[&str], library: &Path) {
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]);
    compiler.arg("-I").arg(crate::workspace_root().join("hal/include")).arg("-o").arg(library).arg(file);
    compiler.args(macros.iter().map(|name| format!("-D{name}")));
    let output = compiler.output().expect("a C compiler is installed; the README asks for one");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
