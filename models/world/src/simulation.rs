//! Simulation of a world with its tool.

use crate::bodies::{Bodies, Energy};
use crate::file::World;
use crate::touch::{Law, Touch};
use flotor_hal::{ContactSet, DVec3, Input, Pose, rotation_vector};

/// Maximum time by which one call moves the bodies, s.
const LONGEST_S: f64 = 0.1;
/// Maximum step, as a fraction of the time constant of a free body in contact with the tool.
const STEP_SHARE: f64 = 0.35;
/// Minimum step, s.
pub const SHORTEST_STEP_S: f64 = 5.0e-5;

/// World with the tool in it.
pub struct Simulation {
    bodies: Bodies,
    touch: Touch,
    /// Handle after the last call; `None` before the first.
    handle: Option<Pose>,
    on_hand_n: DVec3,
}

impl Simulation {
    /// Creates a world at its start. Not real-time.
    #[must_use]
    pub fn new(world: &World) -> Self {
        Self {
            bodies: Bodies::new(world),
            touch: Touch::new(&world.tool),
            handle: None,
            on_hand_n: DVec3::ZERO,
        }
    }

    /// Returns the bodies.
    #[must_use]
    pub fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    /// Returns the force on the hand in the last step, N.
    #[must_use]
    pub fn on_hand_n(&self) -> DVec3 {
        self.on_hand_n
    }

    /// Returns the energies of all bodies.
    #[must_use]
    pub fn energy(&self) -> Energy {
        self.bodies.energy()
    }

    /// Moves the handle to `pose` in `time_s`, and the bodies with it, in steps of at most `step_s`. A pose that is not finite leaves
    /// the handle where it is. Not real-time.
    pub fn advance(&mut self, pose: &Pose, time_s: f64, law: &Law, step_s: f64) {
        let from = self.handle.unwrap_or(*pose);
        let to = if is_usable(pose) { *pose } else { from };
        if !is_usable(&to) {
            return;
        }
        self.handle = Some(to);
        let time_s = time_s.clamp(0.0, LONGEST_S);
        let steps = (time_s / step_s).ceil();
        let way_m = to.position() - from.position();
        let turn_rad = rotation_vector(to.orientation() * from.orientation().conjugate());
        let mut step = 0.0;
        while step < steps {
            step += 1.0;
            let share = step / steps;
            let orientation = from.orientation().lerp(to.orientation(), share).normalize();
            let now = if step < steps { Pose::new(from.position() + way_m * share, orientation) } else { to };
            self.on_hand_n =
                self.touch.push(&mut self.bodies, &now, [way_m / time_s, turn_rad / time_s], law);
            self.bodies.step(time_s / steps);
        }
    }

    /// Returns the contacts of the tool at an input; none for a pose that is not finite. Not real-time.
    pub fn contacts(&mut self, input: &Input, law: &Law) -> ContactSet {
        if is_usable(&input.pose) {
            self.touch.contacts(&self.bodies, input, law)
        } else {
            ContactSet { time_ns: input.time_ns, ..ContactSet::NONE }
        }
    }
}

fn is_usable(pose: &Pose) -> bool {
    pose.is_finite() && (pose.orientation().length_squared() - 1.0).abs() < 1.0e-3
}

/// Returns the longest step at which a law moves the lightest body of a world stably, s, at most `most_s`.
#[must_use]
pub fn stable_step_s(world: &World, law: &Law, most_s: f64) -> f64 {
    let inert_kg = least_inertia_kg(world);
    let by_spring_s = (inert_kg / law.stiffness_n_per_m).sqrt();
    let by_damper_s =
        if law.damping_ns_per_m > 0.0 { inert_kg / law.damping_ns_per_m } else { f64::INFINITY };
    (STEP_SHARE * by_spring_s.min(by_damper_s)).min(most_s)
}

/// Returns the maximum stiffness and damping for a step of [`SHORTEST_STEP_S`].
#[must_use]
pub fn stiffest(world: &World) -> Law {
    let (inert_kg, rate_1_per_s) = (least_inertia_kg(world), STEP_SHARE / SHORTEST_STEP_S);
    Law {
        stiffness_n_per_m: inert_kg * rate_1_per_s * rate_1_per_s,
        damping_ns_per_m: inert_kg * rate_1_per_s,
    }
}

/// Returns the smallest effective mass that a tool can move, kg: at the corner of a box a quarter of its mass.
fn least_inertia_kg(world: &World) -> f64 {
    0.25 * world.bodies.iter().filter_map(|body| body.mass_kg).fold(f64::INFINITY, f64::min)
}
