//! Flat rigid punch on a half-space, a block or the face of a mesh: uniform tractions on cells of the contact, refined towards the
//! rim.
//!
//! The traction under a rigid punch is singular at its rim, as the inverse square root of the distance; the cells shrink with the
//! square of the distance to resolve this. The displacement at the cells' centres is that of the half-space under uniform
//! tractions, in closed form, plus the remainder of the body, which is smooth.

use crate::dense::{self, NotPositive};
use crate::half_space::{Block, HalfSpace, add_scaled};
use crate::plate::symmetric;
use crate::rigid::{MODES, RigidPatch};
use crate::table::{Table, mirrored};
use std::f64::consts::PI;

/// Outline of a punch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outline {
    /// Disc.
    Round {
        /// Radius of the disc, m.
        radius_m: f64,
    },
    /// Square with sides along the axes.
    Square {
        /// Half-extent of the square, m.
        half_m: f64,
    },
}

/// Bond between punch and surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bond {
    /// The surface follows the punch in all directions.
    Bonded,
    /// The surface follows the punch along the normal only; the punch does not lift off.
    Frictionless,
}

/// Polygonal cell, counterclockwise, m.
struct Cell {
    corners: Vec<[f64; 2]>,
    centre: [f64; 2],
    area: f64,
}

impl Cell {
    fn new(corners: Vec<[f64; 2]>) -> Self {
        let (mut area, mut centre) = (0.0, [0.0; 2]);
        for (i, a) in corners.iter().enumerate() {
            let b = corners[(i + 1) % corners.len()];
            let cross = a[0] * b[1] - a[1] * b[0];
            area += 0.5 * cross;
            for k in 0..2 {
                centre[k] += (a[k] + b[k]) * cross / 6.0;
            }
        }
        Self { corners, centre: centre.map(|c| c / area), area }
    }
}

/// Returns positions from 0 to 1 that cluster quadratically at 1.
fn crowded(count: usize) -> Vec<f64> {
    (0..=count).map(|i| flotor_hal::math::sin(0.5 * PI * i as f64 / count as f64)).collect()
}

impl Outline {
    /// Returns the radius, or half of the side, m.
    #[must_use]
    pub fn extent_m(self) -> f64 {
        match self {
            Self::Round { radius_m } => radius_m,
            Self::Square { half_m } => half_m,
        }
    }

    /// Returns 16 points of the rim, m.
    #[must_use]
    pub fn rim(self) -> Vec<[f64; 2]> {
        (0..16)
            .map(|k| {
                let (sine, cosine) = flotor_hal::math::sin_cos(0.125 * PI * f64::from(k));
                match self {
                    Self::Round { radius_m } => [radius_m * cosine, radius_m * sine],
                    Self::Square { half_m } => {
                        let longest = sine.abs().max(cosine.abs());
                        [half_m * cosine / longest, half_m * sine / longest]
                    }
                }
            })
            .collect()
    }

    /// Divides the contact into cells; `fineness`: their number from the middle to the rim.
    fn cells(self, fineness: usize) -> Vec<Cell> {
        let line = crowded(fineness);
        match self {
            Self::Square { half_m } => {
                let borders = mirrored(&line);
                let mut cells = Vec::new();
                for y in borders.windows(2) {
                    for x in borders.windows(2) {
                        let corner = |a: f64, b: f64| [a * half_m, b * half_m];
                        cells.push(Cell::new(vec![
                            corner(x[0], y[0]),
                            corner(x[1], y[0]),
                            corner(x[1], y[1]),
                            corner(x[0], y[1]),
                        ]));
                    }
                }
                cells
            }
            Self::Round { radius_m } => {
                let sectors = 4 * fineness;
                let step = 2.0 * PI / sectors as f64;
                // Give the polygon the area of the disc.
                let scale = radius_m * (step / flotor_hal::math::sin(step)).sqrt();
                let corner = |radius: f64, sector: usize| {
                    let (sine, cosine) = flotor_hal::math::sin_cos(step * sector as f64);
                    [scale * radius * cosine, scale * radius * sine]
                };
                let mut cells = Vec::new();
                for ring in line.windows(2) {
                    for sector in 0..sectors {
                        let mut corners = vec![corner(ring[0], sector)];
                        corners.push(corner(ring[1], sector));
                        corners.push(corner(ring[1], sector + 1));
                        if ring[0] > 0.0 {
                            corners.push(corner(ring[0], sector + 1));
                        }
                        cells.push(Cell::new(corners));
                    }
                }
                cells
            }
        }
    }
}

/// Fineness of the two extrapolated solutions.
const FINENESS: [usize; 2] = [6, 9];

/// Solves for the stiffness of a punch at the origin of the surface `z = 0`, by Richardson extrapolation (second order) from two
/// solutions of [`punch`]. Also returns the relative change by the extrapolation, an upper estimate of the error. Not real-time.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn extrapolated(
    solid: &HalfSpace,
    remainder: Option<&Table>,
    outline: Outline,
    bond: Bond,
) -> Result<(RigidPatch, f64), NotPositive> {
    let coarse = punch(solid, remainder, outline, bond, FINENESS[0])?.0.stiffness;
    let fine = punch(solid, remainder, outline, bond, FINENESS[1])?.0.stiffness;
    let share = FINENESS[1] as f64 / FINENESS[0] as f64;
    let step = 1.0 / (share * share - 1.0);
    let mut stiffness = fine;
    let mut error: f64 = 0.0;
    for (i, row) in stiffness.iter_mut().enumerate() {
        for (j, value) in row.iter_mut().enumerate() {
            *value += step * (fine[i][j] - coarse[i][j]);
            if i == j && *value > 0.0 {
                error = error.max((*value - fine[i][j]).abs() / *value);
            }
        }
    }
    Ok((RigidPatch { stiffness }, error))
}

/// Loads on the surface under each mode of a punch.
pub struct Loads {
    /// Corners of the cells, counterclockwise, m.
    pub cells_m: Vec<Vec<[f64; 2]>>,
    /// Forces on the cells along x, y, z, by mode, N for a mode of one.
    pub forces: Vec<[[f64; MODES]; 3]>,
}

/// Solves for the contact stiffness of a rigid punch at the origin of the surface `z = 0`, and for the loads of its cells.
/// `remainder`: difference between the body and a half-space, `None` for a half-space; `fineness`: number of cells from the middle
/// to the rim. Not real-time.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn punch(
    solid: &HalfSpace,
    remainder: Option<&Table>,
    outline: Outline,
    bond: Bond,
    fineness: usize,
) -> Result<(RigidPatch, Loads), NotPositive> {
    let cells = outline.cells(fineness);
    let centres: Vec<[f64; 2]> = cells.iter().map(|cell| cell.centre).collect();
    let smooth = remainder.map(|table| table.among(&centres));
    let block = |target: usize, source: usize| -> Block {
        let at = centres[target];
        let corners: Vec<[f64; 2]> =
            cells[source].corners.iter().map(|c| [c[0] - at[0], c[1] - at[1]]).collect();
        let mut block = solid.polygon(&corners).map(|row| row.map(|u| u / cells[source].area));
        if let Some(smooth) = &smooth {
            add_scaled(&mut block, &smooth[target * cells.len() + source], 1.0);
        }
        block
    };
    let components: &[usize] = match bond {
        Bond::Bonded => &[0, 1, 2],
        Bond::Frictionless => &[2],
    };
    let count = components.len();
    let size = count * cells.len();
    let mut compliance = vec![0.0; size * size];
    for source in 0..cells.len() {
        for target in source..cells.len() {
            let (there, back) = (block(target, source), block(source, target));
            for (a, &i) in components.iter().enumerate() {
                for (b, &j) in components.iter().enumerate() {
                    compliance[(count * source + b) * size + count * target + a] =
                        0.5 * (there[i][j] + back[j][i]);
                }
            }
        }
    }
    dense::factor(&mut compliance, size, size)?;
    let mut patterns = vec![vec![0.0; size]; MODES];
    for (cell, centre) in centres.iter().enumerate() {
        for (a, &i) in components.iter().enumerate() {
            patterns[i][count * cell + a] = 1.0;
            for j in 0..2 {
                patterns[RigidPatch::entry(i, j)][count * cell + a] = centre[j];
            }
        }
    }
    let mut matrix = [[0.0; MODES]; MODES];
    let mut forces = vec![[[0.0; MODES]; 3]; cells.len()];
    for (mode, row) in matrix.iter_mut().enumerate() {
        let mut tractions = patterns[mode].clone();
        if tractions.iter().all(|value| *value == 0.0) {
            continue;
        }
        dense::solve(&compliance, size, &mut tractions);
        for (value, pattern) in row.iter_mut().zip(&patterns) {
            *value = tractions.iter().zip(pattern).map(|(t, u)| t * u).sum();
        }
        for (force, tractions) in forces.iter_mut().zip(tractions.chunks_exact(count)) {
            components.iter().zip(tractions).for_each(|(&i, traction)| force[i][mode] = *traction);
        }
    }
    let cells_m = cells.into_iter().map(|cell| cell.corners).collect();
    Ok((RigidPatch { stiffness: symmetric(&matrix) }, Loads { cells_m, forces }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closed forms of a disc on a half-space: Johnson 3.36 (frictionless), Spence and Mossakovski (bonded), Reissner and
    /// Sagoci (torsion).
    #[test]
    fn a_round_punch_on_a_half_space_is_the_closed_form() {
        let (e, a) = (2.0, 0.7);
        for nu in [0.0, 0.3, 0.45] {
            let solid = HalfSpace { youngs_modulus_pa: e, poisson_ratio: nu };
            let mu = e / (2.0 * (1.0 + nu));
            let outline = Outline::Round { radius_m: a };
            let stiffness = |bond| extrapolated(&solid, None, outline, bond).expect("a solid").0.stiffness;
            let (frictionless, bonded) = (stiffness(Bond::Frictionless), stiffness(Bond::Bonded));
            let (xy, yx) = (RigidPatch::entry(0, 1), RigidPatch::entry(1, 0));
            let torsion = bonded[xy][xy] + bonded[yx][yx] - 2.0 * bonded[xy][yx];
            let tilt = RigidPatch::entry(2, 0);
            let cases = [
                (frictionless[2][2], 2.0 * e * a / (1.0 - nu * nu)),
                (frictionless[tilt][tilt], 4.0 / 3.0 * e * a * a * a / (1.0 - nu * nu)),
                (bonded[2][2], 4.0 * mu * a * (3.0 - 4.0 * nu).ln() / (1.0 - 2.0 * nu)),
                (torsion, 16.0 / 3.0 * mu * a * a * a),
            ];
            for (got, wanted) in cases {
                // A third of the bound on a punch's force.
                assert!((got / wanted - 1.0).abs() < 0.01, "nu {nu}: {got} {wanted}");
            }
        }
    }
}
