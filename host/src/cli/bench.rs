//! `flotor bench`: work against precision of a force model's settings, and the cost of the loop around it.

use super::options::KeyValue;
use super::{CommandError, style, write_json};
use crate::lab::bench::{
    BenchDevice, Case, Effort, Hand, Plan, Progress, TellApart, TickCost, WholeTick, measure,
};
use crate::registry::Registry;
use clap::{Args, ValueEnum};
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{Plugin, Setting};
use indicatif::ProgressBar;
use serde::Serialize;
use std::path::PathBuf;

/// `--size`
#[derive(Clone, Copy, Debug, ValueEnum)]
enum SizeOption {
    /// Seconds
    Short,
    /// Minutes: p99.9 means something
    Full,
}

/// Measure what an evaluation costs and how wrong it is, for many settings of a force model.
#[derive(Args)]
#[command(
    after_help = "Without --case, the spring's variants and settings are compared with its exact rod; another model's\n\
    defaults alone. With --tick, the whole tick around the model is timed instead: device, mapping, envelope, trace.\n\
    Times are wall clock: compare within one run.\n\n\
    Examples:\n  \
    flotor bench --csv bench.csv --plot bench.svg\n  \
    flotor bench --case variant=energy --case variant=rod,accuracy=servo --size full\n  \
    flotor bench --model ./libmy_model.so --case steps=8 --case steps=64 --reference steps=1024\n  \
    flotor bench --set preset=slender --case variant=energy --depth-mm 20 --apart rod_share\n  \
    flotor bench --tick"
)]
pub(crate) struct BenchArguments {
    /// Id of the model, or path to its plugin file
    #[arg(long, value_name = "ID", default_value = "spring")]
    model: String,
    /// A case: its settings (repeatable)
    #[arg(long = "case", value_name = "KEY=VALUE,...")]
    cases: Vec<String>,
    /// Settings every case starts from (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// The case errors are measured against
    #[arg(long, value_name = "KEY=VALUE,...")]
    reference: Option<String>,
    /// The case whose times those of the others are compared with [default: the first]
    #[arg(long, value_name = "KEY=VALUE,...")]
    yardstick: Option<String>,
    /// How far below home the middle of the motion lies
    #[arg(long, value_name = "MM", default_value_t = 4.0, allow_negative_numbers = true)]
    depth_mm: f64,
    /// Time calls apart for which this detail of the answer is above zero
    #[arg(long, value_name = "DETAIL")]
    apart: Option<String>,
    /// Time the whole tick around the model, on a scripted device and on the simulated flotor
    #[arg(long, conflicts_with_all = ["cases", "sets", "reference", "yardstick", "apart", "csv", "plot"])]
    tick: bool,
    /// How much to time
    #[arg(long, value_enum, default_value = "short")]
    size: SizeOption,
    /// Write every measurement as CSV
    #[arg(long, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Draw error over time
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Write the measurements as JSON (- for standard output)
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Cases of the spring that ships with Flotor: every variant and setting of it.
const SPRING_CASES: [&str; 9] = [
    "variant=thesis",
    "variant=thesis,precision=f32",
    "variant=closed-form",
    "variant=closed-form,precision=f32",
    "variant=current-length",
    "variant=energy,hand_over=off",
    "variant=energy",
    "variant=rod,accuracy=servo",
    "variant=rod,accuracy=tight",
];
/// What they are measured against.
const SPRING_REFERENCE: &str = "variant=rod,accuracy=tight";
/// Which of its answers come from two laws, and where: about the depth of the cases, and about half the free length (mm),
/// where springs that can buckle have.
const SPRING_APART: &str = "rod_share";
const SPRING_WALKS: [(&str, f64); 8] = [
    ("preset=thesis-1", 4.0),
    ("preset=thesis-1", 12.5),
    ("preset=thesis-2", 4.0),
    ("preset=thesis-2", 18.7),
    ("preset=thesis-3", 4.0),
    ("preset=thesis-3", 13.5),
    ("preset=slender", 4.0),
    ("preset=slender", 30.0),
];

pub(crate) fn run(arguments: &BenchArguments) -> Result<(), CommandError> {
    if arguments.tick { time_ticks(arguments) } else { compare_cases(arguments) }
}

/// A whole tick of the loop on one device.
#[derive(Serialize)]
struct TickRow {
    device: BenchDevice,
    #[serde(flatten)]
    cost: TickCost,
}

/// `--tick`
fn time_ticks(arguments: &BenchArguments) -> Result<(), CommandError> {
    let batches = match arguments.size {
        SizeOption::Short => 2_000,
        SizeOption::Full => 50_000,
    };
    let row = |device: BenchDevice| {
        let cost = WholeTick::prepare(device, &arguments.model)?.time(batches);
        Ok(TickRow { device, cost })
    };
    let rows = BenchDevice::ALL.into_iter().map(row).collect::<Result<Vec<_>, CommandError>>()?;
    if arguments.json.as_ref().is_none_or(|path| path.as_os_str() != "-") {
        let title = format!("a tick with `{}`, trace on, virtual clock", arguments.model);
        say!("{}", style::title(&format!("{title:<46}   median     p99  fastest, ns")));
        for TickRow { device, cost: TickCost { median_ns, p99_ns, fastest_ns } } in &rows {
            say!("  {:<46}  {median_ns:>6.0}  {p99_ns:>6.0}   {fastest_ns:>6.0}", device.name());
        }
    }
    arguments.json.as_ref().map_or(Ok(()), |path| write_json(path, &rows))
}

fn compare_cases(arguments: &BenchArguments) -> Result<(), CommandError> {
    let plugin = Registry::search(&[]).load(&arguments.model, PluginKind::Model)?;
    let is_spring = plugin.metadata().id == "spring" && arguments.cases.is_empty();
    let cases: Vec<&str> = match (arguments.cases.is_empty(), is_spring) {
        (false, _) => arguments.cases.iter().map(String::as_str).collect(),
        (true, true) => SPRING_CASES.to_vec(),
        (true, false) => vec![""],
    };
    let reference = arguments.reference.as_deref().or(is_spring.then_some(SPRING_REFERENCE));
    let case = |text: &str| case(&plugin, &arguments.sets, text);
    let hand = Hand { depth_m: arguments.depth_mm / 1e3 };
    let cases = cases.into_iter().map(case).collect::<Result<Vec<_>, _>>()?;
    let yardstick = match &arguments.yardstick {
        Some(text) => {
            let name = case(text)?.name;
            cases.iter().position(|case| case.name == name).ok_or_else(|| {
                CommandError::Usage(format!("yardstick `{text}` is none of the cases; add --case {text}"))
            })?
        }
        None => 0,
    };
    let apart = match (&arguments.apart, is_spring) {
        (Some(detail), _) => {
            let walks = cases.iter().map(|case| (case.clone(), hand)).collect();
            Some(TellApart { detail: detail.clone(), walks })
        }
        (None, true) => {
            let walks = SPRING_WALKS
                .iter()
                .map(|(text, depth_mm)| Ok((case(text)?, Hand { depth_m: depth_mm / 1e3 })));
            Some(TellApart {
                detail: SPRING_APART.to_owned(),
                walks: walks.collect::<Result<_, CommandError>>()?,
            })
        }
        (None, false) => None,
    };
    let reference = reference.map(case).transpose()?;
    let effort = match arguments.size {
        SizeOption::Short => Effort::Short,
        SizeOption::Full => Effort::Full,
    };
    let line = ProgressLine(super::run::progress_bar(1, "{msg:<44} {wide_bar} {elapsed}"));
    let plan = Plan { cases, yardstick, reference, hand, apart, effort };
    let report = measure(&plugin, &plan, &line)?;
    line.0.finish_and_clear();

    let json_on_stdout = arguments.json.as_ref().is_some_and(|path| path.as_os_str() == "-");
    if !json_on_stdout {
        say!("{}\n{}", style::title(&format!("{} {}", report.model, report.version)), report.to_text());
    }
    for (path, text) in [(&arguments.csv, report.to_csv()), (&arguments.plot, report.to_svg())] {
        if let Some(path) = path {
            std::fs::write(path, text)
                .map_err(|cause| CommandError::file(path, "cannot write the measurements", cause))?;
        }
    }
    arguments.json.as_ref().map_or(Ok(()), |path| write_json(path, &report))
}

/// A case from `KEY=VALUE,KEY=VALUE` on top of what every case starts from.
fn case(plugin: &Plugin, sets: &[KeyValue], text: &str) -> Result<Case, CommandError> {
    let usage = |problem: String| CommandError::Usage(format!("case `{text}`: {problem}"));
    let own = text.split(',').filter(|part| !part.trim().is_empty()).map(str::parse::<KeyValue>);
    let own = own.collect::<Result<Vec<_>, _>>().map_err(usage)?;
    let settings = sets.iter().chain(&own).map(|set| {
        let parameter = set.parameter();
        Setting::parse(plugin.parameters(), &parameter.key, &parameter.value)
            .map_err(|error| usage(error.to_string()))
    });
    // A value says what it is of, but for a switch.
    let word = |set: &KeyValue| {
        let parameter = set.parameter();
        match parameter.value.as_str() {
            "on" | "off" => format!("{} {}", parameter.key, parameter.value),
            _ => parameter.value,
        }
    };
    let values: Vec<String> = own.iter().map(word).collect();
    let name = if values.is_empty() { "defaults".to_owned() } else { values.join(" ") };
    Ok(Case { name, settings: settings.collect::<Result<_, _>>()? })
}

/// A progress line on a terminal, nothing in a pipe.
struct ProgressLine(ProgressBar);

impl Progress for ProgressLine {
    fn begin(&self, name: &str, done: usize, all: usize) {
        self.0.set_length(all as u64);
        self.0.set_position(done as u64);
        self.0.set_message(name.to_owned());
    }
}
