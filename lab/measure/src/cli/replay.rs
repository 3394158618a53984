//! `flotor replay`: re-evaluation of the models of a recording, unchanged or changed.

use super::replay_picture::ReplayPicture;
use crate::replay::{Compared, Coverage, Difference, DivergenceCause, Replay, ReplayState};
use clap::Args;
use flotor_command::options::{JsonOption, KeyValue, PluginKeyValue, PluginPathOption, svg_file};
use flotor_command::{CommandError, print_result, progress_bar, style, write_text};
use flotor_hal::read_text;
use flotor_record::Ending;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Re-evaluate the models on a recorded trajectory: bit-exact, or with changed parameters.
#[derive(Args)]
#[command(
    after_help = "Without a change force, torque and energy must equal the recorded ones bit for bit, as far as the \
    recording contains them; otherwise the exit code is 1. With --set or --model, a difference is expected. If the \
    scene of the run named a plugin by its file, give the folder of \
    that file with --plugin-path.\n\n\
    Examples:\n  flotor replay run.mcap\n  flotor replay run.mcap --set spring.preset=thesis-3 --plot difference.svg\n  \
    flotor replay run.mcap --model spring=./libmy_spring.so --json -\n  \
    flotor replay run.mcap --plugin-path target/release\n  \
    flotor replay run.mcap --save-state before.json --at-tick 1200; flotor replay run.mcap --from-state before.json"
)]
pub(crate) struct ReplayArguments {
    /// Recording to replay
    recording: PathBuf,
    /// Set a parameter of a model of the recording (repeatable)
    #[arg(long = "set", value_name = "PLUGIN.KEY=VALUE")]
    sets: Vec<PluginKeyValue>,
    /// Evaluate another model instead of a recorded one (repeatable): NAME is the recorded model, PLUGIN the id or file
    /// of the other
    #[arg(long = "model", value_name = "NAME=PLUGIN")]
    models: Vec<KeyValue>,
    #[command(flatten)]
    plugin_path: PluginPathOption,
    #[command(flatten)]
    json: JsonOption,
    /// Save the state of the models before the tick of --at-tick, to start other replays there
    #[arg(long, value_name = "FILE.json", requires = "at_tick")]
    save_state: Option<PathBuf>,
    /// Tick before which --save-state saves
    #[arg(long, value_name = "TICK", requires = "save_state")]
    at_tick: Option<u64>,
    /// Start at the tick of a saved state: earlier ticks are not evaluated
    #[arg(long, value_name = "FILE.json")]
    from_state: Option<PathBuf>,
    /// Plot recorded and replayed force
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

impl ReplayArguments {
    /// Returns true if the user requested a change of the wrench.
    fn changes_anything(&self) -> bool {
        !(self.sets.is_empty() && self.models.is_empty())
    }

    /// Describes the recording and the changes, as on the command line.
    fn text(&self) -> String {
        let file = self.recording.file_name().unwrap_or_default().to_string_lossy();
        let sets = self.sets.iter().map(|set| format!("--set {set}"));
        let models = self.models.iter().map(|model| format!("--model {model}"));
        let changes: Vec<String> = sets.chain(models).collect();
        if changes.is_empty() {
            format!("{file}, unchanged")
        } else {
            format!("{file}, {}", changes.join(" "))
        }
    }
}

#[derive(Serialize)]
struct Report {
    bit_exact: bool,
    /// True if the recording covers the whole run.
    complete: bool,
    #[serde(skip)]
    ending: Ending,
    #[serde(skip)]
    starts_from_state: bool,
    #[serde(flatten)]
    coverage: Coverage,
    #[serde(flatten)]
    difference: Difference,
    why_apart: Option<DivergenceCause>,
    /// Implausible recorded samples, by device.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    implausible: Vec<String>,
    recorded_s: f64,
    wall_s: f64,
}

pub(crate) fn run(arguments: &ReplayArguments) -> Result<(), CommandError> {
    let registry = arguments.plugin_path.registry();
    let mut replay = Replay::open(&arguments.recording, &registry, &arguments.models, &arguments.sets)?;
    if let Some(file) = &arguments.from_state {
        replay = replay.start_from(read_state(file)?);
    }
    if let Some(tick) = arguments.at_tick {
        replay = replay.save_before(tick);
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a year
    let progress = progress_bar((replay.run().duration_s * 1.0e3) as u64, "{percent:>3} %  replaying");
    let names: Vec<String> = replay.plugins().iter().map(|plugin| plugin.name.clone()).collect();
    let started = Instant::now();
    let mut picture = arguments.plot.as_ref().map(|_| ReplayPicture::new());
    let mut end_ns = 0;
    let Compared { difference, coverage, why, ending, implausible, health, state } =
        replay.compare(|record, outputs| {
            end_ns = record.time_ns;
            progress.set_position(record.time_ns / 1_000_000);
            if let Some(picture) = &mut picture {
                picture.add(record, outputs);
            }
        })?;
    progress.finish_and_clear();
    if let (Some(file), Some(state)) = (&arguments.save_state, &state) {
        write_text(Some(file.as_path()), || serde_json::to_string(state).unwrap_or_default())?;
    }

    let recorded_s = end_ns as f64 * 1.0e-9;
    let bit_exact = difference.is_bit_exact();
    let report = Report {
        bit_exact,
        complete: ending == Ending::Finished && coverage.is_whole(),
        ending,
        starts_from_state: arguments.from_state.is_some(),
        coverage,
        difference,
        why_apart: why,
        implausible: implausible.iter().map(|(device, found)| format!("{device}: {found}")).collect(),
        recorded_s,
        wall_s: started.elapsed().as_secs_f64(),
    };
    print_result(arguments.json.file(), &report, || to_text(arguments, &report))?;
    write_text(arguments.plot.as_deref(), || {
        picture.map_or_else(String::new, |picture| picture.into_svg(&arguments.text()))
    })?;
    let mut named = names.iter().zip(&health);
    if let Some((name, (_, words))) = named.find(|(_, (health, _))| health.panicked_at.is_some()) {
        return Err(CommandError::PluginRefused(format!("the model `{name}` failed in the replay: {words}")));
    }
    if !bit_exact && !arguments.changes_anything() {
        let why = report.why_apart.unwrap_or(DivergenceCause::OtherBuild);
        return Err(CommandError::Failed(format!("the outputs differ although nothing was changed: {why}")));
    }
    Ok(())
}

/// Reads a state that `--save-state` has written.
fn read_state(file: &Path) -> Result<ReplayState, CommandError> {
    let text = read_text(file, "the state")
        .map_err(|problem| CommandError::Usage(problem.in_file(file.display())))?;
    serde_json::from_str(&text).map_err(|cause| {
        let advice = "use a file that `flotor replay --save-state` has written";
        CommandError::Usage(format!("{}: {cause}; {advice}", file.display()))
    })
}

impl Report {
    /// Returns the verdict, restricted to the compared ticks.
    fn verdict(&self) -> String {
        match (self.difference.ticks, self.bit_exact, self.coverage.missing_ticks) {
            (0, ..) => "no tick to compare".to_owned(),
            (_, false, _) => "the outputs of the models differ".to_owned(),
            (_, true, 0) => "bit for bit the recorded outputs".to_owned(),
            (_, true, missing) => {
                format!("bit for bit the recorded outputs, but {missing} ticks are missing")
            }
        }
    }

    /// Describes the ticks around the differing ones, where the wrench is equal.
    fn same_around(&self, first: u64, last: u64) -> String {
        let Coverage { begins_at_tick, ends_at_tick, .. } = self.coverage;
        let before = begins_at_tick.filter(|begin| *begin < first).map(|_| format!("before {first}"));
        let after = ends_at_tick.filter(|end| *end > last).map(|_| format!("after {last}"));
        let parts: Vec<String> = before.into_iter().chain(after).collect();
        if parts.is_empty() { String::new() } else { format!("; bit for bit {}", parts.join(" and ")) }
    }

    /// Describes the parts of the run that are missing in the recording.
    fn gaps(&self) -> Vec<String> {
        let Coverage { begins_at_tick, missing_ticks, first_missing_tick, .. } = self.coverage;
        let late = begins_at_tick.filter(|first| *first > 0);
        let late = late.map(|first| {
            if self.starts_from_state {
                format!("the replay started with the saved state before tick {first}")
            } else {
                format!("the recording begins at tick {first}, after the start of the run")
            }
        });
        let missing = first_missing_tick.map(|first| {
            format!("{missing_ticks} ticks are missing, from {first} on: their records were lost")
        });
        let cut = (self.ending == Ending::CutOff)
            .then(|| "the recording is truncated: its process was killed, or its disk was full".to_owned());
        [late, missing, cut].into_iter().flatten().collect()
    }
}

fn to_text(arguments: &ReplayArguments, report: &Report) -> String {
    let mut lines = vec![style::title(&format!("{}: {}", arguments.recording.display(), report.verdict()))];
    let mut row = |name: &str, text: String| lines.push(format!("  {name:<11}{text}"));
    let d = &report.difference;
    row("ticks", format!("{} ({:.3} s) in {:.3} s", d.ticks, report.recorded_s, report.wall_s));
    if let (Some(first), Some(last)) = (d.first_tick, d.last_tick) {
        let (differ, same) = (d.differing_ticks, report.same_around(first, last));
        row("differ", format!("{differ} ticks, the first is {first}, the last {last}{same}"));
        row("force", format!("max {:.3e} N, rms {:.3e} N", d.max_force_n, d.rms_force_n));
        if let (Some(max_nm), Some(rms_nm)) = (d.max_torque_nm, d.rms_torque_nm) {
            row("torque", format!("max {max_nm:.3e} N·m, rms {rms_nm:.3e} N·m"));
        }
        if let Some(max_j) = d.max_energy_j {
            row("energy", format!("max {max_j:.3e} J"));
        }
    }
    // Without changes the error contains the cause.
    if let (Some(why), true) = (&report.why_apart, arguments.changes_anything()) {
        row("note", format!("the outputs differ for another reason as well: {why}"));
    }
    let implausible = report.implausible.iter().map(|found| format!("as recorded: {found}"));
    implausible.for_each(|found| row("note", found));
    report.gaps().into_iter().for_each(|gap| row("note", gap));
    lines.join("\n")
}
