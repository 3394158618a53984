//! Integrals and quantiles of a univariate density, by Gauss-Legendre quadrature.

use crate::count;
use std::f64::consts::PI;

/// Maximum number of Newton steps for a node; four are usual.
const NEWTON_STEPS: usize = 20;
/// Number of panels for the integral of a density.
const PANELS: usize = 512;

/// Node of a quadrature rule with its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// Abscissa of the node.
    pub at: f64,
    /// Weight of the node.
    pub weight: f64,
}

/// Returns the Gauss-Legendre rule with `nodes` nodes over an interval, in ascending order: exact for polynomials of degree
/// below `2 * nodes`.
#[must_use]
pub fn gauss_legendre(nodes: usize, [low, high]: [f64; 2]) -> Vec<Node> {
    let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
    let node = |index: usize| {
        let mut x = -libm::cos(PI * (count(index) + 0.75) / (count(nodes) + 0.5));
        let mut slope = 1.0;
        for _ in 0..NEWTON_STEPS {
            let (value, derivative) = legendre(nodes, x);
            slope = derivative;
            let step = value / derivative;
            x -= step;
            if step.abs() < 1.0e-15 {
                break;
            }
        }
        Node { at: middle + half * x, weight: half * 2.0 / ((1.0 - x * x) * slope * slope) }
    };
    (0..nodes).map(node).collect()
}

/// Returns a Legendre polynomial and its derivative.
fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for n in 2..=degree {
        let n = count(n);
        (before, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n);
    }
    (value, count(degree) * (x * value - before) / (x * x - 1.0))
}

/// Density over an interval, not normalised: the polynomial through the values at the nodes of a quadrature rule; negative
/// values count as zero.
#[derive(Clone, Debug)]
pub struct Density {
    low: f64,
    width: f64,
    /// Values at the ends and midpoints of the panels.
    values: Vec<f64>,
    /// Integral from the lower end to each panel boundary.
    below: Vec<f64>,
}

impl Density {
    /// Builds a density from its values, up to a constant factor, at the nodes of [`gauss_legendre`] over the interval.
    #[must_use]
    pub fn new(nodes: &[Node], [low, high]: [f64; 2], at_nodes: &[f64]) -> Self {
        let width = (high - low) / count(PANELS);
        // Barycentric weights of the Legendre nodes (Wang and Xiang 2012).
        let side = |index: usize| if index.is_multiple_of(2) { 1.0 } else { -1.0 };
        let barycentric: Vec<f64> = nodes
            .iter()
            .enumerate()
            .map(|(index, node)| side(index) * ((node.at - low) * (high - node.at) * node.weight).sqrt())
            .collect();
        let value = |at: f64| {
            let (mut top, mut bottom) = (0.0, 0.0);
            for ((node, weight), value) in nodes.iter().zip(&barycentric).zip(at_nodes) {
                if node.at == at {
                    return *value;
                }
                let share = weight / (at - node.at);
                top += share * value;
                bottom += share;
            }
            (top / bottom).max(0.0)
        };
        let values: Vec<f64> =
            (0..=2 * PANELS).map(|index| value(low + 0.5 * width * count(index))).collect();
        let mut sum = 0.0;
        let mut below = vec![0.0];
        for panel in values.windows(3).step_by(2) {
            if let [first, middle, last] = panel {
                sum += width / 6.0 * (first + 4.0 * middle + last); // Simpson's rule
            }
            below.push(sum);
        }
        Self { low, width, values, below }
    }

    /// Returns the quantile for the cumulative probability `share`, 0 to 1.
    #[must_use]
    pub fn quantile(&self, share: f64) -> f64 {
        let total = self.below.last().copied().unwrap_or(f64::NAN);
        let wanted = share * total;
        let panel = self.below.iter().skip(1).take_while(|below| **below < wanted).count().min(PANELS - 1);
        let at = |list: &[f64], index: usize| list.get(index).copied().unwrap_or(f64::NAN);
        let (start, end) = (at(&self.below, panel), at(&self.below, panel + 1));
        let [first, middle, last] = [0, 1, 2].map(|half| at(&self.values, 2 * panel + half));
        // Integral of the parabola through the three values, consistent with Simpson's rule at the panel's end.
        let inside = |x: f64| {
            let (slope, bend) = (4.0 * middle - 3.0 * first - last, 2.0 * (first + last) - 4.0 * middle);
            self.width * x * (first + x * (0.5 * slope + x * bend / 3.0))
        };
        let (mut low, mut high) = (0.0, 1.0);
        if end > start {
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if start + inside(middle) < wanted { low = middle } else { high = middle }
            }
        }
        self.low + self.width * (count(panel) + 0.5 * (low + high))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distribution::{normal_below, normal_density};

    #[test]
    fn rules_are_exact_for_polynomials() {
        for nodes in [2, 5, 24, 64] {
            let rule = gauss_legendre(nodes, [-1.0, 3.0]);
            for power in 0..2 * nodes.min(8) {
                let power = i32::try_from(power).unwrap_or(0);
                let sum: f64 = rule.iter().map(|node| node.weight * node.at.powi(power)).sum();
                let exact = (3.0_f64.powi(power + 1) - (-1.0_f64).powi(power + 1)) / f64::from(power + 1);
                assert!(
                    (sum / exact - 1.0).abs() < 1.0e-12,
                    "{nodes} nodes, power {power}: {sum} for {exact}"
                );
            }
        }
    }

    #[test]
    fn quantiles_of_the_normal_density_are_its_own() {
        let interval = [-7.0, 9.0];
        let rule = gauss_legendre(64, interval);
        let values: Vec<f64> = rule.iter().map(|node| normal_density(node.at)).collect();
        let density = Density::new(&rule, interval, &values);
        for share in [0.001, 0.025, 0.3, 0.5, 0.9, 0.975] {
            // To first order, the error of the quantile.
            let quantile = density.quantile(share);
            let off = (normal_below(quantile) - share) / normal_density(quantile);
            assert!(off.abs() < 1.0e-8, "{share}: {quantile} is off by {off}");
        }
    }
}
