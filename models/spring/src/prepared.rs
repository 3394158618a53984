//! Prepared law of a model, with its seat.

use flotor_hal::{Demand as Served, Input, Memory, Output, VariantInfo};

use crate::batch::Batch;
use crate::centerline::{Centerline, Section};
use crate::closed_form::{ClosedForm, Form};
use crate::contact::AxialContact;
use crate::contract;
use crate::directions::Directions;
use crate::energy::EnergyForm;
use crate::held::{Held, HeldSpring};
use crate::pace::{Advance, Pace};
use crate::parameters::{Choice, SeatChoice, Switch, Variant};
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::rod::{Accuracy, Branch, Coils, Rod};
use crate::rod_blend::RodBlend;
use crate::seat::Seat;
use crate::thesis::Thesis;
use crate::validity::Validity;
use crate::wire::Wire;

/// Maximum number of ticks for a shape to converge before it is drawn. A drawn model is evaluated far less often than a
/// rendered one, so the rod moves farther between two poses.
const MOST_TICKS_TO_DRAW: u32 = 500;

/// Prepared law. A free seat needs a law with an energy to minimise.
#[allow(clippy::large_enum_variant)] // one per model, made once: a box would add a load to every tick
pub(crate) enum Prepared {
    Thesis(Thesis),
    ClosedForm(ClosedForm),
    Energy(Held<EnergyForm>),
    Rod(Held<Rod>),
    RodBlend(Held<RodBlend>),
    FreeEnergy(Held<EnergyForm>, Seat),
    FreeRodBlend(Held<RodBlend>, Seat),
    FreeRod(Held<Rod>, Seat),
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
        let Choice { spring, stiffness, precision, variant, seat, friction, rod_blend, coil_contact, .. } =
            choice;
        match (variant, seat) {
            (Variant::Thesis, _) => Self::Thesis(Thesis::new(spring, *stiffness, *precision)),
            (Variant::ClosedForm, _) => {
                Self::ClosedForm(ClosedForm::new(spring, Form::Printed).with_precision(*precision))
            }
            (Variant::CurrentLength, _) => Self::ClosedForm(ClosedForm::new(spring, Form::CurrentLength)),
            // For touching coils use the rod, which resolves the contact along the bulge.
            (Variant::Energy, SeatChoice::Fixed) if *rod_blend == Switch::On => match coil_contact {
                Switch::Off => Self::RodBlend(held_blend(choice)),
                Switch::On => Self::Rod(exact_rod(choice)),
            },
            (Variant::Energy, SeatChoice::Free) if *rod_blend == Switch::On => {
                let seat = Seat::new(spring, *friction);
                match coil_contact {
                    Switch::Off => Self::FreeRodBlend(held_blend(choice), seat),
                    Switch::On => Self::FreeRod(exact_rod(choice), seat),
                }
            }
            (Variant::Energy, SeatChoice::Fixed) => Self::Energy(energy(choice)),
            (Variant::Energy, SeatChoice::Free) => {
                Self::FreeEnergy(energy(choice), Seat::new(spring, *friction))
            }
            (Variant::Rod, SeatChoice::Fixed) => Self::Rod(rod(choice)),
            (Variant::Rod, SeatChoice::Free) => {
                Self::FreeRod(rod_to_tip(choice), Seat::new(spring, *friction))
            }
        }
    }

    /// Applies a change of parameters. Real-time: bounded, no allocation.
    pub(crate) fn retune(&mut self, from: &Choice, to: &Choice) {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) => *self = Self::new(to),
            Self::Energy(held) => retune_energy(held, from, to),
            Self::RodBlend(held) => retune_blend(held, to),
            Self::Rod(held) => retune_rod(held, to),
            Self::FreeEnergy(held, seat) => {
                retune_energy(held, from, to);
                seat.set_spring(&to.spring, to.friction);
            }
            Self::FreeRodBlend(held, seat) => {
                retune_blend(held, to);
                seat.set_spring(&to.spring, to.friction);
            }
            Self::FreeRod(held, seat) => {
                retune_rod(held, to);
                seat.set_spring(&to.spring, to.friction);
            }
        }
    }

    /// Clears the history. Real-time: bounded, no allocation.
    pub(crate) fn reset(&mut self) {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) | Self::Energy(_) => {}
            Self::RodBlend(held) => held.law.reset(),
            Self::Rod(held) => held.law.reset(),
            Self::FreeEnergy(_, seat) => seat.reset(),
            Self::FreeRodBlend(held, seat) => {
                held.law.reset();
                seat.reset();
            }
            Self::FreeRod(held, seat) => {
                held.law.reset();
                seat.reset();
            }
        }
    }

    /// Returns the output of a step. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn step(&mut self, input: &Input, pace: &mut Pace) -> Output {
        match self {
            Self::ClosedForm(law) => contract::step(law, input),
            Self::Energy(held) if held.is_plain() => contract::step(&held.law, input),
            Self::RodBlend(held) if held.is_plain() => blend_step(&mut held.law, pace, input),
            _ => contract::output(
                &pace.respond(input, |advance, pose, demand| self.respond(advance, pose, demand)),
            ),
        }
    }

    /// Returns the response at a pose. Real-time: bounded, no allocation.
    fn respond(&mut self, advance: Advance, pose: &Pose, demand: Demand) -> Response {
        match self {
            Self::Thesis(law) => law.respond(pose, demand),
            Self::ClosedForm(law) => law.respond(pose, demand),
            Self::Energy(held) => held.respond(pose, demand),
            Self::RodBlend(held) => held_response(held, advance, pose, demand),
            Self::Rod(held) => held_response(held, advance, pose, demand),
            Self::FreeEnergy(held, seat) => free_response(held, seat, advance, pose, demand),
            Self::FreeRodBlend(held, seat) => free_response(held, seat, advance, pose, demand),
            Self::FreeRod(held, seat) => free_response(held, seat, advance, pose, demand),
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
            Self::Energy(held) if held.is_plain() => batch.respond(&held.law, inputs, outputs),
            Self::RodBlend(held) if held.is_plain() => {
                batch.respond(held.law.energy(), inputs, outputs);
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
            Self::Energy(_) => VariantInfo::new(Served::ALL, Memory::Stateless),
            Self::RodBlend(held) if !held.law.remembers() => VariantInfo::new(Served::ALL, Memory::Stateless),
            Self::Rod(_)
            | Self::RodBlend(_)
            | Self::FreeEnergy(..)
            | Self::FreeRodBlend(..)
            | Self::FreeRod(..) => VariantInfo::new(Served::ALL, Memory::PathDependent),
        }
    }

    /// Returns diagnostics of the last response. Real-time: bounded, no allocation.
    pub(crate) fn diagnostics(&self) -> Diagnostics {
        let (state, seat) = match self {
            Self::Thesis(_) | Self::ClosedForm(_) | Self::Energy(_) => (None, None),
            Self::RodBlend(held) => (held.law.rod_state(), None),
            Self::Rod(held) => (Some(held.law.state()), None),
            Self::FreeEnergy(_, seat) => (None, Some(seat)),
            Self::FreeRodBlend(held, seat) => (held.law.rod_state(), Some(seat)),
            Self::FreeRod(held, seat) => (Some(held.law.state()), Some(seat)),
        };
        Diagnostics {
            branch: state.map(|state| state.branch),
            is_stable: state.map(|state| state.is_stable()),
            rod_share: match self {
                Self::RodBlend(held) | Self::FreeRodBlend(held, _) => Some(held.law.share()),
                _ => None,
            },
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
            Self::Thesis(_) | Self::ClosedForm(_) | Self::Energy(_) => draw_law(spring, pose, sections),
            Self::RodBlend(held) => draw_blend(held, spring, pose, sections),
            Self::Rod(held) => draw_rod(&mut held.law, pose, sections),
            Self::FreeEnergy(held, seat) => {
                let arrived = arrive(|| seat.step(held, pose, Demand::Wrench));
                arrived && seat.draw(pose, sections, |pose, sections| draw_law(spring, pose, sections))
            }
            Self::FreeRodBlend(held, seat) => {
                let arrived = arrive(|| seat.step(held, pose, Demand::Wrench));
                arrived
                    && seat.draw(pose, sections, |pose, sections| draw_blend(held, spring, pose, sections))
            }
            Self::FreeRod(held, seat) => {
                let arrived = arrive(|| seat.step(held, pose, Demand::Wrench));
                arrived && seat.draw(pose, sections, |pose, sections| draw_rod(&mut held.law, pose, sections))
            }
        }
    }
}

fn held_response<S: HeldSpring>(spring: &mut S, advance: Advance, pose: &Pose, demand: Demand) -> Response {
    match advance {
        Advance::Step => spring.respond(pose, demand),
        Advance::Stay => spring.stay(pose, demand),
    }
}

fn free_response<S: HeldSpring>(
    spring: &mut S,
    seat: &mut Seat,
    advance: Advance,
    pose: &Pose,
    demand: Demand,
) -> Response {
    match advance {
        Advance::Step => seat.step(spring, pose, demand),
        Advance::Stay => seat.stay(spring, pose, demand),
    }
}

fn wire(choice: &Choice) -> Option<Wire> {
    (choice.wire == Switch::On).then(|| Wire::new(&choice.spring))
}

fn energy(choice: &Choice) -> Held<EnergyForm> {
    let touches = choice.coil_contact == Switch::On;
    let contact = touches.then(|| AxialContact::new(&choice.spring));
    Held { law: EnergyForm::new(&choice.spring), contact, wire: wire(choice) }
}

/// Prepares the rod; its law includes coil contact along the bulge.
fn rod(choice: &Choice) -> Held<Rod> {
    let law = Rod::with_coils(&choice.spring, choice.accuracy, coils(choice));
    Held { law, contact: None, wire: wire(choice) }
}

/// Prepares a rod with each equilibrium to rounding, with the servo's polynomials.
fn exact_rod(choice: &Choice) -> Held<Rod> {
    let law = Rod::to_rounding(&choice.spring, coils(choice));
    Held { law, contact: None, wire: wire(choice) }
}

/// Prepares the rod for a free base: the servo's rod is too coarse for a minimisation of its energy.
fn rod_to_tip(choice: &Choice) -> Held<Rod> {
    match choice.accuracy {
        Accuracy::Servo => exact_rod(choice),
        Accuracy::Tight => rod(choice),
    }
}

fn held_blend(choice: &Choice) -> Held<RodBlend> {
    Held { law: RodBlend::within(&choice.spring, choice.tolerance_n), contact: None, wire: wire(choice) }
}

fn coils(choice: &Choice) -> Coils {
    match choice.coil_contact {
        Switch::Off => Coils::Pass,
        Switch::On => Coils::Touch,
    }
}

/// Recomputes outputs, in sequence, at poses that may need remainder or rod.
fn blend_some(law: &mut RodBlend, pace: &mut Pace, inputs: &[Input], outputs: &mut [Output]) {
    for (input, output) in inputs.iter().zip(outputs) {
        match law.examine(&contract::pose(input)) {
            Some(at) => *output = examined_step(law, pace, input, &at),
            None => {
                law.reset_weight();
                *pace = Pace::default();
            }
        }
    }
}

#[inline]
fn blend_step(law: &mut RodBlend, pace: &mut Pace, input: &Input) -> Output {
    match law.examine(&contract::pose(input)) {
        Some(at) => examined_step(law, pace, input, &at),
        None => {
            law.reset_weight();
            *pace = Pace::default();
            contract::step(law.energy(), input)
        }
    }
}

fn examined_step(law: &mut RodBlend, pace: &mut Pace, input: &Input, at: &Directions) -> Output {
    contract::output(
        &pace.respond(input, |advance, pose, demand| law.respond_examined(advance, pose, at, demand)),
    )
}

fn retune_blend(held: &mut Held<RodBlend>, to: &Choice) {
    held.law.set(&to.spring, to.tolerance_n);
    held.wire = held.wire.map(|_| Wire::new(&to.spring));
}

fn retune_energy(held: &mut Held<EnergyForm>, from: &Choice, to: &Choice) {
    held.law = held.law.retuned(&from.spring, &to.spring);
    held.contact = held.contact.map(|_| AxialContact::new(&to.spring));
    held.wire = held.wire.map(|_| Wire::new(&to.spring));
}

fn retune_rod(held: &mut Held<Rod>, to: &Choice) {
    held.law.set_spring(&to.spring);
    held.wire = held.wire.map(|_| Wire::new(&to.spring));
}

/// Repeats a tick until the response has converged; returns `false` if the pose has no answer.
fn arrive(mut tick: impl FnMut() -> Response) -> bool {
    let mut validity = tick().validity;
    for _ in 0..MOST_TICKS_TO_DRAW {
        if validity != Validity::NotConverged {
            break;
        }
        validity = tick().validity;
    }
    validity.has_answer()
}

fn draw_rod(rod: &mut Rod, pose: &Pose, sections: &mut [Section]) -> bool {
    let arrived = arrive(|| rod.step(pose, Demand::Force));
    if arrived {
        rod.sections(sections);
    }
    arrived
}

/// Draws the shape of the rod where the rod acts alone, and that of `energy` elsewhere.
fn draw_blend(held: &mut Held<RodBlend>, spring: &Spring, pose: &Pose, sections: &mut [Section]) -> bool {
    arrive(|| held.law.respond(pose, Demand::Force))
        && match held.law.rod_alone() {
            Some(rod) => draw_rod(rod, pose, sections),
            None => draw_law(spring, pose, sections),
        }
}

fn draw_law(spring: &Spring, pose: &Pose, sections: &mut [Section]) -> bool {
    let Some(line) = Centerline::new(spring, pose) else { return false };
    let last = sections.len().saturating_sub(1).max(1);
    for (index, section) in sections.iter_mut().enumerate() {
        *section = line.section(index as f64 / last as f64);
    }
    true
}
