//! Rigid patch of a surface: wrench of a bonded plate or punch, from one quadratic energy.
//!
//! The displacement of a point of the patch is `u = t + (R - I) X`, with its position `X` from the patch's centre and the exact
//! rotation `R`: linear in twelve numbers `v`, the modes. The energy is `1/2 v.K v`; force and torque are its derivatives with
//! respect to the movement of the hand.

use flotor_hal::{DMat3, DQuat, DVec3, Demand, Wrench};

/// Number of modes: three of `t`, nine of `R - I`.
pub const MODES: usize = 12;

/// Stiffness of a patch in its modes: translation along x, y, z first, then `R - I`, entry `(i, j)` at index `3 + 3 i + j`.
#[derive(Clone, Debug, PartialEq)]
pub struct RigidPatch {
    /// Symmetric positive semidefinite stiffness matrix, N/m, N and N m.
    pub stiffness: [[f64; MODES]; MODES],
}

impl RigidPatch {
    /// Returns the index of the mode of entry `(i, j)` of `R - I`.
    #[must_use]
    pub const fn entry(i: usize, j: usize) -> usize {
        3 + 3 * i + j
    }

    /// Returns the twelve mode amplitudes of a pose: the translation, m, and the entries of `R - I`. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn modes(position_m: DVec3, orientation: DQuat) -> [f64; MODES] {
        let rotation = DMat3::from_quat(orientation);
        let mut modes = [0.0; MODES];
        modes[..3].copy_from_slice(&position_m.to_array());
        for (j, column) in [rotation.x_axis, rotation.y_axis, rotation.z_axis].into_iter().enumerate() {
            for (i, value) in column.to_array().into_iter().enumerate() {
                modes[Self::entry(i, j)] = value - if i == j { 1.0 } else { 0.0 };
            }
        }
        modes
    }

    /// Returns the wrench on the hand, and the stored energy, J. If neither torque nor energy is requested, both are zero.
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn answer(&self, position_m: DVec3, orientation: DQuat, demand: Demand) -> (Wrench, f64) {
        let modes = Self::modes(position_m, orientation);
        let mut slope = [0.0; MODES];
        let is_force_alone = !(demand.contains(Demand::TORQUE) || demand.contains(Demand::ENERGY));
        // The force needs only three rows; torque and energy need all.
        let rows = if is_force_alone { 3 } else { MODES };
        let mut energy_j = 0.0;
        for ((target, row), mode) in slope.iter_mut().zip(&self.stiffness).zip(&modes).take(rows) {
            *target = row.iter().zip(&modes).map(|(k, v)| k * v).sum();
            energy_j += 0.5 * *target * mode;
        }
        let force_n = -DVec3::new(slope[0], slope[1], slope[2]);
        if is_force_alone {
            return (Wrench::from_force(force_n), 0.0);
        }
        let rotation = DMat3::from_quat(orientation);
        let columns = [rotation.x_axis, rotation.y_axis, rotation.z_axis];
        let mut torque_nm = DVec3::ZERO;
        for (j, column) in columns.into_iter().enumerate() {
            let moment =
                DVec3::new(slope[Self::entry(0, j)], slope[Self::entry(1, j)], slope[Self::entry(2, j)]);
            torque_nm -= column.cross(moment);
        }
        (Wrench::new(force_n, torque_nm), energy_j)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wrench_is_minus_the_slope_of_the_energy() {
        let mut stiffness = [[0.0; MODES]; MODES];
        for i in 0..MODES {
            for j in 0..MODES {
                stiffness[i][j] = ((3 * i * j + i + j) as f64).sin() + if i == j { 12.0 } else { 0.0 };
            }
        }
        let patch = RigidPatch { stiffness };
        let (position, turn) =
            (DVec3::new(0.3, -0.2, 0.5), DQuat::from_scaled_axis(DVec3::new(0.4, -0.7, 0.2)));
        let (wrench, _) = patch.answer(position, turn, Demand::ALL);
        let (alone, _) = patch.answer(position, turn, Demand::FORCE);
        assert_eq!(alone, Wrench::from_force(wrench.force()));
        let h = 1.0e-5;
        for axis in DVec3::AXES {
            let moved = |s: f64| patch.answer(position + axis * s, turn, Demand::ALL).1;
            let turned =
                |s: f64| patch.answer(position, DQuat::from_scaled_axis(axis * s) * turn, Demand::ALL).1;
            let (force, torque) = ((moved(h) - moved(-h)) / (2.0 * h), (turned(h) - turned(-h)) / (2.0 * h));
            // Central differences: h squared times third derivatives of order twelve.
            assert!((wrench.force().dot(axis) + force).abs() < 1.0e-8, "{axis}");
            assert!((wrench.torque().dot(axis) + torque).abs() < 1.0e-8, "{axis}");
        }
    }
}
