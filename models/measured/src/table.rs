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
use flotor_hal::TextProblem;

/// The header a table begins with.
pub const HEADER: &str = "compression_mm,force_n";

/// Reads knots and makes a curve of them. Not real-time.
///
/// # Errors
/// The line that is wrong.
pub fn parse(text: &str) -> Result<Curve, TextProblem> {
    let is_content = |line: &str| !(line.trim().is_empty() || line.trim_start().starts_with('#'));
    let mut lines = (1_usize..).zip(text.lines()).filter(|(_, line)| is_content(line));
    let header = lines.next().map(|(number, line)| (number, line.replace(' ', "")));
    match &header {
        Some((_, line)) if line == HEADER => {}
        Some((number, _)) => return Err(TextProblem::at(*number, format!("the header is `{HEADER}`"))),
        None => return Err(TextProblem::at(1, format!("the table is empty; its header is `{HEADER}`"))),
    }
    let mut numbers = Vec::new();
    let mut knots = Vec::new();
    for (number, line) in lines {
        let mut cells = line.split(',').map(|cell| cell.trim().parse().ok().filter(|x: &f64| x.is_finite()));
        let (Some(Some(compression_mm)), Some(Some(force_n)), None) =
            (cells.next(), cells.next(), cells.next())
        else {
            return Err(TextProblem::at(number, "two finite numbers are expected, separated by a comma"));
        };
        knots.push((compression_mm * 1.0e-3, force_n));
        numbers.push(number);
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
