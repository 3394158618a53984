//! Picture of a world. Not real-time.

use crate::file::World;
use crate::form::Form;
use crate::simulation::Simulation;
use flotor_hal::{DVec3, Form as Drawn, Part, Pose, Primitive, Shape};

/// Half the side of a drawn plane, m.
const PLANE_M: f64 = 0.1;

/// Draws bodies and tool of a handle.
pub(crate) fn draw(world: &World, simulation: &Simulation, handle: &Pose, shape: &mut Shape) {
    let primitives = &mut shape.primitives;
    primitives.clear();
    for (index, body) in world.bodies.iter().enumerate() {
        let Some(pose) = simulation.bodies().pose(index) else { continue };
        for part in &body.parts {
            push(primitives, Part::Body, &part.form, placed(&pose, &part.place));
        }
    }
    if handle.is_finite() {
        push(primitives, Part::Tool, &world.tool.form, placed(handle, &world.tool.place));
    }
}

fn placed(holder: &Pose, place: &Pose) -> Pose {
    let position_m = holder.position() + holder.orientation() * place.position();
    Pose::new(position_m, holder.orientation() * place.orientation())
}

fn push(primitives: &mut Vec<Primitive>, part: Part, form: &Form, pose: Pose) {
    match *form {
        Form::Plane => primitives.push(Primitive::new(Drawn::Plane, part, pose, [PLANE_M, PLANE_M, 0.0])),
        Form::Ball { radius_m } => primitives.push(Primitive::sphere(part, pose, radius_m)),
        Form::Box { half_m } => primitives.push(Primitive::new(Drawn::Box, part, pose, half_m)),
        Form::Capsule { radius_m, half_m } => {
            primitives.push(Primitive::new(Drawn::Cylinder, part, pose, [radius_m, radius_m, half_m]));
            for end_m in [-half_m, half_m] {
                let centre_m = pose.position() + pose.orientation() * (DVec3::Z * end_m);
                primitives.push(Primitive::sphere(part, Pose::new(centre_m, pose.orientation()), radius_m));
            }
        }
    }
}
