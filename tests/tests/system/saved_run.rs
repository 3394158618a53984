//! A run that is saved and restored has the bits of the run that went on, for every shipped model, on the simulated device with its
//! coils and sensors; what cannot be saved says why.

use super::snapshot::MODELS;
use flotor_core::trace::TickRecord;
use flotor_hal::Demand;
use flotor_record::TraceDigest;
use flotor_servo::{Clock, RunEnd, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Lockstep, NewValue, Observer, RunError, RunOptions, Session};
use std::path::Path;

const ONE: &str = "duration_s = 1\n[device]\nplugin = \"simulated\"\n[device.parameters]\npreset = \"full\"\nhand = \"press\"\n\
                   [[model]]\nname = \"coil\"\nplugin = \"spring\"\nblend = { fade_s = 0.05 }\n";

/// A coupling with a delay, models of two priorities, and a change that the scene schedules.
const TWO: &str = "duration_s = 1\n[[device]]\nname = \"left\"\nplugin = \"simulated\"\n[[device]]\nname = \"right\"\nplugin = \"simulated\"\n[device.parameters]\nhand = \"open\"\n\
                   [[coupling]]\nname = \"rod\"\nend = [{ device = \"left\" }, { device = \"right\" }]\ndelay_ticks = 3\n\
                   [[model]]\nname = \"coil\"\nplugin = \"spring\"\ndevice = \"left\"\nblend = { priority = 1 }\n\
                   [[model]]\nname = \"other\"\nplugin = \"spring\"\ndevice = \"left\"\nmapping = { position_mm = [0, 0, 2] }\n\
                   [[change]]\nat_s = 0.3\nset = \"coil.gamma_n=20\"\n";

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

fn registry() -> Registry {
    let registry = Registry::search(&[]).with_linked(&flotor_simulated::FLOTOR_ENTRY).expect("it is new");
    registry.with_linked(&flotor_spring::FLOTOR_ENTRY).expect("it is new")
}

fn session(text: &str) -> Session {
    let scene = Scene::parse(Path::new("test"), text).expect("a legal scene");
    Session::prepare(&scene, &registry(), &RunOptions { clock: Clock::Virtual, seed: 5 }).expect("it starts")
}

fn digest(lockstep: &mut Lockstep, ticks: u64) -> String {
    run(lockstep, ticks).0
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

fn unsaved(result: Result<impl Sized, RunError>) -> String {
    match result {
        Err(RunError::Unsaved(why)) => why,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("it is saved"),
    }
}

#[test]
fn a_restored_run_has_the_bits_of_the_run_that_went_on() {
    for text in [ONE, TWO] {
        let mut run = session(text).into_lockstep().expect("it starts");
        for before in [0, 70, 180, 150] {
            digest(&mut run, before);
            let saved = run.save().expect("all of it can be saved");
            let went_on = digest(&mut run, 120);
            for _ in 0..2 {
                run.restore(&saved).expect("its own state");
                assert_eq!(digest(&mut run, 120), went_on, "{before}\n{text}");
            }
            run.restore(&saved).expect("its own state");
        }
    }
}

#[test]
fn a_restore_takes_back_parameters_their_movement_and_weights() {
    let session = session(ONE);
    let controls = session.controls();
    let set = |value| NewValue { plugin: "coil", parameter: "gamma_n", value };
    let mut run = session.into_lockstep().expect("it starts");
    digest(&mut run, 200);
    controls.set_parameters(&[set("30")]).expect("it is live"); // moves over many ticks
    controls.set_weight("coil", 0.5).expect("a model");
    digest(&mut run, 10);
    let saved = run.save().expect("a movement can be saved");
    let went_on = digest(&mut run, 200);
    controls.set_parameters_at_once(&[set("12")]).expect("it is live");
    controls.set_weight("coil", 0.0).expect("a model");
    digest(&mut run, 100);
    controls.set_weight("coil", 1.0).expect("sent, and not applied before the restore");
    run.restore(&saved).expect("its own state");
    assert_eq!(digest(&mut run, 200), went_on);
}

#[test]
fn a_run_whose_duration_is_over_can_be_restored_and_a_stopped_one_not() {
    let mut run = session(ONE).into_lockstep().expect("it starts");
    let start = run.save().expect("before the first tick");
    let whole = digest(&mut run, 2_000);
    assert_eq!(
        run.advance(&mut Digest(TraceDigest::new(), 0.0), &StopSwitch::default()),
        Some(RunEnd::Finished)
    );
    run.restore(&start).expect("its own state");
    assert_eq!(digest(&mut run, 2_000), whole);
    assert_eq!(run.finish().timing.ticks, 2_000, "both runs count");

    let (mut run, stop) = (session(ONE).into_lockstep().expect("it starts"), StopSwitch::default());
    let start = run.save().expect("before the first tick");
    stop.stop();
    assert_eq!(run.advance_by(500, &mut Digest(TraceDigest::new(), 0.0), &stop), Some(RunEnd::Stopped));
    assert!(unsaved(run.restore(&start)).contains("it has ended"));
}

#[test]
fn what_cannot_be_saved_says_why() {
    let session_of_both = session(ONE);
    let controls = session_of_both.controls();
    let mut run = session_of_both.into_lockstep().expect("it starts");
    let before = run.save().expect("all of it can be saved");
    let mut other = session(ONE).into_lockstep().expect("it starts");
    assert!(unsaved(other.restore(&before)).contains("another run has saved it"));

    controls.swap(&registry(), "coil", None, &[]).expect("it is a model");
    digest(&mut run, 10);
    assert!(unsaved(run.save()).contains("a replacement of `coil` is fading in"));
    digest(&mut run, 100);
    run.save().expect("the fade is over");
    assert!(unsaved(run.restore(&before)).contains("`coil` was replaced"));
}
