//! Reader of the reference tables: comma-separated, one header row, no quotes.
//!
//! The file uses no other module of this crate: the models, which cannot depend on the crate, include it with `#[path]`.

#![allow(dead_code)] // each test program uses its part

use flotor_hal::DVec3;
use std::fs;
use std::rc::Rc;

/// Row of a table, with cells by column name.
pub(crate) struct Row {
    header: Rc<[String]>,
    cells: Vec<String>,
}

impl Row {
    /// Returns the text of a cell; panics without such a column.
    pub(crate) fn text(&self, column: &str) -> &str {
        let index = self.header.iter().position(|name| name == column);
        &self.cells[index.unwrap_or_else(|| panic!("no column {column}"))]
    }

    /// Returns the number in a cell; panics without such a column or with other text.
    pub(crate) fn number(&self, column: &str) -> f64 {
        self.text(column).parse().unwrap_or_else(|error| panic!("{column}: {error}"))
    }

    /// Returns the numbers in three cells as a vector; panics as [`Self::number`].
    pub(crate) fn vector(&self, columns: [&str; 3]) -> DVec3 {
        DVec3::from_array(columns.map(|column| self.number(column)))
    }
}

/// Reads the rows of a reference table in `tests/data/cases` of the workspace; panics if the file cannot be read.
pub(crate) fn rows(file: &str) -> Vec<Row> {
    read(&format!("cases/{file}"))
}

/// Reads the rows of a table in `tests/data` of the workspace; panics if the file cannot be read.
pub(crate) fn read(file: &str) -> Vec<Row> {
    let path = format!("{}/../../tests/data/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let mut lines = text.lines();
    let header: Rc<[String]> = split(lines.next().unwrap_or_default()).into();
    lines.map(|line| Row { header: Rc::clone(&header), cells: split(line) }).collect()
}
