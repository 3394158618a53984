use super::super::memory::mapped;
use super::*;
use flotor_hal::{Contact, DQuat, DVec3, Demand, LinearField, Pose, Twist};

#[test]
fn input_and_output_cross_bit_for_bit() {
    let Some([memory]) = mapped() else { return };
    let input = Input {
        pose: Pose::new(DVec3::new(1.0, f64::NAN, -0.0), DQuat::from_xyzw(0.1, 0.2, 0.3, 0.4)),
        twist: Twist::new(DVec3::new(5.0, 6.0, 7.0), DVec3::new(8.0, f64::INFINITY, 5.0e-324)),
        time_ns: u64::MAX,
        dt_ns: 11,
        tick: 12,
        buttons: u32::MAX,
        demand: Demand::FORCE.with(Demand::ENERGY),
    };
    memory.put_input(&input);
    assert_eq!(format!("{:?}", memory.input()), format!("{input:?}"));
    let wrench = Wrench { force_n: [1.0, -2.0, 3.0], torque_nm: [4.0, 5.0, -6.0] };
    let output = Output::new(wrench, 7.5, StepStatus::Clamped);
    memory.put_output(&output);
    assert_eq!(memory.output(), output);
}

#[test]
fn extensions_cross_bit_for_bit() {
    let Some([memory]) = mapped() else { return };
    assert_eq!(memory.region(), ActiveRegion::EVERYWHERE, "before anything is said");
    for region in [
        ActiveRegion::EVERYWHERE,
        ActiveRegion::sphere([0.1, -0.2, 0.3], 0.4),
        ActiveRegion::cuboid([0.1, -0.2, 0.3], [1.0, 2.0, 3.0]),
    ] {
        memory.put_region(&region);
        assert_eq!(memory.region(), region);
    }
    for bounds in
        [WorkspaceBounds::UNBOUNDED, WorkspaceBounds::between([-1.0, -2.0, -3.0], [4.0, 5.0, f64::INFINITY])]
    {
        memory.put_bounds(&bounds);
        assert_eq!(memory.bounds(), bounds);
    }
    let mut number = 0.0;
    let stiffness = [[0.0; 6]; 6].map(|row| {
        row.map(|_| {
            number += 0.1;
            number
        })
    });
    let anchor = Pose::new(DVec3::new(1.0, 2.0, 3.0), DQuat::from_xyzw(0.1, 0.2, 0.3, 0.4));
    let wrench = Wrench { force_n: [7.0, 8.0, 9.0], torque_nm: [-1.0, -2.0, -3.0] };
    let field =
        LinearField { anchor, wrench, stiffness, valid_m: 0.5, valid_rad: f64::INFINITY, time_ns: u64::MAX };
    let contact = Contact { normal: [0.6, 0.0, 0.8], gap_m: -0.001, friction: 0.3, ..Contact::default() };
    let set = ContactSet { valid_s: 0.1, time_ns: 5, ..ContactSet::NONE.with(contact).with_field(field) };
    memory.put_contact_set(&set);
    assert_eq!(memory.contact_set(), set);
}

#[test]
fn a_status_no_contract_knows_is_no_answer() {
    let Some([memory]) = mapped() else { return };
    memory.output.iter().for_each(|word| word.store(u64::MAX, Ordering::Relaxed));
    assert!(!memory.output().wrench.is_finite());
}

#[test]
fn words_that_do_not_fit_are_cut() {
    let Some([memory]) = mapped() else { return };
    memory.put_message(&"x".repeat(10_000));
    assert_eq!(memory.message().len(), super::super::memory::MESSAGE_BYTES);
}
