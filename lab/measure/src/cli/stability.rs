//! `flotor stability`: largest stable stiffness on the simulated device, compared with theory.

use crate::stability::theory::{Plant, Rendering, exact_limit_n_per_m, gil_limit_n_per_m};
use crate::stability::{Case, Grip, LoopError, Row, default_cases, is_search_end, measure, worst_deviation};
use clap::Args;
use flotor_command::options::{PluginResultOptions, count, number, rate_hz, svg_file};
use flotor_command::tables::{table, to_csv};
use flotor_command::{CommandError, print_result, progress_bar, style, write_json, write_text};
use flotor_hal::abi::PluginKind;
use flotor_loader::Plugin;
use flotor_plot::{Axis, Figure, Panel, Series};
use serde::Serialize;
use std::path::PathBuf;

/// Find the largest stable stiffness of a virtual spring, compared with theory.
#[derive(Args)]
#[command(
    after_help = "For each case, the command bisects the stiffness on the dynamics of the simulated flotor, in \
    virtual time, until the vibration of a released handle neither grows nor fades. Each combination of the listed \
    values is a case; without any list, the command measures a default grid.\n\n\
    Examples:\n  \
    flotor stability --plot stability.svg --csv stability.csv\n  \
    flotor stability --rate 1000,4000 --delay 0,1 --virtual-damping 0,15\n  \
    flotor stability --virtual-damping 15 --quantum-um 10 --hand relaxed"
)]
pub(crate) struct StabilityArguments {
    /// Servo rates in Hz, 100 to 10000, separated by commas (default beside another list: 1000)
    #[arg(long, value_parser = rate_hz, value_name = "HZ", value_delimiter = ',')]
    rate: Vec<f64>,
    /// Delays from a sample to its force in whole periods, 0 to 100, separated by commas (default beside another list:
    /// 0)
    #[arg(long, value_parser = count(0..=100_u32), value_name = "TICKS", value_delimiter = ',')]
    delay: Vec<u32>,
    /// Viscous damping of the device in N s/m, 0 to 100000, separated by commas (default beside another list: 0.5)
    #[arg(long, value_parser = number("N s/m", "damping", 0.0..=100_000.0), value_name = "B", value_delimiter = ',')]
    damping: Vec<f64>,
    /// Virtual damping (backward difference) in N s/m, 0 to 100000, separated by commas (default beside another list:
    /// 0)
    #[arg(long, value_parser = number("N s/m", "damping", 0.0..=100_000.0), value_name = "B", value_delimiter = ',')]
    virtual_damping: Vec<f64>,
    /// Step of the position sensor in µm, 0 to 100
    #[arg(long, value_parser = number("µm", "step", 0.0..=100.0), value_name = "UM", default_value = "0")]
    quantum_um: f64,
    /// Grip of the hand on the handle
    #[arg(long, value_enum, default_value_t)]
    hand: Grip,
    #[command(flatten)]
    options: PluginResultOptions,
    /// Write the rows as CSV (- for standard output)
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Plot stiffness over virtual damping: theory as lines, simulation as points
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// Simulated device.
const DEVICE: &str = "simulated";

/// JSON output of `stability`.
#[derive(Serialize)]
struct Report<'a> {
    device: &'a str,
    version: &'a str,
    rows: &'a [Row],
    worst_deviation: Option<f64>,
}

pub(crate) fn run(arguments: &StabilityArguments) -> Result<(), CommandError> {
    let cases = cases(arguments);
    let plugin = arguments.options.plugin_path.registry().load(DEVICE, PluginKind::Device)?;
    let progress = progress_bar(cases.len() as u64, "{percent:>3} %  case {pos} of {len}");
    let rows = measure(&plugin, &cases, || progress.inc(1)).map_err(refused)?;
    progress.finish_and_clear();

    let worst_deviation = worst_deviation(&rows);
    let version = &plugin.metadata().version;
    let report = Report { device: DEVICE, version, rows: &rows, worst_deviation };
    // CSV on standard output replaces the text result.
    let csv = arguments.csv.as_deref();
    if csv.is_none_or(|path| path.as_os_str() != "-") {
        print_result(arguments.options.json.file(), &report, || to_text(&rows, worst_deviation))?;
    } else if let Some(path) = arguments.options.json.file() {
        write_json(path, &report)?;
    }
    write_text(csv, || to_csv([], &rows))?;
    if arguments.plot.is_none() {
        return Ok(());
    }
    let picture = picture(&plugin, &cases, &rows)?;
    write_text(arguments.plot.as_deref(), || picture)
}

/// Returns the product of all lists given, or the default grid.
fn cases(arguments: &StabilityArguments) -> Vec<Case> {
    let StabilityArguments { rate, delay, damping, virtual_damping, quantum_um, hand: grip, .. } = arguments;
    let quantum_m = quantum_um * 1.0e-6;
    if rate.is_empty() && delay.is_empty() && damping.is_empty() && virtual_damping.is_empty() {
        return default_cases().into_iter().map(|case| Case { quantum_m, grip: *grip, ..case }).collect();
    }
    let mut cases = Vec::new();
    for rate_hz in given_or(rate, 1000.0) {
        let period_ns = flotor_core::period_ns(rate_hz);
        for delay_ticks in given_or(delay, 0) {
            for plant_damping_ns_per_m in given_or(damping, 0.5) {
                cases.extend(given_or(virtual_damping, 0.0).map(|virtual_damping_ns_per_m| Case {
                    period_ns,
                    delay_ticks,
                    plant_damping_ns_per_m,
                    virtual_damping_ns_per_m,
                    quantum_m,
                    grip: *grip,
                }));
            }
        }
    }
    cases
}

fn given_or<T: Copy>(list: &[T], default: T) -> impl Iterator<Item = T> {
    list.iter().copied().chain(list.is_empty().then_some(default))
}

fn refused(error: LoopError) -> CommandError {
    match error {
        LoopError::Plugin(error) => error.into(),
        LoopError::Fault(fault) => CommandError::DeviceFault(fault),
        other => CommandError::PluginRefused(other.to_string()),
    }
}

/// Formats a limit, or the fact that it is above the end of the search.
fn limit_text(limit_n_per_m: f64) -> String {
    let above = if is_search_end(limit_n_per_m) { "above " } else { "" };
    format!("{above}{limit_n_per_m:.1}")
}

fn to_text(rows: &[Row], worst_deviation: Option<f64>) -> String {
    let title = style::title("largest stable stiffness in N/m");
    let head = ["T in ms", "delay", "b", "B", "simulated", "exact", "differ", "Gil", "passive"];
    let line = |row: &Row| {
        let [simulated, exact, gil, passive] =
            [row.k_max_n_per_m, row.exact_n_per_m, row.gil_n_per_m, row.passive_n_per_m].map(limit_text);
        let [period_ms, b, virtual_b] =
            [row.period_s * 1.0e3, row.plant_damping_ns_per_m, row.virtual_damping_ns_per_m]
                .map(|number| number.to_string());
        let differ = row.deviation().map_or("-".to_owned(), |share| format!("{:.3}%", share * 100.0));
        [period_ms, row.delay_ticks.to_string(), b, virtual_b, simulated, exact, differ, gil, passive]
    };
    let worst =
        worst_deviation.map_or("none was compared".to_owned(), |share| format!("{:.3} %", share * 100.0));
    let foot = format!("worst difference between simulated and exact limit: {worst}");
    [vec![title], table(head, rows.iter().map(line)), vec![foot]].concat().join("\n")
}

/// Draws a panel for each combination of period and drag, with a line and points for each delay.
fn picture(plugin: &Plugin, cases: &[Case], rows: &[Row]) -> Result<String, CommandError> {
    let mut figure = Figure::new("Largest stable stiffness", Axis::linear("Virtual damping", "N s/m"))
        .subtitle("points: simulated flotor; lines: exact limit of the sampled loop, and Gil's rule")
        .panel_height_px(320.0);
    let pairs: Vec<(&Case, &Row)> = cases.iter().zip(rows).collect();
    for (index, first) in cases.iter().enumerate() {
        let is_alike = |case: &Case| {
            case.period_ns == first.period_ns && case.plant_damping_ns_per_m == first.plant_damping_ns_per_m
        };
        let within: Vec<_> = pairs.iter().copied().filter(|(case, _)| is_alike(case)).collect();
        let is_new = !cases.iter().take(index).any(is_alike);
        // A curve needs points; single cases are in the table.
        if is_new && (within.len() >= 3 || cases.len() == within.len()) {
            figure = figure.panel(stiffness_panel(first, first.plant(plugin).map_err(refused)?, &within));
        }
    }
    Ok(figure.to_svg())
}

fn stiffness_panel(first: &Case, plant: Plant, within: &[(&Case, &Row)]) -> Panel {
    const CURVE_POINTS: u32 = 120;
    let period_s = first.period_ns as f64 * 1.0e-9;
    let title = format!("T = {} ms, b = {} N s/m", period_s * 1.0e3, first.plant_damping_ns_per_m);
    let most = within.iter().map(|(case, _)| case.virtual_damping_ns_per_m).fold(0.0, f64::max);

    let mut panel = Panel::new(Axis::log("Stiffness", "N/m")).title(title);
    let mut delays: Vec<u32> = within.iter().map(|(case, _)| case.delay_ticks).collect();
    delays.sort_unstable();
    delays.dedup();
    for (slot, delay_ticks) in delays.iter().copied().enumerate() {
        let theory = |limit: fn(&Plant, &Rendering) -> f64| {
            let rendering =
                move |virtual_damping_ns_per_m| Rendering { period_s, delay_ticks, virtual_damping_ns_per_m };
            (0..=CURVE_POINTS).map(move |index| {
                // Denser where the curves are steep, at little damping.
                let share = f64::from(index) / f64::from(CURVE_POINTS);
                let damping = most * share * share;
                (damping, limit(&plant, &rendering(damping)))
            })
        };
        let of_delay = within.iter().filter(|(case, _)| case.delay_ticks == delay_ticks);
        let measured = of_delay.map(|(case, row)| (case.virtual_damping_ns_per_m, row.k_max_n_per_m));
        panel = panel
            .series(
                Series::line(format!("exact, {delay_ticks} ticks"), theory(exact_limit_n_per_m)).slot(slot),
            )
            .series(Series::points("", measured).slot(slot))
            .series(
                Series::line(format!("Gil, {delay_ticks} ticks"), theory(gil_limit_n_per_m))
                    .slot(slot + delays.len()),
            );
    }
    panel
}
