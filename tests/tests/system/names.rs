//! Names of public items say what the items are in the field's terms.

use flotor_tests::{files_under, workspace_root};
use proc_macro2::{TokenStream, TokenTree};
use std::path::Path;

/// Words that are no part of the name of a public item. Between slashes, because the test of the glossary reads this file too.
const WORDS: &str = "/told/heard/errand/ear/letter/remains/blame/blaming/heart/leave/leaves/obey/remark/wish/wished/making/believed/\
                     borne/nonsense/";
/// With fewer public items the search is broken.
const LEAST_ITEMS: usize = 5_000;
/// Folders of tests.
const FOLDERS_OF_TESTS: [&str; 4] = ["tests", "benches", "fixtures", "fuzz"];
/// Keywords before the name of an item.
const KINDS: [&str; 8] = ["fn", "struct", "enum", "trait", "type", "static", "const", "mod"];
/// Keywords between `pub` and that keyword, or between that keyword and the name.
const MODIFIERS: [&str; 5] = ["const", "async", "unsafe", "extern", "mut"];

fn is_of_tests(file: &Path) -> bool {
    let is_module = file.file_stem().is_some_and(|name| name.to_string_lossy().ends_with("tests"));
    is_module || file.iter().any(|folder| FOLDERS_OF_TESTS.iter().any(|of_tests| folder == *of_tests))
}

/// Names of the items after each `pub`, outside the tests of the file.
fn public_items(tokens: TokenStream, found: &mut Vec<String>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let text = |place: Option<usize>| {
        place.and_then(|at| tokens.get(at)).map(ToString::to_string).unwrap_or_default()
    };
    for (at, token) in tokens.iter().enumerate() {
        let before = |steps: usize| text(at.checked_sub(steps));
        match token {
            TokenTree::Group(_) if before(2) == "mod" && before(3).replace(' ', "") == "[cfg(test)]" => {}
            TokenTree::Group(group) => public_items(group.stream(), found),
            TokenTree::Ident(word) if *word == "pub" => found.extend(item_after(&tokens, at)),
            _ => {}
        }
    }
}

/// Name of the item whose `pub` is at a place; `None` for a field, an import, and a name that a macro chooses.
fn item_after(tokens: &[TokenTree], at: usize) -> Option<String> {
    let after = tokens.get(at + 1..)?.iter();
    // `pub(crate)` and the "C" of `extern`.
    let mut words =
        after.filter(|token| !matches!(token, TokenTree::Group(_) | TokenTree::Literal(_))).peekable();
    let mut kind = None;
    while let Some(TokenTree::Ident(word)) = words.peek() {
        let word = word.to_string();
        if KINDS.contains(&word.as_str()) || MODIFIERS.contains(&word.as_str()) {
            kind = Some(word);
            words.next();
        } else {
            return kind.filter(|kind| KINDS.contains(&kind.as_str()) || kind == "mut").map(|_| word);
        }
    }
    None
}

/// Parts of a name in snake case or CamelCase, in lower case.
fn parts(name: &str) -> Vec<String> {
    let letters: Vec<char> = name.chars().collect();
    let is_small = |place: Option<usize>| {
        place.and_then(|at| letters.get(at)).is_some_and(|letter: &char| letter.is_lowercase())
    };
    let mut parts = vec![String::new()];
    for (at, letter) in letters.iter().enumerate() {
        let begins = letter.is_uppercase() && (is_small(at.checked_sub(1)) || is_small(Some(at + 1)));
        if begins || !letter.is_alphabetic() {
            parts.push(String::new());
        }
        if letter.is_alphabetic() {
            parts.last_mut().expect("there is one").extend(letter.to_lowercase());
        }
    }
    parts.retain(|part| !part.is_empty());
    parts
}

fn has_a_word(name: &str) -> bool {
    parts(name).iter().any(|part| WORDS.contains(&format!("/{part}/")))
}

fn items_of(source: &str) -> Vec<String> {
    let mut found = Vec::new();
    public_items(source.parse().expect("a source file is Rust"), &mut found);
    found
}

#[test]
fn public_items_are_named_by_the_terms_of_the_field() {
    let (mut count, mut complaints) = (0, Vec::new());
    let files = files_under("", "rs").expect("the workspace can be read");
    for file in files.iter().filter(|file| !is_of_tests(file)) {
        let source = std::fs::read_to_string(workspace_root().join(file)).expect("a source file is text");
        let items = items_of(&source);
        count += items.len();
        let named = items.into_iter().filter(|name| has_a_word(name));
        complaints.extend(named.map(|name| format!("{}: `{name}`", file.display())));
    }
    assert!(complaints.is_empty(), "name these by the field's terms:\n{}", complaints.join("\n"));
    assert!(count >= LEAST_ITEMS, "only {count} public items were found");
}

#[test]
fn a_name_with_such_a_word_is_noticed() {
    let source = "pub(crate) const fn told() {} pub static mut HEARD_MS: u8 = 0; pub unsafe extern \"C\" fn obey_it() {}
        pub struct RemainsOfRun { pub told: u8 } mod inner { pub enum DVec3Ear {} } pub use a::leave; fn leave() {}
        #[cfg(test)] mod tests { pub fn told() {} } pub const fn ear_of_a_port() {} macro_rules! m { ($n:ident) => { pub fn $n() {} } }";
    let found = items_of(source);
    assert_eq!(found, ["told", "HEARD_MS", "obey_it", "RemainsOfRun", "DVec3Ear", "ear_of_a_port"]);
    assert!(found.iter().all(|name| has_a_word(name)), "{found:?}");
    for harmless in ["clear", "Heartbeat", "remaining_s", "year", "ABI_TABLE", "leaving", "HTTPServer"] {
        assert!(!has_a_word(harmless), "{harmless}");
    }
    assert_eq!(parts("HTTPServer_of2Ends"), ["http", "server", "of", "ends"]);
}
