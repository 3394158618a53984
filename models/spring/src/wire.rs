//! Effects of a coiled wire that a straight rod lacks: twist under compression, and ends off the axis.
//!
//! The equivalent rod of [`crate::rigidity`] has the wire's stiffness along, about and across its axis, but its axis is a
//! straight line, with the ends of the rod on the axis. A wire is a helix, clamped at each end at one point of the coil's
//! circumference. So compression turns the upper plate, and the line of the force passes beside the plate's centre. Both
//! effects are a few per cent of the torques, and are added here as the energy
//!
//! ```text
//! W = q.(K_wire - K_rod) q / 2 + Q z² w / L0²         q = (r, 2 v)
//! ```
//!
//! with the displacement `r` of the upper plate and the vector part `v` of its quaternion (`2 v` is the rotation
//! vector to second order), `z` and `w` the axial displacement and the rotation `2 v_z`.
//!
//! `K_wire` is the stiffness at rest of an elastic wire on a helix, clamped at both ends: its compliance is the
//! integral along the wire of the compliance of each section, in bending and torsion, shear and tension, under the
//! loads of the upper plate (Castigliano; Love, *A treatise on the mathematical theory of elasticity*, chapters 18 and
//! 19). `Q` is the change of the compression-twist coupling as the coil flattens, of a uniform helix with a fixed
//! number of turns: `M_z = Theta (s0 - s) (EI (s0 + s)/2 - GJ s) / l` for the sine `s` of the pitch angle, the length
//! `l` of the wire and its winding angle `Theta`, with `s = s0 (1 + z/L0)`.
//!
//! The wire starts at the coil's radius on the x axis and winds to the right. Derivation: the book, chapter "The
//! spring".

use std::f64::consts::{PI, TAU};

use flotor_hal::glam::{DMat3, DVec3};
use flotor_hal::math;

use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::{Geometry, Material, Rigidities, Spring, Stiffness};
use flotor_lanes::basis::gauss_legendre;
use flotor_lanes::matrix::{Factored, product};

/// Shear force per shear angle of a round wire, in units of `G A`.
const SHEAR_FACTOR: f64 = 0.9;
/// Nodes of the quadrature over a coil: its integrand has four waves in it, which 24 nodes integrate to rounding.
const NODES: usize = 24;

/// Stiffness in displacement (m) and rotation (rad): rows of force (N) and torque (N·m).
type Stiffness6 = [[f64; 6]; 6];

/// Correction of the rod of one spring for its coiled wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wire {
    /// `K_wire - K_rod`
    difference: Stiffness6,
    /// `Q / L0²` (N/m)
    flattening_n_per_m: f64,
}

impl Wire {
    /// Prepares the correction for a spring. Real-time: bounded, no allocation; some tens of microseconds.
    #[must_use]
    pub fn new(spring: &Spring) -> Self {
        let (geometry, material) = (spring.geometry(), spring.material());
        // The wire's own rod; in the other modes both are scaled to the rigidity in force.
        let wire_spring = Spring::new(*geometry, *material, Stiffness::Physical).unwrap_or(*spring);
        let scale = spring.rigidities().gamma_n / wire_spring.rigidities().gamma_n;
        let wire = stiffness(&Compliance::of_wire(geometry, material));
        let rod = rod_stiffness(wire_spring.rigidities(), geometry.free_length_m);
        let section = Section::new(geometry, material);
        let winding_rad = TAU * geometry.active_coils;
        let wire_length_m = winding_rad * section.arc_m_per_rad;
        let length_squared = wire_length_m * wire_length_m;
        let flattening_n_per_m = scale * winding_rad / (wire_length_m * length_squared)
            * (section.torsion_n_m2 - 0.5 * section.bending_n_m2);
        let difference = std::array::from_fn(|i| std::array::from_fn(|j| scale * (wire[i][j] - rod[i][j])));
        Self { difference, flattening_n_per_m }
    }

    /// Returns a response of the rod at a pose with the wrench and energy of the correction added. Real-time: bounded, no
    /// allocation.
    pub fn added_to(&self, response: &Response, pose: &Pose, demand: Demand) -> Response {
        let q = pose.orientation;
        let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
        let (vector, scalar) = (sign * DVec3::new(q.x, q.y, q.z), sign * q.w);
        let (r, turn) = (pose.position_m, 2.0 * vector);
        let along = [r.x, r.y, r.z, turn.x, turn.y, turn.z];
        let [fx, fy, fz, mx, my, mz] = product(&self.difference, &along);
        let flattening_nm = self.flattening_n_per_m * r.z * r.z;
        let force_n = DVec3::new(fx, fy, fz + 2.0 * self.flattening_n_per_m * r.z * turn.z);
        let by_turn_nm = DVec3::new(mx, my, mz + flattening_nm);
        // Half of what is linear; the flattening, linear in the turn and quadratic in z, is whole in the force's half.
        let energy_j = force_n.dot(r) * 0.5 + DVec3::new(mx, my, mz).dot(turn) * 0.5;
        // A small rotation changes 2 v by w times itself and its cross product with v.
        let torque_nm = -(scalar * by_turn_nm + vector.cross(by_turn_nm));
        Response {
            force_n: response.force_n - force_n,
            torque_nm: match demand {
                Demand::Force => response.torque_nm,
                Demand::Wrench | Demand::WrenchAndEnergy => response.torque_nm + torque_nm,
            },
            energy_j: response.energy_j.map(|stored_j| stored_j + energy_j),
            validity: response.validity,
        }
    }
}

/// Cross-section of the wire.
struct Section {
    bending_n_m2: f64,
    torsion_n_m2: f64,
    shear_n: f64,
    tension_n: f64,
    coil_radius_m: f64,
    /// Climb and length of wire per radian of winding.
    climb_m_per_rad: f64,
    arc_m_per_rad: f64,
}

impl Section {
    fn new(geometry: &Geometry, material: &Material) -> Self {
        let d = geometry.wire_diameter_m;
        // Round wire: area pi d² / 4, second moment pi d⁴ / 64; the helix climbs L0 / (2 pi n) per radian.
        let (area_m2, second_moment_m4) = (0.25 * PI * d * d, PI * math::powi(d, 4) / 64.0);
        let coil_radius_m = 0.5 * geometry.coil_diameter_m;
        let climb_m_per_rad = geometry.free_length_m / (TAU * geometry.active_coils);
        Self {
            bending_n_m2: material.youngs_modulus_pa * second_moment_m4,
            torsion_n_m2: material.shear_modulus_pa * 2.0 * second_moment_m4,
            shear_n: SHEAR_FACTOR * material.shear_modulus_pa * area_m2,
            tension_n: material.youngs_modulus_pa * area_m2,
            coil_radius_m,
            climb_m_per_rad,
            arc_m_per_rad: math::hypot(coil_radius_m, climb_m_per_rad),
        }
    }
}

/// Compliance of the upper plate to a force and a torque at its centre: the energy is `F.ff F/2 + F.fm M + M.mm M/2`.
#[derive(Clone, Copy)]
struct Compliance {
    ff: DMat3,
    fm: DMat3,
    mm: DMat3,
}

impl Compliance {
    const NONE: Self = Self { ff: DMat3::ZERO, fm: DMat3::ZERO, mm: DMat3::ZERO };

    /// Returns the compliance of the whole wire: equal coils, each shifted down by its position, and a part of a coil at the top.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // hundreds of coils
    fn of_wire(geometry: &Geometry, material: &Material) -> Self {
        let section = Section::new(geometry, material);
        let (whole, rest) = (geometry.active_coils.floor(), geometry.active_coils.fract());
        let coil = Self::of_arc(&section, TAU);
        let mut sum = Self::of_arc(&section, TAU * rest);
        for index in 0..whole as u32 {
            let coils_above = geometry.active_coils - f64::from(index + 1);
            let height_m = TAU * coils_above * section.climb_m_per_rad;
            sum = sum.plus(&coil.seen_from(DVec3::new(0.0, 0.0, height_m)));
        }
        sum
    }

    /// Returns the compliance of an arc that starts on the x axis and ends at the height of the plate.
    fn of_arc(section: &Section, arc_rad: f64) -> Self {
        let mut sum = Self::NONE;
        for node in 0..NODES {
            let (t, weight) = gauss_legendre(NODES, node);
            let angle = 0.5 * (1.0 + t) * arc_rad;
            let (sine, cosine) = math::sin_cos(angle);
            let radius = section.coil_radius_m;
            let tangent =
                DVec3::new(-radius * sine, radius * cosine, section.climb_m_per_rad) / section.arc_m_per_rad;
            // A section yields along and across its tangent: shear and tension, bending and torsion.
            let along = DMat3::from_cols(tangent * tangent.x, tangent * tangent.y, tangent * tangent.z);
            let across = DMat3::IDENTITY - along;
            let yields = Self {
                ff: across * (1.0 / section.shear_n) + along * (1.0 / section.tension_n),
                fm: DMat3::ZERO,
                mm: across * (1.0 / section.bending_n_m2) + along * (1.0 / section.torsion_n_m2),
            };
            let arm_m =
                DVec3::new(-radius * cosine, -radius * sine, section.climb_m_per_rad * (arc_rad - angle));
            let length_m = 0.5 * weight * arc_rad * section.arc_m_per_rad;
            sum = sum.plus(&yields.seen_from(arm_m).times(length_m));
        }
        sum
    }

    /// Returns the compliance for a load at a point that is an arm away, whose force has a moment here.
    fn seen_from(&self, arm_m: DVec3) -> Self {
        let DVec3 { x, y, z } = arm_m;
        // With the cross product matrix X of the arm: ff + fm X + (fm X)ᵀ + Xᵀ mm X, and fm + Xᵀ mm.
        let cross = DMat3::from_cols(DVec3::new(0.0, z, -y), DVec3::new(-z, 0.0, x), DVec3::new(y, -x, 0.0));
        let mixed = self.fm * cross;
        Self {
            ff: self.ff + mixed + mixed.transpose() + cross.transpose() * self.mm * cross,
            fm: self.fm + cross.transpose() * self.mm,
            mm: self.mm,
        }
    }

    fn plus(&self, other: &Self) -> Self {
        Self { ff: self.ff + other.ff, fm: self.fm + other.fm, mm: self.mm + other.mm }
    }

    fn times(&self, factor: f64) -> Self {
        Self { ff: self.ff * factor, fm: self.fm * factor, mm: self.mm * factor }
    }
}

/// Inverts a compliance.
fn stiffness(compliance: &Compliance) -> Stiffness6 {
    let Compliance { ff, fm, mm } = compliance;
    let entry = |i: usize, j: usize| match (i / 3, j / 3) {
        (0, 0) => ff.col(j).to_array()[i],
        (0, _) => fm.col(j - 3).to_array()[i],
        (_, 0) => fm.col(i - 3).to_array()[j],
        _ => mm.col(j - 3).to_array()[i - 3],
    };
    let matrix: Stiffness6 = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
    let factored = Factored::new(&matrix, 0.0);
    std::array::from_fn(|i| factored.solve(&std::array::from_fn(|j| if i == j { 1.0 } else { 0.0 })))
}

/// Returns the stiffness of the straight rod: a beam that shears (Timoshenko), compressed and twisted besides.
fn rod_stiffness(rigidities: &Rigidities, length_m: f64) -> Stiffness6 {
    let Rigidities { alpha_n_m2: alpha, beta_n: beta, gamma_n: gamma, tau_n_m2: tau } = *rigidities;
    // Timoshenko beam: lateral 12 u / L², coupling 6 u / L, bending (4 + softness) u, u = alpha / (L (1 + softness)).
    let softness = 12.0 * alpha / (beta * length_m * length_m);
    let unit = alpha / (length_m * (1.0 + softness));
    let lateral = 12.0 * unit / (length_m * length_m);
    let (coupling, bending) = (6.0 * unit / length_m, (4.0 + softness) * unit);
    let mut matrix = [[0.0; 6]; 6];
    (matrix[0][0], matrix[1][1], matrix[2][2]) = (lateral, lateral, gamma / length_m);
    (matrix[3][3], matrix[4][4], matrix[5][5]) = (bending, bending, tau / length_m);
    // Tilting towards +x is a rotation about +y, towards +y one about -x.
    (matrix[0][4], matrix[4][0]) = (-coupling, -coupling);
    (matrix[1][3], matrix[3][1]) = (coupling, coupling);
    matrix
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use crate::validity::Validity;
    use flotor_hal::glam::DQuat;

    fn alone(wire: &Wire, pose: &Pose) -> Response {
        let nothing = Response { energy_j: Some(0.0), ..Response::none(Validity::Ok) };
        wire.added_to(&nothing, pose, Demand::WrenchAndEnergy)
    }

    #[test]
    fn wrench_is_the_gradient_of_the_energy() {
        let wire = Wire::new(&Preset::Thesis2.spring());
        let pose = Pose::from_rotation_vector(DVec3::new(4e-3, -2e-3, -9e-3), DVec3::new(0.3, -0.2, 0.5));
        let here = alone(&wire, &pose);
        let h = 1e-5;
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let moved = |s: f64| Pose { position_m: pose.position_m + axis * (s * h), ..pose };
            let turned =
                |s: f64| Pose { orientation: DQuat::from_axis_angle(axis, s * h) * pose.orientation, ..pose };
            let slope = |at: &dyn Fn(f64) -> Pose| {
                let energy = |s: f64| alone(&wire, &at(s)).energy_j.unwrap();
                (energy(1.0) - energy(-1.0)) / (2.0 * h)
            };
            // Second order in the step, on energies of microjoules per millimetre and radian.
            assert!((slope(&moved) + here.force_n.dot(axis)).abs() < 1e-8, "{axis}");
            assert!((slope(&turned) + here.torque_nm.dot(axis)).abs() < 1e-12, "{axis}");
        }
    }

    /// `q` and `-q` are one rotation, and a spring at home feels nothing of its wire.
    #[test]
    fn home_is_home_and_a_rotation_has_one_answer() {
        let wire = Wire::new(&Preset::Thesis1.spring());
        assert_eq!(alone(&wire, &Pose::HOME).force_n, DVec3::ZERO);
        assert_eq!(alone(&wire, &Pose::HOME).torque_nm, DVec3::ZERO);
        let pose = Pose::from_rotation_vector(DVec3::new(1e-3, 0.0, -2e-3), DVec3::new(0.1, 0.2, -0.3));
        let opposite = Pose { orientation: -pose.orientation, ..pose };
        assert_eq!(alone(&wire, &pose), alone(&wire, &opposite));
    }

    /// Compression at a held number of turns unwinds the wire: the torque of the uniform helix, Theta/l times what
    /// bending and torsion differ by, at any compression.
    #[test]
    fn compression_twists_as_a_uniform_helix_does() {
        let spring = Preset::Thesis1.spring();
        let wire = Wire::new(&spring);
        let (geometry, material) = (spring.geometry(), spring.material());
        let section = Section::new(geometry, material);
        let winding_rad = TAU * geometry.active_coils;
        let length_m = winding_rad * section.arc_m_per_rad;
        let physical = Spring::new(*geometry, *material, Stiffness::Physical).unwrap();
        let scale = spring.rigidities().gamma_n / physical.rigidities().gamma_n;
        for compression in [0.01, 0.2, 0.5, 0.7] {
            let z = -compression * geometry.free_length_m;
            let pose = Pose { position_m: DVec3::new(0.0, 0.0, z), ..Pose::HOME };
            let (rest, now) = (geometry.free_length_m / length_m, (geometry.free_length_m + z) / length_m);
            let helix_nm = scale * winding_rad / length_m
                * (rest - now)
                * (0.5 * section.bending_n_m2 * (rest + now) - section.torsion_n_m2 * now);
            // The clamped ends and the wire's shear are not in the uniform helix: 1.4 % of its coupling at rest.
            let torque_nm = alone(&wire, &pose).torque_nm.z;
            assert!((torque_nm / -helix_nm - 1.0).abs() < 0.02, "{compression}: {torque_nm} {helix_nm}");
        }
    }
}
