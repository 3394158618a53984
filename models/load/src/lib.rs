//! Load: a weight in the hand, a resistance to pushing down, or a free ball to push. Stimulus of a force-discrimination experiment.
//!
//! CMU-RI-TR-07-21 (section 7) asks why people discriminate weights so much better than springs, and whether it matters
//! if a force is experienced or applied. The two kinds here differ in that alone:
//!
//! ```text
//! felt      F_z = -F                         a weight: it pulls down all the time, the hand resists
//! exerted   F_z =  F tanh(d / d0),  d > 0    a resistance: no force until the hand pushes down, then F
//! ```
//!
//! with depth `d = -z` below home and an onset `d0` that smooths the law. Both have an energy, `F z` and `F d0 ln
//! cosh(d / d0)`, so a closed path generates none.
//!
//! Devices can share a load: a weight hangs on all hands in equal parts, a resistance resists each of them. A third kind, `free`,
//! is a ball without weight that one hand pushes to the other ([`free`]).
//!
//! On a device with a linear grip the load is an object between the fingers: a spring that pushes them apart below its width.

pub mod free;

use flotor_hal::{
    Choices, DQuat, DVec3, Demand, ForceModel, Form, GripKind, GripModel, GripState, Input, MAX_PORTS,
    Memory, ModelInfo, Output, Parameter, Part, Pose, Primitive, Refusal, SetParameterError, Settings, Shape,
    ShapeModel, SoftRange, SoftRangeModel, StepStatus, VariantInfo, VariantModel, WorldModel, Wrench,
    choices, math, restorable,
};
use free::FreeBody;

/// Workspace limit along each axis, m; a position beyond it is limited to the edge, with status `Clamped`.
const REACH_M: f64 = 1.0;

/// Longest time between two ticks that the free body moves, s.
const LONGEST_TIME_S: f64 = 0.02;

const KINDS: Choices = choices!["felt", "exerted", "free"];

/// Kind of a load: weight, resistance or free body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Weight: pulls down at every height.
    Felt,
    /// Resistance: pushes up below home, no force above.
    Exerted,
    /// Ball without weight, pushed by the handles.
    Free,
}

/// Load on a handle, or on several.
#[derive(Clone, Debug, PartialEq)]
pub struct Load {
    kind: Kind,
    force_n: f64,
    onset_m: f64,
    /// Stiffness, N/m, and width, m, of the object between the fingers.
    grip_stiffness_n_per_m: f64,
    grip_width_m: f64,
    body: FreeBody,
    drawn: Shape,
}

restorable!(Load { body } without { kind, force_n, onset_m, grip_stiffness_n_per_m, grip_width_m, drawn });

/// Mass, kg, radius, m, and contact stiffness, N/m, of the free body by default.
const BODY: [f64; 3] = [0.2, 0.015, 1000.0];

/// Radius and half height of the drawn disc in the hand, m.
const DRAWN_HANDLE_M: [f64; 2] = [8.0e-3, 1.0e-3];
/// Half-extent of the drawn block beneath the disc, m: equal for every force, so that the picture does not reveal the stimulus.
const DRAWN_HALF_M: f64 = 10.0e-3;

impl Load {
    /// Creates a load of `force_n` newtons. `onset_m`: depth `d0`, m, at which a resistance has `tanh 1` = 76 % of its force.
    #[must_use]
    pub fn new(kind: Kind, force_n: f64, onset_m: f64) -> Self {
        let [mass_kg, radius_m, contact_n_per_m] = BODY;
        Self {
            kind,
            force_n,
            onset_m,
            grip_stiffness_n_per_m: 0.0,
            grip_width_m: 0.0,
            body: FreeBody::new(mass_kg, radius_m, contact_n_per_m),
            drawn: Shape::default(),
        }
    }

    /// Sets the body of a load of kind `Free`.
    #[must_use]
    pub fn with_body(self, body: FreeBody) -> Self {
        Self { body, ..self }
    }

    /// Returns the body of a load of kind `Free`.
    #[must_use]
    pub fn body(&self) -> &FreeBody {
        &self.body
    }

    /// Sets stiffness, N/m, and width, m, of the object between the fingers.
    #[must_use]
    pub fn with_grip(self, grip_stiffness_n_per_m: f64, grip_width_m: f64) -> Self {
        Self { grip_stiffness_n_per_m, grip_width_m, ..self }
    }

    /// Returns the force on the hand along z, N, at a height above home, m; 0 for a free body. Real-time: bounded, no allocation.
    #[must_use]
    pub fn force_n(&self, height_m: f64) -> f64 {
        match self.kind {
            Kind::Felt => -self.force_n,
            Kind::Free => 0.0,
            Kind::Exerted if height_m >= 0.0 => 0.0,
            Kind::Exerted => self.force_n * math::tanh(-height_m / self.onset_m),
        }
    }

    /// Returns the potential energy at a height above home, J; zero at home. Real-time: bounded, no allocation.
    #[must_use]
    pub fn energy_j(&self, height_m: f64) -> f64 {
        match self.kind {
            Kind::Felt => self.force_n * height_m,
            Kind::Free => 0.0,
            Kind::Exerted if height_m >= 0.0 => 0.0,
            Kind::Exerted => {
                let depth = -height_m / self.onset_m;
                // ln cosh x without overflow: x + ln((1 + exp(-2x)) / 2).
                let log_cosh = depth + math::ln_1p(math::exp(-2.0 * depth)) - std::f64::consts::LN_2;
                self.force_n * self.onset_m * log_cosh
            }
        }
    }

    /// Returns the output of a weight or a resistance, of which this hand carries a part.
    #[inline(always)] // the output stays in place
    fn hold(&self, input: &Input, part: f64) -> Output {
        if !input.pose.is_finite() {
            return Output::new(Wrench::ZERO, 0.0, StepStatus::InvalidInput);
        }
        let (reached_m, status) = reached(input);
        let force_n = self.force_n(reached_m.z) * part;
        // Skip the energy if not requested: most of the cost of a resistance.
        let is_asked = input.demand.contains(Demand::ENERGY);
        let energy_j = if is_asked { self.energy_j(reached_m.z) * part } else { f64::NAN };
        Output::new(Wrench::from_force(DVec3::Z * force_n), energy_j, status)
    }

    /// Moves the free body among the handles; each output has an equal part of its kinetic energy.
    fn push_body(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        let mut handles_m = [None; MAX_PORTS];
        for (input, handle_m) in inputs.iter().zip(&mut handles_m) {
            *handle_m = input.pose.is_finite().then(|| reached(input).0);
        }
        let time_s = inputs.first().map_or(0.0, |input| input.dt_s().min(LONGEST_TIME_S));
        let pushes = self.body.advance(&handles_m[..inputs.len().min(MAX_PORTS)], time_s);
        let kinetic_j = self.body.kinetic_j() / inputs.len() as f64;
        for ((input, output), push) in inputs.iter().zip(outputs).zip(pushes) {
            let is_asked = input.demand.contains(Demand::ENERGY);
            let energy_j = if is_asked { push.energy_j + kinetic_j } else { f64::NAN };
            let status = if input.pose.is_finite() { reached(input).1 } else { StepStatus::InvalidInput };
            *output = Output::new(Wrench::from_force(push.force_n), energy_j, status);
        }
    }
}

/// Returns the position of a finite input, limited to the workspace, with the status of the step.
#[inline]
fn reached(input: &Input) -> (DVec3, StepStatus) {
    let position_m = input.pose.position();
    let reached_m = position_m.clamp(DVec3::splat(-REACH_M), DVec3::splat(REACH_M));
    (reached_m, if reached_m == position_m { StepStatus::Ok } else { StepStatus::Clamped })
}

impl ForceModel for Load {
    const INFO: ModelInfo =
        ModelInfo::new("load", "Load", "A force to hold or to overcome, or a free body to push")
            .serving(Demand::ALL)
            .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = &[
        Parameter::choice(
            "kind",
            KINDS,
            0,
            "felt: a weight that pulls down; exerted: a resistance to pushing down; free: a ball without weight that hands push",
        ),
        Parameter::real(
            "force_n",
            "N",
            0.0,
            100.0,
            3.0,
            "Weight (kind felt), or resistance at depths far beyond `onset_mm` (kind exerted)",
        )
        .live(),
        Parameter::real(
            "onset_mm",
            "mm",
            0.01,
            100.0,
            1.0,
            "Depth below home at which a resistance has 76 % of its full force (kind exerted)",
        )
        .live(),
        Parameter::real(
            "grip_stiffness_n_per_m",
            "N/m",
            0.0,
            5000.0,
            0.0,
            "Stiffness of the object between the fingers, on a device with a linear grip",
        )
        .live(),
        Parameter::real(
            "grip_width_mm",
            "mm",
            0.0,
            200.0,
            15.0,
            "Width of the object between the fingers; a wider grip has no contact",
        )
        .live(),
        Parameter::real("mass_g", "g", 10.0, 1.0e4, BODY[0] * 1.0e3, "Mass of the ball (kind free)"),
        Parameter::real("radius_mm", "mm", 1.0, 200.0, BODY[1] * 1.0e3, "Radius of the ball (kind free)"),
        Parameter::real(
            "contact_n_per_m",
            "N/m",
            1.0,
            5000.0,
            BODY[2],
            "Stiffness of the contact between ball and handle (kind free)",
        )
        .live(),
    ];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let kind = match settings.choice_or_default("kind") {
            1 => Kind::Exerted,
            2 => Kind::Free,
            _ => Kind::Felt,
        };
        let (force_n, onset_mm) =
            (settings.number_or_default("force_n"), settings.number_or_default("onset_mm"));
        let value = |id| settings.number_or_default(id);
        let grip_width_m = value("grip_width_mm") * 1.0e-3;
        let (mass_kg, radius_m) = (value("mass_g") * 1.0e-3, value("radius_mm") * 1.0e-3);
        Ok(Self::new(kind, force_n, onset_mm * 1.0e-3)
            .with_grip(value("grip_stiffness_n_per_m"), grip_width_m)
            .with_body(FreeBody::new(mass_kg, radius_m, value("contact_n_per_m"))))
    }

    fn step(&mut self, input: &Input) -> Output {
        if self.kind != Kind::Free {
            return self.hold(input, 1.0);
        }
        let mut output = Output::default();
        self.push_body(std::slice::from_ref(input), std::slice::from_mut(&mut output));
        output
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        match index {
            1 => self.force_n = value,
            2 => self.onset_m = value * 1.0e-3,
            3 => self.grip_stiffness_n_per_m = value,
            4 => self.grip_width_m = value * 1.0e-3,
            7 => self.body.set_stiffness(value),
            _ => return Err(SetParameterError::Fixed),
        }
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        match index {
            0 => match self.kind {
                Kind::Felt => 0.0,
                Kind::Exerted => 1.0,
                Kind::Free => 2.0,
            },
            1 => self.force_n,
            2 => self.onset_m * 1.0e3,
            3 => self.grip_stiffness_n_per_m,
            4 => self.grip_width_m * 1.0e3,
            5 => self.body.mass_kg() * 1.0e3,
            6 => self.body.radius_m() * 1.0e3,
            7 => self.body.stiffness_n_per_m(),
            _ => f64::NAN,
        }
    }

    fn reset(&mut self) {
        self.body.reset();
    }
}

impl WorldModel for Load {
    /// A weight hangs on all hands in equal parts, a resistance resists each hand, a free body is pushed by all.
    fn step_ports(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        let part = match self.kind {
            Kind::Felt => 1.0 / inputs.len() as f64,
            Kind::Exerted => 1.0,
            Kind::Free => return self.push_body(inputs, outputs),
        };
        inputs.iter().zip(outputs).for_each(|(input, output)| *output = self.hold(input, part));
    }
}

impl VariantModel for Load {
    /// Only a free body has a history.
    fn variant_info(&self) -> VariantInfo {
        let memory = if self.kind == Kind::Free { Memory::PathDependent } else { Memory::Stateless };
        VariantInfo::new(Demand::ALL, memory)
    }
}

impl GripModel for Load {
    /// Returns the force that opens the fingers; none on an angular grip, for which the load has no size.
    fn grip(&mut self, _: &Input, grip: &GripState) -> f64 {
        match grip.kind() {
            GripKind::Linear => {
                (self.grip_stiffness_n_per_m * (self.grip_width_m - grip.opening)).max(0.0) // 0 for NaN
            }
            GripKind::Angular => 0.0,
        }
    }
}

impl ShapeModel for Load {
    /// Draws a disc in the hand, and beneath it a block: a weight hangs on the hand, a resistance is pushed down by it. A free body
    /// is a ball where it is, and the handle a point.
    fn shape(&mut self, input: &Input) -> &Shape {
        let handle_m = input.pose.position();
        if self.kind == Kind::Free {
            let ball = Pose::new(self.body.centre_m(), DQuat::IDENTITY);
            self.drawn.primitives.clear();
            self.drawn.primitives.extend([
                Primitive::sphere(Part::Body, ball, self.body.radius_m()),
                Primitive::sphere(Part::Tool, input.pose, DRAWN_HANDLE_M[1]),
            ]);
            return &self.drawn;
        }
        let [radius_m, half_height_m] = DRAWN_HANDLE_M;
        let top_m = handle_m - input.pose.orientation() * DVec3::Z * (2.0 * half_height_m);
        let (turn, top_m) = match self.kind {
            Kind::Felt => (input.pose.orientation(), top_m),
            Kind::Exerted | Kind::Free => {
                (DQuat::IDENTITY, DVec3::Z * (handle_m.z.min(0.0) - 2.0 * half_height_m))
            }
        };
        let below = |from_m: DVec3, turn: DQuat, by_m: f64| Pose::new(from_m - turn * DVec3::Z * by_m, turn);
        let disc = below(handle_m, input.pose.orientation(), half_height_m);
        let block = below(top_m, turn, DRAWN_HALF_M);
        self.drawn.primitives.clear();
        self.drawn.primitives.extend([
            Primitive::new(Form::Cylinder, Part::Tool, disc, [radius_m, radius_m, half_height_m]),
            Primitive::new(Form::Box, Part::Body, block, [DRAWN_HALF_M; 3]),
        ]);
        &self.drawn
    }
}

impl SoftRangeModel for Load {
    /// From zero to a force that a hand holds without tiring; the host's own limit is 20 N.
    const SOFT_RANGES: &'static [SoftRange] = &[SoftRange::new("force_n", 0.0, 15.0, 0.1)];
}

flotor_hal::export_model!(Load, variant, shape, snapshot, soft_range, grip, world);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thing_pushes_the_fingers_apart_below_its_width_and_pulls_never() {
        let mut load = Load::new(Kind::Felt, 3.0, 1.0e-3).with_grip(500.0, 0.02);
        let input = Input::at_rest(Pose::HOME);
        let mut effort = |kind, opening| load.grip(&input, &GripState::new(kind, opening, 0.0));
        assert_eq!(effort(GripKind::Linear, 0.016), 500.0 * (0.02 - 0.016));
        assert_eq!([0.02, 0.5, f64::NAN].map(|opening| effort(GripKind::Linear, opening)), [0.0; 3]);
        assert_eq!(effort(GripKind::Angular, 0.0), 0.0);
    }

    #[test]
    fn soft_ranges_are_of_parameters_and_legal() {
        for range in Load::SOFT_RANGES {
            let parameter = Load::PARAMETERS.iter().find(|one| one.id() == range.id()).expect("one of ours");
            let legal = range.within(parameter).expect("a range of numbers");
            assert_eq!((legal.min(), legal.max()), (range.min(), range.max()));
        }
    }
}
