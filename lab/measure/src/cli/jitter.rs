//! `flotor jitter`: lateness of the servo compared with that of a bare loop.

use crate::jitter::{JitterReport, LoopTiming, MissedMore, measure};
use clap::Args;
use flotor_command::options::{PluginResultOptions, core, duration_s, rate_hz, svg_file};
use flotor_command::stopping::stop_run_on_signals;
use flotor_command::tables::table;
use flotor_command::{CommandError, note, print_result, progress_bar, style, write_text};
use flotor_plot::{Axis, Bin, Figure, Panel, Series};
use flotor_servo::{Clock, Core};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{RunError, RunOptions, Session, stop_waits_with};
use std::path::PathBuf;

/// Measure the timing of the servo on this machine, compared with a bare loop.
#[derive(Args)]
#[command(
    after_help = "Servo and bare loop alternate every second, with the same spin window, priority, core and load.\n\n\
    Example:\n  flotor jitter --duration 20s --plot jitter.svg"
)]
pub(crate) struct JitterArguments {
    /// Duration of the whole measurement, rounded up to an even number of seconds
    #[arg(long, value_parser = duration_s, allow_hyphen_values = true, value_name = "TIME", default_value = "20s")]
    duration: f64,
    /// Loop rate in Hz, 100 to 10000
    #[arg(long, value_parser = rate_hz, value_name = "HZ", default_value = "1000")]
    rate: f64,
    /// Run both loops on this core, from 0 (default: not pinned)
    #[arg(long, value_parser = core, value_name = "N")]
    core: Option<Core>,
    #[command(flatten)]
    options: PluginResultOptions,
    /// Plot both histograms
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

pub(crate) fn run(arguments: &JitterArguments) -> Result<(), CommandError> {
    // Handle signals before plugins start threads, which would receive them.
    let stop = stop_run_on_signals()?;
    stop_waits_with(&stop);
    let mut scene = Scene::demo().map_err(RunError::Scene)?;
    scene.rate_hz = arguments.rate;
    arguments.options.plugin_path.put_before_those_of(&mut scene);
    let options = RunOptions { clock: Clock::Real, seed: 0 };
    let session = Session::prepare(&scene, &Registry::search(&scene.plugin_folders), &options)?;
    let session = session.on_core(arguments.core);
    session.notices().into_iter().for_each(note);
    session.warnings().iter().for_each(note);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a year
    let slices = ((arguments.duration / 2.0).ceil() as u64).max(1);
    let progress = progress_bar(slices, "{percent:>3} %  pair {pos} of {len}");
    let report = measure(session, slices, &stop, |done| progress.set_position(done))?;
    progress.finish_and_clear();

    report.real_time.advice().into_iter().for_each(note);
    print_result(arguments.options.json.file(), &report, || to_text(&report))?;
    write_text(arguments.plot.as_deref(), || picture(&report))
}

fn to_text(report: &JitterReport) -> String {
    let us = |ns: u64| format!("{:.2}", ns as f64 * 1.0e-3);
    let row = |name: &str, timing: &LoopTiming| {
        let LoopTiming { lateness_ns: l, ticks, late_ticks, missed_ticks } = timing;
        let [p50, p99, p999, max] = [l.p50, l.p99, l.p999, l.max].map(us);
        let [ticks, late, missed] = [ticks, late_ticks, missed_ticks].map(u64::to_string);
        [name.to_owned(), p50, p99, p999, max, ticks, late, missed]
    };
    let title = format!(
        "lateness in µs at {} Hz, {} s each in turns, spin window {} µs",
        report.rate_hz,
        report.slices,
        us(report.spin_window_ns)
    );
    let head = ["", "p50", "p99", "p99.9", "max", "ticks", "late", "missed"];
    let mut lines = vec![style::title(&title)];
    lines.extend(table(head, [row("servo", &report.servo), row("bare", &report.bare)]));
    if let MissedMore { ticks, standard_error: Some(error) } = report.missed_more {
        lines.push(format!(
            "  missed, servo - bare: {ticks:+} ± {error:.0} (standard error, from the spread of the pairs)"
        ));
    }
    lines.join("\n")
}

/// Groups bins of ns into bars of a quarter octave, µs; times below 10 ns are in the first bar.
fn of_time(bins: &[(u64, u64)]) -> Vec<Bin> {
    Bin::quarter_octaves(0.01, bins.iter().map(|(ns, count)| (*ns as f64 * 1.0e-3, *count)))
}

fn picture(report: &JitterReport) -> String {
    let mut panel = Panel::new(Axis::log("Ticks", ""));
    for (name, bins) in ["servo", "bare loop"].iter().zip(&report.bins) {
        panel = panel.series(Series::histogram(*name, of_time(bins)));
    }
    let subtitle = format!("{} Hz, {} s each in turns of a second", report.rate_hz, report.slices);
    Figure::new("Lateness of the servo and of a bare loop", Axis::log("Lateness", "µs"))
        .subtitle(subtitle)
        .panel_height_px(260.0)
        .panel(panel)
        .to_svg()
}
