//! A batch is the single steps, faster: same bits, same statuses, whatever the poses, the length, the demands and
//! the instruction set.

use crate::sample::{Sampler, Workspace};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Demand, Input, Output};
use flotor_spring::batch::Batch;
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::energy::EnergyForm;
use flotor_spring::pose::Pose;
use flotor_spring::precision::Precision;
use flotor_spring::preset::Preset;
use flotor_spring::response::{self, Law};
use pulp::Arch;

/// From the device's workspace to plates upside down.
const WORKSPACES: [Workspace; 3] = [
    Workspace { shear: 0.25, height: 0.5, tilt_rad: 0.12, yaw_rad: 0.12 },
    Workspace { shear: 0.8, height: 1.2, tilt_rad: 1.4, yaw_rad: 1.8 },
    Workspace { shear: 4.0, height: 9.0, tilt_rad: 3.0, yaw_rad: 3.0 },
];

/// Every instruction set this machine has.
fn batches() -> Vec<Batch> {
    #[allow(unused_mut)] // other machines than x86-64 have nothing to add
    let mut batches = vec![Batch::default(), Batch::on(Arch::Scalar)];
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        batches.push(Batch::on(Arch::V3(avx2)));
    }
    batches
}

/// Sampled poses, with the named ones, what is no pose and every demand among them.
fn inputs(count: usize, free_length_m: f64) -> Vec<Input> {
    let mut sampler = Sampler::new(count as u64);
    let input = |index: usize, position_m: DVec3, orientation: DQuat| Input {
        demand: [Demand::ALL, Demand::ALL, Demand::WRENCH, Demand::FORCE][index % 4],
        ..Input::at_rest(flotor_hal::Pose::new(position_m, orientation))
    };
    (0..count)
        .map(|index| match index % 16 {
            3 => input(index, DVec3::ZERO, DQuat::IDENTITY),
            5 => input(index, DVec3::new(0.0, 0.0, -free_length_m), DQuat::IDENTITY),
            7 => input(index, DVec3::new(f64::NAN, 0.0, 0.0), DQuat::IDENTITY),
            9 => input(index, DVec3::ZERO, DQuat::from_xyzw(0.0, f64::INFINITY, 0.0, 1.0)),
            11 => input(index, DVec3::new(0.0, 0.0, 1e5 * free_length_m), DQuat::from_rotation_x(3.1)),
            _ => {
                let pose = WORKSPACES[index % 3].pose(&mut sampler, free_length_m);
                input(index, pose.position_m, pose.orientation)
            }
        })
        .collect()
}

fn expected<L: Law>(law: &L, input: &Input) -> (response::Response, [f64; 7]) {
    let pose = Pose { position_m: input.pose.position(), orientation: input.pose.orientation() };
    let demand = if input.demand.contains(Demand::ENERGY) {
        response::Demand::WrenchAndEnergy
    } else if input.demand.contains(Demand::TORQUE) {
        response::Demand::Wrench
    } else {
        response::Demand::Force
    };
    let response = law.respond_at(&pose, demand);
    let (force, torque) = (response.force_n.to_array(), response.torque_nm.to_array());
    let [fx, fy, fz] = force;
    let [tx, ty, tz] = torque;
    (response, [fx, fy, fz, tx, ty, tz, response.energy_j.unwrap_or(f64::NAN)])
}

fn is_single_steps<L: Law>(law: &L, free_length_m: f64) {
    for batch in batches() {
        for count in [0, 1, 2, 7, 63, 64, 65, 1000] {
            let inputs = inputs(count, free_length_m);
            let mut outputs = vec![Output::default(); count];
            batch.respond(law, &inputs, &mut outputs);
            for (input, output) in inputs.iter().zip(&outputs) {
                let (response, numbers) = expected(law, input);
                let wrench = output.wrench;
                let found = [wrench.force_n, wrench.torque_nm].concat();
                for (found, expected) in found.iter().chain([&output.energy_j]).zip(&numbers) {
                    // `==` would let a zero of the other sign pass, and it should: sums may differ in it.
                    let same = found == expected || (found.is_nan() && expected.is_nan());
                    assert!(same, "{batch:?} {input:?}: {found:e} {expected:e}");
                }
                let status = output.status().expect("a status of the contract");
                assert_eq!(format!("{status:?}"), format!("{:?}", response.validity), "{input:?}");
            }
        }
    }
}

#[test]
fn energy_form_has_the_bits_of_single_steps() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        is_single_steps(&EnergyForm::new(&spring), spring.geometry().free_length_m);
    }
}

#[test]
fn closed_forms_have_the_bits_of_single_steps() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        let free_length_m = spring.geometry().free_length_m;
        for form in [Form::Printed, Form::CurrentLength] {
            let law = ClosedForm::new(&spring, form);
            is_single_steps(&law, free_length_m);
            is_single_steps(&law.with_precision(Precision::Single), free_length_m);
        }
    }
}

#[test]
fn surplus_of_either_slice_is_left_alone() {
    let spring = Preset::Thesis1.spring();
    let law = EnergyForm::new(&spring);
    let inputs = inputs(100, spring.geometry().free_length_m);
    let mut outputs = vec![Output::default(); 70];
    Batch::default().respond(&law, &inputs, &mut outputs);
    let mut all = vec![Output::default(); 130];
    Batch::default().respond(&law, &inputs, &mut all);
    assert_eq!(format!("{outputs:?}"), format!("{:?}", &all[..70]));
    assert!(all[100..].iter().all(|output| *output == Output::default()));
}
