//! Shared libraries to load: the plugins cargo has built, copies of them with other bytes, and C compiled on
//! the spot.

use flotor_hal::abi::PluginKind;
use flotor_judge::validate::Check;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Where cargo puts this build: the folder with the programs; libraries are in `deps` below it.
///
/// # Panics
/// If the tests do not run from a folder cargo has made.
#[must_use]
pub fn build_folder() -> PathBuf {
    let own = std::env::current_exe().expect("a running test has a file");
    let deps = own.parent().expect("cargo runs tests from a folder");
    deps.parent().expect("and that folder is `deps`").to_path_buf()
}

/// How many rules `flotor validate` checks of a device.
#[must_use]
pub fn rules_of_a_device() -> usize {
    Check::all().filter(|check| check.applies_to(PluginKind::Device)).count()
}

/// The library of a plugin crate of this workspace, built with the tests because they depend on it.
///
/// # Panics
/// If it is not there.
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

/// The bytes of the library of a plugin crate.
///
/// # Panics
/// If it cannot be read.
#[must_use]
pub fn plugin_bytes(package: &str) -> Vec<u8> {
    std::fs::read(plugin_file(package)).expect("a library that is there can be read")
}

/// The same bytes with the one occurrence of `old` replaced by `new`.
///
/// # Panics
/// If `old` occurs never or twice, or `new` has another length: offsets in the file would no longer hold.
#[must_use]
pub fn patched(mut bytes: Vec<u8>, old: &[u8], new: &[u8]) -> Vec<u8> {
    assert_eq!(old.len(), new.len(), "a patch keeps the length");
    let found: Vec<usize> =
        bytes.windows(old.len()).enumerate().filter(|(_, window)| *window == old).map(|(at, _)| at).collect();
    let [at] = found.as_slice() else { panic!("{old:?} occurs {} times", found.len()) };
    bytes.splice(*at..at + old.len(), new.iter().copied());
    bytes
}

/// Compiles C source text to a shared library with the system's compiler.
///
/// # Panics
/// If there is no compiler, or it has anything to say: warnings are errors.
pub fn compile_c(source: &str, library: &Path) {
    let file = library.with_extension("c");
    std::fs::write(&file, source).expect("a scratch folder can be written to");
    compile_c_file(&file, &[], library);
}

/// Compiles a C file to a shared library, with macros defined.
///
/// # Panics
/// As [`compile_c`].
pub fn compile_c_file(file: &Path, macros: &[&str], library: &Path) {
    let mut compiler = Command::new("cc");
    compiler.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-shared", "-fPIC"]);
    compiler.arg("-I").arg(crate::workspace_root().join("hal/include")).arg("-o").arg(library).arg(file);
    compiler.args(macros.iter().map(|name| format!("-D{name}")));
    let output = compiler.output().expect("a C compiler is installed; the README asks for one");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
