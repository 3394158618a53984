//! `--bless`: replaces expected numbers in test files by measured ones; prints each change, and each failure that a new
//! number cannot remove.

use crate::bound::Bound;
use crate::case::{Case, Check};
use crate::check::Outcome;
use crate::file::{Expectation, TestFile};
use crate::report::write_whole;
use flotor_command::{CommandError, note, report_line};
use serde_json::Value;
use std::fmt::Write;
use std::ops::Range;

/// Kinds of expectations that are replaced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Blessed {
    /// Missed expectations of the form `{ value, within }`.
    Numbers,
    /// Missed numbers, and the digests of all runs.
    NumbersAndDigests,
}

/// Updates the files of these cases and prints the changes. Removes the failures of changed expectations.
pub(crate) fn bless(
    files: &[TestFile],
    cases: &[Case<'_>],
    outcomes: &mut [Outcome],
    blessed: Blessed,
) -> Result<(), CommandError> {
    for file in files {
        let own: Vec<usize> =
            (0..cases.len()).filter(|index| std::ptr::eq(cases[*index].file, file)).collect();
        let mut text = file.text.clone();
        // From the end on, so that earlier positions stay valid after a change.
        let mut near: Vec<&Expectation> =
            file.expect.iter().filter(|expected| matches!(expected.bound, Bound::Near { .. })).collect();
        near.sort_by_key(|expected| std::cmp::Reverse(expected.at));
        for expected in near {
            let Bound::Near { value, within } = expected.bound else { continue };
            let of_run = |index: &usize| outcomes[*index].values.get(&expected.path).and_then(Value::as_f64);
            let got: Vec<f64> = own.iter().filter_map(of_run).collect();
            if got.iter().all(|got| (got - value).abs() <= within) {
                continue;
            }
            let place = file.place(expected.at);
            let (least, most) =
                got.iter().fold((f64::MAX, f64::MIN), |(l, m), got| (l.min(*got), m.max(*got)));
            let middle = f64::midpoint(least, most);
            if most - middle > within {
                note(format!(
                    "{place}: {}: the values of its cases are {least} to {most}, a wider range than within = \
                     {within}; write min and max",
                    expected.path
                ));
                continue;
            }
            let Some(number) = number_of_value(&text, expected) else {
                note(format!(
                    "{place}: {}: write the bound in one line, {{ value = …, within = … }}",
                    expected.path
                ));
                continue;
            };
            text.replace_range(number, &format!("{middle:?}"));
            report_line(format_args!("{place}: {}: {value} becomes {middle}", expected.path))?;
            for index in &own {
                let missed = &mut outcomes[*index];
                missed.failures.retain(|failure| failure.what != expected.path);
            }
        }
        digests(file, cases, &own, outcomes, blessed, &mut text)?;
        for index in own {
            let outcome = &mut outcomes[index];
            outcome.settle();
            for failure in &outcome.failures {
                note(format!(
                    "{}: {}: not blessed, because --bless changes only the value of {{ value, within }}; edit the \
                     file, or correct the model",
                    outcome.case,
                    failure.line()
                ));
            }
        }
        if text != file.text {
            write_whole(&file.path, &text)?;
        }
    }
    Ok(())
}

/// Returns the range of the number after `value =`, on the line of the expectation.
fn number_of_value(text: &str, expected: &Expectation) -> Option<Range<usize>> {
    let line = text.get(expected.at..)?.lines().next()?;
    let last = expected.path.rsplit('.').next()?;
    let own = line.find(last)? + last.len();
    let key = own + line.get(own..)?.find("value")?;
    let after = key + line.get(key..)?.find('=')? + 1;
    let start = after + line.get(after..)?.find(|c: char| !c.is_whitespace())?;
    let length = line.get(start..)?.find(|c: char| ",} \t#".contains(c))?;
    Some(expected.at + start..expected.at + start + length)
}

fn digests(
    file: &TestFile,
    cases: &[Case<'_>],
    own: &[usize],
    outcomes: &mut [Outcome],
    blessed: Blessed,
    text: &mut String,
) -> Result<(), CommandError> {
    let runs = own.iter().copied().filter(|index| matches!(cases[*index].check, Check::Run { .. }));
    let mut table = "[digests]\n".to_owned();
    let mut changes = Vec::new();
    for index in runs {
        let (label, outcome) = (&cases[index].label, &mut outcomes[index]);
        let Some(got) = outcome.digest.clone() else { continue };
        // Writing to a string cannot fail.
        let _ =
            writeln!(table, "{} = {}", toml::Value::from(label.as_str()), toml::Value::from(got.as_str()));
        let old = file.digests.get(label);
        if old == Some(&got) || (old.is_none() && blessed == Blessed::Numbers) {
            continue;
        }
        changes.push(match old {
            Some(old) => format!("{label}: digest {old} becomes {got}"),
            None => format!("{label}: digest {got}"),
        });
        if blessed == Blessed::NumbersAndDigests {
            outcome.failures.retain(|failure| failure.what != "trace_digest");
        }
    }
    if changes.is_empty() {
        return Ok(());
    }
    let only_told = if blessed == Blessed::Numbers { " (with --digest)" } else { "" };
    for change in changes {
        report_line(format_args!("{}: {change}{only_told}", file.path.display()))?;
    }
    if blessed == Blessed::NumbersAndDigests {
        *text = with_table(text, &table);
    }
    Ok(())
}

/// Returns the text with the table `[digests]` replaced or appended.
fn with_table(text: &str, table: &str) -> String {
    let mut kept = String::new();
    let mut inside = false;
    for line in text.lines() {
        if line.trim_start().starts_with('[') {
            inside = line.trim() == "[digests]";
        }
        if !inside {
            kept.push_str(line);
            kept.push('\n');
        }
    }
    format!("{}\n\n{table}", kept.trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_is_found_where_it_stands() {
        let text = "[expect]\npeak_force_n = { value = 2.4, within = 0.1 } # value\n\"energy.value_j\" = { within = 1, value = -1e-3 }\n";
        let changed = |path: &str, at: usize| {
            let bound = Bound::Near { value: 0.0, within: 0.0 };
            let number = number_of_value(text, &Expectation { path: path.to_owned(), at, bound });
            number.map(|range| text[range].to_owned())
        };
        assert_eq!(changed("peak_force_n", text.find("peak").unwrap()).as_deref(), Some("2.4"));
        assert_eq!(changed("energy.value_j", text.find("\"energy").unwrap()).as_deref(), Some("-1e-3"));
    }

    #[test]
    fn digests_are_replaced_where_they_are() {
        let table = "[digests]\n\"seed 1\" = \"new\"\n";
        let old = "scene = \"s\"\n\n[digests]\n\"seed 1\" = \"old\"\n\n[expect]\nend = \"finished\"\n";
        let new = with_table(old, table);
        assert_eq!(new, format!("scene = \"s\"\n\n[expect]\nend = \"finished\"\n\n{table}"));
        assert_eq!(with_table(&new, table), new);
    }
}
