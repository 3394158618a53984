//! Plugin of the world: parameters, contacts, picture.

use crate::file::{World, parse};
use crate::simulation::{SHORTEST_STEP_S, Simulation, stable_step_s, stiffest};
use crate::touch::Law;
use crate::{drawing, own};
use flotor_hal::{
    ContactSet, ContactSetModel, ForceModel, Input, Memory, ModelInfo, OutOfRange, Output, Parameter, Pose,
    Refusal, SetParameterError, Settings, Shape, ShapeModel, SoftRange, SoftRangeModel, StepStatus,
    WorldContactsModel, Wrench, read_text,
};
use std::path::Path;

/// World if no file is named.
const DEFAULT: &str = "stack";

const STIFFNESS: usize = 0;
const DAMPING: usize = 1;
const STEP: usize = 3;

/// Parameters of the world.
const SCHEMA: &[Parameter] = &[
    Parameter::real(
        "stiffness_n_per_m",
        "N/m",
        1.0,
        1.0e5,
        500.0,
        "Contact stiffness between a body and a tool that rests flat on it",
    )
    .live(),
    Parameter::real("damping_ns_per_m", "N s/m", 0.0, 1000.0, 4.0, "Contact damping between tool and bodies")
        .live(),
    Parameter::file("file", own::NAMES, "World: a TOML file, or a built-in world (default: stack)"),
    Parameter::real(
        "step_ms",
        "ms",
        0.05,
        10.0,
        1.0,
        "Maximum time step of the bodies; light bodies get a shorter one",
    ),
];

/// World of rigid bodies with a tool in it.
pub struct Touched {
    world: World,
    parameters: [f64; SCHEMA.len()],
    law: Law,
    step_s: f64,
    /// Created anew for the first call after a reset.
    simulation: Option<Simulation>,
    /// World of the pictures, which follows the drawn poses instead of the ticks, and the time of the last one, ns.
    drawn: Option<(Simulation, u64)>,
    shape: Shape,
}

impl ForceModel for Touched {
    const INFO: ModelInfo =
        ModelInfo::new("world", "World", "A world of rigid bodies, touched with a tool; needs [model.field]")
            .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let name = settings.text("file").unwrap_or(DEFAULT);
        let world = match own::text(name) {
            Some(text) => parse(text),
            None => read_text(Path::new(name), "the world").and_then(|text| parse(&text)),
        };
        let world = world.map_err(|wrong| Refusal::parameter(wrong.in_file(name)))?;
        let parameters = std::array::from_fn(|index| settings.number_or_default(SCHEMA[index].id()));
        let ((law, step_s), most) = (law(&world, &parameters), stiffest(&world));
        let is_soft = law.stiffness_n_per_m <= most.stiffness_n_per_m;
        if !is_soft || law.damping_ns_per_m > most.damping_ns_per_m {
            return Err(Refusal::parameter(format!(
                "the lightest body permits at most {:.4} N/m and {:.4} N s/m in steps of {} ms; raise its `mass_g`, or \
                 lower `stiffness_n_per_m` or `damping_ns_per_m`",
                most.stiffness_n_per_m,
                most.damping_ns_per_m,
                SHORTEST_STEP_S * 1.0e3
            )));
        }
        Ok(Self {
            simulation: Some(Simulation::new(&world, 1)),
            world,
            parameters,
            law,
            step_s,
            drawn: None,
            shape: Shape::default(),
        })
    }

    /// Returns no force, with the status `OutOfDomain`: a step of a world is too slow for the loop, and allocates.
    fn step(&mut self, input: &Input) -> Output {
        let is_finite = input.pose.is_finite() && input.twist.is_finite();
        let status = if is_finite { StepStatus::OutOfDomain } else { StepStatus::InvalidInput };
        Output::new(Wrench::ZERO, f64::NAN, status)
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        if ![STIFFNESS, DAMPING].contains(&index) {
            return Err(SetParameterError::Fixed);
        }
        let most = stiffest(&self.world);
        let max = if index == STIFFNESS { most.stiffness_n_per_m } else { most.damping_ns_per_m };
        if value > max {
            return Err(OutOfRange { min: SCHEMA[index].min(), max, value }.into());
        }
        self.parameters[index] = value;
        (self.law, self.step_s) = law(&self.world, &self.parameters);
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }

    fn reset(&mut self) {
        self.simulation = None;
    }
}

/// Returns the law of the parameters, and the step of the bodies, s.
fn law(world: &World, parameters: &[f64; SCHEMA.len()]) -> (Law, f64) {
    let law = Law { stiffness_n_per_m: parameters[STIFFNESS], damping_ns_per_m: parameters[DAMPING] };
    let step_s = stable_step_s(world, &law, parameters[STEP] * 1.0e-3);
    (law, step_s)
}

impl ContactSetModel for Touched {
    /// Moves the world to the time of the input, and returns the planes near the tool.
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let mut sets = [ContactSet::NONE];
        self.contact_sets(std::slice::from_ref(input), &mut sets);
        let [set] = sets;
        set
    }
}

impl WorldContactsModel for Touched {
    /// Moves the world to the time of the inputs with a tool in each hand, and returns the planes near each.
    fn contact_sets(&mut self, inputs: &[Input], sets: &mut [ContactSet]) {
        let Some(first) = inputs.first() else { return };
        let fits = |simulation: &Simulation| simulation.hands() == inputs.len();
        if !self.simulation.as_ref().is_some_and(fits) {
            self.simulation = None;
        }
        let simulation = self.simulation.get_or_insert_with(|| Simulation::new(&self.world, inputs.len()));
        let poses: Vec<Pose> = inputs.iter().map(|input| input.pose).collect();
        simulation.advance(&poses, first.dt_s(), &self.law, self.step_s);
        for (hand, (input, set)) in inputs.iter().zip(sets).enumerate() {
            *set = simulation.contacts(hand, input, &self.law);
        }
    }
}

impl ShapeModel for Touched {
    /// Draws bodies and tool. The world of the pictures moves between them as under the handle of the pictures.
    fn shape(&mut self, input: &Input) -> &Shape {
        let (simulation, last_ns) =
            self.drawn.get_or_insert_with(|| (Simulation::new(&self.world, 1), input.time_ns));
        if input.time_ns < *last_ns {
            // An earlier moment of a recording: from the start.
            (*simulation, *last_ns) = (Simulation::new(&self.world, 1), input.time_ns);
        }
        #[allow(clippy::cast_precision_loss)] // less than a century
        let time_s = (input.time_ns - *last_ns) as f64 * 1.0e-9;
        *last_ns = input.time_ns;
        simulation.advance(&[input.pose], time_s, &self.law, self.step_s);
        drawing::draw(&self.world, simulation, &input.pose, &mut self.shape);
        &self.shape
    }
}

impl SoftRangeModel for Touched {
    /// With a lower stiffness a tool sinks through thin bodies; with a higher one most devices are unstable.
    const SOFT_RANGES: &'static [SoftRange] = &[
        SoftRange::new("stiffness_n_per_m", 50.0, 2000.0, 10.0),
        SoftRange::new("damping_ns_per_m", 0.0, 20.0, 0.5),
    ];
}

flotor_hal::export_model!(Touched, contact_set, shape, soft_range, world_contacts);
