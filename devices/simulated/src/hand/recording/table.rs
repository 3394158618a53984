//! Tables of comma-separated values.

use super::Sample;
use flotor_hal::glam::DVec3;
use flotor_hal::orientation_from_rotation_vector;

/// Columns, in this order; the last three may be missing.
const COLUMNS: [&str; 7] = ["time_s", "x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];
/// Columns that must be there.
const LEAST_COLUMNS: usize = 4;

/// Reads a table.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<Sample>, String> {
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes);
    let columns = reader.headers().map_err(|error| error.to_string())?.len();
    let expected = COLUMNS.get(..columns).filter(|_| columns == LEAST_COLUMNS || columns == COLUMNS.len());
    if expected.is_none_or(|expected| reader.headers().ok().is_none_or(|found| found != expected)) {
        let [least, all] = [LEAST_COLUMNS, COLUMNS.len()].map(|count| COLUMNS[..count].join(","));
        return Err(format!("line 1: the columns are {least} or {all}"));
    }
    let mut samples = Vec::new();
    let mut start_s = None;
    for row in reader.records() {
        let row = row.map_err(|error| error.to_string())?;
        let line = row.position().map_or(0, csv::Position::line);
        let add = |problem: String| format!("line {line}: {problem}");
        let mut numbers = [0.0; COLUMNS.len()];
        for ((number, text), column) in numbers.iter_mut().zip(&row).zip(COLUMNS) {
            *number = text.parse().map_err(|_| add(format!("`{column}` must be a number, not `{text}`")))?;
        }
        let [time_s, x, y, z, rx, ry, rz] = numbers;
        let rotation_rad = DVec3::new(rx, ry, rz);
        if !rotation_rad.is_finite() {
            return Err(add("the rotation is not finite".to_owned()));
        }
        let orientation = orientation_from_rotation_vector(rotation_rad);
        let since_start_s = time_s - *start_s.get_or_insert(time_s);
        let sample = Sample::new(since_start_s, DVec3::new(x, y, z), orientation);
        sample.and_then(|sample| sample.append_to(&mut samples)).map_err(add)?;
    }
    Ok(samples)
}
