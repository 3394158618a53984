use flotor_hal::glam::DVec3;

use super::*;
use crate::pose::Pose;
use crate::preset::Preset;
use crate::rod::Coils;

type Medium = Equilibrium<12, 24, 16>;

const EFFORT: Effort =
    Effort { most_steps: 8, most_matrices: 8, matrix_life: 1, tolerance: 1e-14, renewal: 1e-13 };

fn plate(preset: Preset, shear: f64, compression: f64, rotation_rad: DVec3) -> Plate {
    let free_length_m = preset.spring().geometry().free_length_m;
    let position_m = DVec3::new(shear, 0.0, -compression) * free_length_m;
    Plate::new(&Pose::from_rotation_vector(position_m, rotation_rad), free_length_m).unwrap()
}

fn rod(preset: Preset) -> Medium {
    Medium::new(Ratios::new(&preset.spring(), Coils::Pass), EFFORT)
}

/// Newton's method without regard to stability, in steps from one plate to another; returns the Morse index.
fn follow_any(rod: &mut Medium, from: &Plate, goal: &Plate) -> usize {
    let mut index = 0;
    for step in 0..=200 {
        let part = f64::from(step) / 200.0;
        let plate = Plate::combination(&[*from, *goal], &[1.0 - part, part]);
        for _ in 0..8 {
            let value = rod.functional.value(&rod.shape, &plate);
            let matrix = rod.functional.curvature(&value).matrix;
            let factored = Factored::new(&matrix, 0.0);
            index = factored.negative();
            rod.shape = added(&rod.shape, -1.0, &factored.solve(&value.slope));
        }
    }
    let slope = length(&rod.functional.value(&rod.shape, goal).slope);
    assert!(slope < 1e-11, "an equilibrium to rounding: {slope:e}");
    index
}

#[test]
fn straight_rod_past_buckling_is_unstable_twice() {
    // Haringx's buckling compressions are 0.0828 (slender) and 0.5454 (spring 3); springs 1 and 2 have none.
    for (preset, compression, index) in [
        (Preset::Slender, 0.0825, 0),
        (Preset::Slender, 0.0831, 2),
        (Preset::Slender, 0.1, 2),
        (Preset::Thesis3, 0.545, 0),
        (Preset::Thesis3, 0.546, 2),
        (Preset::Thesis1, 0.7, 0),
        (Preset::Thesis2, 0.7, 0),
    ] {
        let mut rod = rod(preset);
        let goal = plate(preset, 0.0, compression, DVec3::ZERO);
        assert_eq!(follow_any(&mut rod, &Plate::HOME, &goal), index, "{preset:?} {compression}");
        assert_eq!(rod.shape, [0.0; 24], "the straight rod is an equilibrium");
        // Asked to be at rest there, the rod says it is unstable and leaves.
        let mut rod = self::rod(preset);
        let outcome = rod.advance(&goal, Demand::Force);
        assert_eq!(rod.unstable_directions, index);
        assert_eq!(matches!(outcome, Outcome::Settled(_)), index == 0);
    }
}

#[test]
fn tilted_unbuckled_state_is_unstable_and_stiffer() {
    // The slender rod, compressed straight by 40 % and then tilted by two degrees: about 9.8 N, unless it
    // bulges.
    let straight = plate(Preset::Slender, 0.0, 0.4, DVec3::ZERO);
    let goal = plate(Preset::Slender, 0.0, 0.4, DVec3::new(0.0, 2f64.to_radians(), 0.0));
    let mut rod = rod(Preset::Slender);
    let index = follow_any(&mut rod, &straight, &goal);
    let spring = Preset::Slender.spring();
    let unit_n = spring.rigidities().alpha_n_m2 / spring.geometry().free_length_m.powi(2);
    let force_n = -unit_n * rod.functional.value(&rod.shape, &goal).load.force.z;
    assert!(index > 0, "{index} {force_n}");
    assert!((force_n - 9.8).abs() < 0.3, "{force_n} N");
    // From exactly there it slides to the bulging state of a quarter of the force.
    rod.history = History::new(goal, rod.shape);
    let settled = settle(&mut rod, &goal);
    assert!((-unit_n * settled.force.z - 2.4).abs() < 0.1, "{} N", -unit_n * settled.force.z);
}

fn settle(rod: &mut Medium, goal: &Plate) -> Reading {
    for _ in 0..2000 {
        if let Outcome::Settled(reading) = rod.advance(goal, Demand::WrenchAndEnergy) {
            return reading;
        }
    }
    panic!("no equilibrium at {goal:?}");
}

#[test]
fn sliding_never_gains_energy() {
    let goal = plate(Preset::Slender, 0.02, 0.3, DVec3::new(0.02, 0.05, 0.1));
    let mut rod = rod(Preset::Slender);
    let mut last = f64::INFINITY;
    for tick in 0..2000 {
        let outcome = rod.advance(&goal, Demand::WrenchAndEnergy);
        let energy = rod.functional.value(&rod.shape, &goal).energy;
        // A push off a saddle is along falling energy too.
        assert!(energy <= last * (1.0 + 1e-12), "tick {tick}: {last} {energy}");
        last = energy;
        if let Outcome::Settled(_) = outcome {
            return;
        }
    }
    panic!("never settled");
}

#[test]
fn derivatives_are_those_of_the_energy() {
    let moderate = plate(Preset::Thesis1, 0.2, 0.3, DVec3::new(0.3, -0.2, 0.4));
    check_derivatives(&rod(Preset::Thesis1).functional, &moderate, 1e-8);
    // Close to solid, a good part of the coils touch on the inner side, and the rest does not.
    let touching = Functional::new(Ratios::new(&Preset::Thesis1.spring(), Coils::Touch));
    let close = plate(Preset::Thesis1, 0.1, 0.66, DVec3::new(0.1, -0.2, 0.1));
    // Rounded off within a twentieth of a radian, contact has derivatives that are larger by its fourth power.
    check_derivatives(&touching, &close, 1e-6);
}

fn check_derivatives(functional: &Functional<12, 24, 16>, goal: &Plate, allowed: f64) {
    let shape: Shape<24> = std::array::from_fn(|i| 0.1 * (1.7 * i as f64).sin() / (1.0 + i as f64));
    let value = functional.value(&shape, goal);
    let Curvature { matrix, reaction } = functional.curvature(&value);
    let h = 1e-3;
    for direction in 0..24 {
        let at = |n: f64| {
            let mut moved = shape;
            moved[direction] += n * h;
            functional.value(&moved, goal)
        };
        let [m2, m1, p1, p2] = [-2.0, -1.0, 1.0, 2.0].map(at);
        // Differences of fourth order: h⁴ times a fifth derivative of order 100, relative to values of order
        // 10.
        let derivative =
            |f: &dyn Fn(&Value<24, 16>) -> f64| (8.0 * (f(&p1) - f(&m1)) - (f(&p2) - f(&m2))) / (12.0 * h);
        let check = |name: &str, found: f64, expected: f64| {
            assert!((found - expected).abs() < allowed, "{name} {direction}: {found} {expected}");
        };
        check("slope", value.slope[direction], derivative(&|value| value.energy));
        for (row, entries) in matrix.iter().enumerate() {
            check("matrix", entries[direction], derivative(&|value| value.slope[row]));
        }
        for axis in 0..3 {
            check("force", reaction.force[axis][direction], derivative(&|value| value.load.force[axis]));
        }
        for axis in 0..2 {
            check("lean", reaction.by_lean[axis][direction], derivative(&|value| value.by_lean[axis]));
        }
        check("torsion", reaction.torsion[direction], derivative(&|value| value.load.torsion));
    }
}
