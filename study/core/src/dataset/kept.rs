//! Merging of generated files with edits by people, as BIDS requires: preserves added columns, rows and keys, and values where
//! the program has none.

use super::table::MISSING;
use serde_json::{Map, Value};

/// Reason why a file cannot be merged without loss.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Unmergeable {
    /// The first column of the table is not the key column.
    #[error("the first column is not `{0}`; write `{0}` first, and separate the columns with tabs")]
    NoKey(&'static str),
    /// The number of cells in a line differs from the number of columns.
    #[error("line {line}: the number of cells is {cells}, but the number of columns is {columns}")]
    Ragged {
        /// Line, from 1.
        line: usize,
        /// Number of cells in the line.
        cells: usize,
        /// Number of columns in the table.
        columns: usize,
    },
    /// The file is not a text in UTF-8.
    #[error("the file is not saved as UTF-8")]
    NotUtf8,
    /// The text is not a JSON object.
    #[error("the text is not a JSON object ({0})")]
    NotAnObject(String),
}

/// Tab-separated table, with rows keyed by their first cell.
struct Table<'t> {
    columns: Vec<&'t str>,
    rows: Vec<Vec<&'t str>>,
}

impl<'t> Table<'t> {
    /// Parses a table; accepts the CRLF line ends and the byte order mark (BOM) that spreadsheets write.
    fn read(text: &'t str, key: &'static str) -> Result<Self, Unmergeable> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let columns: Vec<&str> = lines.next().map_or("", |(_, head)| head).split('\t').collect();
        if columns.first() != Some(&key) {
            return Err(Unmergeable::NoKey(key));
        }
        let row = |(index, line): (usize, &'t str)| {
            let cells: Vec<&str> = line.split('\t').collect();
            match cells.len() == columns.len() {
                true => Ok(cells),
                false => {
                    Err(Unmergeable::Ragged { line: index + 1, cells: cells.len(), columns: columns.len() })
                }
            }
        };
        let rows = lines.map(row).collect::<Result<_, _>>()?;
        Ok(Self { columns, rows })
    }

    fn row(&self, key: &str) -> Option<&Vec<&'t str>> {
        self.rows.iter().find(|row| row.first() == Some(&key))
    }

    fn cell(&self, row: &[&'t str], column: &str) -> Option<&'t str> {
        let index = self.columns.iter().position(|known| *known == column)?;
        row.get(index).copied()
    }
}

/// Merges a generated table with an earlier one: adds columns and rows that only the earlier table has, and replaces `n/a` with
/// the earlier cell. Returns `None` if the result equals the earlier table.
///
/// # Errors
/// [`Unmergeable`] if the earlier text is not a table with the key column first.
pub(crate) fn table(
    earlier: &str,
    generated: &str,
    key: &'static str,
) -> Result<Option<String>, Unmergeable> {
    let (earlier, new) = (Table::read(earlier, key)?, Table::read(generated, key)?);
    let added = earlier.columns.iter().filter(|column| !new.columns.contains(column));
    let columns: Vec<&str> = new.columns.iter().chain(added).copied().collect();
    let keys = new.rows.iter().chain(earlier.rows.iter()).filter_map(|row| row.first().copied());
    let mut rows: Vec<Vec<&str>> = Vec::new();
    for key in keys {
        if rows.iter().any(|row| row.first() == Some(&key)) {
            continue;
        }
        let chosen = columns.iter().map(|column| {
            let now = new.row(key).and_then(|row| new.cell(row, column)).filter(|cell| *cell != MISSING);
            now.or_else(|| earlier.row(key).and_then(|row| earlier.cell(row, column))).unwrap_or(MISSING)
        });
        rows.push(chosen.collect());
    }
    if columns == earlier.columns && rows == earlier.rows {
        return Ok(None);
    }
    let lines = [&columns].into_iter().chain(&rows).map(|cells| cells.join("\t") + "\n");
    Ok(Some(lines.collect()))
}

/// Merges a generated JSON object with an earlier one: for a common key the earlier value is kept unless the key is in `owned`,
/// with missing members of nested objects added. Returns `None` if the result equals the earlier object.
///
/// # Errors
/// [`Unmergeable`] if the earlier text is not an object.
pub(crate) fn object(
    earlier: &str,
    generated: Map<String, Value>,
    owned: &[&str],
) -> Result<Option<Map<String, Value>>, Unmergeable> {
    let text = earlier.strip_prefix('\u{feff}').unwrap_or(earlier);
    let earlier: Map<String, Value> =
        serde_json::from_str(text).map_err(|error| Unmergeable::NotAnObject(error.to_string()))?;
    let mut merged = earlier.clone();
    complete(&mut merged, generated, owned);
    Ok((merged != earlier).then_some(merged))
}

/// Adds the keys of `more` that an object lacks, recursively, and replaces the values of the `owned` keys; does not change other
/// values.
fn complete(kept: &mut Map<String, Value>, more: Map<String, Value>, owned: &[&str]) {
    for (key, value) in more {
        match (kept.get_mut(&key), value) {
            (Some(known), value) if owned.contains(&key.as_str()) => *known = value,
            (Some(Value::Object(known)), Value::Object(more)) => complete(known, more, &[]),
            (Some(_), _) => {}
            (None, value) => drop(kept.insert(key, value)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const NEW: &str = "participant_id\tcomplete\tage\nsub-01\t1\tn/a\nsub-02\t0\t31\n";

    #[test]
    fn columns_rows_and_values_of_people_stay() {
        let earlier = "\u{feff}participant_id\tgroup\tcomplete\tage\r\nsub-02\tb\t0\tn/a\r\nsub-01\ta\t0\t54\r\n\
                       sub-90\tpilot\t1\t20\r\n";
        let expected = "participant_id\tcomplete\tage\tgroup\nsub-01\t1\t54\ta\nsub-02\t0\t31\tb\n\
                        sub-90\t1\t20\tpilot\n";
        assert_eq!(table(earlier, NEW, "participant_id"), Ok(Some(expected.to_owned())));
        assert_eq!(table(expected, NEW, "participant_id"), Ok(None), "nothing is to be written");
        assert_eq!(table(&expected.replace('\n', "\r\n"), NEW, "participant_id"), Ok(None));
    }

    #[test]
    fn a_table_that_cannot_be_read_is_not_replaced() {
        for (earlier, why) in [
            ("participant_id;group\nsub-01;a\n", Unmergeable::NoKey("participant_id")),
            ("", Unmergeable::NoKey("participant_id")),
            ("participant_id\tgroup\nsub-01\n", Unmergeable::Ragged { line: 2, cells: 1, columns: 2 }),
        ] {
            assert_eq!(table(earlier, NEW, "participant_id"), Err(why), "{earlier}");
        }
    }

    #[test]
    fn keys_of_people_stay_and_those_of_the_program_follow_it() {
        let object = |value: Value| value.as_object().cloned().unwrap_or_default();
        let generated = || {
            object(
                json!({ "Name": "Perception study", "Seed": 2, "age": { "Description": "Age", "Units": "year" } }),
            )
        };
        let earlier =
            json!({ "Name": "Meine Studie", "Authors": ["A"], "Seed": 1, "age": { "Description": "Alter" } });
        let merged = super::object(&earlier.to_string(), generated(), &["Seed"]);
        let expected = json!({
            "Name": "Meine Studie", "Authors": ["A"], "Seed": 2, "age": { "Description": "Alter", "Units": "year" },
        });
        assert_eq!(merged, Ok(Some(object(expected.clone()))));
        assert_eq!(super::object(&expected.to_string(), generated(), &["Seed"]), Ok(None));
        assert!(super::object("[]", generated(), &[]).is_err());
    }
}
