//! The cases that are measured, side by side on all processors, and what is reported of each.

use super::simulated_loop::{Grip, LoopError, LoopSetup};
use super::theory::{Rendering, exact_limit_n_per_m, gil_limit_n_per_m, passive_limit_n_per_m};
use flotor_hal::abi::loader::Plugin;
use rayon::prelude::*;
use serde::Serialize;

/// One point of the grid.
pub type Case = LoopSetup;

/// A case with its measured limit and what theory says.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    /// Time between two samples, s.
    pub period_s: f64,
    /// Whole periods a force waits.
    pub delay_ticks: u32,
    /// Drag of the device, N s/m.
    pub plant_damping_ns_per_m: f64,
    /// Virtual damping, N s/m.
    pub virtual_damping_ns_per_m: f64,
    /// Step of the position sensor, m.
    pub quantum_m: f64,
    /// How the device is held.
    pub hand: Grip,
    /// Largest stable stiffness of the simulated loop, N/m; 0 if there is none.
    pub k_max_n_per_m: f64,
    /// Of the exact sampled-data system with an ideal sensor, N/m.
    pub exact_n_per_m: f64,
    /// By Gil's rule, N/m.
    pub gil_n_per_m: f64,
    /// Largest stiffness that is passive in any hand (Colgate and Schenkel), N/m.
    pub passive_n_per_m: f64,
}

impl Row {
    /// Deviation of the measured from the exact limit, as a share of it; 0 where neither is stable.
    #[must_use]
    pub fn deviation(&self) -> f64 {
        if self.exact_n_per_m > 0.0 {
            self.k_max_n_per_m / self.exact_n_per_m - 1.0
        } else if self.k_max_n_per_m > 0.0 {
            f64::INFINITY
        } else {
            0.0
        }
    }
}

/// The default grid: virtual damping from none to beyond its best at three delays, and single cases with more
/// drag and a faster servo. Its drag of 0.5 N s/m is a quarter of what the simulated flotor has by default: that is an
/// estimate, and a device that nobody has measured may have less.
#[must_use]
pub fn default_cases() -> Vec<Case> {
    const VIRTUAL_DAMPING_NS_PER_M: [f64; 13] =
        [0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 50.0, 100.0, 150.0, 200.0, 300.0, 400.0, 500.0];
    let case = |period_ns, delay_ticks, plant_damping_ns_per_m, virtual_damping_ns_per_m| Case {
        period_ns,
        delay_ticks,
        plant_damping_ns_per_m,
        virtual_damping_ns_per_m,
        quantum_m: 0.0,
        grip: Grip::Open,
    };
    let sweep = (0..=2)
        .flat_map(|delay| VIRTUAL_DAMPING_NS_PER_M.map(|damping| case(1_000_000, delay, 0.5, damping)));
    let single = [case(1_000_000, 0, 2.0, 0.0), case(250_000, 0, 0.5, 0.0), case(250_000, 1, 0.5, 15.0)];
    sweep.chain(single).collect()
}

/// Measures every case on the device of `plugin`, as many at a time as there are processors; `done` is told
/// after each. The rows come in the order of the cases, whatever the processors did. Not real-time.
///
/// # Errors
/// [`LoopError`] of the first case that has one.
pub fn measure(plugin: &Plugin, cases: &[Case], done: impl Fn() + Sync) -> Result<Vec<Row>, LoopError> {
    let rows: Vec<Result<Row, LoopError>> = cases
        .par_iter()
        .map(|case| {
            let row = row(plugin, case);
            done();
            row
        })
        .collect();
    rows.into_iter().collect()
}

fn row(plugin: &Plugin, case: &Case) -> Result<Row, LoopError> {
    let period_s = case.period_ns as f64 * 1.0e-9;
    let Case { delay_ticks, plant_damping_ns_per_m, virtual_damping_ns_per_m, quantum_m, grip, .. } = *case;
    let rendering = Rendering { period_s, delay_ticks, virtual_damping_ns_per_m };
    let plant = case.plant(plugin)?;
    Ok(Row {
        period_s,
        delay_ticks,
        plant_damping_ns_per_m,
        virtual_damping_ns_per_m,
        quantum_m,
        hand: grip,
        k_max_n_per_m: case.limit_n_per_m(plugin)?,
        exact_n_per_m: exact_limit_n_per_m(&plant, &rendering),
        gil_n_per_m: gil_limit_n_per_m(&plant, &rendering),
        passive_n_per_m: passive_limit_n_per_m(plant_damping_ns_per_m, &rendering),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stability::theory::Plant;

    /// Limits of a free 580 g flotor to five digits, computed with other software from the definition: period in
    /// ns, delay, drag, virtual damping, stiffness.
    const PUBLISHED: [(u64, u32, f64, f64, f64); 8] = [
        (1_000_000, 0, 0.5, 0.0, 1000.1),
        (1_000_000, 0, 2.0, 0.0, 4002.3),
        (1_000_000, 1, 0.5, 0.0, 333.4),
        (1_000_000, 0, 0.5, 15.0, 30_213.0),
        (1_000_000, 1, 0.5, 15.0, 10_038.0),
        (1_000_000, 1, 0.5, 30.0, 19_166.0),
        (250_000, 0, 0.5, 0.0, 4000.1),
        (250_000, 1, 0.5, 15.0, 41_039.0),
    ];

    #[test]
    fn the_default_grid_holds_the_published_cases_and_theory_meets_them() {
        let cases = default_cases();
        for (period_ns, delay_ticks, damping, virtual_damping, limit) in PUBLISHED {
            let wanted = Case {
                period_ns,
                delay_ticks,
                plant_damping_ns_per_m: damping,
                virtual_damping_ns_per_m: virtual_damping,
                quantum_m: 0.0,
                grip: Grip::Open,
            };
            assert!(cases.contains(&wanted), "{wanted:?}");
            let rendering = Rendering {
                period_s: period_ns as f64 * 1.0e-9,
                delay_ticks,
                virtual_damping_ns_per_m: virtual_damping,
            };
            let plant = Plant { mass_kg: 0.58, damping_ns_per_m: damping, stiffness_n_per_m: 0.0 };
            let exact = exact_limit_n_per_m(&plant, &rendering);
            // Half a unit of the last digit given.
            assert!((exact / limit - 1.0).abs() < 2.0e-4, "{wanted:?}: {exact} {limit}");
        }
    }

    #[test]
    fn no_case_is_measured_twice() {
        let cases = default_cases();
        for (index, case) in cases.iter().enumerate() {
            assert!(!cases[..index].contains(case), "{case:?}");
        }
    }
}
