//! The table a curve is read from.
//!
//! ```text
//! # comments and empty lines are skipped
//! compression_mm,force_n
//! 0,0
//! 2,1.36
//! ```
//!
//! `flotor study spring MEASURED.csv --curve-scene SCENE.toml` makes one of a measurement: both strokes averaged, the force never
//! falling.

use crate::curve::{Curve, CurveError};
use flotor_hal::{HashLines, Table, TextProblem};

/// The header a table begins with.
pub const HEADER: &str = "compression_mm,force_n";

/// Reads knots and makes a curve of them. Not real-time.
///
/// # Errors
/// The line that is wrong.
pub fn parse(text: &str) -> Result<Curve, TextProblem> {
    let table = Table::parse(text, HashLines::Comments)?;
    if table.columns().join(",") != HEADER {
        return Err(table.header_problem(format!("the header is `{HEADER}`")));
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
            TextProblem::at(last, format!("{count} rows up to here; a curve has 3 to {}", Curve::MOST_KNOTS))
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
                 --curve-scene SCENE.toml` makes such a table of a measurement",
            )
        }
    })
}
