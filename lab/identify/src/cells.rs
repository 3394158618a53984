//! Cells: means of successive samples, on which laws and measurement are compared.
//!
//! An error of the law smaller than the noise of single samples is visible in the means. The law is applied to each sample, and
//! its force is averaged like the measured one: over a moving window and then over a cell. Averaging thus smooths corners of
//! motion and law equally on both sides, and reduces the noise in the velocity of a damped law.

use crate::law::{Motion, Response, Scales};
use crate::measurement::{Measurement, mean, span};

/// Maximum number of samples in a cell.
const MOST_SAMPLES: usize = 64;
/// Maximum duration of a cell, s: short compared with the motions of a hand or a probe.
const LONGEST_S: f64 = 0.02;
/// Minimum number of cells, if there are as many samples.
const LEAST_CELLS: usize = 240;
/// Maximum range of displacement in a cell, as a fraction of the span of the measurement; at most 2 % of the cells exceed it.
const WIDEST: f64 = 0.08;
/// Lower limit of the noise, as a fraction of the force scale: smaller differences between laws are ignored.
pub(crate) const LEAST_NOISE: f64 = 1.0e-4;

/// Measurement divided into cells.
#[derive(Clone, Debug)]
pub(crate) struct Cells<'a> {
    measurement: &'a Measurement,
    /// Times of the samples, s, or their indices.
    time_s: Vec<f64>,
    /// Number of samples in each cell; the remaining samples at the end are not used.
    size: usize,
    scales: Scales,
    /// Displacement of each sample, averaged over about as many samples as a cell has, m.
    smooth_m: Vec<f64>,
    /// Mean force of each cell, N.
    pub(crate) force_n: Vec<f64>,
    /// Mean displacement of each cell, m.
    pub(crate) displacement_m: Vec<f64>,
    /// Direction of the motion in each cell: 1 into the object, -1 out of it, in between at rest.
    pub(crate) directions: Vec<f64>,
    /// Standard deviation of the noise of a cell's mean force, N, estimated from differences of neighbours; used as a scale only.
    pub(crate) noise_n: f64,
}

impl<'a> Cells<'a> {
    /// Divides a measurement into cells. Not real-time.
    pub(crate) fn of(measurement: &'a Measurement) -> Self {
        let count = measurement.force_n().len();
        let most = (count / LEAST_CELLS).clamp(1, MOST_SAMPLES);
        let size = (1..=most).rev().find(|size| is_short(measurement, *size)).unwrap_or(1);
        Self::with_size(measurement, size)
    }

    /// Divides a measurement into cells of one sample each. Not real-time.
    pub(crate) fn single(measurement: &'a Measurement) -> Self {
        Self::with_size(measurement, 1)
    }

    fn with_size(measurement: &'a Measurement, size: usize) -> Self {
        let time_s = measurement.time_s().map_or_else(
            || (0..measurement.force_n().len()).map(|index| index as f64).collect(),
            <[f64]>::to_vec,
        );
        let smooth_m = moving_mean(measurement.displacement_m(), size);
        let means = |column: &[f64]| column.chunks_exact(size).map(mean).collect::<Vec<f64>>();
        let (force_n, displacement_m) = (means(&moving_mean(measurement.force_n(), size)), means(&smooth_m));
        let noise_n = noise(measurement.force_n()) / (size as f64).sqrt();
        // A computed force has no noise, and a coarsely quantised force has none in most samples.
        let scales = Scales::of(measurement);
        let noise_n = noise_n.max(LEAST_NOISE * scales.force_n);
        let directions = directions(&displacement_m, scales.span_m);
        Self { measurement, time_s, size, scales, smooth_m, force_n, displacement_m, directions, noise_n }
    }

    /// Divides another measurement in the same way; `None` if the number of samples differs.
    pub(crate) fn of_same_size<'b>(&self, measurement: &'b Measurement) -> Option<Cells<'b>> {
        let is_same = measurement.force_n().len() == self.time_s.len();
        is_same.then(|| Cells { noise_n: self.noise_n, ..Cells::with_size(measurement, self.size) })
    }

    pub(crate) fn scales(&self) -> Scales {
        self.scales
    }

    /// Returns the motion of the probe.
    pub(crate) fn motion(&self) -> Motion<'_> {
        Motion {
            time_s: &self.time_s,
            displacement_m: self.measurement.displacement_m(),
            smooth_m: &self.smooth_m,
        }
    }

    /// Returns the number of samples in each cell.
    pub(crate) fn size(&self) -> usize {
        self.size
    }

    pub(crate) fn count(&self) -> usize {
        self.force_n.len()
    }

    pub(crate) fn measurement(&self) -> &'a Measurement {
        self.measurement
    }

    /// Returns the mean time between samples, s; 1 without times.
    pub(crate) fn period_s(&self) -> f64 {
        span(&self.time_s) / (self.time_s.len() - 1) as f64
    }

    /// Returns the times of the samples, s, or their indices.
    pub(crate) fn time_s(&self) -> &[f64] {
        &self.time_s
    }

    /// Returns the mean force of each cell, N, of a response measured with a delay, s.
    pub(crate) fn means(&self, response: &Response, delay_s: f64) -> Vec<f64> {
        let mut levels = Delayed::new(&self.time_s, &response.level_n);
        let level_n: Vec<f64> = self.time_s.iter().map(|time_s| levels.at(time_s - delay_s)).collect();
        let smooth_n = moving_mean(&level_n, self.size);
        let level_n = smooth_n.chunks_exact(self.size).map(mean);
        match self.rates(response, delay_s) {
            Some(rates) => level_n.zip(rates).map(|(level_n, rate_n)| level_n + rate_n).collect(),
            None => level_n.collect(),
        }
    }

    /// Returns the force of each sample, N, of a response measured with a delay, s. The velocity-dependent part is constant
    /// within a cell.
    pub(crate) fn samples(&self, response: &Response, delay_s: f64) -> Vec<f64> {
        let mut levels = Delayed::new(&self.time_s, &response.level_n);
        let rates = self.rates(response, delay_s).unwrap_or_default();
        let rate_n = |index: usize| rates.get(index / self.size).or(rates.last()).copied().unwrap_or(0.0);
        let samples = self.time_s.iter().enumerate();
        samples.map(|(index, time_s)| levels.at(time_s - delay_s) + rate_n(index)).collect()
    }

    /// Returns the rate of change of the impulse in each cell, N; `None` for a response without an impulse.
    fn rates(&self, response: &Response, delay_s: f64) -> Option<Vec<f64>> {
        if response.impulse_ns.is_empty() {
            return None;
        }
        let smooth_ns = moving_mean(&response.impulse_ns, self.size);
        let mut impulses = Delayed::new(&self.time_s, &smooth_ns);
        let edges = (0..=self.count()).map(|edge| self.edge_s(edge));
        let edges: Vec<(f64, f64)> = edges.map(|edge_s| (edge_s, impulses.at(edge_s - delay_s))).collect();
        let rate = |pair: &[(f64, f64)]| {
            let elapsed_s = pair[1].0 - pair[0].0;
            if elapsed_s > 0.0 { (pair[1].1 - pair[0].1) / elapsed_s } else { 0.0 }
        };
        Some(edges.windows(2).map(rate).collect())
    }

    /// Returns the time of the edge before a cell, s: midway between two samples.
    fn edge_s(&self, cell: usize) -> f64 {
        let last = self.time_s.len() - 1;
        let after = (cell * self.size).min(last);
        let before = (cell * self.size).clamp(1, last + 1) - 1;
        let (before, after) = if after == 0 { (0, 0) } else { (before, after) };
        0.5 * (self.time_s[before] + self.time_s[after])
    }
}

/// Interpolated values at times between samples: cubic, with slopes of central differences; constant outside.
struct Delayed<'a> {
    time_s: &'a [f64],
    values: &'a [f64],
    /// Index of the sample before the last requested time.
    index: usize,
}

impl<'a> Delayed<'a> {
    fn new(time_s: &'a [f64], values: &'a [f64]) -> Self {
        Self { time_s, values, index: 0 }
    }

    /// Returns the value at a time not before the last requested one.
    fn at(&mut self, time_s: f64) -> f64 {
        let last = self.time_s.len() - 1;
        while self.index < last && self.time_s[self.index + 1] <= time_s {
            self.index += 1;
        }
        let (from, value) = (self.index, self.values[self.index]);
        let since_s = time_s - self.time_s[from];
        if since_s <= 0.0 || from == last {
            return value;
        }
        let slope = |at: usize| {
            let (before, after) = (at.saturating_sub(1), (at + 1).min(last));
            let elapsed_s = self.time_s[after] - self.time_s[before];
            if elapsed_s > 0.0 { (self.values[after] - self.values[before]) / elapsed_s } else { 0.0 }
        };
        let width_s = self.time_s[from + 1] - self.time_s[from];
        let (s, rise) = (since_s / width_s, self.values[from + 1] - value);
        let (first, second) = (slope(from) * width_s - rise, rise - slope(from + 1) * width_s);
        value + s * rise + s * (1.0 - s) * ((1.0 - s) * first + s * second)
    }
}

/// Returns the moving average over about `size` values, an odd number, fewer at the ends.
pub(crate) fn moving_mean(values: &[f64], size: usize) -> Vec<f64> {
    let mut sum = 0.0;
    let sums: Vec<f64> = std::iter::once(0.0)
        .chain(values.iter().map(|value| {
            sum += value;
            sum
        }))
        .collect();
    let around = |index: usize| {
        let reach = (size / 2).min(index).min(values.len() - 1 - index);
        (sums[index + reach + 1] - sums[index - reach]) / (2 * reach + 1) as f64
    };
    (0..values.len()).map(around).collect()
}

/// Returns the direction of the motion at each position, -1 to 1, smoothed for motions within the noise of the positions.
fn directions(places_m: &[f64], span_m: f64) -> Vec<f64> {
    let rest_m = (4.0 * noise(places_m)).max(1.0e-4 * span_m);
    let last = places_m.len() - 1;
    let moved_m = |at: usize| places_m[(at + 1).min(last)] - places_m[at.saturating_sub(1)];
    (0..=last).map(|at| flotor_hal::math::tanh(moved_m(at) / rest_m)).collect()
}

/// Returns true if cells of `size` samples are short compared with the motion.
fn is_short(measurement: &Measurement, size: usize) -> bool {
    let spans = |column: &[f64]| column.chunks_exact(size).map(span).collect::<Vec<f64>>();
    let widest = |mut spans: Vec<f64>| {
        spans.sort_by(f64::total_cmp);
        spans.get(spans.len() * 98 / 100).copied().unwrap_or(0.0)
    };
    let is_brief = measurement.time_s().is_none_or(|time_s| widest(spans(time_s)) < LONGEST_S);
    is_brief && widest(spans(measurement.displacement_m())) <= WIDEST * span(measurement.displacement_m())
}

/// Returns a robust estimate of the standard deviation of white noise, from second differences, to which slow changes add little.
pub(crate) fn noise(values: &[f64]) -> f64 {
    /// Median of the absolute value of a standard normal variable, times the standard deviation of `a - 2 b + c`.
    const PER_DEVIATION: f64 = 0.674_489_750_2 * 2.449_489_742_8;
    let mut sizes: Vec<f64> = values.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    let middle = sizes.len() / 2;
    if sizes.is_empty() {
        return 0.0;
    }
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    *median / PER_DEVIATION
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(count: u32) -> Measurement {
        let times: Vec<f64> = (0..count).map(|index| f64::from(index) * 1.0e-3).collect();
        let x = times.iter().map(|time_s| 2.0e-3 * time_s).collect();
        let f = times.iter().map(|time_s| 1.0 + time_s).collect();
        Measurement::new(Some(times), x, f).unwrap()
    }

    #[test]
    fn a_cell_has_the_mean_of_its_samples_at_the_delayed_times() {
        let measurement = ramp(6000);
        let cells = Cells::of(&measurement);
        assert!(cells.size > 4 && cells.count() >= LEAST_CELLS);
        let level_n: Vec<f64> = cells.time_s().iter().map(|time_s| 3.0 * time_s).collect();
        let response = Response { level_n, impulse_ns: Vec::new() };
        let delay_s = 0.0017;
        let times: Vec<f64> = cells.time_s().to_vec();
        for (cell, found) in cells.means(&response, delay_s).into_iter().enumerate().skip(2).take(150) {
            let samples = &times[cell * cells.size..(cell + 1) * cells.size];
            let expected = samples.iter().map(|t| 3.0 * (t - delay_s)).sum::<f64>() / cells.size as f64;
            // Means and interpolation of a straight line are on the line.
            assert!((found - expected).abs() < 1.0e-9, "{cell}: {found} {expected}");
        }
    }

    #[test]
    fn the_rate_of_an_impulse_is_its_difference_over_the_cell() {
        let measurement = ramp(6000);
        let cells = Cells::of(&measurement);
        let impulse_ns = cells.time_s().iter().map(|time_s| 7.0 * time_s).collect();
        let response = Response { level_n: vec![0.0; 6000], impulse_ns };
        for found in cells.means(&response, 0.0).into_iter().skip(1) {
            assert!((found - 7.0).abs() < 1.0e-9, "{found}");
        }
    }

    #[test]
    fn noise_is_not_the_slope() {
        let values: Vec<f64> = (0..1000).map(|index| f64::from(index) * 0.3 + f64::from(index % 2)).collect();
        // Second differences of 0, 1, 0, 1 ... are 2.
        assert!((noise(&values) - 2.0 / (0.674_489_750_2 * 2.449_489_742_8)).abs() < 1.0e-9);
    }
}
