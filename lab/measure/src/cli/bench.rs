//! `flotor bench`: work against precision of a force model's settings, and the cost of the loop around it.

use super::ProgressLine;
use crate::Size;
use crate::bench::{
    BenchDevice, Case, Hand, Plan, Split, TickCost, WholeTick, Workspace, measure, time_round_trips,
};
use clap::Args;
use flotor_command::options::{KeyValue, PluginResultOptions, new_file, number, svg_file};
use flotor_command::tables::table;
use flotor_command::{CommandError, print_result, style, write_text};
use flotor_hal::Detail;
use flotor_hal::abi::PluginKind;
use flotor_loader::{Plugin, Setting};
use flotor_servo::THREAD_ADVICE;
use flotor_session::registry::Registry;
use serde::Serialize;
use std::path::PathBuf;

/// Measure cost and error of an evaluation, for many settings of a force model.
#[derive(Args)]
#[command(
    after_help = "Without --case, the command compares the variants and settings of the spring with its exact \
    variant, `rod`, and the resolutions of the solid with the membrane, or under a plate with linear tetrahedra. It \
    measures any other model with default settings. With --tick, it measures the whole tick around the model \
    instead: device, mapping, envelope, trace. Times are wall-clock times: compare times of one run only.\n\n\
    Examples:\n  \
    flotor bench --csv bench.csv --plot bench.svg\n  \
    flotor bench --case variant=energy --case variant=rod,accuracy=servo --size full\n  \
    flotor bench solid --set body=beam --set tool=plate --plot beam.svg\n  \
    flotor bench --model ./libmy_model.so --case steps=8 --case steps=64 --reference steps=1024\n  \
    flotor bench --set preset=slender --case variant=energy --apart rod_share\n  \
    flotor bench --tick"
)]
pub(crate) struct BenchArguments {
    /// Id of the model, or path to its plugin file
    #[arg(value_name = "ID", default_value = "spring")]
    model: String,
    /// The model, in place of the first argument
    #[arg(long = "model", value_name = "ID", conflicts_with = "model")]
    named_model: Option<String>,
    /// Settings of a case; the setting `model=ID` selects another model (repeatable; default: the cases of `spring` or
    /// `solid`, else the defaults of the model)
    #[arg(long = "case", value_name = "KEY=VALUE,...")]
    cases: Vec<String>,
    /// Settings common to all cases but those with `model=ID` (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// Reference case for the errors, of high accuracy (default without --case: that of `spring` or `solid`, else none)
    #[arg(long, value_name = "KEY=VALUE,...")]
    reference: Option<String>,
    /// Baseline for the times, one of the cases (default: the first case)
    #[arg(long, value_name = "KEY=VALUE,...")]
    yardstick: Option<String>,
    /// Depth of the middle of the motion below home, in mm
    #[arg(long, value_name = "MM", default_value_t = 4.0, value_parser = number("mm", "depth", 0.0..=100.0))]
    depth_mm: f64,
    /// Radius of the workspace about home, in mm; no effect without a reference or --apart (default: 12, as the device; for a
    /// spring scaled by its free length over 15 mm)
    #[arg(long, value_name = "MM", value_parser = number("mm", "radius", 0.001..=1000.0))]
    workspace_mm: Option<f64>,
    /// Largest rotation in the workspace, in degrees; no effect without a reference or --apart
    #[arg(long, value_name = "DEGREES", default_value_t = 7.0, value_parser = number("degrees", "rotation", 0.0..=180.0))]
    workspace_deg: f64,
    /// Report separately the calls that return more than zero for this detail, a column of `eval --details` (default without
    /// --case: `rod_share` of `spring`, else none)
    #[arg(long, value_name = "DETAIL")]
    apart: Option<String>,
    /// Measure the whole tick with the model: on a scripted device, on the simulated flotor, and with the model in a process
    /// of its own
    #[arg(long, conflicts_with_all = ["cases", "sets", "reference", "yardstick", "depth_mm", "workspace_mm", "workspace_deg", "apart", "csv", "plot"])]
    tick: bool,
    /// Extent of the measurement
    #[arg(long, value_enum, default_value = "short")]
    size: Size,
    /// Write times and errors of each case as CSV, one line per demand
    #[arg(long, value_parser = new_file, value_name = "FILE.csv")]
    csv: Option<PathBuf>,
    /// Plot the error of each case against its computing time (work-precision diagram); without a reference, the times
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    options: PluginResultOptions,
}

impl BenchArguments {
    fn model(&self) -> &str {
        self.named_model.as_ref().unwrap_or(&self.model)
    }
}

/// Default cases of the spring that ships with Flotor: every variant and setting.
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
/// Reference case of the spring.
const SPRING_REFERENCE: &str = "variant=rod,accuracy=tight";
/// Default cases of the solid: its resolutions under a sphere, compared with the membrane; under a plate, with linear tetrahedra.
const SPHERE_CASES: [&str; 3] = [
    "resolution=standard",
    "resolution=quick",
    "model=membrane,ball_radius_mm=12.7,side_mm=80,nodes_per_side=17",
];
const PLATE_CASES: [&str; 3] = ["resolution=standard", "resolution=quick", "resolution=linear-tetrahedra"];
/// Reference case of the solid.
const SOLID_REFERENCE: &str = "resolution=fine";
/// Detail that splits the spring's calls, the springs, and the fractions of their workspaces.
const SPRING_SPLIT: &str = "rod_share";
const SPRINGS: [&str; 4] = ["preset=thesis-1", "preset=thesis-2", "preset=thesis-3", "preset=slender"];
const PARTS: [f64; 2] = [0.5, 1.0];

/// Radius of the device's range, mm: of the thesis's device and of the simulated flotor.
const DEVICE_RANGE_MM: f64 = 12.0;
/// Free length (mm) of a spring whose length unit is the device's: scenes scale a spring's motion by its free length over this.
const UNSCALED_LENGTH_MM: f64 = 15.0;
const FREE_LENGTH: &str = "free_length_mm";

pub(crate) fn run(arguments: &BenchArguments) -> Result<(), CommandError> {
    if arguments.tick { time_ticks(arguments) } else { compare_cases(arguments) }
}

/// Cost of a whole tick of the loop on one device.
#[derive(Serialize)]
struct TickRow {
    device: BenchDevice,
    #[serde(flatten)]
    cost: TickCost,
}

/// Cost of the whole tick, and the part of process isolation.
#[derive(Serialize)]
struct TickReport {
    ticks: Vec<TickRow>,
    /// Round trip to another thread and back, through the system's futexes.
    round_trip: TickCost,
    /// Additional cost of a tick with the model in its own process, in round trips.
    isolation_in_round_trips: f64,
}

impl TickReport {
    fn new(ticks: Vec<TickRow>, round_trip: TickCost) -> Self {
        let median = |device| ticks.iter().find(|row| row.device == device).map(|row| row.cost.median_ns);
        let added_ns = median(BenchDevice::Isolated).zip(median(BenchDevice::Scripted));
        let added_ns = added_ns.map_or(f64::NAN, |(isolated, here)| isolated - here);
        Self { ticks, round_trip, isolation_in_round_trips: added_ns / round_trip.median_ns }
    }
}

/// Approximate slowdown of a loop that waits for another thread: it gets fewer batches by this factor.
const SLOWER: usize = 20;

/// Runs `--tick`: times the whole tick.
fn time_ticks(arguments: &BenchArguments) -> Result<(), CommandError> {
    let batches = match arguments.size {
        Size::Short => 2_000,
        Size::Full => 50_000,
    };
    let row = |device: BenchDevice| {
        let batches = if device == BenchDevice::Isolated { batches / SLOWER } else { batches };
        let cost = WholeTick::prepare(device, arguments.options.plugin_path.registry(), arguments.model())?
            .time(batches);
        Ok(TickRow { device, cost })
    };
    let rows = BenchDevice::ALL.into_iter().map(row).collect::<Result<Vec<_>, CommandError>>()?;
    let round_trips = time_round_trips(batches / SLOWER).map_err(|cause| {
        CommandError::Failed(format!("cannot start a second thread: {cause}; {THREAD_ADVICE}"))
    })?;
    let report = TickReport::new(rows, round_trips);
    let text = || {
        let title = format!("a tick with `{}`, trace on, virtual clock: ns", arguments.model());
        let cells = |name: &str, cost: &TickCost| {
            let TickCost { median_ns, p99_ns, fastest_ns } = cost;
            let [median, p99, fastest] = [median_ns, p99_ns, fastest_ns].map(|ns| format!("{ns:.0}"));
            [name.to_owned(), median, p99, fastest]
        };
        let rows = report.ticks.iter().map(|TickRow { device, cost }| cells(device.name(), cost));
        let rows = rows.chain([cells("futex round trip", &report.round_trip)]);
        let ratio = format!(
            "process isolation adds {:.1} futex round trips to a tick",
            report.isolation_in_round_trips
        );
        [vec![style::title(&title)], table(["", "median", "p99", "fastest"], rows), vec![ratio]]
            .concat()
            .join("\n")
    };
    print_result(arguments.options.json.file(), &report, text)
}

fn compare_cases(arguments: &BenchArguments) -> Result<(), CommandError> {
    let registry = arguments.options.plugin_path.registry();
    let plugin = registry.load(arguments.model(), PluginKind::Model)?;
    let is_spring = plugin.metadata().id == "spring" && arguments.cases.is_empty();
    let is_under_plate = arguments.sets.iter().any(|set| set.parameter().value == "plate");
    let (own_cases, own_reference): (&[&str], _) = match &*plugin.metadata().id {
        "spring" => (&SPRING_CASES, Some(SPRING_REFERENCE)),
        "solid" if is_under_plate => (&PLATE_CASES, Some(SOLID_REFERENCE)),
        "solid" => (&SPHERE_CASES, Some(SOLID_REFERENCE)),
        _ => (&[""], None),
    };
    let cases: Vec<&str> = match arguments.cases.is_empty() {
        true => own_cases.to_vec(),
        false => arguments.cases.iter().map(String::as_str).collect(),
    };
    let own_reference = own_reference.filter(|_| arguments.cases.is_empty());
    let reference = arguments.reference.as_deref().or(own_reference);
    let case = |text: &str| case(&registry, &plugin, &arguments.sets, text);
    let hand = Hand { depth_m: arguments.depth_mm / 1e3 };
    let cases = cases.into_iter().map(case).collect::<Result<Vec<_>, _>>()?;
    if let (Some(detail), Some(case)) = (&arguments.apart, cases.first()) {
        let model = plugin.create_model(&case.settings)?;
        let known: Vec<&str> = model.details().iter().map(Detail::id).collect();
        if !known.contains(&detail.as_str()) {
            let known = known.join(", ");
            let why = format!("--apart {detail}: the model has no such detail; its details are [{known}]");
            return Err(CommandError::Usage(why));
        }
    }
    let baseline = match &arguments.yardstick {
        Some(text) => {
            let name = case(text)?.name;
            cases.iter().position(|case| case.name == name).ok_or_else(|| {
                CommandError::Usage(format!(
                    "--yardstick {text}: not one of the cases; choose one of them, or add --case {text}"
                ))
            })?
        }
        None => 0,
    };
    let workspace = |case: &Case| workspace(arguments, &plugin, case);
    let spring_walks = || {
        let walks = SPRINGS.into_iter().flat_map(|spring| PARTS.map(|part| (spring, part)));
        let walks = walks.map(|(spring, part)| {
            let case = case(spring)?;
            let workspace = workspace(&case)?.scaled(part);
            Ok((case, workspace))
        });
        walks.collect::<Result<_, CommandError>>()
    };
    let case_walks = || {
        let walks = cases.iter().map(|case| Ok((case.clone(), workspace(case)?)));
        walks.collect::<Result<_, CommandError>>()
    };
    let split = match (&arguments.apart, is_spring) {
        (Some(detail), _) => Some((detail.clone(), case_walks()?)),
        (None, true) => Some((SPRING_SPLIT.to_owned(), spring_walks()?)),
        (None, false) => None,
    };
    let split = split.map(|(detail, walks)| Split { detail, walks });
    let reference = reference.map(case).transpose()?;
    let workspace = reference.as_ref().map(workspace).transpose()?;
    let line = ProgressLine::new();
    let plan = Plan { cases, baseline, reference, hand, workspace, split, size: arguments.size };
    let report = measure(&plugin, &plan, &line)?;
    line.0.finish_and_clear();

    let title = || style::title(&format!("{} {}", report.model, report.version));
    print_result(arguments.options.json.file(), &report, || format!("{}\n{}", title(), report.to_text()))?;
    write_text(arguments.csv.as_deref(), || report.to_csv())?;
    write_text(arguments.plot.as_deref(), || report.to_svg())
}

/// Returns the workspace of a case: the one set, else the device's range, for a spring in units of its free length.
fn workspace(arguments: &BenchArguments, plugin: &Plugin, case: &Case) -> Result<Workspace, CommandError> {
    let plugin = case.other.as_ref().unwrap_or(plugin);
    let radius_mm = match arguments.workspace_mm {
        Some(radius_mm) => radius_mm,
        None => {
            let mut model = plugin.create_model(&case.settings)?;
            let index = model.parameters().iter().position(|parameter| parameter.id() == FREE_LENGTH);
            let scale = index.map_or(1.0, |index| model.parameter(index) / UNSCALED_LENGTH_MM);
            DEVICE_RANGE_MM * scale
        }
    };
    Ok(Workspace { radius_m: radius_mm / 1e3, rotation_rad: arguments.workspace_deg.to_radians() })
}

/// Key of another model's id among the settings of a case.
const OTHER_MODEL: &str = "model";

/// Parses a case from `KEY=VALUE,KEY=VALUE`, on top of the common settings; looks up another model in the registry.
fn case(registry: &Registry, plugin: &Plugin, sets: &[KeyValue], text: &str) -> Result<Case, CommandError> {
    let usage = |problem: String| CommandError::Usage(format!("case `{text}`: {problem}"));
    let own = text.split(',').filter(|part| !part.trim().is_empty()).map(str::parse::<KeyValue>);
    let mut own = own.collect::<Result<Vec<_>, _>>().map_err(usage)?;
    let at = own.iter().position(|set| set.parameter().key == OTHER_MODEL);
    let named = at.map(|at| own.remove(at).parameter().value);
    let other = named.map(|id| registry.load(&id, PluginKind::Model)).transpose()?;
    let parameters = other.as_ref().unwrap_or(plugin).parameters();
    // The common settings apply to the common model only.
    let common = if other.is_some() { &[] } else { sets };
    let settings = common.iter().chain(&own).map(|set| {
        let parameter = set.parameter();
        Setting::parse(parameters, &parameter.key, &parameter.value).map_err(|error| usage(error.to_string()))
    });
    // A value is clear without its key, apart from a switch.
    let word = |set: &KeyValue| {
        let parameter = set.parameter();
        match parameter.value.as_str() {
            "on" | "off" => format!("{} {}", parameter.key, parameter.value),
            _ => parameter.value,
        }
    };
    let id = other.as_ref().map(|other| other.metadata().id.clone());
    let values: Vec<String> = id.into_iter().chain(own.iter().map(word)).collect();
    let name = if values.is_empty() { "defaults".to_owned() } else { values.join(" ") };
    Ok(Case { name, settings: settings.collect::<Result<_, _>>()?, other })
}
