//! Measures in separate processes: a call that does not return, or a model that crashes its process, costs one measure,
//! and the score continues.
//!
//! The process of a measure watches its own calls ([`crate::watch`]) and reports the pose of a stuck call. Its result returns
//! through a file on its standard input, apart from the output of the plugin.

use super::measure::{Measure, PoseRecord};
use super::score::{Distributions, StressReport};
use super::{
    Setup, StressOptions, asynchronous, closed_loop, continuity, cost, determinism, energy, part_of, search,
    stiffness, symmetry, totality,
};
use crate::platform::{anonymous_file, end_at_once, ending_signal, standard_input};
use crate::tally::{Merge, tally};
use crate::{Progress, watch};
use flotor_loader::{LoadError, Model, Plugin, Setting};
use flotor_session::PluginProcess;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Seek, Write};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Group of measures that are computed in one process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Measure M0.
    Totality,
    /// Measure M1.
    Continuity,
    /// Measures M2, M3 and M5.
    Stiffness,
    /// Measure M4.
    Loops,
    /// Measure M6.
    ClosedLoop,
    /// Measure M7.
    Cost,
    /// Measure M8.
    Determinism,
    /// Measure M9.
    Search,
    /// Measure M10, if the options name a symmetry.
    Symmetry,
    /// Measure M11, of a model that can run asynchronously.
    Asynchronous,
}

/// Parts with their names and measures.
const PARTS: [(Part, &str, &[[&str; 2]]); 10] = [
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
    (Part::Asynchronous, "asynchronous", &[["M11", "asynchronous"]]),
];

impl Part {
    /// Returns all parts that the options select and that apply to the model.
    pub(super) fn all(options: &StressOptions, model: &Model) -> impl Iterator<Item = Self> + use<> {
        let (has_symmetry, is_asynchronous) = (options.symmetry.is_some(), model.has_local_model());
        PARTS.into_iter().map(|(part, ..)| part).filter(move |part| match part {
            Self::Symmetry => has_symmetry,
            Self::Asynchronous => is_asynchronous,
            _ => true,
        })
    }

    /// Returns the name of the part on the command line.
    #[must_use]
    pub fn word(self) -> &'static str {
        PARTS.iter().find(|(part, ..)| *part == self).map_or("", |(_, word, _)| word)
    }

    /// Finds the part with a name; `None` for an unknown name.
    #[must_use]
    pub fn from_word(word: &str) -> Option<Self> {
        PARTS.iter().find(|(_, known, _)| *known == word).map(|(part, ..)| *part)
    }

    /// Finds the part of a measure, "M0" to "M11"; `None` for an unknown measure.
    #[must_use]
    pub fn of_measure(id: &str) -> Option<Self> {
        PARTS.iter().find(|(.., names)| names.iter().any(|[known, _]| *known == id)).map(|(part, ..)| *part)
    }

    /// Returns the part's measures as failed ones.
    fn broken(self, pose: Option<PoseRecord>, why: &str) -> Found {
        let names = PARTS.iter().find(|(part, ..)| *part == self).map_or(&[][..], |(.., names)| names);
        let measures = names.iter().map(|names| Measure::broken(*names, pose, why)).collect();
        Found { measures, spread: Distributions::default() }
    }
}

tally! {
    /// Results of a part.
    #[derive(Clone, Debug, Serialize, Deserialize)]
    pub(super) struct Found {
        pub(super) measures: Vec<Measure>,
        /// Distributions measured by the part; all other distributions are empty.
        pub(super) spread: Distributions,
    }
}

impl Found {
    fn of(measure: Measure) -> Self {
        Self { measures: vec![measure], ..Self::default() }
    }
}

/// Runs a part in this process.
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
        Part::Asynchronous => Found::of(asynchronous::measure(setup)?),
    })
}

/// Final message of the process of a part.
#[derive(Serialize, Deserialize)]
enum Delivery {
    Found(Found),
    /// Pose and description of a step that did not return.
    Stuck(PoseRecord, String),
    Refused(String),
}

impl Delivery {
    fn write(&self) -> io::Result<()> {
        standard_input()?.write_all(&serde_json::to_vec(self)?)
    }
}

/// Runs one part in this process, which was started for the part, and writes the results into the file on standard input. A
/// step that exceeds `limit` of processor time, or ten times `limit` in waiting, ends the process. Not real-time.
///
/// # Errors
/// If standard input is not a writable file, or no thread can be started.
pub fn deliver(
    plugin: &Plugin,
    settings: &[Setting],
    options: &StressOptions,
    part: Part,
    limit: Duration,
    progress: &dyn Progress,
) -> io::Result<()> {
    watch::start(limit, |stuck| {
        // End the process even if the write fails: nothing else ends a call that does not return.
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

/// Scores a model with the given settings, each part in a separate process. `program` returns the command of a part's
/// process, which must call [`deliver`]. `only` selects parts; empty: all. Not real-time: seconds (short) to minutes
/// (full), on all processors.
///
/// # Errors
/// [`LoadError`] if the plugin is not a model or rejects the settings. A model that fails, hangs or crashes during a
/// measure is not an error: the measure reports it and fails.
pub fn score_in_processes(
    plugin: &Plugin,
    settings: &[Setting],
    options: &StressOptions,
    only: &[Part],
    program: impl Fn(Part) -> Command,
) -> Result<StressReport, LoadError> {
    let model = plugin.create_model(settings)?;
    let (mut found, mut stuck) = (Found::default(), None);
    let parts: Vec<Part> = match only {
        [] => Part::all(options, &model).collect(),
        only => PARTS.into_iter().map(|(part, ..)| part).filter(|part| only.contains(part)).collect(),
    };
    for part in parts {
        let delivered = in_own_process(program(part));
        found.merge(match delivered {
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
    let setup = Setup {
        plugin,
        settings,
        options: *options,
        part: part_of(options.size, model.memory()),
        progress: &(),
    };
    Ok(StressReport { stuck, ..StressReport::new(&setup, found.measures, found.spread) })
}

/// Runs the process of a part and returns its result, or a description of how the process ended without a result.
fn in_own_process(mut command: Command) -> io::Result<Result<Delivery, String>> {
    let mut told = anonymous_file("flotor-stress")?;
    let end = PluginProcess::start(command.stdin(told.try_clone()?).stdout(Stdio::null()))?.wait()?;
    let mut text = Vec::new();
    told.rewind()?;
    told.read_to_end(&mut text)?;
    Ok(serde_json::from_slice(&text).map_err(|_| match ending_signal(end) {
        Some(signal) => format!("the process died by signal {signal}"),
        None => format!("the process ended without a result ({end})"),
    }))
}
