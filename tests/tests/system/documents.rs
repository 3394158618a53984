//! What the documents say about the repository, held by tests: paths, links, chapters, and the rules and
//! refusals of the contract.
//!
//! (That the Rust code in them compiles and runs is seen to by the doctests of this crate.)

use flotor_hal::conformance::Rule;
use flotor_tests::{TestSize, files_under, workspace_root};
use std::path::{Path, PathBuf};

/// Documents outside the book.
const DOCUMENTS: [&str; 9] = [
    "README.md",
    "ARCHITECTURE.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "devices/README.md",
    "interop/README.md",
    "lab/README.md",
    "models/README.md",
    "study/README.md",
];
/// Where the book's chapters lie.
const BOOK: &str = "docs/src";

fn read(file: impl AsRef<Path>) -> String {
    let path = workspace_root().join(file);
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn chapters() -> Vec<PathBuf> {
    files_under(BOOK, "md").expect("the book has chapters")
}

/// The text without its fenced code blocks.
fn prose(markdown: &str) -> String {
    let mut inside = false;
    let outside = |line: &&str| {
        let fence = line.trim_start().starts_with("```");
        inside ^= fence;
        !inside && !fence
    };
    markdown.lines().filter(outside).flat_map(|line| [line, "\n"]).collect()
}

/// A device whose maker has an SDK, firmware or a service: its chapter says what of it may be used, and that none is here.
#[test]
fn a_chapter_about_a_makers_device_has_a_note_on_licences() {
    for device in ["falcon", "force-dimension", "inverse3", "openhaptics"] {
        let chapter = read(format!("{BOOK}/devices/{device}.md"));
        let (_, note) =
            chapter.split_once("\n## Licence\n").unwrap_or_else(|| panic!("{device}: no licence note"));
        let words: Vec<&str> = note.split_whitespace().collect();
        assert!(words.join(" ").contains("is in this repository"), "{device}: {note}");
    }
}

// ---------------------------------------------------------------- commands

/// Files and folders that a command of the book writes: the value of such an option, or a new plugin.
fn written_by(command: &str) -> Vec<String> {
    const OUTPUTS: [&str; 10] = [
        "--out",
        "--curve-scene",
        "--json",
        "--junit",
        "--plots",
        "--plot",
        "--record",
        "--csv",
        "--html",
        "--screenshot",
    ];
    let words: Vec<&str> = command.split_whitespace().take_while(|word| !word.starts_with('#')).collect();
    let of_option = words.windows(2).filter(|pair| OUTPUTS.contains(&pair[0])).map(|pair| pair[1].to_owned());
    let new = words.windows(3).filter(|three| three[0] == "new").map(|three| match three[1] {
        "scene" => format!("{}.toml", three[2]),
        _ => three[2].to_owned(),
    });
    of_option.chain(new).filter(|name| !name.starts_with(['-', '/'])).collect()
}

#[test]
fn what_the_commands_of_the_book_write_is_nothing_to_commit() {
    let ignored = read(".gitignore");
    let is_ignored = |name: &str| {
        let ending = Path::new(name).extension().map(|ending| ending.display().to_string());
        let patterns = [format!("/{name}"), format!("/{name}/")].into_iter();
        let of_ending = ending.into_iter().flat_map(|ending| [format!("*.{ending}"), format!("/*.{ending}")]);
        patterns.chain(of_ending).any(|pattern| ignored.lines().any(|line| line == pattern))
    };
    let mut seen = 0;
    for chapter in chapters() {
        let text = read(&chapter);
        for command in text.lines().filter_map(|line| line.strip_prefix("$ flotor ")) {
            for name in written_by(command) {
                assert!(is_ignored(&name), "{}: {command}: {name} is not in .gitignore", chapter.display());
                seen += 1;
            }
        }
    }
    assert!(seen >= 30, "only {seen} files and folders found");
}

/// A study refuses a folder that holds a complete one: a reader of two chapters would meet that.
#[test]
fn no_two_chapters_put_a_study_into_one_folder() {
    let mut owners = std::collections::BTreeMap::new();
    for chapter in chapters() {
        let text = read(&chapter);
        let studies = text.lines().filter_map(|line| line.strip_prefix("$ flotor study "));
        for name in studies.flat_map(written_by).filter(|name| Path::new(name).extension().is_none()) {
            let owner = owners.entry(name.to_owned()).or_insert_with(|| chapter.clone());
            assert_eq!(*owner, chapter, "both write the study {name}");
        }
    }
    assert!(owners.len() >= 8, "{owners:?}");
}

// ---------------------------------------------------------------- paths

/// What stands in backticks and looks like a path: with a slash or the ending of a file, made of characters of
/// paths only. Interface ids (`flotor.force/1`) end in a revision; commands and code have other characters.
fn named_paths(markdown: &str) -> Vec<String> {
    let quoted = prose(markdown);
    let quoted = quoted.split('`').skip(1).step_by(2);
    let is_path = |text: &&str| {
        let characters = text.chars().all(|c| c.is_ascii_alphanumeric() || "._-/".contains(c));
        let ending = [".md", ".rs", ".toml", ".h", ".svg"].iter().any(|ending| text.ends_with(ending));
        let revision = text.rsplit_once('/').is_some_and(|(_, last)| last.parse::<u32>().is_ok());
        characters && (text.contains('/') || ending) && !revision
    };
    quoted.filter(is_path).map(str::to_owned).collect()
}

#[test]
fn every_path_in_the_architecture_exists() {
    let paths = named_paths(&read("ARCHITECTURE.md"));
    assert!(
        paths.len() >= 20,
        "only {} paths found: is the document still about this repository?",
        paths.len()
    );
    for path in paths {
        let found = workspace_root().join(&path);
        let right = if path.ends_with('/') { found.is_dir() } else { found.exists() };
        assert!(right, "ARCHITECTURE.md names `{path}`, which does not exist");
    }
}

#[test]
fn paths_are_told_from_other_things_in_backticks() {
    let text = "`hal/src/abi/` and `Cargo.toml`, not `flotor.force/1`, `cargo run --release`, `Vec<f64>`\n\
                ```text\n`not/this`\n```\nbut `tests/`.";
    assert_eq!(named_paths(text), ["hal/src/abi/", "Cargo.toml", "tests/"]);
}

// ---------------------------------------------------------------- links

/// Targets of the links and pictures of a document, without those that leave the repository.
fn relative_links(markdown: &str) -> Vec<String> {
    let prose = prose(markdown);
    let targets = prose.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(target, _)| target);
    let targets = targets.map(|target| target.split('#').next().unwrap_or_default());
    targets.filter(|target| !target.is_empty() && !target.contains(':')).map(str::to_owned).collect()
}

#[test]
fn every_link_leads_somewhere() {
    let documents = DOCUMENTS.iter().map(PathBuf::from).chain(chapters());
    for document in documents {
        let folder = workspace_root().join(&document);
        let folder = folder.parent().expect("a document lies in a folder");
        for link in relative_links(&read(&document)) {
            assert!(
                folder.join(&link).exists(),
                "{} links to {link}, which does not exist",
                document.display()
            );
        }
    }
}

#[test]
fn links_are_found_and_the_web_is_left_alone() {
    let text = "[a](b.md#c), ![p](images/p.svg), [w](https://example.org), [here](#top)";
    assert_eq!(relative_links(text), ["b.md", "images/p.svg"]);
}

// ---------------------------------------------------------------- the book

#[test]
fn the_summary_lists_every_chapter_once() {
    let mut listed = relative_links(&read("docs/src/SUMMARY.md"));
    listed.sort();
    let written = chapters();
    let written =
        written.iter().filter_map(|file| file.strip_prefix(BOOK).ok()).map(|file| file.display().to_string());
    let mut written: Vec<String> = written.filter(|file| file != "SUMMARY.md").collect();
    written.sort();
    assert_eq!(listed, written);
}

#[test]
fn rust_in_the_documents_is_compiled() {
    let doctests = read("tests/src/lib.rs");
    let documents = DOCUMENTS.iter().map(PathBuf::from).chain(chapters());
    for document in documents.filter(|document| read(document).contains("```rust")) {
        let included = format!("include_str!(\"../../{}\")", document.display());
        assert!(doctests.contains(&included), "{} holds Rust that no doctest compiles", document.display());
    }
}

/// Rows of the table under a headline, as cells.
fn table_under(markdown: &str, headline: &str) -> Vec<Vec<String>> {
    let lines = markdown.lines().skip_while(|line| *line != headline).skip(1);
    let lines = lines.take_while(|line| !line.starts_with('#')).filter(|line| line.starts_with('|'));
    let cells = |line: &str| line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect();
    lines.skip(2).map(cells).collect()
}

#[test]
fn the_book_prints_the_rules_of_the_contract() {
    let printed = table_under(&read("docs/src/plugin-contract.md"), "## What `flotor validate` checks");
    let rules = Rule::ALL.iter().map(|rule| vec![format!("`{}`", rule.id()), rule.text().to_owned()]);
    assert_eq!(printed, rules.collect::<Vec<_>>());
}

#[test]
fn the_book_lists_every_command() {
    let offered = flotor::cli::command_names();
    let listed = table_under(&read("docs/src/command-line.md"), "# Command line");
    let listed = listed.iter().map(|row| row[0].trim_matches('`').split(' ').next().unwrap_or_default());
    assert_eq!(listed.collect::<Vec<_>>(), offered);
}

/// Names of the variants of an enum in a source text, read off its one-per-line layout.
fn variants(source: &str, name: &str) -> Vec<String> {
    let body = source.lines().skip_while(|line| *line != format!("pub enum {name} {{")).skip(1);
    let body = body.take_while(|line| *line != "}");
    let names =
        body.filter_map(|line| line.strip_prefix("    ")).filter(|line| line.starts_with(char::is_uppercase));
    names.map(|line| line.split([' ', ',', '(', '=']).next().unwrap_or_default().to_owned()).collect()
}

#[test]
fn the_book_prints_every_refusal_of_the_loader() {
    let refusals = variants(&read("hal/loader/src/error.rs"), "LoadError");
    assert!(refusals.len() >= 10 && refusals.contains(&"Truncated".to_owned()), "{refusals:?}");
    let printed = table_under(&read("docs/src/plugin-contract.md"), "## Refusals");
    let printed: Vec<String> = printed.iter().map(|row| row[0].trim_matches('`').to_owned()).collect();
    assert_eq!(printed, refusals);
}

// ---------------------------------------------------------------- glossary

/// Files with words: their extensions.
const TEXT: [&str; 10] = ["rs", "toml", "md", "py", "h", "c", "cpp", "proto", "sh", "wgsl"];
/// Documents that keep the words of their time.
const HISTORY: [&str; 2] = ["CHANGELOG.md", "docs/src/adr"];
/// Between the words of a name in CamelCase.
const HUMP: char = '\u{1}';

/// Lower case and in one line, without the signs of comments; `_` is a space.
fn flattened(text: &str) -> String {
    let mut flat = String::with_capacity(text.len() + text.len() / 16);
    for line in text.lines() {
        let words = line.trim_start().trim_start_matches(['/', '!', '#', '*']).trim().trim_end_matches('\\');
        let words: Vec<char> =
            words.chars().map(|c| if c == '_' { ' ' } else { c }).chain([' ', ' ']).collect();
        let mut last = ' ';
        for pair in words.windows(2) {
            let &[next, following] = pair else { continue };
            let begins = last.is_lowercase() || last.is_ascii_digit() || following.is_lowercase();
            if next.is_uppercase() && last.is_alphanumeric() && begins {
                flat.push(HUMP);
            }
            if next != ' ' || !flat.ends_with(' ') {
                flat.extend(next.to_lowercase());
            }
            last = next;
        }
    }
    flat
}

/// Where a term stands in a flattened text, with what surrounds it. A term next to `/` or `-` is part of a path, a key or
/// the name of a file.
fn first_use<'a>(flat: &'a str, term: &str) -> Option<&'a str> {
    let term = flattened(term);
    let (term, camel) = (term.trim(), term.trim().replace(' ', &HUMP.to_string()));
    let is_part = |c: char| c.is_alphanumeric() || c == '/' || c == '-';
    let is_whole = |start: usize, length: usize| {
        let after = &flat[start + length..];
        let ends = ["", "s", "es"].iter().filter_map(|plural| after.strip_prefix(plural));
        !flat[..start].ends_with(is_part) && ends.into_iter().any(|rest| !rest.starts_with(is_part))
    };
    let found = [term, &camel].into_iter().flat_map(|form| flat.match_indices(form));
    let (start, found) = found.into_iter().find(|(start, found)| is_whole(*start, found.len()))?;
    let from = flat.floor_char_boundary(start.saturating_sub(40));
    Some(&flat[from..flat.ceil_char_boundary(start + found.len() + 40)])
}

/// The terms of the left column of the glossary, and those of the middle one.
fn glossary() -> Vec<[String; 2]> {
    let rows = table_under(&read("CONTRIBUTING.md"), "## Glossary");
    rows.iter().map(|row| [row[0].trim_matches('`').to_owned(), row[1].clone()]).collect()
}

#[test]
fn the_glossary_replaces_each_term_once_and_by_none_of_its_own() {
    let rows = glossary();
    assert!(rows.len() >= 60, "{} rows", rows.len());
    for (number, [left, _]) in rows.iter().enumerate() {
        assert!(!rows[..number].iter().any(|[before, _]| before == left), "`{left}` has two rows");
        for [_, term] in &rows {
            assert_eq!(
                first_use(&flattened(term), left),
                None,
                "`{term}` replaces a term and contains `{left}`"
            );
        }
    }
}

#[test]
fn a_term_is_found_in_every_form_in_which_it_can_be_written() {
    for [term, _] in glossary() {
        let name = flattened(&term).trim().replace([' ', HUMP], "_");
        let is_camel = flattened(&term).contains(HUMP);
        let split = term.replace(' ', "\n    /// ");
        let capital = |word: &str| word[..1].to_uppercase() + &word[1..];
        let camel: String = term.split(' ').map(capital).collect();
        let forms = [
            format!("/// A {term}."),
            format!("let {term}s = 1;"),
            format!("no {term}es"),
            format!("// {split}"),
            format!("Free{camel}::new()"),
        ];
        for text in forms {
            assert!(first_use(&flattened(&text), &term).is_some(), "`{term}` in {text:?}");
        }
        let planted = flattened(&format!("fn of_{name}_here()"));
        assert_eq!(first_use(&planted, &term).is_some(), !is_camel, "`{term}` in {planted}");
        for text in [format!("x{term}x"), format!("key/{term}/name"), format!("{term}-file.md")] {
            assert_eq!(first_use(&flattened(&text), &term), None, "`{term}` in {text:?}");
        }
    }
}

#[test]
fn no_text_uses_a_term_that_the_glossary_replaces() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let terms = glossary();
    let is_left_out = |file: &Path| HISTORY.iter().any(|folder| file.starts_with(folder));
    let files =
        TEXT.iter().flat_map(|extension| files_under("", extension).expect("the workspace can be read"));
    let uses: Vec<String> = files
        .filter(|file| !is_left_out(file))
        .flat_map(|file| {
            let text = read(&file);
            // The table itself is the one place that has to name them.
            let is_table = file.ends_with("CONTRIBUTING.md");
            let text = text.lines().filter(|line| !is_table || !line.starts_with("| `"));
            let flat = flattened(&text.flat_map(|line| [line, "\n"]).collect::<String>());
            let found = terms.iter().filter_map(|[term, right]| {
                let place = first_use(&flat, term)?;
                Some(format!("{}: `{term}` ({right}) in \"{place}\"", file.display()))
            });
            found.collect::<Vec<_>>()
        })
        .collect();
    assert!(uses.is_empty(), "the glossary of CONTRIBUTING.md replaces these:\n{}", uses.join("\n"));
}
