//! The C header is what the Rust sources say, and C and C++ compilers take it without a word.
//!
//! After a change of the contract: `FLOTOR_WRITE_HEADER=1 cargo test -p flotor-tests --features formats header`.

use flotor_hal::abi::{CONTRACT, FieldLayout, LAYOUTS};
use flotor_tests::tools::{Tool, required};
use flotor_tests::{files_under, workspace_root};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Sources of the contract beside the extensions, those that hold structs first used first.
const SOURCES: [&str; 10] = [
    "frame.rs",
    "refusal.rs",
    "parameter.rs",
    "model.rs",
    "device.rs",
    "abi/text.rs",
    "abi/layout.rs",
    "abi/entry.rs",
    "abi/model.rs",
    "abi/device.rs",
];

fn hal() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../hal")
}

fn generate() -> String {
    let config = cbindgen::Config::from_file(hal().join("cbindgen.toml"))
        .expect("hal/cbindgen.toml is a configuration");
    let extensions = files_under("hal/src/extension", "rs").expect("there are extensions");
    let sources = SOURCES.iter().map(|source| Path::new("hal/src").join(source)).chain(extensions);
    let sources = sources.fold(cbindgen::Builder::new().with_config(config), |builder, source| {
        builder.with_src(workspace_root().join(source))
    });
    let mut header = Vec::new();
    sources.generate().expect("the contract can be said in C").write(&mut header);
    let header = without_struct_constants(&String::from_utf8(header).expect("a header is text"));
    header.replace("GENERATED_NAMES", &names()).replace("GENERATED_LAYOUTS", &layouts())
}

/// Version of the contract, and the ids of interfaces and extensions as the sources name them.
fn names() -> String {
    let mut text = format!(
        "/* Version of the contract, for the metadata. */\n#define FLOTOR_CONTRACT \"{CONTRACT}\"\n\
         /* Names of interfaces and extensions. */"
    );
    for id in interface_ids() {
        let name = id["flotor.".len()..id.len() - "/1".len()].replace('-', "_").to_uppercase();
        text += &format!("\n#define FLOTOR_INTERFACE_{name} \"{id}\"");
    }
    text
}

fn interface_ids() -> Vec<String> {
    let mut ids = Vec::new();
    for file in files_under("hal/src", "rs").expect("the contract has sources") {
        let source = std::fs::read_to_string(workspace_root().join(file)).expect("a source is text");
        ids.extend(source.lines().filter_map(|line| {
            Some(line.strip_prefix("table!(")?.split_once(": \"")?.1.split_once('"')?.0.to_owned())
        }));
    }
    ids
}

/// The rows of the contract's layout table, for a C compiler to fill in.
fn layouts() -> String {
    let row = |row: &FieldLayout| match row.name().split_once('.') {
        None => format!("    FLOTOR_STRUCT({}),", row.name()),
        Some((name, "default")) => format!("    FLOTOR_FIELD_CALLED({name}, \"default\", default_),"), // a word of C
        Some((name, field)) => format!("    FLOTOR_FIELD({name}, {field}),"),
    };
    LAYOUTS.iter().map(row).collect::<Vec<_>>().join("\n")
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
        "hal/include/flotor.h is out of date: FLOTOR_WRITE_HEADER=1 cargo test -p flotor-tests --features formats header"
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
