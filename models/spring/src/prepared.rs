//! The law a model was set to, its constants prepared, on the seat it was set on.

use flotor_hal::{Demand as Served, Input, Memory, Output, VariantInfo};

use crate::batch::Batch;
use crate::centerline::{Centerline, Section};
use crate::closed_form::{ClosedForm, Form};
use crate::energy::EnergyForm;
use crate::parameters::{Choice, SeatChoice, Variant};
use crate::pose::Pose;
use crate::response::{Demand, Response};
use crate::rigidity::Spring;
use crate::rod::{Branch, Rod};
use crate::seat::{HeldSpring, Seat};
use crate::thesis::Thesis;
use crate::validity::Validity;

/// Ticks a shape is waited for before it is drawn. A model that is drawn is asked far less often than one that is
/// felt, so the rod has a longer way between two poses.
const MOST_TICKS_TO_DRAW: u32 = 500;

/// One of the laws. A seat that may be left needs a law whose energy it can minimise.
#[allow(clippy::large_enum_variant)] // one per model, made once: a box would add a load to every tick
pub(crate) enum Prepared {
    Thesis(Thesis),
    ClosedForm(ClosedForm),
    Energy(EnergyForm),
    Rod(Rod),
    FreeEnergy(EnergyForm, Seat),
    FreeRod(Rod, Seat),
}

/// What is known about an answer beside the wrench; `None` where a law has no notion of it.
pub(crate) struct Insight {
    pub(crate) branch: Option<Branch>,
    pub(crate) is_stable: Option<bool>,
    /// Roll of the base about the y axis (rad); `None` for a spring that hangs in the air.
    pub(crate) seat_roll_rad: Option<f64>,
}

impl Prepared {
    /// Not real-time: the rod allocates.
    pub(crate) fn new(choice: &Choice) -> Self {
        let Choice { spring, stiffness, precision, variant, accuracy, seat, .. } = choice;
        match (variant, seat) {
            (Variant::Thesis, _) => Self::Thesis(Thesis::new(spring, *stiffness, *precision)),
            (Variant::ClosedForm, _) => {
                Self::ClosedForm(ClosedForm::new(spring, Form::Printed).with_precision(*precision))
            }
            (Variant::CurrentLength, _) => Self::ClosedForm(ClosedForm::new(spring, Form::CurrentLength)),
            (Variant::Energy, SeatChoice::Fixed) => Self::Energy(EnergyForm::new(spring)),
            (Variant::Energy, SeatChoice::Free) => {
                Self::FreeEnergy(EnergyForm::new(spring), Seat::new(spring))
            }
            (Variant::Rod, SeatChoice::Fixed) => Self::Rod(Rod::new(spring, *accuracy)),
            (Variant::Rod, SeatChoice::Free) => Self::FreeRod(Rod::new(spring, *accuracy), Seat::new(spring)),
        }
    }

    /// Takes over a change of parameters. Real-time: bounded, no allocation.
    pub(crate) fn retune(&mut self, from: &Choice, to: &Choice) {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) => *self = Self::new(to),
            Self::Energy(law) => *law = law.retuned(&from.spring, &to.spring),
            Self::Rod(rod) => rod.set_spring(&to.spring),
            Self::FreeEnergy(law, seat) => {
                *law = law.retuned(&from.spring, &to.spring);
                seat.set_spring(&to.spring);
            }
            Self::FreeRod(rod, seat) => {
                rod.set_spring(&to.spring);
                seat.set_spring(&to.spring);
            }
        }
    }

    /// Forgets the past. Real-time: bounded, no allocation.
    pub(crate) fn reset(&mut self) {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) | Self::Energy(_) => {}
            Self::Rod(rod) => rod.reset(),
            Self::FreeEnergy(_, seat) => seat.reset(),
            Self::FreeRod(rod, seat) => {
                rod.reset();
                seat.reset();
            }
        }
    }

    /// Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn respond(&mut self, pose: &Pose, demand: Demand) -> Response {
        match self {
            Self::Thesis(law) => law.respond(pose, demand),
            Self::ClosedForm(law) => law.respond(pose, demand),
            Self::Energy(law) => law.respond(pose, demand),
            Self::Rod(rod) => rod.step(pose, demand),
            Self::FreeEnergy(law, seat) => seat.step(law, pose, demand),
            Self::FreeRod(rod, seat) => seat.step(rod, pose, demand),
        }
    }

    /// Answers to all inputs side by side, where the law can do that; `false` where it goes pose by pose.
    /// Real-time per pose: bounded, no allocation.
    pub(crate) fn respond_side_by_side(
        &self,
        batch: &Batch,
        inputs: &[Input],
        outputs: &mut [Output],
    ) -> bool {
        match self {
            Self::ClosedForm(law) => batch.respond(law, inputs, outputs),
            Self::Energy(law) => batch.respond(law, inputs, outputs),
            Self::Thesis(_) | Self::Rod(_) | Self::FreeEnergy(..) | Self::FreeRod(..) => return false,
        }
        true
    }

    /// What it serves and whether it remembers.
    pub(crate) fn info(&self) -> VariantInfo {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) => VariantInfo::new(Served::WRENCH, Memory::Stateless),
            Self::Energy(_) => VariantInfo::new(Served::ALL, Memory::Stateless),
            Self::Rod(_) | Self::FreeEnergy(..) | Self::FreeRod(..) => {
                VariantInfo::new(Served::ALL, Memory::PathDependent)
            }
        }
    }

    /// About the last answer. Real-time: bounded, no allocation.
    pub(crate) fn insight(&self) -> Insight {
        let (rod, seat) = match self {
            Self::Thesis(_) | Self::ClosedForm(_) | Self::Energy(_) => (None, None),
            Self::Rod(rod) => (Some(rod), None),
            Self::FreeEnergy(_, seat) => (None, Some(seat)),
            Self::FreeRod(rod, seat) => (Some(rod), Some(seat)),
        };
        let state = rod.map(Rod::state);
        Insight {
            branch: state.map(|state| state.branch),
            is_stable: state.map(|state| state.is_stable()),
            seat_roll_rad: match seat {
                Some(seat) if seat.is_lifted() => None,
                Some(seat) => Some(seat.tilt_rad().x),
                None => Some(0.0),
            },
        }
    }

    /// The sections from plate to plate at a pose, evenly in arc length; `false` where there is no shape. Not
    /// real-time; moves a law that remembers to the pose.
    pub(crate) fn draw(&mut self, spring: &Spring, pose: &Pose, sections: &mut [Section]) -> bool {
        match self {
            Self::Thesis(_) | Self::ClosedForm(_) | Self::Energy(_) => draw_law(spring, pose, sections),
            Self::Rod(rod) => draw_rod(rod, pose, sections),
            Self::FreeEnergy(law, seat) => {
                let arrived = arrive(|| seat.step(law, pose, Demand::Wrench));
                arrived && seat.draw(pose, sections, |pose, sections| draw_law(spring, pose, sections))
            }
            Self::FreeRod(rod, seat) => {
                let arrived = arrive(|| seat.step(rod, pose, Demand::Wrench));
                arrived && seat.draw(pose, sections, |pose, sections| draw_rod(rod, pose, sections))
            }
        }
    }
}

/// Repeats a tick until it has an answer that stays; `false` if the pose has none.
fn arrive(mut tick: impl FnMut() -> Response) -> bool {
    let mut validity = tick().validity;
    for _ in 0..MOST_TICKS_TO_DRAW {
        if validity != Validity::NotConverged {
            break;
        }
        validity = tick().validity;
    }
    // A shape on its way is a shape.
    matches!(validity, Validity::Ok | Validity::Clamped | Validity::NotConverged)
}

fn draw_rod(rod: &mut Rod, pose: &Pose, sections: &mut [Section]) -> bool {
    let arrived = arrive(|| rod.respond(pose, Demand::Force));
    if arrived {
        rod.sections(sections);
    }
    arrived
}

fn draw_law(spring: &Spring, pose: &Pose, sections: &mut [Section]) -> bool {
    let Some(line) = Centerline::new(spring, pose) else { return false };
    let last = sections.len().saturating_sub(1).max(1);
    #[allow(clippy::cast_precision_loss)] // some tens of points
    for (index, section) in sections.iter_mut().enumerate() {
        *section = line.section(index as f64 / last as f64);
    }
    true
}
