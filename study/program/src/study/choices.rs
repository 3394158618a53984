//! Command-line values of protocol settings.

use clap::ValueEnum;
use flotor_command::options::real;
use flotor_study::observer::{Percept, Population};
use flotor_study::protocol::{AtBoundary, FirstModality, Quality, Stimulus};
use flotor_study::trial::Modality;

/// Values of `--first`.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum FirstChoice {
    /// Odd subject numbers: vision and haptics; even subject numbers: haptics alone
    #[default]
    ByNumber,
    /// Vision and haptics
    Vh,
    /// Haptics alone
    H,
}

impl From<FirstChoice> for FirstModality {
    fn from(choice: FirstChoice) -> Self {
        match choice {
            FirstChoice::ByNumber => Self::BySubjectNumber,
            FirstChoice::Vh => Self::Always(Modality::Vh),
            FirstChoice::H => Self::Always(Modality::H),
        }
    }
}

/// Values of `--boundary`.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum BoundaryChoice {
    /// Repeat the trial, at most three times
    #[default]
    Repeat,
    /// Keep the answer, log the event
    Keep,
}

impl From<BoundaryChoice> for AtBoundary {
    fn from(choice: BoundaryChoice) -> Self {
        match choice {
            BoundaryChoice::Repeat => Self::default(),
            BoundaryChoice::Keep => Self::Keep,
        }
    }
}

/// Values of `--procedure`.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum ProcedureChoice {
    /// Smaller difference after a correct answer, larger after a wrong one or "I don't know", until --stop-after reversals
    /// (Kaernbach 2001)
    #[default]
    WeightedUpDown,
    /// A fixed number of trials, each at the difference of the largest expected information
    Questplus,
}

/// Values of `--apparatus`.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum PresentationOption {
    /// A scene, explored by a simulated hand
    #[default]
    Scene,
    /// No apparatus: answers are computed from the stimulus values, for studies of the method
    None,
}

/// Values of `--noise`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum NoiseOption {
    /// Play if this machine can
    #[default]
    Auto,
    /// Play, or fail
    On,
    /// Do not play
    Off,
}

/// Values of `--way`.
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum ForceWay {
    /// A weight, which pulls down
    #[default]
    Felt,
    /// A resistance to the pushing hand
    Exerted,
}

impl ForceWay {
    /// Returns the settings of the model `load` for this kind of force.
    pub(super) fn load(self) -> &'static [&'static str] {
        match self {
            Self::Felt => &["load.kind=felt"],
            Self::Exerted => &["load.kind=exerted"],
        }
    }

    /// Returns the settings of the simulated hand in the built-in scene that differ from its settings for a spring.
    pub(super) fn hand(self) -> &'static [&'static str] {
        match self {
            // Only the hand supports a weight: the heaviest weight of the default bases (17.5 N) deflects the softest hand (1.5
            // N/mm) by 12 mm, the whole range below home. The intended position is therefore above home, and the hand lifts the
            // weight a little.
            Self::Felt => &["device.hand_centre_mm=4", "device.hand_amplitude_mm=3"],
            Self::Exerted => &[],
        }
    }
}

/// Returns the population of simulated subjects who compare pairs of a stimulus; `way` is the kind of force in a force experiment.
///
/// # Errors
/// If no Weber fraction of the stimulus is published.
pub(super) fn population(stimulus: &Stimulus, way: Option<ForceWay>) -> Result<Population, String> {
    let percept = match (stimulus.quality(), way) {
        (Quality::Force, Some(ForceWay::Exerted)) => Percept::ExertedForce,
        (Quality::Force, Some(ForceWay::Felt) | None) => Percept::FeltForce,
        (Quality::Stiffness, _) if stimulus.is_stiffness() => Percept::Stiffness,
        (Quality::Stiffness, _) => {
            return Err(format!(
                "stimulus {stimulus}: simulated observers have Weber fractions only for stiffness and force; give \
                 their thresholds, with vision and without, like --weber 0.14,0.17"
            ));
        }
    };
    Ok(Population::judging(percept))
}

/// Parses `VH,H`: two thresholds as fractions of the base, above 0 and below 1.
pub(super) fn thresholds(text: &str) -> Result<[f64; 2], String> {
    let (vh, h) = text.split_once(',').ok_or("write VH,H, like 0.14,0.17")?;
    let both = [real(vh)?, real(h)?];
    let are_shares = both.iter().all(|share| (0.0..1.0).contains(share) && *share > 0.0);
    if are_shares { Ok(both) } else { Err("both shares must be above 0 and below 1".to_owned()) }
}

/// Parses the range `LEAST-MOST`; the first value must be smaller.
pub(super) fn range(text: &str) -> Result<(f64, f64), String> {
    let (least, most) = text.split_once('-').ok_or("write LEAST-MOST, like 12-48")?;
    let (least, most) = (real(least)?, real(most)?);
    if least < most {
        Ok((least, most))
    } else {
        Err(format!("the range {least}-{most} is empty; write two different numbers, the smaller first"))
    }
}
