//! Contact of the tool with the surface: start rule, path in a tick, friction.
//!
//! A ball that overlaps the surface at the start, or lies in a closed body, has no contact until it has been entirely outside
//! once. Friction is Coulomb's, on the proxy: it rests while the force along the surface is at most `static_friction` times the
//! normal force, else it slides towards the frictionless place until that force is `kinetic_friction` times the normal force, and
//! slides on at this coefficient until a tick in which it need not move. A slide shortens `|q - c|`, so friction only dissipates.

use crate::material::{Material, Own};
use crate::proxy::{Ball, Way};
use crate::surface::{Place, Surface};
use flotor_hal::DVec3;

/// State of the friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Friction {
    /// No contact, or no friction.
    #[default]
    Free = 0,
    /// The proxy sticks.
    Sticks = 1,
    /// The proxy slides.
    Slides = 2,
}

/// State of the contact.
#[allow(clippy::large_enum_variant)] // one state an instance, in a tick without allocation
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum State {
    /// No step yet.
    Start,
    /// Overlap since the start; position of the tool and its distance from the surface in the last step, m.
    Overlapping { tool_m: DVec3, distance_m: f64 },
    /// Outside, with or without contact.
    Outside { ball: Ball, tool_m: DVec3 },
}

/// Result of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer {
    /// Force on the tool, N.
    pub force_n: DVec3,
    /// Energy of the spring, J.
    pub energy_j: f64,
    /// Distance between the centres of tool and proxy, m.
    pub depth_m: f64,
    /// Point of the first contact, m, and the direction from the surface to the ball; `None` without contact.
    pub contact: Option<(DVec3, DVec3)>,
    /// Number of contacts.
    pub contacts: usize,
    /// State of the friction.
    pub friction: Friction,
    /// True while a tool that started inside the surface has not been outside.
    pub is_overlapping: bool,
    /// True if the proxy has reached its position in this tick.
    pub is_settled: bool,
}

impl Answer {
    const NOTHING: Self = Self {
        force_n: DVec3::ZERO,
        energy_j: 0.0,
        depth_m: 0.0,
        contact: None,
        contacts: 0,
        friction: Friction::Free,
        is_overlapping: false,
        is_settled: true,
    };
}

/// Difference of the distances of two faces at one place, m.
const TIE_M: f64 = 1.0e-9;
/// Maximum travel of a point in one step of its path, m: finer steps do not improve a point contact. A larger ball travels at
/// most 0.9 of its radius.
const POINT_STEP_M: f64 = 2.0e-3;
/// Radius below which a ball counts as a point, m.
const LEAST_STEP_M: f64 = 5.0e-5;
/// Maximum number of steps of the path in a tick.
const MOST_PARTS: f64 = 64.0;
/// Maximum number of steps of the search for the boundary of the friction cone.
const MOST_SECANTS: usize = 40;
/// Distance from the boundary of the friction cone at which the search ends, m.
const ON_CONE_M: f64 = 1.0e-14;

/// Tool ball and the state of its contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    pub(crate) radius_m: f64,
    pub(crate) state: State,
    pub(crate) friction: Friction,
}

/// Materials of a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Materials {
    /// Material of groups without values of their own.
    pub common: Material,
    /// Values that each group overrides.
    pub own: Vec<Own>,
}

impl Materials {
    fn of(&self, surface: &Surface, ball: &Ball) -> Material {
        let group = ball.contacts.first().map(|contact| usize::from(surface.group(&contact.place)));
        let own = group.and_then(|group| self.own.get(group));
        own.map_or(self.common, |own| self.common.with(own))
    }
}

impl Touch {
    /// Creates a ball of radius `radius_m`, without a position. Not real-time.
    #[must_use]
    pub fn new(radius_m: f64) -> Self {
        Self { radius_m, state: State::Start, friction: Friction::Free }
    }

    /// Resets to the state before the first step. Real-time: bounded, no allocation.
    pub fn reset(&mut self) {
        *self = Self::new(self.radius_m);
    }

    /// Returns true if the ball at `tool_m` is entirely outside, and the distance of its centre from the surface, at most
    /// `bound_m`.
    fn clearance(&self, surface: &Surface, tool_m: DVec3, bound_m: f64) -> (bool, f64) {
        let Some(place) = surface.nearest(tool_m, bound_m, |_| true) else { return (true, bound_m) };
        let distance_m = place.foot.distance_m;
        if distance_m < self.radius_m {
            return (false, distance_m);
        }
        // Faces of two bodies may coincide: outside is what no nearest face has behind it.
        let is_behind = |place: &Place| {
            surface.is_closed(place) && (tool_m - place.foot.point_m).dot(surface.outward(place)) < 0.0
        };
        (surface.nearest(tool_m, distance_m + TIE_M, is_behind).is_none(), distance_m)
    }

    /// Moves the tool to `tool_m` with `velocity_m_per_s` and returns force and contact. Real-time: bounded, no allocation.
    pub fn step(
        &mut self,
        surface: &Surface,
        materials: &Materials,
        tool_m: DVec3,
        velocity_m_per_s: DVec3,
    ) -> Answer {
        let (mut ball, from_m) = match self.state {
            State::Outside { ball, tool_m } => (ball, tool_m),
            State::Start | State::Overlapping { .. } => {
                let bound_m = match self.state {
                    // The distance in the last step bounds the search, with a margin for rounding.
                    State::Overlapping { tool_m: last_m, distance_m } => {
                        (distance_m + (tool_m - last_m).length()) * (1.0 + 1.0e-9) + 1.0e-9
                    }
                    _ => f64::INFINITY,
                };
                let (is_free, distance_m) = self.clearance(surface, tool_m, bound_m);
                if !is_free {
                    self.state = State::Overlapping { tool_m, distance_m };
                    return Answer { is_overlapping: true, ..Answer::NOTHING };
                }
                let ball = Ball::new(self.radius_m, tool_m);
                self.state = State::Outside { ball, tool_m };
                return Answer::NOTHING;
            }
        };
        let way_m = tool_m - from_m;
        let part_m = if self.radius_m < LEAST_STEP_M { POINT_STEP_M } else { 0.9 * self.radius_m };
        let parts = (way_m.length() / part_m).ceil().clamp(1.0, MOST_PARTS);
        let (mut is_settled, mut part, mut last_m) = (true, 1.0, from_m);
        while part <= parts {
            let to_m = if part == parts { tool_m } else { from_m + way_m * (part / parts) };
            // A ball that is not at rest after one part may be after the next.
            is_settled = self.advance(surface, materials, &mut ball, Way { from_m: last_m, to_m });
            (part, last_m) = (part + 1.0, to_m);
        }
        self.state = State::Outside { ball, tool_m };
        let material = materials.of(surface, &ball);
        Answer { is_settled, ..self.answer(surface, &material, &ball, tool_m, velocity_m_per_s) }
    }

    /// Moves the proxy after the tool; returns true if the proxy is at rest.
    fn advance(&mut self, surface: &Surface, materials: &Materials, ball: &mut Ball, way: Way) -> bool {
        let goal_m = way.to_m;
        let material = materials.of(surface, ball);
        let has_friction = material.static_friction > 0.0;
        let Some(normal) = has_friction.then(|| ball.normal(surface)).flatten() else {
            let settled = ball.settle(surface, way);
            let has_friction = materials.of(surface, ball).static_friction > 0.0 && ball.contacts.count() > 0;
            self.friction = if has_friction { Friction::Sticks } else { Friction::Free };
            return settled;
        };
        let coefficient = match self.friction {
            Friction::Slides => material.sliding(),
            _ => material.static_friction,
        };
        if excess_m(ball.proxy_m(goal_m) - goal_m, normal, coefficient) <= 0.0 {
            self.friction = Friction::Sticks;
            return true;
        }
        let before = *ball;
        if let Some(edge) = before.slid_on(surface, way, material.sliding()) {
            (*ball, self.friction) = (edge, Friction::Slides);
            return true;
        }
        let settled = ball.settle(surface, way);
        if ball.contacts.count() == 0 {
            self.friction = Friction::Free;
            return settled;
        }
        self.friction = Friction::Slides;
        if let Some(edge) = at_cone(surface, &before, ball, goal_m, material.sliding()) {
            // Slide along the contacts if the path is free; otherwise the frictionless ball meets the obstacle.
            if before.can_move_to(surface, &edge) {
                *ball = edge;
            }
        }
        settled
    }

    fn answer(
        &self,
        surface: &Surface,
        material: &Material,
        ball: &Ball,
        tool_m: DVec3,
        velocity_m_per_s: DVec3,
    ) -> Answer {
        let Some(contact) = ball.contacts.first() else { return Answer::NOTHING };
        let stretch_m = ball.proxy_m(tool_m) - tool_m;
        if stretch_m == DVec3::ZERO {
            return Answer::NOTHING;
        }
        // Without friction the spring force is along the normal of all contacts.
        let is_along = material.static_friction == 0.0 || ball.contacts.count() > 1;
        let along = is_along.then(|| stretch_m.try_normalize()).flatten();
        let Some(normal) = along.or_else(|| ball.normal(surface)) else { return Answer::NOTHING };
        let Material { stiffness_n_per_m, damping_ns_per_m, viscous_ns_per_m, .. } = *material;
        let depth_m = stretch_m.dot(normal);
        let outwards_m_per_s = velocity_m_per_s.dot(normal);
        let normal_n = (stiffness_n_per_m * depth_m - damping_ns_per_m * outwards_m_per_s).max(0.0);
        let along_m = stretch_m - normal * depth_m;
        let along_m_per_s = velocity_m_per_s - normal * outwards_m_per_s;
        let force_n = normal * normal_n + along_m * stiffness_n_per_m - along_m_per_s * viscous_ns_per_m;
        Answer {
            force_n,
            energy_j: 0.5 * stiffness_n_per_m * stretch_m.length_squared(),
            depth_m: stretch_m.length(),
            contact: Some((contact.place.foot.point_m, normal)),
            contacts: ball.contacts.count(),
            friction: self.friction,
            is_overlapping: false,
            is_settled: true,
        }
    }

    /// Returns the centre of the proxy in contact, m; `None` without contact.
    #[must_use]
    pub fn proxy_m(&self) -> Option<DVec3> {
        match self.state {
            State::Outside { ball, tool_m } if ball.contacts.count() > 0 => Some(ball.proxy_m(tool_m)),
            _ => None,
        }
    }
}

/// Returns the excess of the tangential stretch over `coefficient` times the normal stretch, m; not positive for a ball that
/// sticks. A stretch without pressure counts as free.
fn excess_m(stretch_m: DVec3, normal: DVec3, coefficient: f64) -> f64 {
    let depth_m = stretch_m.dot(normal);
    if depth_m <= 0.0 {
        return f64::INFINITY;
    }
    (stretch_m - normal * depth_m).length() - coefficient * depth_m
}

impl Ball {
    /// Returns this ball after sliding on its only contact after a tool as far as friction permits; `None` for another contact, the
    /// end of this contact, or an obstacle.
    fn slid_on(&self, surface: &Surface, way: Way, coefficient: f64) -> Option<Self> {
        let free = self.over_its_contact(surface, way)?;
        let edge = at_cone(surface, self, &free, way.to_m, coefficient)?;
        self.can_move_to(surface, &edge).then_some(edge)
    }
}

/// Returns the ball between its frictionless position `free` and its position `before` with the force on the friction cone;
/// `None` if the force at the frictionless position is outside the cone.
fn at_cone(surface: &Surface, before: &Ball, free: &Ball, goal_m: DVec3, coefficient: f64) -> Option<Ball> {
    let excess =
        |ball: &Ball| Some(excess_m(ball.proxy_m(goal_m) - goal_m, ball.normal(surface)?, coefficient));
    let (mut low, mut high) = (0.0, 1.0);
    let mut low_m = excess(free)?;
    if coefficient == 0.0 || low_m > 0.0 {
        return None;
    }
    let way_m = (before.centre_m - free.centre_m).length();
    let is_alike = before.contacts.count() == free.contacts.count();
    let mut ball = if is_alike { *before } else { free.placed_under(surface, before.centre_m) };
    let mut high_m = excess(&ball)?;
    if high_m <= 0.0 {
        return Some(ball);
    }
    high_m = high_m.min(way_m);
    // Regula falsi, Illinois variant (Dowell and Jarratt 1971, BIT 11, 168-174).
    let (mut best, mut last) = (*free, 0);
    for _ in 0..MOST_SECANTS {
        let share = (low * high_m - high * low_m) / (high_m - low_m);
        let share = if share > low && share < high { share } else { 0.5 * (low + high) };
        ball = ball.placed_under(surface, free.centre_m.lerp(before.centre_m, share));
        let excess_m = excess(&ball)?;
        let is_met = excess_m.abs() <= ON_CONE_M;
        if is_met || excess_m <= 0.0 {
            best = ball;
        }
        if is_met || (high - low) * way_m <= ON_CONE_M {
            break;
        }
        let side = if excess_m <= 0.0 { -1 } else { 1 };
        if excess_m <= 0.0 {
            (low, low_m) = (share, excess_m);
            high_m *= if last == side { 0.5 } else { 1.0 };
        } else {
            (high, high_m) = (share, excess_m.min(way_m));
            low_m *= if last == side { 0.5 } else { 1.0 };
        }
        last = side;
    }
    Some(best)
}
