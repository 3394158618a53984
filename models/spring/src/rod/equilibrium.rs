//! Stable equilibrium of the rod, followed from tick to tick.
//!
//! Newton's method finds a zero of the slope of the energy. Its matrix is reused for some ticks; the loss of accuracy is
//! estimated at every step, see [`Effort`]. Where the matrix has a negative eigenvalue the shape is not a minimum: the rod has
//! buckled, or its branch has ended. From there the shape moves to lower energy in a damped flow, a bounded distance per tick,
//! so that the force changes fast but never jumps. Only a stable equilibrium counts as converged.
//!
//! Sources: Deuflhard, *Newton Methods for Nonlinear Problems* (2011), 2.1 (kept matrix) and 6.4
//! (pseudo-transient continuation, the damped flow); Morse index by inertia, see [`flotor_lanes::matrix`].

use flotor_hal::glam::{DVec2, DVec3};
use flotor_hal::restorable;

use super::contact::Touching;
use super::curve::Curve;
use super::descent::Found;
use super::functional::{Curvature, Functional, Ratios, Reaction, Reading, Shape, Value, joined};
use super::plate::Plate;
use super::predictor::History;
use super::start;
use crate::pose::{Pose, or_zero};
use crate::response::Demand;
use crate::rigidity::Spring;
use flotor_lanes::matrix::{Factored, added, dot, length, product};

/// Largest change of shape in a tick that reaches no equilibrium, as the root mean square slope of `p`. In a tick that reaches
/// one: largest change beyond the prediction from the plates' motion. A full bulge has about 3. The limit is smaller than 0.1
/// by the second-order effect of a bulge's lean on its torque.
const LONGEST_WAY: f64 = 0.097;
/// Largest step of a search of which only the result is felt.
const LONGEST_UNFELT_STEP: f64 = 0.4;
/// Maximum number of searches of which only the result is felt.
const MOST_SEARCHES: u32 = 3;
/// Largest initial bow of a search, relative to that of the linear column.
const MOST_BOW: f64 = 2.0;
/// Newton steps for the amplitude of the initial bow.
const AMPLITUDE_STEPS: u32 = 8;
/// Maximum total cost of the searches of a tick, in evaluations of the energy, if each costs no more than the one before.
const MOST_COST: u32 = 160;
/// Curvature that counts as zero. Bending has 4; the softest stable directions have 1e-5; rounding causes 1e-14.
const NEUTRAL: f64 = 1.0e-9;
/// Largest curvature counted as zero in an equilibrium that is reported as stable: below the softest of interest.
const SETTLED: f64 = 1.0e-6;
/// Minimum damping of the flow.
const LEAST_DAMPING: f64 = 1.0e-3;
/// Factor by which the damping grows until the damped matrix is definite.
const DAMPING_FACTOR: f64 = 5.0;
/// Maximum number of increases of the damping in a tick. If this is not enough, the next tick continues.
const MOST_DAMPINGS: u32 = 3;
/// Push of a shape off a saddle, as the root mean square slope of `p`.
const PUSH: f64 = 0.02;
/// Largest ratio of a step to the step before; above, the matrix is too old.
const CONTRACTION: f64 = 0.3;

/// Backtracking factor of a step that went uphill.
const SHORTER: f64 = 0.25;
/// Smallest step that is checked for going uphill: below, rounding of the energy would decide.
const LEAST_CHECKED_STEP: f64 = 1.0e-6;
/// Error after a step, relative to the step, if coils may meet within the step.
const KINK: f64 = 1.0e-3;

/// Limits and tolerances of the search in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Effort {
    /// Maximum number of Newton steps per tick.
    pub(crate) most_steps: u32,
    /// Maximum number of matrices computed per tick: each costs as much as nine steps. If a tick needs one more matrix, the next
    /// tick computes it.
    pub(crate) most_matrices: u32,
    /// Number of steps for which a matrix is used.
    pub(crate) matrix_life: u32,
    /// Accepted error of the shape after a step, estimated as the length of the step times the distance from the shape
    /// at which the matrix was computed (Deuflhard 2.1.1, with the Lipschitz constant of a rod, about one).
    pub(crate) tolerance: f64,
    /// Error of a step above which the matrix is renewed.
    pub(crate) renewal: f64,
}

/// Limits on the motion of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stride {
    /// Limit of one step.
    step: f64,
    /// Limit of all steps together.
    way: f64,
}

impl Stride {
    /// Limits of a search whose intermediate shapes are felt.
    const FELT: Self = Self { step: LONGEST_WAY, way: LONGEST_WAY };
    /// Limits of a search of which only the result is felt.
    const UNFELT: Self = Self { step: LONGEST_UNFELT_STEP, way: f64::INFINITY };
}

/// Outcome of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Outcome {
    /// In stable equilibrium.
    Settled(Reading),
    /// Moving to an equilibrium, with the present reading.
    Moving(Reading),
    /// The result is not finite; the shape is unchanged.
    Failed,
}

/// Rod between its plates, with its history.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Equilibrium<const K: usize, const N: usize, const Q: usize> {
    functional: Functional<K, N, Q>,
    effort: Effort,
    shape: Shape<N>,
    history: History<N>,
    marked: (Plate, Shape<N>),
    matrix: CachedMatrix<N>,
    damping: f64,
    stride: Stride,
    /// Morse index at the last computation of the matrix: zero if the shape is stable.
    pub(crate) unstable_directions: usize,
    /// Cost of the last tick.
    pub(crate) work: Work,
}

restorable!([const K: usize, const N: usize, const Q: usize] Equilibrium<K, N, Q>
    { shape, history, marked, matrix, damping, unstable_directions } without { functional, effort, stride, work });

/// Cost of a tick: numbers of evaluations of the rod's energy, of matrices computed, and of factorisations.
/// Reproducible in tests, unlike the time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Number of evaluations of energy and slope.
    pub evaluations: u32,
    /// Number of computed matrices of second derivatives.
    pub matrices: u32,
    /// Number of factorisations of a matrix.
    pub factorings: u32,
}

impl Work {
    /// Returns the cost in evaluations of the energy: a matrix costs as much as nine, a factorisation as three.
    #[must_use]
    pub(crate) fn cost(&self) -> u32 {
        self.evaluations + 9 * self.matrices + 3 * self.factorings
    }

    /// Returns the sum of two costs.
    fn and(self, other: &Self) -> Self {
        Self {
            evaluations: self.evaluations + other.evaluations,
            matrices: self.matrices + other.matrices,
            factorings: self.factorings + other.factorings,
        }
    }
}

/// Step, with its initial shape and energy.
struct Stepped<const N: usize> {
    from: Shape<N>,
    energy: f64,
    step: Shape<N>,
}

/// Factored second derivatives, with the shape and the plate at which they were computed.
#[derive(Clone, Debug, PartialEq)]
struct CachedMatrix<const N: usize> {
    factored: Factored<N>,
    reaction: Reaction<N>,
    shape: Shape<N>,
    plate: Plate,
    touching: Touching,
    /// Smallest eigenvalue.
    softest: f64,
    /// Curvature counted as zero.
    neutral: f64,
    steps_left: u32,
}

restorable!([const N: usize] CachedMatrix<N>
    { factored, reaction, shape, plate, touching, softest, neutral, steps_left });

impl<const N: usize> CachedMatrix<N> {
    /// Returns a placeholder that is valid for no step.
    fn none() -> Self {
        let reaction = Reaction { force: [[0.0; N]; 3], by_lean: [[0.0; N]; 2], torsion: [0.0; N] };
        Self {
            factored: Factored::unit(),
            reaction,
            shape: [0.0; N],
            plate: Plate::HOME,
            touching: Touching::NONE,
            softest: 0.0,
            neutral: NEUTRAL,
            steps_left: 0,
        }
    }
}

impl<const K: usize, const N: usize, const Q: usize> Equilibrium<K, N, Q> {
    /// Builds the rod at rest.
    pub(crate) fn new(ratios: Ratios, effort: Effort) -> Self {
        Self {
            functional: Functional::new(ratios),
            effort,
            shape: [0.0; N],
            history: History::new(Plate::HOME, [0.0; N]),
            marked: (Plate::HOME, [0.0; N]),
            matrix: CachedMatrix::none(),
            damping: LEAST_DAMPING,
            stride: Stride::FELT,
            unstable_directions: 0,
            work: Work::default(),
        }
    }

    /// Resets to rest. Real-time: bounded, no allocation.
    pub(crate) fn reset(&mut self) {
        self.shape = [0.0; N];
        self.history = History::new(Plate::HOME, self.shape);
        self.matrix.steps_left = 0;
        self.damping = LEAST_DAMPING;
        self.unstable_directions = 0;
    }

    /// Saves the shape of the last tick for [`Self::go_back`]. Real-time: bounded, no allocation.
    pub(crate) fn mark(&mut self) {
        self.marked = (*self.history.plate(), self.shape);
    }

    /// Restores the saved shape, without any other history. Real-time: bounded, no allocation.
    pub(crate) fn go_back(&mut self) {
        let (plate, shape) = &self.marked;
        self.history.restart(plate, shape);
        (self.shape, self.damping) = (*shape, LEAST_DAMPING);
    }

    /// Sets the rigidity ratios of the rod, with the shape unchanged. Real-time: bounded, no allocation.
    pub(crate) fn set_ratios(&mut self, ratios: Ratios) {
        self.functional.set_ratios(ratios);
        self.matrix.steps_left = 0;
    }

    /// Returns the accepted error of a shape.
    pub(crate) fn tolerance(&self) -> f64 {
        self.effort.tolerance
    }

    /// Returns the present curve of the rod. Real-time: bounded, no allocation.
    pub(crate) fn curve(&self) -> Curve<K> {
        Curve::new(&self.functional, &self.shape, self.history.plate())
    }

    /// Advances the shape by one tick towards the equilibrium at `plate`, and stores the history. Real-time: bounded, no
    /// allocation.
    pub(crate) fn advance(&mut self, plate: &Plate, demand: Demand) -> Outcome {
        let before = self.shape;
        self.work = Work::default();
        self.stride = Stride::FELT;
        self.shape = self.history.predict(plate);
        let may_miss = self.functional.ratios.contact.is_some() && self.shape != before;
        let mut outcome = self.search(plate, demand);
        if matches!(outcome, Outcome::Moving(_)) && (may_miss || distance(&self.shape, &before) > LONGEST_WAY)
        {
            // The prediction crossed the end of the branch, or a coil contact: search from the last shape.
            self.shape = before;
            let work = std::mem::take(&mut self.work);
            // If there is no time for this search, the next tick searches.
            let has_time = work.and(&work).cost() <= MOST_COST;
            outcome = if has_time { self.search(plate, demand) } else { self.moving(plate) };
            self.work = work.and(&self.work);
        }
        self.remember(plate, &before, &outcome);
        outcome
    }

    /// Returns the ratios of the rod. Real-time: bounded, no allocation.
    pub(crate) fn ratios(&self) -> &Ratios {
        &self.functional.ratios
    }

    /// Adopts the equilibrium of another search as shape and history. Real-time: bounded, no allocation.
    pub(crate) fn settle(&mut self, plate: &Plate, found: &Found<N>) -> Outcome {
        self.work = Work { evaluations: found.energies, ..Work::default() };
        self.history.restart(plate, &found.shape);
        self.shape = found.shape;
        (self.matrix.steps_left, self.damping, self.unstable_directions) = (0, LEAST_DAMPING, 0);
        Outcome::Settled(found.reading)
    }

    /// Finds the equilibrium at a pose without a history, from the shape of the linear column. Intermediate shapes are
    /// not felt, so that steps may be larger. A shape that slides off a saddle, or has used up its matrices, continues
    /// in the next tick. Real-time: bounded, no allocation.
    pub(crate) fn find(&mut self, spring: &Spring, pose: &Pose, plate: &Plate, demand: Demand) -> Outcome {
        self.reset();
        self.stride = Stride::UNFELT;
        self.work = Work::default();
        if let Some(start) = start::linear(&self.functional.basis, spring, pose) {
            let [swayed, bowed] = start.map(|[x, y]| joined(&x, &y));
            self.shape = self.bowed(&swayed, &bowed, plate);
        }
        let mut outcome = Outcome::Failed;
        for _ in 0..MOST_SEARCHES {
            outcome = self.search(plate, demand);
            let may_go_on = self.unstable_directions == 0 && self.work.matrices < self.effort.most_matrices;
            if !matches!(outcome, Outcome::Moving(_)) || !may_go_on {
                break;
            }
        }
        self.remember(plate, &[0.0; N], &outcome);
        outcome
    }

    /// Scales the bow of the linear column to the amplitude of least energy: close to buckling the linear column does
    /// not determine the amplitude. The energy along the bow is approximated by `a t + b t² + d t⁴`, because the bulge
    /// of a straight rod has no preferred side; two evaluations give the three coefficients.
    fn bowed(&mut self, without: &Shape<N>, with: &Shape<N>, plate: &Plate) -> Shape<N> {
        let bow = added(with, -1.0, without);
        let (from, to) = (self.functional.value(without, plate), self.functional.value(with, plate));
        self.work.evaluations += 2;
        let (first, last, rise) = (dot(&from.slope, &bow), dot(&to.slope, &bow), to.energy - from.energy);
        let fourth = 0.5 * (first + last) - rise;
        let second = rise - first - fourth;
        if fourth <= 0.0 {
            return *with;
        }
        // Newton's method on a + 2 b t + 4 d t³ = 0, from above the root.
        let mut part = MOST_BOW;
        for _ in 0..AMPLITUDE_STEPS {
            let by_part = 4.0 * fourth * part * part;
            part -= (first + (2.0 * second + by_part) * part) / (2.0 * second + 3.0 * by_part);
        }
        if part.is_finite() { added(without, part.clamp(0.0, MOST_BOW), &bow) } else { *with }
    }

    /// Stores the history for the next tick.
    fn remember(&mut self, plate: &Plate, before: &Shape<N>, outcome: &Outcome) {
        match outcome {
            Outcome::Settled(_) => self.history.push(*plate, &self.shape),
            Outcome::Moving(_) => self.history = History::new(*plate, self.shape),
            Outcome::Failed => {
                self.shape = *before;
                self.history = History::new(*plate, *before);
                self.matrix.steps_left = 0;
            }
        }
    }

    /// Runs Newton's method from the predicted shape.
    #[inline]
    fn search(&mut self, plate: &Plate, demand: Demand) -> Outcome {
        let (mut last_size, mut way_left) = (f64::INFINITY, self.stride.way);
        let mut last: Option<Stepped<N>> = None;
        for _ in 0..self.effort.most_steps {
            let longest = self.stride.step.min(way_left);
            let value = self.functional.value(&self.shape, plate);
            self.work.evaluations += 1;
            if let Some(Stepped { from, energy, step }) = &mut last
                && value.energy > *energy
            {
                // Coils met within the step, which went uphill: backtrack.
                *step = step.map(|entry| entry * SHORTER);
                self.shape = added(from, 1.0, step);
                continue;
            }
            let bent = distance(&self.shape, &self.matrix.shape);
            let fall = self.functional.eigenvalue_fall(plate.distance(&self.matrix.plate), bent);
            if self.matrix.steps_left == 0
                || fall > self.matrix.softest
                || value.touching != self.matrix.touching
            {
                if self.work.matrices == self.effort.most_matrices {
                    break;
                }
                let curvature = self.functional.curvature(&value);
                self.work.matrices += 1;
                if self.keep(&curvature, plate, &value) > 0 {
                    return self.slide(&value, &curvature, longest, plate, demand);
                }
            }
            let step = self.matrix.factored.step_down(&value.slope);
            let size = length(&step);
            if !size.is_finite() {
                return Outcome::Failed;
            }
            let error = size * (size + distance(&self.shape, &self.matrix.shape)).max(self.kink(&value));
            let step = capped(step, size, longest);
            way_left -= size.min(longest);
            let from = self.shape;
            self.shape = added(&from, 1.0, &step).map(or_zero);
            self.matrix.steps_left = self.matrix.steps_left.saturating_sub(1);
            if error <= self.effort.tolerance && size <= longest && self.matrix.neutral <= SETTLED {
                self.damping = LEAST_DAMPING;
                return Outcome::Settled(read(&value, &self.matrix.reaction, &step, demand));
            }
            if size > longest || size > CONTRACTION * last_size || error > self.effort.renewal {
                self.matrix.steps_left = 0;
            }
            if size > longest {
                break;
            }
            last_size = size;
            last = (value.touching != Touching::NONE && size > LEAST_CHECKED_STEP).then_some(Stepped {
                from,
                energy: value.energy,
                step,
            });
        }
        self.moving(plate)
    }

    /// Returns the reading of the present shape, short of equilibrium: the derivatives of its own energy, so that the
    /// hand receives the energy that the rod loses.
    pub(crate) fn moving(&mut self, plate: &Plate) -> Outcome {
        let (reading, _) = self.functional.reading(&self.shape, plate);
        self.work.evaluations += 1;
        if reading.energy.is_finite() { Outcome::Moving(reading) } else { Outcome::Failed }
    }

    /// Returns the least ratio of the error after a step to the step: where coils touch, others may meet within the step.
    fn kink(&self, value: &Value<N, Q>) -> f64 {
        if value.touching == Touching::NONE { 0.0 } else { KINK }
    }

    /// Factorises the matrix for the coming steps; returns its number of negative eigenvalues.
    fn keep(&mut self, curvature: &Curvature<N>, plate: &Plate, value: &Value<N, Q>) -> usize {
        self.matrix.neutral = NEUTRAL;
        self.matrix.steps_left = self.effort.matrix_life;
        self.matrix.factored = Factored::new(&curvature.matrix, NEUTRAL);
        self.work.factorings += 1;
        if self.matrix.factored.negative() > 0 {
            self.matrix.neutral = neutral(&value.slope);
            self.matrix.steps_left = 1;
            self.matrix.factored = Factored::new(&curvature.matrix, self.matrix.neutral);
            self.work.factorings += 1;
        }
        self.unstable_directions = self.matrix.factored.negative();
        if self.unstable_directions == 0 {
            self.matrix.reaction = curvature.reaction.clone();
            self.matrix.shape = self.shape;
            self.matrix.plate = *plate;
            self.matrix.touching = value.touching;
            self.matrix.softest = self.matrix.factored.smallest_eigenvalue();
        } else {
            self.matrix.steps_left = 0;
        }
        self.unstable_directions
    }

    /// Makes one step of the damped flow, from a shape that is not a minimum: an implicit Euler step down the slope of the
    /// energy, of duration `1 / damping`, of at most `longest`.
    #[cold]
    fn slide(
        &mut self,
        value: &Value<N, Q>,
        curvature: &Curvature<N>,
        longest: f64,
        plate: &Plate,
        demand: Demand,
    ) -> Outcome {
        let mut damping = self.damping;
        let mut damped = Factored::new(&curvature.matrix, damping);
        self.work.factorings += 1;
        for _ in 0..MOST_DAMPINGS {
            if damped.negative() == 0 {
                break;
            }
            damping *= DAMPING_FACTOR;
            damped = Factored::new(&curvature.matrix, damping);
            self.work.factorings += 1;
        }
        if damped.negative() > 0 {
            self.damping = damping * DAMPING_FACTOR;
            return Outcome::Moving(read(value, &curvature.reaction, &[0.0; N], demand));
        }
        self.damping = (damping / DAMPING_FACTOR).max(LEAST_DAMPING);
        let mut step = damped.step_down(&value.slope);
        if let Some((down, curvature)) = falling(&curvature.matrix, &damped, K, neutral(&value.slope)) {
            // On a saddle, where the slope vanishes, only a push starts the motion.
            if length(&value.slope) < 0.5 * PUSH * -curvature {
                let push = if dot(&down, &value.slope) > 0.0 { -PUSH } else { PUSH };
                step = added(&step, push, &down);
            }
        }
        let size = length(&step);
        if !size.is_finite() {
            return Outcome::Failed;
        }
        let step = capped(step, size, longest);
        self.shape = added(&self.shape, 1.0, &step);
        self.moving(plate)
    }
}

/// Returns the curvature that counts as zero off equilibrium: there a direction without stiffness, such as the turning
/// of a straight rod's bulge about its axis, has one as large as the slope, of either sign.
fn neutral<const N: usize>(slope: &Shape<N>) -> f64 {
    NEUTRAL + 4.0 * length(slope)
}

/// Returns a unit direction in which the energy curves down, and that curvature, by inverse iteration.
///
/// The iteration starts from the direction in which a perfect rod bulges if nothing else decides: towards -x, which
/// stands for the side to which the ends of a real coil are off its axis; then, if that is stable, towards -y.
fn falling<const N: usize>(
    matrix: &[[f64; N]; N],
    damped: &Factored<N>,
    bubbles: usize,
    neutral: f64,
) -> Option<([f64; N], f64)> {
    for component in [0, bubbles] {
        let mut direction = [0.0; N];
        // The second bubble leans one way below the middle and the other way above: a bulge. A little of the
        // first, for rods whose plates allow no bulge alone.
        direction[component] = -0.1;
        direction[component + 1] = -1.0;
        for _ in 0..4 {
            direction = damped.solve(&direction);
            let size = length(&direction);
            direction = direction.map(|entry| entry / size);
        }
        let curvature = dot(&direction, &product(matrix, &direction));
        if curvature < -neutral {
            return Some((direction, curvature));
        }
    }
    None
}

/// Returns the reading after a step, to second order in the step: no further evaluation is needed.
#[inline]
fn read<const N: usize, const Q: usize>(
    value: &Value<N, Q>,
    reaction: &Reaction<N>,
    step: &Shape<N>,
    demand: Demand,
) -> Reading {
    let force = value.load.force + DVec3::from_array(product(&reaction.force, step));
    let (mut by_lean, mut torsion) = (DVec2::ZERO, 0.0);
    if demand >= Demand::Wrench {
        by_lean = value.by_lean + DVec2::from_array(product(&reaction.by_lean, step));
        torsion = value.load.torsion + dot(&reaction.torsion, step);
    }
    Reading { energy: value.energy + 0.5 * dot(&value.slope, step), force, by_lean, torsion }
}

#[inline]
fn capped<const N: usize>(step: Shape<N>, size: f64, longest: f64) -> Shape<N> {
    if size > longest { step.map(|entry| entry * (longest / size)) } else { step }
}

#[inline]
fn distance<const N: usize>(a: &Shape<N>, b: &Shape<N>) -> f64 {
    length(&added(a, -1.0, b))
}

#[cfg(test)]
mod tests;
