//! Smooth centreline through the few sections reported by a model.

use flotor_hal::{DQuat, DVec3, Pose};

/// Cross-section of a slender body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Centre, m.
    pub center_m: DVec3,
    /// Orientation; the rotated z axis is the normal of the section.
    pub orientation: DQuat,
}

/// Position and quaternion, interpolated component by component.
type Components = [f64; 7];

/// Smooth curve with a frame along it, through reported sections at even arc lengths at rest.
///
/// Cubic Hermite pieces whose slopes are differences of fourth order (third at the ends): between 65 sections of a
/// spring bent by its own length the error is below a thousandth of the wire's diameter (tested).
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    values: Vec<Components>,
    slopes: Vec<Components>,
}

impl Curve {
    /// Interpolates reported sections, from the fixed end to the handle; `None` for fewer than four sections or a non-finite section.
    #[must_use]
    pub fn through(sections: &[Pose]) -> Option<Self> {
        if sections.len() < 4 || !sections.iter().all(Pose::is_finite) {
            return None;
        }
        let mut values: Vec<Components> = sections.iter().map(components).collect();
        // q and -q are the same rotation: neighbours need the same sign to be interpolated.
        for i in 1..values.len() {
            let side: f64 = (3..7).map(|k| values[i - 1][k] * values[i][k]).sum();
            if side < 0.0 {
                values[i][3..].iter_mut().for_each(|component| *component = -*component);
            }
        }
        let slopes = (0..values.len()).map(|i| slope(&values, i)).collect();
        Some(Self { values, slopes })
    }

    /// Returns the number of reported sections.
    #[must_use]
    pub fn sections(&self) -> usize {
        self.values.len()
    }

    /// Returns the section at the fraction `s` of the length at rest, 0 at the fixed end, 1 at the handle.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few pieces
    pub fn section(&self, s: f64) -> Section {
        let pieces = self.values.len() - 1;
        let place = s.clamp(0.0, 1.0) * pieces as f64;
        let i = (place as usize).min(pieces - 1);
        let u = place - i as f64;
        let (square, cube) = (u * u, u * u * u);
        let weights = [
            2.0 * cube - 3.0 * square + 1.0,
            cube - 2.0 * square + u,
            3.0 * square - 2.0 * cube,
            cube - square,
        ];
        let [a, da, b, db] = [&self.values[i], &self.slopes[i], &self.values[i + 1], &self.slopes[i + 1]];
        let value: Components = std::array::from_fn(|k| {
            weights[0] * a[k] + weights[1] * da[k] + weights[2] * b[k] + weights[3] * db[k]
        });
        Section {
            center_m: DVec3::new(value[0], value[1], value[2]),
            orientation: DQuat::from_xyzw(value[3], value[4], value[5], value[6]).normalize(),
        }
    }
}

fn components(pose: &Pose) -> Components {
    let ([x, y, z], [qx, qy, qz, qw]) = (pose.position_m, pose.orientation_xyzw);
    [x, y, z, qx, qy, qz, qw]
}

/// Returns the derivative per piece at section `i`.
fn slope(values: &[Components], i: usize) -> Components {
    let last = values.len() - 1;
    let at = |stencil: &[(usize, f64)]| -> Components {
        std::array::from_fn(|k| stencil.iter().map(|(j, weight)| weight * values[*j][k]).sum())
    };
    const END: [f64; 4] = [-11.0 / 6.0, 3.0, -1.5, 1.0 / 3.0];
    const NEXT: [f64; 4] = [-1.0 / 3.0, -0.5, 1.0, -1.0 / 6.0];
    match (i, last - i) {
        (0, _) => at(&[(0, END[0]), (1, END[1]), (2, END[2]), (3, END[3])]),
        (_, 0) => at(&[(last, -END[0]), (last - 1, -END[1]), (last - 2, -END[2]), (last - 3, -END[3])]),
        (1, _) => at(&[(0, NEXT[0]), (1, NEXT[1]), (2, NEXT[2]), (3, NEXT[3])]),
        (_, 1) => at(&[(last, -NEXT[0]), (last - 1, -NEXT[1]), (last - 2, -NEXT[2]), (last - 3, -NEXT[3])]),
        _ => at(&[(i + 1, 2.0 / 3.0), (i - 1, -2.0 / 3.0), (i + 2, -1.0 / 12.0), (i - 2, 1.0 / 12.0)]),
    }
}
