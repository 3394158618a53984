//! Sets that are refused, and the place that the error names.

mod common;

use common::floor;
use flotor_contact::{
    Contact, ContactSet, ContactSetError, Coupling, Fault, Limits, Replacement, Solver, Validity,
};
use flotor_hal::Pose;
use flotor_hal::glam::DVec3;

/// Error of a set whose second contact is changed.
fn refusal(change: impl Fn(&mut Contact)) -> (usize, &'static str, Fault) {
    let mut contacts = [floor(0.0); 3];
    change(&mut contacts[1]);
    match ContactSet::new(&Pose::HOME, &contacts, Validity::UNLIMITED) {
        Err(ContactSetError::Contact { index, field, fault }) => (index, field, fault),
        other => panic!("{other:?}"),
    }
}

#[test]
fn an_error_names_contact_and_field() {
    type Change = fn(&mut Contact, f64);
    let fields: [(&str, Change); 9] = [
        ("tool_point_m", |contact, number| contact.tool_point_m.y = number),
        ("surface_point_m", |contact, number| contact.surface_point_m.z = number),
        ("normal", |contact, number| contact.normal.x = number),
        ("gap_m", |contact, number| contact.gap_m = number),
        ("surface_velocity_m_per_s", |contact, number| contact.surface_velocity_m_per_s.z = number),
        ("stiffness_n_per_m", |contact, number| contact.stiffness_n_per_m = number),
        ("tangential_stiffness_n_per_m", |contact, number| contact.tangential_stiffness_n_per_m = number),
        ("damping_ns_per_m", |contact, number| contact.damping_ns_per_m = number),
        ("friction", |contact, number| contact.friction = number),
    ];
    for (field, change) in fields {
        for number in [f64::NAN, f64::INFINITY, -1.0e300] {
            assert_eq!(refusal(|contact| change(contact, number)), (1, field, Fault::NotFinite), "{number}");
        }
    }
    for (field, change) in &fields[6..] {
        assert_eq!(refusal(|contact| change(contact, -1.0)), (1, *field, Fault::TooSmall));
    }
    assert_eq!(refusal(|contact| contact.stiffness_n_per_m = 0.0), (1, "stiffness_n_per_m", Fault::TooSmall));
    assert_eq!(refusal(|contact| contact.normal = DVec3::Z * 1.01), (1, "normal", Fault::NotUnit));
    assert_eq!(refusal(|contact| contact.gap_m = 1.0e-5), (1, "gap_m", Fault::Inconsistent));
    // Numbers of single precision are consistent.
    let close = Contact { gap_m: 2.0e-7, normal: DVec3::Z * (1.0 + 3.0e-7), ..floor(0.0) };
    assert!(ContactSet::new(&Pose::HOME, &[close], Validity::UNLIMITED).is_ok());
}

#[test]
fn an_error_prints_place_cause_and_remedy() {
    let contacts = [floor(0.0), Contact { gap_m: f64::NAN, ..floor(0.0) }];
    let error = ContactSet::new(&Pose::HOME, &contacts, Validity::UNLIMITED).expect_err("a gap is NaN");
    assert_eq!(error.to_string(), "contact 1: `gap_m` is not finite, or larger than 1e9");
    let error = ContactSet::new(&Pose::HOME, &[floor(0.0); 17], Validity::UNLIMITED).expect_err("too many");
    assert_eq!(error.to_string(), "the set has 17 contacts, above the limit of 16; send the deepest ones");
    let nowhere = Pose { orientation_xyzw: [0.0; 4], ..Pose::HOME };
    let error = ContactSet::new(&nowhere, &[], Validity::UNLIMITED).expect_err("no orientation");
    assert_eq!(error, ContactSetError::Anchor);
    let never = Validity { duration_s: f64::NAN, ..Validity::UNLIMITED };
    assert_eq!(ContactSet::new(&Pose::HOME, &[], never).expect_err("no time"), ContactSetError::Validity);
}

#[test]
fn settings_have_to_be_above_zero() {
    for number in [0.0, -1.0, f64::NAN] {
        assert_eq!(Coupling::new(1.0, number).expect_err("wrong").field, "stiffness_nm_per_rad");
        assert_eq!(Limits::new(number, 1.0).expect_err("wrong").to_string(), "`force_n` is not above 0");
        assert_eq!(Limits::new(1.0, number).is_ok(), number == 0.0, "no torque, or a limit above 0");
        let limits = Limits::new(1.0, 1.0).expect("above 0");
        assert!(Solver::new(Coupling::RIGID, limits, Replacement::Immediate, number).is_err());
    }
}
