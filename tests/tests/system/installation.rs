//! Where an installed program finds its plugins, and which folders it does not trust.

use flotor_tests::library::{build_folder, plugin_bytes, plugin_file};
use flotor_tests::process::Owned;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::{crate_name_of, plugin_folders, workspace_root};
use rustix::process::geteuid;
use std::io::{BufRead, BufReader};
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// A user that owns nothing here.
const NOBODY: u32 = 65534;

/// The program alone, as an archive puts it into `bin/`.
fn installed(scratch: &Scratch) -> PathBuf {
    let program = scratch.folder("bin").join("flotor");
    std::fs::copy(build_folder().join("flotor"), &program).expect("the program is built");
    program
}

/// Copies the plugins of the demo into a folder, which is made.
fn with_plugins(folder: &Path) {
    std::fs::create_dir_all(folder).expect("a scratch folder can be written to");
    for name in ["flotor-simulated", "flotor-spring"] {
        let library = plugin_file(name);
        let name = library.file_name().expect("a library has a name");
        std::fs::copy(&library, folder.join(name)).expect("a library can be copied");
    }
}

/// The demo, from a folder that has nothing to do with the installation.
fn demo(program: &Path, home: &Path) -> Command {
    let mut command = Command::new(program);
    command.args(["run", "--clock", "virtual", "--duration", "50ms"]).current_dir("/");
    command.env_remove("FLOTOR_PLUGIN_PATH").env_remove("XDG_DATA_HOME").env("HOME", home);
    command.env("XDG_RUNTIME_DIR", home);
    command
}

fn ran(mut command: Command) -> Output {
    command.output().expect("the program starts")
}

#[test]
fn an_installed_program_finds_its_plugins_from_any_folder() {
    let scratch = Scratch::default();
    let program = installed(&scratch);
    let home = scratch.folder("home");
    let without = ran(demo(&program, &home));
    assert_eq!(without.status.code(), Some(exit_code::CONFIGURATION), "{without:?}");
    with_plugins(&scratch.path().join("lib/flotor/plugins"));
    let with = ran(demo(&program, &home));
    assert_eq!(with.status.code(), Some(exit_code::OK), "{with:?}");
    let printed = String::from_utf8_lossy(&with.stdout);
    assert!(printed.contains("/lib/flotor/plugins/") && !printed.contains("/../"), "{printed}");
}

#[test]
fn an_installed_emulator_finds_its_flotor() {
    let scratch = Scratch::default();
    let program = scratch.folder("bin").join("flotor-maglev-emulator");
    std::fs::copy(build_folder().join("flotor-maglev-emulator"), &program).expect("the program is built");
    let emulator = || {
        let mut command = Command::new(&program);
        command.args(["--transport", "pty"]).env_remove("FLOTOR_PLUGIN_PATH");
        command
    };
    let without = ran(emulator());
    assert!(!without.status.success(), "{without:?}");
    with_plugins(&scratch.path().join("lib/flotor/plugins"));
    let mut emulated = Owned::start(emulator().stdout(Stdio::piped()));
    let mut line = String::new();
    let output = emulated.stdout.take().expect("it is piped");
    BufReader::new(output).read_line(&mut line).expect("a line");
    assert!(line.starts_with("listening"), "{line}");
}

#[test]
fn the_plugins_of_a_users_data_folder_are_found_but_not_by_root() {
    let scratch = Scratch::default();
    let program = installed(&scratch);
    let home = scratch.folder("home");
    with_plugins(&home.join(".local/share/flotor/plugins"));
    let own = ran(demo(&program, &home));
    if !geteuid().is_root() {
        assert_eq!(own.status.code(), Some(exit_code::OK), "{own:?}");
        return;
    }
    assert_eq!(own.status.code(), Some(exit_code::CONFIGURATION), "{own:?}");
    // The same as somebody else, who owns the folder.
    for folder in [scratch.path(), &program] {
        std::fs::set_permissions(folder, std::fs::Permissions::from_mode(0o755)).expect("it is ours");
    }
    for folder in ["", ".local", ".local/share", ".local/share/flotor", ".local/share/flotor/plugins"] {
        chown(home.join(folder), Some(NOBODY), None).expect("root may");
    }
    let mut command = demo(&program, &home);
    command.uid(NOBODY).gid(NOBODY);
    let nobody = ran(command);
    assert_eq!(nobody.status.code(), Some(exit_code::OK), "{nobody:?}");
}

#[test]
fn a_folder_of_somebody_else_is_not_searched_and_the_reason_is_reported() {
    if !geteuid().is_root() {
        println!("skipped: only root can give a folder away");
        return;
    }
    let scratch = Scratch::default();
    let foreign = scratch.folder("foreign");
    with_plugins(&foreign);
    let listed = || Flotor::with(["plugins"]).searching(&[&foreign]).run().stdout;
    assert!(listed().contains("foreign/libflotor_spring.so"), "{}", listed());
    chown(&foreign, Some(NOBODY), None).expect("root may");
    let listed = listed();
    assert!(listed.contains("not searched: user 65534 owns the folder"), "{listed}");
    assert!(!listed.contains("foreign/libflotor_spring.so"), "{listed}");
}

#[test]
fn the_wheel_contains_every_plugin() {
    let manifest = workspace_root().join("interop/python/Cargo.toml");
    let manifest = std::fs::read_to_string(manifest).expect("it is there");
    for folder in plugin_folders() {
        let dependency = format!("{} = {{ path = \"../../{folder}\" }}", crate_name_of(&folder));
        assert!(manifest.lines().any(|line| line == dependency), "the wheel lacks {folder}: {dependency}");
    }
}

#[test]
fn two_files_with_one_id_in_one_folder_are_refused_with_both_names() {
    let scratch = Scratch::default();
    let files = ["liba.so", "libb.so"].map(|name| scratch.file(name, plugin_bytes("flotor-spring")));
    let ran =
        Flotor::with(["run", "--clock", "virtual", "--duration", "50ms"]).searching(&[scratch.path()]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
    let listed = Flotor::with(["plugins"]).searching(&[scratch.path()]).run();
    for file in files {
        let name = file.display().to_string();
        assert!(ran.stderr.contains(&name) && listed.stdout.contains(&name), "{name}: {ran:?} {listed:?}");
    }
}
