//! `flotor test`: scenes with expectations. Command line of the program `flotor-test`, which `flotor` starts.

use crate::bless::{Blessed, bless};
use crate::case::{Case, Check, Shard, combinations};
use crate::check::{Model, check, models, picture};
use crate::file::{SUFFIX, TestFile};
use crate::numbers::misspelt;
use crate::process::{Flotor, ProcessResult};
use crate::report::{Report, deliver, is_output, remove};
use crate::run::run_arguments;
use clap::{Args, Subcommand};
use flotor_command::options::{JsonOption, PluginPathOption, count, duration_s, new_file};
use flotor_command::{CommandError, exit_code_of, options, print_error_line, report_line};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Test force models and devices; `flotor test` starts this program.
#[derive(Subcommand)]
enum Command {
    Test(TestArguments),
}

/// Run scenes with expectations: pass or fail, for CI.
#[derive(Args)]
#[command(after_help = "A file NAME.test.toml contains a scene and the expected results:\n\n  \
    scene = \"scene.toml\"\n  seeds = [1, 2]\n  validate = true\n  stress = \"short\"\n\n  \
    [set]                                   # every combination is a case\n  \
    jelly.stiffness_n_per_m = [400, 800]\n\n  \
    [expect]                                # numbers of the JSON of a run\n  \
    peak_force_n = { min = 1, max = 3.2 }\n  energy.port_lowest_j = { min = -1e-3 }\n  late_ticks = 0\n\n\
    The chapter \"Haptic tests in CI\" of the book has every key.\n\n\
    Examples:\n  flotor test\n  flotor test jelly.test.toml --junit results.xml --plots pictures\n  \
    flotor test models --shard 2/4 --json -\n  flotor test jelly.test.toml --bless\n\n\
    Exit codes: 0 all passed, 1 a case failed, 2 usage or configuration: nothing was judged.")]
struct TestArguments {
    /// Files NAME.test.toml, or folders with such files (default: this folder); subfolders named `target` or `.NAME`
    /// are skipped
    #[arg(value_name = "FOLDER|FILE")]
    paths: Vec<PathBuf>,
    /// Run only the case of this name, or the cases whose name contains this text
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
    /// List the cases, and run none
    #[arg(long)]
    list: bool,
    /// Cases that run at the same time (default: one per core)
    #[arg(long, value_parser = count(1..=1024_usize), value_name = "N")]
    jobs: Option<usize>,
    /// Run only part K of N disjoint parts of the cases
    #[arg(long, value_name = "K/N")]
    shard: Option<Shard>,
    /// Longest time of one run, evaluation, replay, validation or stress test
    #[arg(long, value_parser = duration_s, value_name = "TIME", default_value = "5min")]
    timeout: f64,
    #[command(flatten)]
    json: JsonOption,
    #[command(flatten)]
    plugin_path: PluginPathOption,
    /// Write the results as JUnit XML
    #[arg(long, value_parser = new_file, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Draw a picture of each failure into this folder
    #[arg(long, value_name = "FOLDER")]
    plots: Option<PathBuf>,
    /// In the files, replace the value of each missed { value, within } with the measured value
    #[arg(long, conflicts_with_all = ["filter", "shard", "list"])]
    bless: bool,
    /// With --bless: write the digest of every run too
    #[arg(long, requires = "bless")]
    digest: bool,
}

/// Function that returns the command-line parser of all commands. Not real-time.
pub const PARSER: fn() -> clap::Command = options::parser_of::<Command>;

/// Runs the command of this process.
#[must_use]
pub fn main() -> ExitCode {
    let Command::Test(arguments) = options::command_of::<Command>();
    exit_code_of(run(&arguments))
}

fn run(arguments: &TestArguments) -> Result<(), CommandError> {
    let results = [arguments.json.file(), arguments.junit.as_deref()].into_iter().flatten();
    results.filter(|path| !is_output(path)).try_for_each(remove)?;
    let files = all_or_errors(
        found(&arguments.paths)?.iter().map(|path| TestFile::read(path, &arguments.plugin_path)),
    )?;
    let all: Vec<Case<'_>> = files.iter().flat_map(Case::of).collect();
    if let Some(folder) = &arguments.plots {
        all.iter().try_for_each(|case| remove(&picture(folder, case)))?;
    }
    let text = arguments.filter.as_deref().unwrap_or_default();
    let is_whole_name = all.iter().any(|case| case.name() == text);
    let is_chosen = |case: &Case<'_>| {
        let name = case.name();
        let is_named = if is_whole_name { name == text } else { name.contains(text) };
        is_named && arguments.shard.is_none_or(|shard| shard.has(&name))
    };
    let cases: Vec<Case<'_>> = all.into_iter().filter(is_chosen).collect();
    if cases.is_empty() && arguments.shard.is_none() {
        return Err(CommandError::Usage(format!(
            "--filter {text}: no case matches; `--list` instead of `--filter` lists all cases"
        )));
    }
    if arguments.list {
        return cases.iter().try_for_each(|case| report_line(format_args!("{}", case.name())));
    }
    if let Some(folder) = &arguments.plots {
        std::fs::create_dir_all(folder)
            .map_err(|cause| CommandError::file(folder, "cannot make the folder", cause))?;
    }
    let flotor = Flotor::with_limit(Duration::from_secs_f64(arguments.timeout))?;
    let jobs =
        arguments.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, NonZeroUsize::get));
    let known = probe(&flotor, jobs, &cases)?;
    let plots = arguments.plots.as_deref();
    let mut outcomes = in_parallel(jobs, &cases, |case| {
        let models = known.iter().find(|(file, _)| std::ptr::eq(*file, case.file)).map(|(_, models)| models);
        check(&flotor, case, models.unwrap_or(&Err("the scene was not run".to_owned())), plots)
    });
    if arguments.bless {
        let blessed = if arguments.digest { Blessed::NumbersAndDigests } else { Blessed::Numbers };
        bless(&files, &cases, &mut outcomes, blessed)?;
    }
    let report = Report::new(outcomes);
    deliver(&report, arguments.json.file(), arguments.junit.as_deref())?;
    match report.failed {
        0 => Ok(()),
        failed => Err(CommandError::Failed(format!("{failed} of {} cases failed", report.cases.len()))),
    }
}

/// Returns all results, or the first error after printing the others.
fn all_or_errors<T>(results: impl Iterator<Item = Result<T, CommandError>>) -> Result<Vec<T>, CommandError> {
    let (mut good, mut wrong) = (Vec::new(), None);
    for result in results {
        match (result, &wrong) {
            (Ok(result), _) => good.push(result),
            (Err(error), None) => wrong = Some(error),
            (Err(error), Some(_)) => print_error_line(format_args!("error: {error}")),
        }
    }
    wrong.map_or(Ok(good), Err)
}

/// Finds the test files named by the paths or inside them.
fn found(paths: &[PathBuf]) -> Result<Vec<PathBuf>, CommandError> {
    let here = [PathBuf::from(".")];
    let mut found = Vec::new();
    for path in if paths.is_empty() { &here } else { paths } {
        let before = found.len();
        match path.is_dir() {
            true => search(path, &mut found)?,
            false if path.display().to_string().ends_with(SUFFIX) => found.push(path.clone()),
            false => {
                let wrong = format!(
                    "{} is neither a folder nor a file NAME{SUFFIX}; give one of these",
                    path.display()
                );
                return Err(CommandError::Usage(wrong));
            }
        }
        if found.len() == before {
            return Err(CommandError::Usage(format!(
                "{}: the folder contains no file NAME{SUFFIX}; give another folder, or a file",
                path.display()
            )));
        }
    }
    let plain = |path: PathBuf| path.strip_prefix(".").map_or_else(|_| path.clone(), Path::to_owned);
    let mut found: Vec<PathBuf> = found.into_iter().map(plain).collect();
    found.sort();
    found.dedup();
    Ok(found)
}

fn search(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), CommandError> {
    let unreadable = |cause| CommandError::file(folder, "cannot read the folder", cause);
    for entry in std::fs::read_dir(folder).map_err(unreadable)? {
        let entry = entry.map_err(unreadable)?;
        let (path, name) = (entry.path(), entry.file_name().to_string_lossy().into_owned());
        let kind = entry.file_type().map_err(unreadable)?;
        if kind.is_dir() && name != "target" && !name.starts_with('.') {
            search(&path, found)?;
        } else if !kind.is_dir() && name.ends_with(SUFFIX) {
            found.push(path);
        }
    }
    Ok(())
}

/// Models of a file's scene, or the reason why they are unknown.
type Known<'f> = (&'f TestFile, Result<Vec<Model>, String>);

/// Duration of a trial run of a scene.
const TRIAL: &str = "10ms";

/// Runs the scenes of these cases briefly with all their settings: errors in a file are reported before any case runs.
fn probe<'f>(flotor: &Flotor, jobs: usize, cases: &[Case<'f>]) -> Result<Vec<Known<'f>>, CommandError> {
    let mut trials: Vec<(&'f TestFile, Vec<(String, String)>)> = Vec::new();
    for case in cases {
        let set = match &case.check {
            Check::Run { set, .. } => set.clone(),
            _ => combinations(&case.file.set).swap_remove(0),
        };
        let reference = case.file.reference.as_ref().map(|reference| reference.set.clone());
        for set in [Some(set), reference].into_iter().flatten() {
            if !trials.iter().any(|(file, other)| std::ptr::eq(*file, case.file) && *other == set) {
                trials.push((case.file, set));
            }
        }
    }
    let answers = in_parallel(jobs, &trials, |(file, set)| {
        let mut arguments = run_arguments(file, 1, set, Some(TRIAL));
        arguments.extend(["--json".to_owned(), "-".to_owned()]);
        flotor.run(arguments, "")
    });
    let mut known: Vec<Known<'f>> = Vec::new();
    let judged = trials.iter().zip(answers).map(|((file, _), answer)| {
        let models = models_of(file, answer)?;
        if !known.iter().any(|(other, _)| std::ptr::eq(*other, *file)) {
            known.push((file, models));
        }
        Ok(())
    });
    all_or_errors(judged)?;
    Ok(known)
}

/// Evaluates a trial run. Returns an error if the file is wrong, and the reason why the models are unknown if a plugin
/// fails.
fn models_of(
    file: &TestFile,
    answer: Result<ProcessResult, String>,
) -> Result<Result<Vec<Model>, String>, CommandError> {
    let ran = match answer {
        Ok(ran) => ran,
        Err(late) => return Ok(Err(late)),
    };
    let Some(json) = ran.json() else {
        return match ran.code {
            Some(2) => Err(CommandError::Usage(format!("{}: {}", file.path.display(), ran.error))),
            _ => Ok(Err(ran.error)),
        };
    };
    let wrong = |place: String, wrong: String| Err(CommandError::Usage(format!("{place}: {wrong}")));
    for expected in &file.expect {
        if let Some(told) = misspelt(&json, &expected.path) {
            return wrong(file.place(expected.at), told);
        }
        if let Some(value) =
            crate::numbers::at(&json, &expected.path).filter(|value| !expected.bound.fits(value))
        {
            let told = format!(
                "`{}` is {value} in a run, which this bound cannot match; correct the bound",
                expected.path
            );
            return wrong(file.place(expected.at), told);
        }
    }
    let compared = file.reference.iter().flat_map(|reference| &reference.within);
    if let Some(told) = compared.filter_map(|(path, _)| misspelt(&json, path)).next() {
        return wrong(file.path.display().to_string(), format!("[reference] within: {told}"));
    }
    Ok(Ok(models(&json)))
}

/// Applies `work` to each item on `jobs` threads; returns the results in order. If threads cannot be started, the
/// calling thread processes the remaining items.
fn in_parallel<T: Sync, R: Send>(jobs: usize, items: &[T], work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    let work_on = || {
        while let Some((index, item)) =
            Some(next.fetch_add(1, Ordering::Relaxed)).and_then(|index| Some((index, items.get(index)?)))
        {
            let result = work(item);
            flotor_core::lock(&done).push((index, result));
        }
    };
    std::thread::scope(|scope| {
        for _ in 1..jobs.min(items.len()) {
            let _ = std::thread::Builder::new().spawn_scoped(scope, work_on);
        }
        work_on();
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(index, _)| *index);
    done.into_iter().map(|(_, result)| result).collect()
}
