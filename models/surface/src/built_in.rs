//! Built-in objects, computed from formulas; the top of each is 2 mm below home.

use crate::soup::Soup;
use flotor_hal::{DVec3, math};
use std::f64::consts::{PI, TAU};

/// Distance of the top of a built-in object below home, m.
const BELOW_M: f64 = 2.0e-3;
/// Number of cells about the axis and along the axis.
const CELLS: [u32; 2] = [128, 64];

/// Returns the triangles of a built-in object in metres; `None` for an unknown name.
pub(crate) fn soup(name: &str) -> Option<Soup> {
    match name {
        "bumpy-sphere" => Some(globe(CELLS[1], CELLS[0], bumpy_radius_m)),
        "torus" => Some(torus()),
        _ => None,
    }
}

/// Returns the radius of the bumpy sphere in a direction, m: 20 mm with bumps of 0.4 mm.
fn bumpy_radius_m(d: DVec3) -> f64 {
    0.02 + 4.0e-4 * math::sin(6.0 * d.x) * math::sin(6.0 * d.y) * math::sin(6.0 * d.z)
}

#[allow(clippy::cast_possible_truncation)] // a few thousand points
fn globe(rings: u32, meridians: u32, radius_m: impl Fn(DVec3) -> f64) -> Soup {
    let mut soup = Soup { metres: Some(1.0), ..Soup::default() };
    let mut push =
        |d: DVec3| soup.points.push((d * radius_m(d) - DVec3::Z * (radius_m(DVec3::Z) + BELOW_M)).to_array());
    push(DVec3::Z);
    push(-DVec3::Z);
    for i in 1..rings {
        let (sine, cosine) = math::sin_cos(f64::from(i) / f64::from(rings) * PI);
        for j in 0..meridians {
            let (y, x) = math::sin_cos(f64::from(j) / f64::from(meridians) * TAU);
            push(DVec3::new(sine * x, sine * y, cosine));
        }
    }
    let at = |i: u32, j: u32| match i {
        0 => 0,
        i if i == rings => 1,
        i => 2 + (i - 1) * meridians + j % meridians,
    };
    for i in 0..rings {
        for j in 0..meridians {
            if i + 1 < rings {
                soup.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            }
            if i > 0 {
                soup.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    soup
}

/// Returns a horizontal torus with radii of 20 and 8 mm.
fn torus() -> Soup {
    let mut soup = Soup { metres: Some(1.0), ..Soup::default() };
    let [n, m] = CELLS;
    for i in 0..n {
        let (sin_u, cos_u) = math::sin_cos(f64::from(i) / f64::from(n) * TAU);
        for j in 0..m {
            let (sin_v, cos_v) = math::sin_cos(f64::from(j) / f64::from(m) * TAU);
            let out = 0.02 + 0.008 * cos_v;
            soup.points.push([out * cos_u, out * sin_u, 0.008 * sin_v - 0.008 - BELOW_M]);
        }
    }
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    for i in 0..n {
        for j in 0..m {
            soup.triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            soup.triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    soup
}
