//! Test file `NAME.test.toml`: scene, settings and expectations.

use crate::bound::{Bound, number};
use crate::curve::Points;
use crate::numbers::{did_you_mean, outputs_for};
use flotor_command::CommandError;
use flotor_command::options::{PluginPathOption, duration_s};
use flotor_core::LARGEST_SEED;
use flotor_hal::read_text;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use toml::{Spanned, Value};

/// Suffix of the names of test files.
pub(crate) const SUFFIX: &str = ".test.toml";

/// Test file with expectations, checked as far as possible without running a plugin.
#[derive(Debug)]
pub(crate) struct TestFile {
    pub(crate) path: PathBuf,
    /// Path without the suffix, for the names of the cases.
    pub(crate) name: String,
    pub(crate) text: String,
    pub(crate) scene: PathBuf,
    /// Folders to search for plugins before all others.
    pub(crate) plugin_path: PluginPathOption,
    pub(crate) seeds: Vec<u64>,
    pub(crate) duration: Option<String>,
    /// Values by `PLUGIN.PARAMETER`: the cases are their product.
    pub(crate) set: Vec<(String, Vec<String>)>,
    pub(crate) expect: Vec<Expectation>,
    pub(crate) reference: Option<Reference>,
    pub(crate) curve: Option<Curve>,
    pub(crate) golden: Option<Golden>,
    pub(crate) validate: Option<Validate>,
    pub(crate) stress: Option<Stress>,
    /// Digests by the name of a case; empty if the file has none.
    pub(crate) digests: BTreeMap<String, String>,
}

/// Expectation of one value of a run.
#[derive(Debug)]
pub(crate) struct Expectation {
    pub(crate) path: String,
    /// Position of the key in the text, bytes.
    pub(crate) at: usize,
    pub(crate) bound: Bound,
}

/// Other settings, and the numbers that must agree between both runs.
#[derive(Debug)]
pub(crate) struct Reference {
    pub(crate) set: Vec<(String, String)>,
    /// Largest difference by the path of a number.
    pub(crate) within: Vec<(String, f64)>,
}

/// Expected force-position curve.
#[derive(Debug)]
pub(crate) struct Curve {
    pub(crate) points: Points,
    pub(crate) within_n: f64,
    pub(crate) within_nm: f64,
    pub(crate) model: Option<String>,
    pub(crate) set: Vec<(String, String)>,
}

/// Recording that the models must reproduce.
#[derive(Debug)]
pub(crate) struct Golden {
    pub(crate) recording: PathBuf,
    pub(crate) within_n: f64,
    pub(crate) within_nm: f64,
}

/// Plugins for `flotor validate`.
#[derive(Debug)]
pub(crate) enum Validate {
    /// All models of the scene.
    Models,
    File(PathBuf),
}

/// Stress test of the models of the scene.
#[derive(Debug)]
pub(crate) struct Stress {
    pub(crate) size: String,
    /// Identifiers of the measures that count.
    pub(crate) measures: Vec<String>,
    pub(crate) demand: MeasureDemand,
    pub(crate) set: Vec<(String, String)>,
}

/// Required verdict of a measure of a stress test.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MeasureDemand {
    /// Any verdict but a failure: for a file without named measures, because not every measure applies to every model.
    NotFailed,
    /// Pass or note: for a measure named in the file.
    Judged,
}

/// Unchecked contents of the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Written {
    scene: Spanned<PathBuf>,
    #[serde(default)]
    seeds: Option<Spanned<Vec<u64>>>,
    duration: Option<Spanned<Value>>,
    #[serde(default)]
    set: BTreeMap<Spanned<String>, Value>,
    #[serde(default)]
    expect: BTreeMap<Spanned<String>, Value>,
    reference: Option<Spanned<WrittenReference>>,
    curve: Option<Spanned<WrittenCurve>>,
    golden: Option<Spanned<WrittenGolden>>,
    validate: Option<Spanned<Value>>,
    stress: Option<Spanned<WrittenStress>>,
    #[serde(default)]
    digests: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenReference {
    set: BTreeMap<String, Value>,
    within: BTreeMap<String, Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenCurve {
    file: Spanned<PathBuf>,
    within_n: f64,
    #[serde(default)]
    within_nm: f64,
    model: Option<String>,
    #[serde(default)]
    set: BTreeMap<String, Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WrittenGolden {
    recording: Spanned<PathBuf>,
    within_n: f64,
    #[serde(default)]
    within_nm: f64,
}

#[derive(Deserialize)]
#[serde(untagged, expecting = "write short, full, or a table with `size`, and optionally `pass` and `set`")]
enum WrittenStress {
    Size(String),
    Table(StressTable),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StressTable {
    size: String,
    pass: Option<Vec<String>>,
    #[serde(default)]
    set: BTreeMap<String, Value>,
}

/// Measures of a stress test. By default all count except [`COST`], which depends on the load of the machine.
const MEASURES: [&str; 10] = ["M0", "M1", "M2", "M3", "M4", "M5", "M6", "M7", "M8", "M9"];
const COST: &str = "M7";

impl TestFile {
    /// Reads and checks a file.
    ///
    /// # Errors
    /// An error `FILE:LINE: PROBLEM`.
    pub(crate) fn read(path: &Path, plugin_path: &PluginPathOption) -> Result<Self, CommandError> {
        let text = read_text(path, "the test")
            .map_err(|wrong| CommandError::Usage(wrong.in_file(path.display())))?;
        let file = Self::parse(path, &text)
            .map_err(|(at, wrong)| CommandError::Usage(format!("{}: {wrong}", place(path, &text, at))))?;
        Ok(Self { plugin_path: plugin_path.clone(), ..file })
    }

    /// Returns the model outputs that the numbers of the file need, each once.
    pub(crate) fn outputs(&self) -> BTreeSet<&'static str> {
        let compared = self.reference.iter().flat_map(|reference| &reference.within).map(|(path, _)| path);
        let paths = self.expect.iter().map(|expectation| &expectation.path).chain(compared);
        paths.flat_map(|path| outputs_for(path)).copied().collect()
    }

    fn parse(path: &Path, text: &str) -> Result<Self, Wrong> {
        let written: Written = toml::from_str(text).map_err(|error| {
            (error.span().map_or(0, |span| span.start), with_nearest(error.message()).replace('\n', " "))
        })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let existing = |file: &Spanned<PathBuf>| {
            let found = folder.join(file.get_ref());
            let what = if found.exists() {
                "is not a regular file; name a file"
            } else {
                "does not exist; correct the path"
            };
            let wrong = || (file.span().start, format!("the file {} {what}", found.display()));
            if found.is_file() { Ok(found.clone()) } else { Err(wrong()) }
        };
        let scene = existing(&written.scene)?;
        let seeds = match &written.seeds {
            None => vec![1],
            Some(none) if none.get_ref().is_empty() => {
                return Err((none.span().start, "`seeds` is empty; write at least one seed".to_owned()));
            }
            Some(seeds) => seeds.get_ref().clone(),
        };
        if let Some(large) = seeds.iter().find(|seed| **seed > LARGEST_SEED) {
            let start = written.seeds.as_ref().map_or(0, |seeds| seeds.span().start);
            return Err((
                start,
                format!("the seed {large} is larger than {LARGEST_SEED} (2^53); write a smaller seed"),
            ));
        }
        let duration = written.duration.as_ref().map(|duration| {
            let text = scalar(duration.get_ref()).map_err(|wrong| (duration.span().start, wrong))?;
            duration_s(&text).map_err(|wrong| (duration.span().start, wrong)).map(|_| text)
        });
        let set = settings_with_values(&written.set)?;
        let expect = expectations(&written.expect)?;
        let reference = written.reference.map(|reference| {
            let at = reference.span().start;
            let WrittenReference { set, within } = reference.into_inner();
            let set = settings(&set).map_err(|wrong| (at, wrong))?;
            let number = |(path, value): (String, &Value)| match number(value) {
                Ok(number) => Ok((path, number)),
                Err(wrong) => Err((at, format!("`within.{path}`: {wrong}"))),
            };
            let written = within.iter().flat_map(|(path, value)| leaves(path, value));
            let within = written.map(number).collect::<Result<Vec<_>, _>>()?;
            if within.is_empty() {
                return Err((
                    at,
                    "the reference has no number to compare; write, for example, within = \
                     { peak_force_n = 0.01 }"
                        .to_owned(),
                ));
            }
            Ok(Reference { set, within })
        });
        let curve = written.curve.map(|curve| -> Result<Curve, Wrong> {
            let at = curve.span().start;
            let WrittenCurve { file, within_n, within_nm, model, set } = curve.into_inner();
            let points = Points::read(&existing(&file)?).map_err(|wrong| (file.span().start, wrong))?;
            let set = settings(&set).map_err(|wrong| (at, wrong))?;
            Ok(Curve { points, within_n, within_nm, model, set })
        });
        let golden = written.golden.map(|golden| -> Result<Golden, Wrong> {
            let WrittenGolden { recording, within_n, within_nm } = golden.into_inner();
            Ok(Golden { recording: existing(&recording)?, within_n, within_nm })
        });
        let validate = match written.validate.as_ref().map(|value| (value.get_ref(), value.span().start)) {
            None | Some((Value::Boolean(false), _)) => None,
            Some((Value::Boolean(true), _)) => Some(Validate::Models),
            Some((Value::String(file), _)) => Some(Validate::File(folder.join(file))),
            Some((_, at)) => return Err((at, "write true, false or the path of a plugin file".into())),
        };
        let stress = written.stress.map(|stress| {
            let at = stress.span().start;
            stress_of(stress.into_inner()).map_err(|wrong| (at, wrong))
        });
        let file = Self {
            plugin_path: PluginPathOption::default(),
            path: path.to_owned(),
            name: path.display().to_string().trim_end_matches(SUFFIX).to_owned(),
            text: text.to_owned(),
            scene,
            seeds,
            duration: duration.transpose()?,
            set,
            expect,
            reference: reference.transpose()?,
            curve: curve.transpose()?,
            golden: golden.transpose()?,
            validate,
            stress: stress.transpose()?,
            digests: written.digests,
        };
        file.expects_something()
    }

    fn expects_something(self) -> Result<Self, Wrong> {
        let Self { expect, reference, curve, golden, validate, stress, digests, .. } = &self;
        let checks_a_plugin = curve.is_some() || golden.is_some() || validate.is_some() || stress.is_some();
        let nothing = expect.is_empty() && reference.is_none() && digests.is_empty() && !checks_a_plugin;
        if nothing {
            return Err((
                0,
                "the file has no expectation; write at least one, such as [expect] with late_ticks = 0"
                    .to_owned(),
            ));
        }
        Ok(self)
    }

    /// Formats a position in the text as `FILE:LINE`.
    pub(crate) fn place(&self, at: usize) -> String {
        place(&self.path, &self.text, at)
    }
}

/// Position of an error, bytes from the start, and its message.
type Wrong = (usize, String);

fn place(path: &Path, text: &str, at: usize) -> String {
    let before = text.get(..at).unwrap_or_default();
    format!("{}:{}", path.display(), before.matches('\n').count() + 1)
}

/// Replaces the list of known keys in the parser's message by the nearest one.
fn with_nearest(message: &str) -> String {
    let mut words = message.split('`').skip(1).step_by(2);
    match (message.starts_with("unknown field"), words.next()) {
        (true, Some(unknown)) => format!("unknown key `{unknown}`{}", did_you_mean(unknown, words)),
        _ => message.to_owned(),
    }
}

/// Returns the leaves of nested tables, with their dotted keys: `a.b = 1` and `"a.b" = 1` are equal.
fn leaves<'v>(key: &str, value: &'v Value) -> Vec<(String, &'v Value)> {
    match value {
        Value::Table(table) => {
            table.iter().flat_map(|(below, value)| leaves(&format!("{key}.{below}"), value)).collect()
        }
        value => vec![(key.to_owned(), value)],
    }
}

fn scalar(value: &Value) -> Result<String, String> {
    match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => Ok(value.to_string()),
        other => Err(format!("write a number or a text instead of this {}", other.type_str())),
    }
}

fn settings(written: &BTreeMap<String, Value>) -> Result<Vec<(String, String)>, String> {
    let setting = |(key, value): (String, &Value)| {
        let text = scalar(value).map_err(|wrong| format!("`{key}`: {wrong}"))?;
        Ok((key, text))
    };
    written.iter().flat_map(|(key, value)| leaves(key, value)).map(setting).collect()
}

fn settings_with_values(
    written: &BTreeMap<Spanned<String>, Value>,
) -> Result<Vec<(String, Vec<String>)>, Wrong> {
    let setting = |(at, (key, value)): (usize, (String, &Value))| {
        if !key.contains('.') {
            return Err((at, format!("`{key}` is not PLUGIN.PARAMETER, such as spring.preset")));
        }
        let text = |value: &Value| scalar(value).map_err(|wrong| (at, format!("`{key}`: {wrong}")));
        let values = match value {
            Value::Array(values) => values.iter().map(text).collect::<Result<Vec<_>, _>>()?,
            one => vec![text(one)?],
        };
        if values.is_empty() {
            return Err((at, format!("`{key}` has an empty list; write at least one value")));
        }
        Ok((key, values))
    };
    let written = written.iter().flat_map(|(key, value)| {
        leaves(key.get_ref(), value).into_iter().map(move |leaf| (key.span().start, leaf))
    });
    written.map(setting).collect()
}

fn expectations(written: &BTreeMap<Spanned<String>, Value>) -> Result<Vec<Expectation>, Wrong> {
    fn below(path: &str, at: usize, value: &Value, found: &mut Vec<Expectation>) -> Result<(), String> {
        match (Bound::read(value).map_err(|wrong| format!("`{path}`: {wrong}"))?, value) {
            (Some(bound), _) => found.push(Expectation { path: path.to_owned(), at, bound }),
            (None, Value::Table(table)) if !table.is_empty() => {
                for (key, value) in table {
                    below(&format!("{path}.{key}"), at, value, found)?;
                }
            }
            _ => return Err(format!("`{path}`: the bound is missing; write min, max, or value and within")),
        }
        Ok(())
    }
    let mut found = Vec::new();
    for (key, value) in written {
        let at = key.span().start;
        below(key.get_ref(), at, value, &mut found).map_err(|wrong| (at, wrong))?;
    }
    Ok(found)
}

fn stress_of(written: WrittenStress) -> Result<Stress, String> {
    let (size, pass, set) = match written {
        WrittenStress::Size(size) => (size, None, BTreeMap::new()),
        WrittenStress::Table(StressTable { size, pass, set }) => (size, pass, set),
    };
    if !["short", "full"].contains(&size.as_str()) {
        return Err(format!("unknown size `{size}`; write short or full"));
    }
    let all = || MEASURES.iter().filter(|measure| **measure != COST).map(ToString::to_string).collect();
    let (measures, demand) = match pass {
        Some(named) => (named, MeasureDemand::Judged),
        None => (all(), MeasureDemand::NotFailed),
    };
    if let Some(unknown) = measures.iter().find(|measure| !MEASURES.contains(&measure.as_str())) {
        return Err(format!("unknown measure `{unknown}`; the measures are {}", MEASURES.join(", ")));
    }
    Ok(Stress { size, measures, demand, set: settings(&set)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Line and message of what is wrong with a file that has this after the scene.
    fn wrong(rest: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("scene.toml"), "").unwrap();
        let path = folder.path().join("jelly.test.toml");
        std::fs::write(&path, format!("scene = \"scene.toml\"\n{rest}")).unwrap();
        let error = TestFile::read(&path, &PluginPathOption::default())
            .map(|_| "nothing".to_owned())
            .unwrap_or_else(|error| error.to_string());
        error.replace(&path.display().to_string(), "F")
    }

    #[test]
    fn each_mistake_is_told_with_its_line() {
        for (rest, says) in [
            ("seedz = [1]", "F:2: unknown key `seedz`; did you mean `seeds`?"),
            ("\n[curve]\nfle = \"a\"\nwithin_n = 1", "did you mean `file`?"),
            ("seeds = []", "F:2: `seeds` is empty"),
            ("seeds = [1, 9007199254740993]", "F:2: the seed 9007199254740993 is larger than"),
            ("duration = \"5 parsec\"", "F:2: unknown unit of time `parsec`"),
            ("[set]\nspring = 3", "F:3: `spring` is not PLUGIN.PARAMETER"),
            ("[expect]\nlate_ticks = 0\npeak_force_n = { min = 2, max = 1 }", "F:4: `peak_force_n`: min = 2"),
            ("stress = \"shrt\"\n", "F:2: unknown size `shrt`"),
            ("stress = 3", "write short, full, or a table"),
            ("[stress]\nsize = \"short\"\npass = [\"M11\"]", "unknown measure `M11`"),
            ("[golden]\nrecording = \"no.mcap\"\nwithin_n = 1", "F:3: the file"),
            (
                "[golden]\nrecording = \"/\"\nwithin_n = 1",
                "F:3: the file / is not a regular file; name a file",
            ),
            ("", "the file has no expectation"),
            ("validate = 3", "F:2: write true, false or the path"),
            ("[expect]\nend = \"finished\"", "nothing"),
        ] {
            let told = wrong(rest);
            assert!(told.contains(says), "{rest}: {told}");
        }
    }

    #[test]
    fn keys_with_dots_are_tables_and_tables_are_keys_with_dots() {
        let parse = |text: &str| {
            let table: BTreeMap<Spanned<String>, Value> = toml::from_str(text).unwrap();
            settings_with_values(&table).unwrap()
        };
        let expected = vec![("spring.preset".to_owned(), vec!["a".to_owned(), "b".to_owned()])];
        assert_eq!(parse("spring.preset = [\"a\", \"b\"]"), expected);
        assert_eq!(parse("\"spring.preset\" = [\"a\", \"b\"]"), expected);
    }
}
