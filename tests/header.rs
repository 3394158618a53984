//! The C header is what the Rust sources say, and C and C++ compilers take it without a word.
//!
//! After a change of the contract: `FLOTOR_WRITE_HEADER=1 cargo test -p flotor-tests --test header`.

use flotor_tests::tools::{Tool, required};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Sources of the contract, those that hold structs first used first.
const SOURCES: [&str; 21] = [
    "frame.rs",
    "refusal.rs",
    "parameter.rs",
    "model.rs",
    "shape.rs",
    "activity.rs",
    "field.rs",
    "reach.rs",
    "variant.rs",
    "detail.rs",
    "device.rs",
    "calibration.rs",
    "abi/text.rs",
    "abi/entry.rs",
    "abi/force.rs",
    "abi/field.rs",
    "abi/reach.rs",
    "abi/device.rs",
    "abi/calibration.rs",
    "abi/metadata.rs",
    "abi/mod.rs",
];

fn hal() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../hal")
}

fn generate() -> String {
    let config = cbindgen::Config::from_file(hal().join("cbindgen.toml"))
        .expect("hal/cbindgen.toml is a configuration");
    let sources = SOURCES.iter().fold(cbindgen::Builder::new().with_config(config), |builder, source| {
        builder.with_src(hal().join("src").join(source))
    });
    let mut header = Vec::new();
    sources.generate().expect("the contract can be said in C").write(&mut header);
    without_struct_constants(&String::from_utf8(header).expect("a header is text"))
}

/// cbindgen makes compound literals of the associated constants of structs. No static table of a C plugin may hold
/// one, and some name constants that C does not get: they are left out, with the comments above them. What C needs
/// of them is in the trailer, as numbers.
fn without_struct_constants(header: &str) -> String {
    let mut kept: Vec<&str> = Vec::new();
    for line in header.lines() {
        if line.starts_with("#define Flotor") && line.contains(" (Flotor") {
            while kept.last().is_some_and(|line| line.starts_with("//")) {
                kept.pop();
            }
        } else {
            kept.push(line);
        }
    }
    kept.join("\n") + "\n"
}

#[test]
fn the_committed_header_is_what_the_sources_say() {
    let path = hal().join("include/flotor.h");
    let generated = generate();
    if std::env::var_os("FLOTOR_WRITE_HEADER").is_some() {
        std::fs::write(&path, &generated).expect("the header can be written");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == generated,
        "hal/include/flotor.h is out of date: FLOTOR_WRITE_HEADER=1 cargo test -p flotor-tests --test header"
    );
}

/// Compiles a file that includes the header and nothing else of this repository.
fn compiles(compiler: &str, standard: &str, file_name: &str) {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let source = folder.path().join(file_name);
    std::fs::write(
        &source,
        "#include \"flotor.h\"\nint main(void) { return (int)sizeof(FlotorEntry) == 0; }\n",
    )
    .expect("the source can be written");
    let output = Command::new(compiler)
        .args([standard, "-Wall", "-Wextra", "-Werror", "-pedantic", "-c", "-o"])
        .arg(folder.path().join("out.o"))
        .arg("-I")
        .arg(hal().join("include"))
        .arg(&source)
        .output();
    let output = output.unwrap_or_else(|error| panic!("{compiler} is needed for this test: {error}"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_c_compiler_takes_it_without_a_word() {
    compiles("cc", "-std=c11", "user.c");
}

#[test]
fn a_cpp_compiler_takes_it_without_a_word() {
    if !required(Tool::Cxx) {
        return;
    }
    compiles("c++", "-std=c++17", "user.cc");
}
