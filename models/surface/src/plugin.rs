//! Implementation of the model contract for the surface.

use crate::material::{self, Material, Own};
use crate::object::Object;
use crate::parameters::{FIRST_LIVE, SCHEMA, reading};
use crate::touch::{Answer, Materials, Touch};
use crate::{built_in, drawing, store};
use flotor_hal::{
    DVec3, Demand, Detail, DetailsModel, ForceModel, Input, Memory, ModelInfo, Output, Parameter, Refusal,
    SetParameterError, Settings, Shape, ShapeModel, SoftRange, SoftRangeModel, StepStatus, Wrench, choices,
    read_file, read_text,
};
use std::path::Path;
use std::sync::Arc;

/// Workspace limit along each axis, m; a position beyond it is limited to the edge, with status `Clamped`.
const REACH_M: f64 = 10.0;
/// Maximum size of a mesh file, bytes: four times the largest binary STL file.
const MOST_BYTES: u64 = 4 << 30;
/// Number of live parameters, the values of the common material.
const LIVE: usize = material::KEYS.len();
/// Object if no file is named.
const DEFAULT: &str = "bumpy-sphere";

const DETAILS: &[Detail] = &[
    Detail::number("depth_m", "m", "Distance between the centres of tool and proxy"),
    Detail::number("contacts", "1", "Number of contacts between ball and surface"),
    Detail::word("friction", choices!["free", "sticks", "slides"], "State of the friction"),
    Detail::number("contact_x_m", "m", "Point of the first contact, x"),
    Detail::number("contact_y_m", "m", "Point of the first contact, y"),
    Detail::number("contact_z_m", "m", "Point of the first contact, z"),
    Detail::number("normal_x", "1", "Direction from the surface to the ball, x"),
    Detail::number("normal_y", "1", "Direction from the surface to the ball, y"),
    Detail::number("normal_z", "1", "Direction from the surface to the ball, z"),
];

/// Smooth surface of a mesh file, and the ball that touches it.
pub struct Touched {
    pub(crate) object: Arc<Object>,
    materials: Materials,
    pub(crate) touch: Touch,
    parameters: [f64; SCHEMA.len()],
    last: Option<Answer>,
    /// Ball of the drawing, which follows the drawn poses instead of the ticks.
    drawn_touch: Touch,
    /// Picture; created on the first request.
    drawn: Option<Shape>,
}

/// Loads the object named by the settings.
fn object(settings: &Settings<'_>) -> Result<Arc<Object>, Refusal> {
    let reading = reading(settings);
    let name = settings.text("file").unwrap_or(DEFAULT);
    if let Some(soup) = built_in::soup(name) {
        return store::of_soup(name, soup, &reading)
            .map_err(|unfit| Refusal::parameter(format!("{name}: {unfit}")));
    }
    let bytes = read_file(Path::new(name), MOST_BYTES).map_err(|error| {
        Refusal::resource(format!(
            "{name}: cannot read the mesh: {error}; check the path and its permissions"
        ))
    })?;
    store::of_file(name, bytes, &reading).map_err(|unfit| Refusal::resource(format!("{name}: {unfit}")))
}

fn own_materials(settings: &Settings<'_>, names: &[String]) -> Result<Vec<Own>, Refusal> {
    let Some(file) = settings.text("materials") else { return Ok(Vec::new()) };
    read_text(Path::new(file), "the materials")
        .and_then(|text| material::parse(&text, names))
        .map_err(|wrong| Refusal::parameter(wrong.in_file(file)))
}

impl ForceModel for Touched {
    const INFO: ModelInfo =
        ModelInfo::new("surface", "Surface", "The smooth surface of a mesh file, touched with a ball")
            .serving(Demand::ALL)
            .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let object = object(settings)?;
        let mut parameters: [f64; SCHEMA.len()] =
            std::array::from_fn(|index| settings.number_or_default(SCHEMA[index].id()));
        if settings.number("kinetic_friction").is_none() {
            parameters[FIRST_LIVE + 3] = parameters[FIRST_LIVE + 2];
        }
        let touch = Touch::new(settings.number_or_default("tool_radius_mm") * 1.0e-3);
        let own = own_materials(settings, &object.names)?;
        let mut model = Self {
            object,
            materials: Materials { common: Material::from_values([0.0; LIVE]), own },
            touch,
            parameters,
            last: None,
            drawn_touch: touch,
            drawn: None,
        };
        model.renew_material();
        Ok(model)
    }

    fn step(&mut self, input: &Input) -> Output {
        self.last = None;
        let velocity_m_per_s = input.twist.linear();
        if !input.pose.is_finite() || !velocity_m_per_s.is_finite() {
            return Output::new(Wrench::ZERO, 0.0, StepStatus::InvalidInput);
        }
        let position_m = input.pose.position();
        let reached_m = position_m.clamp(DVec3::splat(-REACH_M), DVec3::splat(REACH_M));
        let answer = self.touch.step(&self.object.surface, &self.materials, reached_m, velocity_m_per_s);
        self.last = Some(answer);
        let status = if reached_m != position_m {
            StepStatus::Clamped
        } else if answer.is_overlapping {
            StepStatus::OutOfDomain
        } else if answer.is_settled {
            StepStatus::Ok
        } else {
            StepStatus::NotConverged
        };
        Output::new(Wrench::from_force(answer.force_n), answer.energy_j, status)
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        if !(FIRST_LIVE..FIRST_LIVE + LIVE).contains(&index) {
            return Err(SetParameterError::Fixed);
        }
        self.parameters[index] = value;
        self.renew_material();
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }

    fn reset(&mut self) {
        self.touch.reset();
        self.last = None;
    }
}

impl Touched {
    fn renew_material(&mut self) {
        self.materials.common =
            Material::from_values(std::array::from_fn(|i| self.parameters[FIRST_LIVE + i]));
    }
}

impl DetailsModel for Touched {
    const DETAILS: &'static [Detail] = DETAILS;

    fn details(&self, values: &mut [f64]) {
        let mut all = [f64::NAN; DETAILS.len()];
        if let Some(answer) = &self.last {
            #[allow(clippy::cast_precision_loss)] // at most four
            let contacts = answer.contacts as f64;
            (all[0], all[1], all[2]) = (answer.depth_m, contacts, f64::from(answer.friction as u8));
            if let Some((point_m, normal)) = answer.contact {
                all[3..6].copy_from_slice(&point_m.to_array());
                all[6..9].copy_from_slice(&normal.to_array());
            }
        }
        values.iter_mut().zip(all).for_each(|(value, number)| *value = number);
    }
}

impl ShapeModel for Touched {
    /// Draws the mesh, the tool, the proxy, and the contact with its normal, thicker while friction holds the ball.
    fn shape(&mut self, input: &Input) -> &Shape {
        let position_m = if input.pose.is_finite() { input.pose.position() } else { DVec3::ZERO };
        let surface = &self.object.surface;
        let answer = self.drawn_touch.step(surface, &self.materials, position_m, DVec3::ZERO);
        let shape = self.drawn.get_or_insert_with(|| drawing::body(surface));
        let pose = flotor_hal::Pose::new(position_m, flotor_hal::DQuat::IDENTITY);
        drawing::tool(shape, pose, self.touch.radius_m, self.drawn_touch.proxy_m(), &answer);
        shape
    }
}

impl SoftRangeModel for Touched {
    /// Dry metal on metal has 0.15, rubber on asphalt 1.
    const SOFT_RANGES: &'static [SoftRange] = &[
        SoftRange::new("static_friction", 0.0, 1.5, 0.01),
        SoftRange::new("kinetic_friction", 0.0, 1.5, 0.01),
    ];
}

flotor_hal::export_model!(Touched, details, shape, snapshot, soft_range);
