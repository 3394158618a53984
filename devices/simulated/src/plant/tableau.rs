//! Butcher's Runge-Kutta method of order six with seven stages, as data.
//!
//! Butcher 1964, "On Runge-Kutta processes of high order", J. Austral. Math. Soc. 4:179. Seven stages are the fewest of any
//! explicit method of order six. Compared with the classical method of order four it costs three more evaluations a step
//! and allows steps six times longer at the accuracy required by the energy balance.

/// Number of evaluations per step.
pub(super) const STAGES: usize = 7;

/// Distinct times of evaluation, as fractions of the step.
pub(super) const NODES: [f64; 5] = [0.0, 1.0 / 3.0, 0.5, 2.0 / 3.0, 1.0];

/// Index of the last of [`NODES`]: the end of the step.
pub(super) const END: usize = NODES.len() - 1;

/// A stage: its evaluation time (an index into [`NODES`]), and the coefficients of the earlier slopes.
pub(super) struct Stage {
    pub(super) node: usize,
    pub(super) along: &'static [f64],
}

pub(super) const TABLEAU: [Stage; STAGES] = [
    Stage { node: 0, along: &[] },
    Stage { node: 1, along: &[1.0 / 3.0] },
    Stage { node: 3, along: &[0.0, 2.0 / 3.0] },
    Stage { node: 1, along: &[1.0 / 12.0, 1.0 / 3.0, -1.0 / 12.0] },
    Stage { node: 2, along: &[-1.0 / 16.0, 9.0 / 8.0, -3.0 / 16.0, -3.0 / 8.0] },
    Stage { node: 2, along: &[0.0, 9.0 / 8.0, -3.0 / 8.0, -3.0 / 4.0, 1.0 / 2.0] },
    Stage { node: END, along: &[9.0 / 44.0, -9.0 / 11.0, 63.0 / 44.0, 18.0 / 11.0, 0.0, -16.0 / 11.0] },
];

/// Weight of each slope in the whole step.
pub(super) const WEIGHTS: [f64; STAGES] =
    [11.0 / 120.0, 0.0, 27.0 / 40.0, 27.0 / 40.0, -4.0 / 15.0, -4.0 / 15.0, 11.0 / 120.0];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weights_integrate_polynomials_up_to_the_fifth_power() {
        for power in 0..6 {
            let integral: f64 = TABLEAU
                .iter()
                .zip(WEIGHTS)
                .map(|(stage, weight)| weight * NODES[stage.node].powi(power))
                .sum();
            assert!((integral * f64::from(power + 1) - 1.0).abs() < 1.0e-15, "{power}: {integral}");
        }
    }

    #[test]
    fn every_stage_goes_as_far_as_its_node() {
        for (index, stage) in TABLEAU.iter().enumerate() {
            assert_eq!(stage.along.len(), index);
            assert!((stage.along.iter().sum::<f64>() - NODES[stage.node]).abs() < 1.0e-15, "{index}");
        }
    }

    #[test]
    fn one_step_of_a_linear_equation_errs_by_the_seventh_power() {
        let error = |z: f64| {
            let mut slopes = [0.0; STAGES];
            for (index, stage) in TABLEAU.iter().enumerate() {
                let along: f64 = stage.along.iter().zip(&slopes).map(|(a, slope)| a * slope).sum();
                slopes[index] = z * (1.0 + along);
            }
            let end: f64 =
                1.0 + WEIGHTS.iter().zip(slopes).map(|(weight, slope)| weight * slope).sum::<f64>();
            (end - z.exp()).abs()
        };
        let order = (error(0.4) / error(0.2)).log2();
        assert!((6.7..7.3).contains(&order), "{order}");
    }
}
