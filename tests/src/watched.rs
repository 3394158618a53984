//! A scene run through the library on the virtual clock, with every tick kept.

use flotor::registry::Registry;
use flotor::scene::Scene;
use flotor::servo::{Clock, StopSwitch};
use flotor::session::{Observer, Outcome, RunOptions, Session};
use flotor::trace::TickRecord;
use std::path::Path;

/// All ticks of a run and what is known after it.
pub struct Watched {
    /// One record a tick, in order.
    pub records: Vec<TickRecord>,
    /// The rest.
    pub outcome: Outcome,
}

/// Keeps every record it sees.
struct Keep(Vec<TickRecord>);

impl Observer for Keep {
    fn observe(&mut self, record: &TickRecord) {
        self.0.push(*record);
    }
}

/// Runs the text of a scene with the plugins built beside the tests.
///
/// # Panics
/// If the scene is wrong or a plugin is refused: such tests have other means.
#[must_use]
pub fn watch(scene: &str) -> Watched {
    watch_on(Clock::Virtual, scene)
}

/// As [`watch`], on a clock.
///
/// # Panics
/// As [`watch`].
#[must_use]
pub fn watch_on(clock: Clock, scene: &str) -> Watched {
    let scene = Scene::parse(Path::new("scene.toml"), scene).expect("the scene is right");
    let options = RunOptions { clock, seed: 1 };
    let session = Session::prepare(&scene, &Registry::search(&[]), &options);
    let session = session.unwrap_or_else(|error| panic!("it does not start: {error}"));
    let mut keep = Keep(Vec::new());
    let outcome = session.run(&mut keep, &StopSwitch::default());
    let outcome = outcome.unwrap_or_else(|error| panic!("it does not run: {error}"));
    Watched { records: keep.0, outcome }
}
