//! Measured force over displacement.

/// Minimum number of samples of a measurement: the most flexible law, except the table, has five parameters and a delay.
pub const LEAST_SAMPLES: usize = 20;

/// Samples of one object under test, in the order of their measurement: displacement into the object and force on the object,
/// both positive in compression.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    time_s: Option<Vec<f64>>,
    displacement_m: Vec<f64>,
    force_n: Vec<f64>,
}

/// Error in the samples of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MeasurementError {
    /// Number of samples below [`LEAST_SAMPLES`].
    #[error("the measurement has {0} samples, but a law needs at least {LEAST_SAMPLES}; measure more points")]
    TooFew(usize),
    /// The columns have different lengths.
    #[error("time, displacement and force have different numbers of samples; give one of each per sample")]
    Lengths,
    /// A number that is not finite, with the index of its sample.
    #[error("sample {0} is not finite; remove it")]
    NotFinite(usize),
    /// Index of a sample whose time is before that of its predecessor.
    #[error("the time decreases at sample {0}; sort the samples by time, or remove the column `time_s`")]
    TimeFalls(usize),
    /// Equal displacements of all samples.
    #[error("the displacement is constant; press the object, and measure again")]
    Constant,
    /// Zero force in all samples.
    #[error("the force is zero everywhere; press until the force rises, and measure again")]
    NoForce,
}

impl MeasurementError {
    /// Returns the message without the sample number, for messages that have a line number.
    #[must_use]
    pub fn without_sample(&self) -> String {
        match self {
            Self::TimeFalls(_) => {
                "the time decreases; sort the rows by time, or remove the column `time_s`".to_owned()
            }
            Self::NotFinite(_) => "a number is not finite; remove the row".to_owned(),
            other => other.to_string(),
        }
    }
}

impl Measurement {
    /// Creates a measurement from its columns; without `time_s` only laws without rate are identified. Not real-time.
    ///
    /// # Errors
    /// A [`MeasurementError`] for too few samples, columns of different lengths, numbers that are not finite, a decreasing time, a
    /// constant displacement, or a force that is zero everywhere.
    pub fn new(
        time_s: Option<Vec<f64>>,
        displacement_m: Vec<f64>,
        force_n: Vec<f64>,
    ) -> Result<Self, MeasurementError> {
        let count = displacement_m.len();
        if force_n.len() != count || time_s.as_ref().is_some_and(|time_s| time_s.len() != count) {
            return Err(MeasurementError::Lengths);
        }
        if count < LEAST_SAMPLES {
            return Err(MeasurementError::TooFew(count));
        }
        let columns = [Some(&displacement_m), Some(&force_n), time_s.as_ref()];
        let wrong = |column: &Vec<f64>| column.iter().position(|value| !value.is_finite());
        if let Some(at) = columns.into_iter().flatten().filter_map(wrong).min() {
            return Err(MeasurementError::NotFinite(at));
        }
        if let Some(at) =
            time_s.as_ref().and_then(|time_s| time_s.windows(2).position(|pair| pair[1] < pair[0]))
        {
            return Err(MeasurementError::TimeFalls(at + 1));
        }
        if span(&displacement_m) == 0.0 {
            return Err(MeasurementError::Constant);
        }
        if force_n.iter().all(|force_n| *force_n == 0.0) {
            return Err(MeasurementError::NoForce);
        }
        // Treat equal times as missing.
        let time_s = time_s.filter(|time_s| span(time_s) > 0.0);
        Ok(Self { time_s, displacement_m, force_n })
    }

    /// Returns the times, s; `None` if only the order of the samples is known.
    #[must_use]
    pub fn time_s(&self) -> Option<&[f64]> {
        self.time_s.as_deref()
    }

    /// Returns the displacements into the object, m.
    #[must_use]
    pub fn displacement_m(&self) -> &[f64] {
        &self.displacement_m
    }

    /// Returns the forces on the object, N.
    #[must_use]
    pub fn force_n(&self) -> &[f64] {
        &self.force_n
    }

    /// Returns the measurement with a length `by_m` added to each displacement. Not real-time.
    pub(crate) fn displaced(&self, by_m: impl Iterator<Item = f64>) -> Self {
        let displacement_m = self.displacement_m.iter().zip(by_m).map(|(x, by_m)| x + by_m).collect();
        Self { displacement_m, ..self.clone() }
    }

    /// Returns a measurement of another motion and force at the same times. Not real-time.
    pub(crate) fn replaced(&self, displacement_m: Vec<f64>, force_n: Vec<f64>) -> Self {
        Self { time_s: self.time_s.clone(), displacement_m, force_n }
    }

    /// Returns the means of groups of successive samples, at most `most` of them. Not real-time.
    pub(crate) fn coarse(&self, most: usize) -> Self {
        let size = self.force_n.len().div_ceil(most.max(1)).max(1);
        let means = |column: &Vec<f64>| column.chunks(size).map(mean).collect();
        Self {
            time_s: self.time_s.as_ref().map(means),
            displacement_m: means(&self.displacement_m),
            force_n: means(&self.force_n),
        }
    }
}

/// Returns the difference between the largest and the smallest number; zero without numbers.
pub(crate) fn span(numbers: &[f64]) -> f64 {
    (numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max) - lowest(numbers)).max(0.0)
}

/// Returns the smallest number; infinity without numbers.
pub(crate) fn lowest(numbers: &[f64]) -> f64 {
    numbers.iter().copied().fold(f64::INFINITY, f64::min)
}

/// Returns the mean; NaN without numbers.
pub(crate) fn mean(numbers: &[f64]) -> f64 {
    numbers.iter().sum::<f64>() / numbers.len() as f64
}
