//! Many models and objects in one scene: what is skipped changes no bit, what is mixed is mixed as asked, and what
//! sleeps costs nothing.

use flotor_core::mapping::{Mapping, MappingConfig};
use flotor_core::trace::TickRecord;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Input, LoopConfig, Output, Wrench};
use flotor_loader::{Model, Plugin, Setting};
use flotor_session::scene::Scene;
use flotor_tests::TestSize;
use flotor_tests::watched::watch;
use std::path::Path;

/// The simulated flotor in a hand that moves it up and down some millimetres.
const DEVICE: &str = "duration_s = 3\n[device]\nplugin = \"simulated\"\n";

/// A model of a plugin linked into this test, asked at every tick, near or far.
struct Oracle {
    model: Model,
    mapping: Mapping,
}

impl Oracle {
    fn new(entry: &'static flotor_hal::abi::Entry, settings: &[(&str, &str)], place_m: [f64; 3]) -> Self {
        let plugin = Plugin::in_process(entry).expect("it is a plugin");
        let setting = |(key, value): &(&str, &str)| {
            Setting::parse(plugin.parameters(), key, value).expect("a legal setting")
        };
        let settings: Vec<Setting> = settings.iter().map(setting).collect();
        let mut model = plugin.create_model(&settings).expect("legal settings");
        model.prepare(&LoopConfig { period_ns: 1_000_000, seed: 1 }).expect("it runs at 1 kHz");
        Self { model, mapping: Mapping::new(&MappingConfig::default()).at(place_m) }
    }

    /// What it asks for at a recorded tick, in the device frame.
    fn at(&mut self, record: &TickRecord) -> Wrench {
        let input = Input {
            pose: self.mapping.pose_to_model(&record.pose),
            twist: self.mapping.twist_to_model(&record.twist),
            time_ns: record.time_ns,
            dt_ns: record.dt_ns,
            tick: record.tick,
            buttons: record.buttons,
            demand: Demand::ALL,
        };
        let mut output = Output::default();
        assert_eq!(self.model.step(&input, &mut output), CallStatus::Ok);
        self.mapping.wrench_to_device(&output.wrench)
    }
}

/// The wrench of the models in a record.
fn recorded(record: &TickRecord) -> Wrench {
    record.model.wrench().expect("both were asked for")
}

fn bits(wrench: &Wrench) -> [u64; 6] {
    let ([fx, fy, fz], [tx, ty, tz]) = (wrench.force_n, wrench.torque_nm);
    [fx, fy, fz, tx, ty, tz].map(f64::to_bits)
}

/// Rough balls that overlap, all over where the handle goes.
const BALLS: &str = r#"
[[model]]
plugin = "wall"
name = "ball"
[model.parameters]
shape = "sphere"
size_mm = 1
friction = 0.4
stiffness_n_per_m = 300
[model.mapping]
position_mm = [0.2, -0.1, 0]
grid = { count = [4, 3, 14], spacing_mm = [1.5, 1.4, 1.3] }
"#;

#[test]
fn leaving_out_who_cannot_act_changes_no_bit() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let text = format!("{DEVICE}{BALLS}");
    let scene = Scene::parse(Path::new("balls.toml"), &text).expect("the scene is right");
    let places_m = &scene.models[0].places_m;
    assert_eq!(places_m.len(), 4 * 3 * 14);
    let settings = [("shape", "sphere"), ("size_mm", "1"), ("friction", "0.4"), ("stiffness_n_per_m", "300")];
    let ball = |place_m: &[f64; 3]| Oracle::new(&flotor_wall::FLOTOR_ENTRY, &settings, *place_m);
    let mut balls: Vec<Oracle> = places_m.iter().map(ball).collect();
    let mut touching = 0;
    for record in watch(&text).records {
        let sum = balls.iter_mut().fold(Wrench::ZERO, |sum, ball| sum + ball.at(&record));
        assert_eq!(bits(&sum), bits(&recorded(&record)), "tick {}", record.tick);
        touching += u32::from(sum != Wrench::ZERO);
    }
    assert!(touching > 1000, "the handle is among the balls: {touching} ticks");
}

#[test]
fn ten_thousand_objects_elsewhere_change_no_bit() {
    let spring = "[[model]]\nplugin = \"spring\"\n";
    let elsewhere = BALLS.replace(
        "position_mm = [0.2, -0.1, 0]\ngrid = { count = [4, 3, 14], spacing_mm = [1.5, 1.4, 1.3] }",
        "position_mm = [0, 0, 200]\ngrid = { count = [20, 25, 20], spacing_mm = 3 }",
    );
    assert!(elsewhere != BALLS);
    let (alone, among) =
        (watch(&format!("{DEVICE}{spring}")), watch(&format!("{DEVICE}{spring}{elsewhere}")));
    for (a, b) in alone.records.iter().zip(&among.records) {
        assert_eq!(
            (bits(&recorded(a)), a.pose, a.events),
            (bits(&recorded(b)), b.pose, b.events),
            "tick {}",
            a.tick
        );
    }
}

#[test]
fn objects_may_be_listed_one_by_one() {
    let listed = BALLS.replace(
        "grid = { count = [4, 3, 14], spacing_mm = [1.5, 1.4, 1.3] }",
        "positions_mm = [[0, 0, -3], [0, 0.5, -4], [1, 0, 2.5]]",
    );
    let scene = Scene::parse(Path::new("balls.toml"), &format!("{DEVICE}{listed}")).expect("it is right");
    let places_mm: Vec<[f64; 3]> =
        scene.models[0].places_m.iter().map(|place| place.map(|x| (x * 1.0e6).round() * 1.0e-3)).collect();
    assert_eq!(places_mm, [[0.2, -0.1, -3.0], [0.2, 0.4, -4.0], [1.2, -0.1, 2.5]]);
}

#[test]
fn a_cross_fade_mixes_two_laws_by_weights_that_move_steadily() {
    let scene = format!(
        "{DEVICE}{}{}{}",
        "[[model]]\nplugin = \"spring\"\nname = \"stiff\"\n[model.blend]\nfade_s = 0.5\n",
        "[[model]]\nplugin = \"spring\"\nname = \"soft\"\n[model.parameters]\ngamma_n = 5\n\
         [model.blend]\nfade_s = 0.5\nweight = 0\n",
        "[[change]]\nat_s = 1\nweight = [\"stiff=0\", \"soft=1\"]\n"
    );
    let mut stiff = Oracle::new(&flotor_spring::FLOTOR_ENTRY, &[], [0.0; 3]);
    let mut soft = Oracle::new(&flotor_spring::FLOTOR_ENTRY, &[("gamma_n", "5")], [0.0; 3]);
    for record in watch(&scene).records {
        let part = ((record.time_ns as f64 * 1.0e-9 - 1.0) / 0.5).clamp(0.0, 1.0);
        let expected = stiff.at(&record) * (1.0 - part) + soft.at(&record) * part;
        let off_n = (record.model.force() - expected.force()).length();
        // Weights are computed from whole nanoseconds on both sides: a few roundings of a force of some newtons.
        assert!(off_n < 1.0e-12, "{off_n} N at {} s", record.time_ns as f64 * 1.0e-9);
    }
}

#[test]
fn a_model_that_pushes_silences_those_of_lower_priority_and_gives_way_again() {
    // A ball about the lower half of the way, in the field of a spring.
    let ball = [("shape", "sphere"), ("size_mm", "3"), ("stiffness_n_per_m", "400")];
    let scene = format!(
        "{DEVICE}[[model]]\nplugin = \"spring\"\n[[model]]\nplugin = \"wall\"\n[model.blend]\npriority = 1\n\
         [model.parameters]\nshape = \"sphere\"\nsize_mm = 3\nstiffness_n_per_m = 400\n\
         [model.mapping]\nposition_mm = [0, 0, -1]\n"
    );
    let mut spring = Oracle::new(&flotor_spring::FLOTOR_ENTRY, &[], [0.0; 3]);
    let mut ball = Oracle::new(&flotor_wall::FLOTOR_ENTRY, &ball, [0.0, 0.0, -0.001]);
    let (mut pushing, mut resting) = (0, 1000);
    let (mut silenced, mut alone) = (0, 0);
    for record in watch(&scene).records {
        let (field, push) = (spring.at(&record), ball.at(&record));
        let pushes = push != Wrench::ZERO;
        (pushing, resting) = if pushes { (pushing + 1, 0) } else { (0, resting + 1) };
        // 20 ms after the change of hands at the latest, one of the two is alone.
        if pushing > 21 {
            assert_eq!(record.model.force(), push.force(), "tick {}", record.tick);
            silenced += 1;
        }
        if resting > 21 {
            assert_eq!(record.model.force(), field.force(), "tick {}", record.tick);
            alone += 1;
        }
    }
    assert!(silenced > 100 && alone > 100, "{silenced} and {alone}");
}

#[test]
fn what_is_wrong_with_places_and_mixing_is_said() {
    let complaint = |mapping: &str| {
        let text = format!("{DEVICE}[[model]]\nplugin = \"wall\"\n{mapping}");
        Scene::parse(Path::new("scene.toml"), &text).expect_err("it is wrong").to_string()
    };
    for (wrong, expected) in [
        (
            "[model.mapping]\ngrid = { count = [1.5, 1, 1], spacing_mm = 1 }\n",
            "scene.toml:7: `count` must be a whole number of 1 or more, or three of them",
        ),
        (
            "[model.mapping]\ngrid = { count = 1000, spacing_mm = 1 }\n",
            "scene.toml:7: the grid has more than 1000000 points, the maximum; reduce `count`",
        ),
        (
            "[model.mapping]\npositions_mm = [[0, 0]]\n",
            "scene.toml:7: `model.mapping.positions_mm` must be a list of 1 to 1000000 points, each three numbers from \
             -10000 to 10000",
        ),
        (
            "[model.mapping]\npositions_mm = [[0, 0, 0]]\ngrid = { count = 1, spacing_mm = 1 }\n",
            "scene.toml:7: a model has both `positions_mm` and `grid`; remove one of them",
        ),
        ("[model.blend]\nweight = 2\n", "scene.toml:7: `model.blend.weight` = 2: must be 0 to 1"),
        (
            "[[change]]\nat_s = 1\nweight = \"wall\"\n",
            "scene.toml:8: `change.weight`: `wall` is not MODEL=WEIGHT with a weight from 0 to 1, like spring=0.5",
        ),
    ] {
        assert_eq!(complaint(wrong), expected);
    }
}
