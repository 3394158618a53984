//! Printed lines, shown and said: what of them has to be equal.

/// True if the lines are those shown, where `…` stands for any lines.
pub(super) fn fits(shown: &[String], printed: &[String]) -> bool {
    match shown.split_first() {
        None => printed.is_empty(),
        Some((line, rest)) if line == "…" => (0..=printed.len()).any(|from| fits(rest, &printed[from..])),
        Some((line, rest)) => printed.first() == Some(line) && fits(rest, &printed[1..]),
    }
}

/// Numbers of a command's output that differ from run to run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Noisy {
    /// Times, versions, dates, folders and process ids alone.
    Times,
    /// Every number and digest.
    Numbers,
    /// The columns of tables with these headings, besides [`Noisy::Times`].
    Columns(Vec<String>),
}

/// The lines without their noisy parts.
pub(super) fn all_comparable<'t>(lines: impl Iterator<Item = &'t str>, noisy: &Noisy) -> Vec<String> {
    let Noisy::Columns(headings) = noisy else {
        return lines.map(|line| comparable(line, *noisy == Noisy::Numbers)).collect();
    };
    let mut ends = Vec::new();
    let without_columns = |line: &str| {
        let found = column_ends(line, headings);
        if line.trim().is_empty() || !found.is_empty() {
            ends = found;
            return line.to_owned();
        }
        without_cells(line, &ends)
    };
    lines.map(without_columns).map(|line| comparable(&line, false)).collect()
}

/// Where the columns of these headings end in the head of a table, in characters. Columns are aligned to the right.
fn column_ends(head: &str, headings: &[String]) -> Vec<usize> {
    let is_apart = |text: &str| text.is_empty() || text.starts_with("  ");
    let mut ends: Vec<usize> = headings
        .iter()
        .flat_map(|heading| head.match_indices(heading.as_str()))
        .filter(|(at, heading)| head[..*at].ends_with("  ") && is_apart(&head[at + heading.len()..]))
        .map(|(at, heading)| head[..at + heading.len()].chars().count())
        .collect();
    ends.sort_unstable();
    ends
}

/// A row with `#` in place of the cells that end there.
fn without_cells(row: &str, ends: &[usize]) -> String {
    let mut cells: Vec<char> = row.chars().collect();
    for end in ends.iter().filter(|end| **end <= row.chars().count()) {
        let digits = cells[..*end].iter().rev().take_while(|c| !c.is_whitespace()).count();
        cells[end - digits..*end].fill(' ');
        if digits > 0 {
            cells[end - 1] = '#';
        }
    }
    cells.into_iter().collect()
}

/// A line without what depends on the machine and the moment: times, folders, versions, dates, process ids; without the width of
/// columns; and without any number or digest if that is asked for.
fn comparable(line: &str, any_number: bool) -> String {
    let words: Vec<&str> = line.split_whitespace().collect();
    let is_time = |at: usize| {
        let unit = words.get(at + 1).map_or("", |unit| unit.trim_end_matches([',', ')', ';', '.']));
        ["ns", "µs", "ms", "s"].contains(&unit) && words[at].contains(|c: char| c.is_ascii_digit())
    };
    let word = |(at, word): (usize, &&str)| {
        if at > 0 && is_time(at - 1) {
            // Longer times have other units.
            return format!("time{}", word.trim_start_matches(char::is_alphabetic));
        }
        let of_a_process = at > 0 && words[at - 1].ends_with("process");
        match word.strip_prefix("xxh3:") {
            Some(_) if any_number => "xxh3:#".to_owned(),
            None if any_number || is_time(at) || of_a_process || is_version_or_date(word) => {
                without_folder(&without_numbers(word))
            }
            _ => without_folder(word),
        }
    };
    words.iter().enumerate().map(word).collect::<Vec<_>>().join(" ")
}

/// `0.1.0` or `2026-03-01`.
fn is_version_or_date(word: &str) -> bool {
    let word = word.trim_matches(|c: char| !c.is_ascii_digit());
    ['.', '-'].into_iter().any(|between| {
        let parts: Vec<&str> = word.split(between).collect();
        parts.len() == 3
            && parts.iter().all(|part| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit()))
    })
}

/// `(/somewhere/target/debug/deps/lib.so)` becomes `(lib.so)`.
fn without_folder(word: &str) -> String {
    let start = word.find(|c: char| c == '/' || c.is_alphanumeric()).unwrap_or(0);
    match word.rfind('/') {
        Some(slash) if word[start..].starts_with('/') || word[start..].starts_with("target/") => {
            format!("{}{}", &word[..start], &word[slash + 1..])
        }
        _ => word.to_owned(),
    }
}

/// Each number in a word becomes `#`: digits that follow no letter, with sign, point and exponent.
fn without_numbers(word: &str) -> String {
    let (mut text, mut rest) = (String::new(), word);
    while let Some(next) = rest.chars().next() {
        let digits = rest.trim_start_matches(['+', '-']);
        let is_number =
            digits.starts_with(|c: char| c.is_ascii_digit()) && !text.ends_with(char::is_alphabetic);
        let end = if is_number {
            text.push('#');
            let end =
                digits.find(|c: char| !(c.is_ascii_digit() || ".e+-".contains(c))).unwrap_or(digits.len());
            rest.len() - digits.len() + end
        } else {
            let word = rest.find(|c: char| !c.is_alphanumeric()).unwrap_or(rest.len());
            let end = word.max(next.len_utf8());
            text.push_str(&rest[..end]);
            end
        };
        rest = &rest[end..];
    }
    text
}

#[test]
fn only_what_depends_on_machine_and_moment_is_left_out() {
    for (line, left) in [
        ("  lateness   p50 18 ns   max 1.00 ms", "lateness p50 # time max # time"),
        ("0.4 s) and 12 min", "# time) and 12 min"),
        ("(process 4711), 7.488 N", "(process #), 7.488 N"),
        ("device simulated 0.1.0 (/a/b/libflotor.so)", "device simulated # (libflotor.so)"),
        ("error: target/release/libx.so: on/off 2026-03-01", "error: libx.so: on/off #"),
    ] {
        assert_eq!(comparable(line, false), left);
    }
    assert_eq!(comparable("3 ms xxh3:0f-10", true), comparable("3 s xxh3:a-9", true));
    assert_eq!(comparable("p99 -1.3e-14 N (3) M7", true), "p99 # N (#) M7");
}

#[test]
fn of_a_table_the_noisy_columns_alone_are_left_out() {
    let noisy = Noisy::Columns(vec!["mean".to_owned(), "force only".to_owned()]);
    let table = |mean: &str, share: &str, force: &str| {
        format!(
            "  times\n  case   mean  share  force only\n  a b   {mean:>5}  {share:>5}  {force:>10}\n\n  {mean}"
        )
    };
    let left = |text: &str| all_comparable(text.lines(), &noisy);
    let (shown, printed) = (left(&table("1.5", "0.5", "77")), left(&table("22.5", "0.5", "8")));
    assert_eq!(shown[2], "a b # 0.5 #");
    assert_eq!(shown[..4], printed[..4]);
    assert_ne!(shown[4], printed[4], "a number below the table is compared");
    assert_ne!(shown[2], left(&table("1.5", "0.6", "77"))[2], "a column that is not named is compared");
}
