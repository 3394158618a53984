//! Picture of the solid at a pose: its deformed surface, the pressure of the contact, and the tool. Not real-time.
//!
//! A plate is drawn from the finite elements of its body. Under a punch, the surface has the displacement of a
//! half-space under the tractions of the punch. Under a sphere, it has the displacement of Hertz's contact (Johnson,
//! *Contact Mechanics*, 1985, sections 3.4 and 4.2) at the depth that the force law gives. Both displacements fade to
//! zero towards the fixed face. The body is not a half-space; the difference moves the surface by a few hundredths of
//! the depth. The force contains this difference, the drawing does not.

use crate::atlas::{Answer, Atlas};
use crate::body;
use crate::description::{Body, Description, Tool};
use crate::grid::Lame;
use crate::half_space::HalfSpace;
use crate::jet::Jet;
use crate::mesh::Mesh;
use crate::plate::plate;
use crate::punch::{Bond, Loads, Outline, punch};
use crate::rigid::{MODES, RigidPatch};
use crate::several::{self, Spheres};
use crate::skin::{Face, Focus, Skin};
use flotor_hal::{DMat3, DQuat, DVec3, Form, Part, Pose, Primitive, ScalarField, Shape, SurfaceVertex, math};
use std::f64::consts::{FRAC_PI_2, PI};

/// Order of the elements in the picture of a plate.
const ORDER: usize = 2;
/// Number of bricks of a cylinder along a side of the square in its middle.
const BRICKS: usize = 6;
/// Number of cells of a punch from its middle to its rim.
const FINENESS: usize = 6;
/// Numbers of steps of a block's surface along x, y, z: about 5 000 triangles.
const STEPS: [usize; 3] = [32, 32, 11];
/// Numbers of steps of a block's surface while a side is touched.
const SIDE_STEPS: [usize; 3] = [20, 20, 28];
/// Radius of the drawn part of a half-space, in radii of the tool.
const HALF_SPACE_RADII: f64 = 5.0;
/// Thickness of a plate and height of a punch, relative to half the shortest side.
const THICKNESS: f64 = 0.3;

const PRESSURE: ScalarField = ScalarField::new("contact pressure", "kPa");
const DISPLACEMENT: ScalarField = ScalarField::new("displacement", "mm");

/// Displacement and pressure of a surface under each mode of a rigid patch, for a modulus of 1 Pa.
#[derive(Clone, Debug)]
struct Modal {
    skin: Skin,
    /// Displacement by corner, m for a mode of one.
    displacement: Vec<[DVec3; MODES]>,
    /// Pressure by corner, Pa for a mode of one; if empty, the displacement is shown.
    pressure: Vec<[f64; MODES]>,
    /// Form and half-extents of the tool, m.
    tool: (Form, [f64; 3]),
    /// Vector from the handle to the tool's centre, m.
    tool_centre_m: DVec3,
}

/// Drawn fields of a solid, by kind of tool.
#[derive(Clone, Debug)]
enum Look {
    /// Plate or punch, with the fields of its modes.
    Bonded(Box<Modal>),
    /// Contact with spheres; `Some`: the surface of a mesh.
    Sphere(Option<Skin>),
}

/// Picture generator of a solid with its tool.
#[derive(Clone, Debug)]
pub struct Drawing {
    body: Body,
    /// Height above the fixed face, m.
    height_m: f64,
    look: Look,
    shape: Shape,
}

impl Drawing {
    /// Solves for the fields of a picture: none under a sphere, up to a second of work under a punch or a plate.
    /// `None` if the parameters do not describe an elastic solid.
    #[must_use]
    pub fn new(description: &Description, mesh: Option<&Mesh>) -> Option<Self> {
        let round = match (description.body, description.tool) {
            (Body::Cylinder { radius_m, height_m }, Tool::Plate) => {
                Mesh::cylinder(radius_m, height_m, BRICKS).ok()
            }
            _ => None,
        };
        let mesh = mesh.or(round.as_ref());
        let look = match description.tool {
            Tool::Sphere { .. } | Tool::Spheres { .. } => {
                Look::Sphere(mesh.map(|mesh| Skin::of_mesh(mesh).0))
            }
            Tool::Plate | Tool::LinearPlate => match mesh {
                Some(mesh) => Look::Bonded(Box::new(plate_on_mesh(description, mesh)?)),
                None => Look::Bonded(Box::new(plate_on_boxes(description)?)),
            },
            Tool::Punch { outline, bond } => {
                Look::Bonded(Box::new(punch_modes(description, mesh, outline, bond)?))
            }
        };
        let height_m = height_m(description.body, mesh);
        Some(Self { body: description.body, height_m, look, shape: Shape::default() })
    }

    /// Draws the solid under a plate or a punch at a pose (finite).
    pub fn bonded(&mut self, pose: &Pose, modulus_pa: f64) -> &Shape {
        if let Look::Bonded(modal) = &self.look {
            modal.draw(&mut self.shape, pose, modulus_pa);
        }
        &self.shape
    }

    /// Draws the solid under a sphere centred at `centre_m` (finite); `answer`: result of the law at this position.
    pub fn sphere(&mut self, atlas: &Atlas, centre_m: DVec3, answer: &Answer, modulus_pa: f64) -> &Shape {
        let contact = Contact::new(self.height_m, atlas, centre_m, answer, modulus_pa);
        let focus = Focus { at_m: contact.at_m, width_m: 0.6 * contact.radius_m.max(0.15 * atlas.radius_m) };
        self.under(&[contact], focus, atlas.radius_m)
    }

    /// Draws a mesh with its surface moved out of a sphere centred at `centre_m` (finite); the surface around is drawn undeformed.
    pub fn ball(&mut self, radius_m: f64, centre_m: DVec3) -> &Shape {
        self.under(&[], Focus { at_m: centre_m, width_m: radius_m }, radius_m);
        let Shape { primitives, surface } = &mut self.shape;
        for vertex in &mut surface.vertices {
            let away_m = DVec3::from_array(vertex.position_m) - centre_m;
            let moved_m = (radius_m - away_m.length()).max(0.0);
            vertex.position_m = (centre_m + away_m + away_m.normalize_or_zero() * moved_m).to_array();
            vertex.value = moved_m * 1.0e3;
        }
        surface.field = DISPLACEMENT;
        surface.set_normals();
        primitives.push(Primitive::sphere(Part::Tool, Pose::new(centre_m, DQuat::IDENTITY), radius_m));
        &self.shape
    }

    /// Draws the solid under several spheres; the displacement of the surface is the sum of the displacements under each contact
    /// alone.
    pub fn spheres(&mut self, spheres: &Spheres, answer: &several::Answer, modulus_pa: f64) -> &Shape {
        let atlas = &spheres.atlas;
        let contacts: Vec<Contact> = (0..spheres.count())
            .map(|i| {
                let slope = (-answer.forces_n[i]).to_array();
                let energy = Jet { value: 0.0, slope };
                let alone = Answer { energy, depth_m: answer.depths_m[i], is_extrapolated: false };
                // Relative to the surface as lowered by the other spheres.
                let lifted_m = answer.centres_m[i] + DVec3::Z * answer.depressions_m[i];
                let contact = Contact::new(self.height_m, atlas, lifted_m, &alone, modulus_pa);
                Contact { centre_m: answer.centres_m[i], ..contact }
            })
            .collect();
        let middle_m = contacts.iter().map(|contact| contact.at_m).sum::<DVec3>() / contacts.len() as f64;
        let away_m = contacts.iter().map(|contact| contact.at_m.distance(middle_m)).fold(0.0, f64::max);
        self.under(&contacts, Focus { at_m: middle_m, width_m: away_m }, away_m + atlas.radius_m)
    }

    /// Draws the solid under contacts, with a surface that is fine at `focus`; `tool_m`: extent of the tool from the focus.
    fn under(&mut self, contacts: &[Contact], focus: Focus, tool_m: f64) -> &Shape {
        let own;
        let skin = match &self.look {
            Look::Sphere(Some(skin)) => skin,
            _ => {
                let is_above = contacts.iter().any(|contact| contact.normal.z > 0.7);
                own = skin_of(self.body, focus, if is_above { STEPS } else { SIDE_STEPS }, tool_m);
                &own
            }
        };
        let Shape { primitives, surface } = &mut self.shape;
        surface.vertices.clear();
        surface.vertices.extend(skin.places_m.iter().map(|place_m| vertex(contacts, *place_m)));
        surface.triangles.clone_from(&skin.triangles);
        surface.field = PRESSURE;
        surface.set_normals();
        primitives.clear();
        primitives.extend(contacts.iter().map(|Contact { centre_m, sphere_m, .. }| {
            Primitive::sphere(Part::Tool, Pose::new(*centre_m, DQuat::IDENTITY), *sphere_m)
        }));
        &self.shape
    }
}

/// Returns the surface of a body without a mesh, fine at `focus`. `steps`: numbers of steps of a block; `tool_m`: extent of the
/// tool.
fn skin_of(body: Body, focus: Focus, steps: [usize; 3], tool_m: f64) -> Skin {
    match body {
        Body::Block(size) => Skin::block([size.half_x_m, size.half_y_m], size.height_m, focus, steps),
        Body::Cylinder { radius_m, height_m } => Skin::cylinder(radius_m, height_m, focus),
        _ => Skin::disc(HALF_SPACE_RADII * tool_m, focus),
    }
}

/// Returns a surface point deformed by contacts, with the pressure there.
fn vertex(contacts: &[Contact], place_m: DVec3) -> SurfaceVertex {
    let moved_m: DVec3 = contacts.iter().map(|contact| contact.moved_m(place_m)).sum();
    let outside_m = contacts.iter().fold(place_m + moved_m, |at_m, contact| contact.outside_m(place_m, at_m));
    let value = contacts.iter().map(|contact| contact.pressure_kpa(place_m)).sum();
    SurfaceVertex { position_m: outside_m.to_array(), normal: [0.0; 3], value }
}

/// Returns the drawn fraction of a half-space's displacement at a height: zero at the fixed face.
fn free_share(height_m: f64, z_m: f64) -> f64 {
    (1.0 + z_m / height_m).clamp(0.0, 1.0)
}

/// Returns the height of a body whose bottom is fixed, m.
fn height_m(body: Body, mesh: Option<&Mesh>) -> f64 {
    match body {
        Body::Block(size) => size.height_m,
        Body::Cylinder { height_m, .. } => height_m,
        Body::Beam { .. } | Body::HalfSpace => f64::INFINITY,
        Body::File { .. } => mesh.map_or(f64::INFINITY, |mesh| {
            -mesh.nodes_m.iter().map(|node| node[2]).fold(-f64::MIN_POSITIVE, f64::min)
        }),
    }
}

/// Hertzian contact with a sphere.
struct Contact {
    /// Middle of the contact on the undeformed surface, m.
    at_m: DVec3,
    /// Outward normal of the solid.
    normal: DVec3,
    /// Radius of the contact, m; 0 without contact.
    radius_m: f64,
    /// Depression of the rim of the contact, m.
    rim_m: f64,
    /// Pressure in the middle of the contact, kPa.
    peak_kpa: f64,
    centre_m: DVec3,
    sphere_m: f64,
    height_m: f64,
}

impl Contact {
    fn new(height_m: f64, atlas: &Atlas, centre_m: DVec3, answer: &Answer, modulus_pa: f64) -> Self {
        let sphere_m = atlas.radius_m;
        let force_n = DVec3::from_array(answer.energy.slope) * -modulus_pa;
        let normal = force_n.try_normalize();
        let at_m = match normal {
            Some(normal) => centre_m - normal * (sphere_m - answer.depth_m.max(0.0)),
            None => centre_m.with_z(0.0),
        };
        let depth_m = answer.depth_m.clamp(0.0, atlas.deepest_m);
        let radius_m = contact_radius_m(sphere_m, depth_m);
        let rim_m = depth_m - sphere_m + (sphere_m * sphere_m - radius_m * radius_m).sqrt();
        let area_m2 = PI * radius_m * radius_m;
        let peak_kpa = if area_m2 > 0.0 { 1.5e-3 * force_n.length() / area_m2 } else { 0.0 };
        let normal = normal.unwrap_or(DVec3::Z);
        Self { at_m, normal, radius_m, rim_m, peak_kpa, centre_m, sphere_m, height_m }
    }

    /// Returns the displacement of a surface point, m.
    fn moved_m(&self, place_m: DVec3) -> DVec3 {
        let share = free_share(self.height_m, place_m.z);
        self.normal * -(share * self.depression_m(place_m.distance(self.at_m)))
    }

    /// Moves a displaced surface point that lies inside the sphere out to the sphere's surface.
    fn outside_m(&self, place_m: DVec3, at_m: DVec3) -> DVec3 {
        if self.radius_m == 0.0 || at_m.distance_squared(self.centre_m) >= self.sphere_m * self.sphere_m {
            return at_m;
        }
        let beside_m = self.beside_m(place_m);
        let within = self.sphere_m * self.sphere_m - beside_m.length_squared();
        let below_m = (self.centre_m - self.at_m).dot(self.normal) - within.max(0.0).sqrt();
        self.at_m + beside_m + self.normal * below_m
    }

    /// Returns the offset of a place from the contact's middle, along the surface, m.
    fn beside_m(&self, place_m: DVec3) -> DVec3 {
        let from_middle_m = place_m - self.at_m;
        from_middle_m - self.normal * from_middle_m.dot(self.normal)
    }

    fn pressure_kpa(&self, place_m: DVec3) -> f64 {
        let part = 1.0 - self.beside_m(place_m).length_squared() / (self.radius_m * self.radius_m);
        let is_on_face = (place_m - self.at_m).dot(self.normal).abs() < 0.1 * self.sphere_m;
        if part > 0.0 && is_on_face { self.peak_kpa * part.sqrt() } else { 0.0 }
    }

    /// Returns the depression of the surface at a distance from the middle, m: the sphere's shape inside the contact, Hertz's
    /// solution outside.
    fn depression_m(&self, distance_m: f64) -> f64 {
        if self.radius_m == 0.0 {
            return 0.0;
        }
        let x = distance_m / self.radius_m;
        if x > 1.0 {
            return self.rim_m * outside(x);
        }
        let level = |radius_m: f64| (self.sphere_m * self.sphere_m - radius_m * radius_m).sqrt();
        self.rim_m + level(distance_m) - level(self.radius_m)
    }
}

/// Returns the contact radius of a sphere at a depth, m: Hertz's radius, reduced at large depth, where a sphere is not a paraboloid.
fn contact_radius_m(sphere_m: f64, depth_m: f64) -> f64 {
    (sphere_m * depth_m).sqrt() / (1.0 + 0.12 * depth_m / sphere_m)
}

/// Returns the depression outside Hertz's contact, relative to that at the rim, at a distance of `x` contact radii.
fn outside(x: f64) -> f64 {
    ((2.0 - x * x) * math::asin(1.0 / x) + (x * x - 1.0).sqrt()) / FRAC_PI_2
}

impl Modal {
    fn draw(&self, shape: &mut Shape, pose: &Pose, modulus_pa: f64) {
        let modes = RigidPatch::modes(pose.position(), pose.orientation());
        let Shape { primitives, surface } = shape;
        surface.field = if self.pressure.is_empty() { DISPLACEMENT } else { PRESSURE };
        surface.triangles.clone_from(&self.skin.triangles);
        surface.vertices.clear();
        surface.vertices.extend(self.skin.places_m.iter().zip(&self.displacement).enumerate().map(
            |(corner, (place_m, columns))| {
                let moved_m: DVec3 = columns.iter().zip(&modes).map(|(column, mode)| *column * *mode).sum();
                let pressed = self.pressure.get(corner).map(|row| {
                    row.iter().zip(&modes).map(|(p, mode)| p * mode).sum::<f64>() * modulus_pa * 1.0e-3
                });
                let value = pressed.unwrap_or(moved_m.length() * 1.0e3);
                SurfaceVertex { position_m: (*place_m + moved_m).to_array(), normal: [0.0; 3], value }
            },
        ));
        surface.set_normals();
        let (form, half_sides_m) = self.tool;
        let centre_m = pose.position() + pose.orientation() * self.tool_centre_m;
        primitives.clear();
        primitives.push(Primitive::new(
            form,
            Part::Tool,
            Pose::new(centre_m, pose.orientation()),
            half_sides_m,
        ));
    }
}

/// Returns the displacement of a node under each mode.
fn columns(displacement: &[f64], node: usize) -> [DVec3; MODES] {
    let at = |axis: usize, mode: usize| displacement[(3 * node + axis) * MODES + mode];
    std::array::from_fn(|mode| DVec3::new(at(0, mode), at(1, mode), at(2, mode)))
}

/// Solves for the picture of a plate on a mesh.
fn plate_on_mesh(description: &Description, mesh: &Mesh) -> Option<Modal> {
    let (_, displacement) = body::plate_modes(mesh, Lame::new(1.0, description.poisson_ratio)).ok()?;
    let (skin, nodes) = Skin::of_mesh(mesh);
    let [[left, right], [front, back]] = body::outline_m(mesh);
    let half_m = [0.5 * (right - left), 0.5 * (back - front)];
    let thick_m = THICKNESS * half_m[0].min(half_m[1]);
    let form = if matches!(description.body, Body::Cylinder { .. }) { Form::Cylinder } else { Form::Box };
    Some(Modal {
        skin,
        displacement: nodes.iter().map(|&node| columns(&displacement, node)).collect(),
        pressure: Vec::new(),
        tool: (form, [half_m[0], half_m[1], 0.5 * thick_m]),
        tool_centre_m: DVec3::new(0.5 * (left + right), 0.5 * (front + back), 0.5 * thick_m),
    })
}

/// Solves for the picture of a plate on boxes: elements of second order, independent of the law's.
fn plate_on_boxes(description: &Description) -> Option<Modal> {
    let under = description.body.plate_box()?;
    let (grid, axis) = (under.grid(ORDER), under.axis);
    let (_, displacement) = plate(&grid, Lame::new(1.0, description.poisson_ratio), axis).ok()?;
    let [x, y, z] = [0, 1, 2].map(|k| &grid.axes[k].nodes_m[..]);
    // The clamped end of a beam and the bottom of a block are hidden, and so is the face under the plate.
    let faces: &[Face] = match axis {
        0 => &[Face::Top, Face::Bottom, Face::Front, Face::Back],
        _ => &[Face::Left, Face::Right, Face::Front, Face::Back],
    };
    let skin = Skin::boxed(x, y, z, faces);
    let half_m = [x, y, z].map(|nodes| 0.5 * (nodes[nodes.len() - 1] - nodes[0]));
    let thick_m = THICKNESS * half_m[1];
    let mut tool_half_m = half_m;
    tool_half_m[axis] = 0.5 * thick_m;
    let nearest = |nodes: &[f64], at: f64| nodes.partition_point(|node| *node < at - 1.0e-12);
    let node_at = |at: DVec3| grid.node([nearest(x, at.x), nearest(y, at.y), nearest(z, at.z)]);
    Some(Modal {
        displacement: skin.places_m.iter().map(|at| columns(&displacement, node_at(*at))).collect(),
        skin,
        pressure: Vec::new(),
        tool: (Form::Box, tool_half_m),
        tool_centre_m: DVec3::AXES[axis] * (0.5 * thick_m),
    })
}

/// Computes the picture of a punch.
fn punch_modes(
    description: &Description,
    mesh: Option<&Mesh>,
    outline: Outline,
    bond: Bond,
) -> Option<Modal> {
    let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: description.poisson_ratio };
    let (_, loads) = punch(&solid, None, outline, bond, FINENESS).ok()?;
    let extent_m = outline.extent_m();
    let focus = Focus { at_m: DVec3::ZERO, width_m: 0.7 * extent_m };
    let skin = match mesh {
        Some(mesh) => Skin::of_mesh(mesh).0,
        None => skin_of(description.body, focus, STEPS, extent_m),
    };
    let height_m = height_m(description.body, mesh);
    let field = Loaded::new(&solid, &loads, outline, bond);
    let (displacement, pressure) =
        skin.places_m.iter().map(|at| field.at(*at, free_share(height_m, at.z))).unzip();
    let thick_m = THICKNESS * extent_m;
    let form = if matches!(outline, Outline::Round { .. }) { Form::Cylinder } else { Form::Box };
    Some(Modal {
        skin,
        displacement,
        pressure,
        tool: (form, [extent_m, extent_m, 0.5 * thick_m]),
        tool_centre_m: DVec3::Z * (0.5 * thick_m),
    })
}

/// Half-space under the loads of a punch.
struct Loaded<'a> {
    solid: &'a HalfSpace,
    loads: &'a Loads,
    outline: Outline,
    bond: Bond,
    centres_m: Vec<DVec3>,
    areas_m2: Vec<f64>,
}

impl<'a> Loaded<'a> {
    fn new(solid: &'a HalfSpace, loads: &'a Loads, outline: Outline, bond: Bond) -> Self {
        let mean = |corners: &Vec<[f64; 2]>| {
            corners.iter().map(|c| DVec3::new(c[0], c[1], 0.0)).sum::<DVec3>() / corners.len() as f64
        };
        let area = |corners: &Vec<[f64; 2]>| {
            let next = corners.iter().cycle().skip(1);
            0.5 * corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>()
        };
        let centres_m = loads.cells_m.iter().map(mean).collect();
        Self { solid, loads, outline, bond, centres_m, areas_m2: loads.cells_m.iter().map(area).collect() }
    }

    fn is_covered(&self, at: DVec3) -> bool {
        let on_plane = at.z > -1.0e-9;
        on_plane
            && match self.outline {
                Outline::Round { radius_m } => at.truncate().length() <= radius_m,
                Outline::Square { half_m } => at.truncate().abs().max_element() <= half_m,
            }
    }

    /// Returns the displacement, scaled by `share`, and the pressure at a place, under each mode.
    fn at(&self, at: DVec3, share: f64) -> ([DVec3; MODES], [f64; MODES]) {
        let mut displacement = [DVec3::ZERO; MODES];
        for ((corners, centre_m), (forces, area_m2)) in
            self.loads.cells_m.iter().zip(&self.centres_m).zip(self.loads.forces.iter().zip(&self.areas_m2))
        {
            let block = if at.z > -1.0e-9 {
                let corners: Vec<[f64; 2]> = corners.iter().map(|c| [c[0] - at.x, c[1] - at.y]).collect();
                self.solid.polygon(&corners).map(|row| row.map(|u| u / area_m2))
            } else {
                self.solid.field((at - *centre_m).to_array()).displacement.map(|row| row.map(|u| u.value))
            };
            let matrix = DMat3::from_cols_array_2d(&block).transpose();
            for (mode, moved) in displacement.iter_mut().enumerate() {
                *moved += matrix * DVec3::from_array([0, 1, 2].map(|axis| forces[axis][mode])) * share;
            }
        }
        if !self.is_covered(at) {
            return (displacement, [0.0; MODES]);
        }
        // Set the covered surface to the punch's displacement where bonded; the sum above is exact at cell centres only.
        for axis in (0..3).filter(|axis| self.bond == Bond::Bonded || *axis == 2) {
            for (mode, moved) in displacement.iter_mut().enumerate() {
                let rigid = match mode {
                    0..3 => f64::from(u8::from(mode == axis)),
                    _ if (mode - 3) / 3 == axis => at[(mode - 3) % 3],
                    _ => 0.0,
                };
                moved[axis] = rigid;
            }
        }
        let nearest = self
            .centres_m
            .iter()
            .enumerate()
            .min_by(|(_, a), (_, b)| a.distance_squared(at).total_cmp(&b.distance_squared(at)));
        let pressure = nearest.map_or([0.0; MODES], |(cell, _)| {
            self.loads.forces[cell][2].map(|force| -force / self.areas_m2[cell])
        });
        (displacement, pressure)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::prepare::sphere_on_half_space;
    use crate::remainder::Resolution;
    use crate::sphere::{Patch, Problem};

    #[test]
    fn the_rim_of_hertzs_contact_is_smooth_and_far_away_it_is_boussinesqs() {
        assert!((outside(1.0) - 1.0).abs() < 1.0e-15);
        // u = (1 - nu2) F / (pi E r) with F = 4/3 E* a d, over d/2 at the rim: 8 / (3 pi x).
        assert!((outside(50.0) * 50.0 * 3.0 * PI / 8.0 - 1.0).abs() < 1.0e-3, "{}", outside(50.0));
        for (a, b) in [(1.0, 1.1), (1.1, 2.0), (2.0, 9.0)] {
            assert!(outside(a) > outside(b));
        }
    }

    /// The drawn contact beside the solved one: nothing in the sphere, and the same radius within a cell.
    #[test]
    fn the_contact_is_as_large_as_the_one_that_is_solved() {
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio: 0.3 };
        let rings = 10;
        let patch = Patch::new(&solid, rings);
        let mut before = None;
        for share in [0.05, 0.2, 0.5, 0.9] {
            let cell_m = 1.25 * contact_radius_m(1.0, share) / f64::from(rings);
            let problem = Problem { radius_m: 1.0, depth_m: share, cell_m, on_face: &[], smooth: &[] };
            let contact = patch.solve(&problem, before.as_ref()).expect("a solution");
            let drawn = contact_radius_m(1.0, share);
            assert!((contact.reach * cell_m - drawn).abs() < 1.5 * cell_m, "{share}: {}", contact.reach);
            before = Some(contact);
        }
    }

    #[test]
    fn the_surface_goes_round_the_sphere_and_its_pressure_is_the_force() {
        let atlas = sphere_on_half_space(0.3, 0.01).expect("a law").atlas;
        let description = Description {
            body: Body::HalfSpace,
            tool: Tool::Sphere { radius_m: 0.01 },
            poisson_ratio: 0.3,
            resolution: Resolution::QUICK,
        };
        let mut drawing = Drawing::new(&description, None).expect("nothing to solve");
        for depth_m in [0.0005, 0.002, 0.008, 0.02] {
            let centre_m = DVec3::new(0.004, -0.003, 0.01 - depth_m);
            let answer = atlas.answer(centre_m.to_array());
            let shape = drawing.sphere(&atlas, centre_m, &answer, 1.0e4);
            assert_eq!(shape.check(), Ok(()));
            let at = |corner: u32| shape.surface.vertices[corner as usize];
            let mut sum_n = 0.0;
            for triangle in &shape.surface.triangles {
                let [a, b, c] = triangle.map(|corner| DVec3::from_array(at(corner).position_m));
                let area_m2 = 0.5 * (b - a).cross(c - a).z;
                sum_n += area_m2 * triangle.map(|corner| at(corner).value * 1.0e3).iter().sum::<f64>() / 3.0;
            }
            for vertex in &shape.surface.vertices {
                let distance_m = DVec3::from_array(vertex.position_m).distance(centre_m);
                assert!(distance_m > 0.01 * (1.0 - 1.0e-9), "{depth_m}: a corner is inside");
            }
            let force_n = -answer.energy.slope[2] * 1.0e4;
            // The rim of a root on triangles of a tenth of the radius.
            assert!((sum_n / force_n - 1.0).abs() < 0.05, "{depth_m}: {sum_n} N, {force_n} N");
        }
    }
}
