//! Choices of a protocol as words of the command line.

use clap::ValueEnum;
use flotor_study::apparatus::Kinematics;
use flotor_study::procedure::{Averaging, StepAtReversal};
use flotor_study::protocol::{AtBoundary, ComparisonSide, FirstModality, PresentationOrder};
use flotor_study::trial::Modality;

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

/// `--averaging`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum AveragingChoice {
    /// Both count
    #[default]
    BothEnds,
    /// The trial of the first does not
    AfterFirst,
    /// The trial of the last does not
    BeforeLast,
}

impl From<AveragingChoice> for Averaging {
    fn from(choice: AveragingChoice) -> Self {
        match choice {
            AveragingChoice::BothEnds => Self::BothEnds,
            AveragingChoice::AfterFirst => Self::AfterFirst,
            AveragingChoice::BeforeLast => Self::BeforeLast,
        }
    }
}

/// `--step-at-reversal`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum StepChoice {
    /// The halved one, at once
    #[default]
    New,
    /// The old one
    Old,
}

impl From<StepChoice> for StepAtReversal {
    fn from(choice: StepChoice) -> Self {
        match choice {
            StepChoice::New => Self::New,
            StepChoice::Old => Self::Old,
        }
    }
}

/// `--side`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum SideChoice {
    /// Above the base
    #[default]
    Above,
    /// Below the base
    Below,
    /// Drawn for each trial
    Random,
}

impl From<SideChoice> for ComparisonSide {
    fn from(choice: SideChoice) -> Self {
        match choice {
            SideChoice::Above => Self::Above,
            SideChoice::Below => Self::Below,
            SideChoice::Random => Self::Random,
        }
    }
}

/// `--order`
#[derive(Clone, Copy, Debug, Default, ValueEnum)]
pub(super) enum OrderChoice {
    /// Drawn for each trial
    #[default]
    Random,
    /// The base
    BaseFirst,
    /// The comparison
    ComparisonFirst,
}

impl From<OrderChoice> for PresentationOrder {
    fn from(choice: OrderChoice) -> Self {
        match choice {
            OrderChoice::Random => Self::Random,
            OrderChoice::BaseFirst => Self::BaseFirst,
            OrderChoice::ComparisonFirst => Self::ComparisonFirst,
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

/// `--kinematics`
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(super) enum KinematicsOption {
    /// Every tick of every trial (MCAP), and the measures
    Full,
    /// Measures of each stimulus
    Summary,
    /// Nothing
    None,
}

impl From<KinematicsOption> for Kinematics {
    fn from(option: KinematicsOption) -> Self {
        match option {
            KinematicsOption::Full => Self::Full,
            KinematicsOption::Summary => Self::Summary,
            KinematicsOption::None => Self::None,
        }
    }
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
