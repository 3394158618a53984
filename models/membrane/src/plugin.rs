//! Plugin of the membrane: parameters and step.

use crate::mesh::{Mesh, Sheet};
use crate::network::{Network, State, Surroundings};
use crate::touch::{SupportPlane, Touch};
use flotor_hal::{
    Contact, ContactSet, ContactSetModel, DQuat, DVec3, ForceModel, Input, MAX_PORTS, Memory, ModelInfo,
    Output, Parameter, Part, Pose, Primitive, Refusal, ScalarField, SetParameterError, Settings, Shape,
    ShapeModel, Sides, SoftRange, SoftRangeModel, StepStatus, Surface, SurfaceVertex, WorldContactsModel,
    WorldModel, Wrench, choices, read_text, restorable,
};
use std::path::Path;

/// Workspace limit along each axis, m; a position beyond it is limited to the edge, with status `Clamped`.
const REACH_M: f64 = 1.0;
/// Longest simulated time between two ticks, s: the network skips the rest of a longer time.
const LONGEST_TIME_S: f64 = 0.02;
/// Maximum number of network steps per millisecond.
const MOST_STEPS_PER_MS: f64 = 100.0;

/// Index of the only live parameter.
const DAMPING: usize = 6;

/// Parameters of the membrane.
const SCHEMA: &[Parameter] = &[
    Parameter::real(
        "nodes_per_side",
        "1",
        3.0,
        200.0,
        17.0,
        "Number of masses along a side of the sheet, whose border is fixed; no effect with `file`",
    ),
    Parameter::real("side_mm", "mm", 1.0, 1000.0, 40.0, "Side length of the sheet; no effect with `file`"),
    Parameter::real("mass_g", "g", 0.01, 1.0e5, 10.0, "Total mass of the sheet"),
    Parameter::real(
        "stiffness_n_per_m",
        "N/m",
        0.1,
        1.0e5,
        200.0,
        "Stiffness of a spring between two masses",
    ),
    Parameter::real(
        "stretch",
        "1",
        0.5,
        3.0,
        1.25,
        "Pretension: ratio of the initial length of a spring to its length without force",
    ),
    Parameter::real("gravity_m_per_s2", "m/s²", 0.0, 30.0, 0.0, "Gravitational acceleration, downwards"),
    Parameter::real("damping_per_s", "1/s", 0.0, 1.0e4, 50.0, "Decay rate of the velocity by drag").live(),
    Parameter::real("ball_radius_mm", "mm", 0.1, 100.0, 5.0, "Radius of the ball at the handle"),
    Parameter::real(
        "contact_n_per_m",
        "N/m",
        1.0,
        1.0e5,
        400.0,
        "Contact stiffness between the ball and a mass",
    ),
    Parameter::file(
        "file",
        choices![],
        "Mesh file instead of the sheet: Wavefront OBJ, coordinates in m, z upwards; the border is fixed",
    ),
];

/// Membrane of masses and springs, touched with a ball.
pub struct Membrane {
    touch: Touch,
    radius_m: f64,
    /// Initial length of the longest spring, m: the scale on which the sheet is no longer linear.
    coarseness_m: f64,
    parameters: [f64; SCHEMA.len()],
    /// State of the last picture, at rest.
    pictured: State,
    /// Centre of the ball in the last picture, m.
    pictured_at_m: Option<DVec3>,
    untouched_m: Vec<DVec3>,
    drawn: Shape,
}

restorable!(Membrane { touch } without {
    radius_m, coarseness_m, parameters, pictured, pictured_at_m, untouched_m, drawn
});

impl Membrane {
    /// Returns the centre of the ball for a position of the handle, m; at home the ball lies on the sheet.
    fn centre_m(&self, handle_m: DVec3) -> DVec3 {
        handle_m + DVec3::Z * self.radius_m
    }

    /// Returns the centre of the ball of each port, m, and whether any input is valid: the ball of another stays where it is.
    fn centres_m(&self, inputs: &[Input]) -> ([DVec3; MAX_PORTS], bool) {
        let mut centres_m = std::array::from_fn(|port| self.touch.centre_m(port));
        let mut is_valid = false;
        for (input, centre_m) in inputs.iter().zip(&mut centres_m) {
            if let Ok((handle_m, _)) = Self::reached(input) {
                (*centre_m, is_valid) = (self.centre_m(handle_m), true);
            }
        }
        (centres_m, is_valid)
    }

    /// Returns the handle's position limited to the workspace, with the status of the step.
    fn reached(input: &Input) -> Result<(DVec3, StepStatus), StepStatus> {
        if !input.pose.is_finite() {
            return Err(StepStatus::InvalidInput);
        }
        let position_m = input.pose.position();
        let reached_m = position_m.clamp(DVec3::splat(-REACH_M), DVec3::splat(REACH_M));
        Ok((reached_m, if reached_m == position_m { StepStatus::Ok } else { StepStatus::Clamped }))
    }
}

impl ForceModel for Membrane {
    const INFO: ModelInfo =
        ModelInfo::new("membrane", "Membrane", "A membrane of masses and springs, touched with a ball")
            .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = SCHEMA;

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let number = |id| settings.number_or_default(id);
        let nodes = number("nodes_per_side");
        if nodes.fract() != 0.0 {
            return Err(Refusal::parameter(format!(
                "`nodes_per_side` is {nodes}, but must be a whole number: it counts masses"
            )));
        }
        let (stiffness_n_per_m, stretch) = (number("stiffness_n_per_m"), number("stretch"));
        let mass_kg = number("mass_g") * 1.0e-3;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 3 to 200
        let mesh = match settings.text("file") {
            None => Mesh::sheet(&Sheet {
                nodes_per_side: nodes as usize,
                side_m: number("side_mm") * 1.0e-3,
                mass_kg,
                stiffness_n_per_m,
                stretch,
            }),
            Some(file) => read_text(Path::new(file), "the mesh")
                .and_then(|text| Mesh::from_obj(&text, mass_kg, stiffness_n_per_m, stretch))
                .map_err(|wrong| Refusal::parameter(wrong.in_file(file)))?,
        };
        let radius_m = number("ball_radius_mm") * 1.0e-3;
        if radius_m < 0.75 * mesh.coarseness_m() {
            return Err(Refusal::parameter(format!(
                "a ball of radius {:.4} mm would fall through between springs of length {:.4} mm; set \
                 `ball_radius_mm` to {:.3} or more, or make the mesh finer{}",
                radius_m * 1.0e3,
                mesh.coarseness_m() * 1.0e3,
                (0.75e6 * mesh.coarseness_m()).ceil() * 1.0e-3,
                if settings.text("file").is_none() { " with `nodes_per_side`" } else { "" }
            )));
        }
        let mut network = Network::new(
            &mesh,
            Surroundings {
                gravity_m_per_s2: number("gravity_m_per_s2"),
                damping_per_s: number("damping_per_s"),
                contact_n_per_m: number("contact_n_per_m"),
            },
        );
        let steps_per_ms = 1.0e-3 / network.longest_step_s();
        if steps_per_ms > MOST_STEPS_PER_MS {
            return Err(Refusal::parameter(format!(
                "the springs are so stiff and the masses so light that a millisecond needs {} steps (at most \
                 {MOST_STEPS_PER_MS}); raise `mass_g`, or lower `stiffness_n_per_m` or `contact_n_per_m`",
                steps_per_ms.ceil()
            )));
        }
        // Under gravity the sheet sags before the first touch.
        if number("gravity_m_per_s2") > 0.0 {
            network.come_to_rest(MOST_SETTLING_STEPS);
            network.activate();
        }
        let parameters = std::array::from_fn(|index| number(SCHEMA[index].id()));
        let coarseness_m = mesh.coarseness_m();
        let pictured = network.state().clone();
        let surface = Surface {
            vertices: vec![SurfaceVertex::default(); mesh.positions_m.len()],
            triangles: mesh.triangles,
            sides: Sides::Both,
            field: ScalarField::new("displacement", "mm"),
        };
        Ok(Self {
            pictured,
            pictured_at_m: None,
            untouched_m: mesh.positions_m,
            drawn: Shape { primitives: Vec::new(), surface },
            touch: Touch::new(network, radius_m, DVec3::Z * radius_m),
            radius_m,
            coarseness_m,
            parameters,
        })
    }

    fn step(&mut self, input: &Input) -> Output {
        let mut output = [Output::default()];
        self.step_ports(std::slice::from_ref(input), &mut output);
        let [output] = output;
        output
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        if index != DAMPING {
            return Err(SetParameterError::Fixed);
        }
        self.parameters[DAMPING] = value;
        self.touch.network_mut().set_damping_per_s(value);
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }

    fn reset(&mut self) {
        self.touch.reset(DVec3::Z * self.radius_m);
    }
}

impl WorldModel for Membrane {
    /// Moves the ball of every port through one network. The ball of an invalid input stays where it is, and its hand feels no
    /// force; without a valid input the network stands still.
    fn step_ports(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        let (centres_m, is_valid) = self.centres_m(inputs);
        let mut forces_n = [DVec3::ZERO; MAX_PORTS];
        if is_valid && let [first, ..] = inputs {
            let centres_m = &centres_m[..inputs.len().min(MAX_PORTS)];
            self.touch.advance_among(centres_m, first.dt_s().min(LONGEST_TIME_S), &mut forces_n);
        }
        for ((input, output), force_n) in inputs.iter().zip(outputs).zip(forces_n) {
            let (force_n, status) = match Self::reached(input) {
                Ok((_, status)) => (force_n, status),
                Err(status) => (DVec3::ZERO, status),
            };
            *output = Output::new(Wrench::from_force(force_n), f64::NAN, status);
        }
    }
}

/// Maximum number of relaxation steps per picture: the sheet moves little between pictures.
const MOST_STEPS_A_PICTURE: usize = 2_000;

impl ShapeModel for Membrane {
    /// Draws the sheet at rest under the ball, and the ball: an observer gets only some of the ticks, so it cannot
    /// follow the sheet's oscillations.
    fn shape(&mut self, input: &Input) -> &Shape {
        let handle_m = Self::reached(input).map_or(DVec3::ZERO, |(handle_m, _)| handle_m);
        let centre_m = self.centre_m(handle_m);
        // Of all that may change in a run, only the ball moves a sheet at rest.
        if self.pictured_at_m == Some(centre_m) {
            return &self.drawn;
        }
        // An unfinished relaxation continues at the next picture.
        let rests = self.touch.rest_under(centre_m, &mut self.pictured, MOST_STEPS_A_PICTURE);
        self.pictured_at_m = rests.then_some(centre_m);
        let Shape { primitives, surface } = &mut self.drawn;
        let positions_m = self.pictured.positions_m();
        for (index, (vertex, untouched_m)) in surface.vertices.iter_mut().zip(&self.untouched_m).enumerate() {
            let position_m = positions_m.get(index);
            vertex.position_m = position_m.to_array();
            vertex.value = position_m.distance(*untouched_m) * 1.0e3;
        }
        surface.set_normals();
        primitives.clear();
        primitives.push(Primitive::sphere(Part::Tool, Pose::new(centre_m, DQuat::IDENTITY), self.radius_m));
        &self.drawn
    }
}

/// Displacement of the ball for the stiffness, relative to the longest spring: several masses come into contact on the way.
const PROBE_SHARE: f64 = 0.125;

impl ContactSetModel for Membrane {
    /// Returns the plane under the ball.
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let mut set = [ContactSet::NONE];
        self.contact_sets(std::slice::from_ref(input), &mut set);
        let [set] = set;
        set
    }
}

impl WorldContactsModel for Membrane {
    /// Moves the ball of every port through one network, and returns the plane under each. The ball of an invalid input stays where it
    /// is, without a plane; without a valid input the network stands still.
    fn contact_sets(&mut self, inputs: &[Input], sets: &mut [ContactSet]) {
        let count = inputs.len().min(MAX_PORTS);
        let (centres_m, is_valid) = self.centres_m(inputs);
        if !is_valid {
            return;
        }
        let time_s = inputs.first().map_or(0.0, |first| first.dt_s().min(LONGEST_TIME_S));
        let (probe_m, mut planes) = (PROBE_SHARE * self.coarseness_m, [None; MAX_PORTS]);
        self.touch.measure_planes(&centres_m[..count], time_s, probe_m, &mut planes[..count]);
        for ((input, set), plane) in inputs.iter().zip(sets).zip(planes) {
            let Ok((handle_m, _)) = Self::reached(input) else { continue };
            let input = Input { pose: Pose::new(handle_m, input.pose.orientation()), ..*input };
            // Farther than half the longest spring, other masses make or lose contact.
            let empty = ContactSet { valid_m: 0.5 * self.coarseness_m, ..ContactSet::at(&input) };
            *set = plane.map_or(empty, |plane| {
                let SupportPlane { normal, gap_m, stiffness_n_per_m } = plane;
                empty.with(Contact::of_handle(&input, normal, gap_m, stiffness_n_per_m))
            });
        }
    }
}

/// Maximum number of steps to settle under gravity; after them the sheet is used as it is.
const MOST_SETTLING_STEPS: usize = 20_000;

impl SoftRangeModel for Membrane {
    /// Below, the sheet oscillates for seconds after a touch and moves the hand; above, it hardly follows the hand.
    const SOFT_RANGES: &'static [SoftRange] = &[SoftRange::new("damping_per_s", 5.0, 500.0, 5.0)];
}

flotor_hal::export_model!(Membrane, contact_set, shape, snapshot, soft_range, world, world_contacts);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn soft_ranges_are_of_live_parameters_and_legal() {
        for range in Membrane::SOFT_RANGES {
            let parameter = SCHEMA.iter().find(|one| one.id() == range.id()).expect("one of ours");
            let legal = range.within(parameter).expect("a range of numbers");
            assert_eq!((legal.min(), legal.max()), (range.min(), range.max()));
        }
    }
}
