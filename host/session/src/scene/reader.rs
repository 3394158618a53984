//! Reads TOML tables key by key, so that every complaint has a file, a line, a key and a way out.
//!
//! serde would know the line of an unknown key but not the closest valid one; here each key is taken by name
//! and what is left over at the end is unknown.

use super::ParameterText;
use std::borrow::Cow;
use std::cell::RefCell;
use std::ops::{Range, RangeInclusive};
use std::path::{Path, PathBuf};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Where in which file something was said.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The file, or what stands for it ("built-in demo", "--set").
    pub file: PathBuf,
    /// Line, from 1; 0 where lines mean nothing.
    pub line: usize,
}

impl Location {
    /// True if it was said in a line of a file, not on a command line. Not real-time.
    #[must_use]
    pub fn is_in_a_file(&self) -> bool {
        self.line > 0
    }

    /// That what was said here is wrong. Not real-time.
    pub(crate) fn problem(&self, problem: impl Into<String>) -> SceneError {
        SceneError { location: self.clone(), problem: problem.into() }
    }
}

impl std::fmt::Display for Location {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            0 => write!(f, "{}", self.file.display()),
            line => write!(f, "{}:{line}", self.file.display()),
        }
    }
}

/// What is wrong with a scene: where, which key, what, and what would be right. One line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{location}: {problem}")]
pub struct SceneError {
    /// Where.
    pub location: Location,
    /// Which key, what is wrong, and what would be right.
    pub problem: String,
}

/// The text of a scene, with what is needed to name a line in it.
pub(super) struct Source<'t> {
    file: &'t Path,
    text: &'t str,
    /// The keys that were looked for in each table that was read to its end.
    seen: RefCell<Vec<(String, Vec<Known>)>>,
    /// The values that were looked for above all tables.
    above: RefCell<Vec<&'static str>>,
}

/// A key that is looked for, and what it takes.
#[derive(Clone, Debug)]
pub(super) struct Known {
    pub(super) key: &'static str,
    pub(super) takes: Takes,
}

/// What a key takes, as far as looking for it says.
#[derive(Clone, Debug)]
pub(super) enum Takes {
    /// What its chapter says.
    Value,
    /// A number in a range.
    Number(RangeInclusive<f64>),
    /// Three of them, or one for all.
    Three(RangeInclusive<f64>),
    /// A table.
    Table,
    /// A list of tables.
    Tables,
}

impl<'t> Source<'t> {
    pub(super) fn new(file: &'t Path, text: &'t str) -> Self {
        Self { file, text, seen: RefCell::default(), above: RefCell::default() }
    }

    pub(super) fn text(&self) -> &'t str {
        self.text
    }

    /// The tables that were read to their end, by name, with the keys that were looked for in each.
    pub(super) fn into_seen(self) -> Vec<(String, Vec<Known>)> {
        self.seen.into_inner()
    }

    fn location(&self, span: &Range<usize>) -> Location {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        Location { file: self.file.into(), line: before.matches('\n').count() + 1 }
    }

    pub(super) fn parse(&'t self) -> Result<Section<'t>, SceneError> {
        let root = DeTable::parse(self.text).map_err(|error| {
            let problem = error.message().lines().next().unwrap_or_default();
            self.location(&error.span().unwrap_or(0..0)).problem(format!("not valid TOML: {problem}"))
        })?;
        Ok(Section {
            source: self,
            name: String::new(),
            span: root.span(),
            table: root.into_inner(),
            known: Vec::new(),
        })
    }
}

/// One table of a scene; keys are taken out of it until none is left.
pub(super) struct Section<'t> {
    source: &'t Source<'t>,
    name: String,
    span: Range<usize>,
    table: DeTable<'t>,
    known: Vec<Known>,
}

/// A value taken from a section, with the place it came from.
pub(super) struct Value<'t> {
    pub(super) location: Location,
    key: String,
    value: DeValue<'t>,
}

impl<'t> Section<'t> {
    /// Takes a key, if it is there.
    pub(super) fn take(&mut self, key: &'static str) -> Option<Value<'t>> {
        self.take_as(key, Takes::Value)
    }

    fn take_as(&mut self, key: &'static str, takes: Takes) -> Option<Value<'t>> {
        self.known.push(Known { key, takes });
        if self.name.is_empty() {
            self.source.above.borrow_mut().push(key);
        }
        let (_, value) = self.table.remove_entry(key)?;
        let location = self.source.location(&value.span());
        Some(Value { location, key: self.path(key), value: value.into_inner() })
    }

    /// Where the table begins.
    pub(super) fn location(&self) -> Location {
        self.source.location(&self.span)
    }

    /// Takes a key that must be there.
    pub(super) fn require(&mut self, key: &'static str) -> Result<Value<'t>, SceneError> {
        let missing = self.missing(key);
        self.take(key).ok_or(missing)
    }

    /// That a key is not there, or what was written in its place.
    pub(super) fn missing(&self, key: &str) -> SceneError {
        let alike = nearest(key, self.table.keys().map(|written| &**written.get_ref()));
        if let Some(written) = self.table.keys().find(|written| Some(&**written.get_ref()) == alike) {
            return self.unknown(written, &format!("; did you mean `{key}`?"));
        }
        self.location().problem(format!("`{}` is missing", self.path(key)))
    }

    /// Takes a number, if it is there, and checks that it lies in `range`.
    pub(super) fn number(
        &mut self,
        key: &'static str,
        range: RangeInclusive<f64>,
    ) -> Result<Option<f64>, SceneError> {
        Ok(self.number_and_place(key, range)?.map(|(number, _)| number))
    }

    /// The same, with the place to complain about if something else in the scene makes it wrong.
    pub(super) fn number_and_place(
        &mut self,
        key: &'static str,
        range: RangeInclusive<f64>,
    ) -> Result<Option<(f64, Location)>, SceneError> {
        let Some(value) = self.take_as(key, Takes::Number(range.clone())) else { return Ok(None) };
        let place = value.location.clone();
        Ok(Some((value.number(range)?, place)))
    }

    /// Takes three numbers (or one for all three), if there, and checks that they lie in `range`.
    pub(super) fn three(
        &mut self,
        key: &'static str,
        range: RangeInclusive<f64>,
    ) -> Result<Option<[f64; 3]>, SceneError> {
        self.take_as(key, Takes::Three(range.clone())).map(|value| value.three(range)).transpose()
    }

    /// Takes a sub-table, if it is there.
    pub(super) fn section(&mut self, key: &'static str) -> Result<Option<Section<'t>>, SceneError> {
        let source = self.source;
        self.known.push(Known { key, takes: Takes::Table });
        let Some((_, value)) = self.table.remove_entry(key) else { return Ok(None) };
        Section::from_value(source, self.path(key), value).map(Some)
    }

    /// Takes a list of tables (`[[key]]`); none is an empty list.
    pub(super) fn sections(&mut self, key: &'static str) -> Result<Vec<Section<'t>>, SceneError> {
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
                let problem = format!("`{name}` is a table like [[{name}]], not {}", other.type_str());
                Err(source.location(&span).problem(problem))
            }
        }
    }

    /// All keys with their values as text: for parameters, whose keys only the plugin knows.
    pub(super) fn into_texts(self) -> Result<Vec<ParameterText>, SceneError> {
        let source = self.source;
        let mut entries: Vec<_> = self.table.into_iter().collect();
        entries.sort_by_key(|(key, _)| key.span().start); // as written: the order plugins see
        let text = |(key, value): (Spanned<Cow<'t, str>>, Spanned<DeValue<'t>>)| {
            let location = source.location(&value.span());
            let text = match value.into_inner() {
                DeValue::String(text) => text.into_owned(),
                DeValue::Integer(number) => number.as_str().replace('_', ""),
                DeValue::Float(number) => number.as_str().replace('_', ""),
                DeValue::Boolean(flag) => if flag { "on" } else { "off" }.to_owned(),
                other => {
                    let (key, found) = (key.get_ref(), other.type_str());
                    let problem = format!("`{key}` is a number, a word or true/false, not {found}");
                    return Err(location.problem(problem));
                }
            };
            Ok(ParameterText { key: key.into_inner().into_owned(), value: text, location })
        };
        entries.into_iter().map(text).collect()
    }

    /// Reports an error for the first unknown key.
    pub(super) fn finish(self) -> Result<(), SceneError> {
        let Some(key) = self.table.keys().min_by_key(|key| key.span().start) else {
            self.source.seen.borrow_mut().push((self.name, self.known));
            return Ok(());
        };
        // TOML has no way back to the keys above the first table.
        if let Some(above) = self.source.above.borrow().iter().find(|above| **above == &**key.get_ref()) {
            return Err(self.unknown(key, &format!("; `{above}` belongs above all tables")));
        }
        Err(self.unknown(key, &did_you_mean(key.get_ref(), self.known.iter().map(|known| known.key))))
    }

    /// That nobody takes a key, and what may help.
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
            other => {
                let problem = format!("`{name}` is a table like [{name}], not {}", other.type_str());
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

    pub(super) fn text(self) -> Result<String, SceneError> {
        match self.value {
            DeValue::String(text) => Ok(text.into_owned()),
            ref other => {
                Err(self.problem(format!("`{}` is text in quotes, not {}", self.key, other.type_str())))
            }
        }
    }

    /// `true` or `false`.
    pub(super) fn truth(self) -> Result<bool, SceneError> {
        match self.value {
            DeValue::Boolean(truth) => Ok(truth),
            ref other => {
                Err(self.problem(format!("`{}` is true or false, not {}", self.key, other.type_str())))
            }
        }
    }

    /// One of a few words, each of which means something.
    pub(super) fn one_of<T: Copy>(self, words: &[(&str, T)]) -> Result<T, SceneError> {
        let legal: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
        let wrong = self.problem(format!("`{}` is one of: {}", self.key, legal.join(", ")));
        let text = self.text()?;
        words.iter().find(|(word, _)| *word == text).map(|(_, meaning)| *meaning).ok_or(wrong)
    }

    pub(super) fn texts(self) -> Result<Vec<String>, SceneError> {
        let wrong = self.problem(format!("`{}` is a list of texts in quotes", self.key));
        let DeValue::Array(list) = self.value else { return Err(wrong) };
        let texts = list.into_iter().map(|value| match value.into_inner() {
            DeValue::String(text) => Ok(text.into_owned()),
            _ => Err(wrong.clone()),
        });
        texts.collect()
    }

    /// One text, or a list of them.
    pub(super) fn one_or_more_texts(self) -> Result<Vec<String>, SceneError> {
        match self.value {
            DeValue::Array(_) => self.texts(),
            _ => self.text().map(|text| vec![text]),
        }
    }

    pub(super) fn number(self, range: RangeInclusive<f64>) -> Result<f64, SceneError> {
        let number = parse_number(&self.value);
        let number = number.ok_or_else(|| {
            self.problem(format!("`{}` is a number, not {}", self.key, self.value.type_str()))
        })?;
        self.in_range(number, &range)
    }

    pub(super) fn three(self, range: RangeInclusive<f64>) -> Result<[f64; 3], SceneError> {
        if let Some(number) = parse_number(&self.value) {
            return self.in_range(number, &range).map(|number| [number; 3]);
        }
        let numbers = self.numbers::<3>()?;
        for number in numbers {
            self.in_range(number, &range)?;
        }
        Ok(numbers)
    }

    /// A whole number in `range`.
    pub(super) fn whole(self, range: RangeInclusive<u32>) -> Result<u32, SceneError> {
        let wrong = self.problem(format!(
            "`{}` is a whole number from {} to {}",
            self.key,
            range.start(),
            range.end()
        ));
        let number =
            self.number(f64::from(*range.start())..=f64::from(*range.end())).map_err(|_| wrong.clone())?;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole, and in the range of a u32
        if number.fract() == 0.0 { Ok(number as u32) } else { Err(wrong) }
    }

    /// A list of lists of three numbers in `range`.
    pub(super) fn points(
        self,
        range: RangeInclusive<f64>,
        counts: RangeInclusive<usize>,
    ) -> Result<Vec<[f64; 3]>, SceneError> {
        let wrong = self.problem(format!(
            "`{}` is a list of {} to {} points, each three numbers from {} to {}",
            self.key,
            counts.start(),
            counts.end(),
            range.start(),
            range.end()
        ));
        let DeValue::Array(list) = &self.value else { return Err(wrong) };
        let point = |value: &Spanned<DeValue<'_>>| {
            let DeValue::Array(numbers) = value.get_ref() else { return None };
            let numbers: Option<Vec<f64>> =
                numbers.iter().map(|value| parse_number(value.get_ref())).collect();
            <[f64; 3]>::try_from(numbers?)
                .ok()
                .filter(|point| point.iter().all(|number| range.contains(number)))
        };
        let points: Option<Vec<[f64; 3]>> = list.iter().map(point).collect();
        points.filter(|points| counts.contains(&points.len())).ok_or(wrong)
    }

    pub(super) fn numbers<const N: usize>(&self) -> Result<[f64; N], SceneError> {
        let wrong = || self.problem(format!("`{}` is a list of {N} numbers", self.key));
        let DeValue::Array(list) = &self.value else { return Err(wrong()) };
        let numbers: Option<Vec<f64>> = list.iter().map(|value| parse_number(value.get_ref())).collect();
        numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(wrong)
    }

    fn in_range(&self, number: f64, range: &RangeInclusive<f64>) -> Result<f64, SceneError> {
        if range.contains(&number) {
            return Ok(number);
        }
        Err(self.problem(format!("`{}` = {number}: legal is {} to {}", self.key, range.start(), range.end())))
    }
}

fn parse_number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(number) if number.radix() == 10 => number.as_str().replace('_', "").parse().ok(),
        DeValue::Float(number) => number.as_str().replace('_', "").parse().ok(),
        _ => None,
    }
}

/// A hint at the known word most like `word`, to stand behind a complaint; empty if none is like it. Not real-time.
pub fn did_you_mean<'k>(word: &str, known: impl Iterator<Item = &'k str>) -> String {
    nearest(word, known).map_or_else(String::new, |near| format!("; did you mean `{near}`?"))
}

/// The known word most like `word`, if any is like it at all.
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
