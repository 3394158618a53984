//! Vectors and poses between the contract and the solver, which has another version of glam.

use flotor_hal::{DQuat, DVec3};
use rapier3d_f64::math::{Pose, Rotation, Vector};

/// Returns a vector of the solver.
pub(crate) fn vector(from: DVec3) -> Vector {
    Vector::new(from.x, from.y, from.z)
}

/// Returns a vector of the contract.
pub(crate) fn dvec3(from: Vector) -> DVec3 {
    DVec3::new(from.x, from.y, from.z)
}

/// Returns a pose of the solver.
pub(crate) fn pose(from: &flotor_hal::Pose) -> Pose {
    let [x, y, z, w] = from.orientation_xyzw;
    Pose { rotation: Rotation::from_xyzw(x, y, z, w), translation: vector(from.position()) }
}

/// Returns a pose of the contract.
pub(crate) fn contract_pose(from: &Pose) -> flotor_hal::Pose {
    let turn = from.rotation;
    flotor_hal::Pose::new(dvec3(from.translation), DQuat::from_xyzw(turn.x, turn.y, turn.z, turn.w))
}
