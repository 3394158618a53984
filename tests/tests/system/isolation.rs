//! A scene loads its own plugins and no others: what else lies in the folders cannot hurt it.

use flotor_tests::library::{compile_c, plugin_bytes, plugin_file};
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use std::os::unix::fs::PermissionsExt;

/// A library that ends any process that opens it.
const DEADLY: &str = r#"
#include "flotor.h"
#include <stdlib.h>
FLOTOR_METADATA("kind = \"model\"\nid = \"deadly\"\nname = \"Deadly\"\ndoc = \"Ends the process\"\n"
                "version = \"0.1.0\"\nabi = \"1.0-rc\"\nentry = \"flotor_entry_deadly\"\n");
__attribute__((constructor)) static void at_load(void) { abort(); }
"#;

/// A folder with everything that may be wrong with a plugin file.
fn folder_of_horrors(scratch: &Scratch) {
    let _ = scratch.file("libtext.so", "this is not a library\n");
    let _ = scratch.file("libempty.so", "");
    let whole = plugin_bytes("flotor-spring");
    let _ = scratch.file("libhalf.so", &whole[..whole.len() / 2]);
    compile_c(DEADLY, &scratch.path().join("libdeadly.so"));
}

#[test]
fn broken_plugins_a_scene_does_not_name_cannot_stop_it() {
    let scratch = Scratch::default();
    folder_of_horrors(&scratch);
    let ran =
        Flotor::with(["run", "--clock", "virtual", "--duration", "100ms"]).searching(&[scratch.path()]).run();
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:?}");
}

#[test]
fn listing_names_what_is_broken_and_runs_none_of_it() {
    let scratch = Scratch::default();
    folder_of_horrors(&scratch);
    let ran = Flotor::with(["plugins"]).searching(&[scratch.path()]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    for expected in
        ["deadly", "libtext.so: not a shared library", "libempty.so", "libhalf.so: the file is truncated"]
    {
        assert!(ran.stdout.contains(expected), "{expected}: {}", ran.stdout);
    }
}

#[test]
fn a_folder_anybody_may_write_to_is_not_searched_and_the_reason_is_told() {
    let scratch = Scratch::default();
    let open = scratch.folder("open");
    std::fs::copy(plugin_file("flotor-spring"), open.join("libspring.so")).expect("a library can be copied");
    std::fs::set_permissions(&open, std::fs::Permissions::from_mode(0o777)).expect("our own folder");
    let ran = Flotor::with(["plugins"]).searching(&[&open]).run();
    assert!(ran.stdout.contains("not searched: every user may write into the folder"), "{}", ran.stdout);
    assert!(!ran.stdout.contains("open/libspring.so"), "{}", ran.stdout);
}

#[test]
fn of_two_plugins_with_one_id_the_first_wins_and_the_other_is_told() {
    let scratch = Scratch::default();
    let copy = scratch.file("libspring_copy.so", plugin_bytes("flotor-spring"));
    let ran = Flotor::with(["plugins"]).searching(&[scratch.path()]).run();
    let own = plugin_file("flotor-spring");
    let hidden =
        format!("{}: not used, because a plugin listed above has the same id `spring`", own.display());
    assert!(ran.stdout.contains(&hidden), "{}", ran.stdout);
    assert!(ran.stdout.contains(&copy.display().to_string()), "{}", ran.stdout);
}

#[test]
fn one_file_under_two_names_hides_nothing() {
    let scratch = Scratch::default();
    let copy = scratch.file("libspring_copy.so", plugin_bytes("flotor-spring"));
    let link = scratch.path().join("libspring_link.so");
    std::fs::hard_link(&copy, &link).expect("one folder is one file system");
    let ran = Flotor::with(["plugins"]).searching(&[scratch.path()]).run();
    assert!(ran.stdout.contains(&copy.display().to_string()), "{}", ran.stdout);
    assert!(!ran.stdout.contains(&link.display().to_string()), "{}", ran.stdout);
}
