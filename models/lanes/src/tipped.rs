//! Minimum of an energy with a kink at zero, the tip: `s.H s/2 - b.s + c |s|` in the plane, and the curvature `H` as observed.

use flotor_hal::glam::{DMat2, DVec2};

/// Newton steps on the secular equation; it is nearly straight, three give all digits.
const SECULAR_STEPS: u32 = 8;
/// Smallest deviation of the slope from its prediction that corrects the curvature, in units of the error that the law's
/// solver tolerates. A smaller deviation is noise, and its quotient by a short step may be any number.
const LEAST_DEVIATION: f64 = 3.0;
/// Smallest curvature assumed (N·m/rad): a smaller one would make the steps too large.
const LEAST_CURVATURE: f64 = 1e-3;

/// Quadratic model of the energy by the tilt, without its tip.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Quadratic {
    /// Observed curvature (N·m/rad).
    curvature: DMat2,
    /// Stiffness at rest (N·m/rad).
    pub stiffness_nm_per_rad: f64,
}

flotor_hal::restorable!(Quadratic { curvature } without { stiffness_nm_per_rad });

impl Quadratic {
    /// Returns the model of a spring at rest. Real-time: bounded, no allocation.
    pub fn at_rest(stiffness_nm_per_rad: f64) -> Self {
        Self { curvature: DMat2::from_diagonal(DVec2::splat(stiffness_nm_per_rad)), stiffness_nm_per_rad }
    }

    /// Returns the tilt of least energy (rad), from the slope at a tilt (N·m) and the cost of lifting (N·m). Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn least(&self, tilt_rad: DVec2, slope: DVec2, tip_nm: f64, largest_rad: f64) -> DVec2 {
        tipped_minimum(self.curvature, self.curvature * tilt_rad - slope, tip_nm, largest_rad)
    }

    /// Applies a symmetric rank-one correction to the curvature (Nocedal and Wright, *Numerical Optimization*, 6.2).
    /// Real-time: bounded, no allocation.
    pub fn observe(&mut self, step: DVec2, change: DVec2, noise_rad: f64) {
        let deviation = change - self.curvature * step;
        if deviation.length() < LEAST_DEVIATION * noise_rad * self.stiffness_nm_per_rad {
            return;
        }
        let along = deviation.dot(step);
        if along.abs() > 1e-8 * deviation.length() * step.length() {
            let update = DMat2::from_cols(deviation * deviation.x, deviation * deviation.y);
            self.curvature += update * (1.0 / along);
        }
    }
}

/// Returns the minimum of `s.H s/2 - b.s + c |s|`: zero while `|b| <= c`, else `s = t (t H + c)⁻¹ b` with its own
/// length `t`.
fn tipped_minimum(curvature: DMat2, pull: DVec2, tip: f64, largest: f64) -> DVec2 {
    if pull.length() <= tip {
        return DVec2::ZERO;
    }
    let mut length = 0.0;
    let mut direction = pull / pull.length();
    for _ in 0..SECULAR_STEPS {
        // One Newton step on 1 - 1 / |(t H + c)⁻¹ b| = 0 for the length `t`.
        let matrix = curvature * length + DMat2::from_diagonal(DVec2::splat(tip));
        let inverse = matrix.inverse();
        let scaled = inverse * pull;
        let size = scaled.length();
        let falling = scaled.dot(inverse * (curvature * scaled)) / (size * size * size);
        let least = LEAST_CURVATURE / tip.max(f64::MIN_POSITIVE);
        direction = scaled / size;
        length = (length + (1.0 - 1.0 / size) / falling.max(least)).clamp(0.0, largest);
    }
    let tilt = length * direction;
    if tilt.is_finite() { tilt } else { DVec2::ZERO }
}
