//! Slow generic solver of the problem in the crate's documentation: an accelerated gradient method with restarts (B. O'Donoghue,
//! E. Candes, "Adaptive restart for accelerated gradient schemes", Found. Comput. Math. 15, 2015), from the formulas, with
//! matrices of its own. It shares no code with the crate.

#![allow(clippy::needless_range_loop)] // matrices and contacts by index, as in the formulas

use super::{Case, PERIOD_S};
use flotor_contact::Contact;
use flotor_hal::glam::DVec3;
use flotor_hal::{Pose, Twist};

type Matrix = [[f64; 6]; 6];

/// Solver with the friction of its own past.
pub(crate) struct Reference {
    contacts: Vec<Contact>,
    arms_at_anchor: Vec<DVec3>,
    points_at_anchor: Vec<DVec3>,
    /// Offset of the tool by coordinates: the symmetric root of the compliance.
    root: Matrix,
    is_rigid: bool,
    springs: Vec<Option<DVec3>>,
    normal_forces: Vec<f64>,
}

/// Force and torque, and the gradient that remains.
pub(crate) struct Answer {
    pub(crate) force: DVec3,
    pub(crate) torque: DVec3,
    pub(crate) residual: f64,
}

/// A contact in a tick without an offset.
struct Fixed {
    depth: f64,
    stretch: DVec3,
    speed: f64,
    limit: f64,
}

impl Reference {
    pub(crate) fn new(case: &Case) -> Self {
        let orientation = case.anchor.orientation();
        let arms: Vec<_> = case.contacts.iter().map(|contact| orientation * contact.tool_point_m).collect();
        let (root, is_rigid) = compliance_root(&case.contacts, &arms, case.stiffness);
        Self {
            points_at_anchor: arms.iter().map(|arm| case.anchor.position() + *arm).collect(),
            arms_at_anchor: arms,
            root,
            is_rigid,
            springs: vec![None; case.contacts.len()],
            normal_forces: vec![0.0; case.contacts.len()],
            contacts: case.contacts.clone(),
        }
    }

    pub(crate) fn tick(&mut self, pose: &Pose, twist: &Twist, age_s: f64, elapsed_s: f64) -> Answer {
        let count = self.contacts.len();
        let arms: Vec<_> =
            self.contacts.iter().map(|contact| pose.orientation() * contact.tool_point_m).collect();
        let mut fixed = Vec::with_capacity(count);
        for i in 0..count {
            let contact = self.contacts[i];
            let point = pose.position() + arms[i];
            let travel = contact.surface_velocity_m_per_s * age_s;
            let gap = contact.gap_m + contact.normal.dot(point - self.points_at_anchor[i] - travel);
            let velocity = twist.linear() + twist.angular().cross(arms[i]) - contact.surface_velocity_m_per_s;
            let spring =
                self.springs[i].map_or(point, |at| at + contact.surface_velocity_m_per_s * elapsed_s);
            self.springs[i] = Some(spring);
            let (depth, speed) = (-gap, -contact.normal.dot(velocity));
            let normal =
                if self.is_rigid { normal_force(&contact, depth, speed) } else { self.normal_forces[i] };
            let stretch = (point - spring).reject_from_normalized(contact.normal);
            fixed.push(Fixed { depth, stretch, speed, limit: contact.friction * normal });
        }
        let z = self.minimum(&fixed);
        let (gradient, forces) = self.gradient(&fixed, &z);
        let [linear, angular] = self.offset(&z);
        let (mut force, mut torque) = (DVec3::ZERO, DVec3::ZERO);
        for i in 0..count {
            let contact = self.contacts[i];
            force += forces[i];
            torque += arms[i].cross(forces[i]);
            let moved = linear + angular.cross(self.arms_at_anchor[i]);
            self.normal_forces[i] =
                normal_force(&contact, fixed[i].depth - contact.normal.dot(moved), fixed[i].speed);
            let friction = (forces[i] - contact.normal * contact.normal.dot(forces[i])) * -1.0;
            // The spring keeps the stretch that its force belongs to.
            let point = pose.position() + arms[i] + moved;
            let stretch = if has_friction(&contact) {
                friction / contact.tangential_stiffness_n_per_m
            } else {
                DVec3::ZERO
            };
            self.springs[i] = Some(point - stretch);
        }
        Answer { force, torque, residual: norm(&gradient) }
    }

    fn offset(&self, z: &[f64; 6]) -> [DVec3; 2] {
        let u = product(&self.root, z);
        [DVec3::new(u[0], u[1], u[2]), DVec3::new(u[3], u[4], u[5])]
    }

    fn gradient(&self, fixed: &[Fixed], z: &[f64; 6]) -> ([f64; 6], Vec<DVec3>) {
        let [linear, angular] = self.offset(z);
        let (mut load, mut forces) = ([0.0; 6], Vec::with_capacity(fixed.len()));
        for (i, fixed) in fixed.iter().enumerate() {
            let contact = self.contacts[i];
            let moved = linear + angular.cross(self.arms_at_anchor[i]);
            let along = contact.normal.dot(moved);
            let normal = normal_force(&contact, fixed.depth - along, fixed.speed);
            let stretch = fixed.stretch + moved - contact.normal * along;
            let mut friction = DVec3::ZERO;
            if has_friction(&contact) {
                let trial = stretch * contact.tangential_stiffness_n_per_m;
                friction =
                    if trial.length() > fixed.limit { trial * (fixed.limit / trial.length()) } else { trial };
            }
            let force = contact.normal * normal - friction;
            let torque = self.arms_at_anchor[i].cross(force);
            for axis in 0..3 {
                load[axis] += force[axis];
                load[axis + 3] += torque[axis];
            }
            forces.push(force);
        }
        // The root is D S with S symmetric: its transpose is S D.
        let mut gradient = *z;
        for (row, load) in self.root.iter().zip(load) {
            for (part, root) in gradient.iter_mut().zip(row) {
                *part -= root * load;
            }
        }
        (gradient, forces)
    }

    fn minimum(&self, fixed: &[Fixed]) -> [f64; 6] {
        if self.is_rigid {
            return [0.0; 6];
        }
        let mut steepest = 1.0;
        for (contact, arm) in self.contacts.iter().zip(&self.arms_at_anchor) {
            let square = |direction: DVec3| {
                let turn = arm.cross(direction);
                let row = [direction.x, direction.y, direction.z, turn.x, turn.y, turn.z];
                let mut sum = [0.0; 6];
                for (root, row) in self.root.iter().zip(row) {
                    for (sum, root) in sum.iter_mut().zip(root) {
                        *sum += root * row;
                    }
                }
                sum.iter().map(|part| part * part).sum::<f64>()
            };
            let (first, second) = contact.normal.any_orthonormal_pair();
            steepest +=
                (contact.stiffness_n_per_m + contact.damping_ns_per_m / PERIOD_S) * square(contact.normal);
            steepest += contact.tangential_stiffness_n_per_m * (square(first) + square(second));
        }
        let root = f64::sqrt(steepest);
        let momentum = (root - 1.0) / (root + 1.0);
        let (mut z, mut ahead) = ([0.0; 6], [0.0; 6]);
        let mut best = (f64::INFINITY, z);
        let mut without_progress = 0;
        for _ in 0..1_000_000 {
            let (gradient, _) = self.gradient(fixed, &ahead);
            let length = norm(&gradient);
            if length < best.0 * 0.999 {
                best = (length, ahead);
                without_progress = 0;
            } else {
                without_progress += 1;
            }
            // Linear convergence: rounding is reached where nothing falls any more.
            if length <= 1.0e-17 || without_progress > 40 + 12 * momentum_steps(root) {
                break;
            }
            let next: [f64; 6] = std::array::from_fn(|row| ahead[row] - gradient[row] / steepest);
            let step: [f64; 6] = std::array::from_fn(|row| next[row] - z[row]);
            let uphill: f64 = (0..6).map(|row| gradient[row] * step[row]).sum();
            let momentum = if uphill > 0.0 { 0.0 } else { momentum };
            ahead = std::array::from_fn(|row| next[row] + momentum * step[row]);
            z = next;
        }
        best.1
    }
}

#[allow(clippy::cast_possible_truncation)]
fn momentum_steps(root: f64) -> i32 {
    root.min(1.0e6) as i32
}

fn has_friction(contact: &Contact) -> bool {
    contact.friction > 0.0 && contact.tangential_stiffness_n_per_m > 0.0
}

fn normal_force(contact: &Contact, depth: f64, speed: f64) -> f64 {
    if depth <= 0.0 {
        return 0.0;
    }
    let damper = (contact.damping_ns_per_m * speed).min(contact.damping_ns_per_m / PERIOD_S * depth);
    (contact.stiffness_n_per_m * depth + damper).max(0.0)
}

/// Root of the compliance in series that makes the stiffness of the set, all contacts touching and sticking, at most the
/// coupling's.
fn compliance_root(contacts: &[Contact], arms: &[DVec3], stiffness: [f64; 2]) -> (Matrix, bool) {
    let scale: [f64; 6] =
        std::array::from_fn(
            |row| if row < 3 { stiffness[0].sqrt().recip() } else { stiffness[1].sqrt().recip() },
        );
    let mut matrix = [[0.0; 6]; 6];
    for (contact, arm) in contacts.iter().zip(arms) {
        let tangential = if has_friction(contact) { contact.tangential_stiffness_n_per_m } else { 0.0 };
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let motions = axes.into_iter().chain(axes.map(|axis| axis.cross(*arm)));
        for (column, moved) in motions.enumerate() {
            let along = contact.normal * contact.normal.dot(moved);
            let force = along * contact.stiffness_n_per_m + (moved - along) * tangential;
            let torque = arm.cross(force);
            for row in 0..3 {
                matrix[row][column] += force[row] * scale[row] * scale[column];
                matrix[row + 3][column] += torque[row] * scale[row + 3] * scale[column];
            }
        }
    }
    let (values, vectors) = classical_jacobi(matrix);
    let mut root = [[0.0; 6]; 6];
    for (value, vector) in values.iter().zip(&vectors) {
        let length = (1.0 - 1.0 / value.max(1.0)).sqrt();
        for row in 0..6 {
            for column in 0..6 {
                root[row][column] += scale[row] * length * vector[row] * vector[column];
            }
        }
    }
    (root, values.iter().all(|value| *value <= 1.0))
}

/// Eigenvalues and eigenvectors by rotations about the largest entry beside the diagonal, with angles.
fn classical_jacobi(mut matrix: Matrix) -> ([f64; 6], [[f64; 6]; 6]) {
    let mut vectors: Matrix =
        std::array::from_fn(|row| std::array::from_fn(|column| f64::from(row == column)));
    for _ in 0..400 {
        let pairs = (0..6).flat_map(|p| (p + 1..6).map(move |q| (p, q)));
        let largest = pairs.max_by(|a, b| matrix[a.0][a.1].abs().total_cmp(&matrix[b.0][b.1].abs()));
        let (p, q) = largest.expect("there are pairs");
        if matrix[p][q].abs() < 1.0e-18 * (matrix[p][p].abs() + matrix[q][q].abs()) || matrix[p][q] == 0.0 {
            break;
        }
        let angle = 0.5 * f64::atan2(2.0 * matrix[p][q], matrix[p][p] - matrix[q][q]);
        let (sine, cosine) = angle.sin_cos();
        let mut rotation: Matrix =
            std::array::from_fn(|row| std::array::from_fn(|column| f64::from(row == column)));
        (rotation[p][p], rotation[p][q]) = (cosine, -sine);
        (rotation[q][p], rotation[q][q]) = (sine, cosine);
        matrix = multiply(&transposed(&rotation), &multiply(&matrix, &rotation));
        vectors = multiply(&vectors, &rotation);
    }
    (std::array::from_fn(|row| matrix[row][row]), transposed(&vectors))
}

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| (0..6).map(|k| a[row][k] * b[k][column]).sum()))
}

fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|row| std::array::from_fn(|column| a[column][row]))
}

fn product(matrix: &Matrix, vector: &[f64; 6]) -> [f64; 6] {
    std::array::from_fn(|row| (0..6).map(|k| matrix[row][k] * vector[k]).sum())
}

fn norm(vector: &[f64; 6]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}
