//! Power of a difference experiment: simulates whole studies without apparatus and counts significant differences between the
//! modalities.
//!
//! The test is the paired t-test of `flotor analyse`. With equal observers in both modalities the fraction of significant
//! studies is the type I error rate, which must equal the significance level.

use crate::{AnalysisError, AnalysisOptions, SubjectRecord, analyse_jnd};
use flotor_study::log::TrialEvent;
use flotor_study::observer::{Population, Sensitivity, SimulatedSubject};
use flotor_study::protocol::{JndProtocol, Protocol, SubjectNumber};
use flotor_study::sitting::Sitting;
use flotor_study::trial::Exploration;
use serde::Serialize;

/// Significance level of the test.
pub const LEVEL: f64 = 0.05;

/// Statistical power of a study with a given number of subjects.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Power {
    /// Number of subjects per study.
    pub subjects: u16,
    /// Number of simulated studies.
    pub studies: u32,
    /// Fraction of studies with a significant difference between the modalities (p below [`LEVEL`]).
    pub power: f64,
    /// Standard error of the power (binomial).
    pub standard_error: f64,
    /// Mean Weber fractions over all studies: vision and haptics, haptics alone.
    pub weber: [f64; 2],
}

/// Returns the default population with the lapse rate `lapse`, and with thresholds without vision that are `ratio` times the
/// thresholds with vision.
pub fn population(ratio: f64, lapse: f64) -> Population {
    let usual = Population::default();
    let h = Sensitivity { sigma: usual.vh.sigma * ratio, ..usual.vh };
    Population { h, lapse, ..usual }
}

/// Simulates one study; returns the p-value of the paired t-test (1 if not testable) and the mean Weber fractions: vision and
/// haptics, haptics alone.
///
/// # Errors
/// [`AnalysisError`] if the study cannot be analysed: a subject has no threshold in some condition, or there are fewer than two
/// subjects.
pub fn study(
    protocol: &JndProtocol,
    population: &Population,
    subjects: u16,
    seed: u64,
) -> Result<(f64, [f64; 2]), AnalysisError> {
    let whole = Protocol::Jnd(protocol.clone());
    let middle = flotor_statistics::describe::mean(&protocol.bases);
    let sit = |subject: SubjectNumber| {
        let simulated = SimulatedSubject::new(population, seed, subject, middle);
        let mut sitting = Sitting::new(&whole, seed, subject);
        let mut trials = Vec::new();
        while let Some(trial) = sitting.next() {
            let response = simulated.respond(&trial);
            let exploration = Exploration::default();
            let Ok(verdict) = sitting.answer(response, &exploration) else { break };
            trials.push(TrialEvent { trial, response, verdict, exploration });
        }
        let first_modality = whole.first_modality().of(subject);
        SubjectRecord { subject, first_modality, trials, tracks: sitting.results().to_vec() }
    };
    let subjects: Vec<SubjectRecord> = (1..=subjects).filter_map(SubjectNumber::new).map(sit).collect();
    let analysis = analyse_jnd(protocol, &subjects, &AnalysisOptions::default())?;
    Ok((analysis.t.tested().map_or(1.0, |t| t.p), [analysis.weber.vh, analysis.weber.h]))
}

/// Estimates the power from the results of [`study`] for `subjects` subjects.
#[must_use]
pub fn power(subjects: u16, results: &[(f64, [f64; 2])]) -> Power {
    let n = results.len() as f64;
    let found = results.iter().filter(|(p, _)| *p < LEVEL).count() as f64 / n;
    let weber = [0, 1].map(|at| results.iter().map(|(_, weber)| weber[at]).sum::<f64>() / n);
    Power {
        subjects,
        studies: u32::try_from(results.len()).unwrap_or(u32::MAX),
        power: found,
        standard_error: (found * (1.0 - found) / n).sqrt(),
        weber,
    }
}
