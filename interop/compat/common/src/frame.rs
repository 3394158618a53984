//! Coordinate frames of other makers' interfaces, and of Flotor (x right, y away from the user, z up). All are right-handed, with
//! the origin at the centre of the range.

use flotor_hal::{DMat3, DQuat, DVec3};

/// Coordinate frame of a maker's interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// x towards the user, y right, z up: DHD, DRD, hdPhantom, CHAI3D.
    TowardsRightUp,
    /// x right, y up, z towards the user: HD.
    RightUpTowards,
}

impl Frame {
    /// Converts a vector from Flotor's frame to this one.
    #[must_use]
    pub fn of_flotor(self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        match self {
            Self::TowardsRightUp => DVec3::new(-y, x, z),
            Self::RightUpTowards => DVec3::new(x, z, -y),
        }
    }

    /// Converts a vector from this frame to Flotor's.
    #[must_use]
    pub fn to_flotor(self, DVec3 { x, y, z }: DVec3) -> DVec3 {
        match self {
            Self::TowardsRightUp => DVec3::new(y, -x, z),
            Self::RightUpTowards => DVec3::new(x, -z, y),
        }
    }

    /// Returns the rotation matrix in this frame, row-major, of an orientation in Flotor's frame.
    #[must_use]
    pub fn rotation(self, orientation: DQuat) -> [[f64; 3]; 3] {
        let turned = DMat3::from_quat(orientation);
        // Column j is the image of axis j of this frame.
        let columns =
            [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| self.of_flotor(turned * self.to_flotor(axis)));
        std::array::from_fn(|row| columns.map(|column| column[row]))
    }
}

/// Returns the length of a vector, without overflow of its square.
#[must_use]
pub fn length(vector: DVec3) -> f64 {
    let largest = vector.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (vector / largest).length() * largest } else { largest }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAMES: [Frame; 2] = [Frame::TowardsRightUp, Frame::RightUpTowards];

    #[test]
    fn the_axes_are_those_of_the_interfaces() {
        let (right, away, up) = (DVec3::X, DVec3::Y, DVec3::Z);
        assert_eq!(
            [-away, right, up].map(|axis| Frame::TowardsRightUp.of_flotor(axis)),
            [DVec3::X, DVec3::Y, DVec3::Z]
        );
        assert_eq!(
            [right, up, -away].map(|axis| Frame::RightUpTowards.of_flotor(axis)),
            [DVec3::X, DVec3::Y, DVec3::Z]
        );
        // hd = (dhd.y, dhd.z, dhd.x).
        let at = DVec3::new(1.0, 2.0, 3.0);
        let (dhd, hd) = (Frame::TowardsRightUp.of_flotor(at), Frame::RightUpTowards.of_flotor(at));
        assert_eq!(hd, DVec3::new(dhd.y, dhd.z, dhd.x));
    }

    #[test]
    fn vectors_come_back_and_rotations_turn_them() {
        let turn = DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(-0.8);
        for frame in FRAMES {
            let vector = DVec3::new(0.2, -0.5, 0.7);
            assert_eq!(frame.to_flotor(frame.of_flotor(vector)), vector);
            let rows = frame.rotation(turn).map(DVec3::from_array);
            let turned = DVec3::from_array(rows.map(|row| row.dot(vector)));
            let expected = frame.of_flotor(turn * frame.to_flotor(vector));
            assert!((turned - expected).length() < 1.0e-15, "{frame:?}");
            // Right-handed: rows of a rotation.
            assert!((rows[0].cross(rows[1]) - rows[2]).length() < 1.0e-15, "{frame:?}");
        }
    }
}
