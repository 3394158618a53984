//! `flotor replay`: the models of a recording once more, as they were or changed.

use super::options::{KeyValue, PluginKeyValue};
use super::{CommandError, run, style, write_json};
use crate::plot::{Axis, Figure, Panel, Series};
use crate::record::Ending;
use crate::record::Recording;
use crate::registry::Registry;
use crate::replay::{Difference, Replay, ReplayError};
use crate::scene::ModelUse;
use clap::Args;
use flotor_hal::{DVec3, Wrench};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;

/// Ask the models of a recording again.
#[derive(Args)]
#[command(
    after_help = "With nothing changed the wrench must come out bit for bit: exit code 1 if it does not. With --set or --model\n\
    the difference is what was asked for.\n\n\
    Examples:\n  flotor replay run.mcap\n  flotor replay run.mcap --set spring.variant=closed-form --plot difference.svg\n  \
    flotor replay run.mcap --model spring=./libmy_spring.so --json -\n  \
    flotor replay run.mcap --plugin-path target/release"
)]
pub(crate) struct ReplayArguments {
    /// The recording
    recording: PathBuf,
    /// Set a parameter of a model of the recording (repeatable)
    #[arg(long = "set", value_name = "PLUGIN.KEY=VALUE")]
    sets: Vec<PluginKeyValue>,
    /// Ask another model in place of one of the recording (repeatable): its name, and the id or file of a plugin
    #[arg(long = "model", value_name = "NAME=PLUGIN")]
    models: Vec<KeyValue>,
    /// Folder to search for plugins (repeatable): for those the run's scene named by their files
    #[arg(long = "plugin-path", value_name = "FOLDER")]
    folders: Vec<PathBuf>,
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
    let registry = Registry::search(&arguments.folders);
    let replay = Replay::open(&arguments.recording, &registry, |models| {
        let others = arguments.models.iter().find_map(|other| replace(other, models).err());
        unknown = others.or_else(|| arguments.sets.iter().find_map(|set| set.apply_to_models(models).err()));
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
    let (difference, health) = replay.compare(|record, wrench| {
        end_ns = record.time_ns;
        progress.set_position(record.time_ns / 1_000_000);
        if arguments.plot.is_some() {
            samples.push(Sample { time_ns: record.time_ns, recorded: record.model, replayed: *wrench });
        }
    })?;
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
    if !bit_exact && arguments.sets.is_empty() && arguments.models.is_empty() {
        let problem =
            "nothing was changed, yet the wrench differs: another build of the plugin, or another machine";
        return Err(CommandError::Failed(problem.to_owned()));
    }
    Ok(())
}

/// Another plugin in place of a model of the recording; it starts from its own defaults.
fn replace(other: &KeyValue, models: &mut [ModelUse]) -> Result<(), String> {
    let (name, plugin) = other.pair();
    let names: Vec<String> = models.iter().map(|model| model.name.clone()).collect();
    let model = models.iter_mut().find(|model| model.name == name).ok_or_else(|| {
        format!("--model {name}={plugin}: the recording has no model `{name}` (it has {})", names.join(", "))
    })?;
    plugin.clone_into(&mut model.plugin.plugin);
    model.plugin.parameters.clear();
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

/// A tick of the recording and what the models say now.
struct Sample {
    time_ns: u64,
    recorded: Wrench,
    replayed: Wrench,
}

/// The force that was and that would be, and how they differ along every axis.
fn picture(samples: &[Sample]) -> String {
    #[allow(clippy::cast_precision_loss)] // for a picture
    let line = |value: &dyn Fn(&Sample) -> f64| -> Vec<(f64, f64)> {
        samples.iter().map(|sample| (sample.time_ns as f64 * 1.0e-9, value(sample))).collect()
    };
    let axes = |label: &str, unit: &str, scale: f64, difference: fn(&Sample) -> DVec3| {
        let panel = Panel::new(Axis::linear(label, unit));
        ["x", "y", "z"].into_iter().enumerate().fold(panel, |panel, (axis, name)| {
            panel.series(Series::line(name, line(&|sample| difference(sample)[axis] * scale)).slot(axis))
        })
    };
    Figure::new("Recorded and replayed", Axis::linear("Time", "s"))
        .panel(
            Panel::new(Axis::linear("Force, z", "N"))
                .series(Series::line("recorded", line(&|sample| sample.recorded.force().z)))
                .series(Series::line("replayed", line(&|sample| sample.replayed.force().z))),
        )
        .panel(axes("Difference of force", "N", 1.0, |s| s.replayed.force() - s.recorded.force()))
        .panel(axes("Difference of torque", "mN·m", 1.0e3, |s| s.replayed.torque() - s.recorded.torque()))
        .panel_height_px(180.0)
        .to_svg()
}
