//! What the laws cost, in instructions: the same on every machine of a kind, however busy it is.
//!
//! Callgrind (valgrind) counts while this test runs itself once more. The count of a pose is the difference between a
//! long and a short run, so that preparing does not matter. Bounds are quotients of two counts of one build. Without
//! valgrind the test says so and passes.

#[allow(dead_code)] // each test needs its part of the helpers
mod sample;

use std::hint::black_box;
use std::path::Path;
use std::process::{Command, Output};

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
use flotor_spring::response::{Demand, Law};
use flotor_spring::rod::{Accuracy, Coils, Rod};
use flotor_spring::thesis::Thesis;
use sample::{Sampler, Workspace};

/// The environment variable that makes this program a workload: its name, and how many poses.
const WORKLOAD: &str = "FLOTOR_SPRING_WORKLOAD";
/// The workspace of the thesis: a quarter of the free length, seven degrees.
const DEVICE: Workspace = Workspace { shear: 0.25, height: 0.3, tilt_rad: 0.12, yaw_rad: 0.12 };
/// Poses in a block; a workload goes over it again and again.
const BLOCK: usize = 1024;
/// Blocks in a short and in a long run.
const BLOCKS: [u32; 2] = [4, 20];
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

fn one_by_one(blocks: u32, mut respond: impl FnMut(&Pose)) {
    let poses = poses(Preset::Thesis1.spring().geometry().free_length_m);
    for _ in 0..blocks {
        poses.iter().for_each(|pose| respond(black_box(pose)));
    }
}

fn side_by_side<L: Law>(blocks: u32, law: &L, batch: &Batch) {
    let poses = poses(Preset::Thesis1.spring().geometry().free_length_m);
    let input = |pose: &Pose| Input {
        demand: Demanded::WRENCH,
        ..Input::at_rest(flotor_hal::Pose::new(pose.position_m, pose.orientation))
    };
    let inputs: Vec<Input> = poses.iter().map(input).collect();
    let mut answers = vec![Answer::default(); inputs.len()];
    for _ in 0..blocks {
        batch.respond(law, black_box(&inputs), black_box(&mut answers));
    }
}

/// Where the counter cuts.
#[inline(never)]
fn one_counted_tick(rod: &mut Rod, pose: &Pose) {
    black_box(rod.step(pose, Demand::Wrench));
}

/// Not a test by itself: what the counted processes run.
#[test]
fn workload() {
    let Ok(workload) = std::env::var(WORKLOAD) else { return };
    let (name, count) = workload.rsplit_once(' ').expect("a name and a number");
    let count: u32 = count.parse().expect("a number");
    let spring = Preset::Thesis1.spring();
    let (_, _, stiffness) = Preset::Thesis1.parameters();
    let printed = Thesis::new(&spring, stiffness, Precision::Double);
    let closed = ClosedForm::new(&spring, Form::Printed);
    let energy = EnergyForm::new(&spring);
    let mut handing_over = HandOver::new(&spring, Coils::Pass);
    match name {
        "printed" => one_by_one(count, |pose| _ = black_box(printed.respond(pose, Demand::Wrench))),
        "closed-form" => one_by_one(count, |pose| _ = black_box(closed.respond(pose, Demand::Wrench))),
        "energy" => one_by_one(count, |pose| _ = black_box(energy.respond(pose, Demand::Wrench))),
        "energy, handing over" => {
            one_by_one(count, |pose| _ = black_box(handing_over.respond(pose, Demand::Wrench)));
        }
        "closed-form, batch" => side_by_side(count, &closed, &Batch::new()),
        "energy, batch" => side_by_side(count, &energy, &Batch::new()),
        "rod" => {
            let mut rod = Rod::new(&spring, Accuracy::Servo);
            for tick in 0..200 {
                let _ = rod.step(&smooth(tick.min(1)), Demand::Wrench);
            }
            (1..=count).for_each(|tick| one_counted_tick(&mut rod, &smooth(tick)));
        }
        other => panic!("no workload {other}"),
    }
}

/// This program under valgrind; nothing where there is none.
fn counted(workload: &str, arguments: &[&str], folder: &Path) -> Option<Output> {
    Command::new("valgrind")
        .arg("--tool=callgrind")
        .arg(format!("--callgrind-out-file={}", folder.join("count").display()))
        .args(arguments)
        .arg(std::env::current_exe().expect("a running test has a file"))
        .args(["--exact", "workload", "--test-threads=1"])
        .env(WORKLOAD, workload)
        .output()
        .ok()
        .filter(|output| output.status.success())
}

/// Instructions a pose.
fn instructions(name: &str) -> Option<f64> {
    let folder = tempfile::tempdir().expect("a folder");
    let count = |blocks: u32| {
        let output = counted(&format!("{name} {blocks}"), &[], folder.path())?;
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        let total = told.lines().find_map(|line| line.split("Collected : ").nth(1))?;
        total.trim().parse::<f64>().ok()
    };
    let [short, long] = BLOCKS;
    Some((count(long)? - count(short)?) / (f64::from(long - short) * BLOCK as f64))
}

#[test]
fn laws_cost_their_share_of_the_printed_one() {
    let Some(printed) = instructions("printed") else {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    };
    let of = |name: &str| {
        let count = instructions(name).expect("valgrind was there a moment ago");
        println!(
            "{name}: {count:.0} instructions a pose, {:.2} of the printed law's {printed:.0}",
            count / printed
        );
        count
    };
    let (closed, energy, handing_over) = (of("closed-form"), of("energy"), of("energy, handing over"));
    let (closed_batch, energy_batch) = (of("closed-form, batch"), of("energy, batch"));
    assert!(closed <= 0.6 * printed, "closed-form");
    assert!(energy <= 1.5 * printed, "energy");
    // To look at the length first and find nothing to hand over.
    assert!(handing_over <= 1.05 * energy, "handing over where there is nothing to");
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
    let folder = tempfile::tempdir().expect("a folder");
    let cuts = ["--dump-before=*one_counted_tick*", "--separate-threads=no"];
    if counted(&format!("rod {TICKS}"), &cuts, folder.path()).is_none() {
        eprintln!("skipped: there is no valgrind to count instructions with");
        return;
    }
    // count.1 is what comes before the first tick, the last file what comes after the last.
    let count = |tick: u32| {
        let part =
            std::fs::read_to_string(folder.path().join(format!("count.{tick}"))).expect("a part a tick");
        let total = part.lines().find_map(|line| line.strip_prefix("totals: ")).expect("a total");
        total.trim().parse::<f64>().expect("a number")
    };
    let counts: Vec<f64> = (2..=TICKS).map(count).collect();
    let mean = counts.iter().sum::<f64>() / counts.len() as f64;
    let worst = counts.iter().copied().fold(0.0, f64::max);
    println!(
        "rod: {mean:.0} instructions a tick, {worst:.0} in the worst of {}, {:.1} times",
        counts.len(),
        worst / mean
    );
    assert!(worst <= 10.0 * mean, "{worst:.0} against {mean:.0}");
}
