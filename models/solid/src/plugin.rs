//! Plugin of the solid: parameters, the selected law, and the friction of one handle.

use crate::description::{Description, Tool};
use crate::drawing::Drawing;
use crate::friction::Friction;
use crate::law::{Law, no_mesh};
use crate::material::{self, Material};
use crate::mesh::Mesh;
use crate::parameters::{BodyChoice, Origin, SCHEMA, Unit, YOUNGS_MODULUS, resolve};
use crate::several::{self, MAX_SPHERES};
use crate::{cache, gmsh};
use flotor_hal::{
    DVec3, Demand, Detail, DetailsModel, ForceModel, Input, Memory, ModelInfo, Output, Parameter, Pose,
    Refusal, SetParameterError, Settings, Shape, ShapeModel, StepStatus, VariantInfo, VariantModel, Wrench,
    read_file, read_text, restorable, text_from_bytes,
};
use std::path::Path;

/// Workspace limit along each axis, m; a position beyond it is limited to the edge, with status `Clamped`.
const REACH_M: f64 = 10.0;

/// Tolerance of an orientation's squared length; equals that of the spring.
const UNIT_NORM_TOLERANCE: f64 = 1.0e-6;

const DETAILS: &[Detail] = &[
    Detail::number("depth_m", "m", "Penetration depth of the sphere"),
    Detail::number("contacts", "1", "Number of spheres in contact"),
    Detail::number("mesh_error", "1", "Estimated relative error of the stiffness due to the mesh"),
];

/// Elastic solid with the tool that touches it.
pub struct Solid {
    law: Law,
    mesh_error: f64,
    /// Friction of each sphere.
    friction: [Friction; MAX_SPHERES],
    /// True once the centre was outside a body that may be touched anywhere; before, nothing is felt.
    was_outside: bool,
    depth_m: f64,
    contacts: f64,
    parameters: [f64; SCHEMA.len()],
    description: Description,
    mesh: Option<Mesh>,
    /// Created for the first picture.
    drawing: Option<Drawing>,
    nothing: Shape,
}

restorable!(Solid { friction, was_outside, depth_m, contacts } without {
    law, mesh_error, parameters, description, mesh, drawing, nothing
});

/// Maximum size of a mesh file, bytes: beyond any body that can be solved for.
const MOST_MESH_BYTES: u64 = 1 << 30;

/// Mesh of `body = "file"`, with the hash of all that was read, and the materials of its physical volumes.
struct Read {
    mesh: Mesh,
    digest: u64,
    materials: Vec<Material>,
}

/// Reads the mesh of `body = "file"`; `None` for other bodies. Not real-time.
///
/// # Errors
/// A [`Refusal`] that names the file, the place and the remedy.
fn read_mesh(settings: &Settings<'_>, common: Material) -> Result<Option<Read>, Refusal> {
    let file = settings.text("file");
    let texts = ["fixed_face", "touched_face", "materials"].map(|id| settings.text(id));
    let origin = Origin::of(settings, "origin");
    if BodyChoice::of(settings, "body") != BodyChoice::File {
        let stray = file.is_some() || texts.iter().any(Option::is_some) || origin == Origin::Body;
        let refusal = "`file`, `fixed_face`, `touched_face`, `materials` and origin = \"body\" are only for a mesh: \
                       set body = \"file\"";
        return if stray { Err(Refusal::parameter(refusal)) } else { Ok(None) };
    }
    let path = file.ok_or_else(no_mesh)?;
    let sizes = ["size_x_mm", "size_y_mm", "size_z_mm"];
    if let Some(id) = sizes.into_iter().find(|id| settings.number(id).is_some()) {
        return Err(Refusal::parameter(format!("`{id}`: a mesh has its own size; omit this parameter")));
    }
    if origin == Origin::Home && texts[2].is_some() {
        return Err(Refusal::unsupported("`materials` needs origin = \"body\": set it, or omit `materials`"));
    }
    let bytes = read_file(Path::new(path), MOST_MESH_BYTES).map_err(|error| {
        Refusal::resource(format!(
            "{path}: cannot read the mesh: {error}; check the path and its permissions"
        ))
    })?;
    let fixed = texts[0].unwrap_or("fixed");
    let wrong = |problem: &dyn std::fmt::Display| Refusal::resource(format!("{path}: {problem}"));
    // Accept malformed text here: the reader reports it with its line.
    let text = text_from_bytes(bytes.clone()).or_else(|_| gmsh::to_text(&bytes)).map_err(|p| wrong(&p))?;
    let mut parts = gmsh::read(&text).map_err(|problem| wrong(&problem))?;
    let unit = Unit::of(settings, "unit");
    if unit == Unit::Millimetre {
        parts.nodes_m.as_flattened_mut().iter_mut().for_each(|c| *c *= 1.0e-3);
    }
    let mesh = match origin {
        Origin::Home => Mesh::new(parts, fixed, texts[1].unwrap_or("touched")),
        Origin::Body => Mesh::in_place(parts, fixed, texts[1]),
    };
    let mesh = mesh.map_err(|problem| wrong(&problem))?;
    let materials = match texts[2] {
        Some(file) => read_text(Path::new(file), "the materials")
            .and_then(|text| material::parse(&text, &mesh.regions, common))
            .map_err(|problem| Refusal::parameter(problem.in_file(file)))?,
        None => vec![common; mesh.regions.len()],
    };
    let named =
        [&bytes[..], b"\0", fixed.as_bytes(), b"\0", texts[1].unwrap_or_default().as_bytes()].concat();
    let digest = cache::digest(&named) ^ u64::from(unit == Unit::Millimetre);
    Ok(Some(Read { mesh, digest, materials }))
}

/// Returns the status of several spheres. `Clamped` (too deep) has priority over `NotConverged`, and this over `OutOfDomain`.
fn worse(status: StepStatus, answer: &several::Answer, is_too_deep: bool) -> StepStatus {
    if status != StepStatus::Ok {
        status
    } else if is_too_deep {
        StepStatus::Clamped
    } else if !answer.is_settled {
        StepStatus::NotConverged
    } else if answer.is_extrapolated {
        StepStatus::OutOfDomain
    } else {
        status
    }
}

impl Solid {
    fn forget_details(&mut self) {
        (self.depth_m, self.contacts) = (f64::NAN, f64::NAN);
    }
}

impl ForceModel for Solid {
    const INFO: ModelInfo =
        ModelInfo::new("solid", "Solid", "An elastic solid, touched with a sphere, a punch or a plate")
            .serving(Demand::ALL)
            .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let parameters = resolve(settings);
        let value = |id: &str| SCHEMA.iter().position(|p| p.id() == id).map_or(f64::NAN, |i| parameters[i]);
        let common =
            Material { youngs_modulus_pa: parameters[YOUNGS_MODULUS], poisson_ratio: value("poisson_ratio") };
        let read = read_mesh(settings, common)?;
        let description = Description::new(settings, value, read.as_ref().map_or(0, |read| read.digest))?;
        let (law, mesh_error) = match &read {
            Some(Read { mesh, materials, .. }) if Origin::of(settings, "origin") == Origin::Body => {
                let relative = |m: &Material| Material {
                    youngs_modulus_pa: m.youngs_modulus_pa / common.youngs_modulus_pa,
                    ..*m
                };
                let materials: Vec<Material> = materials.iter().map(relative).collect();
                (description.prepare_anywhere(mesh, &materials)?, f64::NAN)
            }
            _ => description.prepare(read.as_ref().map(|read| &read.mesh))?,
        };
        let mesh = read.map(|read| read.mesh);
        let reach_m = match description.tool {
            Tool::Sphere { radius_m } | Tool::Spheres { radius_m, .. } => radius_m,
            _ => 0.0,
        };
        let friction =
            Friction::new(settings.number_or_default("friction"), description.poisson_ratio, reach_m);
        Ok(Self {
            law,
            mesh_error,
            friction: [friction; MAX_SPHERES],
            was_outside: false,
            depth_m: f64::NAN,
            contacts: f64::NAN,
            parameters,
            description,
            mesh,
            drawing: None,
            nothing: Shape::default(),
        })
    }

    fn step(&mut self, input: &Input) -> Output {
        let norm_error = input.pose.orientation().length_squared() - 1.0;
        // NaN fails the test too.
        if !(input.pose.is_finite() && norm_error.abs() < UNIT_NORM_TOLERANCE) {
            self.forget_details();
            return Output::new(Wrench::ZERO, f64::NAN, StepStatus::InvalidInput);
        }
        let position_m = input.pose.position();
        let reached_m = position_m.clamp(DVec3::splat(-REACH_M), DVec3::splat(REACH_M));
        let mut status = if reached_m == position_m { StepStatus::Ok } else { StepStatus::Clamped };
        let modulus = self.parameters[YOUNGS_MODULUS];
        let (wrench, energy_j) = match &self.law {
            Law::Bonded(patch) => {
                let (wrench, energy_j) = patch.answer(reached_m, input.pose.orientation(), input.demand);
                (Wrench::new(wrench.force() * modulus, wrench.torque() * modulus), energy_j * modulus)
            }
            Law::Sphere(atlas) => {
                let centre_m = reached_m + DVec3::Z * atlas.radius_m;
                let answer = atlas.answer(centre_m.to_array());
                self.depth_m = answer.depth_m;
                self.contacts = f64::from(u8::from(answer.depth_m > 0.0));
                if answer.depth_m > atlas.deepest_m {
                    status = StepStatus::Clamped;
                } else if answer.is_extrapolated && status == StepStatus::Ok {
                    status = StepStatus::OutOfDomain;
                }
                let normal_n = DVec3::from_array(answer.energy.slope) * -modulus;
                let rubbing = self.friction[0].follow(reached_m, normal_n, modulus);
                (Wrench::from_force(normal_n + rubbing.0), answer.energy.value * modulus + rubbing.1)
            }
            Law::Anywhere(law) => {
                let answer = law.answer(reached_m.to_array());
                self.depth_m = answer.depth_m;
                self.contacts = f64::from(u8::from(answer.depth_m > 0.0));
                self.mesh_error = answer.error;
                self.was_outside |= answer.depth_m <= law.radius_m;
                if !(self.was_outside && answer.is_in_domain(law.radius_m)) && status == StepStatus::Ok {
                    status = StepStatus::OutOfDomain;
                }
                if self.was_outside {
                    let normal_n = DVec3::from_array(answer.energy.slope) * -modulus;
                    let rubbing = self.friction[0].follow(reached_m, normal_n, modulus);
                    (Wrench::from_force(normal_n + rubbing.0), answer.energy.value * modulus + rubbing.1)
                } else {
                    (Wrench::ZERO, 0.0)
                }
            }
            Law::Spheres(spheres) => {
                let answer = spheres.answer(reached_m, input.pose.orientation());
                let depths_m = &answer.depths_m[..spheres.count()];
                self.depth_m = depths_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                self.contacts = depths_m.iter().map(|&depth_m| f64::from(u8::from(depth_m > 0.0))).sum();
                status = worse(status, &answer, self.depth_m > spheres.atlas.deepest_m);
                let home_m = reached_m + DVec3::Z * spheres.atlas.radius_m;
                let (mut rubbing_n, mut rubbing_nm, mut rubbing_j) = (DVec3::ZERO, DVec3::ZERO, 0.0);
                for (i, friction) in self.friction.iter_mut().enumerate().take(spheres.count()) {
                    let centre_m = answer.centres_m[i];
                    let (force_n, energy_j) =
                        friction.follow(centre_m, answer.forces_n[i] * modulus, modulus);
                    rubbing_n += force_n;
                    rubbing_nm += (centre_m - home_m).cross(force_n);
                    rubbing_j += energy_j;
                }
                let force_n = answer.wrench.force() * modulus + rubbing_n;
                let torque_nm = answer.wrench.torque() * modulus + rubbing_nm;
                (Wrench::new(force_n, torque_nm), answer.energy_j * modulus + rubbing_j)
            }
        };
        Output::new(wrench, energy_j, status)
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        if index != YOUNGS_MODULUS {
            return Err(SetParameterError::Fixed);
        }
        self.parameters[index] = value;
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }

    fn reset(&mut self) {
        self.friction.iter_mut().for_each(Friction::release);
        self.was_outside = false;
        self.forget_details();
    }
}

impl ShapeModel for Solid {
    /// Draws the deformed surface with the pressure of the contact (under a plate, the displacement), and the tool. The
    /// first picture of a punch or a plate takes up to a second.
    fn shape(&mut self, input: &Input) -> &Shape {
        let pose = if input.pose.is_finite() { input.pose } else { Pose::HOME };
        let mesh = self.mesh.as_ref();
        if self.drawing.is_none() {
            self.drawing = Drawing::new(&self.description, mesh);
        }
        let Some(drawing) = &mut self.drawing else { return &self.nothing };
        let reached_m = pose.position().clamp(DVec3::splat(-REACH_M), DVec3::splat(REACH_M));
        let modulus = self.parameters[YOUNGS_MODULUS];
        match &self.law {
            Law::Bonded(_) => drawing.bonded(&Pose::new(reached_m, pose.orientation()), modulus),
            Law::Sphere(atlas) => {
                let centre_m = reached_m + DVec3::Z * atlas.radius_m;
                let answer = atlas.answer(centre_m.to_array());
                drawing.sphere(atlas, centre_m, &answer, modulus)
            }
            Law::Anywhere(law) => drawing.ball(law.radius_m, reached_m),
            Law::Spheres(spheres) => {
                let answer = spheres.answer(reached_m, pose.orientation());
                drawing.spheres(spheres, &answer, modulus)
            }
        }
    }
}

impl VariantModel for Solid {
    /// Returns path-dependent memory for a coefficient of friction above zero and for a body that has an inside, else a stateless
    /// law.
    fn variant_info(&self) -> VariantInfo {
        let memory = if self.friction[0].is_smooth() && !matches!(self.law, Law::Anywhere(_)) {
            Memory::Stateless
        } else {
            Memory::PathDependent
        };
        VariantInfo::new(Demand::ALL, memory)
    }
}

impl DetailsModel for Solid {
    const DETAILS: &'static [Detail] = DETAILS;

    fn details(&self, values: &mut [f64]) {
        for (value, number) in values.iter_mut().zip([self.depth_m, self.contacts, self.mesh_error]) {
            *value = number;
        }
    }
}

flotor_hal::export_model!(Solid, variant, details, shape, snapshot);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::anywhere::Anywhere;
    use crate::description::Body;
    use crate::lattice::Lattice;
    use crate::remainder::Resolution;
    use flotor_hal::{DQuat, math};

    const BALL_M: f64 = 0.005;
    const BODY_M: f64 = 0.02;

    /// A round body about the origin, its law written down instead of prepared.
    #[allow(clippy::cast_possible_truncation)] // lengths
    fn round() -> Solid {
        let counts = [34; 3];
        let mut lattice =
            Lattice { low_m: [-0.033; 3], step_m: 0.002, counts, values: vec![0.0; 34 * 34 * 34] };
        let depth_m = |at: [f64; 3]| BALL_M + BODY_M - DVec3::from_array(at).length();
        let depths: Vec<f64> = (0..lattice.values.len()).map(|i| depth_m(lattice.place_m(i))).collect();
        lattice.values = depths.iter().map(|d| d / lattice.step_m).collect();
        let errors = vec![0.01; depths.len()];
        let depths_m = depths.iter().map(|d| *d as f32).collect();
        let law = Anywhere { radius_m: BALL_M, hertz: 0.04, lattice, depths_m, errors };
        let description = Description {
            body: Body::File { digest: 0 },
            tool: Tool::Sphere { radius_m: BALL_M },
            poisson_ratio: 0.3,
            resolution: Resolution::QUICK,
        };
        Solid {
            law: Law::Anywhere(Box::new(law)),
            mesh_error: f64::NAN,
            friction: [Friction::new(0.0, 0.3, BALL_M); MAX_SPHERES],
            was_outside: false,
            depth_m: f64::NAN,
            contacts: f64::NAN,
            parameters: resolve(&Settings::defaults(SCHEMA)),
            description,
            mesh: None,
            drawing: None,
            nothing: Shape::default(),
        }
    }

    fn step(solid: &mut Solid, at_m: DVec3) -> (f64, StepStatus) {
        let output = solid.step(&Input::at_rest(Pose::new(at_m, DQuat::IDENTITY)));
        (output.wrench.force().length(), output.status().expect("a known code"))
    }

    /// Reset, as after a fault or for a new session, is a start too.
    #[test]
    fn a_ball_that_starts_inside_feels_nothing_until_it_was_outside() {
        let mut solid = round();
        let (mut starts, mut felt) = (0, 0);
        for n in 0..1_000_u32 {
            let (turn, rise) = (f64::from(n) * 2.4, 1.0 - 2.0 * (f64::from(n) + 0.5) / 1_000.0);
            let flat = (1.0 - rise * rise).sqrt();
            let (sine, cosine) = math::sin_cos(turn);
            let away = DVec3::new(flat * cosine, flat * sine, rise);
            solid.reset();
            for share in [0.0, 0.3, 0.8, 0.9, 0.5] {
                assert_eq!(step(&mut solid, away * (share * BODY_M)), (0.0, StepStatus::OutOfDomain));
                starts += 1;
            }
            // A centre outside is outside, though the ball overlaps.
            let (force_n, status) = step(&mut solid, away * (BODY_M + 0.4 * BALL_M));
            assert!(force_n > 0.1 && status == StepStatus::Ok, "{force_n} {status:?}");
            let deep = step(&mut solid, away * (0.8 * BODY_M));
            assert!(deep.0 > force_n && deep.1 == StepStatus::OutOfDomain);
            assert_eq!(step(&mut solid, away * (BODY_M + 1.1 * BALL_M)), (0.0, StepStatus::Ok));
            felt += 1;
        }
        assert_eq!((starts, felt), (5_000, 1_000));
    }
}
