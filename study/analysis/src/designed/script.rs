//! Scripts in R and Python that repeat the rows of an analysis from the table of trials.

use super::measure::MeasureKind;
use flotor_study_design::design::Design;
use flotor_study_design::factor::Vary;
use flotor_study_design::value::Value;

/// Scripts, with places for the table's name, the factors and the measure.
const PYTHON: &str = include_str!("../scripts/designed.py");
const R: &str = include_str!("../scripts/designed.R");

/// Language of a script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// Python, with numpy, scipy and pandas.
    Python,
    /// R without packages.
    R,
}

/// Returns the script for a design and its table of trials, a file beside the script.
#[must_use]
pub fn script(design: &Design, language: Language, table_name: &str) -> String {
    let names = |is_within: bool| {
        let all = design.factors().iter().filter(|factor| (factor.vary == Vary::Within) == is_within);
        all.map(|factor| format!("\"{}\"", factor.name)).collect::<Vec<_>>().join(", ")
    };
    let levels = design.factors().iter().map(|factor| {
        let values: Vec<String> = factor.values.iter().map(literal).collect();
        let (name, values) = (&factor.name, values.join(", "));
        match language {
            Language::Python => format!("\"{name}\": [{values}]"),
            Language::R => format!("{name} = c({values})"),
        }
    });
    let levels = levels.collect::<Vec<_>>().join(", ");
    let text = match language {
        Language::Python => PYTHON,
        Language::R => R,
    };
    let table = table_name.replace('\\', "\\\\").replace('"', "\\\"");
    text.replace("@TABLE@", &table)
        .replace("@WITHIN@", &names(true))
        .replace("@BETWEEN@", &names(false))
        .replace("@LEVELS@", &levels)
        .replace("@MEASURE@", MeasureKind::of(design).word())
}

/// Returns a level as both languages write it.
fn literal(value: &Value) -> String {
    match value {
        Value::Number(number) => number.to_string(),
        Value::Choice(word) => format!("\"{}\"", word.replace('\\', "\\\\").replace('"', "\\\"")),
    }
}
