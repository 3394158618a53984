//! The spring on its seat against reference tables, and the properties of a free base.

use crate::preset::preset;
use crate::sample::{Sampler, Workspace, of};
use crate::table::rows;
#[allow(dead_code)] // each test needs its part of the helpers
use flotor_hal::glam::{DQuat, DVec2, DVec3};
use flotor_spring::energy::EnergyForm;
use flotor_spring::held::HeldSpring;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::{Demand, Response};
use flotor_spring::rigidity::Spring;
use flotor_spring::rod::{Accuracy, Coils, Rod};
use flotor_spring::rod_blend::RodBlend;
use flotor_spring::seat::{Friction, Seat};
use flotor_spring::validity::Validity;

/// Walks from rest in steps of at most 0.05 mm and 0.002 rad, then holds until converged.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few hundred steps
fn walk(mut step: impl FnMut(&Pose) -> Response, position_m: DVec3, rotation_rad: DVec3) -> Response {
    let steps = (position_m.length() / 0.05e-3).max(rotation_rad.length() / 0.002).ceil().max(1.0) as u32;
    let at = |part: f64| Pose::from_rotation_vector(position_m * part, rotation_rad * part);
    for n in 1..steps {
        let _ = step(&at(f64::from(n) / f64::from(steps)));
    }
    let mut answer = step(&at(1.0));
    for _ in 0..2000 {
        if answer.validity != Validity::NotConverged {
            break;
        }
        answer = step(&at(1.0));
    }
    answer
}

#[test]
fn rod_on_its_seat_agrees_with_the_table() {
    for row in &rows("e_unseating_planar.csv") {
        let spring = preset(row).spring();
        let (mut rod, mut seat) =
            (Rod::new(&spring, Accuracy::Tight), Seat::new(&spring, Friction::STICKING));
        let height_mm = row.number("rz_mm") - spring.geometry().free_length_m * 1e3;
        let position_m = DVec3::new(row.number("rx_mm"), 0.0, height_mm) * 1e-3;
        let rotation_rad = DVec3::new(0.0, row.number("tilt_rad"), 0.0);
        let step = |pose: &Pose| seat.step(&mut rod, pose, Demand::WrenchAndEnergy);
        let answer = walk(step, position_m, rotation_rad);
        assert_eq!(answer.validity, Validity::Ok, "{}", row.text("id"));
        let force_n = DVec3::new(row.number("FX_N"), 0.0, row.number("FZ_N"));
        // Required 1e-6 N and 1e-6 rad; the table's bisection leaves 1e-11 rad.
        let error_n = (answer.force_n - force_n).length();
        assert!(error_n < 1e-6, "{}: {error_n:e} N", row.text("id"));
        let error_rad = (seat.tilt_rad() - DVec2::new(row.number("base_roll_rad"), 0.0)).length();
        assert!(error_rad < 1e-6, "{}: {error_rad:e} rad", row.text("id"));
        let error_nm = (answer.torque_nm - DVec3::new(0.0, row.number("MY_Nmm") * 1e-3, 0.0)).length();
        assert!(error_nm < 1e-8, "{}: {error_nm:e} N·m", row.text("id"));
    }
}

/// Poses at which the base tips, in any direction.
fn tipping(spring: &Spring) -> Vec<Pose> {
    let workspace = Workspace { shear: 0.15, height: 0.02, tilt_rad: 0.1, yaw_rad: 0.1 };
    let mut sampler = Sampler::new(9);
    let down = DVec3::new(0.0, 0.0, -0.06) * spring.geometry().free_length_m;
    (0..20)
        .map(|_| {
            let pose = workspace.pose(&mut sampler, spring.geometry().free_length_m);
            Pose { position_m: pose.position_m + down, ..pose }
        })
        .collect()
}

fn settled(seat: &mut Seat, law: &mut EnergyForm, pose: &Pose) -> Response {
    let mut answer = seat.step(law, pose, Demand::WrenchAndEnergy);
    for _ in 0..200 {
        if answer.validity != Validity::NotConverged {
            break;
        }
        answer = seat.step(law, pose, Demand::WrenchAndEnergy);
    }
    assert_eq!(answer.validity, Validity::Ok, "{pose:?}");
    answer
}

#[test]
fn wrench_of_the_free_spring_is_the_gradient_of_its_energy() {
    let spring = Preset::Thesis1.spring();
    let mut law = EnergyForm::new(&spring);
    let mut tipped = 0;
    for pose in tipping(&spring) {
        let mut seat = Seat::new(&spring, Friction::STICKING);
        let here = settled(&mut seat, &mut law, &pose);
        tipped += u32::from(seat.tilt_rad().length() > 0.01);
        let h = 1e-4;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let mut energy = |s: f64| {
                let position_m = pose.position_m + axis * (s * h * spring.geometry().free_length_m);
                settled(&mut seat.clone(), &mut law, &Pose { position_m, ..pose }).energy_j.expect("demanded")
            };
            let force_n = -(energy(1.0) - energy(-1.0)) / (2.0 * h * spring.geometry().free_length_m);
            // Second order in a step of 1e-4, on 10 N per free length.
            assert!((force_n - here.force_n.dot(axis)).abs() < 2e-6, "{pose:?}");
            let mut turned = |s: f64| {
                let orientation = DQuat::from_axis_angle(axis, s * h) * pose.orientation;
                settled(&mut seat.clone(), &mut law, &Pose { orientation, ..pose })
                    .energy_j
                    .expect("demanded")
            };
            let torque_nm = -(turned(1.0) - turned(-1.0)) / (2.0 * h);
            assert!((torque_nm - here.torque_nm.dot(axis)).abs() < 2e-8, "{pose:?}");
        }
    }
    assert!(tipped > 5, "{tipped} of the poses tip the base");
}

/// A hand that rocks and shoves a lightly pressed spring, several times a second.
fn rocking(spring: &Spring, tick: u32) -> Pose {
    let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
    let position_m = DVec3::new(
        0.18 * (1.3 * phase).sin(),
        0.12 * (1.9 * phase + 0.4).sin(),
        -0.08 + 0.05 * (0.7 * phase).cos(),
    ) * spring.geometry().free_length_m;
    let rotation_rad = DVec3::new(0.08 * (1.5 * phase).sin(), 0.08 * (2.1 * phase).cos(), 0.05 * phase.sin());
    Pose::from_rotation_vector(position_m, rotation_rad)
}

/// Ticks that waited for their equilibrium, of those on which the base was tipped.
fn waited<S: HeldSpring>(spring: &Spring, law: &mut S) -> (u32, u32) {
    let mut seat = Seat::new(spring, Friction::STICKING);
    let (mut waited, mut tipped) = (0, 0);
    for tick in 0..2000 {
        let answer = seat.step(law, &rocking(spring, tick), Demand::Wrench);
        waited += u32::from(answer.validity == Validity::NotConverged);
        tipped += u32::from(seat.tilt_rad() != DVec2::ZERO);
    }
    (waited, tipped)
}

#[test]
fn a_moving_base_keeps_up_with_the_hand() {
    for preset in [Preset::Thesis1, Preset::Thesis2, Preset::Thesis3] {
        let spring = preset.spring();
        let energy = waited(&spring, &mut EnergyForm::new(&spring));
        let rod = waited(&spring, &mut Rod::to_rounding(&spring, Coils::Pass));
        for (waited, tipped) in [energy, rod] {
            assert!(tipped > 500, "{preset:?}: {tipped} ticks tip the base");
            // The rod waits where it jumps to the tipped base: a hundredth at most.
            assert!(waited * 100 < tipped, "{preset:?}: {waited} of {tipped}");
        }
    }
}

#[test]
fn a_base_slides_where_friction_does_not_hold_it() {
    let spring = Preset::Thesis1.spring();
    let free_length_m = spring.geometry().free_length_m;
    let mut law = EnergyForm::new(&spring);
    let mut seat = Seat::new(&spring, Friction { coefficient: 0.1 });
    let at = |tick: u32| {
        let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
        Pose::from_rotation_vector(
            DVec3::new(0.1 * phase.sin(), 0.05 * (2.0 * phase).sin(), -0.05) * free_length_m,
            DVec3::new(0.0, 0.02 * phase.sin(), 0.0),
        )
    };
    let (mut sliding, mut waited, mut work_j) = (0, 0, 0.0);
    let mut last = (at(0), seat.step(&mut law, &at(0), Demand::WrenchAndEnergy));
    for tick in 1..=4000 {
        let before = seat.slide_m();
        let pose = at(tick);
        let answer = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
        let along_n = answer.force_n.truncate().length();
        waited += u32::from(answer.validity == Validity::NotConverged);
        if answer.validity == Validity::Ok {
            assert!(
                along_n <= 0.1 * answer.force_n.z * (1.0 + 1e-5),
                "{tick}: {along_n} of {}",
                answer.force_n.z
            );
        }
        sliding += u32::from(seat.slide_m() != before);
        // What the hand puts in, by the trapezoidal rule.
        let (moved_m, turned) =
            (pose.position_m - last.0.position_m, pose.orientation * last.0.orientation.conjugate());
        work_j -= 0.5 * (answer.force_n + last.1.force_n).dot(moved_m)
            + 0.5 * (answer.torque_nm + last.1.torque_nm).dot(turned.to_scaled_axis());
        last = (pose, answer);
    }
    assert!(sliding > 1000 && seat.slide_m().length() > 0.0, "{sliding} ticks slide");
    assert!(waited * 100 < sliding, "{waited} of {sliding} wait");
    // Four rounds: friction takes energy, and the spring gives none.
    assert!(work_j > 1e-4, "{work_j} J");
}

#[test]
fn a_free_spring_cannot_be_pulled() {
    let spring = Preset::Thesis1.spring();
    let (mut law, mut seat) = (EnergyForm::new(&spring), Seat::new(&spring, Friction::STICKING));
    let pose = Pose::from_rotation_vector(DVec3::new(1e-3, 0.0, 2e-3), DVec3::ZERO);
    let answer = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
    assert_eq!((answer.force_n, answer.torque_nm, answer.energy_j), (DVec3::ZERO, DVec3::ZERO, Some(0.0)));
    assert!(seat.is_lifted());
    // Down again, it stands under the plate.
    let down = Pose::from_rotation_vector(DVec3::new(1e-3, 0.0, -2e-3), DVec3::ZERO);
    let answer = seat.step(&mut law, &down, Demand::Wrench);
    assert!(!seat.is_lifted() && seat.tilt_rad() == DVec2::ZERO);
    assert!((answer.force_n.z - spring.axial_stiffness_n_per_m() * 2e-3).abs() < 1e-12);
}

/// A law on a free seat, moved one step a tick; what the hand puts in, by the trapezoidal rule, and the largest step of the
/// force.
struct Hand<S> {
    law: S,
    seat: Seat,
    pose: Pose,
    felt: Response,
    work_j: f64,
    exchanged_j: f64,
    step_n: f64,
}

impl<S: HeldSpring> Hand<S> {
    fn new(spring: &Spring, mut law: S, friction: f64) -> Self {
        let mut seat = Seat::new(spring, Friction { coefficient: friction });
        let felt = seat.step(&mut law, &Pose::HOME, Demand::WrenchAndEnergy);
        Self { law, seat, pose: Pose::HOME, felt, work_j: 0.0, exchanged_j: 0.0, step_n: 0.0 }
    }

    fn tick(&mut self, position_m: DVec3, rotation_rad: DVec3) {
        let pose = Pose::from_rotation_vector(position_m, rotation_rad);
        let felt = self.seat.step(&mut self.law, &pose, Demand::WrenchAndEnergy);
        let moved_m = pose.position_m - self.pose.position_m;
        let turned_rad = (pose.orientation * self.pose.orientation.conjugate()).to_scaled_axis();
        let work_j = -0.5 * (felt.force_n + self.felt.force_n).dot(moved_m)
            - 0.5 * (felt.torque_nm + self.felt.torque_nm).dot(turned_rad);
        self.work_j += work_j;
        self.exchanged_j += work_j.abs();
        self.step_n = self.step_n.max((felt.force_n - self.felt.force_n).length());
        (self.pose, self.felt) = (pose, felt);
    }

    /// In a straight line, in steps of two micrometres.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand steps
    fn go(&mut self, position_m: DVec3) {
        let from_m = self.pose.position_m;
        let steps = ((position_m - from_m).length() / 2e-6).ceil() as u32;
        for step in 1..=steps {
            self.tick(from_m.lerp(position_m, f64::from(step) / f64::from(steps)), DVec3::ZERO);
        }
    }
}

/// Lifted, taken aside, put down, pressed and taken back, pressed: no lap gives the hand anything, and nothing jumps.
#[test]
fn a_spring_that_is_set_down_elsewhere_stands_there_without_load() {
    let spring = Preset::Thesis1.spring();
    let mm = |x: f64, z: f64| DVec3::new(x, 0.0, z) * 1e-3;
    for friction in [10.0, 1.0, 0.3] {
        for aside_mm in [2.0, 4.0, 6.0] {
            let mut hand = Hand::new(&spring, EnergyForm::new(&spring), friction);
            hand.go(mm(0.0, 0.5));
            assert!(hand.seat.is_lifted());
            hand.go(mm(aside_mm, 0.5));
            hand.go(mm(aside_mm, -3.0));
            // It stands right under the plate.
            let pressed_n = spring.axial_stiffness_n_per_m() * 3e-3;
            assert!((hand.felt.force_n - DVec3::Z * pressed_n).length() < 1e-9, "{:?}", hand.felt);
            hand.go(mm(0.0, -3.0));
            hand.go(mm(0.0, 0.5));
            assert!(hand.work_j > -1e-6 * hand.exchanged_j, "{friction} {aside_mm}: {} J", hand.work_j);
            // Two micrometres of the axial stiffness; as it lifts off as much sideways, and of a base on
            // its rim L0/D times that again downwards.
            let geometry = spring.geometry();
            let tipping = 1.0 + geometry.free_length_m / geometry.coil_diameter_m;
            let most_n = 1.5 * 2e-6 * spring.axial_stiffness_n_per_m() * (1.0 + friction.min(3.0) * tipping);
            assert!(hand.step_n < most_n, "{friction} {aside_mm}: a step of {} N", hand.step_n);
        }
    }
}

/// Turned in the air, it is put down turned.
#[test]
fn a_spring_that_is_set_down_turned_is_not_twisted() {
    let spring = Preset::Thesis1.spring();
    let mut hand = Hand::new(&spring, EnergyForm::new(&spring), 10.0);
    hand.go(DVec3::Z * 1e-3);
    for step in 1..=500 {
        hand.tick(DVec3::Z * 1e-3, DVec3::Z * 1e-3 * f64::from(step));
    }
    for step in 1..=1000 {
        hand.tick(DVec3::Z * (1e-3 - 3e-6 * f64::from(step)), DVec3::Z * 0.5);
    }
    assert!(hand.felt.torque_nm.length() < 1e-12, "{:?}", hand.felt);
    assert!((hand.felt.force_n.z - spring.axial_stiffness_n_per_m() * 2e-3).abs() < 1e-9, "{:?}", hand.felt);
}

/// A plate that is tilted and was moved sideways comes off as gradually as a level one, whatever the friction.
#[test]
fn a_tilted_plate_lifts_off_without_a_jump() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        let geometry = spring.geometry();
        let free_length_m = geometry.free_length_m;
        // Tilts beyond which a base is on its way over as the plate lifts off are not for the slender one.
        let (depth, tilts) = if preset == Preset::Slender {
            (0.03, &[0.035, 0.1][..])
        } else {
            (0.08, &[0.035, 0.1, 0.2, 0.35][..])
        };
        let mut most = 0.0f64;
        for friction in [0.3, 1.0, 10.0] {
            for tilt_rad in tilts.iter().copied() {
                for aside in [-0.06, 0.0, 0.06] {
                    let mut hand = Hand::new(&spring, RodBlend::new(&spring), friction);
                    let [above, pressed, shoved, off] =
                        [[0.0, 0.1], [0.0, -depth], [aside, -depth], [aside, 0.1]]
                            .map(|[x, z]| DVec3::new(x, 0.0, z) * free_length_m);
                    hand.go(above);
                    let tilted = DVec3::Y * tilt_rad;
                    for (to_m, tick_m) in [(pressed, 4e-6), (shoved, 4e-6), (off, 1e-6)] {
                        let from_m = hand.pose.position_m;
                        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands
                        let ticks = ((to_m - from_m).length() / tick_m).ceil() as u32;
                        hand.step_n = 0.0;
                        for tick in 1..=ticks {
                            let part = f64::from(tick) / f64::from(ticks);
                            hand.tick(from_m.lerp(to_m, part), tilted);
                        }
                    }
                    assert!(hand.seat.is_lifted() && hand.felt.force_n == DVec3::ZERO);
                    // A micrometre of the axial stiffness, and of a base on its rim L0/D times that again.
                    let slope =
                        spring.axial_stiffness_n_per_m() * (1.0 + free_length_m / geometry.coil_diameter_m);
                    most = most.max(hand.step_n / (1e-6 * slope));
                }
            }
        }
        println!("{preset:?}: steps up to {most:.2} of stiffness and travel");
        assert!(most < 1.5, "{preset:?}: {most}");
    }
}

/// Past buckling a free spring falls over: it gives way step by step, carries nothing where it lies, and stands again once
/// it has been lifted.
#[test]
fn a_spring_that_falls_over_gives_way_and_lies_until_it_is_lifted() {
    let spring = Preset::Thesis3.spring();
    let free_length_m = spring.geometry().free_length_m;
    let mut hand = Hand::new(&spring, Rod::to_rounding(&spring, Coils::Pass), 1.0);
    let mm = |x: f64, z: f64| DVec3::new(x, 0.3 * x, z) * 1e-3;
    hand.go(mm(0.5, -0.3 * free_length_m * 1e3));
    assert!(!hand.seat.has_fallen() && hand.felt.force_n.z > 2.0, "{:?}", hand.felt);
    hand.go(mm(0.5, -0.6 * free_length_m * 1e3));
    assert!(hand.seat.has_fallen());
    let nothing = (DVec3::ZERO, DVec3::ZERO, Some(0.0), Validity::Ok);
    let felt = |felt: &Response| (felt.force_n, felt.torque_nm, felt.energy_j, felt.validity);
    assert_eq!(felt(&hand.felt), nothing);
    hand.go(mm(2.0, -0.1 * free_length_m * 1e3));
    assert_eq!(felt(&hand.felt), nothing);
    println!("falls with steps of up to {:.2} N", hand.step_n);
    assert!(hand.step_n < 0.5, "a step of {} N", hand.step_n);
    hand.go(mm(2.0, 1.0));
    hand.go(mm(2.0, -2.0));
    let pressed_n = spring.axial_stiffness_n_per_m() * 2e-3;
    assert!((hand.felt.force_n - DVec3::Z * pressed_n).length() < 1e-6, "{:?}", hand.felt);
    assert!(hand.felt.energy_j.unwrap() < hand.work_j, "{} J", hand.work_j);
}

/// Random laps of a hand in all six dimensions, through the air and over the ground, rolling and sliding.
#[test]
fn no_lap_through_the_air_generates_energy() {
    let mut sampler = Sampler::new(40);
    let (mut lifted, mut landed) = (0, 0);
    for lap in 0..of(200, 8) {
        let preset = Preset::ALL[(lap % 4) as usize];
        let spring = preset.spring();
        let free_length_m = spring.geometry().free_length_m;
        let friction = [10.0, 1.0, 0.2][(lap % 3) as usize];
        let mut hand = Hand::new(&spring, RodBlend::new(&spring), friction);
        // Two harmonics with zero at the start; down by a little less than up.
        let [aside, turned] =
            [[(); 4].map(|()| sampler.vector([1.0; 3])), [(); 4].map(|()| sampler.vector([1.0; 3]))];
        let ticks = 40_000;
        let at = |tick: i32| {
            let phase = std::f64::consts::TAU * f64::from(tick) / f64::from(ticks);
            let weights = [phase.sin(), 1.0 - phase.cos(), (2.0 * phase).sin(), 1.0 - (2.0 * phase).cos()];
            let sum =
                |parts: &[DVec3; 4]| parts.iter().zip(weights).map(|(part, w)| *part * w).sum::<DVec3>();
            let size = if preset == Preset::Slender { 0.02 } else { 0.06 };
            (sum(&aside) * DVec3::new(0.05, 0.05, size) * free_length_m, sum(&turned) * 0.06)
        };
        let mut was_lifted = hand.seat.is_lifted();
        for tick in 1..=2 * ticks {
            let (position_m, rotation_rad) = at(tick);
            hand.tick(position_m, rotation_rad);
            if hand.seat.is_lifted() != was_lifted {
                was_lifted = !was_lifted;
                (lifted, landed) = (lifted + u32::from(was_lifted), landed + u32::from(!was_lifted));
            }
        }
        // Home again: what is stored now was put in.
        let made_j = hand.felt.energy_j.unwrap() - hand.work_j;
        println!("{lap} {preset:?} {friction}: {:.1e} of {:.1e} J", made_j, hand.exchanged_j);
        // The trapezoidal rule meets each landing to second order in the tick.
        assert!(
            made_j <= 1e-6 * hand.exchanged_j,
            "{preset:?} {friction}: {made_j:e} of {:e} J",
            hand.exchanged_j
        );
    }
    assert!(lifted > 10 && landed > 10, "{lifted} and {landed}");
}

#[test]
fn every_pose_gets_a_finite_answer() {
    let wild = Workspace { shear: 1.5, height: 1.5, tilt_rad: 2.0, yaw_rad: 3.0 };
    for preset in Preset::ALL {
        let spring = preset.spring();
        let (mut law, mut seat) = (EnergyForm::new(&spring), Seat::new(&spring, Friction::STICKING));
        let mut sampler = Sampler::new(13);
        for _ in 0..5000 {
            let pose = wild.pose(&mut sampler, spring.geometry().free_length_m);
            let answer = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
            assert!(answer.force_n.is_finite() && answer.torque_nm.is_finite(), "{preset:?} {pose:?}");
        }
        let bad = Pose::from_rotation_vector(DVec3::new(f64::NAN, 0.0, 0.0), DVec3::ZERO);
        assert_eq!(seat.step(&mut law, &bad, Demand::Wrench).validity, Validity::InvalidInput);
    }
}

/// Whatever was tried in vain before leaves nothing behind.
#[test]
fn a_reset_seat_answers_as_a_new_one() {
    let wild = Workspace { shear: 0.5, height: 0.6, tilt_rad: 0.5, yaw_rad: 0.5 };
    for preset in Preset::ALL {
        let spring = preset.spring();
        let new = || (Rod::to_rounding(&spring, Coils::Pass), Seat::new(&spring, Friction::STICKING));
        let (mut law, mut seat) = new();
        let mut sampler = Sampler::new(14);
        for _ in 0..of(2000, 400) {
            for _ in 0..3 {
                let pose = wild.pose(&mut sampler, spring.geometry().free_length_m);
                let _ = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
            }
            law.reset();
            seat.reset();
            assert_eq!(seat, new().1, "{preset:?}");
        }
        let (mut other_law, mut other_seat) = new();
        for _ in 0..of(2000, 400) {
            let pose = wild.pose(&mut sampler, spring.geometry().free_length_m);
            let [one, other] = [(&mut law, &mut seat), (&mut other_law, &mut other_seat)]
                .map(|(law, seat)| seat.step(law, &pose, Demand::WrenchAndEnergy));
            assert_eq!(one, other, "{preset:?} {pose:?}");
        }
    }
}

/// Half as far again as the workspace a base may tip over, where no tilt is of least energy; how many poses stay without one is
/// printed, not hidden.
#[test]
fn far_out_a_base_has_an_answer_if_not_always_a_place() {
    for preset in [Preset::Thesis1, Preset::Thesis3] {
        let spring = preset.spring();
        let (mut sampler, mut stuck, count) = (Sampler::new(5), 0, of(60, 6));
        for _ in 0..count {
            let (position_m, rotation_rad) = (sampler.vector([0.03; 3]), sampler.vector([0.183; 3]));
            let (mut law, mut seat) = (RodBlend::new(&spring), Seat::new(&spring, Friction::STICKING));
            let mut validity = Validity::Ok;
            for tick in 1..=2700 {
                let part = (f64::from(tick) / 700.0).min(1.0);
                if tick > 700 && validity != Validity::NotConverged {
                    break;
                }
                let pose = Pose::from_rotation_vector(position_m * part, rotation_rad * part);
                let answer = seat.step(&mut law, &pose, Demand::WrenchAndEnergy);
                assert!(answer.force_n.is_finite() && answer.torque_nm.is_finite(), "{preset:?} {pose:?}");
                validity = answer.validity;
            }
            stuck += u32::from(validity == Validity::NotConverged);
        }
        println!("{preset:?}: {stuck} of {count} poses stay without a place");
    }
}
