//! Grid of cases, measured in parallel, with their results.

use super::search::is_search_end;
use super::simulated_loop::{Grip, LoopError, LoopSetup};
use super::theory::{Rendering, exact_limit_n_per_m, gil_limit_n_per_m, passive_limit_n_per_m};
use flotor_loader::Plugin;
use rayon::prelude::*;
use serde::Serialize;

/// Loop configuration as a point of the grid.
pub type Case = LoopSetup;

/// Case with its measured and theoretical limits.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Row {
    /// Time between two samples, s.
    pub period_s: f64,
    /// Delay of a force, whole periods.
    pub delay_ticks: u32,
    /// Viscous damping of the device, N s/m.
    pub plant_damping_ns_per_m: f64,
    /// Virtual damping, N s/m.
    pub virtual_damping_ns_per_m: f64,
    /// Step of the position sensor, m.
    pub quantum_m: f64,
    /// Grip of the hand on the device.
    pub hand: Grip,
    /// Largest stable stiffness of the simulated loop, N/m; 0 if no stiffness is stable.
    pub k_max_n_per_m: f64,
    /// Limit of the exact sampled-data system with an ideal sensor, N/m.
    pub exact_n_per_m: f64,
    /// True if the search for `k_max_n_per_m` or for `exact_n_per_m` reached its upper end: the limit is then above the
    /// value.
    pub search_ended: bool,
    /// Limit by Gil's rule, N/m.
    pub gil_n_per_m: f64,
    /// Largest stiffness that is passive in any hand (Colgate and Schenkel), N/m.
    pub passive_n_per_m: f64,
}

impl Row {
    /// Returns the relative deviation of the measured from the exact limit: infinite where only the measured loop is
    /// stable, 0 where neither is. `None` where a limit is beyond the end of the search or NaN.
    #[must_use]
    pub fn deviation(&self) -> Option<f64> {
        let Self { k_max_n_per_m: measured, exact_n_per_m: exact, search_ended, .. } = *self;
        let share = if measured == exact { 0.0 } else { measured / exact - 1.0 };
        (!search_ended && !share.is_nan()).then_some(share)
    }
}

/// Returns the largest magnitude of the deviations of all rows; `None` without any. Not real-time.
#[must_use]
pub fn worst_deviation(rows: &[Row]) -> Option<f64> {
    rows.iter().filter_map(Row::deviation).map(f64::abs).max_by(f64::total_cmp)
}

/// Returns the default grid: virtual damping from none to beyond its optimum at three delays, and single cases with
/// more device damping and a faster servo. The device damping of 0.5 N s/m is a quarter of the simulated flotor's
/// default, which is an estimate: an unmeasured device may have less.
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

/// Measures every case on the device of `plugin`, in parallel on all processors; `done` is called after each. The rows
/// are in the order of the cases, independent of the schedule. Not real-time.
///
/// # Errors
/// The first [`LoopError`] of a case.
pub fn measure(plugin: &Plugin, cases: &[Case], done: impl Fn() + Sync) -> Result<Vec<Row>, LoopError> {
    let measured = |case: &Case| {
        let row = row(plugin, case);
        done();
        row
    };
    let rows: Vec<Result<Row, LoopError>> = cases.par_iter().map(measured).collect();
    rows.into_iter().collect()
}

fn row(plugin: &Plugin, case: &Case) -> Result<Row, LoopError> {
    let period_s = case.period_ns as f64 * 1.0e-9;
    let Case { delay_ticks, plant_damping_ns_per_m, virtual_damping_ns_per_m, quantum_m, grip, .. } = *case;
    let rendering = Rendering { period_s, delay_ticks, virtual_damping_ns_per_m };
    let plant = case.plant(plugin)?;
    let limits = [case.limit_n_per_m(plugin)?, exact_limit_n_per_m(&plant, &rendering)];
    let [k_max_n_per_m, exact_n_per_m] = limits;
    Ok(Row {
        period_s,
        delay_ticks,
        plant_damping_ns_per_m,
        virtual_damping_ns_per_m,
        quantum_m,
        hand: grip,
        k_max_n_per_m,
        exact_n_per_m,
        search_ended: limits.into_iter().any(is_search_end),
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

    fn row_with(k_max_n_per_m: f64, exact_n_per_m: f64) -> Row {
        Row {
            period_s: 1.0e-3,
            delay_ticks: 0,
            plant_damping_ns_per_m: 0.5,
            virtual_damping_ns_per_m: 0.0,
            quantum_m: 0.0,
            hand: Grip::Open,
            k_max_n_per_m,
            exact_n_per_m,
            search_ended: [k_max_n_per_m, exact_n_per_m].into_iter().any(is_search_end),
            gil_n_per_m: 0.0,
            passive_n_per_m: 0.0,
        }
    }

    #[test]
    fn a_limit_that_was_not_found_deviates_by_no_number() {
        let end = 1_048_576.0;
        for (measured, exact) in [(end, end), (end, 1.0), (f64::NAN, 1.0), (1.0, f64::NAN)] {
            let row = row_with(measured, exact);
            assert_eq!(row.deviation(), None, "{measured} {exact}");
            assert_eq!(worst_deviation(&[row]), None);
        }
        assert_eq!(row_with(0.0, 0.0).deviation(), Some(0.0));
        assert_eq!(row_with(3.0, 0.0).deviation(), Some(f64::INFINITY));
        let rows =
            [row_with(end, 1.0), row_with(98.0, 100.0), row_with(101.0, 100.0), row_with(f64::NAN, 1.0)];
        assert!((worst_deviation(&rows).expect("two have one") - 0.02).abs() < 1.0e-15);
    }

    #[test]
    fn no_case_is_measured_twice() {
        let cases = default_cases();
        for (index, case) in cases.iter().enumerate() {
            assert!(!cases[..index].contains(case), "{case:?}");
        }
    }
}
