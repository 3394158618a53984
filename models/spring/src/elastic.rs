//! Laws with a stored energy, for a spring with clamped plates.

use crate::centerline::{Centerline, Section};
use crate::contact::AxialContact;
use crate::energy::EnergyForm;
use crate::held::{Held, HeldSpring};
use crate::parameters::{Choice, SeatChoice, Switch};
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::rod::{Accuracy, Coils, Rod, State};
use crate::rod_blend::RodBlend;
use crate::validity::Validity;
use crate::wire::Wire;
use flotor_hal::{Restorable, StateBytes};

/// Maximum number of ticks for a shape to converge before it is drawn. A drawn model is evaluated far less often than a
/// rendered one, so the rod moves farther between two poses.
const MOST_TICKS_TO_DRAW: u32 = 500;

/// Law with a stored energy.
#[allow(clippy::large_enum_variant)] // one per model, made once: a box would add a load to every tick
pub(crate) enum Elastic {
    Energy(Held<EnergyForm>),
    Rod(Held<Rod>),
    RodBlend(Held<RodBlend>),
}

impl Restorable for Elastic {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        match self {
            Self::Energy(_) => {}
            Self::Rod(held) => held.law.pass(bytes),
            Self::RodBlend(held) => held.law.pass(bytes),
        }
    }
}

/// Evaluates an expression with any of the laws.
macro_rules! each {
    ($law:expr, $held:ident => $body:expr) => {
        match $law {
            Elastic::Energy($held) => $body,
            Elastic::Rod($held) => $body,
            Elastic::RodBlend($held) => $body,
        }
    };
}

impl Elastic {
    /// Prepares the law `energy`. Blended into the rod and with coil contact, the law is the exact rod alone, which resolves the
    /// contact along the bulge; without blending, the contact is along the chord. Not real-time: the rod allocates.
    pub(crate) fn energy(choice: &Choice) -> Self {
        let Choice { spring, tolerance_n, .. } = choice;
        match (choice.rod_blend, choice.coil_contact) {
            (Switch::On, Switch::Off) => Self::RodBlend(held(choice, RodBlend::within(spring, *tolerance_n))),
            (Switch::On, Switch::On) => Self::Rod(exact_rod(choice)),
            (Switch::Off, touches) => {
                let contact = (touches == Switch::On).then(|| AxialContact::new(spring));
                Self::Energy(Held { contact, ..held(choice, EnergyForm::new(spring)) })
            }
        }
    }

    /// Prepares the rod. Under a free base, which minimises the rod's energy, equilibria are solved to rounding instead of the
    /// servo's tolerance. Not real-time: allocates.
    pub(crate) fn rod(choice: &Choice) -> Self {
        Self::Rod(match (choice.seat, choice.accuracy) {
            (SeatChoice::Free, Accuracy::Servo) => exact_rod(choice),
            (_, accuracy) => held(choice, Rod::with_coils(&choice.spring, accuracy, coils(choice))),
        })
    }

    /// Returns the law for evaluation.
    pub(crate) fn held(&mut self) -> &mut dyn HeldSpring {
        each!(self, held => held)
    }

    /// Applies a change of parameters. Real-time: bounded, no allocation.
    pub(crate) fn retune(&mut self, from: &Choice, to: &Choice) {
        match self {
            Self::Energy(held) => {
                held.law = held.law.retuned(&from.spring, &to.spring);
                held.contact = held.contact.map(|_| AxialContact::new(&to.spring));
            }
            Self::Rod(held) => held.law.set_spring(&to.spring),
            Self::RodBlend(held) => held.law.set(&to.spring, to.tolerance_n),
        }
        each!(self, held => held.wire = held.wire.map(|_| Wire::new(&to.spring)));
    }

    /// Returns true if a response may depend on earlier poses.
    pub(crate) fn remembers(&self) -> bool {
        match self {
            Self::Energy(_) => false,
            Self::Rod(_) => true,
            Self::RodBlend(held) => held.law.remembers(),
        }
    }

    /// Returns the state of the rod; `None` if no rod has a part in the last response.
    pub(crate) fn rod_state(&self) -> Option<State> {
        match self {
            Self::Energy(_) => None,
            Self::Rod(held) => Some(held.law.state()),
            Self::RodBlend(held) => held.law.rod_state(),
        }
    }

    /// Returns the weight of the exact rod in a law that blends into it, 0 to 1; `None` for other laws.
    pub(crate) fn rod_share(&self) -> Option<f64> {
        if let Self::RodBlend(held) = self { Some(held.law.share()) } else { None }
    }

    /// Fills in the sections from plate to plate at a pose; returns `false` if there is no shape. A blend has the shape of the rod
    /// where the rod acts alone, and the shape of the law `energy` elsewhere. Not real-time.
    pub(crate) fn draw(&mut self, spring: &Spring, pose: &Pose, sections: &mut [Section]) -> bool {
        let rod = match self {
            Self::Energy(_) => None,
            Self::Rod(held) => Some(&mut held.law),
            Self::RodBlend(held) => {
                if !arrive(|| held.law.respond(pose, Demand::Force)) {
                    return false;
                }
                held.law.rod_alone()
            }
        };
        let Some(rod) = rod else { return draw_line(spring, pose, sections) };
        let arrived = arrive(|| rod.step(pose, Demand::Force));
        if arrived {
            rod.sections(sections);
        }
        arrived
    }
}

/// Adds the wire of a choice to a law.
fn held<L>(choice: &Choice, law: L) -> Held<L> {
    Held { law, contact: None, wire: (choice.wire == Switch::On).then(|| Wire::new(&choice.spring)) }
}

/// Prepares a rod with each equilibrium to rounding, with the servo's polynomials.
fn exact_rod(choice: &Choice) -> Held<Rod> {
    held(choice, Rod::to_rounding(&choice.spring, coils(choice)))
}

fn coils(choice: &Choice) -> Coils {
    match choice.coil_contact {
        Switch::Off => Coils::Pass,
        Switch::On => Coils::Touch,
    }
}

/// Repeats a tick until the response has converged, at most [`MOST_TICKS_TO_DRAW`] times; returns `false` if the pose has no
/// answer.
pub(crate) fn arrive(mut tick: impl FnMut() -> Response) -> bool {
    let mut validity = tick().validity;
    for _ in 0..MOST_TICKS_TO_DRAW {
        if validity != Validity::NotConverged {
            break;
        }
        validity = tick().validity;
    }
    validity.has_answer()
}

/// Fills in the sections of the linear beam-column, evenly in arc length.
pub(crate) fn draw_line(spring: &Spring, pose: &Pose, sections: &mut [Section]) -> bool {
    let Some(line) = Centerline::new(spring, pose) else { return false };
    let last = sections.len().saturating_sub(1).max(1);
    for (index, section) in sections.iter_mut().enumerate() {
        *section = line.section(index as f64 / last as f64);
    }
    true
}
