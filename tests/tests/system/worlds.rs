//! Worlds in the whole loop: the weight of a stack, the friction of a drawer, no pull, and a replay to the bit.

use flotor_core::trace::{Events, TickRecord};
use flotor_hal::DVec3;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::watch;

const STACK: &str = include_str!("../../../host/scenes/stack.toml");
const DRAWER: &str = include_str!("../../../host/scenes/drawer.toml");
const GRAVITY_M_PER_S2: f64 = 9.81;

/// Returns a scene with some of its lines exchanged.
fn with(scene: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(scene.to_owned(), |scene, (from, to)| {
        assert!(scene.contains(from), "{from}");
        scene.replace(from, to)
    })
}

fn records(scene: &str) -> Vec<TickRecord> {
    let watched = watch(scene);
    assert!(watched.records.iter().all(|record| !record.events.intersects(Events::MODEL_FAULT)));
    watched.records
}

fn felt_n(record: &TickRecord) -> DVec3 {
    record.commanded.force()
}

#[test]
fn a_stack_at_rest_has_its_weight_within_a_percent_and_never_pulls() {
    let still = with(
        STACK,
        &[("hand_amplitude_mm = 5", "hand_amplitude_mm = 0"), ("duration_s = 4", "duration_s = 10")],
    );
    let weight_n = 0.2 * GRAVITY_M_PER_S2;
    for record in records(&still) {
        let force_n = felt_n(&record);
        // What rests on a hand pushes it down.
        assert!(force_n.z <= 0.0, "tick {}: {force_n}", record.tick);
        if record.tick >= 500 {
            let ratio = -force_n.z / weight_n;
            assert!((ratio - 1.0).abs() < 0.01, "tick {}: {ratio} of the weight", record.tick);
        }
    }
}

#[test]
fn a_stack_that_is_moved_never_pulls_and_takes_the_work_of_its_height() {
    let (mut largest_n, mut count) = (0.0_f64, 0);
    let records = records(STACK);
    for record in &records {
        let force_n = felt_n(record);
        assert!(force_n.z <= 0.0, "tick {}: {force_n}", record.tick);
        largest_n = largest_n.max(force_n.length());
        count += usize::from(force_n.z < -1.0);
    }
    assert!(count > 3_500 && largest_n < 3.0, "{count} ticks with weight, at most {largest_n} N");
    // From its lowest to its highest place the hand puts in m g h.
    let height_m = |record: &TickRecord| record.pose.position().z;
    let (low, high) = (&records[2500], &records[3500]);
    let work_j = high.port_energy_j - low.port_energy_j;
    let gained_j = 0.2 * GRAVITY_M_PER_S2 * (height_m(high) - height_m(low));
    assert!(gained_j > 0.015 && (work_j / gained_j - 1.0).abs() < 0.05, "{work_j} J for {gained_j} J");
}

#[test]
fn a_drawer_rubs_with_its_friction_within_two_percent() {
    let slow = with(
        DRAWER,
        &[("hand_frequency_hz = 0.5", "hand_frequency_hz = 0.1"), ("duration_s = 4", "duration_s = 10")],
    );
    // Against the motion, where the hand is past the play and the drawer not at its stops.
    let sliding: Vec<f64> = records(&slow)
        .windows(2)
        .filter(|pair| pair[0].tick > 5_000 && pair[1].pose.position().z.abs() < 0.003)
        .map(|pair| {
            let way_m = pair[1].pose.position().z - pair[0].pose.position().z;
            -felt_n(&pair[1]).z * way_m.signum()
        })
        .collect();
    assert!(sliding.len() > 300, "{} ticks", sliding.len());
    let mean_n = sliding.iter().sum::<f64>() / sliding.len() as f64;
    assert!((mean_n - 1.0).abs() < 0.02, "{mean_n} N, not 1 N");
}

#[test]
fn a_world_is_replayed_to_the_bit() {
    for scene in ["stack", "drawer"] {
        let scratch = Scratch::default();
        let file = scratch.path().join("run.mcap").display().to_string();
        let run = ["run", scene, "--clock", "virtual", "--seed", "1", "--record", &file];
        assert_eq!(Flotor::with(run).run().code, Some(exit_code::OK), "{scene}");
        let replayed = Flotor::with(["replay", &file]).run();
        assert_eq!(replayed.code, Some(exit_code::OK), "{scene}");
        assert!(replayed.stdout.contains("bit for bit"), "{scene}: {}", replayed.stdout);
    }
}

#[test]
fn a_world_in_the_loop_has_no_force_and_the_run_says_what_to_write() {
    let scratch = Scratch::default();
    let file = scratch.path().join("scene.toml");
    let (in_loop, _) = STACK.split_once("[model.field]").expect("it is asynchronous");
    std::fs::write(&file, in_loop).expect("there is room");
    let file = file.display().to_string();
    let ran = Flotor::with(["run", &file, "--clock", "virtual", "--duration", "0.1s"]).run();
    assert_eq!(ran.code, Some(exit_code::OK));
    assert!(ran.stderr.contains("`[model.field]` with `rate_hz = 250`"), "{}", ran.stderr);
}
