//! What a person typed (`spring.gamma_n=17`) into what a plugin understands, checked against its schema.

use crate::abi::Str;
use crate::{Mutability, OutOfRange, Parameter, ParameterKind, ParameterValue, Refusal};

/// One checked value for one parameter of one plugin's schema. A plugin takes no setting of another's.
#[derive(Clone, Debug)]
pub struct Setting {
    parameter: &'static Parameter,
    index: u32,
    number: f64,
    text: String,
}

/// Why a setting is refused. Prints what, and what would be right.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// No parameter has this id.
    #[error("no parameter `{id}`; {}",
        nearest.as_ref().map_or("`flotor plugins ID` lists them".to_owned(), |n| format!("did you mean `{n}`?")))]
    Unknown {
        /// The id in the request.
        id: String,
        /// The most similar id, if one is similar at all.
        nearest: Option<String>,
    },
    /// A number was expected.
    #[error("`{id}` must be a number{}, not `{value}`", if unit.is_empty() { String::new() } else { format!(" in {unit}") })]
    NotANumber {
        /// The parameter.
        id: String,
        /// Its unit.
        unit: String,
        /// What was given.
        value: String,
    },
    /// The number is outside the range.
    #[error("`{id}` = {}: must be {} to {}{}", range.value, range.min, range.max, if unit.is_empty() { String::new() } else { format!(" {unit}") })]
    OutOfRange {
        /// The parameter.
        id: String,
        /// Its unit.
        unit: String,
        /// The number and its range.
        range: OutOfRange,
    },
    /// Not one of the choices.
    #[error("`{id}` = `{value}`: must be {}", choices.join(" | "))]
    NotAChoice {
        /// The parameter.
        id: String,
        /// What was given.
        value: String,
        /// What there is.
        choices: Vec<String>,
    },
}

impl Setting {
    /// Reads a value for the parameter `id` of a schema.
    ///
    /// # Errors
    /// [`SettingError`] with the closest valid id, the range, or the choices.
    pub fn parse(schema: &'static [Parameter], id: &str, value: &str) -> Result<Self, SettingError> {
        let (index, parameter) = find(schema, id)?;
        match parameter.kind() {
            ParameterKind::Text | ParameterKind::File => {
                Ok(Self { parameter, index, number: 0.0, text: value.to_owned() })
            }
            ParameterKind::Choice => {
                let names = parameter.choices();
                // A scene may write true or false.
                let is_it = |name: &Str| matches!((name.as_str(), value), ("on", "true") | ("off", "false"));
                let choice = names.iter().position(|name| name.as_str() == value || is_it(name));
                let choice = choice.ok_or_else(|| SettingError::NotAChoice {
                    id: id.to_owned(),
                    value: value.to_owned(),
                    choices: names.iter().map(|name| name.as_str().to_owned()).collect(),
                })?;
                Ok(Self { parameter, index, number: choice as f64, text: String::new() })
            }
            ParameterKind::Real => {
                let number = value.trim().parse::<f64>().map_err(|_| SettingError::NotANumber {
                    id: id.to_owned(),
                    unit: parameter.unit().to_owned(),
                    value: value.to_owned(),
                })?;
                Self::number(schema, id, number)
            }
        }
    }

    /// Takes a number for the parameter `id` of a schema (for a choice, its index).
    ///
    /// # Errors
    /// [`SettingError`] with the closest valid id or the range.
    pub fn number(schema: &'static [Parameter], id: &str, number: f64) -> Result<Self, SettingError> {
        let (index, parameter) = find(schema, id)?;
        parameter.check(number).map_err(|range| SettingError::OutOfRange {
            id: id.to_owned(),
            unit: parameter.unit().to_owned(),
            range,
        })?;
        Ok(Self { parameter, index, number, text: String::new() })
    }

    /// Index of the parameter in its schema.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index as usize
    }

    /// The number (for a choice, its index; 0 for texts and files).
    #[must_use]
    pub fn value(&self) -> f64 {
        self.number
    }

    /// The value as a person would type it.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked indices of a few choices
    pub fn display(&self) -> String {
        match self.parameter.kind() {
            ParameterKind::Text | ParameterKind::File => self.text.clone(),
            ParameterKind::Choice => {
                self.parameter.choices().get(self.number as usize).map_or("", Str::as_str).to_owned()
            }
            ParameterKind::Real => self.number.to_string(),
        }
    }
}

/// The form that crosses the boundary.
///
/// # Errors
/// A [`Refusal`] if one of them was made for another schema: its index would mean another parameter, or none.
///
/// # Safety
/// The result must not outlive `settings`.
pub(super) unsafe fn to_raw(
    settings: &[Setting],
    schema: &'static [Parameter],
) -> Result<Vec<ParameterValue>, Refusal> {
    let raw = |setting: &Setting| {
        if !schema.get(setting.index()).is_some_and(|own| std::ptr::eq(own, setting.parameter)) {
            let id = setting.parameter.id();
            return Err(Refusal::parameter(format!(
                "the setting `{id}` was made for another plugin; make it for this one's parameters"
            )));
        }
        // SAFETY: by the contract of this function nothing borrowed here outlives the setting.
        let text = unsafe { Str::borrowed(&setting.text) };
        Ok(ParameterValue { index: setting.index, reserved: 0, number: setting.number, text })
    };
    settings.iter().map(raw).collect()
}

/// The index that crosses the boundary, if the schema has it.
pub(super) fn index_of(schema: &[Parameter], index: usize) -> Option<u32> {
    u32::try_from(index).ok().filter(|_| index < schema.len())
}

/// The same of a live parameter that may take a value.
pub(super) fn live_index(schema: &[Parameter], index: usize, value: f64) -> Option<u32> {
    let parameter = schema.get(index)?;
    let is_legal = parameter.mutability() == Mutability::Live && parameter.check(value).is_ok();
    index_of(schema, index).filter(|_| is_legal)
}

fn find(schema: &'static [Parameter], id: &str) -> Result<(u32, &'static Parameter), SettingError> {
    let found = (0u32..).zip(schema).find(|(_, parameter)| parameter.id() == id);
    found.ok_or_else(|| {
        // Who writes `spring.gamma_n` has named the plugin twice.
        let key = id.rsplit_once('.').map_or(id, |(_, key)| key);
        let nearest = nearest(key, schema.iter().map(Parameter::id)).map(str::to_owned);
        SettingError::Unknown { id: id.to_owned(), nearest }
    })
}

/// The known word most like `word`, if any is like it at all. Not real-time.
pub fn nearest<'k>(word: &str, known: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    // Jaro-Winkler: a letter that is wrong, missing or swapped leaves 0.9 and more, an ending of its own (`rz_deg` for
    // `rz_rad`) 0.84; words that only share letters (`jelly` and `wall`: 0.63, `balls` and `wall`: 0.78) stay below.
    const ALIKE: f64 = 0.8;
    let scored = known.map(|candidate| (strsim::jaro_winkler(word, candidate), candidate));
    scored
        .filter(|(score, _)| *score > ALIKE)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_word_that_is_alike_is_suggested() {
        let near = |word| nearest(word, ["gamma_n", "gravity", "wall"].into_iter());
        assert_eq!(
            (near("gama_n"), near("graviti"), near("wal")),
            (Some("gamma_n"), Some("gravity"), Some("wall"))
        );
        for unlike in ["port", "jelly", "balls", ""] {
            assert_eq!(near(unlike), None, "{unlike}");
        }
    }
}
