//! Table of poses: `[id,]x_m,y_m,z_m,rx_rad,ry_rad,rz_rad`, one row per pose.

use crate::evaluate::Handle;
use flotor_hal::{DVec3, HashLines, Table, TextProblem, text_from_bytes};
use flotor_session::scene::did_you_mean;

/// Columns of a pose, in order.
const POSE_COLUMNS: [&str; 6] = ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];
/// Optional first column.
const ID_COLUMN: &str = "id";
/// Maximum length of a quotation from the table in a message, characters.
const LONGEST_QUOTE: usize = 40;

/// Poses of a table with their names.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// Values of the column `id`, or the numbers of the rows, from 0.
    pub ids: Vec<String>,
    /// Pose of each row; NaN and infinity are valid.
    pub handles: Vec<Handle>,
}

/// Error in a table, with file and line; an empty file has no line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct PosesError(String);

impl Poses {
    /// Parses a table; `file`: name for errors. Not real-time.
    ///
    /// # Errors
    /// [`PosesError`] with the line and the problem.
    pub fn parse(file: &str, bytes: Vec<u8>) -> Result<Self, PosesError> {
        let wrong = |problem: &TextProblem| PosesError(problem.in_file(file));
        let text = text_from_bytes(bytes).map_err(|problem| wrong(&problem))?;
        if text.trim().is_empty() {
            return Err(wrong(&TextProblem::of_file(format!(
                "the table is empty; write the header {} and one row for each pose",
                header_text()
            ))));
        }
        Self::of_table(&text).map_err(|problem| wrong(&problem))
    }

    fn of_table(text: &str) -> Result<Self, TextProblem> {
        let table = Table::parse(text, HashLines::Rows)?;
        let columns = columns(table.columns()).map_err(|problem| table.header_problem(problem))?;
        let id_column = table.column(ID_COLUMN);
        let mut poses = Self { ids: Vec::new(), handles: Vec::new() };
        for row in table.rows() {
            let row = row?;
            let mut numbers = [0.0; 6];
            for (number, column) in numbers.iter_mut().zip(columns) {
                *number = row.number(column)?;
            }
            let id = id_column.map(|column| row.text(column).to_owned());
            poses.ids.push(id.unwrap_or_else(|| poses.handles.len().to_string()));
            let [x, y, z, rx, ry, rz] = numbers;
            let (position_m, rotation_rad) = (DVec3::new(x, y, z), DVec3::new(rx, ry, rz));
            poses.handles.push(Handle { position_m, rotation_rad });
        }
        Ok(poses)
    }
}

/// Returns the position of each pose column; the error of a missing or unknown one names the right columns.
fn columns(header: &[String]) -> Result<[usize; 6], String> {
    let (known, expected) = (|| POSE_COLUMNS.iter().copied().chain([ID_COLUMN]), header_text());
    if let Some(unknown) = header.iter().find(|name| !known().any(|column| column == name.as_str())) {
        let hint = did_you_mean(unknown, known());
        return Err(format!("unknown column `{}`{hint} (the header must be {expected})", plain(unknown)));
    }
    let mut columns = [0; 6];
    for (column, name) in columns.iter_mut().zip(POSE_COLUMNS) {
        let found = header.iter().position(|found| found == name);
        *column =
            found.ok_or_else(|| format!("column `{name}` is missing (the header must be {expected})"))?;
    }
    Ok(columns)
}

/// Escapes a text of the table for a message of one line: quoted text may have several.
fn plain(text: &str) -> String {
    text.chars().take(LONGEST_QUOTE).flat_map(char::escape_debug).collect()
}

/// Returns the header as users write it.
fn header_text() -> String {
    format!("[{ID_COLUMN},]{}", POSE_COLUMNS.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_no_text_is_named() {
        let told =
            |bytes: &[u8]| Poses::parse("poses.csv", bytes.to_vec()).expect_err("it is none").to_string();
        let mut bytes = b"x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,0,0,0,0\n0,0,".to_vec();
        bytes.extend([0xff, b',', b'0']);
        assert_eq!(told(&bytes), "poses.csv:3: the file is not UTF-8; save the file as UTF-8");
        assert_eq!(
            told(b"x_m\n"),
            "poses.csv:1: column `y_m` is missing (the header must be [id,]x_m,y_m,z_m,rx_rad,ry_rad,rz_rad)"
        );
    }
}
