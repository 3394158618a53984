//! Analysis of thresholds: Weber fractions, their difference between modalities, effects of base, modality and order.

use super::kinematics::{KinematicMeasure, measures};
use super::published::ThesisComparison;
use super::{
    AnalysisError, AnalysisOptions, CONFIDENCE, Estimator, PostHoc, ResponseRow, SubjectRecord,
    mean_responses, means_of_both, order_factor, post_hoc, response_rows, within_factors,
};
use flotor_statistics::Outcome;
use flotor_statistics::anova::{Design, Effect, WithinFactor, analyse};
use flotor_statistics::describe::{MeanInterval, mean, mean_interval};
use flotor_statistics::t_test::{TTest, paired};
use flotor_statistics::trend;
use flotor_study::estimate::{Prior, most_likely};
use flotor_study::protocol::JndProtocol;
use flotor_study::trial::Modality;
use serde::Serialize;

/// Values for the two modalities, such as Weber fractions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WeberFractions<T> {
    /// Vision and haptics.
    pub vh: T,
    /// Haptics alone.
    pub h: T,
}

impl<T> WeberFractions<T> {
    fn try_each<E>(mut of: impl FnMut(Modality) -> Result<T, E>) -> Result<Self, E> {
        Ok(Self { vh: of(Modality::Vh)?, h: of(Modality::H)? })
    }

    fn modality(&self, modality: Modality) -> &T {
        match modality {
            Modality::Vh => &self.vh,
            Modality::H => &self.h,
        }
    }

    fn map<U>(&self, of: impl Fn(&T) -> U) -> WeberFractions<U> {
        WeberFractions { vh: of(&self.vh), h: of(&self.h) }
    }
}

/// Mean threshold in one condition: a bar of figure 18 in CMU-RI-TR-07-21.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ThresholdCell {
    /// Modality of the condition.
    pub modality: Modality,
    /// Base, in the unit of the stimulus.
    pub base: f64,
    /// Mean threshold over subjects, in the unit of the stimulus.
    pub threshold: MeanInterval,
}

/// Analysis of a difference experiment. The field names are a stable interface for scripts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JndAnalysis {
    /// Task label: "jnd".
    pub task: &'static str,
    /// Number of analysed sittings.
    pub subjects: usize,
    /// Estimator of the thresholds.
    pub estimator: Estimator,
    /// Mean Weber fraction: threshold divided by base.
    pub weber: WeberFractions<f64>,
    /// Mean Weber fraction with standard deviation, standard error and 95 % confidence interval over subjects.
    pub weber_detail: WeberFractions<MeanInterval>,
    /// Paired t-test of the Weber fractions between the modalities; positive if the threshold with haptics alone is larger.
    pub t: Outcome<TTest>,
    /// Effects of order, modality and base, and their interactions, on thresholds in the unit of the stimulus.
    pub anova: Vec<Effect>,
    /// Effect of the base on the Weber fraction, within each modality; `None` for a single base.
    pub constancy: WeberFractions<Option<Effect>>,
    /// R² of the linear trend of thresholds over bases (mean of both modalities); NaN (`null` in JSON) with fewer than three bases,
    /// or with equal means.
    pub linear_r2: f64,
    /// Thresholds by condition.
    pub thresholds: Vec<ThresholdCell>,
    /// Mean number of counted pairs per subject.
    pub pairs_per_subject: f64,
    /// Number of tracks without a threshold; [`Estimator::Procedure`] omits these tracks.
    pub unfinished_tracks: usize,
    /// Pairwise comparisons of the modalities at each base, and of the Weber fractions of the bases.
    pub post_hoc: Vec<PostHoc>,
    /// Movement measures; empty if a subject has no movement data in a condition.
    pub kinematics: Vec<KinematicMeasure>,
    /// Comparability with the thesis.
    #[serde(skip)]
    pub thesis: ThesisComparison,
    /// Responses from which the effects are computed.
    #[serde(skip)]
    pub responses: Vec<ResponseRow>,
}

impl JndAnalysis {
    /// Returns the number of tracks that the estimator omitted because they have no threshold; 0 for [`Estimator::Map`], which
    /// counts the answers of all tracks.
    #[must_use]
    pub fn omitted_tracks(&self) -> usize {
        match self.estimator {
            Estimator::Procedure => self.unfinished_tracks,
            Estimator::Map => 0,
        }
    }
}

/// Analyses the thresholds of a study.
///
/// # Errors
/// [`AnalysisError`] if a subject has no threshold in some condition, or a statistic cannot be computed, for instance with fewer
/// than two subjects.
pub fn analyse_jnd(
    protocol: &JndProtocol,
    subjects: &[SubjectRecord],
    options: &AnalysisOptions,
) -> Result<JndAnalysis, AnalysisError> {
    let fractions = subjects.iter().map(|subject| Fractions::of(protocol, subject, options.estimator));
    let fractions = fractions.collect::<Result<Vec<_>, _>>()?;
    let of = |modality| fractions.iter().map(|subject| mean(subject.modality(modality))).collect::<Vec<_>>();
    let weber_detail = WeberFractions::try_each(|modality| mean_interval(&of(modality), CONFIDENCE))?;

    let responses: Vec<Vec<f64>> = fractions.iter().map(|subject| subject.thresholds(protocol)).collect();
    let within = within_factors("base", &protocol.bases);
    let design = Design::new(order_factor(subjects), within, &responses)?;
    let thresholds = mean_responses(&protocol.bases, &responses)?.into_iter();

    let unfinished =
        |subject: &SubjectRecord| subject.tracks.iter().filter(|t| t.threshold.is_none()).count();
    let pairs = subjects.iter().map(|subject| subject.counted().count() as f64).collect::<Vec<_>>();
    Ok(JndAnalysis {
        task: "jnd",
        subjects: subjects.len(),
        estimator: options.estimator,
        weber: weber_detail.map(|detail| detail.mean),
        weber_detail,
        t: paired(&of(Modality::H), &of(Modality::Vh)).into(),
        anova: analyse(&design, options.sums_of_squares),
        constancy: WeberFractions::try_each(|modality| constancy(protocol, &fractions, modality, options))?,
        linear_r2: linear_r2(protocol, &fractions),
        thresholds: thresholds
            .map(|(modality, base, threshold)| ThresholdCell { modality, base, threshold })
            .collect(),
        pairs_per_subject: mean(&pairs),
        unfinished_tracks: subjects.iter().map(unfinished).sum(),
        post_hoc: {
            let fractions: Vec<Vec<f64>> = fractions.iter().map(Fractions::of_both).collect();
            let modalities = post_hoc::modalities("base", &protocol.bases, &responses);
            let bases = post_hoc::levels("fraction, base", &protocol.bases, &fractions);
            modalities.into_iter().chain(bases).collect()
        },
        kinematics: measures(&protocol.bases, subjects, options)?,
        thesis: ThesisComparison::jnd(protocol),
        responses: response_rows(subjects, &protocol.bases, &responses),
    })
}

/// Weber fractions of a subject by base, averaged over replications.
type Fractions = WeberFractions<Vec<f64>>;

impl Fractions {
    fn of(
        protocol: &JndProtocol,
        record: &SubjectRecord,
        estimator: Estimator,
    ) -> Result<Self, AnalysisError> {
        let of = |modality: Modality, base: f64| {
            let found = match estimator {
                Estimator::Procedure => mean_of_tracks(record, modality, base),
                Estimator::Map => map_of_trials(protocol, record, modality, base),
            };
            let (subject, modality) = (record.subject, modality.word());
            found.ok_or(AnalysisError::NoThreshold { subject, modality, base })
        };
        Self::try_each(|modality| protocol.bases.iter().map(|base| of(modality, *base)).collect())
    }

    /// Returns the means of the two modalities, by base.
    fn of_both(&self) -> Vec<f64> {
        means_of_both(&self.vh, &self.h)
    }

    /// Returns the thresholds in the unit of the stimulus, modality by base.
    fn thresholds(&self, protocol: &JndProtocol) -> Vec<f64> {
        let each =
            |modality| self.modality(modality).iter().zip(&protocol.bases).map(|(share, base)| share * base);
        Modality::ALL.into_iter().flat_map(each).collect()
    }
}

/// Returns the mean threshold, as a fraction of the base, over the replications with a threshold; `None` without one.
fn mean_of_tracks(record: &SubjectRecord, modality: Modality, base: f64) -> Option<f64> {
    let tracks = record.tracks.iter().filter(|track| track.modality == modality && track.base == base);
    let thresholds: Vec<f64> = tracks.filter_map(|track| track.threshold).collect();
    (!thresholds.is_empty()).then(|| mean(&thresholds))
}

/// Returns the most likely threshold, as a fraction of the base, given all answers at a base; `None` without answers.
fn map_of_trials(
    protocol: &JndProtocol,
    record: &SubjectRecord,
    modality: Modality,
    base: f64,
) -> Option<f64> {
    let observed = record.observations(modality, base);
    let target = protocol.procedure.target();
    (!observed.is_empty()).then(|| most_likely(&observed, &Prior::default(), target).threshold)
}

/// Tests the constancy of the Weber fraction over bases; `None` for a single base.
fn constancy(
    protocol: &JndProtocol,
    fractions: &[Fractions],
    modality: Modality,
    options: &AnalysisOptions,
) -> Result<Option<Effect>, AnalysisError> {
    if protocol.bases.len() < 2 {
        return Ok(None);
    }
    let base = WithinFactor { name: "base".to_owned(), levels: protocol.bases.len() };
    let rows: Vec<Vec<f64>> = fractions.iter().map(|subject| subject.modality(modality).clone()).collect();
    let design = Design::new(Vec::new(), vec![base], &rows)?;
    Ok(analyse(&design, options.sums_of_squares).into_iter().next())
}

fn linear_r2(protocol: &JndProtocol, fractions: &[Fractions]) -> f64 {
    let row = |subject: &Fractions| {
        subject.of_both().iter().zip(&protocol.bases).map(|(share, base)| share * base).collect()
    };
    let rows: Vec<Vec<f64>> = fractions.iter().map(row).collect();
    trend::linear(&protocol.bases, &rows).map_or(f64::NAN, |trend| trend.r_squared)
}
