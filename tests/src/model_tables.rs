//! Reads the reference tables: comma-separated, one header row, no quotes.
//!
//! Needs nothing of this crate: the models, which cannot depend on it, include this file with `#[path]`.

#![allow(dead_code)] // each test program uses its part

use flotor_hal::DVec3;
use std::fs;
use std::rc::Rc;

/// One row, its cells found by column name.
pub(crate) struct Row {
    header: Rc<[String]>,
    cells: Vec<String>,
}

impl Row {
    /// Cell as text.
    pub(crate) fn text(&self, column: &str) -> &str {
        let index = self.header.iter().position(|name| name == column);
        &self.cells[index.unwrap_or_else(|| panic!("no column {column}"))]
    }

    /// Cell as number.
    pub(crate) fn number(&self, column: &str) -> f64 {
        self.text(column).parse().unwrap_or_else(|error| panic!("{column}: {error}"))
    }

    /// Three cells as a vector.
    pub(crate) fn vector(&self, columns: [&str; 3]) -> DVec3 {
        DVec3::from_array(columns.map(|column| self.number(column)))
    }
}

/// The rows of a reference table, in `tests/data/cases` of the workspace.
pub(crate) fn rows(file: &str) -> Vec<Row> {
    read(&format!("cases/{file}"))
}

/// The rows of a file in `tests/data` of the workspace.
pub(crate) fn read(file: &str) -> Vec<Row> {
    let path = format!("{}/../../tests/data/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let mut lines = text.lines();
    let header: Rc<[String]> = split(lines.next().unwrap_or_default()).into();
    lines.map(|line| Row { header: Rc::clone(&header), cells: split(line) }).collect()
}
