//! Parameters of plugins, as data from which control panels, scenes and checks are generated.
//!
//! A plugin declares a schema (`&'static [Parameter]`). A host checks values against the schema before the plugin sees
//! them, so an author only checks conditions beyond a range (that values are consistent). Values are addressed by index
//! into the schema, not by name: setting a value in a running loop costs no string comparison.

use crate::abi::layout::layout;
use crate::abi::{Choices, Str};
use std::fmt;

layout! {
    Parameter { id, unit, doc, choices, kind, mutability, min, max, default }
    ParameterValue { index, reserved, number, text }
}

/// Builds a constant list of words for [`Parameter::choice`], [`Parameter::file`] and
/// [`crate::extension::details::Detail::word`]: `choices!["plane", "sphere"]`, or `choices!(= WORDS)` for a constant `&[&str]`.
#[macro_export]
macro_rules! choices {
    () => { $crate::Choices::EMPTY };
    (= $words:expr) => {{
        const WORDS: &[&str] = $words;
        const LIST: [$crate::abi::Str; WORDS.len()] = $crate::abi::Str::all(WORDS);
        $crate::Choices::new(&LIST)
    }};
    ($($word:literal),+ $(,)?) => { $crate::choices!(= &[$($word),+]) };
}

/// Kind of a parameter: the meaning of its numeric value.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// A real number between `min` and `max`, in `unit`.
    Real = 1,
    /// One of `choices`; the number is its index.
    Choice = 2,
    /// Free text (a serial number); set at creation only.
    Text = 3,
    /// File, or one of `choices`, which are built in; set at creation only. A host passes a path that can be opened from
    /// its working directory, and resolves a relative path in a scene against the folder of the scene.
    File = 4,
}

/// Times at which a parameter may be set.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mutability {
    /// Only when the instance is created.
    Fixed = 0,
    /// At any tick boundary while the loop runs.
    Live = 1,
}

/// Entry of a plugin's schema. Built with [`Parameter::real`], [`Parameter::choice`], [`Parameter::text`] or
/// [`Parameter::file`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Parameter {
    pub(crate) id: Str,
    pub(crate) unit: Str,
    pub(crate) doc: Str,
    pub(crate) choices: Choices,
    pub(crate) kind: u32,
    pub(crate) mutability: u32,
    pub(crate) min: f64,
    pub(crate) max: f64,
    pub(crate) default: f64,
}

impl Parameter {
    /// Declares a real number between `min` and `max`. `unit` is shown beside the slider ("mm", "N", "1" for none).
    pub const fn real(
        id: &'static str,
        unit: &'static str,
        min: f64,
        max: f64,
        default: f64,
        doc: &'static str,
    ) -> Self {
        Self {
            id: Str::new(id),
            unit: Str::new(unit),
            doc: Str::new(doc),
            choices: Choices::EMPTY,
            kind: ParameterKind::Real as u32,
            mutability: Mutability::Fixed as u32,
            min,
            max,
            default,
        }
    }

    /// Declares a choice from a fixed list of names; `default` is an index into the list.
    ///
    /// # Panics
    /// In the compiler (schemas are constants), if `default` is not an index.
    pub const fn choice(id: &'static str, choices: Choices, default: usize, doc: &'static str) -> Self {
        let count = choices.as_slice().len();
        assert!(default < count, "the default must be one of the choices");
        let mut parameter = Self::real(id, "", 0.0, (count - 1) as f64, default as f64, doc);
        parameter.choices = choices;
        parameter.kind = ParameterKind::Choice as u32;
        parameter
    }

    /// Declares a file, or one of `built_in` by its name; empty by default.
    pub const fn file(id: &'static str, built_in: Choices, doc: &'static str) -> Self {
        let mut parameter = Self::text(id, doc);
        parameter.kind = ParameterKind::File as u32;
        parameter.choices = built_in;
        parameter
    }

    /// Declares a free text, empty by default.
    pub const fn text(id: &'static str, doc: &'static str) -> Self {
        let mut parameter = Self::real(id, "", 0.0, 0.0, 0.0, doc);
        parameter.kind = ParameterKind::Text as u32;
        parameter
    }

    /// Makes the parameter changeable at tick boundaries.
    pub const fn live(mut self) -> Self {
        self.mutability = Mutability::Live as u32;
        self
    }

    /// Returns the name in scenes and on the command line.
    #[must_use]
    pub const fn id(&self) -> &str {
        self.id.as_str()
    }

    /// Returns the unit to display; "1" or empty for a dimensionless number.
    #[must_use]
    pub const fn unit(&self) -> &str {
        self.unit.as_str()
    }

    /// Returns the description, one sentence.
    #[must_use]
    pub const fn doc(&self) -> &str {
        self.doc.as_str()
    }

    /// Returns the names of a choice in index order, or the built-in files; empty for the other kinds.
    pub const fn choices(&self) -> &[Str] {
        self.choices.as_slice()
    }

    /// Returns the kind; an unknown code counts as a real number.
    #[must_use]
    pub const fn kind(&self) -> ParameterKind {
        match self.kind {
            2 => ParameterKind::Choice,
            3 => ParameterKind::Text,
            4 => ParameterKind::File,
            _ => ParameterKind::Real,
        }
    }

    /// Returns the mutability; an unknown code counts as fixed.
    #[must_use]
    pub const fn mutability(&self) -> Mutability {
        if self.mutability == Mutability::Live as u32 { Mutability::Live } else { Mutability::Fixed }
    }

    /// Returns the smallest legal number, in the parameter's unit.
    #[must_use]
    pub const fn min(&self) -> f64 {
        self.min
    }

    /// Returns the largest legal number, in the parameter's unit.
    #[must_use]
    pub const fn max(&self) -> f64 {
        self.max
    }

    /// Returns the default number, in the parameter's unit; a preset may override the default.
    #[must_use]
    pub const fn default(&self) -> f64 {
        self.default
    }

    /// Checks a number against kind and range. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`OutOfRange`] with the range, if the number is not finite, outside the range, or, for a choice, not an integer.
    pub fn check(&self, value: f64) -> Result<(), OutOfRange> {
        let in_range = value >= self.min && value <= self.max; // false for NaN
        let is_index = !matches!(self.kind(), ParameterKind::Choice) || value.fract() == 0.0;
        if in_range && is_index { Ok(()) } else { Err(OutOfRange { min: self.min, max: self.max, value }) }
    }
}

impl fmt::Debug for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} [{}] {}..{} = {}", self.id(), self.unit(), self.min, self.max, self.default)
    }
}

/// Error of an illegal number: outside the range of its parameter, or, for a choice, not an integer. `Copy`: nothing to allocate in
/// a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// Smallest legal number.
    pub min: f64,
    /// Largest legal number.
    pub max: f64,
    /// Rejected number.
    pub value: f64,
}

impl OutOfRange {
    /// Returns true if the number is in the range, so that only its fraction is illegal: the index of a choice. Not real-time.
    #[must_use]
    pub fn has_fraction(&self) -> bool {
        (self.min..=self.max).contains(&self.value)
    }
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { min, max, value } = self;
        match self.has_fraction() {
            true => write!(f, "{value} is not a whole number from {min} to {max}"), // the index of a choice
            false => write!(f, "{value} is outside {min} to {max}"),
        }
    }
}

impl std::error::Error for OutOfRange {}

/// Error of a change of a live parameter. `Copy`: nothing to allocate in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetParameterError {
    /// Parameter fixed in this instance: not live, or without effect with the current values of other parameters.
    Fixed,
    /// Number inconsistent with the values of other parameters.
    OutOfRange(OutOfRange),
}

impl fmt::Display for SetParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed => f.write_str(
                "the parameter cannot change in this instance: it is not live, or has no effect with the \
                 present values of the other parameters; set the parameter in the scene, or change the other \
                 parameters first",
            ),
            Self::OutOfRange(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for SetParameterError {}

impl From<OutOfRange> for SetParameterError {
    fn from(error: OutOfRange) -> Self {
        Self::OutOfRange(error)
    }
}

/// Value at the plugin boundary: index into the schema, number, text (of texts and files).
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ParameterValue {
    pub(crate) index: u32,
    pub(crate) reserved: u32,
    pub(crate) number: f64,
    pub(crate) text: Str,
}

impl ParameterValue {
    /// Builds the value of the parameter at `index`, with the text of a text or a file.
    #[must_use]
    pub const fn new(index: u32, number: f64, text: Str) -> Self {
        Self { index, reserved: 0, number, text }
    }
}

/// Explicitly set values of one instance, without defaults.
///
/// A plugin resolves the other values itself, because a default may depend on another parameter (a preset).
#[derive(Clone, Copy)]
pub struct Settings<'a> {
    schema: &'static [Parameter],
    values: &'a [ParameterValue],
}

impl<'a> Settings<'a> {
    pub(crate) fn new(schema: &'static [Parameter], values: &'a [ParameterValue]) -> Self {
        Self { schema, values }
    }

    /// Returns settings without explicit values, for tests of a plugin.
    #[must_use]
    pub const fn defaults(schema: &'static [Parameter]) -> Settings<'static> {
        Settings { schema, values: &[] }
    }

    fn explicit(&self, id: &str) -> Option<&'a ParameterValue> {
        let index = self.schema.iter().position(|parameter| parameter.id() == id)?;
        self.values.iter().rev().find(|value| value.index as usize == index)
    }

    /// Returns the number explicitly set for a real parameter or a choice, if any.
    #[must_use]
    pub fn number(&self, id: &str) -> Option<f64> {
        self.explicit(id).map(|value| value.number)
    }

    /// Returns the number set for a parameter, else the default of the schema; NaN for an unknown id.
    #[must_use]
    pub fn number_or_default(&self, id: &str) -> f64 {
        let default = || self.schema.iter().find(|p| p.id() == id).map_or(f64::NAN, Parameter::default);
        self.number(id).unwrap_or_else(default)
    }

    /// Returns the index set for a choice, else the default of the schema; 0 for an unknown id.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked indices, small and whole
    pub fn choice_or_default(&self, id: &str) -> usize {
        self.number_or_default(id) as usize
    }

    /// Returns the number of each parameter, set or default, in the order of the schema.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        self.schema.iter().map(|parameter| self.number_or_default(parameter.id())).collect()
    }

    /// Returns the element of `all` at the index of a choice, set or default; `all` must have the order of the choices.
    #[must_use]
    pub fn one_of<T: Copy, const N: usize>(&self, id: &str, all: [T; N]) -> T {
        const { assert!(N > 0, "a choice has at least one element") };
        all[self.choice_or_default(id).min(N - 1)]
    }

    /// Returns the text set for a text or the path set for a file; `None` if not set or empty.
    #[must_use]
    pub fn text(&self, id: &str) -> Option<&'a str> {
        self.explicit(id).map(|value| value.text.as_str()).filter(|text| !text.is_empty())
    }

    /// Returns the ids of all set values, in the order of the settings.
    pub fn ids(&self) -> impl Iterator<Item = &'static str> + 'a {
        let schema = self.schema;
        self.values.iter().filter_map(move |v| schema.get(v.index as usize).map(Parameter::id))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCHEMA: &[Parameter] = &[
        Parameter::real("stiffness_n_per_m", "N/m", 0.0, 100.0, 10.0, "Stiffness").live(),
        Parameter::choice("variant", choices!["fast", "exact"], 1, "Law"),
        Parameter::text("file", "Mesh"),
    ];

    #[test]
    fn range_and_index_are_checked() {
        assert!(SCHEMA[0].check(100.0).is_ok());
        assert!(SCHEMA[0].check(100.1).is_err());
        assert!(SCHEMA[0].check(f64::NAN).is_err());
        assert!(SCHEMA[1].check(1.0).is_ok());
        assert!(SCHEMA[1].check(0.5).is_err());
        assert!(SCHEMA[1].check(2.0).is_err());
    }

    #[test]
    fn settings_give_what_was_set_and_the_last_word_wins() {
        let value = |index, number| ParameterValue { index, reserved: 0, number, text: Str::new("") };
        let values = [value(0, 3.0), value(0, 4.0)];
        let settings = Settings::new(SCHEMA, &values);
        assert_eq!(settings.number("stiffness_n_per_m"), Some(4.0));
        assert_eq!(settings.number("variant"), None);
        assert_eq!(settings.choice_or_default("variant"), 1);
        assert!(settings.number_or_default("no such id").is_nan());
        assert_eq!(settings.text("file"), None);
    }
}
