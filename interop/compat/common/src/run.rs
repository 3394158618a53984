//! Execution of a program's run: recording, publication to clients, and summaries.

use crate::frame::length;
use crate::settings::Settings;
use crate::station::Station;
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_hal::terminal::escaped;
use flotor_live::Directory;
use flotor_record::{Note, Recorder, RunDescription, Severity};
use flotor_servo::{Place, RunEnd, StopSwitch, Stuck, THREAD_ADVICE};
use flotor_session::run_description::describe;
use flotor_session::scene::Scene;
use flotor_session::summary::RunSummary;
use flotor_session::telemetry::{ObservedRun, publish};
use flotor_session::{
    Lockstep, Measurements, Observer, Outcome, PluginReport, RunError, RunOptions, Session,
};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// True once the emergency stop was pressed.
static IS_STOPPED: AtomicBool = AtomicBool::new(false);

/// Returns true if the emergency stop ended the run of this process.
pub(crate) fn is_emergency_stopped() -> bool {
    IS_STOPPED.load(Ordering::Acquire)
}

/// Prepared run with the data of its report.
pub(crate) struct Prepared {
    pub(crate) session: Session,
    pub(crate) scene: Scene,
    pub(crate) options: RunOptions,
    pub(crate) settings: Settings,
}

/// Observers of each tick.
struct Watchers {
    measured: Measurements,
    requested: Vec<Asked>,
    draft: Option<Draft>,
}

/// Intermediate summary, which remains if the program is killed.
struct Draft {
    facts: Facts,
    stations: &'static [Station],
    /// Time of the last write.
    written: Option<Instant>,
}

/// Interval of the intermediate summary; below, number of ticks between two checks of this interval.
const DRAFT_PERIOD: Duration = Duration::from_millis(500);
const DRAFT_LOOK: u64 = 64;

impl Draft {
    /// Writes the intermediate summary atomically once per interval.
    fn update(&mut self, record: &TickRecord, requested: &[Asked], measured: &Measurements) {
        let is_fresh = |written: Instant| written.elapsed() < DRAFT_PERIOD;
        if !record.tick.is_multiple_of(DRAFT_LOOK) || self.written.is_some_and(is_fresh) {
            return;
        }
        self.written = Some(Instant::now());
        let lines = lines(self.stations, requested);
        let ran_s = record.time_ns as f64 * 1.0e-9;
        let Facts { scene, settings, .. } = &self.facts;
        if let Some(path) = settings.report.as_deref().filter(|path| path.as_os_str() != "-") {
            let text =
                format!("{}\n  ran        {ran_s:.3} s so far\n  {}\n", scene.title, lines.join("\n  "));
            replace(&so_far(path), &text);
        }
        if let Some(path) = settings.json.as_deref().filter(|path| path.as_os_str() != "-") {
            let here = Stuck { tick: record.tick, place: Place::Waiting };
            let outcome = Outcome::of_hung_loop(here, record.time_ns);
            let mut summary =
                serde_json::to_value(self.facts.summary(&outcome, measured)).unwrap_or_default();
            summary["end"] = "not ended".into();
            replace(&so_far(path), &summary.to_string());
        }
    }
}

/// Replaces a file atomically; errors such as a full disk are ignored.
fn replace(path: &Path, text: &str) {
    let new = path.with_extension("new");
    let _ = std::fs::write(&new, text).and_then(|()| std::fs::rename(&new, path));
}

/// Largest magnitudes of the requested and the applied force and torque of a device, N and N·m.
#[derive(Clone, Copy, Default)]
struct Asked {
    force_n: f64,
    torque_nm: f64,
    applied_n: f64,
    applied_nm: f64,
}

impl Observer for Watchers {
    fn change(&mut self, change: &Change) {
        self.measured.change(change);
    }

    fn demand(&self) -> Demand {
        self.measured.demand()
    }

    fn observe(&mut self, record: &TickRecord) {
        self.measured.observe(record);
        let device = usize::from(record.device);
        if self.requested.len() <= device {
            self.requested.resize_with(device + 1, Asked::default);
        }
        if let Some(requested) = self.requested.get_mut(device) {
            requested.force_n = requested.force_n.max(length(record.model.force()));
            requested.torque_nm = requested.torque_nm.max(record.model.torque().map_or(0.0, length));
            requested.applied_n = requested.applied_n.max(record.commanded.force().length());
            requested.applied_nm = requested.applied_nm.max(record.commanded.torque().length());
        }
        if let (0, Some(draft)) = (record.device, &mut self.draft) {
            draft.update(record, &self.requested, &self.measured);
        }
    }
}

/// Data for the summary that the ticks do not contain.
#[derive(Clone)]
struct Facts {
    scene: Scene,
    settings: Settings,
    options: RunOptions,
    plugins: Vec<PluginReport>,
}

impl Prepared {
    /// Creates the observers of the run and the facts for its report.
    fn watched(
        &self,
        stop: &StopSwitch,
        stations: &'static [Station],
    ) -> Result<(ObservedRun<Watchers>, Facts), String> {
        let Self { session, scene, options, settings } = self;
        let plugins = session.plugins().to_vec();
        let description: RunDescription = describe(scene, options, &plugins);
        let recorder = settings.record.as_deref().map(|path| Recorder::create(path, &description));
        let recorder = recorder.transpose().map_err(|error| error.to_string())?;
        let publication = publish(&Directory::of_this_user(), scene, &description, session, stop);
        let facts =
            Facts { scene: scene.clone(), settings: settings.clone(), options: options.clone(), plugins };
        let is_to_file = |path: &PathBuf| path.as_os_str() != "-";
        let is_reported = settings.report.iter().chain(&settings.json).any(is_to_file);
        let watchers = Watchers {
            // The program requests force and torque.
            measured: Measurements::new(recorder, Demand::WRENCH),
            requested: Vec::new(),
            draft: is_reported.then(|| Draft { facts: facts.clone(), stations, written: None }),
        };
        Ok((ObservedRun { observer: watchers, publication: publication.ok() }, facts))
    }

    /// Executes the run on this thread, until it is stopped or the device faults. Not real-time.
    pub(crate) fn run(self, stop: &StopSwitch, stations: &'static [Station]) {
        let (mut watched, facts) = match self.watched(stop, stations) {
            Ok(watched) => watched,
            Err(problem) => return report_line(&problem),
        };
        match self.session.run(&mut watched, stop) {
            Ok(outcome) => {
                if let RunEnd::EmergencyStop(_) = outcome.end {
                    IS_STOPPED.store(true, Ordering::Release);
                }
                facts.report(watched, outcome, stations);
            }
            Err(error) => {
                let _ = watched.observer.measured.recording.finish(&[]);
                report_line(&error.to_string());
            }
        }
    }

    /// Converts to a run that the program advances. Not real-time.
    pub(crate) fn in_lockstep(
        self,
        stop: &StopSwitch,
        stations: &'static [Station],
    ) -> Result<LockstepRun, String> {
        let (watched, facts) = self.watched(stop, stations)?;
        let lockstep = self.session.into_lockstep().map_err(|error: RunError| error.to_string())?;
        Ok(LockstepRun { lockstep, watched, facts, stop: stop.clone() })
    }
}

/// Run that the program's calls advance.
pub(crate) struct LockstepRun {
    lockstep: Lockstep,
    watched: ObservedRun<Watchers>,
    facts: Facts,
    stop: StopSwitch,
}

impl LockstepRun {
    /// Executes one tick; returns true if the run continues. Not real-time.
    pub(crate) fn advance(&mut self) -> bool {
        self.lockstep.advance(&mut self.watched, &self.stop).is_none()
    }

    /// Ends and reports the run. Not real-time.
    pub(crate) fn finish(self, stations: &[Station]) {
        let Self { lockstep, watched, facts, .. } = self;
        let outcome = lockstep.finish();
        facts.report(watched, outcome, stations);
    }
}

impl Facts {
    /// Returns the summary of a run with an outcome, also of one in progress.
    fn summary(&self, outcome: &Outcome, measured: &Measurements) -> RunSummary {
        let facts = measured.facts(&self.scene, &self.options, &self.plugins);
        RunSummary::new(facts, outcome, &measured.tally)
    }

    /// Finishes the recording and writes the requested summaries.
    fn report(self, watched: ObservedRun<Watchers>, outcome: Outcome, stations: &[Station]) {
        let ObservedRun { observer: Watchers { mut measured, requested, .. }, publication } = watched;
        let summary = self.summary(&outcome, &measured);
        let settings = &self.settings;
        let mut lines = lines(stations, &requested);
        lines.extend(end_of(&outcome));
        let notes: Vec<Note> = lines
            .iter()
            .map(|text| Note {
                time_ns: outcome.elapsed_ns,
                severity: Severity::Info,
                source: "flotor".to_owned(),
                text: text.clone(),
            })
            .collect();
        if let Err(error) = measured.recording.finish(&notes) {
            report_line(&error.to_string());
        }
        if let Some(publication) = publication {
            publication.end("the program ended", flotor_live::EndKind::InOrder);
        }
        if let Some(path) = &settings.report {
            let text = format!("{}\n{}\n  {}\n", summary.title, summary.to_text(), lines.join("\n  "));
            if write(path, text) {
                let _ = std::fs::remove_file(so_far(path));
            }
        }
        if let Some(path) = &settings.json {
            write(path, serde_json::to_string_pretty(&summary).unwrap_or_default() + "\n");
            let _ = std::fs::remove_file(so_far(path));
        }
        // Last: the code of a plugin may hang, or end the process.
        if let Err(hung) = outcome.unfreed_plugins.free() {
            report_line(&hung.to_string());
        }
    }
}

/// Formats a quantity with its unit and a number of decimals; in scientific notation from a million.
fn quantity(value: f64, decimals: usize, unit: &str) -> String {
    if value < 1.0e6 { format!("{value:.decimals$} {unit}") } else { format!("{value:.1e} {unit}") }
}

fn lines(stations: &[Station], requested: &[Asked]) -> Vec<String> {
    stations.iter().zip(requested).map(|(station, requested)| line(station, *requested)).collect()
}

/// Formats the line of a station: requested and applied wrench, and counts.
fn line(station: &Station, requested: Asked) -> String {
    let counts = station.counts();
    let mut line = format!(
        "program    `{}` opened {}; {} wrenches; asked for {} and {} at most, the hand got {} and {}",
        station.name(),
        if station.opened() == 1 { "once".to_owned() } else { format!("{} times", station.opened()) },
        counts.commands,
        quantity(requested.force_n, 3, "N"),
        quantity(requested.torque_nm, 4, "N·m"),
        quantity(requested.applied_n, 3, "N"),
        quantity(requested.applied_nm, 4, "N·m")
    );
    if counts.refused > 0 {
        line += &format!("; {} refused, not finite", counts.refused);
    }
    if counts.lapses > 0 {
        line += &format!(
            "; {} expired without a newer wrench, faded for {} ticks",
            counts.lapses, counts.lapsed_ticks
        );
    }
    line
}

/// Formats the cause if the run ended before the program.
fn end_of(outcome: &Outcome) -> Option<String> {
    (!outcome.end.is_in_order()).then(|| format!("the run ended before the program: {}", outcome.end.cause()))
}

/// Writes a result to a file, or to standard error if the path is `-`; reports an error. Returns true if the result was written.
fn write(path: &Path, text: String) -> bool {
    if path.as_os_str() == "-" {
        tell_plainly(text.trim_end());
        return true;
    }
    let written = std::fs::write(path, text);
    if let Err(error) = &written {
        report_line(&format!(
            "cannot write `{}`: {error}; choose a folder where you may write",
            path.display()
        ));
    }
    written.is_ok()
}

/// Returns the path of the intermediate summary, for a program that is killed.
fn so_far(report: &Path) -> PathBuf {
    let mut name = report.as_os_str().to_owned();
    name.push(".so-far");
    PathBuf::from(name)
}

/// Writes a message to the user of the program, on standard error.
pub(crate) fn report_line(problem: &str) {
    tell_plainly(&format!("flotor: {problem}"));
}

/// Reports on standard error that the system has not started a thread; `purpose` is the part of the session without its thread.
pub fn report_no_thread(purpose: &str, cause: &io::Error) {
    report_line(&no_thread(purpose, cause));
}

/// Returns the error of a thread that the system has not started; `purpose` is the part of the session without its thread.
#[must_use]
pub fn no_thread(purpose: &str, cause: &io::Error) -> String {
    format!("cannot start a thread for {purpose}: {cause}; {THREAD_ADVICE}")
}

/// Writes a text to standard error; ignores a closed one.
fn tell_plainly(text: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "{}", escaped(text));
}

#[cfg(test)]
mod tests {
    use super::{no_thread, quantity};
    use std::io;

    #[test]
    fn a_missing_thread_is_reported_with_its_purpose_and_cause() {
        let cause = io::Error::other("no process left");
        let text = no_thread("the run", &cause);
        assert!(text.starts_with("cannot start a thread for the run: no process left; end other"), "{text}");
    }

    #[test]
    fn a_quantity_beyond_any_hand_is_a_power_of_ten() {
        assert_eq!(quantity(8.0, 3, "N"), "8.000 N");
        assert_eq!(quantity(1.7e308, 4, "N·m"), "1.7e308 N·m");
    }
}
