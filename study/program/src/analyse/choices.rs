//! Options of an analysis, from the command line or the plan in a study file.

use clap::{Args, ValueEnum};
use flotor_analysis::{AnalysisOptions, Estimator};
use flotor_statistics::anova::SumOfSquares;
use flotor_study::protocol::{Protocol, RatingScale};
use serde::Deserialize;

/// Options of `flotor analyse` that affect its results.
#[derive(Args, Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Choices {
    /// Threshold estimator; no effect on ratings
    #[arg(long, value_enum, default_value_t)]
    pub(crate) estimator: Estimator,
    /// Sums of squares of the analysis of variance
    #[arg(long = "type", value_enum, default_value_t)]
    sums: Sums,
    /// Normalisation of the ratings between subjects; no effect on thresholds
    #[arg(long, value_enum, default_value_t)]
    ratings: RatingScale,
}

/// Values of `--type`.
#[derive(Clone, Copy, Debug, Default, PartialEq, ValueEnum)]
enum Sums {
    /// Each effect adjusted for the effects that do not contain it
    #[value(name = "II")]
    Two,
    /// Each effect adjusted for all others
    #[default]
    #[value(name = "III")]
    Three,
}

/// Table `[analyse]` of a study file: options of `flotor analyse` by name.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PlannedTable {
    estimator: Option<String>,
    #[serde(rename = "type")]
    sums: Option<String>,
    ratings: Option<String>,
}

impl Choices {
    /// Returns the options of the analysis.
    pub(crate) fn options(self) -> AnalysisOptions {
        AnalysisOptions {
            sums_of_squares: match self.sums {
                Sums::Two => SumOfSquares::Two,
                Sums::Three => SumOfSquares::Three,
            },
            rating_scale: self.ratings,
            estimator: self.estimator,
        }
    }

    /// Parses the planned options; a missing option has its default.
    ///
    /// # Errors
    /// The first invalid value, with a list of the valid values.
    pub(crate) fn planned(table: &PlannedTable) -> Result<Self, String> {
        Ok(Self {
            estimator: planned("estimator", table.estimator.as_deref())?,
            sums: planned("type", table.sums.as_deref())?,
            ratings: planned("ratings", table.ratings.as_deref())?,
        })
    }

    /// Returns name and value of each option that affects this task.
    pub(crate) fn of_task(self, protocol: &Protocol) -> [(&'static str, String); 2] {
        let own = match protocol {
            Protocol::Jnd(_) => ("estimator", word(&self.estimator)),
            Protocol::Magnitude(_) => ("ratings", word(&self.ratings)),
        };
        [own, ("type", word(&self.sums))]
    }

    /// Describes each option of this task whose value differs from the planned options `from`.
    pub(crate) fn deviations(self, from: Self, protocol: &Protocol) -> Vec<String> {
        let both = self.of_task(protocol).into_iter().zip(from.of_task(protocol));
        let different = both.filter(|(used, planned)| used != planned);
        different.map(|((name, used), (_, planned))| format!("--{name} {used}, planned {planned}")).collect()
    }
}

fn planned<T: ValueEnum + Default>(name: &str, text: Option<&str>) -> Result<T, String> {
    let Some(text) = text else { return Ok(T::default()) };
    T::from_str(text, false).map_err(|_| {
        let values: Vec<String> = T::value_variants().iter().map(word).collect();
        format!("analyse.{name}: `{text}` is not valid; use one of {}", values.join(", "))
    })
}

/// Returns the command-line name of a value.
fn word(value: &impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}
