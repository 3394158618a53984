//! Design of a sweep: from axes to the values of each row.

use crate::plan::{Axis, Layout, Plan, Scale, Values};
use flotor_hal::math;
use flotor_lab::sampling::Sobol;
use serde::{Deserialize, Serialize};

/// Cell of a row: the value of an axis or of a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Cell {
    /// Number; null in JSON if not finite, NaN in the table.
    Number(Option<f64>),
    /// Word, such as a choice or a status.
    Word(String),
}

impl Cell {
    /// Creates a number cell; a non-finite number becomes a missing number.
    #[must_use]
    pub fn number(value: f64) -> Self {
        Self::Number(value.is_finite().then_some(value))
    }

    /// Formats the value as in a setting; `NaN` for a missing number.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Number(value) => format!("{:?}", value.unwrap_or(f64::NAN)),
            Self::Word(word) => word.clone(),
        }
    }
}

/// Points of a plan, in the order of their rows.
pub struct Design<'a> {
    plan: &'a Plan,
    sobol: Option<Sobol>,
}

/// Point of a plan: values of the axes, and seed.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Values, one per axis.
    pub values: Vec<Cell>,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl<'a> Design<'a> {
    /// Creates the design of a plan.
    #[must_use]
    pub fn new(plan: &'a Plan) -> Self {
        let sobol = match plan.layout {
            Layout::Sobol { seed, .. } => Some(Sobol::new(seed)),
            Layout::Grid => None,
        };
        Self { plan, sobol }
    }

    /// Returns the point of row `row`, from 0; seeds vary fastest, then, in a grid, the last axis.
    #[must_use]
    pub fn point(&self, row: u64) -> Point {
        let seeds = self.plan.seeds.len() as u64;
        let seed = usize::try_from(row % seeds).ok().and_then(|at| self.plan.seeds.get(at)).copied();
        let index = row / seeds;
        let values = match &self.sobol {
            Some(sobol) => {
                let unit = sobol.point(index);
                self.plan
                    .axes
                    .iter()
                    .zip(unit)
                    .map(|(axis, unit)| Cell::number(axis.values.at(unit)))
                    .collect()
            }
            None => self.grid(index),
        };
        Point { values, seed: seed.unwrap_or_default() }
    }

    fn grid(&self, index: u64) -> Vec<Cell> {
        let mut rest = index;
        let mut cells: Vec<Cell> = Vec::with_capacity(self.plan.axes.len());
        for Axis { values, .. } in self.plan.axes.iter().rev() {
            cells.push(values.nth(rest % values.len()));
            rest /= values.len();
        }
        cells.reverse();
        cells
    }
}

impl Values {
    /// Returns the value at a fraction, 0 to 1, of a range; NaN for lists.
    fn at(&self, part: f64) -> f64 {
        match self {
            Self::Range { from, to, scale: Scale::Linear, .. } => from + (to - from) * part,
            Self::Range { from, to, scale: Scale::Log, .. } => from * math::pow(to / from, part),
            Self::Numbers(_) | Self::Words(_) => f64::NAN,
        }
    }

    /// Returns the grid value with an index.
    fn nth(&self, index: u64) -> Cell {
        let listed = usize::try_from(index).unwrap_or(usize::MAX);
        match self {
            Self::Numbers(values) => Cell::number(values.get(listed).copied().unwrap_or(f64::NAN)),
            Self::Words(words) => Cell::Word(words.get(listed).cloned().unwrap_or_default()),
            // Returns `to` exactly, without rounding.
            Self::Range { to, steps, .. } if index + 1 == u64::from(*steps) => Cell::number(*to),
            Self::Range { steps, .. } => Cell::number(self.at(index as f64 / f64::from(steps - 1))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn plan(text: &str) -> Plan {
        Plan::parse(text, Path::new("plan.toml")).unwrap()
    }

    #[test]
    fn a_grid_has_every_combination_once_and_its_ends_exactly() {
        let plan = plan(
            "seeds = [4, 5]\n[ask]\nkind = \"eval\"\nmodel = \"spring\"\n\
             [[axis]]\nkey = \"variant\"\nwords = [\"energy\", \"thesis\"]\n\
             [[axis]]\nkey = \"z_m\"\nfrom = -0.3\nto = 0.1\nsteps = 3\n",
        );
        let design = Design::new(&plan);
        let rows: Vec<String> = (0..plan.row_count().unwrap())
            .map(|row| design.point(row))
            .map(|p| format!("{} {} {}", p.values[0].text(), p.values[1].text(), p.seed))
            .collect();
        assert_eq!(rows.len(), 12);
        assert_eq!(rows[0], "energy -0.3 4");
        assert_eq!(rows[5], "energy 0.1 5");
        assert_eq!(rows[11], "thesis 0.1 5");
        let unique: std::collections::BTreeSet<&String> = rows.iter().collect();
        assert_eq!(unique.len(), 12);
    }

    #[test]
    fn sobol_points_lie_inside_and_a_log_range_is_even_in_the_logarithm() {
        let plan = plan(
            "layout = \"sobol\"\npoints = 1024\n[ask]\nkind = \"eval\"\nmodel = \"spring\"\n\
             [[axis]]\nkey = \"gamma_n\"\nfrom = 1\nto = 100\nscale = \"log\"\n",
        );
        let design = Design::new(&plan);
        let values = (0..1024).map(|row| match design.point(row).values[0] {
            Cell::Number(Some(value)) => value,
            _ => f64::NAN,
        });
        let values: Vec<f64> = values.collect();
        assert!(values.iter().all(|v| (1.0..=100.0).contains(v)));
        // A net: exactly half of the points lie in the lower half of the logarithm.
        assert_eq!(values.iter().filter(|v| **v < 10.0).count(), 512);
    }
}
