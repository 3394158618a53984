//! Plugin of the wall: parameters, and the contact state of each handle.

use crate::proxy::Proxy;
use crate::shape::Shape;
use crate::surface::Surface;
use flotor_hal::{
    self as hal, ActiveRegion, ActiveRegionModel, Choices, Contact, ContactSet, ContactSetModel, DQuat,
    DVec3, Demand, ForceModel, Form, Input, MAX_PORTS, Memory, ModelInfo, Output, Parameter, Part, Pose,
    Primitive, Refusal, SetParameterError, Settings, ShapeModel, SoftRange, SoftRangeModel, StepStatus,
    WorldModel, Wrench, choices,
};

/// Workspace limit along each axis, m; a position beyond it is limited to the edge, with status `Clamped`.
const REACH_M: f64 = 1.0;

/// Half-extent of the drawn part of a plane, m: a plane is infinite.
const DRAWN_HALF_M: f64 = 0.03;
/// Radius of the drawn balls at handle and proxy, m.
const DRAWN_HANDLE_M: f64 = 1.5e-3;

const SHAPES: Choices = choices!["plane", "sphere", "box"];

/// Stiff wall, sphere or box; the handle is a point.
pub struct Wall {
    shape: Shape,
    size_mm: f64,
    height_m: f64,
    surface: Surface,
    /// Proxy of the handle at each port.
    proxies: [Proxy; MAX_PORTS],
    /// Proxy for the drawing, which follows the drawn poses instead of the ticks.
    drawn_proxy: Proxy,
    drawn: hal::Shape,
}

hal::restorable!(Wall { proxies } without { shape, size_mm, height_m, surface, drawn_proxy, drawn });

/// Returns the output at a handle with its proxy on a surface of this shape, whose top is `height_m` above home.
#[inline]
fn touch(proxy: &mut Proxy, (shape, surface, height_m): (&Shape, &Surface, f64), input: &Input) -> Output {
    let velocity_m_per_s = input.twist.linear();
    if !input.pose.is_finite() || !velocity_m_per_s.is_finite() {
        return Output::new(Wrench::ZERO, 0.0, StepStatus::InvalidInput);
    }
    let position_m = input.pose.position();
    let reached_m = position_m.clamp(DVec3::splat(-REACH_M), DVec3::splat(REACH_M));
    let pull = proxy.follow(shape, surface, reached_m - DVec3::Z * height_m, velocity_m_per_s);
    let status = if reached_m == position_m { StepStatus::Ok } else { StepStatus::Clamped };
    Output::new(Wrench::from_force(pull.force_n), pull.energy_j, status)
}

impl ForceModel for Wall {
    const INFO: ModelInfo = ModelInfo::new("wall", "Wall", "A stiff wall, sphere or box with friction")
        .serving(Demand::ALL)
        .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = &[
        Parameter::real("stiffness_n_per_m", "N/m", 0.0, 1.0e6, 2000.0, "Stiffness of the surface").live(),
        Parameter::real(
            "damping_ns_per_m",
            "N s/m",
            0.0,
            1000.0,
            0.0,
            "Damping along the normal, in contact",
        )
        .live(),
        Parameter::real("friction", "1", 0.0, 10.0, 0.0, "Coefficient of friction").live(),
        Parameter::choice("shape", SHAPES, 0, "Shape of the solid: plane (half-space), sphere, box (cube)"),
        Parameter::real(
            "size_mm",
            "mm",
            0.1,
            1000.0,
            10.0,
            "Radius of the sphere, or half the edge of the box; no effect with a plane",
        ),
        Parameter::real("height_mm", "mm", -100.0, 100.0, 0.0, "Height of the top of the solid above home"),
    ];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let size_mm = settings.number_or_default("size_mm");
        let half_m = size_mm * 1.0e-3;
        Ok(Self {
            shape: match settings.choice_or_default("shape") {
                1 => Shape::Sphere { radius_m: half_m },
                2 => Shape::Cube { half_m },
                _ => Shape::Plane,
            },
            size_mm,
            height_m: settings.number_or_default("height_mm") * 1.0e-3,
            surface: Surface {
                stiffness_n_per_m: settings.number_or_default("stiffness_n_per_m"),
                damping_ns_per_m: settings.number_or_default("damping_ns_per_m"),
                friction: settings.number_or_default("friction"),
            },
            proxies: [Proxy::default(); MAX_PORTS],
            drawn_proxy: Proxy::default(),
            drawn: hal::Shape::default(),
        })
    }

    fn step(&mut self, input: &Input) -> Output {
        let Self { shape, surface, height_m, proxies: [proxy, ..], .. } = self;
        touch(proxy, (shape, surface, *height_m), input)
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        match index {
            0 => self.surface.stiffness_n_per_m = value,
            1 => self.surface.damping_ns_per_m = value,
            2 => self.surface.friction = value,
            _ => return Err(SetParameterError::Fixed),
        }
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        match index {
            0 => self.surface.stiffness_n_per_m,
            1 => self.surface.damping_ns_per_m,
            2 => self.surface.friction,
            3 => match self.shape {
                Shape::Plane => 0.0,
                Shape::Sphere { .. } => 1.0,
                Shape::Cube { .. } => 2.0,
            },
            4 => self.size_mm,
            5 => self.height_m * 1.0e3,
            _ => f64::NAN,
        }
    }

    fn reset(&mut self) {
        self.proxies = [Proxy::default(); MAX_PORTS];
    }
}

impl WorldModel for Wall {
    /// Each handle has a proxy of its own: a rigid wall carries nothing from one contact to another.
    fn step_ports(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        let Self { shape, surface, height_m, proxies, .. } = self;
        for ((proxy, input), output) in proxies.iter_mut().zip(inputs).zip(outputs) {
            *output = touch(proxy, (shape, surface, *height_m), input);
        }
    }
}

impl ActiveRegionModel for Wall {
    /// A sphere acts inside only and has no state outside. Plane and cube have no bounded region: the plane is
    /// infinite, the cube stores the side of the handle.
    fn active_region(&self) -> ActiveRegion {
        match self.shape {
            Shape::Sphere { radius_m } => {
                ActiveRegion::sphere([0.0, 0.0, self.height_m - radius_m], radius_m)
            }
            Shape::Plane | Shape::Cube { .. } => ActiveRegion::EVERYWHERE,
        }
    }
}

impl ContactSetModel for Wall {
    /// Returns the plane under the handle: of the face through which it entered, or that it faces from outside.
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let position_m = input.pose.position();
        let reached_m = position_m.clamp(DVec3::splat(-REACH_M), DVec3::splat(REACH_M));
        let Surface { stiffness_n_per_m, damping_ns_per_m, friction } = self.surface;
        if !input.pose.is_finite() || stiffness_n_per_m == 0.0 {
            return ContactSet::NONE;
        }
        let above_top_m = reached_m - DVec3::Z * self.height_m;
        let [proxy, ..] = &mut self.proxies;
        proxy.follow(&self.shape, &self.surface, above_top_m, DVec3::ZERO);
        let place = match proxy.contact() {
            Some(proxy) => self.shape.nearest(above_top_m, proxy.normal),
            None => self.shape.facing(above_top_m),
        };
        let input = Input { pose: Pose::new(reached_m, input.pose.orientation()), ..*input };
        let gap_m = (above_top_m - place.point_m).dot(place.normal);
        let contact = Contact::of_handle(&input, place.normal, gap_m, stiffness_n_per_m);
        ContactSet::at(&input)
            .with(contact.with_damping(damping_ns_per_m).with_friction(friction, stiffness_n_per_m))
    }
}

impl ShapeModel for Wall {
    /// Draws the solid, the handle, and, while the handle is inside, the proxy.
    fn shape(&mut self, input: &Input) -> &hal::Shape {
        let (form, half_sides_m) = match self.shape {
            Shape::Plane => (Form::Plane, [DRAWN_HALF_M, DRAWN_HALF_M, 0.0]),
            Shape::Sphere { radius_m } => (Form::Sphere, [radius_m; 3]),
            Shape::Cube { half_m } => (Form::Box, [half_m; 3]),
        };
        let above_top_m = input.pose.position() - DVec3::Z * self.height_m;
        self.drawn_proxy.follow(&self.shape, &self.surface, above_top_m, DVec3::ZERO);
        let at = |point_m: DVec3| Pose::new(point_m + DVec3::Z * self.height_m, DQuat::IDENTITY);
        let primitives = &mut self.drawn.primitives;
        primitives.clear();
        primitives.push(Primitive::new(form, Part::Body, at(self.shape.centre_m()), half_sides_m));
        primitives.push(Primitive::sphere(Part::Tool, input.pose, DRAWN_HANDLE_M));
        if let Some(proxy) = self.drawn_proxy.contact() {
            primitives.push(Primitive::sphere(Part::Tool, at(proxy.point_m), DRAWN_HANDLE_M));
        }
        &self.drawn
    }
}

impl SoftRangeModel for Wall {
    /// Dry metal on metal has 0.15, rubber on asphalt 1; the default limits around zero would end below a half.
    const SOFT_RANGES: &'static [SoftRange] = &[SoftRange::new("friction", 0.0, 1.5, 0.01)];
}

flotor_hal::export_model!(Wall, active_region, contact_set, shape, snapshot, soft_range, world);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn soft_ranges_are_of_parameters_and_legal() {
        for range in Wall::SOFT_RANGES {
            let parameter = Wall::PARAMETERS.iter().find(|one| one.id() == range.id()).expect("one of ours");
            let legal = range.within(parameter).expect("a range of numbers");
            assert_eq!((legal.min(), legal.max()), (range.min(), range.max()));
        }
    }
}
