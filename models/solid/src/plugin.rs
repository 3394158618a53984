//! Plugin of the solid: parameters, the selected law, and the friction of one handle.

use crate::description::{Description, Tool};
use crate::drawing::Drawing;
use crate::friction::Friction;
use crate::law::{Law, no_mesh};
use crate::mesh::Mesh;
use crate::parameters::{BodyChoice, SCHEMA, Unit, YOUNGS_MODULUS, resolve};
use crate::several::{self, MAX_SPHERES};
use crate::{cache, gmsh};
use flotor_hal::{
    DVec3, Demand, Detail, DetailsModel, ForceModel, Input, Memory, ModelInfo, Output, Parameter, Pose,
    Refusal, SetParameterError, Settings, Shape, ShapeModel, StepStatus, VariantInfo, VariantModel, Wrench,
    read_file, restorable, text_from_bytes,
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
    depth_m: f64,
    contacts: f64,
    parameters: [f64; SCHEMA.len()],
    description: Description,
    mesh: Option<Mesh>,
    /// Created for the first picture.
    drawing: Option<Drawing>,
    nothing: Shape,
}

restorable!(Solid { friction, depth_m, contacts } without {
    law, mesh_error, parameters, description, mesh, drawing, nothing
});

/// Maximum size of a mesh file, bytes: beyond any body that can be solved for.
const MOST_MESH_BYTES: u64 = 1 << 30;

/// Reads the mesh of `body = "file"` with its hash; `None` for other bodies. Not real-time.
///
/// # Errors
/// A [`Refusal`] that names the file, the place and the remedy.
fn read_mesh(settings: &Settings<'_>) -> Result<Option<(Mesh, u64)>, Refusal> {
    let file = settings.text("file");
    let faces = ["fixed_face", "touched_face"].map(|id| settings.text(id));
    if BodyChoice::of(settings, "body") != BodyChoice::File {
        let stray = [file, faces[0], faces[1]].iter().any(Option::is_some);
        let refusal = "`file`, `fixed_face` and `touched_face` are only for a mesh: set body = \"file\"";
        return if stray { Err(Refusal::parameter(refusal)) } else { Ok(None) };
    }
    let path = file.ok_or_else(no_mesh)?;
    let sizes = ["size_x_mm", "size_y_mm", "size_z_mm"];
    if let Some(id) = sizes.into_iter().find(|id| settings.number(id).is_some()) {
        return Err(Refusal::parameter(format!("`{id}`: a mesh has its own size; omit this parameter")));
    }
    let bytes = read_file(Path::new(path), MOST_MESH_BYTES).map_err(|error| {
        Refusal::resource(format!(
            "{path}: cannot read the mesh: {error}; check the path and its permissions"
        ))
    })?;
    let [fixed, touched] = [faces[0].unwrap_or("fixed"), faces[1].unwrap_or("touched")];
    let wrong = |problem: &dyn std::fmt::Display| Refusal::resource(format!("{path}: {problem}"));
    // Accept malformed text here: the reader reports it with its line.
    let text = text_from_bytes(bytes.clone()).or_else(|_| gmsh::to_text(&bytes)).map_err(|p| wrong(&p))?;
    let mut parts = gmsh::read(&text).map_err(|problem| wrong(&problem))?;
    let unit = Unit::of(settings, "unit");
    if unit == Unit::Millimetre {
        parts.nodes_m.as_flattened_mut().iter_mut().for_each(|c| *c *= 1.0e-3);
    }
    let mesh = Mesh::new(parts, fixed, touched).map_err(|problem| wrong(&problem))?;
    let named = [&bytes[..], b"\0", fixed.as_bytes(), b"\0", touched.as_bytes()].concat();
    Ok(Some((mesh, cache::digest(&named) ^ u64::from(unit == Unit::Millimetre))))
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
        let mesh = read_mesh(settings)?;
        let value = |id: &str| SCHEMA.iter().position(|p| p.id() == id).map_or(f64::NAN, |i| parameters[i]);
        let description = Description::new(settings, value, mesh.as_ref().map_or(0, |(_, digest)| *digest))?;
        let mesh = mesh.map(|(mesh, _)| mesh);
        let (law, mesh_error) = description.prepare(mesh.as_ref())?;
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
            Law::Spheres(spheres) => {
                let answer = spheres.answer(reached_m, pose.orientation());
                drawing.spheres(spheres, &answer, modulus)
            }
        }
    }
}

impl VariantModel for Solid {
    /// Returns path-dependent memory for a coefficient of friction above zero, else a stateless law.
    fn variant_info(&self) -> VariantInfo {
        let memory = if self.friction[0].is_smooth() { Memory::Stateless } else { Memory::PathDependent };
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
