use super::*;
use flotor_hal::{DQuat, DVec3, Input};

const MS: u64 = 1_000_000;

fn field(force_n: f64, stiffness_n_per_m: f64) -> LinearField {
    let slope = [DVec3::ZERO, DVec3::ZERO, DVec3::NEG_Z * stiffness_n_per_m];
    LinearField::of_force(&Input::at_rest(Pose::HOME), DVec3::Z * force_n, slope, 0.01)
}

fn up(z_m: f64) -> Pose {
    Pose::new(DVec3::Z * z_m, DQuat::IDENTITY)
}

#[test]
fn a_field_comes_in_evenly_and_is_alone_then() {
    let mut fade = CrossFade::new(4 * MS);
    fade.take(field(2.0, 0.0), &Pose::HOME, 10 * MS);
    for (ms, expected) in [(10, 0.0), (11, 0.5), (12, 1.0), (14, 2.0), (90, 2.0)] {
        let (wrench, _) = fade.at(&Pose::HOME, ms * MS);
        assert!((wrench.force().z - expected).abs() < 1.0e-12, "{ms} ms: {wrench:?}");
    }
}

#[test]
fn whenever_a_field_comes_nothing_jumps() {
    let mut fade = CrossFade::new(5 * MS);
    // Fields of every kind, some before the last has come in, the handle moving all along.
    for (count, at_ms) in [0, 5, 7, 12, 13, 14, 30].into_iter().enumerate() {
        let (count, pose) = (count as f64, up(0.001 * at_ms as f64));
        let before = fade.at(&pose, at_ms * MS).0;
        fade.take(field(3.0 - 2.0 * count, 100.0 * count), &pose, at_ms * MS);
        let after = fade.at(&pose, at_ms * MS).0;
        assert!((before.force() - after.force()).length() < 1.0e-12, "at {at_ms} ms");
        // And what goes on is as stiff as what was.
        let slope = |pose: &Pose| fade.at(pose, at_ms * MS).0.force().z;
        assert!(slope(&up(pose.position().z + 1.0e-4)) <= slope(&pose) + 1.0e-12);
    }
}

#[test]
fn beyond_either_field_it_says_so() {
    let mut fade = CrossFade::new(4 * MS);
    fade.take(field(1.0, 10.0), &Pose::HOME, 0);
    assert!(fade.at(&up(0.009), 2 * MS).1 && !fade.at(&up(0.011), 2 * MS).1);
}

#[test]
fn a_field_that_held_nowhere_is_forgotten_once_it_has_gone() {
    let mut fade = CrossFade::new(4 * MS);
    fade.take(LinearField { valid_m: 0.0, ..field(0.0, 0.0) }, &Pose::HOME, 0);
    for (at_ms, is_valid) in [(4, false), (8, true), (12, true)] {
        fade.take(field(1.0, 10.0), &Pose::HOME, at_ms * MS);
        assert_eq!(fade.at(&up(0.009), (at_ms + 1) * MS).1, is_valid, "at {at_ms} ms");
    }
}
