//! Reader of trajectories from tables of comma-separated values.

use super::Sample;
use flotor_hal::glam::DVec3;
use flotor_hal::{HashLines, Table, TextProblem, orientation_from_rotation_vector};

/// Columns, in this order; the last three may be missing.
const COLUMNS: [&str; 7] = ["time_s", "x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];
/// Number of required columns.
const LEAST_COLUMNS: usize = 4;

/// Reads a trajectory.
pub(super) fn read(text: &str) -> Result<Vec<Sample>, TextProblem> {
    let table = Table::parse(text, HashLines::Comments)?;
    let columns = table.columns().len();
    if ![LEAST_COLUMNS, COLUMNS.len()].contains(&columns) || *table.columns() != COLUMNS[..columns] {
        let [least, all] = [LEAST_COLUMNS, COLUMNS.len()].map(|count| COLUMNS[..count].join(","));
        return Err(table.header_problem(format!("the columns must be {least} or {all}")));
    }
    let mut samples = Vec::new();
    let mut start_s = None;
    for row in table.rows() {
        let row = row?;
        let mut numbers = [0.0; COLUMNS.len()];
        for (column, number) in numbers.iter_mut().enumerate().take(columns) {
            *number = row.finite(column)?;
        }
        let [time_s, x, y, z, rx, ry, rz] = numbers;
        let rotation_rad = DVec3::new(rx, ry, rz);
        let orientation = orientation_from_rotation_vector(rotation_rad);
        let since_start_s = time_s - *start_s.get_or_insert(time_s);
        let sample = Sample::new(since_start_s, DVec3::new(x, y, z), orientation);
        sample
            .and_then(|sample| sample.append_to(&mut samples))
            .map_err(|problem| TextProblem::at(row.line(), problem))?;
    }
    Ok(samples)
}
