//! What the laws cost, in instructions: the same on every machine of a kind, however busy it is.
//!
//! Callgrind (valgrind) counts while this test runs itself once more, and cuts its count each time a function begins that
//! is there for nothing else. Bounds are quotients of two counts of one build, and in one case their
//! difference. Without valgrind the test says so and passes.

#[allow(dead_code)] // each test needs its part of the helpers
mod sample;

use std::hint::black_box;
use std::process::Command;

use flotor_hal::glam::DVec3;
use flotor_hal::{Demand as Demanded, Input, Output as Answer};
use flotor_spring::batch::Batch;
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::energy::EnergyForm;
use flotor_spring::hand_over::HandOver;
use flotor_spring::held::HeldSpring;
use flotor_spring::pose::Pose;
use flotor_spring::precision::Precision;
use flotor_spring::preset::Preset;
use flotor_spring::response::Demand;
use flotor_spring::rod::{Accuracy, Coils, Rod};
use flotor_spring::thesis::Thesis;
use sample::{Sampler, Workspace};

/// The environment variable that makes this program a workload.
const WORKLOAD: &str = "FLOTOR_SPRING_WORKLOAD";
/// The workspace of the thesis: a quarter of the free length, seven degrees.
const DEVICE: Workspace = Workspace { shear: 0.25, height: 0.3, tilt_rad: 0.12, yaw_rad: 0.12 };
/// Poses in a block.
const BLOCK: usize = 1024;
/// Blocks of a law: the count of the second, from its beginning to that of the third, has nothing else in it.
const BLOCKS: usize = 3;
/// The laws, in the order in which they run.
const LAWS: [&str; 6] =
    ["printed", "closed-form", "energy", "energy, handing over", "closed-form, batch", "energy, batch"];
/// Ticks of the rod whose counts are compared.
const TICKS: u32 = 400;

fn poses(spring_length_m: f64) -> Vec<Pose> {
    let mut sampler = Sampler::new(3);
    (0..BLOCK).map(|_| DEVICE.pose(&mut sampler, spring_length_m)).collect()
}

/// Smooth, one to three times a second, a tick a millisecond.
fn smooth(tick: u32) -> Pose {
    let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
    let position =
        DVec3::new(0.1 * (2.0 * phase).sin(), 0.1 * (3.0 * phase + 1.0).sin(), -0.2 + 0.15 * phase.cos());
    let rotation_rad =
        DVec3::new(0.1 * (1.5 * phase).sin(), 0.1 * (2.5 * phase + 0.4).cos(), 0.1 * phase.sin());
    Pose::from_rotation_vector(position * Preset::Thesis1.spring().geometry().free_length_m, rotation_rad)
}

/// Where the counter cuts.
#[inline(never)]
fn one_counted_block(work: &mut dyn FnMut()) {
    work();
    black_box(());
}

/// Where the counter cuts.
#[inline(never)]
fn one_counted_tick(rod: &mut Rod, pose: &Pose) {
    black_box(rod.step(pose, Demand::Wrench));
}

/// Blocks of each of [`LAWS`].
fn run_laws() {
    let spring = Preset::Thesis1.spring();
    let (_, _, stiffness) = Preset::Thesis1.parameters();
    let printed = Thesis::new(&spring, stiffness, Precision::Double);
    let closed = ClosedForm::new(&spring, Form::Printed);
    let energy = EnergyForm::new(&spring);
    let mut handing_over = HandOver::new(&spring, Coils::Pass);
    let batch = Batch::new();
    let poses = poses(spring.geometry().free_length_m);
    let input = |pose: &Pose| Input {
        demand: Demanded::WRENCH,
        ..Input::at_rest(flotor_hal::Pose::new(pose.position_m, pose.orientation))
    };
    let inputs: Vec<Input> = poses.iter().map(input).collect();
    let mut answers = vec![Answer::default(); inputs.len()];
    for law in LAWS {
        for _ in 0..BLOCKS {
            let poses = black_box(&poses);
            one_counted_block(&mut || match law {
                "printed" => {
                    poses.iter().for_each(|pose| _ = black_box(printed.respond(pose, Demand::Wrench)));
                }
                "closed-form" => {
                    poses.iter().for_each(|pose| _ = black_box(closed.respond(pose, Demand::Wrench)));
                }
                "energy" => {
                    poses.iter().for_each(|pose| _ = black_box(energy.respond(pose, Demand::Wrench)));
                }
                "energy, handing over" => {
                    poses.iter().for_each(|pose| _ = black_box(handing_over.respond(pose, Demand::Wrench)));
                }
                "closed-form, batch" => batch.respond(&closed, black_box(&inputs), black_box(&mut answers)),
                "energy, batch" => batch.respond(&energy, black_box(&inputs), black_box(&mut answers)),
                other => panic!("no law {other}"),
            });
        }
    }
}

fn run_rod() {
    let mut rod = Rod::new(&Preset::Thesis1.spring(), Accuracy::Servo);
    for tick in 0..200 {
        let _ = rod.step(&smooth(tick.min(1)), Demand::Wrench);
    }
    (1..=TICKS).for_each(|tick| one_counted_tick(&mut rod, &smooth(tick)));
}

/// Not a test by itself: what the counted process runs.
#[test]
fn workload() {
    match std::env::var(WORKLOAD).as_deref() {
        Ok("laws") => run_laws(),
        Ok("rod") => run_rod(),
        Ok(other) => panic!("no workload {other}"),
        Err(_) => {}
    }
}

/// Counts of this program under valgrind, one from each beginning of a function to the next; nothing where there is no
/// valgrind.
fn counts(workload: &str, cut_at: &str) -> Option<Vec<f64>> {
    let folder = tempfile::tempdir().expect("a folder");
    Command::new("valgrind")
        .args(["--tool=callgrind", "--separate-threads=no"])
        .arg(format!("--dump-before=*{cut_at}*"))
        .arg(format!("--callgrind-out-file={}", folder.path().join("count").display()))
        .arg(std::env::current_exe().expect("a running test has a file"))
        .args(["--exact", "workload", "--test-threads=1"])
        .env(WORKLOAD, workload)
        .output()
        .ok()
        .filter(|output| output.status.success())?;
    // count.1 is what comes before the first beginning; what comes after the last is in a file of another name.
    let count = |part: usize| {
        let text = std::fs::read_to_string(folder.path().join(format!("count.{part}"))).ok()?;
        text.lines().find_map(|line| line.strip_prefix("totals: "))?.trim().parse().ok()
    };
    Some((2..).map_while(count).collect())
}

#[test]
fn laws_cost_their_share_of_the_printed_one() {
    let Some(counts) = counts("laws", "one_counted_block") else {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    };
    // The last block has no next one: its count is not among them.
    assert_eq!(counts.len(), LAWS.len() * BLOCKS - 1);
    let per_pose = |law: usize| counts[law * BLOCKS + 1] / BLOCK as f64;
    let [printed, closed, energy, handing_over, closed_batch, energy_batch] = std::array::from_fn(per_pose);
    for (law, name) in LAWS.iter().enumerate() {
        let (count, share) = (per_pose(law), per_pose(law) / printed);
        println!("{name}: {count:.0} instructions a pose, {share:.2} of the printed law's");
    }
    assert!(closed <= 0.6 * printed, "closed-form");
    assert!(energy <= 1.5 * printed, "energy");
    // To look at the length first and find nothing to hand over, with the answer handed on: 43 to 45 counted, and a tenth.
    assert!(handing_over - energy <= 50.0, "handing over where there is nothing to");
    if cfg!(debug_assertions) {
        eprintln!("batches: skipped, a promise of optimised builds; `cargo test --release` checks it");
        return;
    }
    #[cfg(target_arch = "x86_64")]
    if pulp::x86::V3::try_new().is_some() {
        // Four lanes an instruction, less what a single step gains by working on two components at once and what it takes
        // to turn poses over. In time it is more or less of that: `examples/throughput.rs` measures it.
        assert!(closed_batch <= closed / 2.5, "closed-form, batch");
        assert!(energy_batch <= energy / 2.0, "energy, batch");
    }
}

#[test]
fn no_tick_of_the_rod_costs_ten_times_the_mean() {
    let Some(counts) = counts("rod", "one_counted_tick") else {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    };
    assert_eq!(counts.len(), TICKS as usize - 1);
    let mean = counts.iter().sum::<f64>() / counts.len() as f64;
    let worst = counts.iter().copied().fold(0.0, f64::max);
    println!(
        "rod: {mean:.0} instructions a tick, {worst:.0} in the worst of {}, {:.1} times",
        counts.len(),
        worst / mean
    );
    assert!(worst <= 10.0 * mean, "{worst:.0} against {mean:.0}");
}
