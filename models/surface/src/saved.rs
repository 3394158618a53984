//! State of the touch for `flotor.snapshot/1`: all numbers that affect the next step, except the surface and the parameters.

use crate::closest::Foot;
use crate::contacts::{Contact, Contacts, Side};
use crate::plugin::Touched;
use crate::proxy::Ball;
use crate::surface::{Place, Surface};
use crate::touch::{Friction, State, Touch};
use flotor_hal::{Restorable, StateBytes, restorable};

restorable!(Foot { at, point_m, normal, distance_m });
restorable!(Place { patch, foot });
restorable!(Side = Front | Back | Rim);
restorable!(Contact { place, side });
restorable!(Contacts { all });
restorable!(Ball { centre_m, contacts } without { radius_m, skin_m });
restorable!(Friction = Free | Sticks | Slides);
restorable!(Touch { state, friction } without { radius_m });

/// Kind of a [`State`].
#[derive(Clone, Copy, PartialEq)]
enum Phase {
    Start,
    Overlapping,
    Outside,
}

restorable!(Phase = Start | Overlapping | Outside);

/// Every state has the same number of bytes.
impl Restorable for State {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        let (mut phase, mut place, mut ball) = match *self {
            Self::Start => (Phase::Start, Default::default(), Ball::default()),
            Self::Overlapping { tool_m, distance_m } => {
                (Phase::Overlapping, (tool_m, distance_m), Ball::default())
            }
            Self::Outside { ball, tool_m } => (Phase::Outside, (tool_m, 0.0), ball),
        };
        phase.pass(bytes);
        place.pass(bytes);
        ball.pass(bytes);
        let (tool_m, distance_m) = place;
        *self = match phase {
            Phase::Start => Self::Start,
            Phase::Overlapping => Self::Overlapping { tool_m, distance_m },
            Phase::Outside => Self::Outside { ball, tool_m },
        };
    }
}

impl Restorable for Touched {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        self.touch.pass(bytes);
        self.touch.begin_unless_on(&self.object.surface);
    }
}

impl Touch {
    /// Validates a restored state: resets the contact if the state belongs to another surface or is not finite.
    fn begin_unless_on(&mut self, surface: &Surface) {
        let radius_m = self.radius_m;
        let is_on = match &mut self.state {
            State::Start => true,
            State::Overlapping { tool_m, distance_m } => tool_m.is_finite() && !distance_m.is_nan(),
            State::Outside { ball, tool_m } => {
                *ball = ball.with_radius(radius_m);
                let is_place = |Place { patch, foot }: Place| {
                    let numbers = [foot.at, foot.point_m.to_array(), foot.normal.to_array()];
                    patch < surface.count() && numbers.as_flattened().iter().all(|x| x.is_finite())
                };
                let are_places = ball.contacts.iter().all(|contact| is_place(contact.place));
                tool_m.is_finite() && ball.centre_m.is_finite() && are_places
            }
        };
        if !is_on {
            self.reset();
        }
    }
}
