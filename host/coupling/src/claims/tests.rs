use super::*;
use flotor_core::mapping::MappingConfig;
use flotor_hal::DQuat;

fn is_possible(motion_scale: f64, pose: Pose, twist: Twist) -> bool {
    let mapping = Mapping::new(&MappingConfig { motion_scale, ..MappingConfig::default() });
    let claims = Claims::new(&CouplingConfig::default(), &mapping, Reach::default(), 1.0e-3);
    claims.can_be(&PeerState { pose, twist, passed_on_j: 0.0 }, &mapping)
}

fn can_be(motion_scale: f64, z_m: f64, z_m_per_s: f64) -> bool {
    let pose = Pose::new(DVec3::Z * z_m, DQuat::IDENTITY);
    is_possible(motion_scale, pose, Twist::new(DVec3::Z * z_m_per_s, DVec3::ZERO))
}

/// A hand that swings along all axes, and passes on what its work is.
fn swing(tick: u64) -> PeerState {
    let (rate, most) = (std::f64::consts::TAU * 2.0, DVec3::new(2.0e-3, -1.0e-3, 3.0e-3));
    let (sin, cos) = (rate * 1.0e-3 * tick as f64).sin_cos();
    let pose = Pose::new(most * sin, orientation_from_rotation_vector(most * 10.0 * sin));
    PeerState {
        pose,
        twist: Twist::new(most * rate * cos, most * 10.0 * rate * cos),
        passed_on_j: 1.0e-5 * tick as f64,
    }
}

#[test]
fn an_honest_partner_is_believed_to_the_bit() {
    let mapping = Mapping::new(&MappingConfig::default());
    let reach = Reach { range_m: [7.0e-3; 3], range_rad: [0.5; 3] };
    let mut claims = Claims::new(&CouplingConfig::default(), &mapping, reach, 1.0e-3);
    claims.meet(&swing(0), true);
    let mut heard = 0;
    for tick in 1..10_000 {
        claims.pass(0.0);
        // One message in a hundred is lost, and now and then twenty.
        if tick % 100 == 0 || tick % 1000 < 20 {
            continue;
        }
        let told = swing(tick);
        let accepted = claims.accept(&told, &DeviceState::HOME, &mapping, (tick - heard) as f64 * 1.0e-3);
        assert_eq!((accepted.pose, accepted.twist), (told.pose, told.twist), "tick {tick}");
        assert!((accepted.passed_on_j - told.passed_on_j).abs() < 1.0e-12, "tick {tick}: {accepted:?}");
        heard = tick;
    }
    assert_eq!((claims.cut, claims.is_too_much()), (ClaimExcess::default(), false));
}

#[test]
fn an_orientation_that_is_accepted_is_normalised() {
    let mapping = Mapping::new(&MappingConfig::default());
    let claim = swing(30);
    for length in [0.9991, 0.999_99, 1.000_001, 1.0009] {
        let orientation = claim.pose.orientation() * length;
        let told = PeerState { pose: Pose::new(claim.pose.position(), orientation), ..claim };
        let mut claims = Claims::new(&CouplingConfig::default(), &mapping, Reach::default(), 1.0e-3);
        assert!(claims.can_be(&told, &mapping), "length {length}");
        let accepted = claims.accept(&told, &DeviceState::HOME, &mapping, 1.0e-3).pose.orientation();
        // Four roundings.
        assert!((accepted - claim.pose.orientation()).length() < 1.0e-15, "length {length}: {accepted}");
    }
}

#[test]
fn a_partner_is_heard_where_a_device_can_be() {
    assert!(can_be(1.0, -1.0, 1.0));
    let far = [-2.1, -1.0e30, f64::MAX, f64::NAN].map(|z_m| (z_m, 0.0));
    let fast = [1.0e30, f64::INFINITY, f64::NAN].map(|z_m_per_s| (0.0, z_m_per_s));
    for (z_m, z_m_per_s) in far.into_iter().chain(fast) {
        assert!(!can_be(1.0, z_m, z_m_per_s), "{z_m} m, {z_m_per_s} m/s");
    }
    for length in [0.0, 0.9, 1.0e10, f64::NAN] {
        let pose = Pose { orientation_xyzw: [0.0, 0.0, 0.0, length], ..Pose::HOME };
        assert!(!is_possible(1.0, pose, Twist::ZERO), "a quaternion of length {length}");
    }
    // A shared frame of kilometres, and one of millimetres: its partner's is not known.
    assert!(can_be(1.0e3, 1.0e3, 1.0e3) && can_be(1.0e-3, 1.0, 1.0));
}
