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

/// Maximum length of a quotation in an error, characters.
const LONGEST_QUOTE: usize = 80;

/// Parses a table and builds the curve through its knots. Not real-time.
///
/// # Errors
/// A [`TextProblem`] with the line: wrong header, malformed row, number that is not finite, or knots that [`Curve::new`] rejects.
pub fn parse(text: &str) -> Result<Curve, TextProblem> {
    let table = Table::parse(text, HashLines::Comments)?;
    let header = table.columns().join(",");
    if header != HEADER {
        let found: String = header.chars().take(LONGEST_QUOTE).flat_map(char::escape_debug).collect();
        return Err(table.header_problem(format!("the header must be `{HEADER}`, not `{found}`")));
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
                "the number of rows up to this line is {count}, but must be 3 to {}; add or remove rows", Curve::MOST_KNOTS))
        }
        CurveError::Start => {
            let first = numbers.first().copied().unwrap_or(1);
            TextProblem::at(first, "the first row must be `0,0`: without compression a spring has no force")
        }
        CurveError::Order(at) => {
            let number = numbers.get(at).copied().unwrap_or_default();
            let [(before_m, before_n), (now_m, now_n)] =
                [at.saturating_sub(1), at].map(|index| knots.get(index).copied().unwrap_or_default());
            let problem = if now_m > before_m {
                format!("the force decreases from {before_n} N in the row before to {now_n} N")
            } else {
                format!(
                    "the compression does not increase: {:.6} mm in the row before, then {:.6} mm",
                    before_m * 1.0e3,
                    now_m * 1.0e3
                )
            };
            TextProblem::at(
                number,
                format!(
                    "{problem}; convert a measurement to a curve with `flotor study spring FILE --curve-scene \
                     SCENE.toml`"
                ),
            )
        }
    })
}
