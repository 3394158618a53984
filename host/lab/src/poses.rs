//! A table of poses: `[id,]x_m,y_m,z_m,rx_rad,ry_rad,rz_rad`, one row a pose.

use crate::evaluate::Handle;
use flotor_hal::DVec3;
use flotor_session::scene::did_you_mean;

/// Columns of a pose, in order.
const POSE_COLUMNS: [&str; 6] = ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];
/// Optional first column.
const ID_COLUMN: &str = "id";
/// Longest text of a table that a message repeats, characters.
const LONGEST_QUOTE: usize = 40;

/// The poses of a table and their names.
#[derive(Clone, Debug, PartialEq)]
pub struct Poses {
    /// The column `id`, or the number of the row, from 0.
    pub ids: Vec<String>,
    /// A pose a row; NaN and infinity are legal.
    pub handles: Vec<Handle>,
}

/// Why a table is none, with file and line; an empty file has no line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct PosesError {
    place: String,
    problem: String,
}

impl Poses {
    /// Reads a table; `file` is its name in errors. Not real-time.
    ///
    /// # Errors
    /// [`PosesError`]: the line, and what is wrong with it.
    pub fn parse(file: &str, bytes: &[u8]) -> Result<Self, PosesError> {
        let wrong = |line: usize, problem: String| PosesError { place: format!("{file}:{line}"), problem };
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let before = bytes.iter().take(error.valid_up_to());
            wrong(
                1 + before.filter(|byte| **byte == b'\n').count(),
                "this is not UTF-8; save the poses as UTF-8".to_owned(),
            )
        })?;
        if text.trim().is_empty() {
            let problem = format!("no poses; the header is {}", header_text());
            return Err(PosesError { place: file.to_owned(), problem });
        }
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
        let line = |at: Option<&csv::Position>| at.map_or(1, |at| line_of(text, at));
        let malformed = |error: csv::Error| {
            let problem = match error.kind() {
                csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                    format!("{len} columns, but the header has {expected_len}")
                }
                _ => error.to_string(),
            };
            wrong(line(error.position()), problem)
        };
        let header = reader.headers().map_err(malformed)?.clone();
        let columns = columns(&header).map_err(|problem| wrong(1, problem))?;
        let id_column = header.iter().position(|name| name == ID_COLUMN);

        let mut poses = Self { ids: Vec::new(), handles: Vec::new() };
        for record in reader.into_records() {
            let record = record.map_err(malformed)?;
            let mut numbers = [0.0; 6];
            for ((number, column), name) in numbers.iter_mut().zip(columns).zip(POSE_COLUMNS) {
                let text = record.get(column).unwrap_or_default();
                let problem = |_| {
                    wrong(line(record.position()), format!("{name} must be a number, not `{}`", plain(text)))
                };
                *number = text.parse().map_err(problem)?;
            }
            let id = id_column.and_then(|column| record.get(column)).map(str::to_owned);
            poses.ids.push(id.unwrap_or_else(|| poses.handles.len().to_string()));
            let [x, y, z, rx, ry, rz] = numbers;
            let (position_m, rotation_rad) = (DVec3::new(x, y, z), DVec3::new(rx, ry, rz));
            poses.handles.push(Handle { position_m, rotation_rad });
        }
        Ok(poses)
    }
}

/// Line, from 1, on which a record stands. The reader's own count ends before blank lines it is about to skip.
fn line_of(text: &str, at: &csv::Position) -> usize {
    let start = usize::try_from(at.byte()).unwrap_or(usize::MAX).min(text.len());
    let (before, from_here) = text.split_at_checked(start).unwrap_or((text, ""));
    let blank = from_here.len() - from_here.trim_start_matches(['\n', '\r']).len();
    let skipped = from_here.get(..blank).unwrap_or_default();
    1 + before.matches('\n').count() + skipped.matches('\n').count()
}

/// Where each pose column is; the error of a missing or unknown one names the right columns.
fn columns(header: &csv::StringRecord) -> Result<[usize; 6], String> {
    let known = || POSE_COLUMNS.iter().copied().chain([ID_COLUMN]);
    if let Some(unknown) = header.iter().find(|name| !known().any(|column| column == *name)) {
        let hint = did_you_mean(unknown, known());
        return Err(format!("unknown column `{}`{hint} (the header is {})", plain(unknown), header_text()));
    }
    let mut columns = [0; 6];
    for (column, name) in columns.iter_mut().zip(POSE_COLUMNS) {
        let found = header.iter().position(|found| found == name);
        *column = found.ok_or_else(|| format!("column `{name}` is missing"))?;
    }
    Ok(columns)
}

/// A text of the table in a message of one line: what stands in quotation marks may have several.
fn plain(text: &str) -> String {
    text.chars().take(LONGEST_QUOTE).flat_map(char::escape_debug).collect()
}

/// The header as people write it.
fn header_text() -> String {
    format!("[{ID_COLUMN},]{}", POSE_COLUMNS.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_no_text_is_named() {
        let told = |bytes: &[u8]| Poses::parse("poses.csv", bytes).expect_err("it is none").to_string();
        let mut bytes = b"x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,0,0,0,0\n0,0,".to_vec();
        bytes.extend([0xff, b',', b'0']);
        assert_eq!(told(&bytes), "poses.csv:3: this is not UTF-8; save the poses as UTF-8");
        assert_eq!(told(b"x_m\n"), "poses.csv:1: column `y_m` is missing");
    }
}
