//! From parameters to a law: which bodies and tools go together, what has to be solved, what the cache has.

use crate::atlas::Atlas;
use crate::cache;
use crate::dense::NotPositive;
use crate::grid::{Grid, Lame, graded};
use crate::half_space::HalfSpace;
use crate::plate::plate;
use crate::prepare::{Prepared, Resolution, sphere_on_block, sphere_on_half_space};
use crate::punch::{Bond, Outline, extrapolated};
use crate::remainder::{Face, Fineness, Remainder, Size};
use crate::rigid::{MODES, RigidPatch};
use crate::table::Table;
use flotor_hal::{Refusal, Settings};

/// What is touched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// Top face about the origin, bottom clamped.
    Block(Size),
    /// Free end about the origin, the end at `-length_m` along x clamped.
    Beam {
        /// Length, width and height, m.
        size_m: [f64; 3],
    },
    /// All below `z = 0`.
    HalfSpace,
}

/// What touches it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tool {
    /// Without bond.
    Sphere {
        /// Its radius, m.
        radius_m: f64,
    },
    /// Bonded to the whole of a face.
    Plate,
    /// On part of the top face.
    Punch {
        /// Its outline.
        outline: Outline,
        /// How it holds the surface.
        bond: Bond,
    },
}

/// A solid with its tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// What is touched.
    pub body: Body,
    /// What touches it.
    pub tool: Tool,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Of [`RESOLUTIONS`].
    pub resolution: usize,
}

/// What a tick evaluates, for a Young's modulus of 1 Pa.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// A punch or a plate.
    Bonded(Box<RigidPatch>),
    /// A sphere.
    Sphere(Box<Atlas>),
}

/// Elements of the remainder and cells of a contact, by resolution.
pub const RESOLUTIONS: [Resolution; 3] = [
    Resolution { fineness: Fineness { across: 4, high: 5, order: 2 }, rings: 5 },
    Resolution { fineness: Fineness { across: 4, high: 5, order: 3 }, rings: 6 },
    Resolution { fineness: Fineness { across: 4, high: 5, order: 4 }, rings: 8 },
];
/// Order of the elements under a plate, by resolution.
const PLATE_ORDERS: [usize; 3] = [2, 3, 4];

impl Description {
    /// Reads parameters (`value`: those in force, by id). Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] for a combination that has no meaning or is not there yet.
    pub fn new(settings: &Settings<'_>, value: impl Fn(&str) -> f64) -> Result<Self, Refusal> {
        let metres = |id| value(id) * 1.0e-3;
        let size_m = [metres("size_x_mm"), metres("size_y_mm"), metres("size_z_mm")];
        let body = match settings.choice_or_default("body") {
            0 => Body::Block(Size {
                half_x_m: 0.5 * size_m[0],
                half_y_m: 0.5 * size_m[1],
                height_m: size_m[2],
            }),
            1 => Body::Beam { size_m },
            3 => Body::HalfSpace,
            2 => return Err(not_there("body = \"cylinder\"")),
            _ => return Err(not_there("body = \"file\"")),
        };
        if settings.text("file").is_some() {
            return Err(not_there("file"));
        }
        let radius_m = metres("tool_radius_mm");
        let bond = match settings.choice_or_default("bond") {
            0 => Bond::Bonded,
            _ => Bond::Frictionless,
        };
        let punch = |outline| Tool::Punch { outline, bond };
        let tool = match settings.choice_or_default("tool") {
            0 => Tool::Sphere { radius_m },
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
        if settings.number("bond") == Some(0.0) && matches!(tool, Tool::Sphere { .. }) {
            return Err(Refusal::parameter(
                "a sphere is not bonded: leave `bond` out, and set `friction` if it shall not slide freely",
            ));
        }
        if bond == Bond::Frictionless && tool == Tool::Plate {
            return Err(Refusal::unsupported("a plate is bonded to its face: set bond = \"bonded\""));
        }
        description.check()?;
        Ok(description)
    }

    fn check(&self) -> Result<(), Refusal> {
        let (extent_m, what) = match self.tool {
            Tool::Sphere { radius_m } => (radius_m, "`tool_radius_mm`"),
            Tool::Punch { outline: Outline::Round { radius_m }, .. } => (radius_m, "`tool_radius_mm`"),
            Tool::Punch { outline: Outline::Square { half_m }, .. } => (half_m, "half of `tool_side_mm`"),
            Tool::Plate => (0.0, ""),
        };
        match (self.body, self.tool) {
            (Body::Beam { .. }, Tool::Plate)
            | (Body::HalfSpace, Tool::Sphere { .. } | Tool::Punch { .. }) => Ok(()),
            (Body::Beam { .. }, _) => {
                Err(Refusal::unsupported("a beam is held by its end: set tool = \"plate\""))
            }
            (Body::HalfSpace, Tool::Plate) => Err(Refusal::parameter(
                "a half-space has no face a plate could cover: choose another `tool` or `body`",
            )),
            (Body::Block(size), _) => {
                let limit_m = 0.9 * size.half_x_m.min(size.half_y_m).min(size.height_m);
                if extent_m > limit_m {
                    return Err(Refusal::parameter(format!(
                        "{what} is {:.4} mm, too much for this block (at most {:.4} mm): make the tool smaller or the block larger",
                        extent_m * 1.0e3,
                        limit_m * 1.0e3
                    )));
                }
                Ok(())
            }
        }
    }

    /// What the law depends on, in words, for the cache: the exact bits of every number.
    fn words(&self) -> String {
        // Debug prints the shortest decimal that reads back as the same number.
        format!("{self:?}")
    }

    /// The law, from the cache or solved, and the estimated error of its mesh. Not real-time: up to some seconds.
    ///
    /// # Errors
    /// A [`Refusal`] if no solution exists for these numbers.
    pub fn prepare(&self) -> Result<(Law, f64), Refusal> {
        let words = self.words();
        if let Some(found) = cache::load(&words).and_then(|numbers| self.read(&numbers)) {
            return Ok(found);
        }
        let (law, mesh_error) = self.solve().map_err(|NotPositive { pivot }| {
            Refusal::parameter(format!(
                "the stiffness matrix is not positive definite (unknown {pivot}): sides too unlike each other, or a Poisson's ratio too near 0.5"
            ))
        })?;
        cache::store(&words, &to_numbers(&law, mesh_error));
        Ok((law, mesh_error))
    }

    fn read(&self, numbers: &[f64]) -> Option<(Law, f64)> {
        if let Tool::Sphere { radius_m } = self.tool {
            let size = match self.body {
                Body::Block(size) => Some(size),
                _ => None,
            };
            let prepared = Prepared::from_numbers(numbers, self.poisson_ratio, radius_m, size)?;
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

    /// The law, solved anew, and the estimated error of its mesh. Not real-time: up to some seconds.
    ///
    /// # Errors
    /// [`NotPositive`] if the numbers do not describe a solid.
    pub fn solve(&self) -> Result<(Law, f64), NotPositive> {
        let resolution = RESOLUTIONS[self.resolution.min(2)];
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: self.poisson_ratio };
        let (patch, mesh_error) = match (self.body, self.tool) {
            (Body::Block(size), Tool::Sphere { radius_m }) => {
                return Ok(sphere(sphere_on_block(self.poisson_ratio, radius_m, size, resolution)?));
            }
            (_, Tool::Sphere { radius_m }) => {
                return Ok(sphere(sphere_on_half_space(self.poisson_ratio, radius_m)));
            }
            (Body::Block(size), Tool::Punch { outline, bond }) => {
                let extent_m = match outline {
                    Outline::Round { radius_m } => radius_m,
                    Outline::Square { half_m } => half_m,
                };
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

    /// Two orders of elements on one grid: the better one, and the largest relative difference of a stiffness.
    fn plate(&self, body: Body) -> Result<(RigidPatch, f64), NotPositive> {
        let lame = Lame::new(1.0, self.poisson_ratio);
        let both = |near: f64, far: f64, half: usize| {
            let middle = 0.5 * (near + far);
            let mut borders = graded(near, middle, half, 1.5);
            borders.extend(graded(far, middle, half, 1.5).into_iter().skip(1));
            borders
        };
        let (borders, axis) = match body {
            Body::Beam { size_m: [x, y, z] } => {
                ([both(-x, 0.0, 4), both(-0.5 * y, 0.5 * y, 2), both(-0.5 * z, 0.5 * z, 2)], 0)
            }
            Body::Block(size) => {
                let across = |half_m: f64| both(-half_m, half_m, 2);
                ([across(size.half_x_m), across(size.half_y_m), both(-size.height_m, 0.0, 2)], 2)
            }
            // Refused before.
            Body::HalfSpace => ([both(-1.0, 0.0, 1), both(-1.0, 0.0, 1), both(-1.0, 0.0, 1)], 2),
        };
        let order = PLATE_ORDERS[self.resolution.min(2)];
        let solve = |order| plate(&Grid::new(borders.clone(), order), lame, axis);
        let (fine, coarse) = (solve(order)?, solve(order - 1)?);
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

/// What [`Description::read`] reads.
fn to_numbers(law: &Law, mesh_error: f64) -> Vec<f64> {
    match law {
        Law::Sphere(atlas) => Prepared { atlas: (**atlas).clone(), mesh_error }.to_numbers(),
        Law::Bonded(patch) => {
            let mut numbers = vec![mesh_error];
            patch.stiffness.iter().for_each(|row| numbers.extend(row));
            numbers
        }
    }
}

fn not_there(what: &str) -> Refusal {
    Refusal::unsupported(format!(
        "{what} is not supported by this version; bodies are block, beam and half-space"
    ))
}
