//! A model is replaced while the loop runs: faded, recorded, bounded in memory, and nothing jumps.

use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome, ChangeSubject};
use flotor_hal::abi::PluginKind;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::{ControlError, Controls, Observer};
use flotor_tests::TestSize;
use flotor_tests::library::plugin_file;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::{prepared, watch, watch_seed};
use serde_json::Value;

/// A spring on the simulated flotor, held by a hand; the force may change by 3 N in a tick.
const SPRING: &str = "[limits]\nforce_slew_n_per_s = 3000\n[device]\nplugin = \"simulated\"\n\
    [[model]]\nplugin = \"spring\"\n[model.blend]\nfade_s = 0.05\n";

#[test]
fn a_scheduled_replacement_fades_in_without_a_jump_and_is_alone_then() {
    let swapped = watch(&format!(
        "duration_s = 2\n{SPRING}[[change]]\nat_s = 0.5\nswap = \"spring\"\nparameters = {{ gamma_n = 5 }}\n"
    ));
    let plain = watch(&format!("duration_s = 2\n{SPRING}"));
    let [(seen, change)] = swapped.changes.as_slice() else { panic!("{:?}", swapped.changes) };
    assert_eq!((*seen, change.tick, change.subject), (500, 500, ChangeSubject::Plugin));
    assert_eq!((change.plugin.as_str(), change.parameter.as_str()), ("spring", "spring"));
    assert_eq!(change.settings, [("gamma_n".to_owned(), "5".to_owned())]);
    // Until its first tick, at which its weight is still 0, nothing differs.
    let differs = |(a, b): (&TickRecord, &TickRecord)| a.model != b.model;
    assert_eq!(plain.records.iter().zip(&swapped.records).position(differs), Some(501));
    // A step of the law, cut into the 50 ticks of the fade: some newtons over 50, not at once.
    let jumps_n =
        swapped.records.windows(2).map(|pair| (pair[1].model.force() - pair[0].model.force()).length());
    let plain_n =
        plain.records.windows(2).map(|pair| (pair[1].model.force() - pair[0].model.force()).length());
    let largest = |jumps: &mut dyn Iterator<Item = f64>| jumps.fold(0.0_f64, f64::max);
    let (with, without) = (largest(&mut { jumps_n }), largest(&mut { plain_n }));
    let peak_n = plain.records.iter().map(|record| record.model.force().length()).fold(0.0, f64::max);
    assert!(with < without + peak_n / 50.0 * 1.5, "{with} N against {without} N, of {peak_n} N");
}

#[test]
fn a_replacement_while_the_one_before_still_fades_makes_no_jump_either() {
    let swap = |at_s: f64, stiffness: u32| {
        format!(
            "[[change]]\nat_s = {at_s}\nswap = \"wall\"\nparameters = {{ stiffness_n_per_m = {stiffness} }}\n"
        )
    };
    let scene = "duration_s = 2\n[limits]\nforce_slew_n_per_s = 3000\n\
        [device]\nplugin = \"simulated\"\nparameters = { hand = \"press\" }\n\
        [[model]]\nplugin = \"wall\"\nparameters = { stiffness_n_per_m = 1500 }\n[model.blend]\nfade_s = 0.2\n";
    // The second comes a tenth into the fade of the first, and the last one before that is over.
    let scene = [scene.to_owned(), swap(1.0, 0), swap(1.02, 100), swap(1.1, 0)].concat();
    let swapped = watch(&scene);
    assert_eq!(swapped.changes.len(), 3);
    let force_n = |tick: usize| swapped.records[tick].model.force();
    let before_n = force_n(999).length();
    assert!(before_n > 2.0, "the hand leans on the wall: {before_n} N");
    let largest_n = (1000..2000).map(|tick| (force_n(tick) - force_n(tick - 1)).length()).fold(0.0, f64::max);
    // Over 200 ticks that is 0.02 N a tick; beside it the hand moves.
    assert!(largest_n < 0.3, "{largest_n} N in a tick");
    // Nothing of those that have gone is left.
    assert_eq!(force_n(1301).length(), 0.0);
}

#[test]
fn who_misbehaves_is_named_and_not_who_comes_after() {
    let scratch = Scratch::default();
    let [faulty, spring] =
        ["fixture-faulty-model", "flotor-spring"].map(|name| plugin_file(name).display().to_string());
    let faults = "parameters = { fault = \"nan\" }\n";
    let swap = |at_s: f64, plugin: &str, parameters: &str| {
        format!("[[change]]\nat_s = {at_s}\nswap = \"model\"\nplugin = {plugin:?}\n{parameters}")
    };
    let scene = |first: &str, swaps: &[String]| {
        format!(
            "duration_s = 1\n[device]\nplugin = \"simulated\"\n[[model]]\nname = \"model\"\nplugin = {first:?}\n{}{}",
            if first == faulty { faults } else { "" },
            swaps.concat()
        )
    };
    let scenes = [
        scene(&spring, &[swap(0.2, &faulty, faults), swap(0.5, &spring, "")]),
        scene(&spring, &[swap(0.2, &faulty, faults)]),
        scene(&faulty, &[swap(0.2, &spring, "")]),
    ];
    for text in scenes {
        let file = scratch.file("scene.toml", &text).display().to_string();
        let ran = Flotor::with(["run", &file, "--clock", "virtual"]).run();
        assert_eq!(ran.code, Some(exit_code::PLUGIN_REFUSED), "{text}{ran:?}");
        assert!(ran.error().starts_with(&format!("{faulty}: `model` ")), "{text}{ran:?}");
    }
    // And nobody where nobody did.
    let good = scene(&spring, &[swap(0.2, &spring, "")]);
    let file = scratch.file("scene.toml", good).display().to_string();
    let ran = Flotor::with(["run", &file, "--clock", "virtual"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
}

#[test]
fn a_recording_with_replacements_replays_bit_for_bit() {
    let scratch = Scratch::default();
    let recording = scratch.path().join("run.mcap").display().to_string();
    let changes = "[[change]]\nat_s = 0.4\nswap = \"spring\"\nplugin = \"wall\"\n\
        [change.parameters]\nstiffness_n_per_m = 400\n\
        [[change]]\nat_s = 0.9\nset = \"spring.friction=0.3\"\n\
        [[change]]\nat_s = 1.2\nswap = \"spring\"\n\
        [[change]]\nat_s = 1.21\nswap = \"spring\"\nplugin = \"wall\"\n";
    let scene =
        scratch.file("scene.toml", format!("duration_s = 2\n{SPRING}{changes}")).display().to_string();
    let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--record", &recording]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let ran = Flotor::with(["replay", &recording, "--json", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
    let report: Value = serde_json::from_str(&ran.stdout).expect("the summary is JSON");
    assert_eq!(report["bit_exact"], Value::from(true), "{report}");
}

#[test]
fn the_summary_names_the_model_in_force_at_the_end_but_not_one_that_the_seed_chose() {
    let scratch = Scratch::default();
    let told = |by: &str| {
        let text = format!("duration_s = 0.5\n{SPRING}[[change]]\nat_s = 0.2\nswap = \"spring\"\n{by}\n");
        let scene = scratch.file("scene.toml", text).display().to_string();
        let [text, json] = [&[][..], &["--json"]].map(|more| {
            let ran = Flotor::with([&["run", &scene, "--clock", "virtual"], more].concat()).run();
            assert_eq!(ran.code, Some(exit_code::OK), "{ran:?}");
            ran.stdout
        });
        (text, serde_json::from_str::<Value>(&json).expect("the summary is JSON"))
    };
    let (text, json) = told("plugin = \"wall\"");
    let line = text.lines().find(|line| line.ends_with("in place of `spring` at the end")).expect(&text);
    assert!(line.starts_with("  model      wall "), "{line}");
    assert_eq!(
        (&json["plugins"][1]["id"], &json["replacements"][0]["id"]),
        (&"spring".into(), &"wall".into())
    );

    let (text, json) = told(
        "either = [{ plugin = \"wall\" }, { plugin = \"wall\", parameters = { damping_ns_per_m = 1 } }]",
    );
    assert!(!text.contains("in place of"), "{text}");
    assert_eq!(json.get("replacements"), None);
}

#[test]
fn the_seed_chooses_one_of_several_and_a_pair_of_seeds_gets_each() {
    let alternatives =
        ["parameters = { gamma_n = 5 }", "plugin = \"wall\", parameters = { stiffness_n_per_m = 300 }"];
    let scene =
        |by: &str| format!("duration_s = 0.5\n{SPRING}[[change]]\nat_s = 0.2\nswap = \"spring\"\n{by}\n");
    let [first, second] = alternatives;
    let either = scene(&format!("either = [{{ {first} }}, {{ {second} }}]"));
    let alone = alternatives.map(|by| watch(&scene(&by.replace(", parameters", "\nparameters"))).records);
    let forces = |records: &[TickRecord]| records.iter().map(|record| record.model).collect::<Vec<_>>();
    let alone = alone.map(|records| forces(&records));
    assert_ne!(alone[0], alone[1]);
    for pair in 0..4 {
        let mut got = [2 * pair, 2 * pair + 1].map(|seed| {
            let felt = forces(&watch_seed(&either, seed).records);
            alone.iter().position(|alone| *alone == felt).expect("one of the two, and nothing else")
        });
        assert_eq!(
            forces(&watch_seed(&either, 2 * pair).records),
            alone[got[0]],
            "the same seed, the same one"
        );
        got.sort_unstable();
        assert_eq!(got, [0, 1], "seeds {} and {}", 2 * pair, 2 * pair + 1);
    }
}

/// A later change for one of several alternatives is no mistake for the seeds that got another.
#[test]
fn a_change_that_one_alternative_understands_is_for_the_seeds_that_got_it() {
    let scene = |set: &str| {
        format!(
            "duration_s = 0.4\n{SPRING}[[change]]\nat_s = 0.1\nswap = \"spring\"\n\
             either = [{{ parameters = {{ gamma_n = 5 }} }}, {{ plugin = \"wall\" }}]\n\
             [[change]]\nat_s = 0.2\nset = \"{set}\"\n"
        )
    };
    for (set, parameter) in [("spring.gamma_n=9", "gamma_n"), ("spring.friction=0.2", "friction")] {
        let told = |seed| watch_seed(&scene(set), seed).changes;
        let is_it = |(_, change): &(usize, Change)| change.parameter == parameter;
        let got: Vec<usize> =
            (0..2).map(|seed| told(seed).iter().filter(|told| is_it(told)).count()).collect();
        assert!(got == [0, 1] || got == [1, 0], "{set}: {got:?}");
    }
    let scratch = Scratch::default();
    for set in ["spring.gama_n=9", "ball.friction=0.2"] {
        let file = scratch.file("scene.toml", scene(set)).display().to_string();
        for seed in ["0", "1"] {
            let ran = Flotor::with(["run", &file, "--clock", "virtual", "--seed", seed]).run();
            assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{set}: {ran:?}");
        }
    }
}

#[test]
fn what_is_wrong_with_an_alternative_is_said_whatever_the_seed() {
    let scratch = Scratch::default();
    let text = format!(
        "duration_s = 0.1\n{SPRING}[[change]]\nat_s = 0.05\nswap = \"spring\"\n\
         either = [{{}}, {{ parameters = {{ gama_n = 5 }} }}]\n"
    );
    let scene = scratch.file("scene.toml", text).display().to_string();
    for seed in ["0", "1"] {
        let ran = Flotor::with(["run", &scene, "--clock", "virtual", "--seed", seed]).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:?}");
        assert!(ran.error().contains("did you mean `gamma_n`?"), "{ran:?}");
    }
}

/// Replaces the spring as often as the loop lets it.
struct Swapper<'a> {
    controls: Controls,
    registry: &'a Registry,
    applied: Vec<u64>,
    refused_as_busy: u64,
    last: Option<TickRecord>,
    largest_step_n: f64,
    swap_ns: Vec<u64>,
    other_ns: Vec<u64>,
}

impl Observer for Swapper<'_> {
    fn observe(&mut self, record: &TickRecord) {
        if let Some(last) = &self.last {
            let step_n = (record.commanded.force() - last.commanded.force()).length();
            self.largest_step_n = self.largest_step_n.max(step_n);
        }
        self.last = Some(*record);
        let replaced = record.events.intersects(Events::PARAMETER_CHANGED);
        if replaced { &mut self.swap_ns } else { &mut self.other_ns }.push(record.compute_ns);
        if record.tick.is_multiple_of(100) {
            let plugin = if record.tick.is_multiple_of(200) { None } else { Some("wall") };
            match self.controls.swap(self.registry, "spring", plugin, &[]) {
                Ok(()) => {}
                Err(ControlError::Busy) => self.refused_as_busy += 1,
                Err(error) => panic!("{error}"),
            }
        }
    }

    fn change(&mut self, change: &Change) {
        assert_eq!((change.subject, change.outcome), (ChangeSubject::Plugin, ChangeOutcome::Applied));
        self.applied.push(change.tick);
    }
}

#[test]
fn a_thousand_replacements_under_load_leave_no_step_and_no_memory_behind() {
    let seconds = TestSize::of_this_run().pick(100, 1100);
    let session = prepared(Clock::Virtual, &format!("duration_s = {seconds}\n{SPRING}"));
    let registry = Registry::search(&[]);
    let controls = session.controls();
    let mut swapper = Swapper {
        controls,
        registry: &registry,
        applied: Vec::new(),
        refused_as_busy: 0,
        last: None,
        largest_step_n: 0.0,
        swap_ns: Vec::new(),
        other_ns: Vec::new(),
    };
    assert!(session.run(&mut swapper, &StopSwitch::default()).is_ok());
    let swaps = swapper.applied.len();
    assert!(swaps >= TestSize::of_this_run().pick(90, 1000), "{swaps} replacements");
    assert!(swapper.refused_as_busy > 0, "at most one of a model is on its way");
    // 3000 N/s for 1 ms, and the rounding of a length.
    assert!(swapper.largest_step_n <= 3.0 * (1.0 + 1.0e-12), "{} N", swapper.largest_step_n);
    let median = |ticks: &mut Vec<u64>| {
        ticks.sort_unstable();
        ticks[ticks.len() / 2]
    };
    let (with, without) = (median(&mut swapper.swap_ns), median(&mut swapper.other_ns));
    println!("{swaps} replacements; a tick with one takes {with} ns, another {without} ns");
}

#[test]
fn after_a_replacement_changes_are_for_the_new_model() {
    struct Once<'a>(Controls, &'a Registry, Vec<Change>);
    impl Observer for Once<'_> {
        fn observe(&mut self, record: &TickRecord) {
            let Self(controls, registry, _) = self;
            if record.tick == 10 {
                controls.swap(registry, "spring", Some("wall"), &[("friction", "0.1")]).expect("it is right");
                controls.set_parameter("spring", "friction", "0.5").expect("the wall has friction");
                let error = controls.set_parameter("spring", "gamma_n", "9").expect_err("the wall has none");
                assert!(error.to_string().starts_with("[spring] no parameter `gamma_n`"), "{error}");
                let busy = controls.swap(registry, "spring", None, &[]);
                assert_eq!(busy, Err(ControlError::Busy));
            }
        }
        fn change(&mut self, change: &Change) {
            self.2.push(change.clone());
        }
    }
    let registry = Registry::search(&[]);
    let session = prepared(Clock::Virtual, &format!("duration_s = 3\n{SPRING}"));
    let mut once = Once(session.controls(), &registry, Vec::new());
    assert!(session.run(&mut once, &StopSwitch::default()).is_ok());
    let [replaced, set, ..] = once.2.as_slice() else { panic!("{:?}", once.2) };
    assert_eq!((replaced.subject, replaced.parameter.as_str()), (ChangeSubject::Plugin, "wall"));
    assert_eq!((set.parameter.as_str(), set.outcome), ("friction", ChangeOutcome::Applied));
    assert_eq!(replaced.tick, set.tick, "in one tick, in order");
    assert_eq!(once.2.last().map(|change| change.number), Some(0.5), "from the value of the new model on");
}

#[test]
fn an_unchanged_file_keeps_its_one_mapping_and_a_rebuilt_one_is_another_plugin() {
    let scratch = Scratch::default();
    let registry = Registry::search(&[]);
    let mut bytes = std::fs::read(plugin_file("flotor-wall")).expect("it is built");
    let file = scratch.file("libmine.so", &bytes);
    let path = file.display().to_string();
    // The schema is a static of the library: one address, one mapping.
    let schema = || registry.load(&path, PluginKind::Model).expect("a plugin").parameters().as_ptr();
    let first = schema();
    assert_eq!(schema(), first);
    bytes.push(0);
    std::fs::write(&file, &bytes).expect("a scratch file");
    let rebuilt = schema();
    assert_ne!(rebuilt, first);
    assert_eq!(schema(), rebuilt);
}

#[test]
fn a_plugin_that_is_refused_changes_nothing() {
    let scratch = Scratch::default();
    let registry = Registry::search(&[]);
    let session = prepared(Clock::Virtual, &format!("duration_s = 1\n{SPRING}"));
    let controls = session.controls();
    let path = scratch.file("libmine.so", b"not a plugin").display().to_string();
    let refused = controls.swap(&registry, "spring", Some(&path), &[]).expect_err("it is no plugin");
    assert!(refused.to_string().starts_with("[spring] model unchanged: "), "{refused}");
    assert!(refused.to_string().contains("libmine.so"), "{refused}");
    let unknown = controls.swap(&registry, "sprng", None, &[]).expect_err("no such model");
    assert!(unknown.to_string().contains("did you mean `spring`?"), "{unknown}");
}
