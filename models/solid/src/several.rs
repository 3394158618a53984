//! Several equal spheres on one handle, each in contact with the same solid.
//!
//! Every sphere alone has the energy `E` of [`crate::atlas`]. A contact also lowers the surface under the other
//! spheres: by `C F` for a vertical force `F`, with the compliance `C` of a half-space between two points of its
//! surface, `(1 - nu^2) / (pi E r)`, plus the compliance that the body adds. With the depressions `w` of the surface
//! under each sphere by all other spheres,
//!
//! ```text
//! F_i = -dE_i/dz (c_i + w_i z),   w_i = sum_j C_ij F_j,   W = sum_i E_i(c_i + w_i z) + 1/2 sum_ij C_ij F_i F_j
//! ```
//!
//! `W` is stationary in the forces, so its gradient with respect to the centres has only the parts of `E` at the lowered
//! positions and of `C`: the force has a potential for any set of spheres in contact. A sphere without contact has zero `E` and
//! force, so no search for the set of contacts is needed. The secant method solves for the forces in at most sixty steps, from
//! the same start in every tick, so that the result is independent of the path.
//!
//! At an edge, and deeper than a solid of small strains is valid, the vertical force of `E` falls as a sphere goes down, and several
//! solutions would exist. The lowered law is therefore that of the top face alone, `T` ([`Atlas::top`]), whose force grows with the
//! depth: `W = sum_i (E_i - T_i)(c_i) + T_i(c_i + w_i z) + 1/2 sum_ij C_ij F_i F_j` with `F_i = -dT_i/dz`. On the top, `E` is `T`.
//!
//! `C` treats each contact as a point: for contacts of radius `a` at a distance of `r` the interaction has an error of
//! `0.2 (a / r)^2`, at most 5 % for spheres that nearly touch each other.

use crate::atlas::{self, Atlas, ease_at};
use crate::jet::Jet;
use crate::spline::{Curve, End, take, whole};
use flotor_hal::{DQuat, DVec3, Wrench};
use std::f64::consts::PI;

/// Maximum number of spheres on a handle.
pub const MAX_SPHERES: usize = 4;
/// Maximum number of iterations of a solve.
const STEPS: usize = 60;
/// Largest error of a force at convergence, relative to the largest force.
const TOLERANCE: f64 = 1.0e-12;
/// Least distance between two depressions for a secant, m.
const SECANT_M: f64 = 1.0e-12;
/// Relative difference below which two energies count as equal.
const ROUNDING: f64 = 1.0e-12;

/// Difference between the vertical compliance of a body's top face and that of a half-space, for a modulus of 1 Pa: cubic splines
/// through the values for all pairs of nodes of a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct ExtraCompliance {
    /// Spline of each node of an axis: one at this node, zero at the others.
    shapes: [Vec<Curve>; 2],
    /// First and last node of each axis, m.
    ends_m: [[f64; 2]; 2],
    /// Compliance for each pair of nodes of the grid (x first), m/N.
    values: Vec<f64>,
}

/// Maximum number of grid nodes along an axis.
const MOST_NODES: usize = 7;

/// Weights of the nodes at a place, with their derivatives along x and y.
type Weights = [[f64; 3]; MOST_NODES * MOST_NODES];

impl ExtraCompliance {
    /// Interpolates the values for all pairs of nodes of a grid (x first). `None` unless there are three to seven nodes
    /// along each axis and a value for each pair. Not real-time.
    #[must_use]
    pub fn new(nodes_m: [&[f64]; 2], values: Vec<f64>) -> Option<Self> {
        let count = nodes_m[0].len() * nodes_m[1].len();
        if nodes_m.iter().any(|nodes| !(3..=MOST_NODES).contains(&nodes.len()))
            || values.len() != count * count
        {
            return None;
        }
        let shapes = nodes_m.map(|nodes| {
            let unit = |node: usize| (0..nodes.len()).map(|i| f64::from(u8::from(i == node))).collect();
            (0..nodes.len()).map(|node| Curve::new(nodes.to_vec(), unit(node), [End::Parabola; 2])).collect()
        });
        let ends_m = nodes_m.map(|nodes| [nodes[0], nodes[nodes.len() - 1]]);
        Some(Self { shapes, ends_m, values })
    }

    /// Builds the spline from the numbers of [`crate::prepare::beyond_half_space`]; `None` if the numbers do not describe a grid
    /// for [`Self::new`]. Not real-time.
    #[must_use]
    pub fn from_numbers(mut numbers: &[f64]) -> Option<Self> {
        let counts = [whole(take(&mut numbers, 1)?[0])?, whole(take(&mut numbers, 1)?[0])?];
        let (x, y) = (take(&mut numbers, counts[0])?, take(&mut numbers, counts[1])?);
        Self::new([x, y], numbers.to_vec())
    }

    /// Returns the weights of the nodes at a place, which is limited to the grid.
    fn weights(&self, place_m: DVec3) -> Weights {
        let along = [0, 1].map(|axis| {
            let [low, high] = self.ends_m[axis];
            let width = 0.05 * (high - low);
            let at = ease_at(Jet::variable(place_m[axis], axis), high, width);
            let at = -ease_at(-at, -low, width);
            let mut weights = [(0.0, 0.0); MOST_NODES];
            for (weight, shape) in weights.iter_mut().zip(&self.shapes[axis]) {
                let (value, slope) = shape.at(at.value);
                *weight = (value, slope * at.slope[axis]);
            }
            weights
        });
        let mut all = [[0.0; 3]; MOST_NODES * MOST_NODES];
        let count = self.shapes[0].len();
        for (j, (v, dv)) in along[1].iter().enumerate().take(self.shapes[1].len()) {
            for (i, (u, du)) in along[0].iter().enumerate().take(count) {
                all[j * count + i] = [u * v, du * v, u * dv];
            }
        }
        all
    }

    /// Returns the displacement of each node under a unit force at a place with these weights.
    fn spread(&self, weights: &Weights) -> [f64; MOST_NODES * MOST_NODES] {
        let count = self.shapes[0].len() * self.shapes[1].len();
        let mut moved = [0.0; MOST_NODES * MOST_NODES];
        for (row, weight) in self.values.chunks_exact(count).zip(weights) {
            moved.iter_mut().zip(row).for_each(|(m, value)| *m += value * weight[0]);
        }
        moved
    }
}

/// Force law of several spheres.
#[derive(Clone, Debug, PartialEq)]
pub struct Spheres {
    /// Law of a single sphere.
    pub atlas: Atlas,
    poisson_ratio: f64,
    /// Centres relative to the handle, in its frame, m.
    offsets_m: Vec<DVec3>,
    /// Addition of a block to the compliance of a half-space, for a modulus of 1 Pa (m/N). `None` on a half-space.
    pub beyond: Option<ExtraCompliance>,
}

/// Response of several spheres at a pose, for a modulus of 1 Pa.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Wrench on the hand; the torque is about the middle of the spheres' centres.
    pub wrench: Wrench,
    /// Stored energy, J.
    pub energy_j: f64,
    /// Positions of the centres, m; the first [`Spheres::count`] are valid.
    pub centres_m: [DVec3; MAX_SPHERES],
    /// Force on each sphere, N.
    pub forces_n: [DVec3; MAX_SPHERES],
    /// Depth of the face inside each sphere, including the depression by the other spheres, m; not positive without
    /// contact.
    pub depths_m: [f64; MAX_SPHERES],
    /// Depression of the surface under each sphere by the other spheres, m.
    pub depressions_m: [f64; MAX_SPHERES],
    /// True if the law of a sphere is extrapolated from a nearby position.
    pub is_extrapolated: bool,
    /// True if the forces converged.
    pub is_settled: bool,
}

impl Spheres {
    /// Places two to four spheres at the corners of a regular polygon about the handle, normal to z; two spheres lie
    /// along x. `spacing_m`: distance between neighbouring centres. Not real-time.
    #[must_use]
    pub fn new(
        atlas: Atlas,
        poisson_ratio: f64,
        count: usize,
        spacing_m: f64,
        beyond: Option<ExtraCompliance>,
    ) -> Self {
        let half = 0.5 * spacing_m;
        let corners: &[[f64; 2]] = match count {
            0..=2 => &[[-1.0, 0.0], [1.0, 0.0]],
            3 => &[
                [-1.0, -0.577_350_269_189_625_8],
                [1.0, -0.577_350_269_189_625_8],
                [0.0, 1.154_700_538_379_251_5],
            ],
            _ => &[[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]],
        };
        let offsets_m = corners.iter().map(|[x, y]| DVec3::new(x * half, y * half, 0.0)).collect();
        Self { atlas, poisson_ratio, offsets_m, beyond }
    }

    /// Returns the number of spheres.
    #[must_use]
    pub fn count(&self) -> usize {
        self.offsets_m.len()
    }

    /// Evaluates the law at a pose (finite) of the handle; at home every sphere touches the undeformed face. Real-time: bounded,
    /// no allocation.
    pub fn answer(&self, position_m: DVec3, orientation: DQuat) -> Answer {
        let count = self.count();
        let home = DVec3::Z * self.atlas.radius_m;
        let mut arms_m = [DVec3::ZERO; MAX_SPHERES];
        arms_m.iter_mut().zip(&self.offsets_m).for_each(|(arm, offset)| *arm = orientation * *offset);
        let centres_m = arms_m.map(|arm| position_m + home + arm);
        let (compliance, slopes) = self.compliance(&centres_m);
        let (settled, is_settled) = self.settle(&centres_m, &compliance);
        let mut answer = Answer {
            wrench: Wrench::ZERO,
            energy_j: 0.0,
            centres_m,
            forces_n: [DVec3::ZERO; MAX_SPHERES],
            depths_m: [-1.0; MAX_SPHERES],
            depressions_m: [0.0; MAX_SPHERES],
            is_extrapolated: false,
            is_settled,
        };
        let (mut force_n, mut torque_nm) = (DVec3::ZERO, DVec3::ZERO);
        for i in 0..count {
            let (pressed, depression_m) = settled[i];
            let centre_m = centres_m[i].to_array();
            let (alone, top) = (self.atlas.answer(centre_m), self.atlas.top(centre_m));
            // Contribution of other faces to the energy.
            let mut edge = alone.energy - top.energy;
            if edge.value.abs() <= ROUNDING * alone.energy.value {
                edge = Jet::default();
            }
            let own = edge + pressed.energy;
            let mut own_n = -DVec3::from_array(own.slope);
            answer.energy_j += own.value;
            for j in (0..count).filter(|&j| j != i) {
                let both_n2 = pressed.energy.slope[2] * settled[j].0.energy.slope[2];
                answer.energy_j += 0.5 * compliance[i][j] * both_n2;
                own_n += slopes[i][j] * both_n2;
            }
            answer.forces_n[i] = own_n;
            answer.depths_m[i] =
                if top.energy.value > 0.0 { alone.depth_m - depression_m } else { alone.depth_m };
            answer.depressions_m[i] = depression_m;
            answer.is_extrapolated |= alone.is_extrapolated;
            force_n += own_n;
            torque_nm += arms_m[i].cross(own_n);
        }
        answer.wrench = Wrench::new(force_n, torque_nm);
        answer
    }

    /// Returns the compliance between each two spheres, m/N, and its derivatives with respect to the position of the first
    /// sphere.
    fn compliance(
        &self,
        centres_m: &[DVec3; MAX_SPHERES],
    ) -> ([[f64; MAX_SPHERES]; MAX_SPHERES], [[DVec3; MAX_SPHERES]; MAX_SPHERES]) {
        let count = self.count();
        let (mut values, mut slopes) =
            ([[0.0; MAX_SPHERES]; MAX_SPHERES], [[DVec3::ZERO; MAX_SPHERES]; MAX_SPHERES]);
        for i in 0..count {
            for j in (0..count).filter(|&j| j != i) {
                // The tool is rigid: this distance is the same at every pose, and its derivative is zero.
                let distance_m = (self.offsets_m[i] - self.offsets_m[j]).length();
                values[i][j] = (1.0 - self.poisson_ratio * self.poisson_ratio) / (PI * distance_m);
            }
        }
        let Some(beyond) = &self.beyond else { return (values, slopes) };
        let weights = centres_m.map(|centre| beyond.weights(centre));
        for j in 0..count {
            let moved = beyond.spread(&weights[j]);
            for i in (0..count).filter(|&i| i != j) {
                let mut sums = [0.0; 3];
                for (weight, moved) in weights[i].iter().zip(&moved) {
                    sums.iter_mut().zip(weight).for_each(|(sum, w)| *sum += w * moved);
                }
                values[i][j] += sums[0];
                slopes[i][j] = DVec3::new(sums[1], sums[2], 0.0);
            }
        }
        // The table is symmetric up to rounding; the energy requires exact symmetry.
        for i in 0..count {
            for j in 0..i {
                values[i][j] = values[j][i];
            }
        }
        (values, slopes)
    }

    /// Solves for the forces on the top alone. Returns the contact and the depression of each sphere, and true if the
    /// forces have converged.
    fn settle(
        &self,
        centres_m: &[DVec3; MAX_SPHERES],
        compliance: &[[f64; MAX_SPHERES]; MAX_SPHERES],
    ) -> ([(atlas::Answer, f64); MAX_SPHERES], bool) {
        let count = self.count();
        let alone = |centre: DVec3, depression_m: f64| {
            (self.atlas.top((centre + DVec3::Z * depression_m).to_array()), depression_m)
        };
        let mut now = centres_m.map(|centre| alone(centre, 0.0));
        let (mut up_n, mut stiffness) = ([0.0; MAX_SPHERES], [0.0; MAX_SPHERES]);
        for i in 0..count {
            let (answer, _) = now[i];
            up_n[i] = -answer.energy.slope[2];
            // Start with the stiffness of Hertz's law.
            stiffness[i] = if answer.depth_m > 0.0 { (1.5 * up_n[i] / answer.depth_m).max(0.0) } else { 0.0 };
        }
        for step in 0..STEPS {
            let (mut largest_n, mut miss_n) = (0.0_f64, 0.0_f64);
            let (mut matrix, mut right) = ([[0.0; MAX_SPHERES]; MAX_SPHERES], [0.0; MAX_SPHERES]);
            for i in 0..count {
                let (before, before_m) = now[i];
                let depression_m: f64 = (0..count).map(|j| compliance[i][j] * up_n[j]).sum();
                now[i] = alone(centres_m[i], depression_m);
                let found_n = -now[i].0.energy.slope[2];
                right[i] = found_n - up_n[i];
                largest_n = largest_n.max(found_n.abs());
                miss_n = miss_n.max(right[i].abs());
                // A force depends on one depression alone: the secant through the last two.
                let moved_m = depression_m - before_m;
                let hertz =
                    if now[i].0.depth_m > 0.0 { (1.5 * found_n / now[i].0.depth_m).abs() } else { 0.0 };
                if step >= STEPS / 2 {
                    // At a kink of the law secants may cycle; half of Hertz's stiffness converges at every step.
                    stiffness[i] = 0.5 * hertz;
                } else if moved_m.abs() > SECANT_M {
                    let secant = (-before.energy.slope[2] - found_n) / moved_m;
                    stiffness[i] = secant.clamp(-2.0 * hertz, 2.0 * hertz);
                }
                for j in 0..count {
                    matrix[i][j] = stiffness[i] * compliance[i][j] + f64::from(u8::from(i == j));
                }
            }
            if miss_n <= TOLERANCE * largest_n {
                return (now, true);
            }
            let change = eliminate(matrix, right, count);
            if !change.iter().all(|c| c.is_finite()) {
                break;
            }
            (0..count).for_each(|i| up_n[i] += change[i]);
        }
        (now, false)
    }
}

/// Solves a small diagonally dominant linear system by Gaussian elimination, without pivoting.
fn eliminate(
    mut matrix: [[f64; MAX_SPHERES]; MAX_SPHERES],
    mut right: [f64; MAX_SPHERES],
    count: usize,
) -> [f64; MAX_SPHERES] {
    for column in 0..count {
        let pivot = matrix[column];
        for row in column + 1..count {
            let share = matrix[row][column] / pivot[column];
            matrix[row].iter_mut().zip(pivot).for_each(|(value, p)| *value -= share * p);
            right[row] -= share * right[column];
        }
    }
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count).map(|k| matrix[row][k] * right[k]).sum();
        right[row] = (right[row] - known) / matrix[row][row];
    }
    right
}
