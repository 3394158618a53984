//! A whole run that is saved and restored has the bits of the run that went on, for every shipped model, on the simulated device with
//! its coils and sensors. `host/session/tests/saved.rs` has what else belongs to a run.

use super::snapshot::MODELS;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::TraceDigest;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Lockstep, Observer, RunOptions, Session};
use std::path::Path;

/// Digest of the records, and the largest force, N.
struct Digest(TraceDigest, f64);

impl Observer for Digest {
    fn observe(&mut self, record: &TickRecord) {
        self.0.update(record);
        self.1 = self.1.max(record.commanded.force().length());
    }

    fn demand(&self) -> Demand {
        Demand::ALL
    }
}

fn run(lockstep: &mut Lockstep, ticks: u64) -> (String, f64) {
    let mut digest = Digest(TraceDigest::new(), 0.0);
    lockstep.advance_by(ticks, &mut digest, &StopSwitch::default());
    (digest.0.finish(), digest.1)
}

#[test]
fn a_restored_run_has_the_bits_of_the_run_that_went_on_for_every_shipped_model() {
    for (entry, settings) in MODELS {
        let registry =
            Registry::search(&[]).with_linked(&flotor_simulated::FLOTOR_ENTRY).expect("a shipped plugin");
        let registry = registry.with_linked(entry).expect("a shipped plugin");
        let plugin = flotor_loader::Plugin::in_process(entry).expect("a shipped plugin");
        let id = &plugin.metadata().id;
        let quoted = |value: &str| {
            if value.parse::<f64>().is_ok() { value.to_owned() } else { format!("\"{value}\"") }
        };
        let set: String =
            settings.iter().map(|(key, value)| format!("{key} = {}\n", quoted(value))).collect();
        let text = format!(
            "duration_s = 10\n[device]\nplugin = \"simulated\"\n[device.parameters]\npreset = \"full\"\nhand = \"press\"\n\
             hand_depth_mm = 5\nhand_rise_s = 0.3\n[[model]]\nplugin = \"{id}\"\n[model.parameters]\n{set}"
        );
        let scene = Scene::parse(Path::new("test"), &text).expect("a legal scene");
        let session = Session::prepare(&scene, &registry, &RunOptions { clock: Clock::Virtual, seed: 3 });
        let mut lockstep = session.expect("it starts").into_lockstep().expect("it starts");
        let start = lockstep.save().expect("before the first tick");
        let first = run(&mut lockstep, 260);
        let saved = lockstep.save().expect("a shipped model can be saved");
        let went_on = run(&mut lockstep, 240);
        assert!(went_on.1 > 0.1, "the hand does not touch `{id}`");
        for _ in 0..2 {
            lockstep.restore(&saved).expect("its own state");
            assert_eq!(run(&mut lockstep, 240), went_on, "{id} {settings:?}");
        }
        lockstep.restore(&start).expect("its own state");
        assert_eq!(run(&mut lockstep, 260), first, "{id} {settings:?}");
    }
}
