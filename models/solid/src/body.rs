//! Body of any shape with a plane touched top: difference between its response and that of a half-space.
//!
//! The half-space behind the touched face contains the singularity of every contact, as for a block
//! ([`crate::remainder`]). The finite elements solve for the difference: tractions that cancel those of the half-space on the
//! free surface, and displacements that cancel those on the fixed surface. So the mesh need not be fine under the tool.

use crate::dense::NotPositive;
use crate::dissection::{Stiffness, subtract_forces};
use crate::facet::SurfacePoint;
use crate::grid::Lame;
use crate::half_space::{Block, HalfSpace};
use crate::mesh::{Facet, Mesh, MeshStiffness};
use crate::plate::{Hold, plate_on};
use crate::recovery::twice_error_j;
use crate::rigid::{MODES, RigidPatch};
use crate::table::Table;

/// Number of forces solved for at once.
const BATCH: usize = 8;

/// Body of a mesh, with the Cholesky factors of its stiffness matrix.
#[derive(Debug)]
pub struct Body<'a> {
    mesh: &'a Mesh,
    solid: HalfSpace,
    lame: Lame,
    stiffness: Stiffness,
    /// Quadrature points of the free surface, by facet.
    quadrature: Vec<(&'a Facet, Vec<SurfacePoint>)>,
}

/// Returns smallest and largest x and y of the touched face, m.
#[must_use]
pub fn outline_m(mesh: &Mesh) -> [[f64; 2]; 2] {
    let nodes = || mesh.touched.iter().flat_map(|facet| &facet.nodes);
    [0, 1].map(|k| {
        let all = || nodes().map(|&node| mesh.nodes_m[node][k]);
        [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)]
    })
}

/// Returns the larger of two lengths, m: height of the body above the middle of the touched face, and largest distance of the
/// touched face from the horizontal plane through its middle. Zero if the touched face is plane and the top of the body.
#[must_use]
pub fn unevenness_m(mesh: &Mesh) -> f64 {
    let above = mesh.free.iter().flat_map(|facet| &facet.nodes).map(|&node| mesh.nodes_m[node][2]);
    let beside = mesh.touched.iter().flat_map(|facet| &facet.nodes).map(|&node| mesh.nodes_m[node][2].abs());
    above.chain(beside).fold(0.0, f64::max)
}

/// Solves for the stiffness of a solid against a rigid plate bonded to the touched face of its mesh; also returns the estimated
/// relative error of the stiffness, the largest over the [`MODES`] modes of the plate. Not real-time.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn plate(mesh: &Mesh, lame: Lame) -> Result<(RigidPatch, f64), NotPositive> {
    let (patch, displacement) = plate_modes(mesh, lame)?;
    let errors = twice_error_j(&MeshStiffness { mesh, lame }, &displacement, MODES);
    let shares = errors.iter().enumerate().filter(|(i, _)| patch.stiffness[*i][*i] > 0.0);
    let error = shares.map(|(i, error)| error / patch.stiffness[i][i]).fold(0.0, f64::max);
    Ok((patch, error))
}

/// Solves for the stiffness of a solid against a rigid plate bonded to the touched face of its mesh; also returns the displacements
/// of all nodes for each of the [`MODES`] modes of the plate. Not real-time.
///
/// # Errors
/// [`NotPositive`] if the parameters do not describe an elastic solid.
pub fn plate_modes(mesh: &Mesh, lame: Lame) -> Result<(RigidPatch, Vec<f64>), NotPositive> {
    let mut hold: Vec<Hold> = mesh.fixed.iter().map(|&f| if f { Hold::Fixed } else { Hold::Free }).collect();
    mesh.touched
        .iter()
        .flat_map(|facet| &facet.nodes)
        .for_each(|&node| hold[node] = Hold::Plate(mesh.nodes_m[node]));
    plate_on(&MeshStiffness { mesh, lame }, |node| hold[node])
}

impl<'a> Body<'a> {
    /// Assembles and factorises the stiffness matrix of a mesh. Not real-time.
    ///
    /// # Errors
    /// [`NotPositive`] if the parameters do not describe an elastic solid.
    pub fn new(mesh: &'a Mesh, solid: HalfSpace) -> Result<Self, NotPositive> {
        let lame = Lame::new(solid.youngs_modulus_pa, solid.poisson_ratio);
        let fixed = mesh.fixed.iter().map(|&fixed| [fixed; 3]).collect();
        let stiffness = Stiffness::new(&MeshStiffness { mesh, lame }, fixed)?;
        // The half-space leaves its own plane free of stress.
        let slanted = |facet: &&Facet| facet.nodes.iter().any(|&node| mesh.nodes_m[node][2] < -1.0e-9);
        let quadrature =
            mesh.free.iter().filter(slanted).map(|facet| (facet, facet.points(&mesh.nodes_m))).collect();
        Ok(Self { mesh, solid, lame, stiffness, quadrature })
    }

    /// Returns true if the point of the plane `z = 0` at x and y `at_m` lies on the touched face.
    #[must_use]
    pub fn is_on_face(&self, at_m: [f64; 2]) -> bool {
        let nodes_m = &self.mesh.nodes_m;
        let holds = |facet: &Facet| facet.may_hold(nodes_m, at_m) && facet.locate(nodes_m, at_m).1 < 1.0e-9;
        self.mesh.touched.iter().any(holds)
    }

    /// Finds the facet at or nearest to a point of the plane; also returns the weights of its nodes.
    fn sample(&self, at_m: [f64; 2]) -> (&Facet, Vec<f64>) {
        let mut best = (&self.mesh.touched[0], Vec::new());
        let mut least = f64::INFINITY;
        for facet in &self.mesh.touched {
            let (shares, outside) = facet.locate(&self.mesh.nodes_m, at_m);
            if outside < least {
                (best, least) = ((facet, shares), outside);
            }
        }
        best
    }

    /// Solves for the remainder, m/N, of all pairs of points of a grid; `nearest` moves each point onto the face. Not
    /// real-time.
    pub fn table(&self, nodes_m: [Vec<f64>; 2], nearest: impl Fn([f64; 2]) -> [f64; 2]) -> Table {
        let points: Vec<[f64; 2]> =
            nodes_m[1].iter().flat_map(|&y| nodes_m[0].iter().map(move |&x| [x, y])).map(nearest).collect();
        let samples: Vec<(&Facet, Vec<f64>)> = points.iter().map(|&at| self.sample(at)).collect();
        let answers: Vec<Vec<Block>> =
            points.chunks(BATCH).flat_map(|batch| self.respond(batch, &samples)).collect();
        Table::of(nodes_m, &answers)
    }

    /// Solves for the displacement under forces at `places_m` of the touched face, and returns the largest estimated error of the
    /// compliance along z, relative to that of a half-space under a rigid disc of radius `0.5 * radius_m`. Not real-time.
    #[must_use]
    pub fn mesh_error(&self, radius_m: f64, places_m: &[[f64; 2]]) -> f64 {
        let nu = self.solid.poisson_ratio;
        let unbounded = (1.0 - nu * nu) / (self.solid.youngs_modulus_pa * radius_m); // 1 / (2 E* a), a = R / 2
        let body = MeshStiffness { mesh: self.mesh, lame: self.lame };
        let errors = twice_error_j(&body, &self.displacement(places_m), 3 * places_m.len());
        errors.chunks_exact(3).map(|along| along[2] / unbounded).fold(0.0, f64::max)
    }

    fn respond(&self, sources_m: &[[f64; 2]], samples: &[(&Facet, Vec<f64>)]) -> Vec<Vec<Block>> {
        let columns = 3 * sources_m.len();
        let values = self.displacement(sources_m);
        (0..sources_m.len())
            .map(|source| {
                let block = |(facet, shares): &(&Facet, Vec<f64>)| {
                    [0, 1, 2].map(|axis| {
                        [0, 1, 2].map(|force| {
                            let at = |&node: &usize| values[(3 * node + axis) * columns + 3 * source + force];
                            facet.nodes.iter().map(at).zip(shares).map(|(u, share)| u * share).sum()
                        })
                    })
                };
                samples.iter().map(block).collect()
            })
            .collect()
    }

    /// Returns the remainder displacement of all nodes, m/N, under unit forces along x, y and z at each source.
    fn displacement(&self, sources_m: &[[f64; 2]]) -> Vec<f64> {
        let columns = 3 * sources_m.len();
        let mut values = vec![0.0; 3 * self.mesh.nodes_m.len() * columns];
        self.add_tractions(sources_m, &mut values);
        let prescribed = self.prescribed(sources_m);
        let body = MeshStiffness { mesh: self.mesh, lame: self.lame };
        subtract_forces(&body, &prescribed, &mut values, columns);
        self.stiffness.solve(&mut values, columns);
        values.iter_mut().zip(&prescribed).for_each(|(u, p)| *u += p);
        values
    }

    /// Adds the nodal forces of the tractions that cancel those of the half-space on the free surface.
    fn add_tractions(&self, sources_m: &[[f64; 2]], forces: &mut [f64]) {
        let columns = 3 * sources_m.len();
        let mut tractions = vec![[0.0; 3]; columns];
        for (facet, points) in &self.quadrature {
            for point in points {
                let n = point.normal_m2;
                for (source, at) in sources_m.iter().enumerate() {
                    let [x, y, z] = point.position_m;
                    let u = self.solid.field([x - at[0], y - at[1], z.min(0.0)]).displacement;
                    for force in 0..3 {
                        let trace = self.lame.lambda_pa * (0..3).map(|k| u[k][force].slope[k]).sum::<f64>();
                        tractions[3 * source + force] = [0, 1, 2].map(|i| {
                            let shear: f64 =
                                (0..3).map(|j| (u[i][force].slope[j] + u[j][force].slope[i]) * n[j]).sum();
                            -(self.lame.mu_pa * shear + trace * n[i])
                        });
                    }
                }
                for (node, share) in facet.nodes.iter().zip(&point.shares) {
                    for axis in 0..3 {
                        let start = (3 * node + axis) * columns;
                        let row = &mut forces[start..start + columns];
                        row.iter_mut().zip(&tractions).for_each(|(f, t)| *f += share * t[axis]);
                    }
                }
            }
        }
    }

    /// Returns the displacement that cancels that of the half-space at the fixed nodes, m/N; zero elsewhere.
    fn prescribed(&self, sources_m: &[[f64; 2]]) -> Vec<f64> {
        let columns = 3 * sources_m.len();
        let mut values = vec![0.0; 3 * self.mesh.nodes_m.len() * columns];
        for (node, [x, y, z]) in
            self.mesh.nodes_m.iter().enumerate().filter(|(node, _)| self.mesh.fixed[*node])
        {
            for (source, at) in sources_m.iter().enumerate() {
                let u = self.solid.field([x - at[0], y - at[1], z.min(0.0)]).displacement;
                for (axis, row) in u.iter().enumerate() {
                    for (force, jet) in row.iter().enumerate() {
                        values[(3 * node + axis) * columns + 3 * source + force] = -jet.value;
                    }
                }
            }
        }
        values
    }
}
