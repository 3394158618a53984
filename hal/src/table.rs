//! Tables of numbers in a text: a line of column names, then one line per row, cells separated by commas.
//!
//! One reader for all user-supplied tables, so that every command accepts the same files, or rejects them with the same
//! message.

use crate::TextProblem;
use std::borrow::Cow;

/// Maximum length of a line, bytes.
const LONGEST_LINE_BYTES: usize = 64 << 10;
/// Maximum length of a quotation in an error, characters.
const LONGEST_QUOTE: usize = 40;

/// Meaning of a line that begins with `#`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HashLines {
    /// A comment, which is skipped: for tables whose first cell is a number.
    Comments,
    /// A row or a header like any other: for tables whose first cell may be a name.
    Rows,
}

/// Table with parsed column names, and rows that are parsed on demand ([`Self::rows`]).
#[derive(Clone, Debug)]
pub struct Table<'a> {
    lines: Lines<'a>,
    header_line: usize,
    columns: Vec<String>,
}

/// Row of a table, one cell per column.
#[derive(Clone, Debug)]
pub struct Row<'t> {
    line: usize,
    cells: Vec<Cow<'t, str>>,
    columns: &'t [String],
}

/// Lines with content and their numbers, from 1.
#[derive(Clone, Debug)]
struct Lines<'a> {
    lines: std::iter::Enumerate<std::str::Lines<'a>>,
    hash_lines: HashLines,
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        self.lines.by_ref().map(|(index, line)| (index + 1, line)).find(|(_, line)| {
            let is_comment = self.hash_lines == HashLines::Comments && line.trim_start().starts_with('#');
            !line.trim().is_empty() && !is_comment
        })
    }
}

impl<'a> Table<'a> {
    /// Parses the column names; [`Self::rows`] parses the rows. A byte order mark and a spreadsheet's line `sep=,` are
    /// skipped. Not real-time.
    ///
    /// # Errors
    /// For a separator other than a comma, a column without a name, a duplicate name, a malformed or overlong header,
    /// or a table without a header.
    pub fn parse(text: &'a str, hash_lines: HashLines) -> Result<Self, TextProblem> {
        let text = text.trim_start_matches('\u{feff}');
        let mut lines = Lines { lines: text.lines().enumerate(), hash_lines };
        let mut first = lines.next();
        if let Some((line, separator)) =
            first.and_then(|(line, text)| Some((line, text.trim().strip_prefix("sep=")?)))
        {
            if separator != "," {
                return Err(TextProblem::at(line, other_separator(separator)));
            }
            first = lines.next();
        }
        let (header_line, header) = first
            .ok_or_else(|| TextProblem::at(1, "the table is empty; write a header and at least one row"))?;
        let at = |problem| TextProblem::at(header_line, problem);
        if let Some(separator) =
            [";", "\t"].into_iter().find(|other| header.contains(other) && !header.contains(','))
        {
            return Err(at(other_separator(separator)));
        }
        let columns: Vec<String> = cells(header).map_err(at)?.into_iter().map(Cow::into_owned).collect();
        if let Some(unnamed) = columns.iter().position(String::is_empty) {
            let problem = format!(
                "column {} has no name; remove the column, or name the column (without the index of pandas: \
                 `to_csv(FILE, index=False)`)",
                unnamed + 1
            );
            return Err(at(problem));
        }
        if let Some(twice) = (1..columns.len()).find(|&index| columns[..index].contains(&columns[index])) {
            return Err(at(format!("the column `{}` is given twice; remove one", quoted(&columns[twice]))));
        }
        Ok(Self { lines, header_line, columns })
    }

    /// Returns the names of the columns, in the order of the cells.
    #[must_use]
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Returns the index of a column; `None` for an unknown name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// Builds an error located at the line with the column names. Not real-time.
    #[must_use]
    pub fn header_problem(&self, problem: impl Into<String>) -> TextProblem {
        TextProblem::at(self.header_line, problem)
    }

    /// Parses the rows one after the other. A row whose number of cells differs from the number of columns, or with a malformed
    /// cell, is an error. Not real-time.
    pub fn rows(&self) -> impl Iterator<Item = Result<Row<'_>, TextProblem>> {
        self.lines.clone().map(|(line, text)| {
            let cells = cells(text).map_err(|problem| TextProblem::at(line, problem))?;
            let (found, expected) = (cells.len(), self.columns.len());
            if found == expected {
                return Ok(Row { line, cells, columns: &self.columns });
            }
            let hint = match found {
                1 if text.contains(';') => "; separate them with commas, not with `;`",
                _ if found == 2 * expected => "; write numbers with a decimal point, not with a comma",
                _ => "; write one cell per column",
            };
            let cells = if found == 1 { "cell" } else { "cells" };
            Err(TextProblem::at(line, format!("the line has {found} {cells} for {expected} columns{hint}")))
        })
    }
}

impl Row<'_> {
    /// Returns the line of the row, from 1.
    #[must_use]
    pub fn line(&self) -> usize {
        self.line
    }

    /// Returns the text of the cell in a column, without surrounding blanks (blanks inside quotation marks are kept);
    /// empty for an unknown column.
    #[must_use]
    pub fn text(&self, column: usize) -> &str {
        self.cells.get(column).map_or("", |cell| cell)
    }

    /// Returns the number in a cell, which may be NaN or infinite. Not real-time.
    ///
    /// # Errors
    /// If the text of the cell is not a number.
    pub fn number(&self, column: usize) -> Result<f64, TextProblem> {
        let text = self.text(column);
        text.parse().map_err(|_| {
            let name = self.columns.get(column).map_or("", |name| name);
            let hint = match text.replace(',', ".").parse::<f64>() {
                Ok(_) => ": write a decimal point",
                Err(_) => "",
            };
            TextProblem::at(self.line, format!("`{name}` must be a number, not `{}`{hint}", quoted(text)))
        })
    }

    /// Returns the finite number in a cell. Not real-time.
    ///
    /// # Errors
    /// If the text of the cell is not a finite number.
    pub fn finite(&self, column: usize) -> Result<f64, TextProblem> {
        let number = self.number(column)?;
        let name = self.columns.get(column).map_or("", |name| name);
        let problem = || TextProblem::at(self.line, format!("`{name}` must be finite, not {number}"));
        number.is_finite().then_some(number).ok_or_else(problem)
    }
}

/// Splits a line of bounded length into cells. Quotation marks around a cell are removed, doubled marks inside become single.
fn cells(line: &str) -> Result<Vec<Cow<'_, str>>, String> {
    if line.len() > LONGEST_LINE_BYTES {
        return Err(format!(
            "the line has more than {LONGEST_LINE_BYTES} bytes: the file is not a table; name a file with one line per row \
             and commas between cells"
        ));
    }
    let mut cells = Vec::new();
    let mut rest = line;
    loop {
        let begin = rest.trim_start();
        let (cell, after) = match begin.strip_prefix('"') {
            Some(quoted) => {
                let (cell, after) = quoted_cell(quoted)?;
                (Cow::Owned(cell), after.trim_start())
            }
            None => {
                let end = rest.find(',').unwrap_or(rest.len());
                (Cow::Borrowed(rest[..end].trim()), &rest[end..])
            }
        };
        cells.push(cell);
        match after.strip_prefix(',') {
            Some(next) => rest = next,
            None if after.is_empty() => return Ok(cells),
            None => return Err("a comma must follow a closing quotation mark; write a comma, or double a mark inside the text".to_owned()),
        }
    }
}

/// Reads a cell up to its closing quotation mark; returns the cell and the text after it.
fn quoted_cell(text: &str) -> Result<(String, &str), String> {
    let mut cell = String::new();
    let mut rest = text;
    loop {
        let end = rest.find('"').ok_or(
            "a quotation mark is not closed in this line; close it, or double a mark inside the text",
        )?;
        cell.push_str(&rest[..end]);
        rest = &rest[end + 1..];
        match rest.strip_prefix('"') {
            Some(next) => {
                cell.push('"');
                rest = next;
            }
            None => return Ok((cell, rest)),
        }
    }
}

fn other_separator(separator: &str) -> String {
    let name = if separator == "\t" { "tabs".to_owned() } else { format!("`{}`", quoted(separator)) };
    format!(
        "columns are separated by {name}; separate them with commas, and write numbers with a decimal point (set \
         the spreadsheet to an English locale)"
    )
}

/// Shortens and escapes a text for an error of one line.
fn quoted(text: &str) -> String {
    text.chars().take(LONGEST_QUOTE).flat_map(char::escape_debug).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(text: &str) -> Result<Vec<Vec<f64>>, String> {
        let table = Table::parse(text, HashLines::Comments).map_err(|wrong| wrong.in_file("t"))?;
        let rows = table.rows().map(|row| {
            let row = row?;
            (0..table.columns().len()).map(|column| row.number(column)).collect()
        });
        rows.collect::<Result<_, TextProblem>>().map_err(|wrong| wrong.in_file("t"))
    }

    #[test]
    fn what_programs_write_is_one_table() {
        let expected = Ok(vec![vec![1.0, -0.5], vec![2.0, 3.0]]);
        for text in [
            "x,y\n1,-0.5\n2,3\n",
            "\u{feff}x,y\r\n1,-0.5\r\n2,3\r\n",
            "\u{feff}sep=,\r\nx,y\r\n1,-0.5\r\n2,3\r\n",
            "# measured\n\n x , y \n 1 , -5e-1\n# half\n\n2,3",
            "\"x\",\"y\"\n\"1\",\"-0.5\"\n2, \"3\" \n",
        ] {
            assert_eq!(numbers(text), expected, "{text:?}");
        }
    }

    #[test]
    fn what_is_refused_has_a_line_and_the_cause() {
        for (text, says) in [
            ("", "t:1: the table is empty; write a header and at least one row"),
            ("x;y\n1,5;2\n", "t:1: columns are separated by `;`; separate them with commas"),
            ("sep=;\nx;y\n1;2\n", "t:1: columns are separated by `;`"),
            ("x\ty\n1\t2\n", "t:1: columns are separated by tabs"),
            ("x,y\n1,2\n3;4\n", "t:3: the line has 1 cell for 2 columns; separate them with commas"),
            ("x,y\n0,5,1,5\n", "t:2: the line has 4 cells for 2 columns; write numbers with a decimal point"),
            ("x,y\n\"0,5\",\"1,5\"\n", "t:2: `x` must be a number, not `0,5`: write a decimal point"),
            ("x,y\n1,\n", "t:2: `y` must be a number, not ``"),
            (",x\n0,1\n", "t:1: column 1 has no name"),
            ("x,y,x\n0,1,2\n", "t:1: the column `x` is given twice; remove one"),
            ("x,y\n\"1,2\n", "t:2: a quotation mark is not closed"),
            ("x,y\n\"1\"2,3\n", "t:2: a comma must follow"),
            ("x,y\n\u{1b}[31m,3\n", "t:2: `x` must be a number, not `\\u{1b}[31m`"),
        ] {
            let told = numbers(text).expect_err("refused");
            assert!(told.starts_with(says), "{told}, not {says}");
        }
    }

    #[test]
    fn a_name_may_begin_with_a_hash() {
        let table = Table::parse("id,x\n#1,2\n", HashLines::Rows).expect("a table");
        let rows: Vec<_> = table.rows().map(|row| row.map(|row| row.text(0).to_owned())).collect();
        assert_eq!(rows, [Ok("#1".to_owned())]);
    }
}
