//! Polynomial fit of the readings: least squares, degree by cross-validation, confidence.
//!
//! With the commanded force `F`, the delivered ratio `s(z)` and the weight `W` of the moving part, the sensor reads
//!
//! ```text
//! R = F s(z) - W,      s(z) = a0 P0(u) + a1 P1(u) + ... + ad Pd(u),      u = z over the measured range, -1..1
//! ```
//!
//! which is linear in all unknowns; two forces separate the ratio from the weight. The Legendre polynomials `Pk` make
//! the unknowns nearly independent; the result is stored as powers of the height.
//!
//! **Degree.** Each height is left out once and predicted from all others (single readings would be predicted by their
//! neighbours). The choice is the smallest degree whose error is within one standard error of the least (Breiman et al.
//! 1984, the one-standard-error rule): a higher degree fits noise.

use super::CalibrationError;
use super::least_squares::{Solution, solve};
use super::procedure::Reading;
use flotor_hal::{CALIBRATION_COEFFICIENTS, VerticalCalibration, math};

/// Highest degree of a fit: one below the highest degree of the file format.
pub const MAX_DEGREE: usize = CALIBRATION_COEFFICIENTS - 2;

/// Quantile of the normal distribution for a two-sided interval of 95 %; there are hundreds of readings.
const QUANTILE_95: f64 = 1.959_963_985;

/// Prediction error of a degree on heights left out of the fit.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Candidate {
    /// Degree of the polynomial.
    pub degree: usize,
    /// Root mean square of the prediction error, N.
    pub error_n: f64,
    /// Standard error of `error_n` over the heights, N.
    pub standard_error_n: f64,
}

/// Fitted calibration with its confidence.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Fitted ratio of delivered to commanded force over the height.
    pub calibration: VerticalCalibration,
    /// Degree of the curve.
    pub degree: usize,
    /// Prediction errors of all degrees from 0 to [`MAX_DEGREE`].
    pub candidates: Vec<Candidate>,
    /// Weight of the moving part, N, with the half width of its 95 % interval.
    pub weight_n: [f64; 2],
    /// Standard deviation of the residuals, N.
    pub residual_n: f64,
    /// Largest half width of the 95 % band of the curve's shape (its deviation from its mean) over the measured
    /// heights, percent of the commanded force.
    pub band_95_percent: f64,
    /// Residual of each reading, N, in the order of the readings.
    pub residuals_n: Vec<f64>,
}

/// Fits a calibration to the readings. Not real-time.
///
/// # Errors
/// [`CalibrationError::TooFew`] with fewer than two forces, with no more heights than a curve of [`MAX_DEGREE`] has
/// coefficients, or if the readings do not determine the curve; [`CalibrationError::Implausible`] if the curve is not a
/// valid calibration.
pub fn fit(readings: &[Reading]) -> Result<Fit, CalibrationError> {
    let stops = distinct(readings.iter().map(|reading| u64::from(reading.stop)));
    let forces = distinct(readings.iter().map(|reading| reading.commanded_n.to_bits()));
    let too_few = |needed: String| CalibrationError::TooFew {
        readings: readings.len(),
        heights: stops.len(),
        forces: forces.len(),
        needed,
    };
    if forces.len() < 2 {
        return Err(too_few(
            "measure at two or more different forces (--force), to separate the weight from the field"
                .to_owned(),
        ));
    }
    if stops.len() < MAX_DEGREE + 2 {
        return Err(too_few(format!("measure at {} heights or more (--steps)", MAX_DEGREE + 2)));
    }
    let same_heights = || too_few("measure at heights that differ more (--step-mm)".to_owned());
    let scale = Scale::of(readings);
    let candidates: Option<Vec<Candidate>> =
        (0..=MAX_DEGREE).map(|degree| cross_validate(readings, &stops, &scale, degree)).collect();
    let candidates = candidates.ok_or_else(same_heights)?;
    let degree = choose(&candidates);
    let solution = solution(readings.iter(), &scale, degree).ok_or_else(same_heights)?;

    let shares: Vec<f64> = solution.x.iter().take(degree + 1).copied().collect();
    let calibration = VerticalCalibration::new(scale.range_m(), &scale.powers_of_height(&shares))?;
    let freedom = readings.len().saturating_sub(solution.x.len()).max(1) as f64;
    let residual_n = (solution.residual_squares / freedom).sqrt();
    let weight_n = solution.x.last().copied().unwrap_or(f64::NAN);
    let mut weight_direction = vec![0.0; degree + 1];
    weight_direction.push(1.0);
    let weight_95_n = QUANTILE_95 * residual_n * solution.unit_variance(&weight_direction).sqrt();
    let residual = |reading: &Reading| reading.force_n - predict(reading, &solution, &scale, degree);
    let residuals_n = readings.iter().map(residual).collect();
    Ok(Fit {
        calibration,
        degree,
        candidates,
        weight_n: [weight_n, weight_95_n],
        residual_n,
        band_95_percent: QUANTILE_95 * residual_n * shape_deviation(&solution, degree) * 100.0,
        residuals_n,
    })
}

/// Maps the measured heights to -1..1.
struct Scale {
    middle_m: f64,
    half_m: f64,
}

impl Scale {
    fn of(readings: &[Reading]) -> Self {
        let heights = || readings.iter().map(|reading| reading.height_m);
        let (low, high) =
            (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
        Self { middle_m: 0.5 * (low + high), half_m: 0.5 * (high - low) }
    }

    fn range_m(&self) -> [f64; 2] {
        [self.middle_m - self.half_m, self.middle_m + self.half_m]
    }

    fn unit(&self, height_m: f64) -> f64 {
        (height_m - self.middle_m) / self.half_m
    }

    /// Converts coefficients of Legendre polynomials of `u` to coefficients of powers of the height in m.
    fn powers_of_height(&self, shares: &[f64]) -> Vec<f64> {
        let mut powers = vec![0.0; shares.len()];
        // Evaluate Pk as polynomials in z, by the three-term recurrence (k+1) P(k+1) = (2k+1) u Pk - k P(k-1).
        let [u0, u1] = [-self.middle_m / self.half_m, 1.0 / self.half_m];
        let (mut before, mut now): (Vec<f64>, Vec<f64>) = (Vec::new(), vec![1.0]);
        for (k, share) in (0_u32..).zip(shares) {
            powers.iter_mut().zip(&now).for_each(|(power, term)| *power += share * term);
            let (k, mut next) = (f64::from(k), vec![0.0; now.len() + 1]);
            for (index, term) in now.iter().enumerate() {
                let grown = (2.0 * k + 1.0) / (k + 1.0) * term;
                if let Some(slot) = next.get_mut(index) {
                    *slot += grown * u0;
                }
                if let Some(slot) = next.get_mut(index + 1) {
                    *slot += grown * u1;
                }
            }
            next.iter_mut().zip(&before).for_each(|(slot, term)| *slot -= k / (k + 1.0) * term);
            before = std::mem::replace(&mut now, next);
        }
        powers
    }
}

/// Returns Legendre polynomials 0 to `degree` at `u`.
fn legendre(u: f64, degree: usize) -> Vec<f64> {
    let mut values = vec![1.0, u];
    for k in 1..degree.max(1) {
        let [before, now] = [k - 1, k].map(|index| values.get(index).copied().unwrap_or(0.0));
        let k = k as f64;
        values.push(((2.0 * k + 1.0) * u * now - k * before) / (k + 1.0));
    }
    values.truncate(degree + 1);
    values
}

fn row(reading: &Reading, scale: &Scale, degree: usize) -> Vec<f64> {
    let shares = legendre(scale.unit(reading.height_m), degree).into_iter();
    shares.map(|value| value * reading.commanded_n).chain([-1.0]).collect()
}

fn solution<'r>(
    readings: impl Iterator<Item = &'r Reading>,
    scale: &Scale,
    degree: usize,
) -> Option<Solution> {
    let (rows, values): (Vec<_>, Vec<_>) =
        readings.map(|reading| (row(reading, scale, degree), reading.force_n)).unzip();
    solve(&rows, &values)
}

fn predict(reading: &Reading, solution: &Solution, scale: &Scale, degree: usize) -> f64 {
    row(reading, scale, degree).iter().zip(&solution.x).map(|(a, b)| a * b).sum()
}

/// Returns the prediction error of a degree, where each height is predicted from all others; `None` if the others do
/// not determine the curve.
fn cross_validate(readings: &[Reading], stops: &[u64], scale: &Scale, degree: usize) -> Option<Candidate> {
    let mut squares = Vec::new();
    for stop in stops {
        let (left_out, kept): (Vec<_>, Vec<_>) =
            readings.iter().partition(|reading| u64::from(reading.stop) == *stop);
        let solution = solution(kept.into_iter(), scale, degree)?;
        let errors =
            left_out.iter().map(|reading| reading.force_n - predict(reading, &solution, scale, degree));
        squares.push(mean(errors.map(|error| error * error)));
    }
    let square = mean(squares.iter().copied());
    let count = squares.len() as f64;
    let spread = (mean(squares.iter().map(|value| math::powi(value - square, 2))) / (count - 1.0)).sqrt();
    let error_n = square.sqrt();
    // Standard error of a square root: that of the radicand, over twice the root.
    Some(Candidate { degree, error_n, standard_error_n: spread / (2.0 * error_n) })
}

/// Returns the smallest degree within one standard error of the best.
fn choose(candidates: &[Candidate]) -> usize {
    let best = candidates.iter().min_by(|a, b| a.error_n.total_cmp(&b.error_n));
    let bound_n = best.map_or(f64::INFINITY, |best| best.error_n + best.standard_error_n);
    candidates.iter().find(|candidate| candidate.error_n <= bound_n).map_or(0, |candidate| candidate.degree)
}

/// Returns the largest standard deviation of `s(z) - mean of s` for residuals of unit variance. The mean is less
/// certain than the shape, as it depends on the difference of two forces, and it is a scale, not an unevenness.
fn shape_deviation(solution: &Solution, degree: usize) -> f64 {
    /// Number of points; odd, so that the middle is included.
    const POINTS: u32 = 101;
    let variance = |point: u32| {
        let u = 2.0 * f64::from(point) / f64::from(POINTS - 1) - 1.0;
        let mut direction = legendre(u, degree);
        // The mean of every Legendre polynomial but the first is zero.
        if let Some(first) = direction.first_mut() {
            *first = 0.0;
        }
        direction.push(0.0);
        solution.unit_variance(&direction)
    };
    (0..POINTS).map(variance).fold(0.0, f64::max).sqrt()
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), value| (sum + value, count + 1.0));
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Returns the distinct values in the order of first occurrence.
fn distinct(values: impl Iterator<Item = u64>) -> Vec<u64> {
    let mut found = Vec::new();
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}
