//! Execution and judgement of a run.

use crate::bound::Bound;
use crate::case::Case;
use crate::file::TestFile;
use crate::numbers::at;
use crate::process::{Flotor, ProcessResult};
use serde::Serialize;
use serde_json::Value;

/// Expectation that was not met.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Failure {
    pub(crate) what: String,
    pub(crate) expected: String,
    pub(crate) got: String,
}

impl Failure {
    pub(crate) fn new(what: impl Into<String>, expected: impl Into<String>, got: impl Into<String>) -> Self {
        Self { what: what.into(), expected: expected.into(), got: got.into() }
    }

    /// Formats the failure in one line.
    pub(crate) fn line(&self) -> String {
        format!("{}: expected {}, got {}", self.what, self.expected, self.got)
    }
}

/// Returns the arguments of a run.
pub(crate) fn run_arguments(
    file: &TestFile,
    seed: u64,
    set: &[(String, String)],
    duration: Option<&str>,
) -> Vec<String> {
    let scene = file.scene.display().to_string();
    let mut arguments: Vec<String> =
        ["run", &scene, "--clock", "virtual", "--seed"].into_iter().map(str::to_owned).collect();
    arguments.push(seed.to_string());
    arguments.extend(file.plugin_path.arguments().map(|word| word.to_string_lossy().into_owned()));
    arguments.extend(set.iter().flat_map(|(key, value)| ["--set".to_owned(), format!("{key}={value}")]));
    arguments.extend(file.outputs().into_iter().flat_map(|output| ["--compute", output]).map(str::to_owned));
    arguments.extend(duration.into_iter().flat_map(|duration| ["--duration", duration]).map(str::to_owned));
    arguments
}

/// Failures of a run against the expectations of its case, with the summary of the run; `None` if the run gave no summary.
pub(crate) struct JudgedRun {
    pub(crate) failures: Vec<Failure>,
    pub(crate) json: Option<Value>,
}

/// Executes and judges a run of a case, with its settings or fewer.
pub(crate) fn run(
    flotor: &Flotor,
    case: &Case<'_>,
    seed: u64,
    set: &[(String, String)],
    duration: Option<&str>,
) -> JudgedRun {
    let summary = |set: &[(String, String)]| {
        let mut arguments = run_arguments(case.file, seed, set, duration);
        arguments.extend(["--json".to_owned(), "-".to_owned()]);
        let ran = flotor.run(arguments, "").map_err(|late| Failure::new("the run", "an end", late))?;
        match ran.json() {
            Some(json) => Ok((ran, json)),
            None => Err(Failure::new("the run", "a summary", ran.error)),
        }
    };
    let (ran, json) = match summary(set) {
        Ok(answered) => answered,
        Err(failure) => return JudgedRun { failures: vec![failure], json: None },
    };
    let mut failures = judge(case, &ran, &json);
    if let Some(reference) = &case.file.reference {
        let is_replaced = |key: &str| reference.set.iter().any(|(other, _)| other == key);
        let kept = set.iter().filter(|(key, _)| !is_replaced(key)).chain(&reference.set);
        match summary(&kept.cloned().collect::<Vec<_>>()) {
            Err(failure) => {
                failures.push(Failure { what: format!("reference: {}", failure.what), ..failure })
            }
            Ok((_, other)) => failures.extend(reference.within.iter().filter_map(|(path, within)| {
                let value = at(&other, path).and_then(Value::as_f64).unwrap_or(f64::NAN);
                let bound = Bound::Near { value, within: *within };
                missed(&format!("{path} against the reference"), &bound, at(&json, path))
            })),
        }
    }
    JudgedRun { failures, json: Some(json) }
}

fn judge(case: &Case<'_>, ran: &ProcessResult, json: &Value) -> Vec<Failure> {
    let Case { file, label, .. } = case;
    let mut failures = Vec::new();
    if !file.expect.iter().any(|expectation| expectation.path == "end") {
        let early = missed("end", &Bound::Word("finished".to_owned()), at(json, "end"));
        failures.extend(early.map(|early| Failure { got: format!("{}: {}", early.got, ran.error), ..early }));
        let ended = failures.is_empty() && ran.code != Some(0);
        failures.extend(ended.then(|| Failure::new("the run", "exit code 0", &ran.error)));
    }
    let expected = file.expect.iter();
    failures.extend(
        expected.filter_map(|expected| missed(&expected.path, &expected.bound, at(json, &expected.path))),
    );
    let digest = file.digests.get(label).map(|digest| Bound::Word(digest.clone()));
    failures.extend(digest.and_then(|digest| missed("trace_digest", &digest, at(json, "trace_digest"))));
    failures
}

pub(crate) fn missed(what: &str, bound: &Bound, value: Option<&Value>) -> Option<Failure> {
    if bound.is_met_by(value) {
        return None;
    }
    let got = match value {
        None => "no value".to_owned(),
        Some(Value::String(word)) => word.clone(),
        Some(value) => value.to_string(),
    };
    Some(Failure::new(what, bound.text(), got))
}
