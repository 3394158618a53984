use super::*;
use flotor_hal::{Axes, Pose};

const PERIOD_NS: u64 = 1_000_000;
const DEVICE: Capabilities = Capabilities {
    sensed: Axes::ALL,
    actuated: Axes::ALL,
    range_m: [0.012; 3],
    range_rad: [0.12; 3],
    resolution_m: 0.0,
    max_force_n: [40.0, 40.0, 100.0],
    max_torque_nm: [5.0, 5.0, 10.0],
    max_force_slew_n_per_s: 20_000.0,
    max_torque_slew_nm_per_s: 2_000.0,
    max_stiffness_n_per_m: 25_000.0,
    rate_hz: [100.0, 10_000.0],
    latency_s: 0.0,
};

fn envelope(limits: &Limits) -> Envelope {
    Envelope::new(limits, &Boundary::default(), &DEVICE, PERIOD_NS)
}

fn tick(index: u64) -> Tick {
    Tick { index, time_ns: index * PERIOD_NS, dt_ns: if index == 0 { 0 } else { PERIOD_NS } }
}

/// Runs one tick at home; the wrench and the events.
fn apply(envelope: &mut Envelope, request: Wrench, index: u64) -> (Wrench, Events) {
    let mut events = Events::NONE;
    let sent = envelope.apply(&request, Gate::OPEN, &DeviceState::HOME, &tick(index), &mut events);
    (sent, events)
}

#[test]
fn what_is_within_all_limits_passes_unchanged() {
    let request = Wrench::new(DVec3::new(1.0, -2.0, 3.0), DVec3::new(0.1, 0.2, -0.3));
    let (sent, events) = apply(&mut envelope(&Limits::default()), request, 0);
    assert_eq!(sent, request);
    assert_eq!(events, Events::NONE);
}

#[test]
fn nothing_gets_past_limits_and_slew_whatever_a_model_asks() {
    let limits = Limits {
        force_n: Bound::box_of([30.0, 50.0, 50.0]),
        torque_slew_nm_per_s: 500.0,
        ..Limits::default()
    };
    let mut envelope = envelope(&limits);
    // The tighter of scene and device.
    let (most_n, most_nm) = (DVec3::new(30.0, 40.0, 50.0), DVec3::new(5.0, 5.0, 10.0));
    let (slew_n, slew_nm) = (20.0, 0.5);
    let wild = [0.0, 1.0, -1.0, 1.0e3, -1.0e3, 1.0e300, -1.0e300, 5.0e-324, f64::NAN, f64::INFINITY];
    let mut last = Wrench::ZERO;
    let mut state: u64 = 1; // a linear congruential generator (Knuth's MMIX) is random enough to pick wild values
    for index in 0..100_000 {
        let mut pick = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            wild[(state >> 33) as usize % wild.len()]
        };
        let request = Wrench { force_n: [pick(), pick(), pick()], torque_nm: [pick(), pick(), pick()] };
        let (sent, _) = apply(&mut envelope, request, index);
        // One rounding of the largest number involved.
        let slack = 1.0 + 4.0 * f64::EPSILON;
        assert!(sent.is_finite());
        assert!(sent.force().abs().cmple(most_n * slack).all(), "{sent:?}");
        assert!(sent.torque().abs().cmple(most_nm * slack).all(), "{sent:?}");
        assert!((sent.force() - last.force()).length() <= slew_n * slack + 1.0e-13, "{sent:?} {last:?}");
        assert!((sent.torque() - last.torque()).length() <= slew_nm * slack + 1.0e-14, "{sent:?} {last:?}");
        last = sent;
    }
}

/// Random numbers: a linear congruential generator (Knuth's MMIX) is random enough to ask for anything.
struct Requests(u64);

impl Requests {
    /// Evenly between -1 and 1.
    fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// A vector of any direction, from a thousandth of `scale` to a thousand times it.
    fn vector(&mut self, scale: f64) -> DVec3 {
        let magnitude = scale * 10.0_f64.powf(3.0 * self.share());
        DVec3::new(self.share(), self.share(), self.share()) * magnitude
    }

    fn wrench(&mut self) -> Wrench {
        Wrench::new(self.vector(10.0), self.vector(0.5))
    }
}

#[test]
fn no_request_gets_past_ball_box_device_and_slew_and_a_ball_keeps_the_direction() {
    let ball = Limits { force_n: Bound::ball(10.0), torque_nm: Bound::ball(0.5), ..Limits::default() };
    let boxed = Bound::box_of([9.0, 50.0, 4.0]);
    let both = Limits {
        force_n: ball.force_n.and(boxed),
        force_slew_n_per_s: 3000.0,
        torque_slew_nm_per_s: 200.0,
        ..ball
    };
    let device = Capabilities { max_force_n: [40.0, 7.0, 100.0], ..DEVICE };
    let guarded = |limits: &Limits, device| Envelope::new(limits, &Boundary::default(), device, PERIOD_NS);
    let unslewed = Capabilities {
        max_force_slew_n_per_s: f64::INFINITY,
        max_torque_slew_nm_per_s: f64::INFINITY,
        ..DEVICE
    };
    let (mut tight, mut free) = (guarded(&both, &device), guarded(&ball, &unslewed));
    let (mut requests, mut last) = (Requests(1), Wrench::ZERO);
    let (mut at_the_ball, mut at_the_box) = (0, 0);
    for index in 0..1_000_000 {
        let request = requests.wrench();
        // Forces of any direction in a row are an oscillation, whose damping is not what is tested here.
        (tight.oscillation, free.oscillation) = (Oscillation::NONE, Oscillation::NONE);
        let (sent, _) = apply(&mut tight, request, index);
        // The limits hold to the bit; a step may be a rounding of the largest number longer.
        assert!(sent.force().abs().cmple(DVec3::new(9.0, 7.0, 4.0)).all(), "{sent:?}");
        assert!(sent.force().length_squared() <= 100.0, "{sent:?}");
        assert!(sent.torque().length_squared() <= 0.25, "{sent:?}");
        let [step_n, step_nm] =
            [sent.force() - last.force(), sent.torque() - last.torque()].map(DVec3::length);
        assert!(step_n <= 3.0 + 1.0e-13 && step_nm <= 0.2 + 1.0e-14, "{sent:?} after {last:?}");
        last = sent;

        let (short, _) = apply(&mut free, request, index);
        assert!(short.force().length_squared() <= 100.0 && short.torque().length_squared() <= 0.25);
        for (asked, sent, most) in
            [(request.force(), short.force(), 10.0), (request.torque(), short.torque(), 0.5)]
        {
            let wanted = asked.length().min(most);
            assert!((sent.length() - wanted).abs() <= 1.0e-14 * most, "{sent} of {asked}");
            assert!(sent.cross(asked).length() <= 1.0e-12 * sent.length() * asked.length(), "{sent}");
        }
        at_the_ball += u32::from(request.force().length() > 10.0);
        at_the_box += u32::from(sent.force().z.abs() == 4.0);
    }
    assert!(at_the_ball > 300_000 && at_the_box > 1_000, "{at_the_ball} and {at_the_box} of a million");
}

#[test]
fn a_planar_device_has_its_two_axes_limited_and_walled_as_any_other() {
    let device = Capabilities {
        range_m: [0.05, 0.04, 0.0],
        max_force_n: [3.0, 3.0, 0.0],
        range_rad: [0.0; 3],
        max_torque_nm: [0.0; 3],
        ..DEVICE
    };
    let mut envelope = Envelope::new(&Limits::default(), &Boundary::default(), &device, PERIOD_NS);
    let (sent, events) = apply(&mut envelope, Wrench::new(DVec3::new(1.0, -2.0, 7.0), DVec3::X), 0);
    assert_eq!(sent, Wrench::from_force(DVec3::new(1.0, -2.0, 0.0)), "what cannot be driven costs nothing");
    assert_eq!(events, Events::NONE);
    let (sent, events) = apply(&mut envelope, Wrench::from_force(DVec3::new(30.0, 15.0, 900.0)), 1);
    assert!((sent.force() - DVec3::new(3.0, 1.5, 0.0)).length() < 1.0e-12, "{sent:?}");
    assert!(events.intersects(Events::FORCE_LIMITED));
    // A millimetre beyond the wall along x: 10 N, of which 3 are allowed.
    let mut state = DeviceState::HOME;
    state.pose = Pose::new(DVec3::X * 0.0505, flotor_hal::DQuat::IDENTITY);
    envelope.last = Wrench::ZERO;
    let walled = envelope.apply(&Wrench::ZERO, Gate::OPEN, &state, &tick(1), &mut Events::NONE.clone());
    assert!((walled.force() - DVec3::X * -3.0).length() < 1.0e-9, "{walled:?}");
}

#[test]
fn a_force_that_is_too_large_keeps_its_direction() {
    let asked = DVec3::new(100.0, 50.0, 0.0);
    let limits = Limits { force_n: Bound::box_of([20.0; 3]), ..Limits::default() };
    let (sent, events) = apply(&mut envelope(&limits), Wrench::from_force(asked), 0);
    assert!(sent.force().cross(asked).length() < 1.0e-12);
    assert!(events.intersects(Events::FORCE_LIMITED));
}

#[test]
fn not_a_number_becomes_no_force_and_is_told() {
    let request = Wrench { force_n: [0.0, f64::NAN, 1.0], torque_nm: [0.0; 3] };
    let (sent, events) = apply(&mut envelope(&Limits::default()), request, 0);
    assert_eq!(sent, Wrench::ZERO);
    assert!(events.intersects(Events::NOT_FINITE));
}

#[test]
fn the_gate_scales_models_and_boundary() {
    let mut envelope = envelope(&Limits::default());
    let mut state = DeviceState::HOME;
    state.pose = Pose::new(DVec3::new(0.0, 0.0, 0.0117), flotor_hal::DQuat::IDENTITY); // the wall pushes with 7.75 N
    let mut sent = |models, boundary| {
        let (gate, request) = (Gate { models, boundary }, Wrench::from_force(DVec3::X));
        envelope.last = Wrench::ZERO;
        envelope.apply(&request, gate, &state, &tick(1), &mut Events::NONE.clone()).force()
    };
    assert!((sent(0.5, 1.0) - DVec3::new(0.5, 0.0, -7.75)).length() < 1.0e-9);
    assert!((sent(1.0, 0.5) - DVec3::new(1.0, 0.0, -3.875)).length() < 1.0e-9);
    assert_eq!(sent(0.0, 0.0), DVec3::ZERO);
}

/// Found by the campaign of `tests/tests/system/campaign`: what is left of the largest double beside its part along the
/// velocity may be more than any double, and was sent as a corner of the box outside the ball.
#[test]
fn no_request_of_any_size_gets_past_the_ball_at_any_velocity() {
    let most = (Bound::ball(20.0), Bound::ball(1.0));
    let limits = Limits {
        force_n: most.0,
        torque_nm: most.1,
        velocity_m_per_s: Bound::ball(0.06),
        angular_velocity_rad_per_s: Bound::ball(0.5),
        ..Limits::default()
    };
    let device = Capabilities {
        max_force_slew_n_per_s: f64::INFINITY,
        max_torque_slew_nm_per_s: f64::INFINITY,
        ..DEVICE
    };
    let mut envelope = Envelope::new(&limits, &Boundary::default(), &device, PERIOD_NS);
    let mut requests = Requests(7);
    for (index, scale) in (0..200_000).zip([f64::MAX, f64::MAX, 1.0e307, 1.0e154, 1.0e3].into_iter().cycle())
    {
        let mut huge = || DVec3::new(requests.share(), requests.share(), requests.share()) * scale;
        let request = Wrench::new(huge(), huge());
        let mut state = DeviceState::HOME;
        state.twist = flotor_hal::Twist::new(requests.vector(0.1), requests.vector(1.0));
        let mut events = Events::NONE;
        let sent = envelope.apply(&request, Gate::OPEN, &state, &tick(index), &mut events);
        let slack = 1.0 + 4.0 * f64::EPSILON;
        assert!(sent.force().length() <= 20.0 * slack, "{request:?} {sent:?}");
        assert!(sent.torque().length() <= slack, "{request:?} {sent:?}");
    }
}

#[test]
fn nothing_drives_a_handle_on_that_is_too_fast_and_braking_is_left() {
    let limits = Limits { velocity_m_per_s: Bound::box_of([1.0, 0.5, 1.0]), ..Limits::default() };
    let mut envelope = envelope(&limits);
    let mut sent = |velocity: DVec3, force: DVec3| {
        let mut state = DeviceState::HOME;
        state.twist.linear_m_per_s = velocity.to_array();
        let mut events = Events::NONE;
        envelope.last = Wrench::ZERO;
        let sent = envelope.apply(&Wrench::from_force(force), Gate::OPEN, &state, &tick(1), &mut events);
        (sent.force(), events.intersects(Events::VELOCITY_LIMITED))
    };
    let asked = DVec3::new(3.0, 4.0, 0.0);
    assert_eq!(sent(DVec3::new(1.0, 0.0, 0.0), asked), (asked, false), "at the limit all passes");
    assert_eq!(
        sent(DVec3::new(1.5, 0.0, 0.0), asked),
        (DVec3::new(1.5, 4.0, 0.0), true),
        "half of the drive"
    );
    assert_eq!(sent(DVec3::new(2.0, 0.0, 0.0), asked), (DVec3::new(0.0, 4.0, 0.0), true), "none of it");
    assert_eq!(sent(DVec3::new(-9.0, 0.0, 0.0), asked), (asked, true), "braking is left alone");
    assert_eq!(
        sent(DVec3::new(0.0, 0.75, 0.0), asked).0,
        DVec3::new(3.0, 2.0, 0.0),
        "each axis has its limit"
    );
}

#[test]
fn one_velocity_limit_is_for_the_speed() {
    let limits = Limits { velocity_m_per_s: Bound::ball(1.0), ..Limits::default() };
    let mut envelope = envelope(&limits);
    let mut state = DeviceState::HOME;
    state.twist.linear_m_per_s = [0.9, 1.2, 0.0]; // 1.5 m/s
    let along = DVec3::new(0.6, 0.8, 0.0);
    let mut events = Events::NONE;
    let sent = envelope.apply(&Wrench::from_force(along), Gate::OPEN, &state, &tick(1), &mut events);
    assert!((sent.force() - along * 0.5).length() < 1.0e-15, "{sent:?}");
    assert!(events.intersects(Events::VELOCITY_LIMITED));
}

#[test]
fn the_wall_pushes_inwards_only_and_only_outside() {
    let mut envelope = envelope(&Limits::default());
    let mut push = |position_m: DVec3, velocity: DVec3| {
        let mut state = DeviceState::HOME;
        state.pose = Pose::new(position_m, flotor_hal::DQuat::IDENTITY);
        state.twist.linear_m_per_s = velocity.to_array();
        let mut events = Events::NONE;
        envelope.last = Wrench::ZERO;
        envelope.apply(&Wrench::ZERO, Gate::OPEN, &state, &tick(1), &mut events).force()
    };
    let inside = push(DVec3::new(0.0, 0.0, 0.0106), DVec3::Z);
    assert_eq!(inside, DVec3::ZERO);
    // 7.5 kN/m from 12 mm - 2 (5 N) / (7.5 kN/m) = 10.67 mm on.
    let outside = push(DVec3::new(0.0, 0.0, 0.0117), DVec3::ZERO);
    assert!((outside - DVec3::new(0.0, 0.0, -7.75)).length() < 1.0e-9, "{outside}");
    let leaving = push(DVec3::new(0.0, 0.0, 0.0117), DVec3::Z * 0.1);
    assert!((leaving.z + 9.25).abs() < 1.0e-9, "damping resists going out: {leaving}");
    let returning = push(DVec3::new(0.0, 0.0, 0.0117), DVec3::Z * -10.0);
    assert!(
        (returning.z + 7.75).abs() < 1.0e-9,
        "and does not pull a handle out that comes back: {returning}"
    );
    let sideways = push(DVec3::new(0.00936, 0.0, 0.00702), DVec3::ZERO); // 11.7 mm at 3:4
    assert!(sideways.cross(DVec3::new(4.0, 0.0, 3.0)).length() < 1.0e-9, "a sphere, not a box: {sideways}");
}
