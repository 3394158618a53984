//! Tables of results: human-readable, and as CSV for other programs.

use serde::Serialize;

/// Formats a human-readable table, one line for the header and one per row: the first column is aligned left, the others right.
#[must_use]
pub fn table<const N: usize>(head: [&str; N], rows: impl IntoIterator<Item = [String; N]>) -> Vec<String> {
    let lines: Vec<[String; N]> = [head.map(str::to_owned)].into_iter().chain(rows).collect();
    let widest = |column: usize| lines.iter().map(|cells| cells[column].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(widest);
    let line = |cells: &[String; N]| {
        let line =
            cells.iter().zip(widths).enumerate().fold(String::new(), |line, (column, (cell, width))| {
                if column == 0 { format!("  {cell:<width$}") } else { format!("{line}  {cell:>width$}") }
            });
        line.trim_end().to_owned()
    };
    lines.iter().map(line).collect()
}

/// Formats rows as CSV with the header `head`; if `head` is empty, the field names of `T` are the header.
#[must_use]
pub fn to_csv<'h, T: Serialize>(
    head: impl IntoIterator<Item = &'h str>,
    rows: impl IntoIterator<Item = T>,
) -> String {
    let head: Vec<&str> = head.into_iter().collect();
    let mut writer = csv::WriterBuilder::new().has_headers(head.is_empty()).from_writer(Vec::new());
    let begun = if head.is_empty() { Ok(()) } else { writer.write_record(head) };
    // Writing to memory fails only for a row that is not a record.
    let written = begun.and_then(|()| rows.into_iter().try_for_each(|row| writer.serialize(row)));
    debug_assert!(written.is_ok(), "{written:?}");
    String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
}
