//! Slow preparation of a law from a solid and a tool, before the loop.

use crate::atlas::{Atlas, TouchedBody};
use crate::body::{Body as ElasticBody, outline_m};
use crate::dense::NotPositive;
use crate::description::Body;
use crate::half_space::HalfSpace;
use crate::mesh::Mesh;
use crate::remainder::{Face, Fineness, Remainder, Resolution, Size};
use crate::sphere::{Contact, NotConverged, Patch, Problem};
use crate::spline::{Curve, End, Volume};
use crate::table::{Table, mirrored};
use flotor_hal::Refusal;

/// Largest depth, in radii, for which the law is valid: beyond it a linear solid's force falls and the contact snaps through.
const DEEPEST: f64 = 1.2;
/// Largest solved depth, in radii; a little deeper, so that the law ends smoothly.
const DEEPEST_SOLVED: f64 = 1.25;
/// Number of depths, evenly spaced in the square root of depth over radius.
const LEVELS: usize = 14;
/// Number of depths on the half-space, which is solved once.
const PROFILE_LEVELS: usize = 30;
/// Cells of the half-space's patch from the middle to the rim.
const PROFILE_RINGS: i32 = 10;
/// Distances of the points of the remainder's table from an edge, in halves of a side.
const TABLE_SHARES: [f64; 9] = [1.0, 0.8, 0.62, 0.47, 0.34, 0.23, 0.145, 0.08, 0.03];
/// Positions of the sphere along half a side, as fractions of the distance from the middle to the outermost solved
/// position (twice the rounding before the edge).
const PLACES: [f64; 9] = [0.0, 0.25, 0.44, 0.59, 0.7, 0.785, 0.86, 0.93, 1.0];
/// Least distance from the clamped bottom at which the law of a side is solved, in radii: nearer, the elements do not
/// resolve the bottom's effect on a half-space's compliance.
const CLAMPED_MARGIN: f64 = 0.75;
/// Least distance between two positions, in halves of a side.
const LEAST_GAP: f64 = 0.05;

/// Distances from the middle of a face for a mesh's table and for the positions of the sphere, in halves of a side.
const FACE_TABLE: [f64; 6] = [0.0, 0.3, 0.55, 0.75, 0.9, 1.0];
const FACE_PLACES: [f64; 5] = [0.0, 0.35, 0.65, 0.85, 1.0];
/// End conditions of the ratios on a mesh's face and on a cylinder.
const FACE_ENDS: [[End; 2]; 3] = [[End::Parabola; 2]; 3];
const CYLINDER_ENDS: [[End; 2]; 3] = [[End::Level, End::Parabola], [End::Parabola; 2], [End::Parabola; 2]];

/// Prepared law of a sphere with its error estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Prepared {
    /// Law for a Young's modulus of 1 Pa.
    pub atlas: Atlas,
    /// Estimated relative error of the stiffness due to the elements: for a block from two grids, for a mesh from
    /// [`crate::recovery`], zero for a half-space.
    pub mesh_error: f64,
}

/// Returns the cell size at which the contact fills about four fifths of the patch, m. The radius of the contact is Hertz's
/// radius, reduced at large depth.
fn cell_m(radius_m: f64, depth_m: f64, rings: i32) -> f64 {
    1.25 * (radius_m * depth_m).sqrt() / (1.0 + 0.12 * depth_m / radius_m) / f64::from(rings)
}

/// Solves contacts with a half-space for roots of depth, in radii of a sphere of radius one.
fn unbounded(solid: &HalfSpace, rings: i32, roots: &[f64]) -> Result<Vec<Contact>, NotConverged> {
    let patch = Patch::new(solid, rings);
    let mut contacts: Vec<Contact> = Vec::with_capacity(roots.len());
    for root in roots {
        let depth_m = root * root;
        let problem = Problem {
            radius_m: 1.0,
            depth_m,
            cell_m: cell_m(1.0, depth_m, rings),
            on_face: &[],
            smooth: &[],
        };
        let contact = patch.solve(&problem, contacts.last())?;
        contacts.push(contact);
    }
    Ok(contacts)
}

/// Returns the square roots of depth over radius at which contacts are solved.
fn roots() -> Vec<f64> {
    (1..=LEVELS).map(|level| DEEPEST_SOLVED.sqrt() * level as f64 / LEVELS as f64).collect()
}

/// Returns the ratios of a body's energy to a half-space's at one place, by growing depth; `on_face`: true for a point of the
/// touched face.
fn column(
    patch: &Patch,
    table: &Table,
    radius_m: f64,
    place_m: [f64; 2],
    roots: &[f64],
    reference: &[Contact],
    on_face: &dyn Fn([f64; 2]) -> bool,
) -> Vec<f64> {
    let mut ratios: Vec<f64> = Vec::with_capacity(roots.len());
    let (mut start, mut solved): (Option<Contact>, f64) = (None, 1.0);
    for (root, unbounded) in roots.iter().zip(reference) {
        let depth_m = radius_m * root * root;
        let cell_m = cell_m(radius_m, depth_m, patch.rings);
        let points: Vec<[f64; 2]> =
            patch.points_m(cell_m).iter().map(|at| [at[0] + place_m[0], at[1] + place_m[1]]).collect();
        let on_face: Vec<bool> = points.iter().map(|&at| on_face(at)).collect();
        let smooth = table.among(&points);
        let problem = Problem { radius_m, depth_m, cell_m, on_face: &on_face, smooth: &smooth };
        let ratio =
            |contact: &Contact| contact.energy_j / (unbounded.energy_j * radius_m * radius_m * radius_m);
        let solution = patch.solve(&problem, start.as_ref()).map(|contact| (ratio(&contact), contact));
        let solution = solution.ok().filter(|(ratio, _)| ratio.is_finite() && *ratio > 0.0);
        // Near a corner the shallowest contact already has a ratio other than one; off the face it has none.
        let first = solution.as_ref().map_or(1.0, |(ratio, _)| *ratio);
        let before = ratios.last().copied().unwrap_or(first);
        if let Some((ratio, contact)) = solution.filter(|(ratio, _)| (ratio / before - 1.0).abs() < 0.3) {
            ratios.push(ratio);
            (start, solved) = (Some(contact), ratio);
        } else {
            // After a snap-through the ratio is extrapolated, by a half at most.
            let earlier = ratios.len().checked_sub(2).map_or(before, |i| ratios[i]);
            ratios.push((2.0 * before - earlier).clamp(0.5 * solved, 1.5 * solved));
        }
    }
    ratios
}

/// Returns Hertz's energy of a sphere of radius one at the depth `root²`, for a modulus of one.
fn hertz(poisson_ratio: f64, root: f64) -> f64 {
    8.0 / 15.0 / (1.0 - poisson_ratio * poisson_ratio) * flotor_hal::math::powi(root, 5)
}

/// Returns the energy relative to Hertz's, by square root of depth. It is divided by its value at the smallest depth, where
/// Hertz's law is exact, to remove the error of the cells.
fn profile(solid: &HalfSpace) -> Result<Curve, NotConverged> {
    let top = DEEPEST_SOLVED.sqrt();
    let mut roots = vec![0.01];
    roots.extend((1..=PROFILE_LEVELS).map(|level| top * level as f64 / PROFILE_LEVELS as f64));
    let contacts = unbounded(solid, PROFILE_RINGS, &roots)?;
    let shares: Vec<f64> = roots
        .iter()
        .zip(&contacts)
        .map(|(root, contact)| contact.energy_j / hertz(solid.poisson_ratio, *root))
        .collect();
    let values = shares.iter().map(|share| share / shares[0]).collect();
    roots[0] = 0.0;
    Ok(Curve::new(roots, values, [End::Parabola; 2]))
}

/// Returns the end conditions of a face's ratios: zero slope on a mirror plane of the block.
fn ends(face: Face) -> [[End; 2]; 3] {
    let along_q = if face == Face::Top { [End::Level, End::Parabola] } else { [End::Parabola; 2] };
    [[End::Level, End::Parabola], along_q, [End::Parabola; 2]]
}

fn atlas(solid: &HalfSpace, radius_m: f64, profile: Curve, body: TouchedBody) -> Atlas {
    Atlas {
        radius_m,
        hertz: 8.0 / 15.0 / (1.0 - solid.poisson_ratio * solid.poisson_ratio) * radius_m.sqrt(),
        profile,
        deepest_m: DEEPEST * radius_m,
        body,
    }
}

/// Prepares the law of a sphere on a half-space. Not real-time.
///
/// # Errors
/// A [`Refusal`] if the parameters do not describe an elastic solid, or a contact with a half-space has no solution.
pub fn sphere_on_half_space(poisson_ratio: f64, radius_m: f64) -> Result<Prepared, Refusal> {
    let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio };
    let atlas = atlas(&solid, radius_m, profile(&solid)?, TouchedBody::HalfSpace);
    Ok(Prepared { atlas, mesh_error: 0.0 })
}

/// Prepares the law of a sphere on a block. Not real-time: some seconds.
///
/// # Errors
/// A [`Refusal`] if the parameters do not describe an elastic solid, or a contact with a half-space has no solution.
pub fn sphere_on_block(
    poisson_ratio: f64,
    radius_m: f64,
    size: Size,
    resolution: Resolution,
) -> Result<Prepared, Refusal> {
    let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio };
    let remainder = Remainder::new(size, solid, resolution.fineness())?;
    let rounding_m = rounding_m(size, radius_m);
    let builder = Builder { solid, size, radius_m, rounding_m, remainder: &remainder, resolution };
    let top = builder.ratios(Face::Top)?;
    let side_x = builder.ratios(Face::SideX)?;
    let side_y = if size.half_x_m == size.half_y_m { side_x.clone() } else { builder.ratios(Face::SideY)? };
    let ratios = Box::new([top, side_x, side_y]);
    let mesh_error = builder.mesh_error()?;
    let body = TouchedBody::Block { size, ratios, rounding_m };
    Ok(Prepared { atlas: atlas(&solid, radius_m, profile(&solid)?, body), mesh_error })
}

/// Positions at which contacts on a block are compared, in halves of a side from the middle.
const BEYOND_PLACES: [f64; 4] = [0.0, 0.4, 0.75, 0.97];

/// Solves for the difference between the vertical compliance of a block's top and that of a half-space, and returns the numbers
/// of [`crate::several::ExtraCompliance`], for a modulus of 1 Pa. Not real-time: up to some seconds.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn beyond_half_space(
    poisson_ratio: f64,
    size: Size,
    fineness: Fineness,
) -> Result<Vec<f64>, NotPositive> {
    let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio };
    let remainder = Remainder::new(size, solid, fineness)?;
    let [x, y] = [size.half_x_m, size.half_y_m].map(|half_m| BEYOND_PLACES.map(|share| share * half_m));
    let table = Table::new(&remainder, Face::Top, [&x, &y]);
    let (x, y) = (mirrored(&x), mirrored(&y));
    let points: Vec<[f64; 2]> = y.iter().flat_map(|&y| x.iter().map(move |&x| [x, y])).collect();
    let mut numbers = vec![x.len() as f64, y.len() as f64];
    numbers.extend(x.iter().chain(&y));
    numbers.extend(table.among(&points).iter().map(|block| block[2][2]));
    Ok(numbers)
}

/// Returns the radius of a block's edges for a sphere, m.
fn rounding_m(size: Size, radius_m: f64) -> f64 {
    let least_m = (2.0 * size.half_x_m).min(2.0 * size.half_y_m).min(size.height_m);
    (0.02 * least_m).min(0.25 * radius_m)
}

/// Returns the size of the block around a cylinder.
fn around(radius_m: f64, height_m: f64) -> Size {
    Size { half_x_m: radius_m, half_y_m: radius_m, height_m }
}

/// Prepares the law of a sphere on the touched face of a mesh: top of a cylinder ([`Body::Cylinder`]), or any plane face.
/// `rings`: number of cells of a contact from its middle to its rim. Not real-time: some seconds.
///
/// # Errors
/// A [`Refusal`] if the parameters do not describe an elastic solid, or a contact with a half-space has no solution.
pub fn sphere_on_mesh(
    mesh: &Mesh,
    body: Body,
    poisson_ratio: f64,
    radius_m: f64,
    rings: i32,
) -> Result<Prepared, Refusal> {
    let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio };
    let elastic = ElasticBody::new(mesh, solid)?;
    let patch = Patch::new(&solid, rings);
    let roots = roots();
    let reference = unbounded(&solid, rings, &roots)?;
    let outline_m = outline_m(mesh);
    let column = |table: &Table, place_m: [f64; 2]| {
        let on_face = |at: [f64; 2]| elastic.is_on_face(at);
        column(&patch, table, radius_m, place_m, &roots, &reference, &on_face)
    };
    let mut levels = vec![0.0];
    levels.extend(&roots);
    let touched = if let Body::Cylinder { radius_m: rim_m, height_m } = body {
        let rounding_m = rounding_m(around(rim_m, height_m), radius_m);
        let line = mirrored(&table_nodes(rim_m));
        // Move points a little inside the polygon that the elements make of the rim.
        let nearest = |at: [f64; 2]| {
            let most = 0.999 * rim_m / (at[0] * at[0] + at[1] * at[1]).sqrt().max(0.999 * rim_m);
            at.map(|c| c * most)
        };
        let table = elastic.table([line.clone(), line], nearest);
        let places: Vec<f64> = PLACES.iter().map(|share| share * (rim_m - 2.0 * rounding_m)).collect();
        let mut values = vec![1.0; 3 * places.len() * levels.len()];
        for (i, &place) in places.iter().enumerate() {
            for (level, ratio) in column(&table, [place, 0.0]).into_iter().enumerate() {
                (0..3).for_each(|idle| values[((level + 1) * 3 + idle) * places.len() + i] = ratio);
            }
        }
        let ratio = Volume::new([places, vec![-1.0, 0.0, 1.0], levels], &values, CYLINDER_ENDS);
        TouchedBody::Cylinder { radius_m: rim_m, height_m, ratio: Box::new(ratio), rounding_m }
    } else {
        let spread = |shares: &[f64], k: usize, margin: f64| -> Vec<f64> {
            let [low, high] = outline_m[k];
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low) * margin);
            mirrored(shares).iter().map(|share| middle + share * half).collect()
        };
        let [x, y] = [0, 1].map(|k| spread(&FACE_TABLE, k, 0.97));
        let table = elastic.table([x, y], |at| at);
        let [x, y] = [0, 1].map(|k| spread(&FACE_PLACES, k, 0.92));
        let mut values = vec![1.0; x.len() * y.len() * levels.len()];
        for (j, &py) in y.iter().enumerate() {
            for (i, &px) in x.iter().enumerate() {
                for (level, ratio) in column(&table, [px, py]).into_iter().enumerate() {
                    values[((level + 1) * y.len() + j) * x.len() + i] = ratio;
                }
            }
        }
        TouchedBody::Face { outline_m, ratio: Box::new(Volume::new([x, y, levels], &values, FACE_ENDS)) }
    };
    // Evaluate in the middle, and at an eighth of the side from an edge.
    let mesh_error = elastic.mesh_error(radius_m, &[[0.0; 2], [0.75 * outline_m[0][1], 0.0]]);
    Ok(Prepared { atlas: atlas(&solid, radius_m, profile(&solid)?, touched), mesh_error })
}

impl Prepared {
    /// Returns all solved numbers, for the cache. Not real-time.
    #[must_use]
    pub fn to_numbers(&self) -> Vec<f64> {
        let mut numbers = vec![self.mesh_error];
        self.atlas.profile.write_numbers(&mut numbers);
        match &self.atlas.body {
            TouchedBody::HalfSpace => {}
            TouchedBody::Block { ratios, .. } => {
                ratios.iter().for_each(|volume| volume.write_numbers(&mut numbers))
            }
            TouchedBody::Cylinder { ratio, .. } => ratio.write_numbers(&mut numbers),
            TouchedBody::Face { outline_m, ratio } => {
                ratio.write_numbers(&mut numbers);
                numbers.extend(outline_m.as_flattened());
            }
        }
        numbers
    }

    /// Restores a law from its numbers, bit for bit; `None` if they do not describe such a law. Not real-time.
    #[must_use]
    pub fn from_numbers(mut numbers: &[f64], poisson_ratio: f64, radius_m: f64, body: Body) -> Option<Self> {
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio };
        let (&mesh_error, rest) = numbers.split_first()?;
        numbers = rest;
        let profile = Curve::from_numbers(&mut numbers, [End::Parabola; 2])?;
        let touched = match body {
            Body::HalfSpace | Body::Beam { .. } => TouchedBody::HalfSpace,
            Body::Block(size) => {
                let mut next = |face| Volume::from_numbers(&mut numbers, ends(face));
                let ratios = Box::new([next(Face::Top)?, next(Face::SideX)?, next(Face::SideY)?]);
                TouchedBody::Block { size, ratios, rounding_m: rounding_m(size, radius_m) }
            }
            Body::Cylinder { radius_m: rim_m, height_m } => {
                let ratio = Box::new(Volume::from_numbers(&mut numbers, CYLINDER_ENDS)?);
                TouchedBody::Cylinder {
                    radius_m: rim_m,
                    height_m,
                    ratio,
                    rounding_m: rounding_m(around(rim_m, height_m), radius_m),
                }
            }
            Body::File { .. } => {
                let ratio = Box::new(Volume::from_numbers(&mut numbers, FACE_ENDS)?);
                let (&[a, b, c, d], rest) = numbers.split_first_chunk()?;
                numbers = rest;
                TouchedBody::Face { outline_m: [[a, b], [c, d]], ratio }
            }
        };
        numbers.is_empty().then(|| Self { atlas: atlas(&solid, radius_m, profile, touched), mesh_error })
    }
}

struct Builder<'a> {
    solid: HalfSpace,
    size: Size,
    radius_m: f64,
    rounding_m: f64,
    remainder: &'a Remainder,
    resolution: Resolution,
}

/// Returns the table coordinates along half a side, as distances from the middle.
fn table_nodes(half_m: f64) -> Vec<f64> {
    TABLE_SHARES.iter().map(|share| half_m * (1.0 - share)).collect()
}

/// Returns the table coordinates from bottom to top.
fn table_heights(height_m: f64) -> Vec<f64> {
    let half_m = 0.5 * height_m;
    let up = table_nodes(half_m);
    // The clamped end is smoother: every second point is enough.
    let below = up.iter().skip(1).step_by(2).rev().map(|x| -half_m - x);
    below.chain(up.iter().map(|x| x - half_m)).collect()
}

impl Builder<'_> {
    fn half_along(&self, axis: usize) -> f64 {
        [self.size.half_x_m, self.size.half_y_m, 0.5 * self.size.height_m][axis]
    }

    /// Returns the positions along an axis at which the sphere's law is solved, m: from the middle to twice the
    /// rounding before the edge, or from [`CLAMPED_MARGIN`] above the clamped bottom to the top.
    fn places(&self, axis: usize) -> Vec<f64> {
        let half_m = self.half_along(axis);
        let up: Vec<f64> = PLACES.iter().map(|share| share * (half_m - 2.0 * self.rounding_m)).collect();
        if axis < 2 {
            return up;
        }
        let lowest_m = CLAMPED_MARGIN * self.radius_m - 2.0 * half_m;
        let below = up.iter().skip(1).rev().map(|x| -half_m - x);
        let mut all = vec![lowest_m];
        all.extend(below.chain(up.iter().map(|x| x - half_m)).filter(|&x| x > lowest_m + LEAST_GAP * half_m));
        all
    }

    fn table(&self, face: Face) -> Table {
        let [p, q, _] = face.axes();
        let nodes = |axis: usize| {
            if axis < 2 { table_nodes(self.half_along(axis)) } else { table_heights(self.size.height_m) }
        };
        Table::new(self.remainder, face, [&nodes(p), &nodes(q)])
    }

    /// Computes the ratio of the block's energy to that of a half-space, by position and square root of depth over radius.
    fn ratios(&self, face: Face) -> Result<Volume, NotConverged> {
        let [p, q, _] = face.axes();
        let table = self.table(face);
        let rings = self.resolution.rings;
        let patch = Patch::new(&self.solid, rings);
        let roots = roots();
        let reference = unbounded(&self.solid, rings, &roots)?;
        let inside = |axis: usize, x: f64| {
            if axis < 2 { x.abs() <= self.half_along(axis) } else { -self.size.height_m <= x && x <= 0.0 }
        };
        let on_face = |at: [f64; 2]| inside(p, at[0]) && inside(q, at[1]);
        let places = [self.places(p), self.places(q)];
        let counts = [places[0].len(), places[1].len()];
        let mut values = vec![1.0; counts[0] * counts[1] * (LEVELS + 1)];
        let symmetric = face == Face::Top && self.size.half_x_m == self.size.half_y_m;
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                let at = |level: usize, i: usize, j: usize| (level * counts[1] + j) * counts[0] + i;
                if symmetric && i < j {
                    continue;
                }
                let place_m = [places[0][i], places[1][j]];
                let column = column(&patch, &table, self.radius_m, place_m, &roots, &reference, &on_face);
                for (level, ratio) in column.into_iter().enumerate() {
                    values[at(level + 1, i, j)] = ratio;
                    if symmetric {
                        values[at(level + 1, j, i)] = ratio;
                    }
                }
            }
        }
        let mut levels = vec![0.0];
        levels.extend(roots);
        let [a, b] = places;
        Ok(Volume::new([a, b, levels], &values, ends(face)))
    }

    /// Estimates the relative error of the stiffness under the sphere, in the middle of the top and at an eighth of the side
    /// from an edge: change of the compliance with coarser elements, relative to a contact of half the sphere's radius on a
    /// half-space.
    fn mesh_error(&self) -> Result<f64, NotPositive> {
        let Fineness { across, high, order } = self.resolution.fineness();
        let coarse = Fineness { across: across.div_ceil(2).max(1), high: high.div_ceil(2).max(1), order };
        let other = Remainder::new(self.size, self.solid, coarse)?;
        let nu = self.solid.poisson_ratio;
        let unbounded = (1.0 - nu * nu) / self.radius_m; // 1 / (2 E* a), a = R / 2
        let points = [[0.0, 0.0], [0.75 * self.size.half_x_m, 0.0]];
        let at = |remainder: &Remainder, k: usize| {
            remainder.responses(Face::Top, &points[k..=k], &points[k..=k])[0][0][0][2][2]
        };
        Ok((0..2).map(|k| (at(self.remainder, k) - at(&other, k)).abs() / unbounded).fold(0.0, f64::max))
    }
}
