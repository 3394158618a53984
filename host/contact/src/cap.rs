//! Compliance between handle and tool that limits the stiffness of a contact set to that of the coupling.

use crate::Coupling;
use crate::linear::{self, ROWS, Symmetric6, Vector6};
use flotor_hal::DVec3;

/// Spring between the tool and a surface.
pub(crate) struct Spring {
    pub(crate) arm_m: DVec3,
    pub(crate) direction: DVec3,
    pub(crate) stiffness_n_per_m: f64,
}

/// Coordinates of the offset: the offset is the sum of the columns, each times its coordinate, and its energy half the sum of
/// the squared coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OffsetSpace {
    columns: [Vector6; ROWS],
    excess: f64,
}

impl OffsetSpace {
    /// The handle and the tool coincide.
    pub(crate) const RIGID: Self = Self { columns: linear::ZERO, excess: 1.0 };

    /// Returns the offset space of a set of springs behind the coupling. Real-time: bounded, no allocation.
    ///
    /// With their stiffness `N` in units of the coupling's, `N = V diag(s) V^T`, the compliance `V diag(max(0, 1 - 1/s)) V^T`
    /// in series makes it `V diag(min(s, 1)) V^T`.
    pub(crate) fn new(coupling: &Coupling, springs: impl Iterator<Item = Spring>) -> Self {
        let [linear, angular] = coupling.root_compliances();
        let mut stiffness = linear::ZERO;
        for Spring { arm_m, direction, stiffness_n_per_m } in springs {
            let row = generalized(direction * linear, arm_m.cross(direction) * angular);
            linear::add_square(&mut stiffness, &row, stiffness_n_per_m);
        }
        Self::with_stiffness(&stiffness, [linear, angular])
    }

    fn with_stiffness(stiffness: &Symmetric6, [linear, angular]: [f64; 2]) -> Self {
        let trace: f64 = stiffness.iter().enumerate().filter_map(|(row, values)| values.get(row)).sum();
        if trace <= 1.0 {
            return Self::RIGID; // no eigenvalue is above the trace
        }
        let mut space = Self::RIGID;
        let (values, vectors) = linear::eigen(stiffness);
        for ((column, value), vector) in space.columns.iter_mut().zip(values).zip(vectors) {
            if value > 1.0 {
                let [x, y, z, rx, ry, rz] = vector;
                let length = (1.0 - 1.0 / value).sqrt();
                let [linear, angular] = [linear * length, angular * length];
                *column = generalized(DVec3::new(x, y, z) * linear, DVec3::new(rx, ry, rz) * angular);
                space.excess = space.excess.max(value);
            }
        }
        space
    }

    /// Returns true if no offset is needed: the set is not stiffer than the coupling in any direction.
    pub(crate) fn is_rigid(&self) -> bool {
        self.excess <= 1.0
    }

    /// Returns the largest ratio of the set's stiffness to the coupling's, at least 1.
    pub(crate) fn excess(&self) -> f64 {
        self.excess
    }

    /// Returns the generalised force on each coordinate, which equals the coordinate of the resulting offset.
    pub(crate) fn coordinates(&self, force: DVec3, torque: DVec3) -> Vector6 {
        let generalized = generalized(force, torque);
        self.columns.each_ref().map(|column| linear::dot(column, &generalized))
    }
}

fn generalized(linear: DVec3, angular: DVec3) -> Vector6 {
    let ([x, y, z], [rx, ry, rz]) = (linear.to_array(), angular.to_array());
    [x, y, z, rx, ry, rz]
}
