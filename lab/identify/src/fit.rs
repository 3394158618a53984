//! Least-squares fit of one law: Levenberg and Marquardt's method (crate `levenberg-marquardt`, after MINPACK's `lmder`).
//!
//! The unknowns are the parameters of the law and two properties of the device: the delay of the force relative to the
//! displacement, and the error of the force as a function of displacement. The device's properties have priors, so the
//! uncertainty of the law's parameters includes that of the device.

use crate::cells::Cells;
use crate::law::{Connection, Form, Law, Response, Scales};
use crate::linear_system::solve;
use crate::measurement::mean;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, storage::Owned};

/// Unit of the coordinate of the delay, s.
const DELAY_UNIT_S: f64 = 1.0e-3;
/// Standard deviation of the prior of the delay, ms.
const DELAY_DEVIATION: f64 = 2.0;
/// Number of polynomials for the force error over the displacement.
const FORCE_ERRORS: usize = 3;
/// Step of the central differences of the Jacobian, in coordinates of the order of one.
const STEP: f64 = 1.0e-5;
/// Maximum number of samples in the first search.
const COARSE_SAMPLES: usize = 800;
/// Maximum number of evaluations per unknown.
const PATIENCE: usize = 8;
/// Relative decrease of the sum of squares, and relative step, at which the first search and the final fit end. A change of a
/// parameter by one standard deviation changes the sum, about the number of cells, by one.
const ROUGH: f64 = 1.0e-5;
const FINE: f64 = 1.0e-9;

/// Known properties of the measuring device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Device {
    /// Standard deviation of the relative error of the measured force, which changes slowly over the displacement.
    pub force_error: f64,
    /// Standard deviation of the device's own dry friction, which opposes the motion and adds to the measured force, N.
    pub friction_n: f64,
}

/// Law fitted to a measurement.
#[derive(Clone, Debug)]
pub(crate) struct Fit {
    pub(crate) law: Law,
    pub(crate) connection: Connection,
    pub(crate) coordinates: DVector<f64>,
    /// Residual of each cell, N: measured minus predicted.
    pub(crate) residuals_n: Vec<f64>,
    /// Derivative of each cell's prediction with respect to each coordinate, N.
    pub(crate) jacobian_n: DMatrix<f64>,
    /// Precision of the prior of each coordinate; zero without prior.
    pub(crate) precisions: DVector<f64>,
}

impl Fit {
    /// Returns the mean of the squared residuals, N².
    pub(crate) fn mean_square(&self) -> f64 {
        mean(&self.residuals_n.iter().map(|residual_n| residual_n * residual_n).collect::<Vec<f64>>())
    }

    /// Returns the predicted force of each sample, N.
    pub(crate) fn prediction_n(&self, cells: &Cells<'_>, device: Device) -> Vec<f64> {
        let problem = Problem::of(self, cells, device, cells.scales());
        let (response, delay_s, _) = problem.response(&self.coordinates);
        self.connection.limited(cells.samples(&response, delay_s))
    }

    /// Returns the coordinate of the delay; `None` without times.
    pub(crate) fn delay_index(&self, cells: &Cells<'_>) -> Option<usize> {
        cells.measurement().time_s().map(|_| self.law.forms().len())
    }
}

/// Converts a coordinate to a delay, s.
pub(crate) fn delay_s(coordinate: f64) -> f64 {
    DELAY_UNIT_S * coordinate
}

/// Fits a law; `None` if the measurement does not determine it. Not real-time.
pub(crate) fn fit(law: Law, connection: Connection, cells: &Cells<'_>, device: Device) -> Option<Fit> {
    let coarse = cells.measurement().coarse(COARSE_SAMPLES);
    let rough = Cells::single(&coarse);
    let scales = cells.scales();
    let search = |cells, starts: Vec<DVector<f64>>, tolerance: f64| {
        let found = starts.into_iter().filter_map(|start| {
            let problem = Problem { law, connection, cells, device, scales, coordinates: start };
            let method =
                LevenbergMarquardt::new().with_patience(PATIENCE).with_ftol(tolerance).with_xtol(tolerance);
            let (problem, _) = method.minimize(problem);
            let cost = problem.residuals()?.norm_squared();
            cost.is_finite().then_some((cost, problem.coordinates))
        });
        found.min_by(|(one, _), (other, _)| one.total_cmp(other)).map(|(_, coordinates)| coordinates)
    };
    let starts = law.starts(&contacts(&rough, &scales)).into_iter();
    let starts = starts.map(|start| with_amplitude(law, connection, &rough, &scales, device, start));
    let near = search(&rough, starts.collect(), ROUGH)?;
    let coordinates = search(cells, vec![near], FINE)?;
    let problem = Problem { law, connection, cells, device, scales, coordinates };
    let jacobian = problem.jacobian()?;
    let prediction_n = problem.prediction_n(&problem.coordinates);
    let residuals_n =
        cells.force_n.iter().zip(prediction_n).map(|(measured, predicted)| measured - predicted);
    Some(Fit {
        law,
        connection,
        residuals_n: residuals_n.collect(),
        jacobian_n: jacobian.rows(0, cells.count()) * -cells.noise_n,
        precisions: problem.priors().precisions(),
        coordinates: problem.coordinates,
    })
}

/// Returns initial guesses for the coordinate of the contact: where the force exceeds its noise, at the smallest displacement,
/// and at the zero of a straight line through the upper half of the forces.
fn contacts(cells: &Cells<'_>, scales: &Scales) -> Vec<f64> {
    let threshold_n = (6.0 * cells.noise_n).max(0.02 * scales.force_n);
    let pairs = || cells.displacement_m.iter().zip(&cells.force_n);
    let rising = pairs().filter(|(_, f)| **f > threshold_n).map(|(x, _)| *x).fold(f64::INFINITY, f64::min);
    let coordinate = |x: f64| (x - scales.lowest_m) / scales.span_m;
    let upper: Vec<(f64, f64)> =
        pairs().filter(|(_, f)| **f > 0.5 * scales.force_n).map(|(x, f)| (*x, *f)).collect();
    let count = upper.len() as f64;
    let (x_mean, f_mean) = (
        upper.iter().map(|(x, _)| x).sum::<f64>() / count,
        upper.iter().map(|(_, f)| f).sum::<f64>() / count,
    );
    let slope = upper.iter().map(|(x, f)| (x - x_mean) * (f - f_mean)).sum::<f64>()
        / upper.iter().map(|(x, _)| (x - x_mean) * (x - x_mean)).sum::<f64>();
    let foot = x_mean - f_mean / slope;
    let mut contacts: Vec<f64> = [coordinate(rising), 0.0, coordinate(foot)]
        .into_iter()
        .filter(|contact| contact.is_finite() && (-2.0..0.95).contains(contact))
        .collect();
    contacts.dedup_by(|one, other| (*one - *other).abs() < 0.02);
    contacts
}

/// Adds the coordinates of the device to an initial guess, and scales its amplitude to the measured force.
fn with_amplitude(
    law: Law,
    connection: Connection,
    cells: &Cells<'_>,
    scales: &Scales,
    device: Device,
    start: Vec<f64>,
) -> DVector<f64> {
    let problem = Problem { law, connection, cells, device, scales: *scales, coordinates: DVector::zeros(0) };
    let mut coordinates = DVector::zeros(problem.width());
    coordinates.iter_mut().zip(start).for_each(|(slot, value)| *slot = value);
    let prediction_n = problem.prediction_n(&coordinates);
    let product: f64 = prediction_n.iter().zip(&cells.force_n).map(|(p, f)| p * f).sum();
    let square: f64 = prediction_n.iter().map(|p| p * p).sum();
    let ratio = product / square;
    if law != Law::Table && ratio.is_finite() && ratio > 0.0 {
        coordinates[0] += flotor_hal::math::ln(ratio);
    }
    coordinates
}

/// Least-squares problem of a law and a measurement, with residuals in units of the noise.
pub(crate) struct Problem<'a> {
    law: Law,
    connection: Connection,
    cells: &'a Cells<'a>,
    device: Device,
    scales: Scales,
    coordinates: DVector<f64>,
}

/// Prior mean and precision of each coordinate.
struct Priors(Vec<Option<(f64, f64)>>);

impl Priors {
    /// Returns the precision of each prior; zero without one.
    fn precisions(&self) -> DVector<f64> {
        DVector::from_iterator(
            self.0.len(),
            self.0.iter().map(|prior| prior.map_or(0.0, |(_, deviation)| 1.0 / (deviation * deviation))),
        )
    }
}

impl<'a> Problem<'a> {
    /// Creates the problem of a fit for other cells.
    pub(crate) fn of(fit: &Fit, cells: &'a Cells<'a>, device: Device, scales: Scales) -> Self {
        let Fit { law, connection, coordinates, .. } = fit;
        Self { law: *law, connection: *connection, cells, device, scales, coordinates: coordinates.clone() }
    }

    /// Returns the Gauss-Newton step from the coordinates; `None` if the measurement does not determine them.
    pub(crate) fn step(&self) -> Option<DVector<f64>> {
        self.step_along(&self.residuals()?)
    }

    /// Returns the Gauss-Newton step of the data alone, without the gradient of the priors.
    pub(crate) fn step_of_data(&self) -> Option<DVector<f64>> {
        let mut residuals = self.residuals()?;
        residuals.iter_mut().skip(self.cells.count()).for_each(|of_prior| *of_prior = 0.0);
        self.step_along(&residuals)
    }

    fn step_along(&self, residuals: &DVector<f64>) -> Option<DVector<f64>> {
        let jacobian = self.jacobian()?;
        solve(jacobian.tr_mul(&jacobian), &-jacobian.tr_mul(residuals))
    }

    fn forms(&self) -> &'static [Form] {
        self.law.forms()
    }

    fn has_delay(&self) -> bool {
        self.cells.measurement().time_s().is_some()
    }

    /// Returns the number of coordinates.
    fn width(&self) -> usize {
        self.forms().len()
            + usize::from(self.has_delay())
            + usize::from(self.device.friction_n > 0.0)
            + if self.device.force_error > 0.0 { FORCE_ERRORS } else { 0 }
    }

    fn priors(&self) -> Priors {
        let mut priors: Vec<_> = self.forms().iter().map(|form| form.prior).collect();
        if self.has_delay() {
            priors.push(Some((0.0, DELAY_DEVIATION)));
        }
        priors.resize(self.width(), Some((0.0, 1.0)));
        Priors(priors)
    }

    /// Returns the response of the law, the delay, s, and the coordinates of friction and force error.
    fn response(&self, coordinates: &DVector<f64>) -> (Response, f64, Vec<f64>) {
        let forms = self.forms();
        let parameters: Vec<f64> =
            forms.iter().zip(coordinates).map(|(form, at)| self.scales.parameter(form, *at)).collect();
        let motion = self.cells.motion();
        let response = self.law.respond(&parameters, self.connection, &self.scales, motion);
        let device = coordinates.iter().skip(forms.len()).copied();
        let delay_s = if self.has_delay() { device.clone().next().map_or(0.0, delay_s) } else { 0.0 };
        (response, delay_s, device.skip(usize::from(self.has_delay())).collect())
    }

    /// Returns the force that the device measures in each cell, N.
    pub(crate) fn prediction_n(&self, coordinates: &DVector<f64>) -> Vec<f64> {
        let (response, delay_s, mut errors) = self.response(coordinates);
        let friction_n = match self.device.friction_n {
            deviation_n if deviation_n > 0.0 => deviation_n * errors.remove(0),
            _ => 0.0,
        };
        let mut force_n = self.connection.limited(self.cells.means(&response, delay_s));
        if friction_n != 0.0 {
            force_n
                .iter_mut()
                .zip(&self.cells.directions)
                .for_each(|(f, direction)| *f += friction_n * direction);
        }
        if errors.is_empty() {
            return force_n;
        }
        let deviation = self.device.force_error / (FORCE_ERRORS as f64).sqrt();
        let ratio = |x: &f64| {
            let u = 2.0 * (x - self.scales.lowest_m) / self.scales.span_m - 1.0;
            let polynomials = [1.0, u, 1.5 * u * u - 0.5];
            1.0 + deviation * errors.iter().zip(polynomials).map(|(error, p)| error * p).sum::<f64>()
        };
        force_n.iter().zip(&self.cells.displacement_m).map(|(f, x)| f * ratio(x)).collect()
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, coordinates: &DVector<f64>) {
        self.coordinates.copy_from(coordinates);
    }

    fn params(&self) -> DVector<f64> {
        self.coordinates.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        let predictions = self.prediction_n(&self.coordinates).into_iter();
        let cells = self.cells.force_n.iter().zip(predictions);
        let cells = cells.map(|(measured, predicted)| (measured - predicted) / self.cells.noise_n);
        let Priors(priors) = self.priors();
        let priors = priors
            .iter()
            .zip(&self.coordinates)
            .map(|(prior, at)| prior.map_or(0.0, |(mean, deviation)| (at - mean) / deviation));
        let residuals = DVector::from_iterator(self.cells.count() + self.width(), cells.chain(priors));
        residuals.iter().all(|residual| residual.is_finite()).then_some(residuals)
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        let count = self.cells.count();
        let Priors(priors) = self.priors();
        let mut jacobian = DMatrix::zeros(count + self.width(), self.width());
        for (column, prior) in priors.iter().enumerate() {
            let at = |step: f64| {
                let mut moved = self.coordinates.clone();
                moved[column] += step;
                self.prediction_n(&moved)
            };
            let (above, below) = (at(STEP), at(-STEP));
            for (row, (above, below)) in above.iter().zip(below).enumerate() {
                jacobian[(row, column)] = (below - above) / (2.0 * STEP * self.cells.noise_n);
            }
            jacobian[(count + column, column)] = prior.map_or(0.0, |(_, deviation)| 1.0 / deviation);
        }
        jacobian.iter().all(|entry| entry.is_finite()).then_some(jacobian)
    }
}
