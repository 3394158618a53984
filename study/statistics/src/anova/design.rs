//! Design of an analysis of variance: subjects, groups, and conditions.

use crate::StatisticsError;
use crate::count;
use crate::linear::Matrix;

/// Between-subject factor, which divides the subjects into groups.
#[derive(Clone, Debug, PartialEq)]
pub struct BetweenFactor {
    /// Factor name in the table.
    pub name: String,
    /// Group of each subject, from 0.
    pub groups: Vec<usize>,
}

/// Within-subject factor (repeated measures): every subject is measured at all levels.
#[derive(Clone, Debug, PartialEq)]
pub struct WithinFactor {
    /// Factor name in the table.
    pub name: String,
    /// Number of levels, 2 or more.
    pub levels: usize,
}

/// Checked design with its responses.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    between: Vec<BetweenFactor>,
    within: Vec<WithinFactor>,
    pub(super) responses: Matrix,
}

/// Set of factors by their indices in the design: an effect within or between subjects.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Term(Vec<usize>);

impl Term {
    pub(super) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn contains(&self, other: &Self) -> bool {
        other.0.iter().all(|factor| self.0.contains(factor))
    }

    /// Returns all subsets of `factors` factors in order of size, the empty set first.
    fn all(factors: usize) -> Vec<Self> {
        let mut terms = vec![Self(Vec::new())];
        for factor in 0..factors {
            let with: Vec<Self> =
                terms.iter().map(|term| Self(term.0.iter().copied().chain([factor]).collect())).collect();
            terms.extend(with);
        }
        terms.sort_by_key(|term| term.0.len());
        terms
    }
}

impl Design {
    /// Creates a design after checking it. `responses[subject]` has one value per cell of the within-subject factors, with the
    /// levels of the last factor varying fastest; without within-subject factors, one value.
    ///
    /// # Errors
    /// [`StatisticsError::Design`] if a factor has fewer than two levels or groups, a factor or a row has the wrong length, a
    /// combination of groups has no subject, or a response is not finite; [`StatisticsError::TooFew`] if no combination of groups
    /// has two subjects.
    pub fn new(
        between: Vec<BetweenFactor>,
        within: Vec<WithinFactor>,
        responses: &[Vec<f64>],
    ) -> Result<Self, StatisticsError> {
        let refuse = |problem: String| Err(StatisticsError::Design(problem));
        let cells: usize = within.iter().map(|factor| factor.levels).product();
        if let Some(factor) = within.iter().find(|factor| factor.levels < 2) {
            return refuse(format!(
                "`{}` has {} level; a factor has two or more",
                factor.name, factor.levels
            ));
        }
        for (subject, row) in responses.iter().enumerate() {
            if row.len() != cells {
                return refuse(format!("subject {subject} has {} responses for {cells} cells", row.len()));
            }
            if let Some(cell) = row.iter().position(|value| !value.is_finite()) {
                return refuse(format!("subject {subject}, cell {cell}: the response is not finite"));
            }
        }
        for factor in &between {
            if factor.groups.len() != responses.len() {
                let (groups, subjects) = (factor.groups.len(), responses.len());
                return refuse(format!(
                    "`{}` has the groups of {groups} subjects; give a group for each of {subjects}",
                    factor.name
                ));
            }
            if factor.count() < 2 {
                return refuse(format!("`{}` has only one group", factor.name));
            }
        }
        let design = Self {
            between,
            within,
            responses: Matrix::from_fn(responses.len(), cells, |row, column| {
                responses.get(row).and_then(|row| row.get(column)).copied().unwrap_or(f64::NAN)
            }),
        };
        design.check_groups()?;
        Ok(design)
    }

    /// Checks that every combination of groups has a subject, and at least one has two.
    fn check_groups(&self) -> Result<(), StatisticsError> {
        let combinations: usize = self.between.iter().map(BetweenFactor::count).product();
        let combination = |subject: usize| {
            self.between.iter().fold(0, |index, factor| index * factor.count() + factor.group(subject))
        };
        let mut filled: Vec<usize> = (0..self.subjects()).map(combination).collect();
        filled.sort_unstable();
        filled.dedup();
        if filled.len() < combinations {
            return Err(StatisticsError::Design(format!(
                "subjects are missing in {} of {combinations} combinations of groups",
                combinations - filled.len()
            )));
        }
        if self.subjects() <= combinations {
            return Err(StatisticsError::TooFew {
                what: "an analysis of variance",
                unit: "subjects",
                needed: combinations + 1,
                found: self.subjects(),
            });
        }
        Ok(())
    }

    /// Returns the number of subjects.
    #[must_use]
    pub fn subjects(&self) -> usize {
        self.responses.rows()
    }

    pub(super) fn between_terms(&self) -> Vec<Term> {
        Term::all(self.between.len())
    }

    pub(super) fn within_terms(&self) -> Vec<Term> {
        Term::all(self.within.len())
    }

    pub(super) fn name(&self, between: &Term, within: &Term) -> String {
        let between = between.0.iter().filter_map(|index| self.between.get(*index)).map(|f| f.name.as_str());
        let within = within.0.iter().filter_map(|index| self.within.get(*index)).map(|f| f.name.as_str());
        between.chain(within).collect::<Vec<_>>().join(":")
    }

    /// Returns the design columns of an effect between subjects in sum-to-zero (effect) coding.
    pub(super) fn coded(&self, term: &Term) -> Matrix {
        let factors = term.0.iter().filter_map(|index| self.between.get(*index));
        let intercept = Matrix::from_fn(self.subjects(), 1, |_, _| 1.0);
        factors.fold(intercept, |columns, factor| {
            let own = factor.count() - 1;
            Matrix::from_fn(self.subjects(), columns.columns() * own, |subject, column| {
                columns.at(subject, column / own) * factor.sum_code(subject, column % own)
            })
        })
    }

    /// Returns orthonormal contrasts of an effect within subjects, over all cells: Helmert contrasts of the factors of the
    /// effect, means over the other factors.
    pub(super) fn contrasts(&self, term: &Term) -> Matrix {
        let one = Matrix::from_fn(1, 1, |_, _| 1.0);
        self.within.iter().enumerate().fold(one, |contrasts, (index, factor)| {
            let own = if term.0.contains(&index) { helmert(factor.levels) } else { constant(factor.levels) };
            contrasts.kronecker(&own)
        })
    }
}

impl BetweenFactor {
    fn count(&self) -> usize {
        self.groups.iter().max().map_or(0, |last| last + 1)
    }

    fn group(&self, subject: usize) -> usize {
        self.groups.get(subject).copied().unwrap_or(0)
    }

    fn sum_code(&self, subject: usize, column: usize) -> f64 {
        let group = self.group(subject);
        if group == column {
            1.0
        } else if group + 1 == self.count() {
            -1.0
        } else {
            0.0
        }
    }
}

fn constant(levels: usize) -> Matrix {
    Matrix::from_fn(levels, 1, |_, _| 1.0 / count(levels).sqrt())
}

/// Returns normalised Helmert contrasts: each level against the mean of the previous levels.
fn helmert(levels: usize) -> Matrix {
    Matrix::from_fn(levels, levels - 1, |level, column| {
        let before = count(column + 1);
        let length = (before * (before + 1.0)).sqrt();
        match level.cmp(&(column + 1)) {
            std::cmp::Ordering::Less => -1.0 / length,
            std::cmp::Ordering::Equal => before / length,
            std::cmp::Ordering::Greater => 0.0,
        }
    })
}
