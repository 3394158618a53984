//! Ball in the hand that moves through a network, and the plane that stands for the network in a faster loop.

use crate::ball::Ball;
use crate::network::{Network, State};
use flotor_hal::{DVec3, restorable};

/// Network and the ball that touches it.
#[derive(Debug)]
pub struct Touch {
    network: Network,
    ball: Ball,
    /// Initial state of the network.
    untouched: State,
    /// Preallocated states for [`Self::measure_plane`].
    before: State,
    after: State,
}

restorable!(Touch { network, ball } without { untouched, before, after });

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
    /// Places a ball of radius `radius_m` in a network, centred at `start_m`. Not real-time.
    #[must_use]
    pub fn new(network: Network, radius_m: f64, start_m: DVec3) -> Self {
        let state = network.state().clone();
        let ball = Ball { centre_m: start_m, radius_m };
        Self { network, ball, untouched: state.clone(), before: state.clone(), after: state }
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

    /// Returns the number of network steps for a duration, s; at least 1.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a few thousand, see the plugin
    pub fn steps_in(&self, duration_s: f64) -> u32 {
        (duration_s / self.network.longest_step_s()).ceil().max(1.0) as u32
    }

    /// Advances the network by `duration_s` while the ball moves to `centre_m` at constant speed; returns the force on the ball
    /// in the last step, N. Real-time: bounded by [`Self::steps_in`], no allocation.
    pub fn advance(&mut self, centre_m: DVec3, duration_s: f64) -> DVec3 {
        let (from_m, steps) = (self.ball.centre_m, self.steps_in(duration_s));
        let step_s = duration_s / f64::from(steps);
        let mut force_n = DVec3::ZERO;
        for step in 1..=steps {
            self.ball.centre_m = from_m.lerp(centre_m, f64::from(step) / f64::from(steps));
            force_n = self.network.step(step_s, Some(&self.ball));
        }
        self.ball.centre_m = centre_m;
        force_n
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
        let from_m = self.ball.centre_m;
        self.before.clone_from(self.network.state());
        let force_n = self.advance(centre_m, duration_s);
        let (push_n, plane) = match force_n.try_normalize() {
            Some(normal) => (force_n.length(), Some((normal, 0.0))),
            None => (0.0, self.nearest().filter(|(_, clearance_m)| *clearance_m <= self.ball.radius_m)),
        };
        let (normal, clearance_m) = plane?;
        self.after.clone_from(self.network.state());
        self.network.restore(&self.before);
        self.ball.centre_m = from_m;
        let is_touching = push_n > 0.0;
        let outward_m =
            if is_touching { probe_m.copysign((centre_m - from_m).dot(normal)) } else { -probe_m };
        let probed_m = centre_m + normal * (outward_m - clearance_m);
        let probed_n = self.advance(probed_m, duration_s).dot(normal);
        self.network.restore(&self.after);
        self.ball.centre_m = centre_m;
        // Where an impact ends, the force may fall with depth; no plane is farther away than the radius.
        let stiffness_n_per_m = ((push_n - probed_n) / outward_m).max(push_n / self.ball.radius_m);
        let gap_m = if is_touching { -push_n / stiffness_n_per_m } else { clearance_m };
        (stiffness_n_per_m > 0.0).then_some(SupportPlane { normal, gap_m, stiffness_n_per_m })
    }

    /// Returns the direction from the nearest mass to the centre of the ball, and the distance of the mass from the ball, m, at least 0.
    fn nearest(&self) -> Option<(DVec3, f64)> {
        let positions_m = self.network.positions_m();
        let outward = (0..positions_m.x.len()).map(|index| self.ball.centre_m - positions_m.get(index));
        let nearest = outward.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
        Some((nearest.try_normalize()?, (nearest.length() - self.ball.radius_m).max(0.0)))
    }

    /// Relaxes `state` under a ball fixed at `centre_m`; the network itself does not change. Returns true if the masses
    /// rest within `most_steps`. Not real-time.
    pub fn rest_under(&mut self, centre_m: DVec3, state: &mut State, most_steps: usize) -> bool {
        self.before.clone_from(self.network.state());
        self.network.restore(state);
        let rests = self.network.relax(&Ball { centre_m, radius_m: self.ball.radius_m }, most_steps);
        state.clone_from(self.network.state());
        self.network.restore(&self.before);
        rests
    }

    /// Restores the initial state, with the ball at `start_m`. Real-time: bounded, no allocation.
    pub fn reset(&mut self, start_m: DVec3) {
        self.network.restore(&self.untouched);
        self.ball.centre_m = start_m;
    }
}
