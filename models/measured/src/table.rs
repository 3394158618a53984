//! Parser of a table of compression and force.
//!
//! ```text
//! # comments and empty lines are skipped
//! compression_mm,force_n
//! 0,0
//! 2,1.36
//! ```
//!
//! `flotor study spring MEASURED.csv --curve-scene SCENE.toml` writes such a table from a measurement: the mean of loading and
//! unloading, made monotone.

use crate::curve::{Curve, CurveError};
use flotor_hal::{HashLines, Table, TextProblem};

/// Header line of a table.
pub const HEADER: &str = "compression_mm,force_n";

/// Parses a table and builds the curve through its knots. Not real-time.
///
/// # Errors
/// A [`TextProblem`] with the line: wrong header, malformed row, number that is not finite, or knots that [`Curve::new`] rejects.
pub fn parse(text: &str) -> Result<Curve, TextProblem> {
    let table = Table::parse(text, HashLines::Comments)?;
    if table.columns().join(",") != HEADER {
        return Err(table.header_problem(format!("the header must be `{HEADER}`")));
    }
    let (mut numbers, mut knots) = (Vec::new(), Vec::new());
    for row in table.rows() {
        let row = row?;
        knots.push((row.finite(0)? * 1.0e-3, row.finite(1)?));
        numbers.push(row.line());
    }
    Curve::new(&knots).map_err(|error| match error {
        CurveError::Count(count) => {
            let last = numbers.last().copied().unwrap_or(1);
            TextProblem::at(last, format!(
                "the curve has {count} rows up to this line, but needs 3 to {}", Curve::MOST_KNOTS))
        }
        CurveError::Start => {
            let first = numbers.first().copied().unwrap_or(1);
            TextProblem::at(first, "the first row must be `0,0`: without compression a spring has no force")
        }
        CurveError::Order(at) => {
            let number = numbers.get(at).copied().unwrap_or_default();
            TextProblem::at(
                number,
                "compression must grow from row to row and the force must not fall; `flotor study spring FILE \
                 --curve-scene SCENE.toml` converts a measurement to such a table",
            )
        }
    })
}
