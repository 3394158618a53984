use flotor_hal::glam::{DMat3, DVec2, DVec3, DVec4};

use super::{Quartic, coefficients};
use crate::bending::Bending;
use crate::preset::Preset;
use crate::rigidity::Spring;
use crate::shape::{Shape, relative_length, saturated_argument};
use flotor_lanes::angle::measures;

/// Normal of a section that leans from the chord (third axis) by the given vector.
fn normal(lean: DVec2) -> DVec3 {
    let angle = lean.length();
    let across = lean * if angle > 0.0 { angle.sin() / angle } else { 1.0 };
    across.extend(angle.cos())
}

/// The exact rod's energy of bending, shear and compression on the shape of the linear column: the integral of
/// the module documentation, nothing expanded.
fn exact_energy(spring: &Spring, length_m: f64, sway_rad: DVec2, bow_rad: DVec2) -> f64 {
    let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
    let z = Shape::argument(rigidities, free_length_m, length_m).unwrap();
    let shape = Shape::new(rigidities, free_length_m, length_m, z).unwrap();
    let (mut curvature2, mut mean, mut dyad) = (0.0, DVec3::ZERO, DMat3::ZERO);
    let steps = 400;
    for i in 0..=steps {
        // Simpson's rule.
        let factor = if i == 0 || i == steps { 1.0 } else { 2.0 + 2.0 * f64::from(i % 2) };
        let weight = factor / (3.0 * f64::from(steps));
        let [sway, bow] = shape.lean(f64::from(i) / f64::from(steps) - 0.5);
        let lean = sway_rad * sway.value + bow_rad * bow.value;
        let slope = sway_rad * sway.slope + bow_rad * bow.slope;
        let angle = lean.length();
        // Across the direction of the lean, a step on the sphere is shorter than in the plane of leans.
        let (radial, turning) = if angle > 0.0 {
            (slope.dot(lean) / angle, slope.perp_dot(lean) / angle * (angle.sin() / angle))
        } else {
            (slope.x, slope.y)
        };
        curvature2 += weight * (radial * radial + turning * turning);
        let n = normal(lean);
        mean += weight * n;
        dyad += DMat3::from_cols(n * n.x, n * n.y, n * n.z) * weight;
    }
    let compliance = DMat3::from_diagonal(DVec3::splat(1.0 / rigidities.beta_n))
        + dyad * (1.0 / rigidities.gamma_n - 1.0 / rigidities.beta_n);
    let gap = DVec3::new(0.0, 0.0, length_m / free_length_m) - mean;
    0.5 * rigidities.alpha_n_m2 / free_length_m * curvature2
        + 0.5 * free_length_m * gap.dot(compliance.inverse() * gap)
}

/// Energy of bending by the law under test, at the same ends.
fn energy(spring: &Spring, length_m: f64, sway_rad: DVec2, bow_rad: DVec2) -> f64 {
    let free_length_m = spring.geometry().free_length_m;
    let [lower, upper] = [sway_rad - bow_rad, sway_rad + bow_rad].map(normal);
    let versine = |a: DVec3, b: DVec3| 0.5 * (a - b).length_squared();
    let versines = [versine(lower, DVec3::Z), versine(upper, DVec3::Z), versine(lower, upper)];
    let (angles, _) = measures(versines, 0.0, 0.0);
    let shortening_m = free_length_m - length_m;
    let bending = Bending::new(spring).at(length_m, shortening_m, &angles);
    bending.energy_j + 0.5 * spring.axial_stiffness_n_per_m() * shortening_m * shortening_m
}

#[test]
fn energy_is_right_to_fourth_order() {
    // Remainder of order six: halving the angles divides it by 64.
    let directions = [
        (DVec2::new(1.0, 0.0), DVec2::ZERO),
        (DVec2::ZERO, DVec2::new(0.0, 0.5)),
        (DVec2::new(0.7, 0.0), DVec2::new(-0.5, 0.0)),
        (DVec2::new(0.6, 0.2), DVec2::new(-0.2, 0.5)),
    ];
    for preset in [Preset::Thesis1, Preset::Thesis2, Preset::Thesis3] {
        let spring = preset.spring();
        for relative in [0.75, 0.9, 1.0, 1.3] {
            let length_m = relative * spring.geometry().free_length_m;
            for (sway, bow) in directions {
                let unit_j = spring.rigidities().alpha_n_m2 / spring.geometry().free_length_m;
                let remainder = |scale: f64| {
                    let found = energy(&spring, length_m, sway * scale, bow * scale);
                    (found - exact_energy(&spring, length_m, sway * scale, bow * scale)) / unit_j
                };
                let (coarse, fine) = (remainder(0.2), remainder(0.1));
                // Floor: the fit is good to 2e-4 of coefficients of up to five units, times angle⁴.
                let floor = 1e-3 * 0.1f64.powi(4);
                assert!(
                    fine.abs() < coarse.abs() / 40.0 + floor,
                    "{preset:?} L = {relative} L0, {sway} {bow}: {coarse:e} {fine:e}"
                );
            }
        }
    }
}

#[test]
fn fit_follows_the_coefficients() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        let quartic = Quartic::new(&spring);
        // Relative to the largest coefficient; documented: the slender spring's run to its pole is harder.
        let tolerance = if preset == Preset::Slender { 1e-2 } else { 2e-4 };
        let (shortest, longest) = (quartic.shortest.knee_m, quartic.longest.knee_m);
        for step in 0..=100 {
            let length_m = shortest + (longest - shortest) * f64::from(step) / 100.0;
            let exact = coefficients(rigidities, free_length_m, length_m / free_length_m);
            let found = quartic.form_at(length_m).coefficients;
            let found = DVec4::from_array(found) * rigidities.gamma_n;
            let error = (found - exact).abs().max_element() / exact.abs().max_element();
            assert!(error < tolerance, "{preset:?} at {length_m}: {error:e}");
        }
    }
}

#[test]
fn derivatives_agree_with_differences() {
    let h = 1e-4;
    for preset in Preset::ALL {
        let spring = preset.spring();
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        let quartic = Quartic::new(&spring);
        // Inside the fit, in both saturated ends and far outside.
        for relative in [0.1, 0.22, 0.5, 0.8, 0.97, 1.0, 1.4, 1.78, 3.0] {
            let length_m = relative * free_length_m;
            for squares in [[0.01, 0.02, 0.04], [0.3, 0.1, 0.5], [1.5, 2.0, 0.7]] {
                let at = |step_m: f64, offsets: [f64; 3]| {
                    let z = |length| {
                        saturated_argument(Shape::argument(rigidities, free_length_m, length).unwrap()).value
                    };
                    let length = length_m + step_m;
                    let tiny = 1e-3 * h * free_length_m;
                    let z_slope = (z(length + tiny) - z(length - tiny)) / (2.0 * tiny);
                    let moved = [0, 1, 2].map(|i| squares[i] + offsets[i]);
                    quartic.at(&quartic.form_at(length), z(length), z_slope, moved)
                };
                let here = at(0.0, [0.0; 3]);
                let scale = here.energy_j.abs() + here.by_squares.map(f64::abs).iter().sum::<f64>();
                for i in 0..3 {
                    let mut offset = [0.0; 3];
                    offset[i] = h;
                    let slope = (at(0.0, offset).energy_j - at(0.0, offset.map(|o| -o)).energy_j) / (2.0 * h);
                    // Second-order differences: h² times third derivatives, magnified towards the pole.
                    assert!((slope - here.by_squares[i]).abs() < 1e-4 * scale, "{preset:?} {relative} {i}");
                }
                let step = 0.1 * h * free_length_m;
                let slope = (at(step, [0.0; 3]).energy_j - at(-step, [0.0; 3]).energy_j) / (2.0 * step);
                let tolerance = 1e-4 * (here.by_length.abs() + scale / free_length_m);
                assert!((slope - here.by_length).abs() < tolerance, "{preset:?} {relative} length");
            }
        }
    }
}

#[test]
fn lengths_are_inverse_to_arguments() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        let (rigidities, free_length_m) = (spring.rigidities(), spring.geometry().free_length_m);
        for z in [-60.0, -3.0, 0.0, 1.0, 8.75] {
            let load = rigidities.gamma_n * free_length_m * free_length_m / (4.0 * rigidities.alpha_n_m2);
            let excess = 1.0 - rigidities.gamma_n / rigidities.beta_n;
            let Some(relative) = relative_length(load, excess, z) else {
                assert!(z > 3.0, "only compression has a largest argument");
                continue;
            };
            let again = Shape::argument(rigidities, free_length_m, relative * free_length_m).unwrap();
            assert!((again - z).abs() < 1e-12 * (1.0 + z.abs()), "{preset:?}: {again} instead of {z}");
        }
    }
}
