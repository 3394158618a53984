//! Conversion of user input (`spring.gamma_n=17`) to parameter values, checked against a plugin's schema.

use flotor_hal::abi::Str;
use flotor_hal::{Mutability, OutOfRange, Parameter, ParameterKind, ParameterValue, Refusal};

/// Checked value of one parameter of a plugin's schema. Plugins with another schema reject the setting.
#[derive(Clone, Debug)]
pub struct Setting {
    parameter: &'static Parameter,
    index: u32,
    number: f64,
    text: String,
}

/// Error in a setting. Prints the problem and the valid values.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingError {
    /// No parameter has this id.
    #[error("no parameter `{id}`; {}",
        nearest.as_ref().map_or("`flotor plugins ID` lists the parameters".to_owned(), |n| format!("did you mean `{n}`?")))]
    Unknown {
        /// Requested id.
        id: String,
        /// Most similar id, if similar enough.
        nearest: Option<String>,
    },
    /// The value is not a number.
    #[error("`{id}` must be a number{}, not `{value}`", if unit.is_empty() { String::new() } else { format!(" in {unit}") })]
    NotANumber {
        /// Id of the parameter.
        id: String,
        /// Unit of the parameter; empty if dimensionless.
        unit: String,
        /// Rejected value.
        value: String,
    },
    /// The number is outside the range or, for a choice, not an integer.
    #[error("`{id}` = {}: must be {}{} to {}{}", range.value, if range.has_fraction() { "a whole number from " } else { "" },
        range.min, range.max, if unit.is_empty() { String::new() } else { format!(" {unit}") })]
    OutOfRange {
        /// Id of the parameter.
        id: String,
        /// Unit of the parameter; empty if dimensionless.
        unit: String,
        /// Number and its legal range.
        range: OutOfRange,
    },
    /// The value is not one of the choices.
    #[error("`{id}` = `{value}`: must be {}", choices.join(" | "))]
    NotAChoice {
        /// Id of the parameter.
        id: String,
        /// Rejected value.
        value: String,
        /// Valid choices.
        choices: Vec<String>,
    },
}

impl Setting {
    /// Parses a value for the parameter `id` of a schema.
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
                // Scenes may use the booleans true and false.
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
                    unit: unit_of(parameter),
                    value: value.to_owned(),
                })?;
                Self::number(schema, id, number)
            }
        }
    }

    /// Checks a number for the parameter `id` of a schema (for a choice, its index).
    ///
    /// # Errors
    /// [`SettingError`] with the closest valid id or the range.
    pub fn number(schema: &'static [Parameter], id: &str, number: f64) -> Result<Self, SettingError> {
        let (index, parameter) = find(schema, id)?;
        parameter.check(number).map_err(|range| SettingError::OutOfRange {
            id: id.to_owned(),
            unit: unit_of(parameter),
            range,
        })?;
        Ok(Self { parameter, index, number, text: String::new() })
    }

    /// Returns the index of the parameter in its schema.
    #[must_use]
    pub fn index(&self) -> usize {
        self.index as usize
    }

    /// Returns the value as a number in the parameter's unit: for a choice, its index; 0 for texts and files.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.number
    }

    /// Formats the value in the syntax that [`Self::parse`] accepts.
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

/// Returns the unit of a parameter for an error; empty if dimensionless.
fn unit_of(parameter: &Parameter) -> String {
    Some(parameter.unit()).filter(|unit| *unit != "1").unwrap_or_default().to_owned()
}

/// Converts settings to the form of the plugin boundary.
///
/// # Errors
/// A [`Refusal`] if a setting was made for another schema: its index would mean another parameter, or none.
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
                "the setting `{id}` was created for another plugin; create the setting from the parameters of this plugin"
            )));
        }
        // SAFETY: by the contract of this function nothing borrowed here outlives the setting.
        let text = unsafe { Str::borrowed(&setting.text) };
        Ok(ParameterValue::new(setting.index, setting.number, text))
    };
    settings.iter().map(raw).collect()
}

/// Converts an index for the plugin boundary; `None` outside the schema.
pub(super) fn index_of(schema: &[Parameter], index: usize) -> Option<u32> {
    u32::try_from(index).ok().filter(|_| index < schema.len())
}

/// Converts the index of a live parameter for the plugin boundary; `None` if the parameter cannot take the value.
pub(super) fn live_index(schema: &[Parameter], index: usize, value: f64) -> Option<u32> {
    let parameter = schema.get(index)?;
    let is_legal = parameter.mutability() == Mutability::Live && parameter.check(value).is_ok();
    index_of(schema, index).filter(|_| is_legal)
}

fn find(schema: &'static [Parameter], id: &str) -> Result<(u32, &'static Parameter), SettingError> {
    let found = (0u32..).zip(schema).find(|(_, parameter)| parameter.id() == id);
    found.ok_or_else(|| {
        // The key of `spring.gamma_n`: the plugin is already named.
        let key = id.rsplit_once('.').map_or(id, |(_, key)| key);
        let nearest = nearest(key, schema.iter().map(Parameter::id)).map(str::to_owned);
        SettingError::Unknown { id: id.to_owned(), nearest }
    })
}

/// Returns the known word most similar to `word`; `None` if no known word is similar enough. Not real-time.
pub fn nearest<'k>(word: &str, known: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    // Jaro-Winkler similarity: one wrong, missing or swapped character gives at least 0.9, a different ending (`rz_deg` for
    // `rz_rad`) 0.84; words that only share characters (`jelly` and `wall`: 0.63, `balls` and `wall`: 0.78) score lower.
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
