//! Preparation of a law from a description: solving and caching.

use crate::anywhere::Anywhere;
use crate::atlas::Atlas;
use crate::body;
use crate::cache;
use crate::condensation::Condensation;
use crate::dense::NotPositive;
use crate::description::{Body, Description, Tool};
use crate::grid::Lame;
use crate::half_space::HalfSpace;
use crate::material::Material;
use crate::mesh::Mesh;
use crate::prepare::{Prepared, beyond_half_space, sphere_on_block, sphere_on_half_space, sphere_on_mesh};
use crate::punch::{Outline, extrapolated};
use crate::refinement::Refinement;
use crate::remainder::{Face, Remainder};
use crate::rigid::{MODES, RigidPatch};
use crate::several::{ExtraCompliance, Spheres};
use crate::sphere::NotConverged;
use crate::survey::survey;
use crate::table::Table;
use crate::tetrahedra;
use flotor_hal::Refusal;

/// Force law evaluated in a tick, for a Young's modulus of 1 Pa.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// Law of a punch or a plate.
    Bonded(Box<RigidPatch>),
    /// Law of one sphere.
    Sphere(Box<Atlas>),
    /// Law of several spheres.
    Spheres(Box<Spheres>),
    /// Law of one sphere anywhere on the surface of a mesh.
    Anywhere(Box<Anywhere>),
}

/// Prepared law with the estimated error of its mesh, or the reason for the failure.
type Prepares = Result<(Law, f64), Refusal>;
/// Cached numbers of a law, or the reason for the failure of their computation.
type Numbers = Result<Vec<f64>, Refusal>;

impl Description {
    /// Loads the law from the cache, or solves for it and caches it; also returns the estimated error of its mesh. `mesh`: mesh of
    /// [`Body::File`]. Not real-time: up to some seconds, for a large mesh a minute.
    ///
    /// # Errors
    /// A [`Refusal`] if no solution exists for these numbers, the mesh is missing, or the tool does not fit the body.
    pub fn prepare(&self, mesh: Option<&Mesh>) -> Result<(Law, f64), Refusal> {
        if let Tool::Spheres { .. } = self.tool {
            return self.spheres(&|one| one.prepare(None), &|words, solve| match cache::load(words) {
                Some(found) => Ok(found),
                None => solve().inspect(|numbers| cache::store(words, numbers)),
            });
        }
        // Debug prints the shortest decimal that reads back as the same number.
        let words = format!("{self:?}");
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
                    format!("beyond a half-space {size:?} {:?} {:?}", self.poisson_ratio, self.resolution);
                let fineness = self.resolution.fineness();
                let solve = || Ok(beyond_half_space(self.poisson_ratio, size, fineness)?);
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

    /// Loads the law of a sphere anywhere on a mesh from the cache, or surveys the body and caches it. `materials`: of each physical volume, for a Young's modulus of 1 Pa of this solid. Not real-time: minutes.
    ///
    /// # Errors
    /// A [`Refusal`] if the tool is not one sphere, or an element not a tetrahedron, or a material not elastic.
    pub fn prepare_anywhere(&self, mesh: &Mesh, materials: &[Material]) -> Result<Law, Refusal> {
        let Tool::Sphere { radius_m } = self.tool else {
            return Err(Refusal::unsupported(
                "origin = \"body\" is for one sphere: set tool = \"sphere\" and omit `tool_count`, or set origin = \"home\"",
            ));
        };
        let words = format!("anywhere {self:?} {materials:?}");
        if let Some(law) = cache::load(&words).and_then(|numbers| Anywhere::from_numbers(&numbers)) {
            return Ok(Law::Anywhere(Box::new(law)));
        }
        let base = Refinement::new(mesh).ok_or_else(|| {
            Refusal::resource(
                "the mesh has bricks, but origin = \"body\" needs tetrahedra of 10 nodes: mesh the body with tetrahedra, \
                 or set origin = \"home\"",
            )
        })?;
        let lames = materials.iter().map(|m| Lame::new(m.youngs_modulus_pa, m.poisson_ratio)).collect();
        let regions = mesh.elements.iter().map(|element| element.region).collect();
        let body = Condensation::new(base, lames, regions)?;
        let hertz = 8.0 / 15.0 / (1.0 - self.poisson_ratio * self.poisson_ratio) * radius_m.sqrt();
        let places = 32 * self.resolution.bricks; // 128, 192 and 256
        let mut law = survey(mesh, &body, radius_m, hertz, (places, 0.7))?;
        if materials.iter().any(|material| *material != materials[0]) {
            law.errors.fill(1.0); // the contrast of a lump is not proven
        }
        cache::store(&words, &law.to_numbers());
        Ok(Law::Anywhere(Box::new(law)))
    }

    fn read(&self, numbers: &[f64]) -> Option<(Law, f64)> {
        if let Tool::Sphere { radius_m } = self.tool {
            let prepared = Prepared::from_numbers(numbers, self.poisson_ratio, radius_m, self.body)?;
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

    /// Solves for the law without the cache; also returns the estimated error of its mesh. Not real-time: up to some seconds.
    ///
    /// # Errors
    /// A [`Refusal`] if no solution exists for these numbers, the tool does not fit the body, or the body is a mesh from a file:
    /// see [`Self::solve_on`].
    pub fn solve(&self) -> Result<(Law, f64), Refusal> {
        let Self { body, tool, poisson_ratio, resolution } = *self;
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio };
        let lame = Lame::new(1.0, poisson_ratio);
        let (patch, mesh_error) = match (body, tool, body.plate_box()) {
            (_, Tool::Spheres { .. }, _) => return self.spheres(&Self::solve, &|_, solve| solve()),
            (Body::Cylinder { radius_m, height_m }, ..) => {
                let mesh = Mesh::cylinder(radius_m, height_m, resolution.bricks)
                    .map_err(|_| not_a_cylinder(radius_m, height_m))?;
                return self.solve_on(&mesh);
            }
            (Body::File { .. }, ..) => return Err(no_mesh()),
            (Body::Block(size), Tool::Sphere { radius_m }, _) => {
                return Ok(sphere(sphere_on_block(poisson_ratio, radius_m, size, resolution)?));
            }
            (Body::HalfSpace, Tool::Sphere { radius_m }, _) => {
                return Ok(sphere(sphere_on_half_space(poisson_ratio, radius_m)?));
            }
            (Body::Block(size), Tool::Punch { outline, bond }, _) => {
                let extent_m = outline.extent_m();
                let remainder = Remainder::new(size, solid, resolution.fineness())?;
                let nodes = [0.0, 0.5 * extent_m, extent_m];
                let table = Table::new(&remainder, Face::Top, [&nodes, &nodes]);
                extrapolated(&solid, Some(&table), outline, bond)?
            }
            (Body::HalfSpace, Tool::Punch { outline, bond }, _) => extrapolated(&solid, None, outline, bond)?,
            (_, Tool::Plate, Some(under)) => under.solve(lame, resolution.order)?,
            (_, Tool::LinearPlate, Some(under)) => tetrahedra::plate(&under, lame)?,
            _ => return Err(self.unfit()),
        };
        Ok((Law::Bonded(Box::new(patch)), mesh_error))
    }

    /// Solves for the law on a mesh; also returns the estimated error of the mesh. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if no solution exists for these numbers, or the tool does not fit the touched face.
    pub fn solve_on(&self, mesh: &Mesh) -> Result<(Law, f64), Refusal> {
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: self.poisson_ratio };
        if self.tool == Tool::Plate {
            let (patch, mesh_error) = body::plate(mesh, Lame::new(1.0, self.poisson_ratio))?;
            return Ok((Law::Bonded(Box::new(patch)), mesh_error));
        }
        let [[left, right], [front, back]] = body::outline_m(mesh);
        let uneven_m = body::unevenness_m(mesh);
        if uneven_m > 1.0e-6 * (right - left).max(back - front) {
            return Err(Refusal::parameter(format!(
                "the touched face is not planar, or not the top of the body (deviation {:.4} mm): turn the \
                 mesh so that the touched face is the top, across z; or set tool = \"plate\", which fits \
                 every face",
                uneven_m * 1.0e3
            )));
        }
        if let Tool::Sphere { radius_m } = self.tool {
            let rings = self.resolution.rings;
            let prepared = sphere_on_mesh(mesh, self.body, self.poisson_ratio, radius_m, rings)?;
            return Ok(sphere(prepared));
        }
        let Tool::Punch { outline, bond } = self.tool else {
            return Err(Refusal::unsupported("this tool does not fit a mesh; choose another `tool`"));
        };
        let extent_m = outline.extent_m();
        let base = body::Body::new(mesh, solid)?;
        if !outline.rim().into_iter().all(|at| base.is_on_face(at)) {
            let (what, size_m, parameter) = match outline {
                Outline::Round { radius_m } => ("radius", radius_m, "tool_radius_mm"),
                Outline::Square { half_m } => ("side", 2.0 * half_m, "tool_side_mm"),
            };
            return Err(Refusal::parameter(format!(
                "a punch of {what} {:.4} mm at the middle of the touched face extends beyond the face: reduce \
                 `{parameter}`",
                size_m * 1.0e3
            )));
        }
        let nodes: Vec<f64> = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| share * extent_m).to_vec();
        let table = base.table([nodes.clone(), nodes], |at| at);
        let (patch, step) = extrapolated(&solid, Some(&table), outline, bond)?;
        Ok((Law::Bonded(Box::new(patch)), step.max(base.mesh_error(extent_m, &[[0.0; 2]]))))
    }
}

/// Returns the refusal of `body = "file"` without a mesh.
pub(crate) fn no_mesh() -> Refusal {
    Refusal::parameter("body = \"file\" needs a mesh: set `file` to the path of a Gmsh file (.msh)")
}

/// Returns the refusal of a cylinder without a mesh; the remedies of a mesh error are for mesh files.
fn not_a_cylinder(radius_m: f64, height_m: f64) -> Refusal {
    Refusal::parameter(format!(
        "a cylinder of diameter {} mm and height {} mm cannot be meshed: set `size_x_mm` (diameter) and `size_z_mm` (height) \
         to 1 to 2000 mm, with a smaller ratio between them",
        2.0e3 * radius_m,
        1.0e3 * height_m
    ))
}

fn sphere(prepared: Prepared) -> (Law, f64) {
    (Law::Sphere(Box::new(prepared.atlas)), prepared.mesh_error)
}

/// Serialises a law for [`Description::read`].
fn to_numbers(law: &Law, mesh_error: f64) -> Vec<f64> {
    match law {
        Law::Sphere(atlas) => Prepared { atlas: (**atlas).clone(), mesh_error }.to_numbers(),
        Law::Anywhere(law) => law.to_numbers(),
        Law::Spheres(spheres) => Prepared { atlas: spheres.atlas.clone(), mesh_error }.to_numbers(),
        Law::Bonded(patch) => {
            let mut numbers = vec![mesh_error];
            patch.stiffness.iter().for_each(|row| numbers.extend(row));
            numbers
        }
    }
}

impl From<NotPositive> for Refusal {
    fn from(NotPositive { pivot }: NotPositive) -> Self {
        Self::parameter(format!(
            "the stiffness matrix is not positive definite (degree of freedom {pivot}): lower `poisson_ratio`, or \
             make the sides of the body (of a mesh: of each element) more similar"
        ))
    }
}

impl From<NotConverged> for Refusal {
    fn from(NotConverged { depth }: NotConverged) -> Self {
        Self::parameter(format!(
            "the contact of the sphere at a depth of {depth:.3} radii has no solution: lower `poisson_ratio`, or choose another \
             `resolution`"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::remainder::Resolution;

    /// The remedies were those for a mesh file: a scaling factor of Gmsh, and the order of the nodes of an element.
    #[test]
    fn a_cylinder_that_cannot_be_meshed_is_refused_with_its_parameters() {
        for (radius_m, height_m) in [(6.0, 0.1), (0.1, 11.0), (0.1, -0.1)] {
            let body = Body::Cylinder { radius_m, height_m };
            let tool = Tool::Sphere { radius_m: 0.01 };
            let cylinder = Description { body, tool, poisson_ratio: 0.3, resolution: Resolution::QUICK };
            let refusal = cylinder.solve().expect_err("no mesh").to_string();
            assert!(refusal.contains("`size_x_mm`") && refusal.contains("`size_z_mm`"), "{refusal}");
            assert!(!refusal.contains("Mesh.") && !refusal.contains("nodes"), "{refusal}");
        }
    }
}
