//! Positions of the rod's sections: integration of their directions to a curve in space.
//!
//! The directions are the polynomials of the shape; the rest of each section follows from quantities common to all
//! sections (lengths in `L0`): `psi' = Phi + w (p x p')`, the twist evenly distributed beside the winding, and
//! `r' = d + n/beta + delta (n.d) d`, stretched and sheared by the force, and held apart where coils touch.

use flotor_hal::glam::{DQuat, DVec2, DVec3};

use super::functional::{Functional, Ratios, Shape};
use super::plate::Plate;
use super::section::{Load, Sections};
use crate::centerline::Section;
use flotor_lanes::basis::{bubbles, gauss_legendre};

/// Minimum number of panels over the whole rod, and nodes in each: together far more degrees than the polynomials have.
const LEAST_PANELS: usize = 64;
const NODES: usize = 4;

/// Shape of a rod, with the quantities common to all sections.
pub(crate) struct Curve<const K: usize> {
    lean: [[f64; K]; 2],
    end: DVec2,
    /// Internal force.
    force: DVec3,
    ratios: Ratios,
    /// Evenly distributed twist (rad).
    twist_rad: f64,
}

/// Direction of a section, with tangent and turn rate of the curve.
struct Step {
    lean: DVec2,
    tangent: DVec3,
    turn_rate_rad: f64,
}

impl<const K: usize> Curve<K> {
    pub(crate) fn new<const N: usize, const Q: usize>(
        functional: &Functional<K, N, Q>,
        shape: &Shape<N>,
        plate: &Plate,
    ) -> Self {
        let load = functional.value(shape, plate).load;
        let mut lean = [[0.0; K]; 2];
        for (coefficient, value) in lean.as_flattened_mut().iter_mut().zip(shape) {
            *coefficient = *value;
        }
        let ratios = functional.ratios;
        let twist_rad = load.torsion / ratios.torsion;
        Self { lean, end: plate.lean, force: load.force, ratios, twist_rad }
    }

    /// Computes sections evenly in arc length, the first in the lower plate, the last in the upper. Not real-time.
    pub(crate) fn draw(&self, free_length_m: f64, sections: &mut [Section]) {
        let gaps = sections.len().saturating_sub(1).max(1);
        let panels = LEAST_PANELS.div_ceil(gaps);
        let width = 1.0 / (gaps * panels) as f64;
        let (mut center, mut turn_rad) = (DVec3::new(0.0, 0.0, -1.0), 0.0);
        for (index, section) in sections.iter_mut().enumerate() {
            let lean = self.step(index as f64 / gaps as f64).lean;
            let shortest = DQuat::from_xyzw(-lean.y, lean.x, 0.0, 1.0).normalize();
            *section = Section {
                center_m: center * free_length_m,
                orientation: shortest * DQuat::from_rotation_z(turn_rad),
            };
            // Center and turn by Gauss-Legendre quadrature of the tangent and the rate of turn.
            for panel in 0..panels {
                let start = (index * panels + panel) as f64 * width;
                for node in 0..NODES {
                    let (t, weight) = gauss_legendre(NODES, node);
                    let step = self.step(start + 0.5 * (1.0 + t) * width);
                    center += 0.5 * weight * width * step.tangent;
                    turn_rad += 0.5 * weight * width * step.turn_rate_rad;
                }
            }
        }
    }

    /// Returns direction and rates at scaled arc length `s`.
    fn step(&self, s: f64) -> Step {
        let (bubble, slope) = bubbles::<K>(2.0 * s - 1.0);
        let along = |field: &[f64; K], c: usize| -> f64 {
            field.iter().zip(&self.lean[c]).map(|(value, coefficient)| value * coefficient).sum()
        };
        // `p` is linear in `s` plus the bubbles of the basis.
        let lean = self.end * s + DVec2::new(along(&bubble, 0), along(&bubble, 1));
        let rate = self.end + DVec2::new(along(&slope, 0), along(&slope, 1));
        let section = Sections::<1>::new([[lean.x], [lean.y]], [[rate.x], [rate.y]]);
        let scale = 2.0 / (1.0 + lean.length_squared());
        let normal = (scale * lean).extend(scale - 1.0);
        let Ratios { softening, shear_compliance, contact, .. } = self.ratios;
        let load = Load { force: self.force, torsion: 0.0, softening };
        let pressed = contact.map_or(0.0, |contact| section.pressed(&contact, &load, 0));
        let stretch = 1.0 + softening * self.force.dot(normal) + pressed;
        Step {
            lean,
            tangent: stretch * normal + shear_compliance * self.force,
            turn_rate_rad: self.twist_rad + scale * lean.perp_dot(rate),
        }
    }
}
