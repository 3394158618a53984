//! Comparison of computed numbers with the numbers printed in the book.
//!
//! The file uses no other module of this crate: crates that cannot depend on the crate include it with `#[path]`.

use std::path::Path;

/// Asserts that a chapter of the book contains a text, such as a row of a table; any white space counts as one space.
///
/// # Panics
/// If the chapter cannot be read, or does not contain the text.
#[track_caller]
pub fn assert_chapter_prints(chapter: &str, text: &str) {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let written =
        folders.find_map(|folder| std::fs::read_to_string(folder.join("docs/src").join(chapter)).ok());
    let written = written.unwrap_or_else(|| panic!("no chapter {chapter}"));
    let [written, text] =
        [written.as_str(), text].map(|text| text.split_whitespace().collect::<Vec<_>>().join(" "));
    assert!(written.contains(&text), "{chapter} does not print `{text}`");
}
