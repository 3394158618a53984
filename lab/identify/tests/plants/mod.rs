//! Simulated things behind a simulated rig: the truth against which identifications are judged.
//!
//! The things are integrated in steps of a hundredth of a sample, by code that shares nothing with the laws under test.

use flotor_identify::Measurement;
use rand_core::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Period of the samples, s.
const PERIOD_S: f64 = 1.0e-3;
/// Steps of the simulation in a sample: the velocity of a step is that of its middle, half a step early.
const STEPS: usize = 100;
/// Delay of the force, in samples.
const DELAY_SAMPLES: usize = 1;
/// Standard deviation of the noise of force, N, and displacement, m.
const NOISE_N: f64 = 0.02;
const NOISE_M: f64 = 2.0e-6;

/// Motion of the probe, m over s, and its depth, m.
#[derive(Clone, Copy)]
pub(crate) enum Motion {
    /// Ramps of several rates with holds, then a chirp.
    RampsAndChirp,
    /// Ramps of several rates with holds.
    Ramps,
    /// Chirp about a depth.
    Chirp,
}

/// Thing under test.
pub(crate) struct Plant {
    pub(crate) name: &'static str,
    /// Id of the law; `none of these` outside the ladder.
    pub(crate) law: &'static str,
    /// Parameters of the law; the contact is drawn for each run.
    pub(crate) parameters: &'static [(&'static str, f64)],
    pub(crate) depth_m: f64,
    pub(crate) motion: Motion,
    /// Force, N, for a depth, m, its velocity, m/s, the step, s, and the state of the thing.
    pub(crate) force: fn(f64, f64, f64, &mut [f64; 2]) -> f64,
}

/// Measurement of a plant with its truth.
pub(crate) struct Run {
    pub(crate) measurement: Measurement,
    pub(crate) truth: Vec<(&'static str, f64)>,
}

impl Plant {
    /// Measures the thing in a run of its own: contact, rates, times and noise are drawn anew.
    pub(crate) fn measure(&self, seed: u64) -> Run {
        let mut noise =
            Noise(Pcg64Mcg::seed_from_u64(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ self.name.len() as u64));
        let contact_m = 1.0e-3 * (0.2 + 0.8 * noise.uniform());
        let path = path(self.motion, contact_m + self.depth_m, contact_m, &mut noise);
        let (mut state, mut before_m) = ([0.0; 2], path(0.0));
        let step_s = PERIOD_S / STEPS as f64;
        let (mut true_n, mut x) = (Vec::new(), Vec::new());
        let mut index = 0_usize;
        loop {
            let time_s = index as f64 * step_s;
            let Some(at_m) = Some(path(time_s)).filter(|at_m| at_m.is_finite()) else { break };
            let [from, to] = [before_m, at_m].map(|x| (x - contact_m).max(0.0));
            let force_n = (self.force)(to, (to - from) / step_s, step_s, &mut state).max(0.0);
            before_m = at_m;
            if index.is_multiple_of(STEPS) {
                x.push(at_m + NOISE_M * noise.normal());
                true_n.push(force_n);
            }
            index += 1;
        }
        let force_n =
            (0..x.len()).map(|index| true_n[index.saturating_sub(DELAY_SAMPLES)] + NOISE_N * noise.normal());
        let (force_n, times) =
            (force_n.collect(), (0..x.len()).map(|index| index as f64 * PERIOD_S).collect());
        let truth = self.parameters.iter().copied().chain([("contact_m", contact_m)]).collect();
        Run {
            measurement: Measurement::new(Some(times), x, force_n).expect("the samples are a measurement"),
            truth,
        }
    }
}

/// Returns the displacement over time; NaN after the end.
fn path(motion: Motion, deepest_m: f64, contact_m: f64, noise: &mut Noise) -> impl Fn(f64) -> f64 + use<> {
    let mut corners = vec![(0.0, 0.0)];
    let mut go = |duration_s: f64, to_m: f64| {
        let (from_s, _) = corners[corners.len() - 1];
        corners.push((from_s + duration_s, to_m));
    };
    if !matches!(motion, Motion::Chirp) {
        for rate in [1.0, 2.0, 6.0] {
            let share = 0.75 + 0.25 * noise.uniform();
            let deep_m = if rate == 1.0 { deepest_m } else { deepest_m * share };
            let ramp_s = (1.0 + 0.4 * noise.uniform()) / rate;
            go(ramp_s, deep_m);
            go(0.3 + 0.4 * noise.uniform(), deep_m);
            go(ramp_s * (0.7 + 0.6 * noise.uniform()), 0.0);
            go(0.1 + 0.2 * noise.uniform(), 0.0);
        }
    }
    let has_chirp = !matches!(motion, Motion::Ramps);
    let middle_m = contact_m + 0.5 * (deepest_m - contact_m);
    if has_chirp {
        go(0.4, middle_m);
    }
    let (end_s, _) = corners[corners.len() - 1];
    let (chirp_s, from_hz, to_hz) = (4.0, 0.5, 6.0 + 4.0 * noise.uniform());
    let amplitude_m = (0.35 + 0.1 * noise.uniform()) * (deepest_m - contact_m);
    move |time_s| {
        if time_s <= end_s {
            let after = corners.partition_point(|(corner_s, _)| *corner_s < time_s).max(1);
            let ((from_s, from_m), (to_s, to_m)) = (corners[after - 1], corners[after]);
            return from_m + (to_m - from_m) * (time_s - from_s) / (to_s - from_s);
        }
        let since_s = time_s - end_s;
        if !has_chirp || since_s > chirp_s {
            return f64::NAN;
        }
        let phase = TAU * since_s * (from_hz + 0.5 * (to_hz - from_hz) * since_s / chirp_s);
        middle_m + amplitude_m * phase.sin()
    }
}

/// Returns the step of a Maxwell element with the force `state`, exact for a constant velocity.
fn maxwell(state: &mut f64, stiffness: f64, relaxation_s: f64, velocity: f64, step_s: f64) -> f64 {
    let limit_n = stiffness * relaxation_s * velocity;
    *state = limit_n + (*state - limit_n) * (-step_s / relaxation_s).exp();
    *state
}

/// Returns all plants.
pub(crate) fn all() -> Vec<Plant> {
    use Motion::{Chirp, Ramps, RampsAndChirp};
    let plant = |name, law, parameters, depth_m, motion, force| Plant {
        name,
        law,
        parameters,
        depth_m,
        motion,
        force,
    };
    vec![
        plant(
            "linear soft",
            "linear",
            &[("stiffness_n_per_m", 600.0)],
            5.0e-3,
            RampsAndChirp,
            |d, _, _, _| 600.0 * d,
        ),
        plant(
            "linear stiff",
            "linear",
            &[("stiffness_n_per_m", 10_000.0)],
            1.0e-3,
            RampsAndChirp,
            |d, _, _, _| 1.0e4 * d,
        ),
        plant("hertz", "hertz", &[("hertz_n_per_m_1_5", 2.0e4)], 4.0e-3, RampsAndChirp, |d, _, _, _| {
            2.0e4 * d * d.sqrt()
        }),
        plant("hertz ramps", "hertz", &[("hertz_n_per_m_1_5", 9.0e4)], 2.0e-3, Ramps, |d, _, _, _| {
            9.0e4 * d.powf(1.5)
        }),
        plant(
            "hunt-crossley",
            "hunt-crossley",
            &[("hertz_n_per_m_1_5", 2.0e4), ("exponent", 1.5), ("dissipation_s_per_m", 1.5)],
            4.0e-3,
            RampsAndChirp,
            |d, v, _, _| 2.0e4 * d.powf(1.5) * (1.0 + 1.5 * v),
        ),
        plant(
            "hunt-crossley 1.8",
            "hunt-crossley",
            &[("hertz_n_per_m_1_5", 2.0e5), ("exponent", 1.8), ("dissipation_s_per_m", 4.0)],
            4.0e-3,
            RampsAndChirp,
            |d, v, _, _| 2.0e5 * d.powf(1.8) * (1.0 + 4.0 * v),
        ),
        plant(
            "zener",
            "zener",
            &[("stiffness_n_per_m", 800.0), ("maxwell_n_per_m", 400.0), ("relaxation_s", 0.3)],
            4.0e-3,
            RampsAndChirp,
            |d, v, dt, state| 800.0 * d + maxwell(&mut state[0], 400.0, 0.3, v, dt),
        ),
        plant(
            "zener fast",
            "zener",
            &[("stiffness_n_per_m", 2000.0), ("maxwell_n_per_m", 1500.0), ("relaxation_s", 0.04)],
            2.0e-3,
            RampsAndChirp,
            |d, v, dt, state| 2000.0 * d + maxwell(&mut state[0], 1500.0, 0.04, v, dt),
        ),
        plant(
            "spring",
            "spring",
            &[("stiffness_n_per_m", 700.0), ("travel_m", 4.0e-3), ("coil_contact_n_per_m", 5000.0)],
            5.0e-3,
            RampsAndChirp,
            |d, _, _, _| 700.0 * d + 5000.0 * (d - 4.0e-3).max(0.0),
        ),
        plant(
            "hysteresis",
            "hysteresis",
            &[("stiffness_n_per_m", 1000.0), ("sticking_n_per_m", 4000.0), ("friction_n", 0.5)],
            4.0e-3,
            RampsAndChirp,
            |d, v, dt, state| {
                state[0] = (state[0] + 4000.0 * v * dt).clamp(-0.5, 0.5);
                1000.0 * d + state[0]
            },
        ),
        plant("table", "table", &[], 4.0e-3, RampsAndChirp, |d, _, _, _| {
            0.15 * ((1000.0 * d).exp() - 1.0) + 600.0 * d * (1.0 + 0.5 * (3000.0 * d).sin())
        }),
        plant("two relaxations", "none of these", &[], 4.0e-3, RampsAndChirp, |d, v, dt, state| {
            let [fast, slow] = state;
            800.0 * d + maxwell(fast, 500.0, 0.02, v, dt) + maxwell(slow, 500.0, 0.8, v, dt)
        }),
        plant("quasi-linear", "none of these", &[], 4.0e-3, RampsAndChirp, |d, v, dt, state| {
            let rate = 3.0e4 * d.sqrt() * v;
            2.0e4 * d.powf(1.5) + maxwell(&mut state[0], 1.0, 0.3, 0.5 * rate, dt)
        }),
        plant("square drag", "none of these", &[], 4.0e-3, Chirp, |d, v, _, _| {
            if d > 0.0 { 800.0 * d + 60.0 * v * v.abs() } else { 0.0 }
        }),
    ]
}

struct Noise(Pcg64Mcg);

impl Noise {
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}
