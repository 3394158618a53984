//! Response functions against closed forms, and the Gramian against a finer quadrature.

use super::*;

/// Rates (1/s, 1/s²) of every damping regime, at the limits of the series for a step of 1 ms.
const REGIMES: [(f64, f64); 7] = [
    (0.0, 0.0),
    (250.0, 0.0),
    (0.0, 62_500.0),
    (250.0, 62_500.0),
    (250.0, 15_625.0),
    (3.4, 1_950.0),
    (250.0, 100.0),
];

const STEP_S: f64 = 1.0e-3;

fn oscillator((damping, stiffness): (f64, f64)) -> Oscillator {
    Oscillator { damping_per_s: DVec3::splat(damping), stiffness_per_s2: DVec3::splat(stiffness) }
}

/// Impulse response and its derivative from the textbook formula of each regime.
fn impulse_response((beta, kappa): (f64, f64), t: f64) -> (f64, f64) {
    let half = 0.5 * beta;
    let discriminant = half * half - kappa;
    let decay = (-half * t).exp();
    if discriminant == 0.0 {
        (t * decay, (1.0 - half * t) * decay)
    } else if discriminant < 0.0 {
        let w = (-discriminant).sqrt();
        let (sin, cos) = (w * t).sin_cos();
        (decay * sin / w, decay * (cos - half * sin / w))
    } else {
        let w = discriminant.sqrt();
        (decay * (w * t).sinh() / w, decay * ((w * t).cosh() - half * (w * t).sinh() / w))
    }
}

#[test]
fn response_equals_the_textbook_formula_in_every_damping_regime() {
    for regime in REGIMES {
        let Response([p0, p1, ..]) = oscillator(regime).response(STEP_S);
        let (expected, derivative) = impulse_response(regime, STEP_S);
        // A handful of roundings on either side.
        assert!((p1.x - expected).abs() <= 8.0 * f64::EPSILON * STEP_S, "{regime:?}: {} {expected}", p1.x);
        assert!((p0.x - derivative).abs() <= 8.0 * f64::EPSILON, "{regime:?}: {} {derivative}", p0.x);
    }
}

#[test]
fn higher_responses_are_integrals_of_lower_ones() {
    for regime in REGIMES {
        let oscillator = oscillator(regime);
        let Response(at_end) = oscillator.response(STEP_S);
        let mut integral = [DVec3::ZERO; ORDER];
        for (node, weight) in GAUSS_LEGENDRE_5 {
            let Response(p) = oscillator.response(node * STEP_S);
            for n in 0..ORDER {
                integral[n] += p[n] * weight * STEP_S;
            }
        }
        for n in 0..ORDER {
            // Rounding of five terms; the quadrature itself is exact to degree 9.
            let size = at_end[n + 1].x.abs();
            assert!((integral[n].x - at_end[n + 1].x).abs() <= 1.0e-14 * size, "{regime:?}, p{}", n + 1);
        }
    }
}

#[test]
fn two_half_steps_make_a_step() {
    for regime in REGIMES {
        let oscillator = oscillator(regime);
        let start = Drive {
            velocity: DVec3::splat(0.3),
            acceleration: DVec3::splat(-40.0),
            jerk: DVec3::splat(900.0),
        };
        let half = oscillator.response(0.5 * STEP_S);
        let full = oscillator.response(STEP_S);
        let midway = Drive {
            velocity: half.velocity(&start),
            acceleration: start.acceleration + start.jerk * (0.5 * STEP_S)
                - oscillator.stiffness_per_s2 * half.displacement(&start),
            jerk: start.jerk,
        };
        let displacement = half.displacement(&start) + half.displacement(&midway);
        let velocity = half.velocity(&midway);
        assert!(
            (displacement - full.displacement(&start)).abs().max_element() <= 1.0e-15 * 3.0e-4,
            "{regime:?}"
        );
        assert!((velocity - full.velocity(&start)).abs().max_element() <= 2.0e-15 * 0.3, "{regime:?}");

        let halves = oscillator.gramian(0.5 * STEP_S);
        let twice = halves.squared_velocity(&start) + halves.squared_velocity(&midway);
        let once = oscillator.gramian(STEP_S).squared_velocity(&start);
        // What five nodes leave at the longest step is 1e-13 of the integral, 2^-10 of that on half the step.
        assert!((twice - once).abs().max_element() <= 1.0e-13 * once.x, "{regime:?}: {} {}", twice.x, once.x);
    }
}
