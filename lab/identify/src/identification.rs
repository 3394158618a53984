//! Identification of a law and its parameters from a measurement.

use crate::cells::{Cells, LEAST_NOISE};
use crate::displacement_noise::corrected;
use crate::fit::{Device, Fit, delay_s, fit};
use crate::ladder::{Score, choice, score};
use crate::law::{Connection, Coordinate, Law, Scales, knot_displacement_m};
use crate::measurement::{Measurement, mean};
use crate::uncertainty::{Structure, half_widths, structure};

/// Maximum structure of the residuals of an accepted law, as a fraction of the root mean square of the force.
const TOLERANCE: f64 = 0.005;
/// Structure of the residuals above which it is significant, in standard deviations.
const SIGNIFICANT: f64 = 4.5;

/// Maximum half-width of the interval of a positive parameter for an eligible law, as the natural logarithm of a ratio.
const WIDEST_RATIO: f64 = 1.5;
/// Minimum time constant of an eligible law, in sampling periods.
const SHORTEST_PERIODS: f64 = 2.0;

/// Number with its 95 % interval.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Id of the parameter, with its unit.
    pub id: &'static str,
    /// Estimated value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// Law of the ladder with its prediction error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rung {
    /// The law.
    pub law: Law,
    /// Root mean square of the prediction error of cells in cross-validation, N.
    pub score_n: f64,
    /// Standard error of the score, N.
    pub standard_error_n: f64,
}

/// Result of an identification.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Law that explains the measurement; `None` if no law of the ladder does.
    pub law: Option<Law>,
    /// Law that was chosen by cross-validation: `law`, or the closest one if none explains the measurement.
    pub closest: Law,
    /// Parameters of the closest law.
    pub parameters: Vec<Estimate>,
    /// Delay of the force relative to the displacement, s; `None` without times.
    pub delay_s: Option<Estimate>,
    /// Root mean square of the difference between measured and predicted force of each sample, N.
    pub rms_n: f64,
    /// Root mean square of the part of this difference that is not noise, N.
    pub structure_n: f64,
    /// Scores of the laws, in the order of [`Law::ALL`].
    pub ladder: Vec<Rung>,
    /// Predicted force of each sample, N.
    pub prediction_n: Vec<f64>,
}

impl Identification {
    /// Returns the id of the law, or `none of these`.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.law.map_or("none of these", Law::id)
    }

    /// Returns the value of a parameter; `None` if the closest law has none of this id.
    #[must_use]
    pub fn parameter(&self, id: &str) -> Option<f64> {
        self.parameters.iter().find(|estimate| estimate.id == id).map(|estimate| estimate.value)
    }

    /// Returns measured less predicted force of each sample, N. Not real-time.
    #[must_use]
    pub fn residuals_n(&self, measurement: &Measurement) -> Vec<f64> {
        let pairs = measurement.force_n().iter().zip(&self.prediction_n);
        pairs.map(|(measured, predicted)| measured - predicted).collect()
    }
}

/// Reason why no law can be fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum IdentifyError {
    /// A law with a rate needs times.
    #[error("the law `{}` depends on the velocity, and the measurement has no times; add a column `time_s`", .0.id())]
    NoTimes(Law),
    /// No law could be fitted.
    #[error("the measurement does not determine any law; press deeper, or measure more points")]
    Undetermined,
}

/// Fits the laws to a measurement and chooses one. Not real-time.
///
/// # Errors
/// [`IdentifyError::NoTimes`] if all laws depend on a velocity and the measurement has no times; [`IdentifyError::Undetermined`] if
/// no law can be fitted.
pub fn identify(
    measurement: &Measurement,
    laws: &[Law],
    device: Device,
) -> Result<Identification, IdentifyError> {
    let has_times = measurement.time_s().is_some();
    let cells = Cells::of(measurement);
    let possible = laws.iter().filter(|law| has_times || !law.has_rate());
    let fitted: Vec<(Fit, Score)> = possible
        .filter_map(|law| {
            let fit = connected(*law, &cells, device)?;
            let score = score(&fit, cells.noise_n)?;
            Some((fit, score))
        })
        .collect();
    let determined: Vec<&Fit> = fitted
        .iter()
        .map(|(fit, _)| fit)
        .filter(|fit| laws.len() == 1 || is_determined(fit, &cells))
        .collect();
    let candidates: Vec<(usize, Score)> = fitted
        .iter()
        .filter(|(fit, _)| determined.iter().any(|one| one.law == fit.law))
        .map(|(fit, score)| (fit.law.forms().len(), *score))
        .collect();
    let least_n = LEAST_NOISE * cells.scales().force_n;
    let Some(chosen) = choice(&candidates, least_n).and_then(|index| determined.get(index)).copied() else {
        let without_times = laws.first().filter(|law| !has_times && law.has_rate());
        return Err(without_times.map_or(IdentifyError::Undetermined, |law| IdentifyError::NoTimes(*law)));
    };
    let structure = structure(&chosen.residuals_n);
    let chosen = Fit {
        coordinates: corrected(chosen, &cells, device).ok_or(IdentifyError::Undetermined)?,
        ..chosen.clone()
    };
    let ladder = fitted.iter().map(|(fit, score)| {
        let score_n = score.mean_square.sqrt();
        Rung { law: fit.law, score_n, standard_error_n: 0.5 * score.standard_error / score_n }
    });
    let prediction_n = chosen.prediction_n(&cells, device);
    let residuals =
        measurement.force_n().iter().zip(&prediction_n).map(|(measured, predicted)| measured - predicted);
    let squares: Vec<f64> = residuals.map(|residual_n| residual_n * residual_n).collect();
    let (parameters, delay_s) = estimates(&chosen, &cells).ok_or(IdentifyError::Undetermined)?;
    Ok(Identification {
        law: explains(structure, &cells).then_some(chosen.law),
        closest: chosen.law,
        parameters,
        delay_s,
        rms_n: mean(&squares).sqrt(),
        structure_n: structure.rms_n,
        ladder: ladder.collect(),
        prediction_n,
    })
}

/// Returns true if the measurement determines each parameter. A law with an undetermined parameter is equivalent to a simpler
/// one, or to a limiting case outside the ladder.
fn is_determined(fit: &Fit, cells: &Cells<'_>) -> bool {
    let Some(widths) = half_widths(fit, cells.noise_n) else { return false };
    let period_s = cells.period_s();
    fit.law.forms().iter().zip(&fit.coordinates).zip(widths).all(|((form, at), width)| {
        match form.coordinate {
            Coordinate::Positive(unit) => {
                let is_resolved =
                    !unit.is_time() || cells.scales().parameter(form, *at) > SHORTEST_PERIODS * period_s;
                width < WIDEST_RATIO && is_resolved
            }
            Coordinate::Displacement | Coordinate::Signed(_) => true,
        }
    })
}

/// Returns true if the residuals have no structure beyond noise and tolerance.
fn explains(structure: Structure, cells: &Cells<'_>) -> bool {
    let squares: Vec<f64> = cells.force_n.iter().map(|force_n| force_n * force_n).collect();
    structure.deviations < SIGNIFICANT || structure.rms_n < TOLERANCE * mean(&squares).sqrt()
}

/// Fits a law; with both kinds of connection if the object is also pulled, and returns the better fit.
fn connected(law: Law, cells: &Cells<'_>, device: Device) -> Option<Fit> {
    let scale_n = cells.force_n.iter().map(|force_n| force_n.abs()).fold(0.0, f64::max);
    let pull_n = (8.0 * cells.noise_n).max(0.01 * scale_n);
    let pulls = cells.force_n.iter().filter(|force_n| **force_n < -pull_n).count();
    let connections: &[Connection] =
        if pulls < 3 { &[Connection::Presses] } else { &[Connection::Presses, Connection::Attached] };
    let fits = connections.iter().filter_map(|connection| fit(law, *connection, cells, device));
    fits.min_by(|one, other| one.mean_square().total_cmp(&other.mean_square()))
}

/// Returns the parameters of a fit and its delay, with their intervals.
fn estimates(fit: &Fit, cells: &Cells<'_>) -> Option<(Vec<Estimate>, Option<Estimate>)> {
    let scales = cells.scales();
    let widths = half_widths(fit, cells.noise_n)?;
    let around = |index: usize| {
        let (at, width) = (*fit.coordinates.get(index)?, *widths.get(index)?);
        Some([at, at - width, at + width])
    };
    let estimate =
        |id, [value, one, other]: [f64; 3]| Estimate { id, value, low: one.min(other), high: one.max(other) };
    let forms = fit.law.forms().iter().enumerate();
    let mut parameters = forms
        .map(|(index, form)| Some(estimate(form.id, around(index)?.map(|at| scales.parameter(form, at)))))
        .collect::<Option<Vec<_>>>()?;
    if fit.law == Law::Table {
        parameters.extend(table_contact(&parameters, &scales));
    }
    let delay = fit.delay_index(cells).and_then(around);
    Some((parameters, delay.map(|around| estimate("delay_s", around.map(delay_s)))))
}

/// Returns the displacement at which the force of a table begins, with an interval of one knot spacing.
fn table_contact(knots: &[Estimate], scales: &Scales) -> Option<Estimate> {
    let deepest_n = knots.iter().map(|knot| knot.value).fold(0.0, f64::max);
    let pressed = knots.iter().position(|knot| knot.low > 0.0 && knot.value > 0.01 * deepest_n)?;
    let at = |index: usize| knot_displacement_m(scales, index);
    let value = at(pressed.saturating_sub(1));
    Some(Estimate { id: "contact_m", value, low: at(pressed.saturating_sub(2)), high: at(pressed) })
}
