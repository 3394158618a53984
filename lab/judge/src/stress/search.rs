//! M9, search: worst case found by optimisation.
//!
//! Even coverage finds faults that fill part of the workspace. A fault that grows towards a point (a pole, a transition between two
//! formulas, a swirl around an axis) is found faster by ascent. No derivative is needed: the best of many points is varied at
//! random, a better point replaces the best, and the size of the variations follows the success rate (a (1+1) evolution strategy
//! with the rule of one success in five; Rechenberg, *Evolutionsstrategie*, 1973).
//!
//! Four goals, each from several starts with their own seeds:
//! - *step*: irregularity along a short line, in pieces of 1, 0.1 and 0.01 mm; then refined as in M1, to 1e-8 mm;
//! - *energy*: work of a small closed ellipse in any two of all directions, relative to the most that forces of its
//!   size could have done, at rest in each of its poses;
//! - *energy in motion*: work of a triangle, relative to all work exchanged: out along the force and sideways in one
//!   fast motion, sideways back, and in again slowly. Energy that friction, damping or a clamp removes from a yielding
//!   force must be gone when the handle is back;
//! - *size*: the largest wrench, near which numbers stop being finite.
//!
//! The search stays in the workspace and inside the model's declared bounds: answers beyond them are not judged.
//!
//! An isolated fault in a flat field, such as a hole of a tenth of a millimetre, cannot be found faster than by chance.

use super::continuity::{FELT_N, FELT_NM, HARMLESS, Jumps, Line, PIECES_MM, changes, close_in, standing_out};
use super::energy::samples;
use super::jacobian::size_n;
use super::lap::{CONSERVATIVE, Dissipation, Lap};
use super::measure::{Measure, PoseRecord, Verdict};
use super::motion::Triangle;
use super::poses::Reach;
use super::sweep::sweep;
use super::{LEVER_M, Setup};
use crate::PERIOD_NS;
use crate::sampling::Random;
use crate::subject::Subject;
use crate::tally::{Worst, tally};
use crate::trajectory::{Series, Trajectory};
use flotor_hal::{DVec3, Memory, Pose, Twist, WorkspaceBounds, math, rotation_vector};
use flotor_loader::LoadError;
use std::array::from_fn;

const NAME: &str = "search";
/// Number of coordinates of a point: a pose, and two directions, or a direction, two sizes and a speed.
const NUMBERS: usize = 18;
/// Number of variations of a start; fewer for a model with memory, which is walked to each.
const TRIES: usize = 240;
const TRIES_WITH_MEMORY: usize = 60;
/// Divisor of the tries that are random points, before the best is varied.
const ANYWHERE: usize = 4;
/// Size of the first variations, relative to the workspace; smallest size; growth after a success, cancelled by four
/// failures.
const FIRST_SIZE: f64 = 0.3;
const LEAST_SIZE: f64 = 1.0e-6;
const GROWTH: f64 = 1.5;
/// Lengths of a line's pieces by stage, m, and their number.
const STAGES_M: [f64; 3] = [1.0e-3, 1.0e-4, 1.0e-5];
const PIECES: usize = 12;
/// Number of samples of an ellipse, and its largest half axis relative to the workspace.
const SAMPLES: usize = 64;
const ELLIPSE: f64 = 0.1;
/// Samples of a triangle's edge, in the search and for the best; longest side relative to the workspace and ratio to
/// the shortest, and the speeds, m/s.
const EDGE_SAMPLES: usize = 64;
const EDGE_SAMPLES_OF_THE_BEST: usize = 1024;
const SIDE: f64 = 0.25;
const SIDE_RATIO: f64 = 30.0;
const FASTEST_M_PER_S: f64 = 1.0;
const SPEED_RATIO: f64 = 20.0;
const SLOW_M_PER_S: f64 = 0.02;

/// Coordinates from -1 to 1.
type Point = [f64; NUMBERS];

tally! {
    struct Tally {
        tries: u64,
        jumps: Jumps,
        energy: Worst,
        energy_in_motion: Worst,
        /// Number of laps whose energy is known to the bound.
        laps_resolved: u64,
        size: Worst,
        troubles: u64,
        trouble_at: Option<Pose>,
    }
}

/// Optimiser of one goal from one start.
struct Opponent<'a, 'b> {
    subject: &'a mut Subject<'b>,
    reach: Reach,
    /// Bounds of the model; its answers beyond them never reach the hand.
    bounds: WorkspaceBounds,
    random: Random,
    tries: usize,
    tally: Tally,
}

impl Opponent<'_, '_> {
    /// Maximises a goal: starts from the best of many random points, or from a known one.
    fn climb(&mut self, from: Option<Point>, mut goal: impl FnMut(&mut Self, &Point) -> f64) -> (Point, f64) {
        let anywhere = if from.is_some() { 0 } else { self.tries / ANYWHERE };
        let mut best = from.unwrap_or([0.0; NUMBERS]);
        let mut height = goal(self, &best);
        for _ in 0..anywhere {
            let point = from_fn(|_| self.random.symmetric());
            let here = goal(self, &point);
            if here > height {
                (best, height) = (point, here);
            }
        }
        let mut size = FIRST_SIZE;
        for _ in anywhere..self.tries {
            let point = best.map(|at| (at + size * self.random.symmetric()).clamp(-1.0, 1.0));
            let here = goal(self, &point);
            if here > height {
                (best, height, size) = (point, here, (size * GROWTH).min(1.0));
            } else {
                // Four failures cancel the growth of one success.
                size = (size / GROWTH.sqrt().sqrt()).max(LEAST_SIZE);
            }
        }
        self.tally.tries += self.tries as u64;
        (best, height)
    }

    fn pose(&self, point: &Point) -> Pose {
        let pose = self.reach.pose(from_fn(|axis| 0.5 * (1.0 + point[axis])));
        Pose::new(pose.position() - self.bounds.beyond(pose.position()), pose.orientation())
    }

    /// Returns a line through the point's pose, in the direction of its second six coordinates.
    fn line(&self, point: &Point) -> Line {
        let pose = self.pose(point);
        let [_, _, _, _, _, _, x, y, z, rx, ry, rz, ..] = *point;
        let (along, around) = (DVec3::new(x, y, z), DVec3::new(rx, ry, rz));
        let length = (along.length_squared() + around.length_squared()).sqrt().max(f64::MIN_POSITIVE);
        let (along_m, along_rad) = (along / length, around / (length * LEVER_M));
        Line {
            position_m: pose.position(),
            rotation_rad: rotation_vector(pose.orientation()),
            along_m,
            along_rad,
        }
    }

    /// Returns the most irregular piece along a line, with its irregularity.
    fn outstanding(&mut self, line: &Line, piece_m: f64) -> (usize, f64) {
        let start_m = -0.5 * piece_m * PIECES as f64;
        let changes = changes(self.subject, line, start_m, piece_m, PIECES);
        let is_inside = |index: usize| {
            let pose = line.pose(start_m + piece_m * index as f64);
            self.reach.holds(pose) && self.bounds.beyond(pose.position()) == DVec3::ZERO
        };
        let inside = (0..PIECES).filter(|index| is_inside(*index) && is_inside(index + 1));
        let heights = inside.map(|index| (index, standing_out(&changes, index)));
        heights.max_by(|(_, a), (_, b)| a.total_cmp(b)).unwrap_or((0, 0.0))
    }

    fn step(&mut self) {
        let mut from = None;
        for piece_m in STAGES_M {
            let goal = |own: &mut Self, point: &Point| own.outstanding(&own.line(point), piece_m).1;
            let (mut best, _) = self.climb(from, goal);
            // Centre the next, shorter line on this piece.
            let line = self.line(&best);
            let (index, _) = self.outstanding(&line, piece_m);
            let start_m = (index as f64 - 0.5 * PIECES as f64) * piece_m;
            if piece_m <= PIECES_MM[0] * 1.0e-3 {
                close_in(self.subject, self.reach, &line, start_m, &mut self.tally.jumps);
                return;
            }
            let middle = line.pose(start_m + 0.5 * piece_m);
            let [position_m, rotation_rad] = self.reach.sizes();
            let place = middle
                .position_m
                .map(|x| x / position_m)
                .into_iter()
                .chain(rotation_vector(middle.orientation()).to_array().map(|turn| turn / rotation_rad));
            best.iter_mut().zip(place).for_each(|(to, from)| *to = from.clamp(-1.0, 1.0));
            from = Some(best);
        }
    }

    /// Returns an ellipse about the point's pose, in the directions of its further twelve coordinates.
    fn ellipse(&self, point: &Point) -> Trajectory {
        let pose = self.pose(point);
        let [_, _, _, _, _, _, x, y, z, rx, ry, rz, u, v, w, ru, rv, rw] = *point;
        let [position_m, rotation_rad] = self.reach.sizes().map(|size| ELLIPSE * size);
        Trajectory {
            position: Series::ellipse(
                pose.position(),
                DVec3::new(x, y, z) * position_m,
                DVec3::new(u, v, w) * position_m,
            ),
            rotation: Series::ellipse(
                rotation_vector(pose.orientation()),
                DVec3::new(rx, ry, rz) * rotation_rad,
                DVec3::new(ru, rv, rw) * rotation_rad,
            ),
        }
    }

    /// Returns the energy generated on a lap of an ellipse, relative to the most that its forces could have done.
    fn made(&mut self, point: &Point) -> f64 {
        let path = self.ellipse(point);
        let memory = self.subject.memory();
        if memory == Memory::PathDependent && samples(self.subject, &path, SAMPLES).is_none() {
            return 0.0;
        }
        let Some(samples) = samples(self.subject, &path, SAMPLES) else { return 0.0 };
        let (lap, dissipation) = (Lap::from_samples(&samples, memory), Dissipation::at_rest(memory));
        let most_j = samples.iter().map(|sample| sample.most_j).sum::<f64>() / SAMPLES as f64;
        if most_j <= 0.0 {
            return 0.0;
        }
        self.tally.laps_resolved += u64::from(lap.is_resolved(dissipation));
        lap.made_j(dissipation) / most_j
    }

    fn energy(&mut self) {
        let (best, made) = self.climb(None, Self::made);
        let pose = self.pose(&best);
        self.tally.energy.offer(made, pose);
    }

    /// Returns a triangle from the point's pose; `None` where there is no force.
    fn triangle(&mut self, point: &Point) -> Option<Triangle> {
        let pose = self.pose(point);
        // Jump there without a walk: friction on the way would rotate the force.
        self.subject.restart();
        let there = self.subject.advance(pose, Twist::ZERO, PERIOD_NS).ok()?;
        let out = there.wrench.force().try_normalize()?;
        let [_, _, _, _, _, _, x, y, z, height, width, speed, ..] = *point;
        let aside = DVec3::new(x, y, z).reject_from_normalized(out).try_normalize()?;
        let below = |largest: f64, ratio: f64, number: f64| largest * math::pow(ratio, 0.5 * (number - 1.0));
        let [position_m, _] = self.reach.sizes();
        let up = out * below(SIDE * position_m, SIDE_RATIO, height);
        let side = aside * below(SIDE * position_m, SIDE_RATIO, width);
        let speeds = [below(FASTEST_M_PER_S, SPEED_RATIO, speed), SLOW_M_PER_S, SLOW_M_PER_S];
        Some(Triangle { start: pose, ways_m: [up + side, -side, -up], speeds_m_per_s: speeds })
    }

    fn energy_in_motion(&mut self) {
        self.tries = TRIES;
        // Minimal dissipation guides towards generated energy; without force there is no gradient.
        let (best, _) = self.climb(None, |own, point| {
            let lap = own.triangle(point).and_then(|triangle| triangle.lap(own.subject, EDGE_SAMPLES));
            lap.filter(|lap| lap.gross_j > 0.0).map_or(f64::NEG_INFINITY, |lap| lap.net_j / lap.gross_j)
        });
        let triangle = self.triangle(&best);
        let lap = triangle.and_then(|triangle| triangle.lap(self.subject, EDGE_SAMPLES_OF_THE_BEST));
        if let Some(lap) = lap.filter(|lap| lap.gross_j > 0.0) {
            self.tally.laps_resolved += u64::from(lap.is_resolved(Dissipation::Allowed));
            let pose = self.pose(&best);
            self.tally.energy_in_motion.offer(lap.made_j(Dissipation::Allowed) / lap.gross_j, pose);
        }
    }

    fn size(&mut self) {
        let (best, size_n) = self.climb(None, |own, point| {
            let pose = own.pose(point);
            match own.subject.answer_at(pose) {
                Ok(output) => size_n(&output.wrench),
                Err(trouble) => {
                    own.tally.troubles += 1;
                    own.tally.trouble_at.get_or_insert(trouble.pose);
                    0.0
                }
            }
        });
        let pose = self.pose(&best);
        self.tally.size.offer(size_n, pose);
    }
}

/// Number of goals.
const GOALS: u64 = 4;

/// Runs an optimiser for each goal from several starts.
pub(super) fn measure(setup: &Setup<'_>) -> Result<Measure, LoadError> {
    let reach = setup.options.reach;
    let total = sweep(setup, NAME, GOALS * setup.share(800, 2), |subject, block| {
        let tries = match subject.memory() {
            Memory::Stateless => TRIES,
            Memory::PathDependent => TRIES_WITH_MEMORY,
        };
        let random = Random::new(setup.options.seed, block);
        let bounds = subject.model().workspace_bounds();
        let mut opponent = Opponent { subject, reach, bounds, random, tries, tally: Tally::default() };
        match block % GOALS {
            0 => opponent.step(),
            1 => opponent.energy(),
            2 => opponent.energy_in_motion(),
            _ => opponent.size(),
        }
        opponent.tally
    })?;
    Ok(judge(&total))
}

fn judge(total: &Tally) -> Measure {
    let last = PIECES_MM.len() - 1;
    let (force, torque) = (total.jumps.force[last], total.jumps.torque[last]);
    // Judge each value by its own bound, and report the most severe.
    let graded = [
        (force, FELT_N * HARMLESS, FELT_N, "step of force"),
        (torque, FELT_NM * HARMLESS, FELT_NM, "step of torque"),
        (total.energy, CONSERVATIVE, CONSERVATIVE, "energy of a lap"),
        (total.energy_in_motion, CONSERVATIVE, CONSERVATIVE, "energy of a lap in motion"),
    ];
    let (worst, bound, _, what) = graded
        .into_iter()
        .max_by(|(a, of_a, ..), (b, of_b, ..)| (a.value / of_a).total_cmp(&(b.value / of_b)))
        .unwrap_or(graded[0]);
    let verdicts = graded.map(|(worst, bound, limit, _)| Verdict::of(worst.value, bound, limit));
    let mut verdict = verdicts.into_iter().max().unwrap_or(Verdict::Pass);
    let mut comment = format!("{what}, relative to its bound, after {} tries", total.tries);
    let mut pose = worst.pose;
    if total.troubles > 0 {
        verdict = Verdict::Fail;
        comment = format!("{} of {} tries returned no result", total.troubles, total.tries);
        pose = total.trouble_at;
    }
    let value = Worst { value: worst.value / bound, pose };
    let measure = Measure::of(["M9", NAME, ""], &value, [1.0, 1.0], comment)
        .count("tries", total.tries)
        .count("tries without answer", total.troubles)
        .with("largest force step over 1e-8 mm", force.value, "N")
        .with("largest torque step over 1e-8 mm", torque.value, "N·m")
        .with("largest energy of a lap, of what its forces could do", total.energy.value, "")
        .with("largest energy of a lap in motion, of all work exchanged", total.energy_in_motion.value, "")
        .count("laps known to the bound", total.laps_resolved)
        .with("largest wrench", total.size.value, "N");
    let possible = if total.laps_resolved > 0 { value.value } else { f64::INFINITY };
    Measure { verdict, pose: pose.map(PoseRecord::from), ..measure }
        .unless_uncertain(possible, || "no lap of the search is resolved to the bound".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A peak a thousandth of the space wide on a slope that leads to it: chance needs a million tries in two dimensions.
    #[test]
    fn what_is_worse_the_nearer_one_comes_is_found() {
        let plugin = super::super::tests::honest();
        let mut subject = Subject::new(&plugin, &[], 1).unwrap();
        let reach = Reach::default();
        let mut opponent = Opponent {
            subject: &mut subject,
            reach,
            bounds: WorkspaceBounds::UNBOUNDED,
            random: Random::new(1, 1),
            tries: 400,
            tally: Tally::default(),
        };
        let distance = |point: &Point| ((point[0] - 0.3).powi(2) + (point[1] + 0.2).powi(2)).sqrt();
        let (best, _) = opponent.climb(None, |_, point| 1.0 / (1.0e-6 + distance(point)));
        assert!(distance(&best) < 1.0e-3, "{}", distance(&best));
    }
}
