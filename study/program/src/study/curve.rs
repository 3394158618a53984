//! Measured force-length curves of real springs: parsing, fitting, and conversion to a curve for the model `measured`.
//!
//! A table has a header and two columns, force and either length or compression:
//!
//! ```text
//! length_mm,force_n            or   compression_mm,force_n
//! 25.0,0.00                         0.0,0.00
//! 20.0,3.41                         5.0,3.41
//! ```

use flotor_hal::{HashLines, Table, TextProblem};
use flotor_statistics::StatisticsError;
use flotor_statistics::describe::mean;
use flotor_statistics::regression::{self, Line};
use serde::Serialize;

/// Measured curve of a spring.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeasuredCurve {
    /// Points of compression, m, and force, N, in the order of measurement.
    pub(super) points: Vec<(f64, f64)>,
    /// Free length (without load), m; `None` if the table has compressions and no free length was given.
    pub(super) free_length_m: Option<f64>,
}

/// Fitted range of the deflection, as fractions of the largest deflection. Outside this range, spring ends that are not yet
/// seated and coils that begin to touch distort the stiffness (EN 15800 measures the spring rate between 30 and 70 %).
pub(super) const FITTED: [f64; 2] = [0.3, 0.7];

/// Linear spring fitted to a curve.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct SpringFit {
    /// Stiffness, N/m.
    pub(super) stiffness_n_per_m: f64,
    /// 95 % confidence interval of the stiffness, N/m.
    pub(super) stiffness_interval_n_per_m: [f64; 2],
    /// Compression at which the fitted line crosses zero force, m: play of the fixture.
    pub(super) offset_m: f64,
    /// Free length (without load), m; `None` if unknown.
    pub(super) free_length_m: Option<f64>,
    /// Compression rigidity gamma, N: stiffness times free length; `None` without a free length.
    pub(super) gamma_n: Option<f64>,
    /// R² of the fitted line over the fitted range.
    pub(super) r_squared: f64,
    /// Number of points in the fitted range.
    pub(super) points: usize,
    /// Largest deviation of any measured point from the line, as a fraction of the largest force.
    pub(super) nonlinearity: f64,
}

/// Measured curve prepared for rendering: averaged, with a force that does not decrease with compression.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct ServedCurve {
    /// Knots of compression, m, and force, N: from (0, 0) on, compression increasing, force not decreasing.
    pub(super) knots: Vec<(f64, f64)>,
    /// Root mean square deviation of the measured points from the curve, N, due to scatter, friction and averaging.
    pub(super) rms_n: f64,
}

/// Number of equal parts of the deflection in which points are averaged: finer than the movement of a hand between two ticks,
/// coarse enough for a part to contain points of both strokes.
const PARTS: u32 = 64;

/// Reason why a measured curve is unusable.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub(super) enum CurveError {
    /// A line is invalid.
    #[error("line {}: {}", .0.line, .0.problem)]
    Line(TextProblem),
    /// The free length is unknown.
    #[error("the table has compressions only; give the length without load (--free-length-mm)")]
    NoFreeLength,
    /// The fitted range has too few points.
    #[error("no line fits the middle of the deflection (30 to 70 %): {0}; measure at more lengths")]
    Statistics(#[from] StatisticsError),
    /// The force decreases with compression; holds the slope, N/m.
    #[error(
        "the force does not rise as the spring is compressed (slope {0:.1} N/m); check the sign of the forces, and whether length \
         and compression are interchanged"
    )]
    Falling(f64),
    /// The points have too few different compressions for a curve; holds their number, zero compression included.
    #[error("the curve needs points at three lengths or more, and has {0}; measure at more lengths")]
    Sparse(usize),
}

impl From<TextProblem> for CurveError {
    fn from(problem: TextProblem) -> Self {
        Self::Line(problem)
    }
}

/// Quantity of the first column.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Abscissa {
    Length,
    Compression,
}

impl MeasuredCurve {
    /// Parses a table. In a table of lengths, the largest length is the free length unless `free_length_m` is given.
    ///
    /// # Errors
    /// [`CurveError::Line`] if the header or a line is invalid.
    pub(super) fn parse(text: &str, free_length_m: Option<f64>) -> Result<Self, CurveError> {
        let table = Table::parse(text, HashLines::Comments)?;
        let abscissa = match table.columns().join(",").as_str() {
            "length_mm,force_n" => Abscissa::Length,
            "compression_mm,force_n" => Abscissa::Compression,
            _ => {
                let problem = "the header must be `length_mm,force_n` or `compression_mm,force_n`";
                return Err(table.header_problem(problem).into());
            }
        };
        let rows = table.rows().map(|row| {
            let row = row?;
            Ok((row.finite(0)? * 1.0e-3, row.finite(1)?))
        });
        let rows: Vec<(f64, f64)> = rows.collect::<Result<_, TextProblem>>()?;
        let longest_m = rows.iter().map(|(length_m, _)| *length_m).fold(f64::NEG_INFINITY, f64::max);
        Ok(match abscissa {
            Abscissa::Compression => Self { points: rows, free_length_m },
            Abscissa::Length => {
                let free_m = free_length_m.unwrap_or(longest_m);
                let points = rows.into_iter().map(|(length_m, force_n)| (free_m - length_m, force_n));
                Self { points: points.collect(), free_length_m: Some(free_m) }
            }
        })
    }

    /// Fits a linear spring to the middle of the deflection ([`FITTED`]) by least squares.
    ///
    /// # Errors
    /// [`CurveError`] if the range has too few points, or the force decreases with compression.
    pub(super) fn fit(&self) -> Result<SpringFit, CurveError> {
        let deepest_m = self.points.iter().map(|(x, _)| *x).fold(0.0, f64::max);
        let [from_m, to_m] = FITTED.map(|share| share * deepest_m);
        let middle = self.points.iter().filter(|(x, _)| (from_m..=to_m).contains(x));
        let (x, f): (Vec<f64>, Vec<f64>) = middle.copied().unzip();
        let line: Line = regression::line(&x, &f)?;
        if line.slope <= 0.0 {
            return Err(CurveError::Falling(line.slope));
        }
        let strongest_n = self.points.iter().map(|(_, force_n)| force_n.abs()).fold(0.0, f64::max);
        let off = |(x, force_n): &(f64, f64)| (force_n - (line.intercept + line.slope * x)).abs();
        Ok(SpringFit {
            stiffness_n_per_m: line.slope,
            stiffness_interval_n_per_m: line.slope_interval,
            offset_m: -line.intercept / line.slope,
            free_length_m: self.free_length_m,
            gamma_n: self.free_length_m.map(|length_m| line.slope * length_m),
            r_squared: line.r_squared,
            points: x.len(),
            nonlinearity: self.points.iter().map(off).fold(0.0, f64::max) / strongest_n,
        })
    }

    /// Computes the curve for rendering: averages the points in small parts of the deflection (over both strokes, if measured),
    /// begins at zero force and compression, and makes the force non-decreasing (isotonic regression by the
    /// pool-adjacent-violators algorithm).
    ///
    /// # Errors
    /// [`CurveError::Sparse`] if fewer than two parts of the deflection have points.
    pub(super) fn served(&self) -> Result<ServedCurve, CurveError> {
        let deepest_m = self.points.iter().map(|(x, _)| *x).fold(0.0, f64::max);
        let part_m = deepest_m / f64::from(PARTS);
        // Part 0 is about zero compression, where the force is zero: it has no points.
        let mut parts: Vec<(f64, f64, f64)> = vec![(0.0, 0.0, 0.0); PARTS as usize + 1];
        for (x_m, force_n) in self.points.iter().filter(|(x_m, _)| *x_m > 0.5 * part_m) {
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // positive, at most PARTS
            if let Some(part) = parts.get_mut((x_m / part_m).round() as usize) {
                *part = (part.0 + 1.0, part.1 + x_m, part.2 + force_n.max(0.0));
            }
        }
        let filled = parts.into_iter().filter(|(count, ..)| *count > 0.0);
        let means: Vec<(f64, f64, f64)> =
            filled.map(|(count, x_m, force_n)| (count, x_m / count, force_n / count)).collect();
        if means.len() < 2 {
            return Err(CurveError::Sparse(means.len() + 1));
        }
        let weighted: Vec<(f64, f64)> = means.iter().map(|(count, _, force_n)| (*count, *force_n)).collect();
        let forces = never_falling(&weighted);
        let inner = means.iter().zip(forces).map(|((_, x_m, _), force_n)| (*x_m, force_n));
        let knots: Vec<(f64, f64)> = std::iter::once((0.0, 0.0)).chain(inner).collect();
        let square = |(x_m, force_n): &(f64, f64)| {
            let apart_n = force_n - between(&knots, *x_m);
            apart_n * apart_n
        };
        let squares: Vec<f64> = self.points.iter().map(square).collect();
        Ok(ServedCurve { rms_n: mean(&squares).sqrt(), knots })
    }
}

impl ServedCurve {
    /// Formats the curve as a table (CSV) for the force model `measured`.
    #[must_use]
    pub(super) fn to_table(&self) -> String {
        let row = |(x_m, force_n): &(f64, f64)| format!("{:.6},{force_n:.6}\n", x_m * 1.0e3);
        let rows: String = self.knots.iter().map(row).collect();
        format!("compression_mm,force_n\n{rows}")
    }
}

/// Returns the closest non-decreasing values to `(weight, value)` pairs by weighted least squares (pool-adjacent-violators
/// algorithm).
fn never_falling(weighted: &[(f64, f64)]) -> Vec<f64> {
    let mut blocks: Vec<(f64, f64, usize)> = Vec::new();
    for (weight, value) in weighted {
        let mut block = (*weight, *value, 1);
        while let Some((before, lower, count)) = blocks.pop_if(|(_, lower, _)| *lower > block.1) {
            let sum = before + block.0;
            block = (sum, (before * lower + block.0 * block.1) / sum, count + block.2);
        }
        blocks.push(block);
    }
    blocks.into_iter().flat_map(|(_, value, count)| std::iter::repeat_n(value, count)).collect()
}

/// Interpolates the force linearly between knots; constant beyond the last knot, zero before the first.
fn between(knots: &[(f64, f64)], x_m: f64) -> f64 {
    let after = knots.partition_point(|(at, _)| *at <= x_m);
    match (after.checked_sub(1).and_then(|before| knots.get(before)), knots.get(after)) {
        (Some(a), Some(b)) => a.1 + (b.1 - a.1) * (x_m - a.0) / (b.0 - a.0),
        (Some(last), None) => last.1,
        (None, _) => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A spring of 0.68 N/mm and 25 mm whose coils touch beyond 80 %: the middle gives its stiffness back.
    #[test]
    fn the_middle_of_the_deflection_tells_the_stiffness() {
        let mut text = "# test bench 3\nlength_mm,force_n\n".to_owned();
        for tenth in 0..=100_u32 {
            let x_mm = f64::from(tenth) * 0.1;
            let block_n = 5.0 * (x_mm - 8.0).max(0.0);
            text += &format!("{},{}\n", 25.0 - x_mm, 0.68 * x_mm + block_n);
        }
        let fit = MeasuredCurve::parse(&text, None).unwrap().fit().unwrap();
        // Rounding of decimal numbers, and nothing else.
        assert!((fit.stiffness_n_per_m - 680.0).abs() < 1.0e-6, "{fit:?}");
        assert!((fit.gamma_n.unwrap() - 17.0).abs() < 1.0e-7 && fit.offset_m.abs() < 1.0e-9);
        assert!((fit.nonlinearity - 10.0 / 16.8).abs() < 1.0e-9 && fit.points == 41);
    }

    /// A stiffness needs no free length; a rigidity does.
    #[test]
    fn compressions_alone_tell_the_stiffness_and_no_more() {
        let rows: String = (0..=20).map(|step| format!("{step},{}\n", 0.5 * f64::from(step))).collect();
        let fit = MeasuredCurve::parse(&("compression_mm,force_n\n".to_owned() + &rows), None);
        let fit = fit.unwrap().fit().unwrap();
        assert!((fit.stiffness_n_per_m - 500.0).abs() < 1.0e-6, "{fit:?}");
        assert_eq!((fit.free_length_m, fit.gamma_n), (None, None));
    }

    /// Two strokes with friction between them and scatter on top: what is served lies in the middle, begins at nothing and
    /// never falls.
    #[test]
    fn what_is_served_is_the_middle_of_both_strokes_and_never_falls() {
        let mut text = "compression_mm,force_n\n".to_owned();
        for step in 0..=1000_u32 {
            let x_mm = f64::from(step) * 0.01;
            let scatter_n = 0.03 * (f64::from(step) * 12.9898).sin();
            text += &format!("{x_mm},{}\n{x_mm},{}\n", 0.68 * x_mm + 0.1 + scatter_n, 0.68 * x_mm - 0.1);
        }
        let curve = MeasuredCurve::parse(&text, Some(0.025)).unwrap();
        let served = curve.served().unwrap();
        assert_eq!((served.knots[0], served.knots.len()), ((0.0, 0.0), 65));
        assert!(served.knots.windows(2).all(|pair| pair[1].0 > pair[0].0 && pair[1].1 >= pair[0].1));
        for (x_m, force_n) in &served.knots[1..] {
            // A mean of 15 points of such scatter.
            assert!((force_n - 680.0 * x_m).abs() < 0.02, "{x_m}: {force_n}");
        }
        // Friction of 0.1 N, and the scatter.
        assert!((0.09..0.12).contains(&served.rms_n), "{}", served.rms_n);
        assert_eq!(served.to_table().lines().nth(1), Some("0.000000,0.000000"));
        let few = MeasuredCurve::parse("compression_mm,force_n\n0,0\n1,2\n", Some(0.02)).unwrap();
        assert_eq!(few.served(), Err(CurveError::Sparse(2)));
    }

    #[test]
    fn values_in_the_wrong_order_become_their_weighted_mean() {
        let values = never_falling(&[(1.0, 1.0), (1.0, 4.0), (3.0, 2.0), (1.0, 2.4), (1.0, 5.0)]);
        assert_eq!(values, [1.0, 2.48, 2.48, 2.48, 5.0]);
    }

    #[test]
    fn what_is_no_curve_is_refused_with_its_line() {
        let refused = |text: &str| MeasuredCurve::parse(text, None).unwrap_err().to_string();
        assert!(refused("x,y\n1,2\n").starts_with("line 1: the header"));
        assert!(
            refused("length_mm,force_n\n1,2\n3;4\n")
                .starts_with("line 3: the line has 1 cell for 2 columns; separate them with commas")
        );
        assert!(refused("length_mm,force_n\n1,nan\n").starts_with("line 2"));
        let few = MeasuredCurve::parse("compression_mm,force_n\n0,0\n1,2\n", Some(0.02)).unwrap();
        assert!(matches!(few.fit(), Err(CurveError::Statistics(_))));
        let falling = "compression_mm,force_n\n0,9\n4,5\n5,4\n6,3\n10,0\n";
        let falling = MeasuredCurve::parse(falling, Some(0.02)).unwrap();
        assert!(matches!(falling.fit(), Err(CurveError::Falling(_))));
    }
}
