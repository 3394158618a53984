//! Published results of CMU-RI-TR-07-21 (section 4.3), for comparison.

use flotor_statistics::describe::MeanInterval;
use flotor_study::protocol::{JndProtocol, MagnitudeProtocol, Stimulus};

/// Comparability of a study with the thesis, whose results hold only for springs with the bases and stimuli of the thesis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[must_use]
pub enum ThesisComparison {
    /// The settings match the thesis.
    Thesis,
    /// The settings differ.
    #[default]
    Nothing,
}

impl ThesisComparison {
    /// Compares the settings of a difference experiment with the thesis: springs with bases of 17, 26 and 35 N, larger
    /// comparisons, a target of 75 %.
    pub fn jnd(protocol: &JndProtocol) -> Self {
        let usual = JndProtocol::default();
        let is_same = is_of_springs(&protocol.stimulus)
            && protocol.bases == usual.bases
            && protocol.side == usual.side
            && protocol.procedure.target() == usual.procedure.target();
        if is_same { Self::Thesis } else { Self::Nothing }
    }

    /// Compares the settings of a magnitude experiment with the thesis: springs with twelve stimuli of 12 to 48 N.
    pub fn magnitude(protocol: &MagnitudeProtocol) -> Self {
        let is_same =
            is_of_springs(&protocol.stimulus) && protocol.values == MagnitudeProtocol::default().values;
        if is_same { Self::Thesis } else { Self::Nothing }
    }

    /// Returns `text`, a result of the thesis, if the study is comparable, else an empty text.
    #[must_use]
    pub fn text(self, text: &str) -> &str {
        if self == Self::Thesis { text } else { "" }
    }

    /// Returns `effects`, results of the thesis, if the study is comparable, else an empty slice.
    #[must_use]
    pub fn effects(self, effects: &[Published]) -> &[Published] {
        if self == Self::Thesis { effects } else { &[] }
    }

    /// Returns the Weber fractions of the thesis ([`WEBER`]) if the study is comparable.
    #[must_use]
    pub fn weber(self) -> Option<[f64; 2]> {
        (self == Self::Thesis).then_some(WEBER)
    }
}

fn is_of_springs(stimulus: &Stimulus) -> bool {
    (stimulus.model.as_str(), stimulus.parameter.as_str()) == ("spring", "gamma_n")
}

/// Name of an effect, and its test statistic as printed in the thesis.
pub type Published = (&'static str, &'static str);

/// Effects on thresholds (section 4.3.2).
pub const JND: [Published; 3] = [
    ("modality", "F(1, 14) = 11.94, p = 0.004"),
    ("base", "F(2, 28) = 23.01, p < 0.001"),
    ("modality:base", "F(2, 28) = 3.10, p = 0.061"),
];
/// Effects on ratings (section 4.3.1).
pub const MAGNITUDE: [Published; 3] = [
    ("modality", "F(1, 14) < 0.02, p = 0.88"),
    ("order", "F(1, 14) < 0.823, p = 0.198"),
    ("stimulus", "F(11, 154) = 13.57, p < 0.001"),
];
/// Mean Weber fractions: vision and haptics, haptics alone.
pub const WEBER: [f64; 2] = [0.142, 0.172];
/// Effects of the base on Weber fractions: vision and haptics, haptics alone.
pub const CONSTANCY: [&str; 2] = ["F(2, 30) = 1.46, p = 0.25", "F(2, 30) = 0.80, p = 0.46"];
/// Paired t-test of the Weber fractions between the modalities.
pub const T: &str = "t(15) = 3.30, p = 0.005";
/// R² of the linear trend of the mean ratings over the stimuli.
pub const LINEAR_R2: f64 = 0.983;

/// Returns the published effects on a movement measure in a task (modality had no effect); empty for other tasks and measures.
#[must_use]
pub fn movement(task: &str, measure: &str) -> &'static [Published] {
    match (task, measure) {
        ("jnd", "mean speed") => &[("stimulus", "F(2, 12) = 5.13, p = 0.025"), ("modality", "none")],
        ("jnd", "mean acceleration") => &[("stimulus", "none"), ("modality", "none")],
        ("jnd", "mean force") => &[("stimulus", "F(2, 12) = 13.18, p = 0.001"), ("modality", "none")],
        ("magnitude", "mean speed") => &[("stimulus", "F(11, 77) = 9.25, p < 0.001"), ("modality", "none")],
        ("magnitude", "mean acceleration") => {
            &[("stimulus", "F(11, 77) = 3.73, p < 0.001"), ("modality", "none")]
        }
        ("magnitude", "mean force") => &[("stimulus", "F(11, 77) = 11.92, p < 0.001"), ("modality", "none")],
        _ => &[],
    }
}

/// Formats the direction of change with the stimulus that section 5 publishes for a movement measure, and whether `exponent`
/// reproduces this direction: whether its confidence interval lies entirely on that side of 0. Returns `None` for a measure
/// without a published direction. Section 5 states: "velocity and acceleration are directly proportional and force is inversely
/// proportional to the rendered gamma".
#[must_use]
pub fn direction(measure: &str, exponent: &MeanInterval) -> Option<String> {
    let [low, high] = exponent.interval;
    let (way, is_reproduced) = match measure {
        "mean speed" | "mean acceleration" => ("rises", low > 0.0),
        "mean force" => ("falls", high < 0.0),
        _ => return None,
    };
    let reproduced = if is_reproduced { "reproduced" } else { "not reproduced" };
    Some(format!("{way} (section 5): {reproduced}"))
}
