//! The rooms: folders at the root of the repository, each on a floor, and the arrows between them.
//!
//! After a change of one: `FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests rooms`.

use super::architecture::metadata_of;
use super::supply::WORKSPACES;
use cargo_metadata::DependencyKind;
use flotor_tests::{files_under, workspace_root};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

/// The rooms of the product, from the ground floor up. A room uses rooms on lower floors only.
const FLOORS: [&[&str]; 5] =
    [&["hal"], &["devices", "models"], &["host"], &["lab", "study"], &["interop", "viewer"]];
/// Rooms that use every other room, and that no room uses.
const OUTSIDE: [&str; 2] = ["examples", "tests"];
/// Rooms for crates of contributors: the README of each lists its crates.
const DOORS: [&str; 5] = ["devices", "interop", "lab", "models", "study"];
const MOST_LINES_OF_A_README: usize = 15;
const MOST_FOLDERS_OF_THE_HOST: usize = 14;
/// The document with the drawing, and the line above it.
const DOCUMENT: &str = "ARCHITECTURE.md";
const NOTE: &str = "<!-- Drawn by `FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests rooms`. -->\n\n";
const ADVICE: &str = "FLOTOR_WRITE_REFERENCE=1 cargo test -p flotor-tests rooms";

// ---------------------------------------------------------------- arrows

/// Each room with the other rooms that its crates depend on. Dependencies of tests and examples do not count.
type Arrows = BTreeMap<String, BTreeSet<String>>;

fn room_of(folder: &Path) -> String {
    let relative = folder.strip_prefix(workspace_root()).unwrap_or(folder);
    relative.iter().next().unwrap_or_default().display().to_string()
}

fn arrows() -> Arrows {
    let mut arrows = Arrows::new();
    for package in WORKSPACES.into_iter().flat_map(|workspace| metadata_of(workspace).packages) {
        let user = room_of(package.manifest_path.as_std_path());
        let used = package.dependencies.iter().filter(|used| used.kind != DependencyKind::Development);
        let used = used.filter_map(|used| Some(room_of(used.path.as_ref()?.as_std_path())));
        arrows.entry(user.clone()).or_default().extend(used.filter(|room| *room != user));
    }
    arrows.retain(|room, _| !OUTSIDE.contains(&room.as_str()));
    arrows
}

fn floor_of(room: &str) -> Option<usize> {
    FLOORS.iter().position(|rooms| rooms.contains(&room))
}

/// Returns the rooms without a floor, and the arrows that do not point to a lower floor.
fn complaints(arrows: &Arrows) -> Vec<String> {
    let mut complaints = Vec::new();
    for (user, used) in arrows {
        let Some(floor) = floor_of(user) else {
            complaints.push(format!("{user} has no floor"));
            continue;
        };
        for room in used.iter().filter(|room| floor_of(room).is_none_or(|below| below >= floor)) {
            complaints.push(format!("{user} uses {room}, which is on no lower floor"));
        }
    }
    complaints
}

#[test]
fn arrows_between_rooms_point_down() {
    let arrows = arrows();
    let rooms: Vec<&str> = FLOORS.into_iter().flatten().copied().collect();
    assert!(
        rooms.iter().all(|room| arrows.contains_key(*room)),
        "a room of {rooms:?} has no crate: {arrows:?}"
    );
    assert_eq!(complaints(&arrows), Vec::<String>::new());
}

#[test]
fn an_arrow_that_does_not_point_down_is_noticed() {
    let complaints = |user: &str, used: &str| {
        complaints(&Arrows::from([(user.to_owned(), BTreeSet::from([used.to_owned()]))])).len()
    };
    assert_eq!(complaints("host", "hal"), 0);
    assert_eq!(complaints("devices", "host"), 1);
    assert_eq!(complaints("lab", "study"), 1, "on one floor");
    assert_eq!(complaints("host", "tests"), 1);
    assert_eq!(complaints("cellar", "hal"), 1, "a room without a floor");
}

// ---------------------------------------------------------------- the drawing

/// Draws the floors from the top down, each with the arrows of its rooms.
fn drawing(arrows: &Arrows) -> String {
    let mut lines = String::new();
    for (floor, rooms) in FLOORS.iter().enumerate().rev() {
        let mut boxes = rooms.iter().map(|room| format!("[{room}]")).collect::<Vec<_>>().join("  ");
        let mut number = format!("floor {}", floor + 1);
        for room in *rooms {
            let used: Vec<&str> = arrows.get(*room).into_iter().flatten().map(String::as_str).collect();
            let used = if used.is_empty() { String::new() } else { format!("{room} -> {}", used.join(", ")) };
            let line = format!("{number:<8}{boxes:^24}{used}");
            let _ = writeln!(lines, "{}", line.trim_end());
            boxes.clear();
            number.clear();
        }
    }
    lines
}

#[test]
fn the_architecture_draws_the_rooms() {
    let path = workspace_root().join(DOCUMENT);
    let document = std::fs::read_to_string(&path).expect("the document is text");
    let (before, rest) = document.split_once(NOTE).expect("the document has a place for the drawing");
    let (_, after) = rest.split_once("```\n").expect("the drawing ends");
    let drawn = format!("{before}{NOTE}```text\n{}```\n{after}", drawing(&arrows()));
    if std::env::var_os("FLOTOR_WRITE_REFERENCE").is_some() {
        std::fs::write(&path, &drawn).expect("the document can be written");
    } else {
        assert!(document == drawn, "{DOCUMENT} does not draw the rooms as they are: {ADVICE}");
    }
}

// ---------------------------------------------------------------- folders

/// Folders of a room with sources; the output of an earlier build does not count.
fn folders_in(room: &str) -> BTreeSet<String> {
    let sources = ["proto", "rs", "toml"].into_iter();
    let sources = sources.flat_map(|extension| files_under(room, extension).expect("a room is a folder"));
    let folders = sources.filter(|file| file.iter().count() > 2);
    folders.filter_map(|file| Some(file.iter().nth(1)?.display().to_string())).collect()
}

#[test]
fn the_host_has_few_folders() {
    let folders = folders_in("host");
    assert!(folders.contains("src") && folders.contains("servo"), "{folders:?}");
    assert!(folders.len() <= MOST_FOLDERS_OF_THE_HOST, "{}: {folders:?}", folders.len());
}

#[test]
fn the_readme_of_a_door_is_short_and_lists_its_folders() {
    for door in DOORS {
        let readme = std::fs::read_to_string(workspace_root().join(door).join("README.md"))
            .unwrap_or_else(|error| panic!("{door}/README.md: {error}"));
        assert!(readme.lines().count() <= MOST_LINES_OF_A_README, "{door}/README.md is long");
        let missing: Vec<String> =
            folders_in(door).into_iter().filter(|folder| !readme.contains(&format!("`{folder}`"))).collect();
        assert_eq!(missing, Vec::<String>::new(), "{door}/README.md does not list them");
    }
}

#[test]
fn every_crate_describes_its_job() {
    for package in WORKSPACES.into_iter().flat_map(|workspace| metadata_of(workspace).packages) {
        let description = package.description.as_deref().unwrap_or_default();
        assert!(description.split(' ').count() >= 3, "{}: {description:?}", package.manifest_path);
    }
}
