//! `flotor replay`: the models of a recording once more, as they were or changed.

use super::options::PluginKeyValue;
use super::{CommandError, run, style, write_json};
use crate::plot::{Axis, Figure, Panel, Series};
use crate::record::Ending;
use crate::record::Recording;
use crate::registry::Registry;
use crate::replay::{Difference, Replay, ReplayError};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Ask the models of a recording again.
#[derive(Args)]
#[command(
    after_help = "Without --set the wrench must come out bit for bit: exit code 1 if it does not. With --set the difference is\n\
    what was asked for.\n\n\
    Examples:\n  flotor replay run.mcap\n  flotor replay run.mcap --set spring.variant=closed-form --plot difference.svg"
)]
pub(crate) struct ReplayArguments {
    /// The recording
    recording: PathBuf,
    /// Set a parameter of a model of the recording (repeatable)
    #[arg(long = "set", value_name = "PLUGIN.KEY=VALUE")]
    sets: Vec<PluginKeyValue>,
    /// Write the difference as JSON (- for standard output)
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Draw recorded and replayed force
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    bit_exact: bool,
    complete: bool,
    #[serde(flatten)]
    difference: Difference,
    recorded_s: f64,
    wall_s: f64,
}

pub(crate) fn run(arguments: &ReplayArguments) -> Result<(), CommandError> {
    let mut unknown = None;
    let replay = Replay::open(&arguments.recording, &Registry::search(&[]), |models| {
        unknown = arguments.sets.iter().find_map(|set| set.apply_to_models(models).err());
    });
    if let Some(problem) = unknown {
        return Err(CommandError::Usage(problem));
    }
    let replay = replay?;
    let complete =
        Recording::open(&arguments.recording).map_err(ReplayError::from)?.ending() == Ending::Finished;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a year
    let progress = run::progress_bar((replay.run().duration_s * 1.0e3) as u64, "{percent:>3} %  replaying");
    let started = Instant::now();
    let mut samples = Vec::new();
    let mut end_ns = 0;
    let (difference, health) = replay
        .compare(|record, wrench| {
            end_ns = record.time_ns;
            progress.set_position(record.time_ns / 1_000_000);
            if arguments.plot.is_some() {
                samples.push((record.time_ns, record.model.force().z, wrench.force().z));
            }
        })
        .map_err(ReplayError::from)?;
    progress.finish_and_clear();

    #[allow(clippy::cast_precision_loss)] // 2^53 ns are 104 days
    let recorded_s = end_ns as f64 * 1.0e-9;
    let bit_exact = difference.is_bit_exact();
    let report =
        Report { bit_exact, complete, difference, recorded_s, wall_s: started.elapsed().as_secs_f64() };
    tell(arguments, &report)?;
    if let Some(path) = &arguments.plot {
        std::fs::write(path, picture(&samples))
            .map_err(|cause| CommandError::file(path, "cannot write the plot", cause))?;
    }
    if let Some((_, words)) = health.iter().find(|(health, _)| health.panicked_at.is_some()) {
        return Err(CommandError::PluginRefused(format!(
            "a model of the recording stopped answering: {words}"
        )));
    }
    if !bit_exact && arguments.sets.is_empty() {
        let problem =
            "nothing was changed, yet the wrench differs: another build of the plugin, or another machine";
        return Err(CommandError::Failed(problem.to_owned()));
    }
    Ok(())
}

fn tell(arguments: &ReplayArguments, report: &Report) -> Result<(), CommandError> {
    if arguments.json.as_ref().is_none_or(|path| path.as_os_str() != "-") {
        let verdict = if report.bit_exact { "bit for bit the recorded wrench" } else { "the wrench differs" };
        say!("{}", style::title(&format!("{}: {verdict}", arguments.recording.display())));
        let Difference {
            ticks,
            differing_ticks,
            first_tick,
            max_force_n,
            max_torque_nm,
            rms_force_n,
            rms_torque_nm,
        } = &report.difference;
        say!("  {:<11}{ticks} ({:.3} s) in {:.3} s", "ticks", report.recorded_s, report.wall_s);
        if let Some(first) = first_tick {
            say!("  {:<11}{differing_ticks} ticks, the first is {first}", "differ");
            say!("  {:<11}max {max_force_n:.3e} N, rms {rms_force_n:.3e} N", "force");
            say!("  {:<11}max {max_torque_nm:.3e} N·m, rms {rms_torque_nm:.3e} N·m", "torque");
        }
        if !report.complete {
            say!("  {:<11}the recording breaks off: its process was killed or its disk full", "note");
        }
    }
    arguments.json.as_ref().map_or(Ok(()), |path| write_json(path, report))
}

fn picture(samples: &[(u64, f64, f64)]) -> String {
    #[allow(clippy::cast_precision_loss)] // for a picture
    let line = |value: fn(&(u64, f64, f64)) -> f64| {
        samples.iter().map(move |sample| (sample.0 as f64 * 1.0e-9, value(sample))).collect::<Vec<_>>()
    };
    Figure::new("Recorded and replayed", Axis::linear("Time", "s"))
        .panel(
            Panel::new(Axis::linear("Force, z", "N"))
                .series(Series::line("recorded", line(|s| s.1)))
                .series(Series::line("replayed", line(|s| s.2))),
        )
        .panel(Panel::new(Axis::linear("Difference, z", "N")).series(Series::line("", line(|s| s.2 - s.1))))
        .panel_height_px(180.0)
        .to_svg()
}
