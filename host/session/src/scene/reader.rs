//! Reader of TOML tables, key by key, whose errors name file, line, key and remedy.
//!
//! serde would report the line of an unknown key but not the closest valid one; here each key is removed by name, and keys that
//! remain at the end are unknown.

use flotor_core::limits::Bound;
pub use flotor_loader::nearest;
use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt::Display;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Key of a table.
type Key = &'static str;
/// Range of the legal values of a number.
pub(super) type Legal = RangeInclusive<f64>;

/// Location of a value, for error messages: a line of a file, or a command line option.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// Path of the file, or a substitute such as "built-in demo" or "--set".
    pub file: PathBuf,
    /// Line number, from 1; 0 for a source without lines.
    pub line: usize,
}

impl Location {
    /// Returns true if the location is a line; false for a command line option, and for a file as a whole. Not real-time.
    #[must_use]
    pub fn is_in_a_file(&self) -> bool {
        self.line > 0
    }

    /// Returns an error at this location. Not real-time.
    pub(crate) fn problem(&self, problem: impl Into<String>) -> SceneError {
        SceneError { location: self.clone(), problem: problem.into() }
    }
}

impl Display for Location {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            0 => write!(f, "{}", self.file.display()),
            line => write!(f, "{}:{line}", self.file.display()),
        }
    }
}

/// Error in a scene, in one line: location, key, problem and remedy.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{location}: {problem}")]
pub struct SceneError {
    /// Location of the problem.
    pub location: Location,
    /// Key, problem and remedy.
    pub problem: String,
}

/// Parameter of a plugin as written in a scene or on a command line, not yet checked.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterText {
    /// Id of the parameter.
    pub key: String,
    /// Value of the parameter, as text.
    pub value: String,
    /// Location of the value.
    pub location: Location,
}

/// Text of a scene, with an index of its lines.
pub(super) struct Source<'t> {
    file: &'t Path,
    pub(super) text: &'t str,
    /// Byte offsets of the line ends, for a lookup of line numbers by binary search.
    line_ends: Vec<usize>,
    /// Name and looked-up keys of each table that was read to its end.
    seen: RefCell<Vec<(String, Vec<Known>)>>,
    /// Keys looked up at the top level, above all tables.
    above: RefCell<Vec<Key>>,
}

/// Key that is looked up, with the type of its value.
#[derive(Clone, Debug)]
pub(super) struct Known {
    pub(super) key: Key,
    pub(super) takes: Takes,
}

/// Type of a key's value, as far as the lookup determines it.
#[derive(Clone, Debug)]
pub(super) enum Takes {
    /// Value described in the book only.
    Value,
    /// A number in a range.
    Number(Legal),
    /// Three numbers, or one for all.
    Three(Legal),
    /// Bound of a vector: one number (the norm), three numbers (one for each axis), or a table with both.
    Bound(Legal),
    /// A table.
    Table,
    /// A list of tables.
    Tables,
}

impl<'t> Source<'t> {
    pub(super) fn new(file: &'t Path, text: &'t str) -> Self {
        let line_ends = text.match_indices('\n').map(|(at, _)| at).collect();
        Self { file, text, line_ends, seen: RefCell::default(), above: RefCell::default() }
    }

    /// Returns the tables that were read to their end, by name, with the keys looked up in each.
    pub(super) fn into_seen(self) -> Vec<(String, Vec<Known>)> {
        self.seen.into_inner()
    }

    fn location(&self, span: &Range<usize>) -> Location {
        let before = self.line_ends.partition_point(|end| *end < span.start);
        Location { file: self.file.into(), line: before + 1 }
    }

    pub(super) fn parse(&'t self) -> Result<Section<'t>, SceneError> {
        let root = DeTable::parse(self.text).map_err(|error| {
            let location = self.location(&error.span().unwrap_or(0..0));
            let line = self.text.lines().nth(location.line - 1).unwrap_or_default().trim();
            let line: String = line.chars().take(80).collect(); // a JSON file may have one line
            let is_number =
                |(a, b): (&str, &str)| a.ends_with(char::is_numeric) && b.starts_with(char::is_numeric);
            let problem = if line.split_once(',').is_some_and(is_number) && !line.contains('[') {
                format!("use a point as the decimal separator: `{}`", line.replace(',', "."))
            } else if line.contains('\\') {
                format!("put text with a backslash in single quotes: `{}`", line.replace('"', "'"))
            } else {
                error.message().lines().next().unwrap_or_default().to_owned()
            };
            location.problem(format!("not valid TOML: `{line}`: {problem}"))
        })?;
        let (name, span) = (String::new(), root.span());
        Ok(Section { source: self, name, span, table: root.into_inner(), known: Vec::new() })
    }
}

/// Returns the first control character of a text except line feed and tab: it could control a terminal.
fn control_character(text: &str) -> Option<char> {
    text.chars().find(|character| character.is_control() && !matches!(character, '\n' | '\t'))
}

/// Table of a scene. Keys are removed as they are read; remaining keys are unknown.
pub(super) struct Section<'t> {
    source: &'t Source<'t>,
    name: String,
    span: Range<usize>,
    table: DeTable<'t>,
    known: Vec<Known>,
}

/// Value taken from a section, with its location.
pub(super) struct Value<'t> {
    pub(super) location: Location,
    key: String,
    value: DeValue<'t>,
}

impl<'t> Section<'t> {
    /// Removes a key and returns its value; `None` if the key is absent.
    pub(super) fn take(&mut self, key: Key) -> Option<Value<'t>> {
        self.take_as(key, Takes::Value)
    }

    fn take_as(&mut self, key: Key, takes: Takes) -> Option<Value<'t>> {
        self.known.push(Known { key, takes });
        if self.name.is_empty() {
            self.source.above.borrow_mut().push(key);
        }
        let (_, value) = self.table.remove_entry(key)?;
        let location = self.source.location(&value.span());
        Some(Value { location, key: self.path(key), value: value.into_inner() })
    }

    /// Returns the location of the table.
    pub(super) fn location(&self) -> Location {
        self.source.location(&self.span)
    }

    /// Removes a required key and returns its value.
    pub(super) fn require(&mut self, key: Key) -> Result<Value<'t>, SceneError> {
        let missing = self.missing(key);
        self.take(key).ok_or(missing)
    }

    /// Returns the error about a missing key, or about an unknown key with a similar name, if the table has one.
    pub(super) fn missing(&self, key: &str) -> SceneError {
        let alike = nearest(key, self.table.keys().map(|written| &**written.get_ref()));
        if let Some(written) = self.table.keys().find(|written| Some(&**written.get_ref()) == alike) {
            return self.unknown(written, &format!("; did you mean `{key}`?"));
        }
        self.location().problem(format!("`{}` is missing", self.path(key)))
    }

    /// Removes a key and reads its value; `None` if the key is absent.
    pub(super) fn read<T>(
        &mut self,
        key: Key,
        read: impl FnOnce(Value<'t>) -> Result<T, SceneError>,
    ) -> Result<Option<T>, SceneError> {
        self.take(key).map(read).transpose()
    }

    /// Reads a number and checks that it lies in `range`; returns `default` if the key is absent.
    pub(super) fn number_or(&mut self, key: Key, range: Legal, default: f64) -> Result<f64, SceneError> {
        Ok(self.number(key, range)?.unwrap_or(default))
    }

    /// Reads a number and checks that it lies in `range`; `None` if the key is absent.
    pub(super) fn number(&mut self, key: Key, range: Legal) -> Result<Option<f64>, SceneError> {
        Ok(self.number_and_place(key, range)?.map(|(number, _)| number))
    }

    /// Reads a number as [`Self::number`] does, with its location for errors that depend on other keys.
    pub(super) fn number_and_place(
        &mut self,
        key: Key,
        range: Legal,
    ) -> Result<Option<(f64, Location)>, SceneError> {
        let Some(value) = self.take_as(key, Takes::Number(range.clone())) else { return Ok(None) };
        let place = value.location.clone();
        Ok(Some((value.number(range)?, place)))
    }

    /// Reads three numbers (or one for all three) and checks that they lie in `range`; `None` if the key is absent.
    pub(super) fn three(&mut self, key: Key, range: Legal) -> Result<Option<[f64; 3]>, SceneError> {
        self.take_as(key, Takes::Three(range.clone())).map(|value| value.three(range)).transpose()
    }

    /// Reads the bound of a vector, a norm, a number for each axis, or a table with both, and checks that its numbers lie in `range`;
    /// returns `default` if the key is absent.
    pub(super) fn bound_or(&mut self, key: Key, range: Legal, default: Bound) -> Result<Bound, SceneError> {
        if matches!(self.table.get(key).map(Spanned::get_ref), Some(DeValue::Table(_)))
            && let Some(mut both) = self.section(key)?
        {
            let norm = both.require("norm")?.number(range.clone())?;
            let axes = both.require("axes")?;
            let axes = axes.each_in_range(axes.numbers()?, &range)?;
            both.finish()?;
            return Ok(Bound::ball(norm).and(Bound::box_of(axes)));
        }
        let Some(value) = self.take_as(key, Takes::Bound(range.clone())) else { return Ok(default) };
        match (parse_number(&value.value), &value.value) {
            (Some(norm), _) => value.in_range(norm, &range).map(Bound::ball),
            (None, DeValue::Array(_)) => value.axes(range).map(Bound::box_of),
            (None, _) => Err(value.no_bound()),
        }
    }

    /// Removes a sub-table and returns it; `None` if absent.
    pub(super) fn section(&mut self, key: Key) -> Result<Option<Section<'t>>, SceneError> {
        let source = self.source;
        self.known.push(Known { key, takes: Takes::Table });
        let Some((_, value)) = self.table.remove_entry(key) else { return Ok(None) };
        Section::from_value(source, self.path(key), value).map(Some)
    }

    /// Removes a list of tables (`[[key]]`), or a single table, and returns it; empty if absent.
    pub(super) fn sections(&mut self, key: Key) -> Result<Vec<Section<'t>>, SceneError> {
        let source = self.source;
        self.known.push(Known { key, takes: Takes::Tables });
        let Some((_, value)) = self.table.remove_entry(key) else { return Ok(Vec::new()) };
        let (name, span) = (self.path(key), value.span());
        match value.into_inner() {
            DeValue::Array(list) => {
                list.into_iter().map(|value| Section::from_value(source, name.clone(), value)).collect()
            }
            table @ DeValue::Table(_) => {
                Ok(vec![Section::from_value(source, name, Spanned::new(span, table))?])
            }
            other => {
                let table = match (key, other.as_str()) {
                    ("device", Some(id)) => format!("[device] and below it plugin = \"{id}\""),
                    ("model", Some(id)) => format!("[[model]] and below it plugin = \"{id}\""),
                    _ => format!("[[{name}]] and below it its keys"),
                };
                let problem = format!("`{name}` is a table: write {table}");
                Err(source.location(&span).problem(problem))
            }
        }
    }

    /// Returns all keys with their values as text, in the order of the file: for parameters, whose keys only the plugin defines.
    pub(super) fn into_texts(self) -> Result<Vec<ParameterText>, SceneError> {
        let source = self.source;
        let mut entries: Vec<_> = self.table.into_iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start); // as written: the order for plugins
        let text = |(key, value): (Spanned<Cow<'t, str>>, Spanned<DeValue<'t>>)| {
            let location = source.location(&value.span());
            let text = match value.into_inner() {
                DeValue::String(text) => text.into_owned(),
                DeValue::Integer(number) => number.as_str().replace('_', ""),
                DeValue::Float(number) => number.as_str().replace('_', ""),
                DeValue::Boolean(flag) => flag.to_string(),
                other => {
                    let (key, found) = (key.get_ref(), other.type_str());
                    let problem =
                        format!("`{key}` must be a number, text in quotes, or true or false; found: {found}");
                    return Err(location.problem(problem));
                }
            };
            Ok(ParameterText { key: key.into_inner().into_owned(), value: text, location })
        };
        entries.into_iter().map(text).collect()
    }

    /// Returns an error for the first key that was not read.
    pub(super) fn finish(self) -> Result<(), SceneError> {
        let Some(key) = self.table.keys().min_by_key(|key| key.span().start) else {
            self.source.seen.borrow_mut().push((self.name, self.known));
            return Ok(());
        };
        // In TOML no key after the first table header belongs to the top level.
        if let Some(above) = self.source.above.borrow().iter().find(|above| **above == &**key.get_ref()) {
            return Err(self.unknown(key, &format!("; `{above}` belongs above all tables")));
        }
        Err(self.unknown(key, &did_you_mean(key.get_ref(), self.known.iter().map(|known| known.key))))
    }

    /// Returns the error about an unknown key, with a hint.
    fn unknown(&self, key: &Spanned<Cow<'t, str>>, hint: &str) -> SceneError {
        let location = self.source.location(&key.span());
        location.problem(format!("unknown key `{}`{hint}", self.path(key.get_ref())))
    }

    fn from_value(
        source: &'t Source<'t>,
        name: String,
        value: Spanned<DeValue<'t>>,
    ) -> Result<Self, SceneError> {
        let span = value.span();
        match value.into_inner() {
            DeValue::Table(table) => Ok(Section { source, name, span, table, known: Vec::new() }),
            _ => {
                let problem = format!("`{name}` is a table: write [{name}] and below it its keys");
                Err(source.location(&span).problem(problem))
            }
        }
    }

    fn path(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }
}

impl Value<'_> {
    pub(super) fn problem(&self, problem: impl Into<String>) -> SceneError {
        self.location.problem(problem)
    }

    /// Returns the error about an illegal value; `legal` describes the legal values.
    fn must_be(&self, legal: impl Display) -> SceneError {
        self.problem(format!("`{}` must be {legal}", self.key))
    }

    /// Returns the error about a value of the wrong type; `legal` describes the right one.
    fn wrong_type(&self, legal: &str) -> SceneError {
        self.must_be(format_args!("{legal}; found: {}", self.value.type_str()))
    }

    pub(super) fn text(self) -> Result<String, SceneError> {
        match &self.value {
            DeValue::String(text) => self.for_people(text),
            _ => Err(self.wrong_type("text in quotes")),
        }
    }

    /// Returns the text if a terminal can show it.
    fn for_people(&self, text: &str) -> Result<String, SceneError> {
        let Some(control) = control_character(text) else { return Ok(text.to_owned()) };
        Err(self.problem(format!(
            "`{}` contains the control character {}; remove the character, or, if a backslash was meant, put the text in \
             single quotes",
            self.key,
            control.escape_default()
        )))
    }

    /// Returns a Boolean value.
    pub(super) fn truth(self) -> Result<bool, SceneError> {
        self.value.as_bool().ok_or_else(|| self.wrong_type("true or false"))
    }

    /// Returns the value that `words` assigns to the text.
    pub(super) fn one_of<T: Copy>(self, words: &[(&str, T)]) -> Result<T, SceneError> {
        let legal: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        let wrong = self.must_be(format_args!("one of: {}", legal.join(", ")));
        let text = self.text()?;
        words.iter().find(|(word, _)| *word == text).map(|(_, meaning)| *meaning).ok_or(wrong)
    }

    pub(super) fn texts(self) -> Result<Vec<String>, SceneError> {
        let wrong = || self.must_be("a list of texts in quotes");
        let DeValue::Array(list) = &self.value else { return Err(wrong()) };
        let texts = list.iter().map(|value| match value.get_ref() {
            DeValue::String(text) => self.for_people(text),
            _ => Err(wrong()),
        });
        texts.collect()
    }

    /// Returns the texts of a list, or a single text as a list.
    pub(super) fn one_or_more_texts(self) -> Result<Vec<String>, SceneError> {
        match self.value {
            DeValue::Array(_) => self.texts(),
            _ => self.text().map(|text| vec![text]),
        }
    }

    pub(super) fn number(self, range: Legal) -> Result<f64, SceneError> {
        let number = parse_number(&self.value).ok_or_else(|| self.wrong_type("a number"))?;
        self.in_range(number, &range)
    }

    pub(super) fn three(self, range: Legal) -> Result<[f64; 3], SceneError> {
        if let Some(number) = parse_number(&self.value) {
            return self.in_range(number, &range).map(|number| [number; 3]);
        }
        if !matches!(self.value, DeValue::Array(_)) {
            return Err(self.wrong_type("a number or a list of three"));
        }
        self.each_in_range(self.numbers()?, &range)
    }

    /// Returns three numbers in `range`, one for each axis.
    fn axes(self, range: Legal) -> Result<[f64; 3], SceneError> {
        self.each_in_range(self.numbers().map_err(|_| self.no_bound())?, &range)
    }

    fn no_bound(&self) -> SceneError {
        self.must_be("one number (the largest norm), three numbers (the largest along each axis), or { norm, axes } for both")
    }

    /// Returns a whole number in `range`.
    pub(super) fn whole(self, range: RangeInclusive<u32>) -> Result<u32, SceneError> {
        let wrong = self.must_be(format_args!("a whole number from {} to {}", range.start(), range.end()));
        let number =
            self.number(f64::from(*range.start())..=f64::from(*range.end())).map_err(|_| wrong.clone())?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole, and in the range of a u32
        if number.fract() == 0.0 { Ok(number as u32) } else { Err(wrong) }
    }

    /// Returns a list of points, each three numbers in `range`; `counts` is the legal number of points.
    pub(super) fn points(
        self,
        range: Legal,
        counts: RangeInclusive<usize>,
    ) -> Result<Vec<[f64; 3]>, SceneError> {
        let ([least, most], [from, to]) = ([counts.start(), counts.end()], [range.start(), range.end()]);
        let wrong = self.must_be(format_args!(
            "a list of {least} to {most} points, each three numbers from {from} to {to}"
        ));
        let DeValue::Array(list) = &self.value else { return Err(wrong) };
        let is_in_range = |point: &[f64; 3]| point.iter().all(|number| range.contains(number));
        let point = |value: &Spanned<DeValue<'_>>| parse_numbers(value.get_ref()).filter(is_in_range);
        let points: Option<Vec<[f64; 3]>> = list.iter().map(point).collect();
        points.filter(|points| counts.contains(&points.len())).ok_or(wrong)
    }

    pub(super) fn numbers<const N: usize>(&self) -> Result<[f64; N], SceneError> {
        parse_numbers(&self.value).ok_or_else(|| self.must_be(format_args!("a list of {N} numbers")))
    }

    fn each_in_range(&self, numbers: [f64; 3], range: &Legal) -> Result<[f64; 3], SceneError> {
        numbers.iter().try_for_each(|number| self.in_range(*number, range).map(drop))?;
        Ok(numbers)
    }

    fn in_range(&self, number: f64, range: &Legal) -> Result<f64, SceneError> {
        if range.contains(&number) {
            return Ok(number);
        }
        Err(self.problem(format!("`{}` = {number}: must be {}", self.key, legal(range))))
    }
}

/// Formats a range of legal values for an error or the reference.
pub(super) fn legal(range: &Legal) -> String {
    let (least, most) = (range.start(), range.end());
    if most.is_finite() { format!("{least} to {most}") } else { format!("{least} or more") }
}

fn parse_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(number) if number.radix() == 10 => number.as_str().replace('_', "").parse().ok(),
        DeValue::Float(number) => number.as_str().replace('_', "").parse().ok(),
        _ => None,
    }
}

/// Parses a list of `N` numbers.
fn parse_numbers<const N: usize>(value: &DeValue<'_>) -> Option<[f64; N]> {
    let DeValue::Array(list) = value else { return None };
    let numbers: Option<Vec<f64>> = list.iter().map(|value| parse_number(value.get_ref())).collect();
    numbers?.try_into().ok()
}

/// Returns a hint at the closest known word, to append to an error; empty without a similar word. Not real-time.
pub fn did_you_mean<'k>(word: &str, known: impl Iterator<Item = &'k str>) -> String {
    nearest(word, known).map_or_else(String::new, |near| format!("; did you mean `{near}`?"))
}
