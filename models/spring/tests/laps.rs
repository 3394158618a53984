//! Random laps of a hand in all six dimensions, from a micrometre to a tenth of a millimetre a tick, with each option of
//! the spring: whatever it rolls, slides, touches, leaves or lands on, no lap gives the hand energy.

use std::f64::consts::TAU;

use crate::printed::assert_chapter_prints;
use crate::sample::{Loop, Sampler, Workspace, of};
use flotor_hal::glam::{DQuat, DVec3};
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

/// Of a lap, J.
struct Work {
    /// What the hand got, by the trapezoidal rule on exact velocities.
    given_j: f64,
    exchanged_j: f64,
    /// By how much that differs from the rule on every other tick: what a kink leaves uncertain.
    uncertain_j: f64,
    /// What the spring stores at the end beyond the start, at the same pose.
    stored_j: f64,
    /// Ticks without an equilibrium.
    waited: u32,
}

/// Of a lap from where it begins, `first` laps after the hand was put there.
fn work(path: &Path, ticks: u32, first: u32, mut respond: impl FnMut(&Pose) -> Response) -> Work {
    let (mut powers, mut stored_j, mut waited) = (Vec::new(), [0.0; 2], 0);
    for tick in 0..=(first + 1) * ticks {
        let phase = TAU * f64::from(tick % ticks) / f64::from(ticks);
        let (pose, velocity, angular) = path.at(phase);
        let answer = respond(&pose);
        assert!(answer.force_n.is_finite() && answer.torque_nm.is_finite(), "{pose:?}: {answer:?}");
        if tick.is_multiple_of(ticks) {
            stored_j = [stored_j[1], answer.energy_j.unwrap_or_default()];
        }
        if tick >= first * ticks {
            powers.push(answer.force_n.dot(velocity) + answer.torque_nm.dot(angular));
            waited += u32::from(answer.validity == Validity::NotConverged);
        }
    }
    let interval = TAU / f64::from(ticks);
    // By the trapezoidal rule: where a spring falls over, a lap does not end as it began.
    let ends = 0.5 * (powers.first().unwrap_or(&0.0) + powers.last().unwrap_or(&0.0));
    let given_j = interval * (powers.iter().sum::<f64>() - ends);
    let half_j = 2.0 * interval * (powers.iter().step_by(2).sum::<f64>() - ends);
    Work {
        given_j,
        // One that has fallen over exchanges nothing.
        exchanged_j: (interval * powers.iter().map(|power| power.abs()).sum::<f64>()).max(f64::MIN_POSITIVE),
        uncertain_j: (given_j - half_j).abs(),
        stored_j: stored_j[1] - stored_j[0],
        waited,
    }
}

/// Length of a lap with turns at a lever of the free length, m.
fn length_m(path: &Path, free_length_m: f64) -> f64 {
    let steps = 400;
    let speed = |step: u32| {
        let (_, velocity, angular) = path.at(TAU * f64::from(step) / f64::from(steps));
        (velocity.length_squared() + (angular * free_length_m).length_squared()).sqrt()
    };
    (0..steps).map(speed).sum::<f64>() * TAU / f64::from(steps)
}

/// Whether a lap may cost energy.
#[derive(Clone, Copy, PartialEq)]
enum Dissipation {
    /// Nothing slides and nothing snaps.
    None,
    /// A base that slides, or a bulge that swings round.
    Some,
}

/// Whether stiffness has steps.
#[derive(Clone, Copy, PartialEq)]
enum Kinks {
    None,
    /// Where coils meet.
    OfCoils,
}

/// Of touching coils.
const STIFFNESS_N_PER_M: f64 = 25.0e3;

/// One kind of law: of a spring and a number of the lap, what answers.
type Law = fn(&Spring, u32) -> Box<dyn FnMut(&Pose) -> Response>;

fn of_law<S: HeldSpring + 'static>(mut law: S) -> Box<dyn FnMut(&Pose) -> Response> {
    Box::new(move |pose| law.respond(pose, Demand::WrenchAndEnergy))
}

fn on_seat<S: HeldSpring + 'static>(
    spring: &Spring,
    lap: u32,
    mut law: S,
) -> Box<dyn FnMut(&Pose) -> Response> {
    let coefficient = [10.0, 1.0, 0.2][(lap % 3) as usize];
    let mut seat = Seat::new(spring, Friction { coefficient });
    Box::new(move |pose| seat.step(&mut law, pose, Demand::WrenchAndEnergy))
}

fn wired<L>(spring: &Spring, law: L) -> Held<L> {
    Held { law, contact: None, wire: Some(Wire::new(spring)) }
}

/// What a hand does: down to touching coils or past buckling, or up and down through the air.
#[derive(Clone, Copy)]
enum Way {
    Deep,
    /// The same from the first tick of the first lap on, put there from rest: in the second a spring may lie.
    DeepAtOnce,
    Shallow,
}

/// A lap, lowered so that its lowest point is where it has to be.
struct Path {
    lap: Loop,
    lowered_m: f64,
}

impl Path {
    fn at(&self, phase: f64) -> (Pose, DVec3, DVec3) {
        let (pose, velocity, angular) = self.lap.at(phase);
        (Pose { position_m: pose.position_m - DVec3::Z * self.lowered_m, ..pose }, velocity, angular)
    }
}

fn path(spring: &Spring, preset: Preset, way: Way, sampler: &mut Sampler) -> Path {
    let geometry = spring.geometry();
    let solid = 1.0 - geometry.solid_length_m() / geometry.free_length_m;
    // Down to solid for those that reach it unbuckled, past buckling for the others.
    let depth = match preset {
        Preset::Thesis1 | Preset::Thesis2 => solid + 0.01,
        Preset::Thesis3 => 0.6,
        Preset::Slender => 0.12,
    };
    // How far down it goes, and how far up and down, in free lengths.
    let (lowest, height, shear) = match (way, preset) {
        (Way::Deep | Way::DeepAtOnce, _) => (depth, 0.6 * depth, 0.15),
        (Way::Shallow, Preset::Slender) => (0.03, 0.1, 0.08),
        (Way::Shallow, _) => (0.08, 0.25, 0.08),
    };
    let workspace = Workspace { shear, height, tilt_rad: 0.12, yaw_rad: 0.12 };
    let lap = Loop::new(sampler, workspace, geometry.free_length_m);
    let heights = (0..400).map(|step| lap.at(TAU * f64::from(step) / 400.0).0.position_m.z);
    let lowered_m = heights.fold(f64::INFINITY, f64::min) + lowest * geometry.free_length_m;
    Path { lap, lowered_m }
}

/// By how much shorter the ticks are in which a lap is walked again that seems to generate energy. The error of the
/// trapezoidal rule is then at least this much smaller; what a law itself generates in a lap is not.
const SHORTER_TICKS: u32 = 8;

/// Largest energy that a lap generated, as a share of its work.
struct Made {
    /// Where nothing slides and nothing snaps.
    held: f64,
    /// Where something does.
    loose: f64,
}

impl Made {
    fn most(&self) -> f64 {
        self.held.max(self.loose)
    }
}

/// Holds the chapter to a row of its table of energies, at full size.
fn assert_book_has(option: &str, shares: &str) {
    if of(1, 0) == 1 {
        assert_chapter_prints("models/spring/seat-and-wire.md", &format!("| {option} | {shares} |"));
    }
}

/// 200 laps at full size, every tick length from 1 to 100 µm.
fn laps(
    name: &str,
    way: Way,
    touches: Kinks,
    dissipation: impl Fn(Preset, u32) -> Dissipation,
    law: Law,
) -> Made {
    let (mut sampler, mut is_kept) = (Sampler::new(90), true);
    let (mut worst, mut wasted, mut eaten, mut waiting) = ([0.0f64; 2], 0.0f64, 0, 0);
    for lap in 0..of(200, 8) {
        let preset = Preset::ALL[(lap % 4) as usize];
        let spring = preset.spring();
        let path = path(&spring, preset, way, &mut sampler);
        let tick_m = 1e-6 * 10f64.powf(1.0 + sampler.signed());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // tens of thousands
        let ticks = 2 * (0.5 * length_m(&path, spring.geometry().free_length_m) / tick_m).ceil() as u32;
        // The first lap forgets where it came from.
        let first = u32::from(!matches!(way, Way::DeepAtOnce));
        let respond = law(&spring, lap);
        let Work { given_j, exchanged_j, uncertain_j, stored_j, waited } = work(&path, ticks, first, respond);
        // What the hand got beyond what the store lost, less what the rule leaves open.
        let made = (given_j + stored_j - uncertain_j) / exchanged_j;
        let lost = (-(given_j + stored_j) - uncertain_j) / exchanged_j;
        // The trapezoidal rule meets a kink of 25 N/mm with that times the square of a tick over eight; two harmonics go in and
        // out four times.
        let open =
            if touches == Kinks::OfCoils { STIFFNESS_N_PER_M * tick_m * tick_m / exchanged_j } else { 0.0 };
        let lost = lost - open;
        let kind = dissipation(preset, lap);
        let mut made = made;
        if made > 1e-6 && touches == Kinks::OfCoils {
            let finer = work(&path, ticks * SHORTER_TICKS, first, law(&spring, lap));
            let still_made = (finer.given_j + finer.stored_j) / finer.exchanged_j;
            println!(
                "{name}, lap {lap}, {preset:?}, {:.1} µm: the rule has {made:.1e}, in ticks {SHORTER_TICKS} times shorter \
                 {still_made:.1e}",
                tick_m * 1e6
            );
            if still_made * f64::from(SHORTER_TICKS) <= made {
                made = still_made;
            }
        }
        worst[usize::from(kind == Dissipation::Some)] =
            worst[usize::from(kind == Dissipation::Some)].max(made);
        if made > 1e-6 || (kind == Dissipation::None && lost > 1e-6) {
            println!(
                "{name}, lap {lap}, {preset:?}, {:.1} µm: made {made:.1e}, lost {lost:.1e}, open {:.1e}",
                tick_m * 1e6,
                uncertain_j / exchanged_j
            );
        }
        match kind {
            // The first tick of all is a jump.
            Dissipation::None => (wasted, waiting) = (wasted.max(lost), waiting + waited * first),
            Dissipation::Some => eaten += u32::from(lost > 1e-6),
        }
        is_kept &= made <= 1e-6 && (kind == Dissipation::Some || lost <= 1e-6);
    }
    println!(
        "{name}: made at most {:.1e} of the work, where something slides or snaps {:.1e}, {eaten} laps cost some; \
         lost where nothing does {wasted:.1e}, {waiting} ticks wait there",
        worst[0], worst[1]
    );
    assert!(is_kept && waiting == 0, "{name}: {waiting} ticks wait");
    Made { held: worst[0], loose: worst[1] }
}

/// Springs 3 and `slender` are taken past buckling, where a bulge may swing round.
fn snaps(preset: Preset, _lap: u32) -> Dissipation {
    match preset {
        Preset::Thesis1 | Preset::Thesis2 => Dissipation::None,
        Preset::Thesis3 | Preset::Slender => Dissipation::Some,
    }
}

fn jumps(_preset: Preset, _lap: u32) -> Dissipation {
    Dissipation::Some
}

fn slides(_preset: Preset, _lap: u32) -> Dissipation {
    Dissipation::Some
}

#[test]
fn no_lap_generates_energy_with_the_default_law() {
    let made = laps("energy", Way::Deep, Kinks::None, snaps, |spring, _| of_law(RodBlend::new(spring)));
    assert_book_has("`energy`", &format!("{:.1e}", made.most()));
}

#[test]
fn no_lap_generates_energy_with_the_rod() {
    let made = laps("rod, tight", Way::Deep, Kinks::None, snaps, |spring, _| {
        of_law(Rod::to_rounding(spring, Coils::Pass))
    });
    assert_book_has("`rod`, solved to rounding", &format!("{:.1e}", made.most()));
}

#[test]
fn no_lap_generates_energy_with_the_rod_of_the_servo() {
    let made = laps("rod, servo", Way::Deep, Kinks::None, snaps, |spring, _| {
        of_law(Rod::new(spring, Accuracy::Servo))
    });
    assert_book_has("`rod`, servo setting", &format!("{:.1e}, past buckling {:.1e}", made.held, made.loose));
}

#[test]
fn no_lap_generates_energy_with_touching_coils() {
    let made = laps("contact", Way::Deep, Kinks::OfCoils, snaps, |spring, _| {
        of_law(Rod::to_rounding(spring, Coils::Touch))
    });
    let shares = format!("{:.1e}; {:.1e}", made.held, made.loose);
    assert_book_has("`coil_contact=on`, springs 1 and 2; past buckling", &shares);
    laps("contact, servo", Way::Deep, Kinks::OfCoils, snaps, |spring, _| {
        of_law(Rod::with_coils(spring, Accuracy::Servo, Coils::Touch))
    });
}

/// From rest to anywhere in one tick, on from there: what the rod loses on its way to an equilibrium nobody gets.
#[test]
fn no_lap_generates_energy_that_begins_with_a_jump() {
    let touching = laps("contact, at once", Way::DeepAtOnce, Kinks::OfCoils, jumps, |spring, _| {
        of_law(Rod::to_rounding(spring, Coils::Touch))
    });
    laps("contact, servo, at once", Way::DeepAtOnce, Kinks::OfCoils, jumps, |spring, _| {
        of_law(Rod::with_coils(spring, Accuracy::Servo, Coils::Touch))
    });
    let passing = laps("rod, servo, at once", Way::DeepAtOnce, Kinks::None, jumps, |spring, _| {
        of_law(Rod::new(spring, Accuracy::Servo))
    });
    let shares = format!("{:.1e}, {:.1e}", touching.loose, passing.loose);
    assert_book_has("laps that begin with a jump from rest, `coil_contact=on`, `rod`", &shares);
}

#[test]
fn no_lap_generates_energy_with_a_wire() {
    let energy =
        laps("wire", Way::Deep, Kinks::None, snaps, |spring, _| of_law(wired(spring, RodBlend::new(spring))));
    let rod = laps("wire, rod", Way::Deep, Kinks::None, snaps, |spring, _| {
        of_law(wired(spring, Rod::to_rounding(spring, Coils::Pass)))
    });
    let shares = format!("{:.1e}, {:.1e}", energy.most(), rod.most());
    assert_book_has("`wire=on`, `energy`, `rod`", &shares);
}

#[test]
fn no_lap_generates_energy_on_a_free_seat() {
    let energy = laps("seat", Way::Shallow, Kinks::None, slides, |spring, lap| {
        on_seat(spring, lap, RodBlend::new(spring))
    });
    let rod = laps("seat, rod", Way::Shallow, Kinks::None, slides, |spring, lap| {
        on_seat(spring, lap, Rod::to_rounding(spring, Coils::Pass))
    });
    let shares = format!("{:.1e}, {:.1e}", energy.loose, rod.loose);
    assert_book_has("`seat=free`, `energy`, `rod`", &shares);
}

/// Pressed past buckling on a free seat a spring may fall over.
#[test]
fn no_lap_generates_energy_where_a_free_spring_falls_over() {
    let seat = laps("seat, deep", Way::DeepAtOnce, Kinks::None, slides, |spring, lap| {
        on_seat(spring, lap, RodBlend::new(spring))
    });
    let all = laps("seat, contact, wire, deep", Way::DeepAtOnce, Kinks::OfCoils, slides, |spring, lap| {
        on_seat(spring, lap, wired(spring, Rod::to_rounding(spring, Coils::Touch)))
    });
    let again = laps("seat, contact, wire, deep again", Way::Deep, Kinks::OfCoils, slides, |spring, lap| {
        on_seat(spring, lap, wired(spring, Rod::to_rounding(spring, Coils::Touch)))
    });
    let shares = format!("{:.1e}; {:.1e}; {:.1e}", seat.loose, all.loose, again.loose);
    assert_book_has(
        "`seat=free` past buckling, where springs fall over; all three; on their second lap",
        &shares,
    );
}

#[test]
fn no_lap_generates_energy_with_everything() {
    let made = laps("seat, contact, wire", Way::Shallow, Kinks::OfCoils, slides, |spring, lap| {
        on_seat(spring, lap, wired(spring, Rod::to_rounding(spring, Coils::Touch)))
    });
    assert_book_has("all three", &format!("{:.1e}", made.loose));
}

/// The largest singular value of the tangent is at least what steps along each axis, both ways, make of force and torque.
fn stiffness_n_per_m<L: HeldSpring + Clone>(
    law: &L,
    seat: &Seat,
    pose: &Pose,
    lever_m: f64,
    small_m: f64,
) -> f64 {
    let here = seat.clone().step(&mut law.clone(), pose, Demand::WrenchAndEnergy);
    let mut most = 0.0f64;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        for by in [axis * small_m, axis * -small_m] {
            let shifted = Pose { position_m: pose.position_m + by, ..*pose };
            let turned =
                Pose { orientation: DQuat::from_scaled_axis(by / lever_m) * pose.orientation, ..*pose };
            for other in [shifted, turned] {
                let there = seat.clone().step(&mut law.clone(), &other, Demand::WrenchAndEnergy);
                most = most.max(apart_n(&here, &there, lever_m) / small_m);
            }
        }
    }
    most
}

/// Distance of two wrenches, torques at a lever (N).
fn apart_n(a: &Response, b: &Response, lever_m: f64) -> f64 {
    ((a.force_n - b.force_n).length_squared()
        + (a.torque_nm - b.torque_nm).length_squared() / (lever_m * lever_m))
        .sqrt()
}

/// Rolling, sliding, lifting off, landing: no step of the wrench above 1.5 of stiffness and travel.
#[test]
fn no_tick_on_a_free_seat_is_a_jump() {
    let mut sampler = Sampler::new(91);
    let (mut moved, mut jumps, mut worst, mut waited) = (0, 0, 0.0f64, 0);
    for lap in 0..of(60, 12) {
        let preset = Preset::ALL[(lap % 4) as usize];
        let spring = preset.spring();
        let lever_m = spring.geometry().free_length_m;
        let path = path(&spring, preset, Way::Shallow, &mut sampler);
        let tick_m = [1e-5, 1e-4, 3e-5, 1e-6, 3e-6][(lap % 5) as usize];
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // tens of thousands
        let ticks = (length_m(&path, lever_m) / tick_m).ceil() as u32;
        let at = |tick: f64| path.at(TAU * tick / f64::from(ticks)).0;
        let friction = Friction { coefficient: [10.0, 1.0, 0.2][(lap % 3) as usize] };
        let (mut law, mut seat) = (RodBlend::new(&spring), Seat::new(&spring, friction));
        let mut last = seat.step(&mut law, &at(0.0), Demand::WrenchAndEnergy);
        for tick in 1..=ticks {
            let (law_before, seat_before) = (law.clone(), seat);
            let felt = seat.step(&mut law, &at(f64::from(tick)), Demand::WrenchAndEnergy);
            let step_n = apart_n(&felt, &last, lever_m);
            // Less is within the tolerance of friction.
            if step_n > 1e-6 && tick > 1 {
                moved += 1;
                waited += u32::from(felt.validity == Validity::NotConverged);
                // Steps ten times smaller, before and after; along the path first, which tells most.
                let small = |law: &RodBlend, seat: &Seat, from: &Response, at: &Pose| {
                    let there = seat.clone().step(&mut law.clone(), at, Demand::WrenchAndEnergy);
                    apart_n(&there, from, lever_m) / (0.1 * tick_m)
                };
                let along = small(&law_before, &seat_before, &last, &at(f64::from(tick) - 0.9)).max(small(
                    &law,
                    &seat,
                    &felt,
                    &at(f64::from(tick) + 0.1),
                ));
                if step_n > 1.5 * along * tick_m {
                    let stiffness = along
                        .max(stiffness_n_per_m(
                            &law_before,
                            &seat_before,
                            &at(f64::from(tick) - 1.0),
                            lever_m,
                            0.1 * tick_m,
                        ))
                        .max(stiffness_n_per_m(&law, &seat, &at(f64::from(tick)), lever_m, 0.1 * tick_m));
                    let ratio = step_n / (stiffness * tick_m);
                    worst = worst.max(ratio);
                    if ratio > 1.5 {
                        jumps += 1;
                        println!(
                            "{lap} {preset:?} {friction:?} {tick_m:.0e} m, tick {tick}: {step_n:.1e} N, {ratio:.1} {:?} {:?} {:?}",
                            last.force_n, felt.force_n, felt.validity
                        );
                    }
                }
            }
            last = felt;
        }
    }
    println!("{jumps} of {moved} ticks jump, the worst by {worst:.1}; {waited} wait");
    assert_eq!(jumps, 0);
}
