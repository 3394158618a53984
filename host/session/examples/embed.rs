//! Embeds Flotor in a program: runs a scene in virtual time, observes every tick, and halves the weight of the spring during the run.
//!
//! `cargo run -p flotor-session --example embed`

use flotor_core::trace::TickRecord;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunOptions, Session};
use std::path::Path;

const SCENE: &str = r#"
title = "A spring, held by a hand"
duration_s = 2

[device]
plugin = "simulated"

[[model]]
plugin = "spring"

[[change]]
at_s = 1.0
weight = "spring=0.5"
"#;

/// Observer of the largest force on the hand, N.
struct Peak(f64);

impl Observer for Peak {
    fn observe(&mut self, record: &TickRecord) {
        self.0 = self.0.max(record.commanded.force().length());
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let scene = Scene::parse(Path::new("embedded scene"), SCENE)?;
    // A program finds plugins beside itself, in the scene's folders and in FLOTOR_PLUGIN_PATH; here they are linked into the program.
    let registry = Registry::search(&[])
        .with_linked(&flotor_simulated::FLOTOR_ENTRY)?
        .with_linked(&flotor_spring::FLOTOR_ENTRY)?;
    let session = Session::prepare(&scene, &registry, &RunOptions { clock: Clock::Virtual, seed: 1 })?;
    let mut peak = Peak(0.0);
    let outcome = session.run(&mut peak, &StopSwitch::default())?;
    println!("{:?} after {} ticks; largest force {:.3} N", outcome.end, outcome.timing.ticks, peak.0);
    Ok(())
}
