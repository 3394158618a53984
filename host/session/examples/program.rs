//! Uses a program as the source of force: this program, not a model, renders a wall, in lockstep with the loop.
//!
//! `cargo run -p flotor-session --example program`

use flotor_core::trace::TickRecord;
use flotor_hal::{DVec3, Wrench};
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunOptions, Session, program};
use std::path::Path;

const SCENE: &str =
    "title = \"A wall drawn by a program\"\nduration_s = 2\n[device]\nplugin = \"simulated\"\n";

/// Observer that ignores all records.
struct Nobody;

impl Observer for Nobody {
    fn observe(&mut self, _record: &TickRecord) {}
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut scene = Scene::parse(Path::new("embedded scene"), SCENE)?;
    // Adds a model to each device; its wrench is the one that the program commands through the port.
    let connected = program::connect(&mut scene);
    let registry = Registry::search(&[]).with_linked(&flotor_simulated::FLOTOR_ENTRY)?;
    let mut session = Session::prepare(&scene, &registry, &RunOptions { clock: Clock::Virtual, seed: 1 })?;
    let tap = session.tap(0);
    let mut run = session.into_lockstep()?;

    let port = &connected[0].port;
    port.enable();
    let mut deepest_m = 0.0_f64;
    while run.advance(&mut Nobody, &StopSwitch::default()).is_none() {
        let Some((_, newest)) = tap.read() else { continue };
        let depth_m = -newest.pose.position().z;
        deepest_m = deepest_m.max(depth_m);
        port.command(&Wrench::from_force(DVec3::Z * 1.0e3 * depth_m.max(0.0)))?;
    }
    let outcome = run.finish();
    println!(
        "{:?} after {} ticks; {:.2} mm into the wall",
        outcome.end,
        outcome.timing.ticks,
        deepest_m * 1.0e3
    );
    Ok(())
}
