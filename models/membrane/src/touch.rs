//! Balls in the hands that move through a network, and the plane that stands for the network in a faster loop.

use crate::ball::Ball;
use crate::network::{Network, State};
use flotor_hal::{DVec3, MAX_PORTS, restorable};

/// Network and the balls that touch it, of one handle or of several.
#[derive(Debug)]
pub struct Touch {
    network: Network,
    /// Ball of each port; a ball counts from its first movement on.
    balls: [Ball; MAX_PORTS],
    /// Initial state of the network.
    untouched: State,
    /// Preallocated states for [`Self::measure_plane`].
    before: State,
    after: State,
}

restorable!(Touch { network, balls } without { untouched, before, after });

/// Plane that pushes a ball as a network does, as long as the ball does not move far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupportPlane {
    /// Unit normal, towards the ball.
    pub normal: DVec3,
    /// Distance of the ball from the plane along the normal, m; below 0 inside.
    pub gap_m: f64,
    /// Force per depth, N/m; above 0.
    pub stiffness_n_per_m: f64,
}

impl Touch {
    /// Places balls of radius `radius_m` in a network, centred at `start_m`. Not real-time.
    #[must_use]
    pub fn new(network: Network, radius_m: f64, start_m: DVec3) -> Self {
        let state = network.state().clone();
        let balls = [Ball { centre_m: start_m, radius_m }; MAX_PORTS];
        Self { network, balls, untouched: state.clone(), before: state.clone(), after: state }
    }

    /// Returns the network in its present state.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// Returns the network, mutable, for changes of its parameters.
    pub fn network_mut(&mut self) -> &mut Network {
        &mut self.network
    }

    /// Returns the number of network steps for a duration, s, with one ball; at least 1.
    #[must_use]
    pub fn steps_in(&self, duration_s: f64) -> u32 {
        self.steps_among(duration_s, 1)
    }

    /// Returns the number of network steps for a duration, s, among several balls.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand, see the plugin
    fn steps_among(&self, duration_s: f64, balls: usize) -> u32 {
        let longest_step_s = self.network.longest_step_s() / (balls as f64).sqrt();
        (duration_s / longest_step_s).ceil().max(1.0) as u32
    }

    /// Advances the network by `duration_s` while the ball moves to `centre_m` at constant speed; returns the force on the ball
    /// in the last step, N. Real-time: bounded by [`Self::steps_in`], no allocation.
    pub fn advance(&mut self, centre_m: DVec3, duration_s: f64) -> DVec3 {
        let mut force_n = [DVec3::ZERO];
        self.advance_among(&[centre_m], duration_s, &mut force_n);
        let [force_n] = force_n;
        force_n
    }

    /// Advances the network by `duration_s` while the ball of each port moves to its centre at constant speed; writes the forces
    /// on the balls in the last step, N. Real-time: bounded by [`Self::steps_in`] times the root of the number of balls, no
    /// allocation.
    pub fn advance_among(&mut self, centres_m: &[DVec3], duration_s: f64, forces_n: &mut [DVec3]) {
        let (from, steps) = (self.balls, self.steps_among(duration_s, centres_m.len()));
        let step_s = duration_s / f64::from(steps);
        let Self { network, balls, .. } = self;
        let balls = &mut balls[..centres_m.len().min(MAX_PORTS)];
        for step in 1..=steps {
            for ((ball, from), to_m) in balls.iter_mut().zip(&from).zip(centres_m) {
                ball.centre_m = from.centre_m.lerp(*to_m, f64::from(step) / f64::from(steps));
            }
            network.step_among(step_s, balls, forces_n);
        }
        balls.iter_mut().zip(centres_m).for_each(|(ball, centre_m)| ball.centre_m = *centre_m);
    }

    /// Returns the centre of the ball of a port, m.
    #[must_use]
    pub fn centre_m(&self, port: usize) -> DVec3 {
        self.balls[port].centre_m
    }

    /// Advances the network as [`Self::advance`] does, and returns the plane with the same force on the ball at the end. The plane is as
    /// stiff as the change of the force along its normal by finite differences: the movement is repeated to a point `probe_m` farther, in
    /// the direction of motion. The stiffness thus contains the network's inertia and compliance over this time, and upcoming contacts.
    /// With a short probe the impact of a single mass would count as stiffness.
    ///
    /// A ball that touches no mass gets the plane at the nearest mass, and the probe ends inside the network. Returns `None` if the
    /// nearest mass is farther from the ball than its radius, or does not push the probe. Real-time: bounded by twice
    /// [`Self::steps_in`], no allocation.
    pub fn measure_plane(&mut self, centre_m: DVec3, duration_s: f64, probe_m: f64) -> Option<SupportPlane> {
        let from_m = self.balls[0].centre_m;
        self.before.clone_from(self.network.state());
        let force_n = self.advance(centre_m, duration_s);
        let (push_n, plane) = match force_n.try_normalize() {
            Some(normal) => (force_n.length(), Some((normal, 0.0))),
            None => (0.0, self.nearest().filter(|(_, clearance_m)| *clearance_m <= self.balls[0].radius_m)),
        };
        let (normal, clearance_m) = plane?;
        self.after.clone_from(self.network.state());
        self.network.restore(&self.before);
        self.balls[0].centre_m = from_m;
        let is_touching = push_n > 0.0;
        let outward_m =
            if is_touching { probe_m.copysign((centre_m - from_m).dot(normal)) } else { -probe_m };
        let probed_m = centre_m + normal * (outward_m - clearance_m);
        let probed_n = self.advance(probed_m, duration_s).dot(normal);
        self.network.restore(&self.after);
        self.balls[0].centre_m = centre_m;
        // Where an impact ends, the force may fall with depth; no plane is farther away than the radius.
        let stiffness_n_per_m = ((push_n - probed_n) / outward_m).max(push_n / self.balls[0].radius_m);
        let gap_m = if is_touching { -push_n / stiffness_n_per_m } else { clearance_m };
        (stiffness_n_per_m > 0.0).then_some(SupportPlane { normal, gap_m, stiffness_n_per_m })
    }

    /// Returns the direction from the nearest mass to the centre of the ball, and the distance of the mass from the ball, m, at least 0.
    fn nearest(&self) -> Option<(DVec3, f64)> {
        let positions_m = self.network.positions_m();
        let outward = (0..positions_m.x.len()).map(|index| self.balls[0].centre_m - positions_m.get(index));
        let nearest = outward.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
        Some((nearest.try_normalize()?, (nearest.length() - self.balls[0].radius_m).max(0.0)))
    }

    /// Relaxes `state` under a ball fixed at `centre_m`; the network itself does not change. Returns true if the masses
    /// rest within `most_steps`. Not real-time.
    pub fn rest_under(&mut self, centre_m: DVec3, state: &mut State, most_steps: usize) -> bool {
        self.before.clone_from(self.network.state());
        self.network.restore(state);
        let rests = self.network.relax(&Ball { centre_m, radius_m: self.balls[0].radius_m }, most_steps);
        state.clone_from(self.network.state());
        self.network.restore(&self.before);
        rests
    }

    /// Restores the initial state, with all balls at `start_m`. Real-time: bounded, no allocation.
    pub fn reset(&mut self, start_m: DVec3) {
        self.network.restore(&self.untouched);
        self.balls.iter_mut().for_each(|ball| ball.centre_m = start_m);
    }
}
