//! The rule against a simulation that shares nothing with it: a mass under a constant weight rests on a wall that is
//! sampled, late and filtered, and is disturbed a little.

use super::{Damper, SampledLoop};
use crate::math;
use std::collections::VecDeque;

/// A handle on a wall.
struct Handle {
    mass_kg: f64,
    damping_ns_per_m: f64,
    /// Bandwidth of the velocity estimate, Hz.
    bandwidth_hz: f64,
    period_s: f64,
    latency_ticks: usize,
    damper: Damper,
}

const WEIGHT_N: f64 = 5.0;
/// First distance from the place of rest, as a share of the depth there.
const DISTURBANCE: f64 = 0.004;

impl Handle {
    /// True if a disturbance has decayed after ten seconds on a wall of this stiffness.
    fn comes_to_rest(&self, stiffness_n_per_m: f64) -> bool {
        let Self { mass_kg, damping_ns_per_m, bandwidth_hz, period_s, latency_ticks, damper } = *self;
        let rate = damping_ns_per_m / mass_kg;
        let decay = math::exp(-rate * period_s);
        // Exact motion under a force that is constant for a period.
        let glide_s = (1.0 - decay) / rate;
        let rest_m = WEIGHT_N / stiffness_n_per_m;
        let disturbance_m = DISTURBANCE * rest_m;
        let (mut depth_m, mut speed, mut estimate) = (rest_m + disturbance_m, 0.0, 0.0);
        let mut samples = VecDeque::from(vec![depth_m; latency_ticks + 2]);
        let share = 1.0 - math::exp(-std::f64::consts::TAU * bandwidth_hz * period_s);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // counts
        let ticks = (10.0 / period_s).round() as usize;
        let mut last_m = 0.0_f64;
        for tick in 0..ticks {
            samples.push_back(depth_m);
            samples.pop_front();
            let (before_m, seen_m) = (samples[0], samples[1]);
            estimate += share * ((seen_m - before_m) / period_s - estimate);
            let damped = match damper {
                Damper::BothWays(damping) => damping * estimate,
                Damper::OneWay(damping) => damping * estimate.max(0.0),
            };
            let push_n = if seen_m > 0.0 { (stiffness_n_per_m * seen_m + damped).max(0.0) } else { 0.0 };
            let drift = (WEIGHT_N - push_n) / damping_ns_per_m;
            depth_m += drift * period_s + (speed - drift) * glide_s;
            speed = drift + (speed - drift) * decay;
            if tick > ticks - ticks / 10 {
                last_m = last_m.max((depth_m - rest_m).abs());
            }
            if depth_m.is_nan() || depth_m.abs() > 1.0 {
                return false;
            }
        }
        last_m < disturbance_m
    }

    /// Stiffness at which the handle stops coming to rest, N/m.
    fn limit_n_per_m(&self) -> f64 {
        let (mut stable, mut unstable) = (1.0e2_f64, 1.0e6_f64);
        while unstable / stable > 1.001 {
            let between = (stable * unstable).sqrt();
            *(if self.comes_to_rest(between) { &mut stable } else { &mut unstable }) = between;
        }
        stable
    }

    fn sampled(&self) -> SampledLoop {
        SampledLoop { period_s: self.period_s, latency_s: self.latency_ticks as f64 * self.period_s }
    }
}

fn handles(dampers: &[Damper]) -> Vec<Handle> {
    let mut handles = Vec::new();
    for damper in dampers {
        for (damping_ns_per_m, period_s) in [(2.0, 1.0e-3), (0.5, 1.0e-3), (2.0, 0.25e-3)] {
            for latency_ticks in 0..4 {
                handles.push(Handle {
                    mass_kg: 0.58,
                    damping_ns_per_m,
                    bandwidth_hz: 1.0e6,
                    period_s,
                    latency_ticks,
                    damper: *damper,
                });
            }
        }
    }
    handles
}

/// The rule drops terms of the order of `(b + B) (T + latency) / m`; the search ends within 0.1 %.
#[test]
fn the_rule_is_where_a_handle_on_a_wall_stops_coming_to_rest() {
    for handle in handles(&[Damper::OneWay(15.0), Damper::BothWays(15.0)]) {
        let Handle { mass_kg, damping_ns_per_m, period_s, latency_ticks, damper, .. } = handle;
        let rule = handle.sampled().stability_limit(damping_ns_per_m, damper);
        let share = handle.limit_n_per_m() / rule;
        let delay_s = period_s * (1 + latency_ticks) as f64;
        let dropped = (damping_ns_per_m + 15.0) * delay_s / mass_kg + 1.0e-3;
        assert!(
            (1.0 - share).abs() < dropped,
            "{share} of {rule} N/m, {dropped}; b {damping_ns_per_m}, T {period_s}, {latency_ticks} ticks, {damper:?}"
        );
    }
}

/// Half of the limit is for filters and light handles: 200 Hz, and the 45 g of a stylus.
#[test]
fn a_light_handle_with_a_filtered_velocity_rests_on_a_wall_of_the_largest_stiffness() {
    let mut rested = 0;
    for mass_kg in [0.045, 0.1, 0.2, 0.58] {
        for handle in handles(&[Damper::OneWay(15.0)]) {
            let handle = Handle { mass_kg, bandwidth_hz: 200.0, ..handle };
            let stiffness = handle.sampled().largest_stiffness(0.0, handle.damper);
            let Handle { period_s, latency_ticks, .. } = handle;
            assert!(
                handle.comes_to_rest(stiffness),
                "{mass_kg} kg, {stiffness} N/m, T {period_s}, {latency_ticks} ticks"
            );
            rested += 1;
        }
    }
    assert_eq!(rested, 48);
}
