//! A scene run through the library on the virtual clock, with every tick kept.

use crate::library::build_folder;
use flotor_core::Change;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_live::Directory;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, Outcome, RunOptions, Session};
use std::path::Path;

/// All ticks of a run and what is known after it.
pub struct Watched {
    /// One record a tick, in order.
    pub records: Vec<TickRecord>,
    /// Every change of a parameter, with the number of records seen before it.
    pub changes: Vec<(usize, Change)>,
    /// The rest.
    pub outcome: Outcome,
}

/// Keeps everything it sees.
#[derive(Default)]
struct Keep {
    records: Vec<TickRecord>,
    changes: Vec<(usize, Change)>,
}

impl Observer for Keep {
    fn observe(&mut self, record: &TickRecord) {
        self.records.push(*record);
    }

    /// Everything that a record can hold.
    fn demand(&self) -> Demand {
        Demand::ALL
    }

    fn change(&mut self, change: &Change) {
        self.changes.push((self.records.len(), change.clone()));
    }
}

/// Makes the text of a scene ready to run on a clock, with the plugins built beside the tests.
///
/// # Panics
/// If the scene is wrong or a plugin is refused: such tests have other means.
pub fn prepared(clock: Clock, scene: &str) -> Session {
    prepared_with(&Registry::search(&[build_folder().join("deps")]), clock, scene)
}

/// The same with plugins that may have been loaded before: for many runs, which then load none.
fn prepared_with(registry: &Registry, clock: Clock, scene: &str) -> Session {
    seeded(registry, RunOptions { clock, seed: 1 }, scene)
}

fn seeded(registry: &Registry, options: RunOptions, scene: &str) -> Session {
    let scene = Scene::parse(Path::new("scene.toml"), scene).expect("the scene is right");
    let session = Session::prepare(&scene, registry, &options);
    let session = session.unwrap_or_else(|error| panic!("it does not start: {error}"));
    // No folder: an emergency stop of a test stays with its run.
    session.latched_in(&Directory::at("/dev/null/no-folder"))
}

/// Runs the text of a scene on the virtual clock; as [`prepared`].
///
/// # Panics
/// As [`prepared`].
#[must_use]
pub fn watch(scene: &str) -> Watched {
    watch_on(Clock::Virtual, scene)
}

/// The same without the host's ceiling.
///
/// # Panics
/// As [`prepared`].
#[must_use]
pub fn watch_strong(scene: &str) -> Watched {
    keep(prepared(Clock::Virtual, scene).allow_strong())
}

/// The same with a seed of the caller's.
///
/// # Panics
/// As [`prepared`].
#[must_use]
pub fn watch_seed(scene: &str, seed: u64) -> Watched {
    keep(seeded(&Registry::search(&[]), RunOptions { clock: Clock::Virtual, seed }, scene))
}

/// Runs the text of a scene; as [`prepared`].
///
/// # Panics
/// As [`prepared`].
#[must_use]
pub fn watch_on(clock: Clock, scene: &str) -> Watched {
    keep(prepared(clock, scene))
}

/// Runs the text of one of many scenes on the virtual clock; `registry` loads each plugin once for all of them.
///
/// # Panics
/// As [`prepared`].
#[must_use]
pub fn watch_with(registry: &Registry, scene: &str) -> Watched {
    keep(prepared_with(registry, Clock::Virtual, scene))
}

fn keep(session: Session) -> Watched {
    let mut keep = Keep::default();
    let outcome = session.run(&mut keep, &StopSwitch::default());
    let outcome = outcome.unwrap_or_else(|error| panic!("it does not run: {error}"));
    Watched { records: keep.records, changes: keep.changes, outcome }
}
