//! Simulation of a world with the tool of each hand.

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

/// World with the tool of each hand in it.
pub struct Simulation {
    bodies: Bodies,
    hands: Vec<Hand>,
}

/// Hand with its tool.
struct Hand {
    touch: Touch,
    /// Handle after the last call; `None` before the first with a pose.
    handle: Option<Pose>,
    on_hand_n: DVec3,
}

/// Motion of a handle in a call.
#[derive(Clone, Copy)]
struct Motion {
    from: Pose,
    to: Pose,
    way_m: DVec3,
    turn_rad: DVec3,
}

impl Motion {
    fn new(from: Pose, to: Pose) -> Self {
        let way_m = to.position() - from.position();
        let turn_rad = rotation_vector(to.orientation() * from.orientation().conjugate());
        Self { from, to, way_m, turn_rad }
    }

    /// Returns the pose after a share of the time, 0 to 1.
    fn at(&self, share: f64) -> Pose {
        if share >= 1.0 {
            return self.to;
        }
        let orientation = self.from.orientation().lerp(self.to.orientation(), share).normalize();
        Pose::new(self.from.position() + self.way_m * share, orientation)
    }
}

impl Simulation {
    /// Creates a world at its start, with the same tool in each of `hands` hands. Not real-time.
    #[must_use]
    pub fn new(world: &World, hands: usize) -> Self {
        let hand = || Hand { touch: Touch::new(&world.tool), handle: None, on_hand_n: DVec3::ZERO };
        Self { bodies: Bodies::new(world), hands: (0..hands).map(|_| hand()).collect() }
    }

    /// Returns the number of hands.
    #[must_use]
    pub fn hands(&self) -> usize {
        self.hands.len()
    }

    /// Returns the bodies.
    #[must_use]
    pub fn bodies(&self) -> &Bodies {
        &self.bodies
    }

    /// Returns the force on a hand in the last step, N; zero for a hand that is not there.
    #[must_use]
    pub fn on_hand_n(&self, hand: usize) -> DVec3 {
        self.hands.get(hand).map_or(DVec3::ZERO, |hand| hand.on_hand_n)
    }

    /// Returns the energies of all bodies.
    #[must_use]
    pub fn energy(&self) -> Energy {
        self.bodies.energy()
    }

    /// Moves each handle to its pose in `time_s`, and the bodies with them, in steps of at most `step_s`. A pose that is not finite
    /// leaves its handle where it is. Without any pose yet the world stands still. Not real-time.
    pub fn advance(&mut self, poses: &[Pose], time_s: f64, law: &Law, step_s: f64) {
        let mut motions = Vec::with_capacity(self.hands.len());
        for (hand, pose) in self.hands.iter_mut().zip(poses) {
            let to = if is_usable(pose) { Some(*pose) } else { hand.handle };
            motions.push(to.map(|to| Motion::new(hand.handle.unwrap_or(to), to)));
            hand.handle = to;
        }
        if motions.iter().all(Option::is_none) {
            return;
        }
        let time_s = time_s.clamp(0.0, LONGEST_S);
        let steps = (time_s / step_s).ceil();
        let mut step = 0.0;
        while step < steps {
            step += 1.0;
            for (hand, motion) in self.hands.iter_mut().zip(&motions) {
                let Some(motion) = motion else { continue };
                let twist = [motion.way_m / time_s, motion.turn_rad / time_s];
                hand.on_hand_n = hand.touch.push(&mut self.bodies, &motion.at(step / steps), twist, law);
            }
            self.bodies.step(time_s / steps);
        }
    }

    /// Returns the contacts of the tool of a hand at an input; none for a pose that is not finite. Not real-time.
    pub fn contacts(&mut self, hand: usize, input: &Input, law: &Law) -> ContactSet {
        match self.hands.get_mut(hand) {
            Some(hand) if is_usable(&input.pose) => hand.touch.contacts(&self.bodies, input, law),
            _ => ContactSet { time_ns: input.time_ns, ..ContactSet::NONE },
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
