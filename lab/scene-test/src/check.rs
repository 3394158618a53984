//! Execution and judgement of cases.

use crate::bound::Bound;
use crate::case::{Case, Check};
use crate::curve::POSE;
use crate::file::{Expectation, MeasureDemand, TestFile, Validate};
use crate::minimise::shortest;
use crate::near::near_failure;
use crate::numbers::at;
use crate::process::{Flotor, ProcessResult};
use crate::rule::RuleFinding;
use crate::run::{Failure, missed, run, run_arguments};
use flotor_command::{command_line, note};
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Result of a case.
#[derive(Debug, Serialize)]
pub(crate) struct Outcome {
    pub(crate) case: String,
    pub(crate) scene: PathBuf,
    pub(crate) passed: bool,
    pub(crate) failures: Vec<Failure>,
    /// Judged values by path.
    pub(crate) values: BTreeMap<String, Value>,
    /// Command that repeats the case.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) repeat: Option<String>,
    /// Command that reproduces the failure alone: a pose, a rule, a measure, or a run up to its fault.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) detail: Option<String>,
    /// Command of a replay that starts near the failure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) near: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) picture: Option<PathBuf>,
    #[serde(skip)]
    pub(crate) digest: Option<String>,
    /// Path of the test file.
    #[serde(skip)]
    pub(crate) file: PathBuf,
    /// Duration of the case.
    #[serde(skip)]
    pub(crate) took: Duration,
}

impl Outcome {
    /// Sets `passed`, and clears the commands of a failure if the case has passed.
    pub(crate) fn settle(&mut self) {
        self.passed = self.failures.is_empty();
        if self.passed {
            (self.repeat, self.detail, self.near) = (None, None, None);
        }
    }

    /// Returns the commands for a failure, first the command that repeats the case.
    pub(crate) fn commands(&self) -> impl Iterator<Item = &String> {
        self.repeat.iter().chain(&self.detail).chain(&self.near)
    }
}

/// Model of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub(crate) name: String,
    pub(crate) file: String,
}

/// Returns the models named in the JSON of a run.
pub(crate) fn models(json: &Value) -> Vec<Model> {
    let text = |plugin: &Value, key: &str| plugin.get(key).and_then(Value::as_str).map(str::to_owned);
    let plugins = json.get("plugins").and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    let models = plugins.iter().filter(|plugin| text(plugin, "kind").as_deref() == Some("model"));
    models
        .filter_map(|model| Some(Model { name: text(model, "name")?, file: text(model, "file")? }))
        .collect()
}

/// Returns the plot arguments for bounds of peak force and peak torque.
fn drawn_bounds(file: &TestFile) -> impl Iterator<Item = String> {
    let drawn = file
        .expect
        .iter()
        .filter(|expected| ["peak_force_n", "peak_torque_nm"].contains(&expected.path.as_str()));
    let of = |expected: &Expectation| {
        let path = expected.path.clone();
        expected.bound.ends().into_iter().map(move |end| ["--plot-bound".to_owned(), format!("{path}={end}")])
    };
    drawn.flat_map(of).flatten()
}

/// Executes and judges a case. `models`: models of the scene, or the reason why they are unknown.
pub(crate) fn check(
    flotor: &Flotor,
    case: &Case<'_>,
    models: &Result<Vec<Model>, String>,
    plots: Option<&Path>,
) -> Outcome {
    let mut outcome = Outcome {
        case: case.name(),
        scene: case.file.scene.clone(),
        passed: false,
        failures: Vec::new(),
        values: BTreeMap::new(),
        repeat: Some(judging_again(case)),
        detail: None,
        near: None,
        picture: None,
        digest: None,
        file: case.file.path.clone(),
        took: Duration::ZERO,
    };
    let begun = Instant::now();
    // None for a rule of `validate`, which no curve of a run shows.
    let mut plotted = None;
    match (&case.check, models) {
        (Check::Run { seed, set }, _) => {
            let judged = run(flotor, case, *seed, set, case.file.duration.as_deref());
            let mut arguments = run_arguments(case.file, *seed, set, case.file.duration.as_deref());
            arguments.extend(drawn_bounds(case.file));
            if let Some(first) = judged.failures.first() {
                let shortest = shortest(flotor, case, first, judged.json.as_ref());
                let near = shortest.as_ref().zip(plots).and_then(|(shortest, folder)| {
                    near_failure(flotor, case, shortest, &picture(folder, case))
                });
                outcome.detail = shortest.map(|run| command_line(&run.arguments));
                outcome.near = near.map(command_line);
            }
            if let Some(json) = &judged.json {
                let paths = case.file.expect.iter().map(|expectation| &expectation.path);
                outcome.values =
                    paths.filter_map(|path| Some((path.clone(), at(json, path)?.clone()))).collect();
                outcome.digest = at(json, "trace_digest").and_then(Value::as_str).map(str::to_owned);
            }
            (outcome.failures, plotted) = (judged.failures, Some(arguments));
        }
        (_, Err(why)) => outcome.failures.push(Failure::new("the scene", "a scene that runs", why)),
        (Check::Curve, Ok(models)) => {
            let picture = plots.map(|folder| picture(folder, case));
            curve(flotor, case.file, models, picture.as_deref(), &mut outcome);
        }
        (Check::Golden, Ok(models)) => plotted = golden(flotor, case.file, models, &mut outcome),
        (Check::Validate, Ok(models)) => validate(flotor, case.file, models, &mut outcome),
        (Check::Stress, Ok(models)) => plotted = stress(flotor, case.file, models, &mut outcome),
    }
    outcome.settle();
    outcome.took = begun.elapsed();
    if let (false, Some(folder), Some(mut arguments)) = (outcome.passed, plots, plotted) {
        let picture = picture(folder, case);
        arguments.extend(["--plot".to_owned(), picture.display().to_string()]);
        let _ = flotor.run(arguments, "");
        outcome.picture = picture.is_file().then_some(picture);
    }
    outcome
}

/// Returns the command that repeats a case.
fn judging_again(case: &Case<'_>) -> String {
    let file = case.file.path.display().to_string();
    let folders = case.file.plugin_path.arguments().map(|word| word.to_string_lossy().into_owned());
    let words = ["test".to_owned(), file, "--filter".to_owned(), case.name()];
    command_line(words.into_iter().chain(folders))
}

/// Returns the path of a case's picture.
pub(crate) fn picture(folder: &Path, case: &Case<'_>) -> PathBuf {
    let plain = |c: char| if c.is_alphanumeric() || "-_.=".contains(c) { c } else { '-' };
    folder.join(case.name().chars().map(plain).collect::<String>() + ".svg")
}

/// Compares a model with a curve; draws a picture of a failure to the file `picture`, if given.
fn curve(flotor: &Flotor, file: &TestFile, models: &[Model], picture: Option<&Path>, outcome: &mut Outcome) {
    let Some(curve) = &file.curve else { return };
    let named = |model: &&Model| curve.model.as_ref().is_none_or(|name| *name == model.name);
    let mut chosen = models.iter().filter(named);
    let (Some(model), None) = (chosen.next(), chosen.next()) else {
        let names: Vec<&str> = models.iter().map(|model| model.name.as_str()).collect();
        let has = format!("{} models ({})", names.len(), names.join(", "));
        outcome.failures.push(Failure::new("curve", "one model, or its name in `model`", has));
        return;
    };
    let mut arguments = with_settings(&["eval", "--model", &model.file], &curve.set);
    arguments.extend(["--poses".to_owned(), "-".to_owned()]);
    let tolerance = |index: usize| if index < 3 { curve.within_n } else { curve.within_nm };
    let answers = match flotor.run(&arguments, &curve.points.poses()) {
        Ok(ran) if ran.code == Some(0) => ran.stdout,
        Ok(ProcessResult { error, .. }) | Err(error) => {
            return outcome.failures.push(Failure::new("curve", "an evaluation", error));
        }
    };
    match curve.points.worst(&answers, tolerance) {
        Ok(None) => {}
        Err(error) => outcome.failures.push(Failure::new("curve", "a result for each pose", error)),
        Ok(Some(worst)) => {
            let pose: Vec<String> = worst.pose.iter().map(ToString::to_string).collect();
            let place = POSE.iter().zip(worst.pose).filter(|(_, number)| *number != 0.0);
            let place: Vec<String> = place.map(|(name, number)| format!("{name} = {number}")).collect();
            let place = if place.is_empty() { "home".to_owned() } else { place.join(", ") };
            let index = crate::curve::WRENCH.iter().position(|column| *column == worst.column).unwrap_or(0);
            let expected = format!("{} within {}", worst.expected, tolerance(index));
            let got = format!("{} ({})", worst.got, worst.status);
            outcome.failures.push(Failure::new(format!("{} at {place}", worst.column), expected, got));
            let header = POSE.join(",");
            let eval = command_line(&arguments);
            outcome.detail = Some(format!("printf '{header}\\n{}\\n' | {eval}", pose.join(",")));
            let drawn = picture.zip(curve.points.picture(&outcome.case, &answers, tolerance).ok());
            outcome.picture = drawn
                .filter(|(path, svg)| std::fs::write(path, svg).is_ok())
                .map(|(path, _)| path.to_path_buf());
        }
    }
}

fn golden(flotor: &Flotor, file: &TestFile, models: &[Model], outcome: &mut Outcome) -> Option<Vec<String>> {
    let golden = file.golden.as_ref()?;
    let mut arguments = vec!["replay".to_owned(), golden.recording.display().to_string()];
    for folder in models.iter().filter_map(|model| Path::new(&model.file).parent()) {
        arguments.extend(["--plugin-path".to_owned(), folder.display().to_string()]);
    }
    outcome.detail = Some(command_line(&arguments));
    let asked = arguments.iter().cloned().chain(["--json".to_owned(), "-".to_owned()]);
    match flotor.answer::<Value, _>(asked) {
        Err(error) => outcome.failures.push(Failure::new("golden", "a replay", error)),
        Ok(json) => {
            let first =
                at(&json, "first_tick").map_or(String::new(), |tick| format!(", first at tick {tick}"));
            for (what, path, within) in
                [("force", "max_force_n", golden.within_n), ("torque", "max_torque_nm", golden.within_nm)]
            {
                let bound = Bound::Range { min: None, max: Some(within) };
                let failure =
                    missed(&format!("difference of {what} from the recording"), &bound, at(&json, path));
                outcome.failures.extend(
                    failure.map(|failure| Failure { got: format!("{}{first}", failure.got), ..failure }),
                );
            }
            let complete = missed("complete", &Bound::Flag(true), at(&json, "complete"));
            outcome.failures.extend(complete);
        }
    }
    Some(arguments)
}

fn validate(flotor: &Flotor, file: &TestFile, models: &[Model], outcome: &mut Outcome) {
    let files: Vec<String> = match &file.validate {
        Some(Validate::File(file)) => vec![file.display().to_string()],
        _ => models.iter().map(|model| model.file.clone()).collect(),
    };
    for plugin in files {
        let findings: Vec<Value> = match flotor.answer(["validate", &plugin, "--json"]) {
            Ok(findings) => findings,
            Err(error) => {
                outcome.failures.push(Failure::new("validate", "an answer", error));
                continue;
            }
        };
        for finding in &findings {
            match RuleFinding::of(finding) {
                RuleFinding::Holds => {}
                RuleFinding::NotJudged { rule, why } => {
                    note(format!("{plugin}: the rule {rule} is not judged: {why}"));
                }
                RuleFinding::Fails { rule, text, seen } => {
                    outcome.failures.push(Failure::new(format!("rule {rule}"), text, seen));
                    let arguments = ["validate", &plugin, "--only", rule].map(str::to_owned);
                    outcome.detail.get_or_insert_with(|| command_line(&arguments));
                }
            }
        }
    }
}

fn stress(flotor: &Flotor, file: &TestFile, models: &[Model], outcome: &mut Outcome) -> Option<Vec<String>> {
    let stress = file.stress.as_ref()?;
    let only = |measures: &[&String]| -> Vec<String> {
        measures.iter().flat_map(|id| ["--only".to_owned(), (*id).clone()]).collect()
    };
    let mut failing = None;
    for model in models {
        let score = with_settings(&["stress", "--model", &model.file, "--size", &stress.size], &stress.set);
        let counted: Vec<&String> = stress.measures.iter().collect();
        // Compute only measures that count.
        let asked = [&score[..], &only(&counted), &["--json".to_owned(), "-".to_owned()]].concat();
        let failed = match flotor.answer::<Value, _>(asked) {
            Err(error) => {
                outcome.failures.push(Failure::new("stress", "an answer", error));
                counted
            }
            Ok(json) => {
                let failures =
                    counted.into_iter().filter_map(|id| Some((id, measure(&json, id, stress.demand)?)));
                let (failed, failures): (Vec<&String>, Vec<Failure>) = failures.unzip();
                outcome.failures.extend(failures);
                failed
            }
        };
        if !failed.is_empty() {
            failing.get_or_insert([score, only(&failed)].concat());
        }
    }
    outcome.detail = failing.as_deref().map(command_line);
    failing
}

/// Returns the failure of a stress test's measure whose verdict does not meet the demand or is missing; `None` if it
/// meets the demand.
fn measure(json: &Value, id: &str, demand: MeasureDemand) -> Option<Failure> {
    let measures = json.get("measures").and_then(Value::as_array);
    let has_id = |measure: &&Value| measure.get("id").and_then(Value::as_str) == Some(id);
    let Some(found) = measures.and_then(|measures| measures.iter().find(has_id)) else {
        return Some(Failure::new(id, "a measure", "none"));
    };
    let word = |key: &str| found.get(key).and_then(Value::as_str).unwrap_or_default();
    let number = |key: &str| found.get(key).and_then(Value::as_f64).map(|_| found[key].to_string());
    let failed = || {
        let name = format!("{id} {}", word("name"));
        let (Some(value), Some(bound)) = (number("value"), number("bound")) else {
            return Failure::new(name, "a value", word("remark"));
        };
        let unit = word("unit");
        let expected = format!("at most {bound} {unit}");
        Failure::new(name, expected.trim_end(), format!("{value} {unit} ({})", word("remark")))
    };
    match word("verdict") {
        "pass" | "note" => None,
        "fail" => Some(failed()),
        "nothing to judge" | "not resolved" if demand == MeasureDemand::NotFailed => None,
        unjudged => {
            let name = format!("{id} {}", word("name"));
            Some(Failure::new(name, "a verdict", format!("{unjudged} ({})", word("remark"))))
        }
    }
}

fn with_settings(command: &[&str], set: &[(String, String)]) -> Vec<String> {
    let set = set.iter().flat_map(|(key, value)| ["--set".to_owned(), format!("{key}={value}")]);
    command.iter().map(ToString::to_string).chain(set).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measure_that_was_not_judged_does_not_pass() {
        let json = |verdict: &str| {
            let measure =
                serde_json::json!({ "id": "M3", "name": "reciprocity", "verdict": verdict, "remark": "why" });
            serde_json::json!({ "measures": [measure] })
        };
        let is_missed = |verdict: &str, demand| measure(&json(verdict), "M3", demand).is_some();
        for (verdict, missed_where_named, missed) in [
            ("pass", false, false),
            ("note", false, false),
            ("nothing to judge", true, false),
            ("not resolved", true, false),
            ("fail", true, true),
            ("skipped", true, true),
            ("", true, true),
        ] {
            assert_eq!(is_missed(verdict, MeasureDemand::Judged), missed_where_named, "{verdict}");
            assert_eq!(is_missed(verdict, MeasureDemand::NotFailed), missed, "{verdict}");
        }
        assert!(measure(&json("pass"), "M4", MeasureDemand::NotFailed).is_some(), "it is not there");
    }
}
