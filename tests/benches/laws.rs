//! What an evaluation costs: every law at every demand, one pose at a time and in batches.
//!
//! The yardstick is the printed law in double (`thesis/f64`). Each measurement runs over the same poses of the
//! thesis's workspace, spring 1; criterion's `thrpt` is poses per second.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use flotor_hal::glam::DQuat;
use flotor_hal::{Input, Output};
use flotor_spring::batch::Batch;
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::energy::EnergyForm;
use flotor_spring::pose::Pose;
use flotor_spring::precision::Precision;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Law, Response};
use flotor_spring::thesis::Thesis;
use flotor_tests::thesis_poses::thesis_pose;

const POSES: usize = 1024;

const DEMANDS: [(&str, Demand); 3] =
    [("force", Demand::Force), ("wrench", Demand::Wrench), ("energy", Demand::WrenchAndEnergy)];

fn poses() -> Vec<Pose> {
    let poses = (0..POSES).map(|index| thesis_pose(index, 0.025));
    poses.map(|(position_m, rotation_rad)| Pose::from_rotation_vector(position_m, rotation_rad)).collect()
}

fn inputs(poses: &[Pose], demand: Demand) -> Vec<Input> {
    let demand = match demand {
        Demand::Force => flotor_hal::Demand::FORCE,
        Demand::Wrench => flotor_hal::Demand::WRENCH,
        Demand::WrenchAndEnergy => flotor_hal::Demand::ALL,
    };
    let at =
        |pose: &Pose| flotor_hal::Pose::new(pose.position_m, DQuat::from_array(pose.orientation.to_array()));
    poses.iter().map(|pose| Input { demand, ..Input::at_rest(at(pose)) }).collect()
}

fn single(criterion: &mut Criterion, name: &str, respond: impl Fn(&Pose) -> Response) {
    let poses = poses();
    let mut group = criterion.benchmark_group("one pose");
    group.throughput(Throughput::Elements(POSES as u64));
    group.bench_function(name, |bencher| {
        bencher.iter(|| {
            for pose in &poses {
                let _ = black_box(respond(black_box(pose)));
            }
        });
    });
}

fn batch<L: Law>(criterion: &mut Criterion, name: &str, law: &L, batch: &Batch, demand: Demand) {
    let inputs = inputs(&poses(), demand);
    let mut outputs = vec![Output::default(); POSES];
    let mut group = criterion.benchmark_group("batch");
    group.throughput(Throughput::Elements(POSES as u64));
    group.bench_function(name, |bencher| {
        bencher.iter(|| batch.respond(law, black_box(&inputs), black_box(&mut outputs)));
    });
}

/// The instruction sets of this machine, by name.
fn batches() -> Vec<(&'static str, Batch)> {
    #[allow(unused_mut)] // other machines than x86-64 have nothing to add
    let mut batches = vec![("best", Batch::default()), ("one-lane", Batch::on(pulp::Arch::Scalar))];
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        batches.push(("avx2", Batch::on(pulp::Arch::V3(avx2))));
    }
    batches
}

fn laws(criterion: &mut Criterion) {
    let spring = Preset::Thesis1.spring();
    let (_, _, stiffness) = Preset::Thesis1.parameters();
    for (name, precision) in [("f64", Precision::Double), ("f32", Precision::Single)] {
        let law = Thesis::new(&spring, stiffness, precision);
        for (demand_name, demand) in &DEMANDS[..2] {
            single(criterion, &format!("thesis/{name}/{demand_name}"), |pose| law.respond(pose, *demand));
        }
    }
    let closed = ClosedForm::new(&spring, Form::Printed);
    let current = ClosedForm::new(&spring, Form::CurrentLength);
    let rounded = closed.with_precision(Precision::Single);
    let energy = EnergyForm::new(&spring);
    for (demand_name, demand) in &DEMANDS[..2] {
        single(criterion, &format!("closed-form/f64/{demand_name}"), |pose| closed.respond(pose, *demand));
        single(criterion, &format!("closed-form/f32/{demand_name}"), |pose| rounded.respond(pose, *demand));
        single(criterion, &format!("current-length/{demand_name}"), |pose| current.respond(pose, *demand));
    }
    for (demand_name, demand) in DEMANDS {
        single(criterion, &format!("energy/{demand_name}"), |pose| energy.respond(pose, demand));
    }
    for (name, instructions) in batches() {
        for (demand_name, demand) in DEMANDS {
            batch(criterion, &format!("energy/{name}/{demand_name}"), &energy, &instructions, demand);
        }
        batch(criterion, &format!("closed-form/{name}/wrench"), &closed, &instructions, Demand::Wrench);
    }
    criterion.bench_function("retune/stiffness", |bencher| {
        bencher.iter(|| black_box(energy.retuned(black_box(&spring), &spring)));
    });
    criterion.bench_function("retune/proportions", |bencher| {
        bencher.iter(|| black_box(EnergyForm::new(black_box(&spring))));
    });
}

criterion_group!(benches, laws);
criterion_main!(benches);
