//! Orientation as three angles: about x, then y, then z, each about the fixed axis: `R = Rz(rz) Ry(ry) Rx(rx)`.

use flotor_hal::{DQuat, DVec3, math};

/// Converts three angles about x, y and z, rad, to an orientation.
#[must_use]
pub fn orientation(angles_rad: DVec3) -> DQuat {
    let about = |axis: DVec3, angle: f64| {
        let (sin, cos) = math::sin_cos(0.5 * angle);
        DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
    };
    about(DVec3::Z, angles_rad.z) * about(DVec3::Y, angles_rad.y) * about(DVec3::X, angles_rad.x)
}

/// Converts an orientation to three angles about x, y and z, rad; the angle about y is from -π/2 to π/2.
#[must_use]
pub fn angles(orientation: DQuat) -> DVec3 {
    let DQuat { x, y, z, w } = orientation;
    // Entries of the rotation matrix: first column, and the last row.
    let (r11, r21, r31) = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y));
    let (r32, r33) = (2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y));
    DVec3::new(math::atan2(r32, r33), math::asin((-r31).clamp(-1.0, 1.0)), math::atan2(r21, r11))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_orientation_are_inverses() {
        for angles_rad in [DVec3::ZERO, DVec3::new(0.1, -0.05, 0.12), DVec3::new(-1.2, 0.9, 2.8)] {
            // The rounding of a few products and an arc tangent.
            assert!((angles(orientation(angles_rad)) - angles_rad).length() < 1.0e-14, "{angles_rad}");
        }
    }

    #[test]
    fn the_first_turn_is_about_x_and_the_last_about_z() {
        let quarter = std::f64::consts::FRAC_PI_2;
        // y goes to z by the turn about x, and stays there in the turn about z.
        let turned = orientation(DVec3::new(quarter, 0.0, quarter)) * DVec3::Y;
        assert!((turned - DVec3::Z).length() < 1.0e-15, "{turned}");
    }
}
