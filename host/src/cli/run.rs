//! `flotor run`: runs a scene in the servo loop, with its observers.

use crate::cli::object::{ObjectScene, object_scene};
use crate::peak_bounds::PeakBound;
use crate::platform::most_open_files;
use crate::run_picture::RunPicture;
use clap::{Args, ValueEnum};
use flotor_command::options::{
    ClockOption, JsonOption, PluginKeyValue, SceneOptions, core, duration_s, mcap_file, rate_hz, seed,
    svg_file,
};
use flotor_command::stopping::{Keys, stop_on_signals, stop_run_on_signals};
use flotor_command::{
    CommandError, end_notes, end_words, first_error, keep_results_apart, note, print_result, progress_bar,
    style, verdict, while_preparing, write_json,
};
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_coupling::Line;
use flotor_hal::Demand;
use flotor_live::{Directory, EndKind};
use flotor_record::{Recorder, RunDescription};
use flotor_servo::{Clock, Core, EmergencySource, RunEnd};
use flotor_session::registry::Registry;
use flotor_session::run_description::describe;
use flotor_session::scene::Scene;
use flotor_session::summary::{RunFacts, RunSummary};
use flotor_session::telemetry::{LinkCounts, ObservedRun, PeerLink, publish, start_peer_link};
use flotor_session::{
    LatchGuard, Measurements, Observer, Outcome, RunError, RunOptions, Session, stop_waits_with,
};
use indicatif::ProgressBar;
use std::path::{Path, PathBuf};

/// Run a scene in the servo loop.
#[derive(Args, Default)]
#[command(after_help = "Examples:\n  \
    flotor run --duration 5s --plot run.svg\n  \
    flotor run wall                                       a scene of Flotor's own (`flotor scenes` lists them)\n  \
    flotor run scene.toml --clock virtual --seed 7 --record run.mcap --json run.json\n  \
    flotor run --object duck.stl --set surface.tool_radius_mm=1\n  \
    flotor run --set spring.variant=closed-form --set device.hand=press\n  \
    flotor run maglev.toml --allow-strong                 more than 20 N and 1 N·m, where scene and device allow it")]
pub(crate) struct RunArguments {
    /// Scene file (TOML), or the name of one of Flotor's own scenes (default: demo)
    scene: Option<PathBuf>,
    /// Touch the object of a mesh file (STL, OBJ, PLY, GLB) in place of a scene: the top of its box lies 5 mm below home
    #[arg(long, conflicts_with = "scene", value_name = "FILE")]
    object: Option<PathBuf>,
    /// Duration of the run: 10s, 500ms, 2min; a number alone is in seconds (default: the duration in the scene)
    #[arg(long, value_parser = duration_s, allow_hyphen_values = true, value_name = "TIME")]
    duration: Option<f64>,
    /// Loop rate in Hz, 100 to 10000 (default: the rate in the scene)
    #[arg(long, value_parser = rate_hz, value_name = "HZ")]
    rate: Option<f64>,
    /// Real time, or as fast as possible and bit-exact
    #[arg(long, value_enum, default_value_t)]
    clock: ClockOption,
    /// Seed of all random numbers
    #[arg(long, value_parser = seed, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Pin the loop to this core of the machine, from 0 (real clock; default: not pinned)
    #[arg(long, value_parser = core, value_name = "N")]
    core: Option<Core>,
    /// Record every tick to an MCAP file (opens in Foxglove, Rerun, Python)
    #[arg(long, value_parser = mcap_file, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Plot motion, force, energy and timing over time
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Draw a bound of the largest force (N) or torque (N·m), such as peak_force_n=3.2 (repeatable)
    #[arg(long, hide = true, requires = "plot", value_name = "NUMBER=VALUE")]
    plot_bound: Vec<PeakBound>,
    #[command(flatten)]
    json: JsonOption,
    /// Compute an output of the models even if neither the hand nor an observer needs the output (repeatable)
    #[arg(long, value_enum, value_name = "OUTPUT")]
    compute: Vec<OutputOption>,
    /// Set a parameter of a plugin of the scene (repeatable)
    #[arg(long = "set", value_name = "PLUGIN.KEY=VALUE")]
    sets: Vec<PluginKeyValue>,
    /// Add the controller of the Maglev 200 as a model of the first device, and accept programs of the ML API at this address
    #[arg(long, hide = true, value_name = "HOST:PORT")]
    ml_api: Option<String>,
    #[command(flatten)]
    options: SceneOptions,
}

impl RunArguments {
    /// Returns true if `flotor lend` has started this run: the run must then end with that process, because nothing else ends it.
    pub(crate) fn is_lent(&self) -> bool {
        self.ml_api.is_some()
    }
}

/// Model output for `--compute`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum OutputOption {
    /// Torque, even if the device exerts no torque
    Torque,
    /// Stored energy
    Energy,
}

impl OutputOption {
    fn demand(self) -> Demand {
        match self {
            Self::Torque => Demand::TORQUE,
            Self::Energy => Demand::ENERGY,
        }
    }
}

/// Scene text with the model for `--ml-api`; its device is a placeholder, because a scene needs a device.
const ML_API: &str = "[device]\nplugin = \"none\"\n[[model]]\nplugin = \"ml-api\"\n";

pub(crate) fn run(arguments: RunArguments) -> Result<(), CommandError> {
    // First, so that a signal during loading also ends the run. With `--ml-api`, every signal stops the run normally, so that a
    // summary is always printed, even after a very short program.
    let stop = if arguments.is_lent() { stop_on_signals()? } else { stop_run_on_signals()? };
    stop_waits_with(&stop);
    if arguments.json.is_on_standard_output() {
        keep_results_apart()?;
    }
    let object = object(&arguments)?;
    let scene = scene(&arguments, object.as_ref())?;
    let options = run_options(&arguments)?;
    let mut session = prepare(&arguments, &scene, &options)?;
    drop(object);
    let links = peer_links(&mut session, options.clock)?;
    let plugins = session.plugins().to_vec();
    let description = describe(&scene, &options, &plugins);
    let publication = publish(&Directory::of_this_user(), &scene, &description, &session, &stop);
    let publication =
        publication.map_err(|error| note(format_args!("telemetry server not started: {error}"))).ok();
    let mut watched = ObservedRun { observer: Watchers::new(&arguments, &scene, &description)?, publication };
    let keys = (options.clock == Clock::Real).then(|| Keys::listen(&stop)).flatten();
    let latch = session.latch().cloned();
    let outcome = session.run(&mut watched, &stop);
    drop(keys);
    let ObservedRun { observer: watchers, publication } = watched;
    watchers.progress.finish_and_clear();
    let facts = watchers.measured.facts(&scene, &options, &plugins);
    let facts = RunFacts { requested: watchers.demand(), ..facts };
    let outcome = match outcome {
        Ok(outcome) => outcome,
        Err(error) => return report_failure(&arguments, facts, watchers, error),
    };
    let carried: Vec<(String, LinkCounts)> =
        links.into_iter().map(|(name, link)| (name, link.finish())).collect();
    if let Some(publication) = publication {
        let kind = if outcome.end.is_in_order() { EndKind::InOrder } else { EndKind::Failed };
        publication.end(&end_words(&outcome, scene.rate_hz), kind);
    }
    report(&arguments, RunFacts { carried: &carried, ..facts }, watchers, outcome, latch.as_ref())
}

/// Returns the options of the run, checked against each other and the machine.
fn run_options(arguments: &RunArguments) -> Result<RunOptions, CommandError> {
    let clock = match arguments.clock {
        ClockOption::Real => enough_files().map(|()| Clock::Real)?,
        ClockOption::Virtual if arguments.core.is_some() => {
            let usage = "--core needs the real clock: omit `--clock virtual`".to_owned();
            return Err(CommandError::Usage(usage));
        }
        ClockOption::Virtual => Clock::Virtual,
    };
    Ok(RunOptions { clock, seed: arguments.seed })
}

/// Prepares the session and prints its notices and warnings.
fn prepare(arguments: &RunArguments, scene: &Scene, options: &RunOptions) -> Result<Session, CommandError> {
    let registry = Registry::search(&scene.plugin_folders);
    let session = while_preparing(&scene.title, || Session::prepare(scene, &registry, options))?;
    let session = session.with_strength(arguments.options.strength()).on_core(arguments.core);
    if !arguments.is_lent() {
        session.notices().into_iter().for_each(note);
    }
    session.warnings().iter().for_each(note);
    Ok(session)
}

/// Finishes the recording of a failed run, and writes the JSON summary if the loop is stuck.
fn report_failure(
    arguments: &RunArguments,
    facts: RunFacts<'_>,
    watchers: Watchers,
    error: RunError,
) -> Result<(), CommandError> {
    let Measurements { tally, mut recording, .. } = watchers.measured;
    let recorded = recording.finish(&[]).map_err(Into::into);
    let reported = match (&error, arguments.json.file()) {
        (RunError::Hung { who, stuck, .. }, Some(json)) => {
            let summary = RunSummary::new(facts, &Outcome::of_hung_loop(*stuck, tally.last_ns()), &tally);
            write_json(json, &summary.with_health(who, &error.to_string()))
        }
        _ => Ok(()),
    };
    first_error([Err(error.into()), recorded, reported])
}

/// Finishes the recording of a run, writes plot and summary, and frees its plugins; returns the first error.
fn report(
    arguments: &RunArguments,
    facts: RunFacts<'_>,
    watchers: Watchers,
    outcome: Outcome,
    latch: Option<&LatchGuard>,
) -> Result<(), CommandError> {
    let Watchers { measured: Measurements { tally, mut recording, .. }, plot, .. } = watchers;
    let plugins = facts.plugins;
    let summary = RunSummary::new(facts, &outcome, &tally);
    // Before all other steps that can fail: the recording cannot be repeated.
    let recorded = recording.finish(&end_notes(&outcome, &summary)).map_err(Into::into);
    let drawn = match (&arguments.plot, plot) {
        (Some(path), Some(plot)) => std::fs::write(path, plot.into_svg(&summary.one_line(), &outcome.timing))
            .map_err(|cause| CommandError::file(path, "cannot write the plot", cause)),
        _ => Ok(()),
    };
    let text = || format!("{}\n{}", style::title(&summary.title), summary.to_text());
    let printed = print_result(arguments.json.file(), &summary, text);
    outcome.real_time.advice().into_iter().for_each(note);
    outcome.later_warnings().iter().for_each(note);
    always_degraded(&summary).into_iter().for_each(note);
    latch.and_then(|latch| stop_note(outcome.end, latch)).into_iter().for_each(note);
    let verdict = verdict(&outcome, plugins, &summary);
    // Last, because plugin code may hang or end the process.
    let Outcome { unresponsive, unfreed_plugins, .. } = outcome;
    let freed = unfreed_plugins.free();
    let freed = unresponsive.map_or(freed, Err).map_err(|hung| CommandError::PluginRefused(hung.to_string()));
    // Scripts need the outcome of the run first, a missing file second.
    first_error([verdict, freed, recorded, drawn, printed])
}

/// Returns advice if a model had no valid answer in any tick; `None` otherwise.
fn always_degraded(summary: &RunSummary) -> Option<String> {
    let degraded = summary.events.get("model_degraded").copied().unwrap_or(0);
    (summary.ticks > 0 && degraded >= summary.ticks).then(|| {
        "no tick had a valid answer of all models (`model_degraded`); move the handle or the model's origin into its domain, and give \
         a model that computes asynchronously `[model.field]` with `rate_hz = 250` in the scene"
            .to_owned()
    })
}

/// Describes the effect of this run's emergency stop on other runs, or the source of the emergency stop of another run; `None`
/// without an emergency stop.
fn stop_note(end: RunEnd, latch: &LatchGuard) -> Option<String> {
    match end {
        RunEnd::EmergencyStop(EmergencySource::Latch) => latch.check().err().map(|error| error.to_string()),
        _ => latch.reach().map(|reach| reach.to_string()),
    }
}

/// Largest number of open files of a run in real time, with a margin: plugins, recording, socket, sixteen clients.
const OPEN_FILES: u64 = 64;

/// Checks the limit on open files: a run that cannot open more files lacks signal handlers, recording or socket while a hand is on
/// the device.
fn enough_files() -> Result<(), CommandError> {
    match most_open_files() {
        Some(most) if most < OPEN_FILES => Err(CommandError::Usage(format!(
            "the process may open only {most} files, but a run in real time needs {OPEN_FILES}; raise the \
             limit with `ulimit -n {OPEN_FILES}`"
        ))),
        _ => Ok(()),
    }
}

/// Reads the mesh file of `--object`; `None` without the option.
fn object(arguments: &RunArguments) -> Result<Option<ObjectScene>, CommandError> {
    let registry = || arguments.options.registry();
    arguments.object.as_deref().map(|file| object_scene(file, &arguments.sets, &registry())).transpose()
}

/// Loads the scene and applies the options of the command line.
fn scene(arguments: &RunArguments, object: Option<&ObjectScene>) -> Result<Scene, CommandError> {
    let scene = match (&arguments.scene, object) {
        (_, Some(object)) => Scene::parse(Path::new("--object"), &object.text),
        (Some(path), None) => Scene::load(path),
        (None, None) => Scene::demo(),
    };
    let mut scene = scene.map_err(RunError::Scene)?;
    if let Some(duration_s) = arguments.duration {
        scene.duration_s = duration_s;
    }
    if let Some(rate_hz) = arguments.rate {
        scene.set_rate(rate_hz, "--rate").map_err(RunError::Scene)?;
    }
    if let Some(listen) = &arguments.ml_api {
        let added = Scene::parse(Path::new("--ml-api"), ML_API).map_err(RunError::Scene)?.models;
        scene.models.extend(added.iter().map(|model| model.replaced_by(None, &[("listen", listen)])));
    }
    arguments.options.apply(&mut scene);
    for set in &arguments.sets {
        set.apply(&mut scene).map_err(CommandError::Usage)?;
    }
    Ok(scene)
}

/// Starts a peer link for each coupling with a remote end.
fn peer_links(session: &mut Session, clock: Clock) -> Result<Vec<(String, PeerLink)>, CommandError> {
    let lines = session.take_lines();
    if let (Some((name, _)), Clock::Virtual) = (lines.first(), clock) {
        return Err(CommandError::Usage(format!(
            "the remote end of the coupling `{name}` runs in real time: omit `--clock virtual`"
        )));
    }
    let directory = Directory::of_this_user();
    let link = |(name, line): (String, Line)| match start_peer_link(&directory, &name, line) {
        Ok(link) => Ok((name, link)),
        Err(error) => {
            Err(CommandError::Failed(format!("coupling `{name}`: cannot start the peer link: {error}")))
        }
    };
    lines.into_iter().map(link).collect()
}

/// Observers of a run: measurements, plot and progress line.
struct Watchers {
    measured: Measurements,
    plot: Option<RunPicture>,
    progress: ProgressBar,
}

/// Interval between updates of the progress line, ticks: thirty updates per second at 1 kHz.
const PROGRESS_TICKS: u64 = 33;

impl Watchers {
    fn new(
        arguments: &RunArguments,
        scene: &Scene,
        description: &RunDescription,
    ) -> Result<Self, CommandError> {
        let recorder = arguments.record.as_deref().map(|path| Recorder::create(path, description));
        let computed = arguments.compute.iter().fold(Demand::FORCE, |all, output| all.with(output.demand()));
        let devices = || scene.devices.iter().map(|device| device.name.clone()).collect();
        let plot = || RunPicture::new(&scene.title, devices(), &arguments.plot_bound);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most a year
        let length_ms = (scene.duration_s * 1.0e3) as u64;
        Ok(Self {
            measured: Measurements::new(recorder.transpose()?, computed),
            plot: arguments.plot.is_some().then(plot),
            progress: progress_bar(length_ms, "{percent:>3} %  {msg}"),
        })
    }
}

impl Observer for Watchers {
    fn change(&mut self, change: &Change) {
        self.measured.change(change);
        self.plot.iter_mut().for_each(|plot| plot.change(change));
    }

    fn demand(&self) -> Demand {
        let plot = self.plot.as_ref().map_or(Demand::FORCE, RunPicture::demand);
        self.measured.demand().with(plot)
    }

    fn observe(&mut self, record: &TickRecord) {
        self.measured.observe(record);
        self.plot.iter_mut().for_each(|plot| plot.observe(record));
        if record.tick.is_multiple_of(PROGRESS_TICKS) && record.device == 0 {
            self.progress.set_position(record.time_ns / 1_000_000);
            if !self.progress.is_hidden() {
                self.progress.set_message(live_line(record));
            }
        }
    }
}

/// Formats the height of the handle, as a bar and in mm, and the vertical force on the hand, N.
fn live_line(record: &TickRecord) -> String {
    const COLUMNS: usize = 21;
    let z_mm = record.pose.position().z * 1.0e3;
    let force_n = record.commanded.force().z;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to a few columns
    let column = ((z_mm + 10.0) / 20.0 * COLUMNS as f64).clamp(0.0, (COLUMNS - 1) as f64) as usize;
    let mark = |place: usize| match place {
        place if place == column => '█',
        place if place == COLUMNS / 2 => '┊',
        _ => '·',
    };
    let bar: String = (0..COLUMNS).map(mark).collect();
    format!("-10 mm {bar} +10   z {z_mm:+6.2} mm   Fz {force_n:+6.2} N")
}
