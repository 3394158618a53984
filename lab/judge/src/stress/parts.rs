//! The measures one by one, each in a process of its own: a call that does not return or a model that brings its process
//! down costs one measure, and the score goes on.
//!
//! The process of a measure watches its own calls ([`crate::watch`]) and says at which pose one is stuck. What it found
//! comes back through a file that is its standard input: what a plugin prints goes elsewhere.

use super::measure::{Measure, PoseRecord};
use super::score::{Distributions, StressReport};
use super::{
    Setup, StressOptions, closed_loop, continuity, cost, determinism, energy, part_of, search, stiffness,
    symmetry, totality,
};
use crate::platform::{anonymous_file, end_at_once, ending_signal, standard_input};
use crate::{Progress, watch};
use flotor_hal::abi::loader::{LoadError, Plugin, Setting};
use flotor_session::PluginProcess;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Seek, Write};
use std::process::{Command, Stdio};
use std::time::Duration;

/// What is measured in one go.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// M0.
    Totality,
    /// M1.
    Continuity,
    /// M2, M3 and M5.
    Stiffness,
    /// M4.
    Loops,
    /// M6.
    ClosedLoop,
    /// M7.
    Cost,
    /// M8.
    Determinism,
    /// M9.
    Search,
    /// M10, of a model that declares a symmetry.
    Symmetry,
}

/// Each with its word and its measures.
const PARTS: [(Part, &str, &[[&str; 2]]); 9] = [
    (Part::Totality, "totality", &[["M0", "totality"]]),
    (Part::Continuity, "continuity", &[["M1", "continuity"]]),
    (
        Part::Stiffness,
        "stiffness",
        &[["M2", "Lipschitz constant"], ["M3", "reciprocity"], ["M5", "sampled energy"]],
    ),
    (Part::Loops, "loops", &[["M4", "loop energy"]]),
    (Part::ClosedLoop, "closed-loop", &[["M6", "closed loop"]]),
    (Part::Cost, "cost", &[["M7", "cost of a call"]]),
    (Part::Determinism, "determinism", &[["M8", "determinism"]]),
    (Part::Search, "search", &[["M9", "search"]]),
    (Part::Symmetry, "symmetry", &[["M10", "symmetry"]]),
];

impl Part {
    /// All that these options ask for.
    pub(super) fn all(options: &StressOptions) -> impl Iterator<Item = Self> + use<> {
        let has_symmetry = options.symmetry.is_some();
        let parts = PARTS.into_iter().map(|(part, ..)| part);
        parts.filter(move |part| *part != Self::Symmetry || has_symmetry)
    }

    /// Its word.
    #[must_use]
    pub fn word(self) -> &'static str {
        PARTS.iter().find(|(part, ..)| *part == self).map_or("", |(_, word, _)| word)
    }

    /// The part of a word.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        PARTS.iter().find(|(_, known, _)| *known == word).map(|(part, ..)| *part)
    }

    /// The part with a measure, "M0" to "M10".
    #[must_use]
    pub fn of_measure(id: &str) -> Option<Self> {
        PARTS.iter().find(|(.., names)| names.iter().any(|[known, _]| *known == id)).map(|(part, ..)| *part)
    }

    /// Its measures, none of which came to its end.
    fn broken(self, pose: Option<PoseRecord>, why: &str) -> Found {
        let names = PARTS.iter().find(|(part, ..)| *part == self).map_or(&[][..], |(.., names)| names);
        let measures = names.iter().map(|names| Measure::broken(*names, pose, why)).collect();
        Found { measures, spread: Distributions::default() }
    }
}

/// What a part found.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Found {
    pub(super) measures: Vec<Measure>,
    /// Of these quantities those that the part knows.
    pub(super) spread: Distributions,
}

impl Found {
    fn of(measure: Measure) -> Self {
        Self { measures: vec![measure], ..Self::default() }
    }

    pub(super) fn add(&mut self, later: Self) {
        self.measures.extend(later.measures);
        let Distributions { jumps, gains_n_per_m, loop_energies, calls_ns } = later.spread;
        self.spread.jumps.extend(jumps);
        self.spread.gains_n_per_m.add(gains_n_per_m);
        self.spread.loop_energies.add(loop_energies);
        self.spread.calls_ns.add(calls_ns);
    }
}

/// Measures a part, in this process.
pub(super) fn measure(setup: &Setup<'_>, part: Part) -> Result<Found, LoadError> {
    let none = Distributions::default();
    Ok(match part {
        Part::Totality => Found::of(totality::measure(setup)?),
        Part::Continuity => {
            let (measure, jumps) = continuity::measure(setup)?;
            Found { measures: vec![measure], spread: Distributions { jumps, ..none } }
        }
        Part::Stiffness => {
            let (measures, gains_n_per_m) = stiffness::measure(setup)?;
            Found { measures: measures.into(), spread: Distributions { gains_n_per_m, ..none } }
        }
        Part::Loops => {
            let (measure, loop_energies) = energy::measure_loops(setup)?;
            Found { measures: vec![measure], spread: Distributions { loop_energies, ..none } }
        }
        Part::ClosedLoop => Found::of(closed_loop::measure(setup)?),
        Part::Cost => {
            let (measure, calls_ns) = cost::measure(setup)?;
            Found { measures: vec![measure], spread: Distributions { calls_ns, ..none } }
        }
        Part::Determinism => Found::of(determinism::measure(setup)?),
        Part::Search => Found::of(search::measure(setup)?),
        Part::Symmetry => match setup.options.symmetry {
            Some(symmetry) => Found::of(symmetry::measure(setup, symmetry)?),
            None => Found::default(),
        },
    })
}

/// What the process of a part says at its end.
#[derive(Serialize, Deserialize)]
enum Delivery {
    Found(Found),
    /// A step did not return, at this pose; and which.
    Stuck(PoseRecord, String),
    Refused(String),
}

impl Delivery {
    fn write(&self) -> io::Result<()> {
        standard_input()?.write_all(&serde_json::to_vec(self)?)
    }
}

/// Measures one part in this process, which is there for that alone, and writes what it found into the file that is standard
/// input. A step that takes longer than `limit` of
/// processor time, or waits ten times as long, ends the process. Not real-time.
///
/// # Errors
/// Standard input is no such file, or the system has no thread.
pub fn deliver(
    plugin: &Plugin,
    settings: &[Setting],
    options: &StressOptions,
    part: Part,
    limit: Duration,
    progress: &dyn Progress,
) -> io::Result<()> {
    watch::start(limit, |stuck| {
        // Whether or not that can be told: nothing else ends a call that does not return.
        Delivery::Stuck(PoseRecord::from(stuck.pose), stuck.to_string()).write().ok();
        end_at_once();
    })?;
    let measured = plugin.create_model(settings).and_then(|model| {
        let part_of_full = part_of(options.size, model.memory());
        measure(&Setup { plugin, settings, options: *options, part: part_of_full, progress }, part)
    });
    match measured {
        Ok(found) => Delivery::Found(found),
        Err(refused) => Delivery::Refused(refused.to_string()),
    }
    .write()
}

/// Scores a model with these settings, each part in a process that `program` starts and that [delivers](deliver). Not
/// real-time; takes seconds (short) to minutes (full), on all processors. `only` names the parts; empty: all.
///
/// # Errors
/// [`LoadError`] if the plugin is no model or refuses the settings. A model that breaks while it is measured, hangs or brings
/// its process down is no error: a measure says so and fails.
pub fn score_in_processes(
    plugin: &Plugin,
    settings: &[Setting],
    options: &StressOptions,
    only: &[Part],
    program: impl Fn(Part) -> Command,
) -> Result<StressReport, LoadError> {
    let memory = plugin.create_model(settings)?.memory();
    let (mut found, mut stuck) = (Found::default(), None);
    for part in Part::all(options).filter(|part| only.is_empty() || only.contains(part)) {
        let delivered = in_own_process(program(part));
        found.add(match delivered {
            Ok(Ok(Delivery::Found(found))) => found,
            Ok(Ok(Delivery::Stuck(pose, step))) => {
                let found = part.broken(Some(pose), &step);
                stuck.get_or_insert(step);
                found
            }
            Ok(Ok(Delivery::Refused(why)) | Err(why)) => part.broken(None, &why),
            Err(error) => part.broken(None, &format!("cannot be measured: {error}")),
        });
    }
    let setup =
        Setup { plugin, settings, options: *options, part: part_of(options.size, memory), progress: &() };
    Ok(StressReport { stuck, ..StressReport::new(&setup, found.measures, found.spread) })
}

/// What the process of a part says, or how it ended without a word.
fn in_own_process(mut command: Command) -> io::Result<Result<Delivery, String>> {
    let mut told = anonymous_file("flotor-stress")?;
    let end = PluginProcess::start(command.stdin(told.try_clone()?).stdout(Stdio::null()))?.wait()?;
    let mut text = Vec::new();
    told.rewind()?;
    told.read_to_end(&mut text)?;
    Ok(serde_json::from_slice(&text).map_err(|_| match ending_signal(end) {
        Some(signal) => format!("the process died by signal {signal}"),
        None => format!("the process ended without an answer ({end})"),
    }))
}
