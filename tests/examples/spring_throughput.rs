//! How many poses a second, one by one and side by side, on one core:
//!
//! ```console
//! $ cargo run --release -p flotor-tests --features measurements --example spring_throughput
//! ```
//!
//! One by one is the fastest way to a wrench that this crate has for a single pose: the very step of the plugin, with the
//! law in the instructions of the machine, called from the loop without a boundary between. Contenders take turns, a
//! slice of a fraction of a millisecond each, and the reported number is the median of the quotients of neighbouring
//! slices: a busy machine slows both.

use std::hint::black_box;
use std::time::Instant;

use flotor_hal::{Demand, Input, Output};
use flotor_spring::batch::Batch;
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::contract::step;
use flotor_spring::energy::EnergyForm;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::Law;
use flotor_tests::thesis_poses::thesis_pose;

/// Poses of a slice: they and their answers stay in the second-level cache.
const POSES: usize = 1024;
const ROUNDS: usize = 2001;

fn inputs(free_length_m: f64) -> Vec<Input> {
    let input = |index: usize| {
        let (position_m, rotation_rad) = thesis_pose(index, free_length_m);
        let pose = Pose::from_rotation_vector(position_m, rotation_rad);
        let pose = flotor_hal::Pose::new(pose.position_m, pose.orientation);
        Input { demand: Demand::WRENCH, ..Input::at_rest(pose) }
    };
    (0..POSES).map(input).collect()
}

/// The instruction sets of this machine, by name.
fn batches() -> Vec<(&'static str, Batch)> {
    let mut batches = vec![("one number at a time", Batch::on(pulp::Arch::Scalar))];
    #[cfg(target_arch = "x86_64")]
    {
        batches.extend(pulp::x86::V3::try_new().map(|avx2| ("AVX2", Batch::on(pulp::Arch::V3(avx2)))));
        batches.extend(pulp::x86::V4::try_new().map(|avx512| ("AVX-512", Batch::on(pulp::Arch::V4(avx512)))));
    }
    #[cfg(not(target_arch = "x86_64"))]
    batches.push(("best", Batch::default()));
    batches
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Nanoseconds a pose of one slice.
fn timed(mut slice: impl FnMut()) -> f64 {
    let begin = Instant::now();
    slice();
    let elapsed_ns = begin.elapsed().as_nanos() as f64;
    elapsed_ns / POSES as f64
}

fn compare<L: Law>(name: &str, law: &L, inputs: &[Input]) {
    let mut outputs = vec![Output::default(); POSES];
    let batches = batches();
    let mut singles = Vec::with_capacity(ROUNDS);
    let mut gains = vec![Vec::with_capacity(ROUNDS); batches.len()];
    let mut times = gains.clone();
    for _ in 0..ROUNDS {
        let single_ns = timed(|| {
            for (input, output) in inputs.iter().zip(&mut outputs) {
                *output = step(law, black_box(input));
            }
        });
        singles.push(single_ns);
        for ((_, batch), (gains, times)) in batches.iter().zip(gains.iter_mut().zip(&mut times)) {
            let batch_ns = timed(|| batch.respond(law, black_box(inputs), black_box(&mut outputs)));
            times.push(batch_ns);
            gains.push(single_ns / batch_ns);
        }
    }
    let fastest = |times: &[f64]| times.iter().copied().fold(f64::INFINITY, f64::min);
    let alone = fastest(&singles);
    println!("{name:<14}{:<24}{:>8.1}{:>8}{alone:>10.1}", "one by one", median(singles), "");
    for ((instructions, _), (gains, times)) in batches.iter().zip(gains.into_iter().zip(times)) {
        let best = fastest(&times);
        println!(
            "{:<14}{instructions:<24}{:>8.1}{:>8.2}{best:>10.1}{:>8.2}",
            "",
            median(times),
            median(gains),
            alone / best
        );
    }
}

fn main() {
    let spring = Preset::Thesis1.spring();
    let inputs = inputs(spring.geometry().free_length_m);
    println!("{:<14}{:<24}{:>16}{:>18}", "", "", "median", "fastest");
    println!("{:<14}{:<24}{:>8}{:>8}{:>10}{:>8}", "law", "instructions", "ns", "gain", "ns", "gain");
    compare("closed-form", &ClosedForm::new(&spring, Form::Printed), &inputs);
    compare("energy", &EnergyForm::new(&spring), &inputs);
}
