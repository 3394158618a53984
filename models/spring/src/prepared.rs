//! Prepared law of a model, with its seat.

use flotor_hal::{Demand as Served, Input, Memory, Output, Restorable, StateBytes, VariantInfo};

use crate::batch::Batch;
use crate::centerline::Section;
use crate::closed_form::{ClosedForm, Form};
use crate::contract;
use crate::directions::Directions;
use crate::elastic::{Elastic, arrive, draw_line};
use crate::pace::{Advance, Pace};
use crate::parameters::{Choice, SeatChoice, Variant};
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::rod::Branch;
use crate::rod_blend::RodBlend;
use crate::seat::Seat;
use crate::thesis::Thesis;

/// Prepared law. A free seat needs a law with an energy to minimise.
#[allow(clippy::large_enum_variant)] // one per model, made once: a box would add a load to every tick
pub(crate) enum Prepared {
    Thesis(Thesis),
    ClosedForm(ClosedForm),
    Elastic(Elastic, Option<Seat>),
}

impl Restorable for Prepared {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        if let Self::Elastic(law, seat) = self {
            law.pass(bytes);
            seat.iter_mut().for_each(|seat| seat.pass(bytes));
        }
    }
}

/// Diagnostics of a response beside the wrench; `None` for quantities that a law does not have.
pub(crate) struct Diagnostics {
    pub(crate) branch: Option<Branch>,
    pub(crate) is_stable: Option<bool>,
    /// Roll of the base about the y axis (rad); `None` for a lifted spring.
    pub(crate) seat_roll_rad: Option<f64>,
    /// Weight of the exact rod in a law that blends into it, 0 to 1.
    pub(crate) rod_share: Option<f64>,
}

impl Prepared {
    /// Prepares the law. Not real-time: the rod allocates.
    pub(crate) fn new(choice: &Choice) -> Self {
        let Choice { spring, stiffness, precision, variant, seat, friction, .. } = choice;
        let law = match variant {
            Variant::Thesis => return Self::Thesis(Thesis::new(spring, *stiffness, *precision)),
            Variant::ClosedForm => {
                let law = ClosedForm::new(spring, Form::Printed).with_precision(*precision);
                return Self::ClosedForm(law);
            }
            Variant::CurrentLength => return Self::ClosedForm(ClosedForm::new(spring, Form::CurrentLength)),
            Variant::Energy => Elastic::energy(choice),
            Variant::Rod => Elastic::rod(choice),
        };
        Self::Elastic(law, (*seat == SeatChoice::Free).then(|| Seat::new(spring, *friction)))
    }

    /// Applies a change of parameters. Real-time: bounded, no allocation.
    pub(crate) fn retune(&mut self, from: &Choice, to: &Choice) {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) => *self = Self::new(to),
            Self::Elastic(law, seat) => {
                law.retune(from, to);
                if let Some(seat) = seat {
                    seat.set_spring(&to.spring, to.friction);
                }
            }
        }
    }

    /// Clears the history. Real-time: bounded, no allocation.
    pub(crate) fn reset(&mut self) {
        if let Self::Elastic(law, seat) = self {
            law.held().unload();
            if let Some(seat) = seat {
                seat.reset();
            }
        }
    }

    /// Returns the output of a step. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn step(&mut self, input: &Input, pace: &mut Pace) -> Output {
        match self {
            Self::ClosedForm(law) => contract::step(law, input),
            Self::Elastic(Elastic::Energy(held), None) if held.is_plain() => contract::step(&held.law, input),
            Self::Elastic(Elastic::RodBlend(held), None) if held.is_plain() => {
                blend_step(&mut held.law, pace, input)
            }
            _ => contract::output(
                &pace.respond(input, |advance, pose, demand| self.respond(advance, pose, demand)),
            ),
        }
    }

    /// Returns the response at a pose. Real-time: bounded, no allocation.
    fn respond(&mut self, advance: Advance, pose: &Pose, demand: Demand) -> Response {
        match (self, advance) {
            (Self::Thesis(law), _) => law.respond(pose, demand),
            (Self::ClosedForm(law), _) => law.respond(pose, demand),
            (Self::Elastic(law, None), Advance::Step) => law.held().respond(pose, demand),
            (Self::Elastic(law, None), Advance::Stay) => law.held().stay(pose, demand),
            (Self::Elastic(law, Some(seat)), Advance::Step) => seat.step(law.held(), pose, demand),
            (Self::Elastic(law, Some(seat)), Advance::Stay) => seat.stay(law.held(), pose, demand),
        }
    }

    /// Evaluates all inputs as a batch; returns `false` for a law that is evaluated pose by pose. Real-time per pose:
    /// bounded, no allocation.
    pub(crate) fn respond_side_by_side(
        &mut self,
        batch: &Batch,
        pace: &mut Pace,
        inputs: &[Input],
        outputs: &mut [Output],
    ) -> bool {
        match self {
            Self::ClosedForm(law) => batch.respond(law, inputs, outputs),
            Self::Elastic(Elastic::Energy(held), None) if held.is_plain() => {
                batch.respond(&held.law, inputs, outputs);
            }
            Self::Elastic(Elastic::RodBlend(held), None) if held.is_plain() => {
                batch.respond(&held.law.energy, inputs, outputs);
                blend_some(&mut held.law, pace, inputs, outputs);
            }
            _ => return false,
        }
        true
    }

    /// Returns the demands served and the path dependence.
    pub(crate) fn info(&self) -> VariantInfo {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) => VariantInfo::new(Served::WRENCH, Memory::Stateless),
            Self::Elastic(law, None) if !law.remembers() => VariantInfo::new(Served::ALL, Memory::Stateless),
            Self::Elastic(..) => VariantInfo::new(Served::ALL, Memory::PathDependent),
        }
    }

    /// Returns diagnostics of the last response. Real-time: bounded, no allocation.
    pub(crate) fn diagnostics(&self) -> Diagnostics {
        let (law, seat) = match self {
            Self::Thesis(_) | Self::ClosedForm(_) => (None, None),
            Self::Elastic(law, seat) => (Some(law), seat.as_ref()),
        };
        let state = law.and_then(Elastic::rod_state);
        Diagnostics {
            branch: state.map(|state| state.branch),
            is_stable: state.map(|state| state.is_stable()),
            rod_share: law.and_then(Elastic::rod_share),
            seat_roll_rad: match seat {
                Some(seat) if seat.is_lifted() => None,
                Some(seat) => Some(seat.tilt_rad().x),
                None => Some(0.0),
            },
        }
    }

    /// Fills in the sections from plate to plate at a pose, evenly in arc length; returns `false` if there is no shape.
    /// Not real-time; moves a path-dependent law to the pose.
    pub(crate) fn draw(&mut self, spring: &Spring, pose: &Pose, sections: &mut [Section]) -> bool {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) => draw_line(spring, pose, sections),
            Self::Elastic(law, None) => law.draw(spring, pose, sections),
            Self::Elastic(law, Some(seat)) => {
                arrive(|| seat.step(law.held(), pose, Demand::Wrench))
                    && seat.draw(pose, sections, |pose, sections| law.draw(spring, pose, sections))
            }
        }
    }
}

/// Recomputes outputs, in sequence, at poses that may need remainder or rod.
fn blend_some(law: &mut RodBlend, pace: &mut Pace, inputs: &[Input], outputs: &mut [Output]) {
    for (input, output) in inputs.iter().zip(outputs) {
        if let Some(at) = examined(law, pace, input) {
            *output = examined_step(law, pace, input, &at);
        }
    }
}

#[inline]
fn blend_step(law: &mut RodBlend, pace: &mut Pace, input: &Input) -> Output {
    match examined(law, pace, input) {
        Some(at) => examined_step(law, pace, input, &at),
        None => contract::step(&law.energy, input),
    }
}

/// Returns the directions of a pose that may need remainder or rod; at any other pose ends the motion of the rod.
#[inline]
fn examined(law: &mut RodBlend, pace: &mut Pace, input: &Input) -> Option<Directions> {
    let at = law.examine(&contract::pose(input));
    if at.is_none() {
        law.reset_weight();
        *pace = Pace::default();
    }
    at
}

fn examined_step(law: &mut RodBlend, pace: &mut Pace, input: &Input, at: &Directions) -> Output {
    contract::output(
        &pace.respond(input, |advance, pose, demand| law.respond_examined(advance, pose, at, demand)),
    )
}
