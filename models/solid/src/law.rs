//! Preparation of a law from parameters: valid combinations of body and tool, solving, caching.

use crate::atlas::Atlas;
use crate::body;
use crate::cache;
use crate::dense::NotPositive;
use crate::grid::{Grid, Lame, graded};
use crate::half_space::HalfSpace;
use crate::mesh::Mesh;
use crate::plate::{Hold, plate, plate_on};
use crate::prepare::{
    BodyKind, Prepared, Resolution, beyond_half_space, sphere_on_block, sphere_on_half_space, sphere_on_mesh,
};
use crate::punch::{Bond, Outline, extrapolated};
use crate::remainder::{Face, Fineness, Remainder, Size};
use crate::rigid::{MODES, RigidPatch};
use crate::several::{ExtraCompliance, Spheres};
use crate::table::Table;
use crate::tetrahedra::Tetrahedra;
use flotor_hal::{Refusal, Settings};

/// Touched body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// Block: top face about the origin, bottom clamped.
    Block(Size),
    /// Beam: free end about the origin, the end at `-length_m` along x clamped.
    Beam {
        /// Length, width and height, m.
        size_m: [f64; 3],
    },
    /// Half-space `z <= 0`.
    HalfSpace,
    /// Round cylinder: top about the origin, bottom clamped.
    Cylinder {
        /// Radius, m.
        radius_m: f64,
        /// Height, m.
        height_m: f64,
    },
    /// Mesh from a file; the origin is the middle of the touched face.
    File {
        /// Hash of the file's text and of the names of its faces.
        digest: u64,
    },
}

/// Tool that touches the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tool {
    /// Sphere without bond.
    Sphere {
        /// Radius of the sphere, m.
        radius_m: f64,
    },
    /// Equal spheres on one handle, without bond; several may be in contact at once.
    Spheres {
        /// Radius of each sphere, m.
        radius_m: f64,
        /// Number of spheres, two to four.
        count: usize,
        /// Distance between the centres of neighbours, m.
        spacing_m: f64,
    },
    /// Plate bonded to the whole of a face.
    Plate,
    /// Flat punch on part of the top face.
    Punch {
        /// Outline of the contact.
        outline: Outline,
        /// Bond to the surface.
        bond: Bond,
    },
}

/// Solid with its tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// Touched body.
    pub body: Body,
    /// Tool that touches the body.
    pub tool: Tool,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Index into [`RESOLUTIONS`], or [`LINEAR_TETRAHEDRA`].
    pub resolution: usize,
}

/// Law evaluated in a tick, for a Young's modulus of 1 Pa.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Law of a punch or a plate.
    Bonded(Box<RigidPatch>),
    /// Law of one sphere.
    Sphere(Box<Atlas>),
    /// Law of several spheres.
    Spheres(Box<Spheres>),
}

/// Elements of the remainder and cells of a contact, by resolution.
pub const RESOLUTIONS: [Resolution; 3] = [
    Resolution { fineness: Fineness { across: 4, high: 5, order: 2 }, rings: 5 },
    Resolution { fineness: Fineness { across: 4, high: 5, order: 3 }, rings: 6 },
    Resolution { fineness: Fineness { across: 4, high: 5, order: 4 }, rings: 8 },
];
/// Resolution beyond [`RESOLUTIONS`]: a plate on linear tetrahedra.
pub const LINEAR_TETRAHEDRA: usize = 3;
/// Bricks along a side of the square in the middle of a cylinder, by resolution.
const CYLINDER_BRICKS: [usize; 3] = [4, 6, 8];
/// Order of the elements under a plate, by resolution.
const PLATE_ORDERS: [usize; 3] = [2, 3, 4];

/// Prepared law and the estimated error of its mesh, or the reason of a failure.
type Prepares = Result<(Law, f64), Refusal>;
/// Cached numbers of a law.
type Numbers = Result<Vec<f64>, Refusal>;

impl Description {
    /// Reads the parameters. `value`: current value by id; `mesh_digest`: hash of the mesh's text and names. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] for a combination that is invalid or not supported.
    pub fn new(
        settings: &Settings<'_>,
        value: impl Fn(&str) -> f64,
        mesh_digest: u64,
    ) -> Result<Self, Refusal> {
        let metres = |id| value(id) * 1.0e-3;
        let size_m = [metres("size_x_mm"), metres("size_y_mm"), metres("size_z_mm")];
        let body = match settings.choice_or_default("body") {
            0 => Body::Block(Size {
                half_x_m: 0.5 * size_m[0],
                half_y_m: 0.5 * size_m[1],
                height_m: size_m[2],
            }),
            1 => Body::Beam { size_m },
            2 => {
                if settings.number("size_y_mm").is_some_and(|y| y * 1.0e-3 != size_m[0]) {
                    return Err(Refusal::parameter(
                        "a cylinder is round: omit `size_y_mm`, because `size_x_mm` is its diameter",
                    ));
                }
                Body::Cylinder { radius_m: 0.5 * size_m[0], height_m: size_m[2] }
            }
            3 => Body::HalfSpace,
            _ => Body::File { digest: mesh_digest },
        };
        let radius_m = metres("tool_radius_mm");
        let bond = match settings.choice_or_default("bond") {
            0 => Bond::Bonded,
            _ => Bond::Frictionless,
        };
        let punch = |outline| Tool::Punch { outline, bond };
        let tool = match settings.choice_or_default("tool") {
            0 => match settings.choice_or_default("tool_count") {
                0 => Tool::Sphere { radius_m },
                more => Tool::Spheres { radius_m, count: 1 + more, spacing_m: metres("tool_spacing_mm") },
            },
            1 => Tool::Plate,
            2 => punch(Outline::Round { radius_m }),
            _ => punch(Outline::Square { half_m: 0.5 * metres("tool_side_mm") }),
        };
        let description = Self {
            body,
            tool,
            poisson_ratio: value("poisson_ratio"),
            resolution: settings.choice_or_default("resolution"),
        };
        if settings.choice_or_default("tool_count") > 0 && matches!(tool, Tool::Plate | Tool::Punch { .. }) {
            return Err(Refusal::parameter(
                "`tool_count` is only for spheres: omit this parameter, or set tool = \"sphere\"",
            ));
        }
        if settings.number("bond") == Some(0.0) && matches!(tool, Tool::Sphere { .. } | Tool::Spheres { .. })
        {
            return Err(Refusal::parameter(
                "a sphere is not bonded: omit `bond`, and set `friction` for a sphere that does not slide freely",
            ));
        }
        if bond == Bond::Frictionless && tool == Tool::Plate {
            return Err(Refusal::unsupported("a plate is bonded to its face: set bond = \"bonded\""));
        }
        description.check()?;
        Ok(description)
    }

    fn check(&self) -> Result<(), Refusal> {
        let has_tetrahedra =
            matches!((self.body, self.tool), (Body::Block(_) | Body::Beam { .. }, Tool::Plate));
        if self.resolution == LINEAR_TETRAHEDRA && !has_tetrahedra {
            return Err(Refusal::unsupported(
                "resolution = \"linear-tetrahedra\" is a comparison for plates on a block or a beam: set tool = \"plate\"",
            ));
        }
        let (extent_m, what) = match self.tool {
            Tool::Sphere { radius_m } | Tool::Spheres { radius_m, .. } => (radius_m, "`tool_radius_mm`"),
            Tool::Punch { outline: Outline::Round { radius_m }, .. } => (radius_m, "`tool_radius_mm`"),
            Tool::Punch { outline: Outline::Square { half_m }, .. } => (half_m, "half of `tool_side_mm`"),
            Tool::Plate => (0.0, ""),
        };
        if let Tool::Spheres { radius_m, spacing_m, .. } = self.tool {
            self.check_spheres(radius_m, spacing_m)?;
        }
        match (self.body, self.tool) {
            (Body::Beam { .. }, Tool::Plate)
            | (Body::File { .. }, _)
            | (Body::HalfSpace, Tool::Sphere { .. } | Tool::Spheres { .. } | Tool::Punch { .. }) => Ok(()),
            (Body::Beam { .. }, _) => {
                Err(Refusal::unsupported("a beam is moved by a plate at its end: set tool = \"plate\""))
            }
            (Body::HalfSpace, Tool::Plate) => Err(Refusal::parameter(
                "a half-space has no face for a plate: choose another `tool` or `body`",
            )),
            (Body::Block(_) | Body::Cylinder { .. }, _) => {
                let least_m = match self.body {
                    Body::Cylinder { radius_m, height_m } => radius_m.min(height_m),
                    Body::Block(size) => size.half_x_m.min(size.half_y_m).min(size.height_m),
                    _ => f64::INFINITY,
                };
                let limit_m = 0.9 * least_m;
                if extent_m > limit_m {
                    return Err(Refusal::parameter(format!(
                        "{what} is {:.4} mm, but at most {:.4} mm for this body: make the tool smaller or the body larger",
                        extent_m * 1.0e3,
                        limit_m * 1.0e3
                    )));
                }
                Ok(())
            }
        }
    }

    fn check_spheres(&self, radius_m: f64, spacing_m: f64) -> Result<(), Refusal> {
        let mm = |m: f64| m * 1.0e3;
        if spacing_m < 2.0 * radius_m {
            return Err(Refusal::parameter(format!(
                "`tool_spacing_mm` is {:.4} mm, but spheres of {:.4} mm are at least {:.4} mm apart: make the spheres smaller or the spacing larger",
                mm(spacing_m),
                mm(radius_m),
                mm(2.0 * radius_m)
            )));
        }
        match self.body {
            Body::HalfSpace | Body::Beam { .. } => Ok(()),
            Body::Block(Size { half_x_m, half_y_m, .. }) => {
                let least_m = half_x_m.min(half_y_m);
                // With four spheres the farthest centre is that far along an axis; with three a little farther.
                if 0.6 * spacing_m <= least_m {
                    return Ok(());
                }
                Err(Refusal::parameter(format!(
                    "`tool_spacing_mm` is {:.4} mm, but at most {:.4} mm for this face: make the spacing smaller or the body larger",
                    mm(spacing_m),
                    mm(least_m / 0.6)
                )))
            }
            Body::Cylinder { .. } | Body::File { .. } => Err(Refusal::unsupported(
                "several spheres are only for a block or a half-space: omit `tool_count`, or choose another `body`",
            )),
        }
    }

    /// Returns the key of the cache: all that the law depends on, with the exact bits of every number.
    fn words(&self) -> String {
        // Debug prints the shortest decimal that reads back as the same number.
        format!("{self:?}")
    }

    /// Loads the law from the cache or solves for it; returns also the estimated error of its mesh. `mesh`: that of
    /// [`Body::File`]. Not real-time: up to some seconds, for a large mesh a minute.
    ///
    /// # Errors
    /// A [`Refusal`] if no solution exists for these numbers.
    pub fn prepare(&self, mesh: Option<&Mesh>) -> Result<(Law, f64), Refusal> {
        if let Tool::Spheres { .. } = self.tool {
            return self.spheres(&|one| one.prepare(None), &|words, solve| match cache::load(words) {
                Some(found) => Ok(found),
                None => solve().inspect(|numbers| cache::store(words, numbers)),
            });
        }
        let words = self.words();
        if let Some(found) = cache::load(&words).and_then(|numbers| self.read(&numbers)) {
            return Ok(found);
        }
        let (law, mesh_error) = match mesh {
            Some(mesh) => self.solve_on(mesh)?,
            None => self.solve()?,
        };
        cache::store(&words, &to_numbers(&law, mesh_error));
        Ok((law, mesh_error))
    }

    /// Builds the law of several spheres; `one` prepares a single sphere, `remember` caches the influence between contacts.
    fn spheres(
        &self,
        one: &dyn Fn(&Self) -> Prepares,
        remember: &dyn Fn(&str, &dyn Fn() -> Numbers) -> Numbers,
    ) -> Result<(Law, f64), Refusal> {
        let Tool::Spheres { radius_m, count, spacing_m } = self.tool else { return one(self) };
        let single = Self { tool: Tool::Sphere { radius_m }, ..*self };
        let (Law::Sphere(atlas), mesh_error) = one(&single)? else {
            return Err(Refusal::unsupported("this body supports no spheres; set tool = \"plate\""));
        };
        let beyond = match self.body {
            Body::Block(size) => {
                let words =
                    format!("beyond a half-space {size:?} {:?} {}", self.poisson_ratio, self.resolution);
                let fineness = RESOLUTIONS[self.resolution.min(2)].fineness;
                let solve = || beyond_half_space(self.poisson_ratio, size, fineness).map_err(not_positive);
                let numbers = remember(&words, &solve)?;
                match ExtraCompliance::from_numbers(&numbers) {
                    Some(beyond) => Some(beyond),
                    None => ExtraCompliance::from_numbers(&solve()?),
                }
            }
            _ => None,
        };
        let spheres = Spheres::new(*atlas, self.poisson_ratio, count, spacing_m, beyond);
        Ok((Law::Spheres(Box::new(spheres)), mesh_error))
    }

    /// Returns the kind of body under a sphere.
    fn body_kind(&self) -> BodyKind {
        match self.body {
            Body::Block(size) => BodyKind::Block(size),
            Body::Cylinder { radius_m, height_m } => BodyKind::Cylinder([radius_m, height_m]),
            Body::File { .. } => BodyKind::Face,
            Body::Beam { .. } | Body::HalfSpace => BodyKind::HalfSpace,
        }
    }

    fn read(&self, numbers: &[f64]) -> Option<(Law, f64)> {
        if let Tool::Sphere { radius_m } = self.tool {
            let prepared = Prepared::from_numbers(numbers, self.poisson_ratio, radius_m, self.body_kind())?;
            return Some((Law::Sphere(Box::new(prepared.atlas)), prepared.mesh_error));
        }
        let (&mesh_error, rest) = numbers.split_first()?;
        if rest.len() != MODES * MODES {
            return None;
        }
        let mut stiffness = [[0.0; MODES]; MODES];
        for (row, values) in stiffness.iter_mut().zip(rest.chunks_exact(MODES)) {
            row.copy_from_slice(values);
        }
        Some((Law::Bonded(Box::new(RigidPatch { stiffness })), mesh_error))
    }

    /// Solves for the law without the cache; returns also the estimated error of its mesh. Not real-time: up to some seconds.
    ///
    /// # Errors
    /// A [`Refusal`] if no solution exists for these numbers, or a mesh is needed: see [`Self::solve_on`].
    pub fn solve(&self) -> Result<(Law, f64), Refusal> {
        if let Tool::Spheres { .. } = self.tool {
            return self.spheres(&Self::solve, &|_, solve| solve());
        }
        match self.body {
            Body::Cylinder { radius_m, height_m } => {
                let mesh = Mesh::cylinder(radius_m, height_m, CYLINDER_BRICKS[self.resolution.min(2)])
                    .map_err(|problem| Refusal::parameter(format!("the cylinder: {problem}")))?;
                self.solve_on(&mesh)
            }
            Body::File { .. } => Err(Refusal::parameter("body = \"file\" needs a mesh: set `file`")),
            _ => self.solve_boxes().map_err(not_positive),
        }
    }

    /// Solves for the law on a mesh; returns also the estimated error of the mesh. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if no solution exists for these numbers, or the tool does not fit the touched face.
    pub fn solve_on(&self, mesh: &Mesh) -> Result<(Law, f64), Refusal> {
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: self.poisson_ratio };
        if self.tool == Tool::Plate {
            let (patch, mesh_error) =
                body::plate(mesh, Lame::new(1.0, self.poisson_ratio)).map_err(not_positive)?;
            return Ok((Law::Bonded(Box::new(patch)), mesh_error));
        }
        let [[left, right], [front, back]] = body::outline_m(mesh);
        let uneven_m = body::unevenness_m(mesh);
        if uneven_m > 1.0e-6 * (right - left).max(back - front) {
            return Err(Refusal::parameter(format!(
                "the touched face is not plane, or not the top of the body (by {:.4} mm): turn the mesh so that the \
                 touched face is the top, across z; or set tool = \"plate\", which fits every face",
                uneven_m * 1.0e3
            )));
        }
        if let Tool::Sphere { radius_m } = self.tool {
            let rings = RESOLUTIONS[self.resolution.min(2)].rings;
            let prepared = sphere_on_mesh(mesh, self.body_kind(), self.poisson_ratio, radius_m, rings);
            return Ok(sphere(prepared.map_err(not_positive)?));
        }
        let Tool::Punch { outline, bond } = self.tool else {
            return Err(Refusal::unsupported("this tool does not fit a mesh; choose another `tool`"));
        };
        let extent_m = outline.extent_m();
        let base = body::Body::new(mesh, solid).map_err(not_positive)?;
        if !outline.rim().into_iter().all(|at| base.is_on_face(at)) {
            return Err(Refusal::parameter(
                "the punch at the middle of the touched face reaches beyond the face: make the punch smaller",
            ));
        }
        let nodes: Vec<f64> = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| share * extent_m).to_vec();
        let table = base.table([nodes.clone(), nodes], |at| at);
        let (patch, step) = extrapolated(&solid, Some(&table), outline, bond).map_err(not_positive)?;
        Ok((Law::Bonded(Box::new(patch)), step.max(base.mesh_error(extent_m, &[[0.0; 2]]))))
    }

    /// Solves for the law of a body without a mesh.
    fn solve_boxes(&self) -> Result<(Law, f64), NotPositive> {
        let resolution = RESOLUTIONS[self.resolution.min(2)];
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: self.poisson_ratio };
        let (patch, mesh_error) = match (self.body, self.tool) {
            (Body::Block(size), Tool::Sphere { radius_m }) => {
                return Ok(sphere(sphere_on_block(self.poisson_ratio, radius_m, size, resolution)?));
            }
            (_, Tool::Sphere { radius_m } | Tool::Spheres { radius_m, .. }) => {
                return Ok(sphere(sphere_on_half_space(self.poisson_ratio, radius_m)));
            }
            (Body::Block(size), Tool::Punch { outline, bond }) => {
                let extent_m = outline.extent_m();
                let remainder = Remainder::new(size, solid, resolution.fineness)?;
                let nodes = [0.0, 0.5 * extent_m, extent_m];
                let table = Table::new(&remainder, Face::Top, [&nodes, &nodes]);
                extrapolated(&solid, Some(&table), outline, bond)?
            }
            (_, Tool::Punch { outline, bond }) => extrapolated(&solid, None, outline, bond)?,
            (body, Tool::Plate) => self.plate(body)?,
        };
        Ok((Law::Bonded(Box::new(patch)), mesh_error))
    }

    /// Returns the borders of the elements under a plate, and the axis normal to the plate.
    pub(crate) fn plate_borders(body: Body) -> ([Vec<f64>; 3], usize) {
        let both = |near: f64, far: f64, half: usize| {
            let middle = 0.5 * (near + far);
            let mut borders = graded(near, middle, half, 1.5);
            borders.extend(graded(far, middle, half, 1.5).into_iter().skip(1));
            borders
        };
        match body {
            Body::Beam { size_m: [x, y, z] } => {
                ([both(-x, 0.0, 4), both(-0.5 * y, 0.5 * y, 2), both(-0.5 * z, 0.5 * z, 2)], 0)
            }
            Body::Block(size) => {
                let across = |half_m: f64| both(-half_m, half_m, 2);
                ([across(size.half_x_m), across(size.half_y_m), both(-size.height_m, 0.0, 2)], 2)
            }
            // Unreachable for a plate: `check` rejects the half-space, and the others are solved on a mesh.
            Body::HalfSpace | Body::Cylinder { .. } | Body::File { .. } => {
                ([both(-1.0, 0.0, 1), both(-1.0, 0.0, 1), both(-1.0, 0.0, 1)], 2)
            }
        }
    }

    /// Solves on ten by two by two cells of a beam, six tetrahedra each: 99 corners. Compares with cells of half the side.
    fn linear_plate(body: Body, lame: Lame) -> Result<(RigidPatch, f64), NotPositive> {
        let even = |from: f64, to: f64, count: usize| -> Vec<f64> {
            (0..=count).map(|i| from + (to - from) * i as f64 / count as f64).collect()
        };
        let (ranges, counts, axis) = match body {
            Body::Beam { size_m: [x, y, z] } => {
                ([(-x, 0.0), (-0.5 * y, 0.5 * y), (-0.5 * z, 0.5 * z)], [10, 2, 2], 0)
            }
            Body::Block(Size { half_x_m: x, half_y_m: y, height_m: z }) => {
                ([(-x, x), (-y, y), (-z, 0.0)], [4, 4, 4], 2)
            }
            // Unreachable: `check` rejects other bodies.
            _ => ([(-1.0, 0.0); 3], [1, 1, 1], 2),
        };
        let solve = |finer: usize| {
            let borders = [0, 1, 2].map(|k| even(ranges[k].0, ranges[k].1, finer * counts[k]));
            let grid = Grid::new(borders, 1);
            let centre = [0, 1, 2].map(|k| if k == axis { 0.0 } else { 0.5 * (ranges[k].0 + ranges[k].1) });
            let hold = |node: usize| {
                let at = grid.position_m(node);
                match grid.index(node)[axis] {
                    0 => Hold::Fixed,
                    last if last == finer * counts[axis] => Hold::Plate([0, 1, 2].map(|k| at[k] - centre[k])),
                    _ => Hold::Free,
                }
            };
            plate_on(&Tetrahedra::new(&grid, lame), hold).map(|(patch, _)| patch)
        };
        let (own, finer) = (solve(1)?, solve(2)?);
        let error = (0..MODES)
            .filter(|&i| finer.stiffness[i][i] > 0.0)
            .map(|i| (own.stiffness[i][i] / finer.stiffness[i][i] - 1.0).abs())
            .fold(0.0, f64::max);
        Ok((own, error))
    }

    /// Solves with two element orders on one grid; returns the better result, and the largest relative difference of a stiffness.
    fn plate(&self, body: Body) -> Result<(RigidPatch, f64), NotPositive> {
        let lame = Lame::new(1.0, self.poisson_ratio);
        if self.resolution == LINEAR_TETRAHEDRA {
            return Self::linear_plate(body, lame);
        }
        let (borders, axis) = Self::plate_borders(body);
        let order = PLATE_ORDERS[self.resolution.min(2)];
        let solve = |order| plate(&Grid::new(borders.clone(), order), lame, axis);
        let ((fine, _), (coarse, _)) = (solve(order)?, solve(order - 1)?);
        let error = (0..MODES)
            .filter(|&i| fine.stiffness[i][i] > 0.0)
            .map(|i| (coarse.stiffness[i][i] / fine.stiffness[i][i] - 1.0).abs())
            .fold(0.0, f64::max);
        Ok((fine, error))
    }
}

fn sphere(prepared: Prepared) -> (Law, f64) {
    (Law::Sphere(Box::new(prepared.atlas)), prepared.mesh_error)
}

/// Serialises a law for [`Description::read`].
fn to_numbers(law: &Law, mesh_error: f64) -> Vec<f64> {
    match law {
        Law::Sphere(atlas) => Prepared { atlas: (**atlas).clone(), mesh_error }.to_numbers(),
        // Cached as the law of a single sphere.
        Law::Spheres(spheres) => Prepared { atlas: spheres.atlas.clone(), mesh_error }.to_numbers(),
        Law::Bonded(patch) => {
            let mut numbers = vec![mesh_error];
            patch.stiffness.iter().for_each(|row| numbers.extend(row));
            numbers
        }
    }
}

fn not_positive(NotPositive { pivot }: NotPositive) -> Refusal {
    Refusal::parameter(format!(
        "the stiffness matrix is not positive definite (unknown {pivot}): use more similar sides, or a Poisson's \
         ratio farther from 0.5"
    ))
}
