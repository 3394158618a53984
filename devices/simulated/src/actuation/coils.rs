//! The six coils: placement, wrench of a set of currents, currents for a wrench.
//!
//! The published descriptions give force limits per axis but no coil positions. This geometry is synthetic and meets
//! these limits (55 to 140 N, 6.3 to 12.2 N·m): on a hemisphere of 115 mm radius, ring A holds three coils 65 degrees
//! from the bottom pole with forces along the meridian, ring B three coils at 45 degrees with forces along the
//! parallel; the coils of a ring are 120 degrees apart. A current of 3.5 A gives 51.5 N. The coils move by a tenth of
//! the radius at most, so their directions at home are used throughout.

use crate::linear::{Matrix6, Vector6, inverse, product};
use crate::plant::Wrench;
use crate::validation::{Domain, InvalidParameter, number};
use flotor_hal::glam::DVec3;
use flotor_hal::math;
use std::f64::consts::PI;

/// Number of coils.
pub const COILS: usize = 6;

/// Currents of all coils, A; ring A first.
pub type Currents = [f64; COILS];

/// Current limit of a coil, A (public interface of the device: ±3.5 A).
pub const CURRENT_LIMIT_A: f64 = 3.5;

/// Geometry of the coils, and the force of one coil at the current limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CoilGeometry {
    /// Radius of the hemisphere, m.
    pub radius_m: f64,
    /// Angle of ring A from the bottom pole, rad.
    pub meridian_ring_rad: f64,
    /// Angle of ring B from the bottom pole, rad.
    pub parallel_ring_rad: f64,
    /// Force of a coil at [`CURRENT_LIMIT_A`], N.
    pub coil_force_n: f64,
}

impl CoilGeometry {
    /// Synthetic geometry described in the module documentation.
    pub const MAGLEV: Self = Self {
        radius_m: 0.115,
        meridian_ring_rad: 65.0 * PI / 180.0,
        parallel_ring_rad: 45.0 * PI / 180.0,
        coil_force_n: 51.5,
    };

    /// Returns position from the origin of the flotor frame (m) and force direction of each coil.
    fn places(&self) -> [(DVec3, DVec3); COILS] {
        let place = |index: usize| {
            let azimuth = (index % 3) as f64 * (2.0 * PI / 3.0);
            let (sin_azimuth, cos_azimuth) = math::sin_cos(azimuth);
            let along_meridian = index < 3;
            let angle = if along_meridian { self.meridian_ring_rad } else { self.parallel_ring_rad };
            let (sin, cos) = math::sin_cos(angle);
            let position = self.radius_m * DVec3::new(sin * cos_azimuth, sin * sin_azimuth, -cos);
            let direction = if along_meridian {
                DVec3::new(cos * cos_azimuth, cos * sin_azimuth, sin)
            } else {
                DVec3::new(-sin_azimuth, cos_azimuth, 0.0)
            };
            (position, direction)
        };
        [0, 1, 2, 3, 4, 5].map(place)
    }
}

/// Coil model: matrices from currents to the wrench about the origin of the flotor frame, and back.
#[derive(Clone, Copy, Debug)]
pub struct Coils {
    /// Wrench per current, N/A and N·m/A: one column per coil.
    wrench_of: Matrix6,
    /// Current per wrench, A/N and A/(N·m): one row per coil.
    currents_of: Matrix6,
}

impl Coils {
    /// Computes the matrices between currents and wrenches. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// If a number is not physical, or the wrenches of the six coils are linearly dependent, so that some forces or torques cannot
    /// be produced.
    pub fn new(geometry: &CoilGeometry) -> Result<Self, InvalidParameter> {
        number("coil_radius_mm", geometry.radius_m, Domain::Positive)?;
        number("coil_force_n", geometry.coil_force_n, Domain::Positive)?;
        number("coil_ring_a_deg", geometry.meridian_ring_rad, Domain::Finite)?;
        number("coil_ring_b_deg", geometry.parallel_ring_rad, Domain::Finite)?;
        let force_n_per_a = geometry.coil_force_n / CURRENT_LIMIT_A;
        let mut wrench_of = [[0.0; COILS]; 6];
        // Torques over the radius are forces: rows of equal magnitude, so that only dependence causes a small pivot.
        let mut scaled = wrench_of;
        for (coil, (position, direction)) in geometry.places().into_iter().enumerate() {
            let force = direction * force_n_per_a;
            let torque = position.cross(force);
            let column = [force.x, force.y, force.z, torque.x, torque.y, torque.z];
            for (row, entry) in column.into_iter().enumerate() {
                wrench_of[row][coil] = entry;
                scaled[row][coil] = if row < 3 { entry } else { entry / geometry.radius_m };
            }
        }
        let mut currents_of = inverse(&scaled).ok_or(InvalidParameter::DependentCoils)?;
        for row in &mut currents_of {
            row.iter_mut().skip(3).for_each(|entry| *entry /= geometry.radius_m);
        }
        Ok(Self { wrench_of, currents_of })
    }

    /// Returns the currents for a wrench, A, and the factor by which all are scaled down to [`CURRENT_LIMIT_A`] (1
    /// within the limit). Real-time: bounded, no allocation.
    #[must_use]
    pub fn currents(&self, wrench: &Wrench) -> (Currents, f64) {
        let asked_a = product(&self.currents_of, &six(wrench));
        let largest_a = asked_a.iter().fold(0.0_f64, |largest, current| largest.max(current.abs()));
        if largest_a <= CURRENT_LIMIT_A {
            (asked_a, 1.0)
        } else {
            let share = CURRENT_LIMIT_A / largest_a;
            (asked_a.map(|current| current * share), share)
        }
    }

    /// Returns the wrench of a set of currents (A) in an even field. Real-time: bounded, no allocation.
    #[must_use]
    pub fn wrench(&self, currents_a: &Currents) -> Wrench {
        let [fx, fy, fz, tx, ty, tz] = product(&self.wrench_of, currents_a);
        Wrench { force_n: DVec3::new(fx, fy, fz), torque_nm: DVec3::new(tx, ty, tz) }
    }

    /// Returns the largest force along each axis, N, and torque about each axis, N·m, with all other components zero.
    /// Real-time: bounded, no allocation.
    #[must_use]
    pub fn pure_axis_limits(&self) -> Wrench {
        let limit = |axis: usize| {
            let largest = self.currents_of.iter().fold(0.0_f64, |largest, row| largest.max(row[axis].abs()));
            CURRENT_LIMIT_A / largest
        };
        Wrench {
            force_n: DVec3::new(limit(0), limit(1), limit(2)),
            torque_nm: DVec3::new(limit(3), limit(4), limit(5)),
        }
    }
}

fn six(wrench: &Wrench) -> Vector6 {
    let Wrench { force_n: f, torque_nm: t } = wrench;
    [f.x, f.y, f.z, t.x, t.y, t.z]
}
