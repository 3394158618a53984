//! Closed paths cost nothing: whatever law with an energy answers, on whatever seat, the hand gets back what it gave.

use std::f64::consts::TAU;

use flotor_hal::glam::DVec3;
use flotor_spring::contact::AxialContact;
use flotor_spring::energy::EnergyForm;
use flotor_spring::held::{Held, HeldSpring};
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::Spring;
use flotor_spring::rod::{Accuracy, Coils, Rod};
use flotor_spring::rod_blend::RodBlend;
use flotor_spring::seat::{Friction, Seat};
use flotor_spring::validity::Validity;
use flotor_spring::wire::Wire;

/// Largest net work of a closed path, per sum of all work exchanged on it.
const BOUND: f64 = 1e-9;

/// A closed path: a sine about a mean in each coordinate, in free lengths and radians.
#[derive(Clone, Copy)]
struct Path {
    mean: DVec3,
    position: DVec3,
    /// The plate tilts about an axis that stays, so that its angular velocity is known exactly.
    tilt_rad: f64,
}

impl Path {
    /// Pose, velocity and angular velocity per radian of phase.
    fn at(&self, phase: f64, free_length_m: f64) -> (Pose, DVec3, DVec3) {
        let (sine, cosine) = phase.sin_cos();
        let axis = DVec3::new(0.6, -0.64, 0.48);
        let waves = DVec3::new(sine, cosine, (phase + 1.0).sin());
        let slopes = DVec3::new(cosine, -sine, (phase + 1.0).cos());
        let pose = Pose::from_rotation_vector(
            (self.mean + self.position * waves) * free_length_m,
            axis * (self.tilt_rad * cosine),
        );
        (pose, self.position * slopes * free_length_m, axis * (-self.tilt_rad * sine))
    }
}

/// Net work of the second of two rounds, per sum of all work exchanged, and ticks without an equilibrium.
fn net_share(
    spring: &Spring,
    path: &Path,
    steps: u32,
    mut respond: impl FnMut(&Pose) -> Response,
) -> (f64, u32) {
    let free_length_m = spring.geometry().free_length_m;
    // Neumaier's sum: rounding of a hundred thousand terms would be of the bound's order.
    let (mut net, mut carry, mut gross, mut waited) = (0.0, 0.0, 0.0, 0);
    for step in 0..2 * steps {
        let phase = TAU * f64::from(step) / f64::from(steps);
        let (pose, velocity, angular) = path.at(phase, free_length_m);
        let answer = respond(&pose);
        assert!(answer.validity.has_answer(), "{pose:?}: {answer:?}");
        if step < steps {
            continue;
        }
        waited += u32::from(answer.validity == Validity::NotConverged);
        let power = answer.force_n.dot(velocity) + answer.torque_nm.dot(angular);
        let sum: f64 = net + power;
        carry += if net.abs() > power.abs() { (net - sum) + power } else { (power - sum) + net };
        net = sum;
        gross += power.abs();
    }
    ((net + carry).abs() / gross, waited)
}

/// Within the workspace of a hand.
const DEVICE: Path =
    Path { mean: DVec3::new(0.02, -0.01, -0.15), position: DVec3::new(0.12, 0.1, 0.12), tilt_rad: 0.1 };
/// Into the region where spring 3 is the rod alone, and out of it.
const DEEP: Path =
    Path { mean: DVec3::new(0.01, 0.02, -0.30), position: DVec3::new(0.05, 0.04, 0.06), tilt_rad: 0.06 };
/// Hardly pressed and shoved about: a free base rolls around its rim.
const ROLLING: Path =
    Path { mean: DVec3::new(0.0, 0.0, -0.08), position: DVec3::new(0.15, 0.12, 0.02), tilt_rad: 0.05 };

/// Asserts that a law gives back what it takes, and has an equilibrium at every tick.
fn costs_nothing(
    name: &str,
    spring: &Spring,
    (path, steps): (&Path, u32),
    respond: impl FnMut(&Pose) -> Response,
) {
    let (share, waited) = net_share(spring, path, steps, respond);
    assert!(share < BOUND && waited == 0, "{name}: {share:e} of the work, {waited} ticks waited");
}

/// The rectangle rule is exact to rounding on smooth periodic integrands.
#[test]
fn no_law_on_a_held_seat_makes_or_takes_energy() {
    for preset in [Preset::Thesis1, Preset::Thesis3] {
        let spring = preset.spring();
        for path in [&DEVICE, &DEEP] {
            let way = (path, 2000);
            let energy = EnergyForm::new(&spring);
            costs_nothing("energy", &spring, way, |pose| energy.respond(pose, Demand::Wrench));
            let mut rod = Rod::new(&spring, Accuracy::Servo);
            costs_nothing("rod", &spring, way, |pose| rod.step(pose, Demand::Wrench));
            let mut law = RodBlend::new(&spring);
            costs_nothing("hand-over", &spring, way, |pose| law.respond(pose, Demand::Wrench));
            let mut law = Rod::to_rounding(&spring, Coils::Touch);
            costs_nothing("touching coils", &spring, way, |pose| law.step(pose, Demand::Wrench));
            let (contact, wire) = (Some(AxialContact::new(&spring)), Some(Wire::new(&spring)));
            let mut coil = Held { law: RodBlend::new(&spring), contact, wire };
            costs_nothing("contact and wire", &spring, way, |pose| coil.respond(pose, Demand::Wrench));
        }
    }
}

/// A fast hand, 100 µm a tick: the servo's rod errs by what it accepts as an equilibrium, the same rod solved to rounding by
/// nothing.
#[test]
fn a_fast_hand_gets_no_more_than_the_servo_accepts() {
    for preset in [Preset::Thesis1, Preset::Thesis3] {
        let spring = preset.spring();
        // Twenty millimetres of way in a lap.
        let way = (&DEVICE, 200);
        let (mut servo, mut exact) =
            (Rod::new(&spring, Accuracy::Servo), Rod::to_rounding(&spring, Coils::Pass));
        let (share, _) = net_share(&spring, way.0, way.1, |pose| servo.step(pose, Demand::Wrench));
        println!("{preset:?}: the servo's rod makes {share:.1e} of the work exchanged");
        // The accepted error of the shape, 1e-8, over angles of a tenth.
        assert!(share < 1e-7, "{preset:?}: {share:e}");
        costs_nothing("to rounding", &spring, way, |pose| exact.step(pose, Demand::Wrench));
    }
}

/// A base that tips is where the energy has its least, so the energy stays one. Where it leaves its seat the wrench has a
/// kink, which the rectangle rule meets to second order only: the path's steps are as many as that needs.
#[test]
fn a_base_that_rolls_and_sits_down_makes_no_energy() {
    let spring = Preset::Thesis1.spring();
    let way = (&ROLLING, 4000);
    let seat = || Seat::new(&spring, Friction::STICKING);
    let (mut base, mut law) = (seat(), EnergyForm::new(&spring));
    costs_nothing("energy", &spring, way, |pose| base.step(&mut law, pose, Demand::Wrench));
    assert!(base.tilt_rad().length() > 0.01, "the path tips the base");
    let (mut base, mut law) = (seat(), RodBlend::new(&spring));
    costs_nothing("hand-over", &spring, way, |pose| base.step(&mut law, pose, Demand::Wrench));
    let (mut base, mut law) = (seat(), Rod::to_rounding(&spring, Coils::Pass));
    // Where the base tips the rod may cost more than a tick has; the next tick goes on.
    let (share, waited) = net_share(&spring, way.0, way.1, |pose| base.step(&mut law, pose, Demand::Wrench));
    assert!(share < BOUND && waited <= 1, "rod: {share:e} of the work, {waited} of {} ticks waited", way.1);
    // Spring 3 is blended on the way; its base sits down and tips in turns.
    let spring = Preset::Thesis3.spring();
    let (mut base, mut law) = (Seat::new(&spring, Friction::STICKING), RodBlend::new(&spring));
    costs_nothing("hand-over, seated", &spring, (&DEEP, 2000), |pose| {
        base.step(&mut law, pose, Demand::Wrench)
    });
    let (mut base, mut law) = (Seat::new(&spring, Friction::STICKING), EnergyForm::new(&spring));
    costs_nothing("energy, tipping", &spring, (&ROLLING, 20_000), |pose| {
        base.step(&mut law, pose, Demand::Wrench)
    });
}
