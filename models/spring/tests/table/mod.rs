//! Reads the reference tables: comma-separated, one header row, no quotes.

use std::fs;

use flotor_hal::glam::DVec3;
use flotor_spring::preset::Preset;

/// One row, its cells found by column name.
pub(crate) struct Row {
    header: Vec<String>,
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

/// The rows of a table in `tests/data/cases` of the workspace.
pub(crate) fn rows(file: &str) -> Vec<Row> {
    let path = format!("{}/../../tests/data/cases/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let split = |line: &str| line.split(',').map(str::to_owned).collect::<Vec<_>>();
    let mut lines = text.lines();
    let header = split(lines.next().unwrap_or_default());
    lines.map(|line| Row { header: header.clone(), cells: split(line) }).collect()
}

/// The preset a row is about.
pub(crate) fn preset(row: &Row) -> Preset {
    match row.text("spring") {
        "1" => Preset::Thesis1,
        "2" => Preset::Thesis2,
        "3" => Preset::Thesis3,
        "4" => Preset::Slender,
        other => panic!("no spring {other}"),
    }
}
