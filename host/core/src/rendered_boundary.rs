//! Boundary wall as a loop renders it on a device: at most as stiff as is stable, and far enough inside the range.

use crate::limits::{Bound, Boundary};
use flotor_hal::{Capabilities, Damper, SampledLoop};
use std::fmt::{self, Display, Formatter};

/// Design load of the wall inside the range of a device, N, limited by device and scene.
pub const DESIGN_FORCE_N: f64 = 5.0;

/// Ratio of the depth under a suddenly applied force to the depth under the same force at rest.
const SWING: f64 = 2.0;

/// Smallest fraction of the range that is free of the wall.
const LEAST_SHARE_OF_RANGE: f64 = 0.5;

/// Boundary wall of one device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderedBoundary {
    /// Distances from the origin at which the wall begins along each axis, m; infinite along an axis without a range.
    pub begins_m: [f64; 3],
    /// Rotations at which the wall begins about each axis, rad; infinite about an axis without a range.
    pub begins_rad: [f64; 3],
    /// Stiffness, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping of outward motion, N·s/m.
    pub damping_ns_per_m: f64,
    /// Rotational stiffness, N·m/rad.
    pub stiffness_nm_per_rad: f64,
    /// Damping of outward rotation, N·m·s/rad.
    pub damping_nms_per_rad: f64,
    /// Static force that the wall withstands inside the range, N: [`DESIGN_FORCE_N`] or the limit of force, less if
    /// half of the range is too short. A suddenly applied force is withstood too, if the limit of force is twice as
    /// large.
    pub holds_n: f64,
    /// Force that the wall should withstand, N.
    wanted_n: f64,
    /// Stiffness requested by the scene, N/m and N·m/rad; the second is 0 on a device without torque.
    requested: [f64; 2],
    /// Latency of the device, s.
    latency_s: f64,
    period_s: f64,
}

impl RenderedBoundary {
    /// Computes the wall on a device whose force is limited to `most_n`. Not real-time.
    ///
    /// The damping of the device is not known and counts as zero. A wall without a damper has the scene's stiffness, limited to the
    /// stiffness that the device declares.
    #[must_use]
    pub fn new(boundary: &Boundary, device: &Capabilities, most_n: &Bound, period_ns: u64) -> Self {
        let sampled = SampledLoop { period_s: period_ns as f64 * 1.0e-9, latency_s: device.latency_s };
        let stable = |damping: f64| {
            let most = sampled.largest_stiffness(0.0, Damper::OneWay(damping));
            if damping > 0.0 { most } else { f64::INFINITY }
        };
        let declared = device.max_stiffness_n_per_m;
        let declared = if declared > 0.0 { declared } else { f64::INFINITY };
        let Boundary { damping_ns_per_m, damping_nms_per_rad, .. } = *boundary;
        let stiffness_n_per_m = boundary.stiffness_n_per_m.min(stable(damping_ns_per_m)).min(declared);
        let wanted_n =
            most_n.and(Bound::box_of(device.max_force_n)).axes().map(|most| most.min(DESIGN_FORCE_N));
        let [x, y, z] = [0, 1, 2].map(|axis: usize| {
            Room::new(device.range_m[axis], boundary.margin_m, wanted_n[axis], stiffness_n_per_m)
        });
        let turns = device.max_torque_nm.iter().any(|most| *most > 0.0);
        let wanted_n = wanted_n.into_iter().fold(0.0, f64::max);
        let taken_share = x.taken_share.min(y.taken_share).min(z.taken_share);
        Self {
            begins_m: [x.begins_m, y.begins_m, z.begins_m],
            begins_rad: device.range_rad.map(|range| begins(range, boundary.margin_rad)),
            stiffness_n_per_m,
            damping_ns_per_m,
            stiffness_nm_per_rad: boundary.stiffness_nm_per_rad.min(stable(damping_nms_per_rad)),
            damping_nms_per_rad,
            holds_n: wanted_n * taken_share,
            wanted_n,
            requested: [boundary.stiffness_n_per_m, if turns { boundary.stiffness_nm_per_rad } else { 0.0 }],
            latency_s: device.latency_s,
            period_s: sampled.period_s,
        }
    }

    /// Returns a sentence for users if the wall differs from the scene's wall, or withstands less force than it should;
    /// `None` otherwise. Not real-time.
    #[must_use]
    pub fn notice(&self) -> Option<String> {
        let [stiffness, rotational] = self.requested;
        let mut parts = Vec::new();
        if self.stiffness_n_per_m < stiffness {
            parts.push(format!("has {:.0} N/m instead of {stiffness:.0}", self.stiffness_n_per_m));
        }
        if self.stiffness_nm_per_rad < rotational {
            parts.push(format!("has {:.1} N·m/rad instead of {rotational:.1}", self.stiffness_nm_per_rad));
        }
        if self.damping_ns_per_m <= 0.0 && self.stiffness_n_per_m > 0.0 {
            parts.push("has no damper, so only the damping of the device can keep it stable".to_owned());
        }
        // Rounding of a quotient is not a shortfall.
        if self.holds_n < self.wanted_n * (1.0 - 1.0e-9) {
            parts.push(format!(
                "withstands {:.1} N instead of {:.1} N, because it begins at half of the range",
                self.holds_n, self.wanted_n
            ));
        }
        (!parts.is_empty()).then(|| format!("the boundary wall {}; {self}", parts.join(" and ")))
    }
}

/// Prints the stable stiffness of the wall, its beginning and the force that it withstands.
impl Display for RenderedBoundary {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { period_s, latency_s, stiffness_n_per_m, damping_ns_per_m, holds_n, .. } = *self;
        let begins_mm = self.begins_m.into_iter().fold(f64::INFINITY, f64::min) * 1.0e3;
        write!(
            f,
            "at {:.0} Hz and {:.1} ms of latency it {} {stiffness_n_per_m:.0} N/m",
            1.0 / period_s,
            latency_s * 1.0e3,
            if damping_ns_per_m > 0.0 { "is stable with" } else { "has" }
        )?;
        if begins_mm.is_finite() {
            write!(f, ", begins {begins_mm:.1} mm from home and withstands {holds_n:.1} N")?;
        }
        Ok(())
    }
}

/// Wall along one axis.
struct Room {
    begins_m: f64,
    /// Force that the wall withstands, as a fraction of the wanted force; at most 1.
    taken_share: f64,
}

impl Room {
    fn new(range_m: f64, margin_m: f64, wanted_n: f64, stiffness_n_per_m: f64) -> Self {
        let needed_m = SWING * wanted_n / stiffness_n_per_m;
        let is_needed = range_m > 0.0 && wanted_n > 0.0;
        let begins_m = begins(range_m, if is_needed { margin_m.max(needed_m) } else { margin_m });
        let taken_share = if is_needed { ((range_m - begins_m) / needed_m).min(1.0) } else { 1.0 };
        Self { begins_m, taken_share }
    }
}

/// Returns the distance from home at which a wall with this margin begins; infinity without a range.
fn begins(range: f64, margin: f64) -> f64 {
    if range > 0.0 { (range - margin).max(range * LEAST_SHARE_OF_RANGE) } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::Axes;

    const FLOTOR: Capabilities = Capabilities {
        sensed: Axes::ALL,
        actuated: Axes::ALL,
        range_m: [0.012; 3],
        range_rad: [0.12; 3],
        max_force_n: [55.0, 55.0, 140.0],
        max_torque_nm: [6.0; 3],
        ..Capabilities::UNDRIVEN
    };

    fn rendered(boundary: &Boundary, latency_s: f64, most_n: Bound, period_ns: u64) -> RenderedBoundary {
        RenderedBoundary::new(boundary, &Capabilities { latency_s, ..FLOTOR }, &most_n, period_ns)
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1.0e-9 * expected.abs(), "{found} is not {expected}");
    }

    #[test]
    fn a_weight_of_five_newtons_swings_to_the_edge_of_the_range() {
        let wall = rendered(&Boundary::default(), 1.0e-3, Bound::NONE, 1_000_000);
        near(wall.stiffness_n_per_m, 2500.0);
        near(wall.begins_m[0], 0.008);
        near(wall.holds_n, 5.0);
        let told = wall.notice().expect("7.5 kN/m are not stable");
        assert!(told.contains("2500 N/m instead of 7500") && told.contains("8.0 mm from home"), "{told}");
    }

    #[test]
    fn a_margin_of_the_scene_is_a_least_one() {
        let boundary = Boundary { margin_m: 5.0e-3, ..Boundary::default() };
        near(rendered(&boundary, 1.0e-3, Bound::NONE, 1_000_000).begins_m[1], 0.007);
    }

    #[test]
    fn half_of_the_range_that_is_too_short_is_reported_with_the_force() {
        let wall = rendered(&Boundary::default(), 3.0e-3, Bound::NONE, 1_000_000);
        near(wall.begins_m[2], 0.006);
        near(wall.holds_n, 7500.0 / 7.0 * 0.006 / 2.0);
        let told = wall.notice().expect("3.2 of 5 N");
        assert!(told.contains("withstands 3.2 N instead of 5.0 N"), "{told}");
    }

    #[test]
    fn a_limit_of_force_below_five_newtons_is_what_it_takes() {
        let wall = rendered(&Boundary::default(), 3.0e-3, Bound::ball(2.0), 1_000_000);
        near(wall.holds_n, 2.0);
        let told = wall.notice().expect("stiffness");
        assert!(!told.contains("instead of 2.0 N"), "{told}");
    }

    #[test]
    fn a_wall_as_the_scene_says_is_not_reported() {
        assert_eq!(rendered(&Boundary::default(), 0.0, Bound::NONE, 1_000_000).notice(), None);
        let undamped = Boundary { damping_ns_per_m: 0.0, ..Boundary::default() };
        let told = rendered(&undamped, 0.0, Bound::NONE, 1_000_000).notice().expect("no damper");
        assert!(told.contains("no damper"), "{told}");
    }
}
