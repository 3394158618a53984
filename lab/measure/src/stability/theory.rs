//! Theoretical limits of the stable stiffness.
//!
//! Three limits, from exact to simple:
//! - [`exact_limit_n_per_m`]: the sampled-data system itself. Mass and damper under a zero-order hold are discretised
//!   without error, spring, damper and delay are added in `z`, and the characteristic polynomial must have all roots
//!   inside the unit circle. Valid for the stability of this device alone.
//! - [`passive_limit_n_per_m`]: Colgate and Schenkel (1997, J. Robotic Systems 14:37): the device stays stable
//!   in *any* passive hand if its own damping exceeds what sampling feeds back at every frequency.
//! - [`gil_limit_n_per_m`]: Gil, Sanchez, Hulin, Preusche and Hirzinger (2009, J. Comput. Inf. Sci. Eng.
//!   9:011005): a linear rule for little damping, short delay and fast sampling.

use super::search::largest_stable;
use flotor_hal::{Damper, SampledLoop, math};
pub use flotor_judge::plant::Plant;
use std::convert::Infallible;
use std::f64::consts::PI;

/// Sampling period, delay and damping of a rendered spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rendering {
    /// Time between two samples, s.
    pub period_s: f64,
    /// Whole periods between a sample and its force, beyond the hold.
    pub delay_ticks: u32,
    /// Virtual damping by backward difference, N s/m.
    pub virtual_damping_ns_per_m: f64,
}

/// Relative tolerance of the search for the exact limit.
const EXACT_TOLERANCE: f64 = 1.0e-9;

/// Returns the largest stiffness at which the sampled loop is stable, N/m: 0 if no stiffness is stable, and the [end of the
/// search](super::is_search_end) if it is stable up to there. Not real-time.
#[must_use]
pub fn exact_limit_n_per_m(plant: &Plant, rendering: &Rendering) -> f64 {
    let held = HeldPlant::new(plant, rendering.period_s);
    let Ok(limit) = largest_stable(EXACT_TOLERANCE, |stiffness_n_per_m| {
        Ok::<_, Infallible>(is_schur_stable(characteristic(&held, rendering, stiffness_n_per_m)))
    });
    limit
}

/// Returns the largest stiffness that a device of `damping_ns_per_m` renders passively, N/m; 0 if the device renders no stiffness
/// passively. Not real-time.
///
/// Colgate and Schenkel's condition `b > T/2 / (1 - cos wT) Re[(1 - e^-jwT) H(e^jwT)]` at every frequency up to Nyquist's. Without
/// delay it is `b > K T/2 + |B|`; with delay, at low frequency, `b > K (T/2 + delay)`.
#[must_use]
pub fn passive_limit_n_per_m(damping_ns_per_m: f64, rendering: &Rendering) -> f64 {
    /// Number of evaluated frequencies: the bounds vary smoothly, over a few periods for a few ticks of delay.
    const FREQUENCIES: u32 = 4096;
    let Rendering { period_s, delay_ticks, virtual_damping_ns_per_m } = *rendering;
    let delay = f64::from(delay_ticks);
    let (mut least, mut most) = (0.0_f64, f64::INFINITY);
    for index in 1..=FREQUENCIES {
        let angle = PI * f64::from(index) / f64::from(FREQUENCIES);
        // Real part of (1 - e^-ja)^n e^-jda over 2 (1 - cos a), for the spring (n = 1) and the damper (n = 2).
        let cosine = |ticks: f64| math::cos(angle * (delay + ticks));
        let scale = 2.0 * (1.0 - math::cos(angle));
        let of_spring = period_s * (cosine(0.0) - cosine(1.0)) / scale;
        let of_damper = (cosine(0.0) - 2.0 * cosine(1.0) + cosine(2.0)) / scale;
        let left = damping_ns_per_m - virtual_damping_ns_per_m * of_damper;
        // K of_spring <= left: an upper bound where sampling generates energy, a lower bound where it dissipates energy.
        if of_spring > 0.0 {
            most = most.min(left / of_spring);
        } else if left < 0.0 {
            least = least.max(left / of_spring);
        }
    }
    if most >= least && most.is_finite() { most } else { 0.0 }
}

/// Evaluates Gil's rule `K < (b + B) / (T/2 + delay)`, N/m, with all damping of device and hand in `b`. Not real-time.
#[must_use]
pub fn gil_limit_n_per_m(plant: &Plant, rendering: &Rendering) -> f64 {
    let Rendering { period_s, delay_ticks, virtual_damping_ns_per_m } = *rendering;
    let sampled = SampledLoop { period_s, latency_s: period_s * f64::from(delay_ticks) };
    sampled.stability_limit(plant.damping_ns_per_m, Damper::BothWays(virtual_damping_ns_per_m))
}

/// Transfer function from force to position of a plant under a zero-order hold: `(b1 z + b0) / (z^2 + a1 z + a0)`.
struct HeldPlant {
    a0: f64,
    a1: f64,
    b0: f64,
    b1: f64,
}

impl HeldPlant {
    fn new(plant: &Plant, period_s: f64) -> Self {
        let [[xx, xv, xu], [vx, vv, vu]] = plant.held(period_s);
        Self { a0: xx * vv - xv * vx, a1: -(xx + vv), b0: xv * vu - vv * xu, b1: xu }
    }
}

/// Returns the characteristic polynomial of the loop, lowest power first: `(z^2 + a1 z + a0) z^(d+1) + (b1 z + b0) ((K
/// + B/T) z - B/T)`.
fn characteristic(plant: &HeldPlant, rendering: &Rendering, stiffness_n_per_m: f64) -> Vec<f64> {
    let HeldPlant { a0, a1, b0, b1 } = *plant;
    let damper = rendering.virtual_damping_ns_per_m / rendering.period_s;
    let (now, before) = (stiffness_n_per_m + damper, -damper);
    let delayed = rendering.delay_ticks as usize + 1;
    let open_loop = std::iter::repeat_n(0.0, delayed).chain([a0, a1, 1.0]);
    let fed_back = [b0 * before, b0 * now + b1 * before, b1 * now].into_iter().chain(std::iter::repeat(0.0));
    open_loop.zip(fed_back).map(|(open, back)| open + back).collect()
}

/// Returns true if all roots of a real polynomial, lowest power first, lie strictly inside the unit circle: the
/// Schur-Cohn recursion (Jury 1964), which lowers the degree one by one without computing a root.
fn is_schur_stable(mut polynomial: Vec<f64>) -> bool {
    while let (Some(&last), Some(&first), true) =
        (polynomial.last(), polynomial.first(), polynomial.len() > 1)
    {
        let reflection = first / last;
        if reflection.abs() >= 1.0 || reflection.is_nan() {
            return false;
        }
        let reversed = polynomial.iter().rev();
        polynomial =
            polynomial.iter().zip(reversed).skip(1).map(|(up, down)| up - reflection * down).collect();
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASS_KG: f64 = 0.58;

    fn flotor(damping_ns_per_m: f64) -> Plant {
        Plant { mass_kg: MASS_KG, damping_ns_per_m, stiffness_n_per_m: 0.0 }
    }

    fn at(period_s: f64, delay_ticks: u32, virtual_damping_ns_per_m: f64) -> Rendering {
        Rendering { period_s, delay_ticks, virtual_damping_ns_per_m }
    }

    #[test]
    fn the_exponential_of_a_damped_mass_is_the_textbook_hold() {
        let (period_s, damping) = (1.0e-3, 15.0);
        let rate = damping / MASS_KG;
        let decay = math::exp(-rate * period_s);
        let held = HeldPlant::new(&flotor(damping), period_s);
        // Roots of the denominator are 1 and the decay; rounding of numbers of order one.
        assert!((held.a0 - decay).abs() < 4.0e-16 && (held.a1 + 1.0 + decay).abs() < 4.0e-16);
        let moved = (period_s + math::exp_m1(-rate * period_s) / rate) / damping;
        // The textbook form cancels: rate T = 0.026, so it loses four digits.
        assert!((held.b1 / moved - 1.0).abs() < 1.0e-11, "{} {moved}", held.b1);
    }

    #[test]
    fn schur_stability_agrees_with_known_roots() {
        // (z - a)(z - b)(z - c) with real roots, lowest power first.
        let cubic = |a: f64, b: f64, c: f64| vec![-a * b * c, a * b + b * c + c * a, -(a + b + c), 1.0];
        assert!(is_schur_stable(cubic(0.999, -0.999, 0.5)));
        assert!(!is_schur_stable(cubic(1.001, -0.5, 0.5)));
        assert!(!is_schur_stable(cubic(0.0, 0.0, -1.001)));
        // A complex pair r e^(+-j): z^2 - 2 r cos(1) z + r^2.
        let pair = |r: f64| vec![r * r, -2.0 * r * 1.0_f64.cos(), 1.0];
        assert!(is_schur_stable(pair(0.9999)) && !is_schur_stable(pair(1.0001)));
        assert!(!is_schur_stable(vec![f64::NAN, 0.0, 1.0]));
    }

    /// The limit of a free mass without delay and virtual damping has a closed form: the product of the roots
    /// of the quadratic characteristic polynomial reaches one.
    #[test]
    fn without_delay_the_limit_is_where_the_product_of_the_roots_is_one() {
        for (damping, period_s) in [(0.5, 1.0e-3), (2.0, 1.0e-3), (0.5, 0.25e-3)] {
            let held = HeldPlant::new(&flotor(damping), period_s);
            let closed_form = (1.0 - held.a0) / held.b0;
            let exact = exact_limit_n_per_m(&flotor(damping), &at(period_s, 0, 0.0));
            // b0 is a difference of numbers 1e3 times larger.
            assert!((exact / closed_form - 1.0).abs() < 1.0e-8, "{exact} {closed_form}");
        }
    }

    #[test]
    fn gil_holds_for_little_damping_and_fast_sampling() {
        for (damping, rendering) in
            [(0.5, at(1.0e-3, 0, 0.0)), (0.5, at(1.0e-3, 1, 0.0)), (0.5, at(0.25e-3, 0, 0.0))]
        {
            let (exact, gil) = (
                exact_limit_n_per_m(&flotor(damping), &rendering),
                gil_limit_n_per_m(&flotor(damping), &rendering),
            );
            // The next term is of the order of period times damping over mass, 1e-3.
            assert!((exact / gil - 1.0).abs() < 1.0e-3, "{exact} {gil}");
        }
    }

    #[test]
    fn passivity_without_delay_is_colgate_and_schenkels_line() {
        for (damping, virtual_damping) in [(0.5, 0.0), (2.0, 0.5), (2.0, 1.9)] {
            let limit = passive_limit_n_per_m(damping, &at(1.0e-3, 0, virtual_damping));
            let line = 2.0 * (damping - virtual_damping) / 1.0e-3;
            assert!((limit / line - 1.0).abs() < 1.0e-9, "{limit} {line}");
        }
        assert_eq!(passive_limit_n_per_m(0.5, &at(1.0e-3, 0, 15.0)), 0.0, "more virtual than real damping");
    }

    #[test]
    fn passive_is_stricter_than_stable_and_delay_lowers_both() {
        for delay in 0..3 {
            let (here, later) = (at(1.0e-3, delay, 0.0), at(1.0e-3, delay + 1, 0.0));
            let (passive, exact) =
                (passive_limit_n_per_m(0.5, &here), exact_limit_n_per_m(&flotor(0.5), &here));
            assert!(passive <= exact * 1.0001, "{passive} {exact}");
            assert!(exact_limit_n_per_m(&flotor(0.5), &later) < exact);
            assert!(passive_limit_n_per_m(0.5, &later) < passive);
        }
    }

    #[test]
    fn a_relaxed_hand_raises_the_limit() {
        let held = Plant { mass_kg: MASS_KG + 0.554, damping_ns_per_m: 0.5 + 6.45, stiffness_n_per_m: 135.0 };
        assert!(
            exact_limit_n_per_m(&held, &at(1.0e-3, 0, 0.0))
                > 10.0 * exact_limit_n_per_m(&flotor(0.5), &at(1.0e-3, 0, 0.0))
        );
    }

    #[test]
    fn too_much_virtual_damping_is_unstable_at_any_stiffness() {
        assert_eq!(exact_limit_n_per_m(&flotor(0.5), &at(1.0e-3, 2, 1000.0)), 0.0);
    }
}
