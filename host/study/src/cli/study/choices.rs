//! Choices of a protocol as words of the command line.

use crate::protocol::{AtBoundary, FirstModality};
use crate::trial::Modality;
use clap::ValueEnum;

/// `--first`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum FirstChoice {
    /// Odd subject numbers vision and haptics, even ones haptics alone
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

/// `--boundary`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum BoundaryChoice {
    /// The trial comes again, at most three times
    #[default]
    Repeat,
    /// The answer counts, the hit is noted
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

/// `--procedure`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum ProcedureChoice {
    /// Kaernbach's rule, as in the report
    #[default]
    WeightedUpDown,
    /// Trials where they tell most, a fixed number of them
    Questplus,
}

/// `--apparatus`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum PresentationOption {
    /// A scene, felt by a simulated hand
    #[default]
    Scene,
    /// Nothing: answers follow from the numbers alone, for studies of the method
    None,
}

/// `--noise`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum NoiseOption {
    /// If this machine can
    #[default]
    Auto,
    /// It must
    On,
    /// None
    Off,
}

/// `--way`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum ForceWay {
    /// A weight: it pulls down
    #[default]
    Felt,
    /// A resistance: it is pushed against
    Exerted,
}

impl ForceWay {
    /// The setting of the load that makes it so.
    pub(super) fn load(self) -> &'static [&'static str] {
        match self {
            Self::Felt => &["load.kind=felt"],
            Self::Exerted => &["load.kind=exerted"],
        }
    }

    /// How the simulated hand of the built-in scene goes about it, where not as with a spring.
    pub(super) fn hand(self) -> &'static [&'static str] {
        match self {
            // Nothing but the hand holds a weight up: the softest of hands (1.5 N/mm) gives way by 12 mm to the heaviest
            // that the default bases can lead to (17.5 N), which is all the way there is below home. So it means to be above
            // home, and lifts the weight a little.
            Self::Felt => &["device.hand_centre_mm=4", "device.hand_amplitude_mm=3"],
            Self::Exerted => &[],
        }
    }
}

/// `LEAST-MOST`, of which the first is smaller.
pub(super) fn range(text: &str) -> Result<(f64, f64), String> {
    let number = |text: &str| text.trim().parse::<f64>().map_err(|_| format!("`{text}` is no number"));
    let (least, most) = text.split_once('-').ok_or("write LEAST-MOST, like 12-48")?;
    let (least, most) = (number(least)?, number(most)?);
    if least < most {
        Ok((least, most))
    } else {
        Err(format!("{least}-{most} is empty: the first must be smaller"))
    }
}
