//! Printed lines, shown and said: what of them has to be equal.

/// True if the lines are those shown, where `…` stands for any lines.
pub(super) fn fits(shown: &[String], printed: &[String]) -> bool {
    match shown.split_first() {
        None => printed.is_empty(),
        Some((line, rest)) if line == "…" => (0..=printed.len()).any(|from| fits(rest, &printed[from..])),
        Some((line, rest)) => printed.first() == Some(line) && fits(rest, &printed[1..]),
    }
}

/// A line without what depends on the machine and the moment: times, folders, versions, dates, process ids; without the width of
/// columns; and without any number or digest if that is asked for.
pub(super) fn comparable(line: &str, any_number: bool) -> String {
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
