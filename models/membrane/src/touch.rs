//! Ball in the hand that moves through a network, and its local linear model for a faster loop.

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
    /// Preallocated states for [`Self::measure_slope`].
    before: State,
    after: State,
}

restorable!(Touch { network, ball } without { untouched, before, after });

/// Force on the ball, and its derivative with respect to the end point of the ball's movement.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceSlope {
    /// Force on the ball, N.
    pub force_n: DVec3,
    /// Change of the force per displacement along x, y and z, N/m.
    pub slope_n_per_m: [DVec3; 3],
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

    /// Advances the network as [`Self::advance`] does, and returns force and slope of the force by finite differences: the
    /// movement is repeated three times, each to a point `probe_m` farther along one axis, in the direction of motion. The slope
    /// thus contains the network's inertia and compliance over this time, and upcoming contacts. With a short probe the impact of
    /// a single mass would count as stiffness. Real-time: bounded by four times [`Self::steps_in`], no allocation.
    pub fn measure_slope(&mut self, centre_m: DVec3, duration_s: f64, probe_m: f64) -> ForceSlope {
        let from_m = self.ball.centre_m;
        let way_m = centre_m - from_m;
        self.before.clone_from(self.network.state());
        let force_n = self.advance(centre_m, duration_s);
        self.after.clone_from(self.network.state());
        let slope_n_per_m = DVec3::AXES.map(|axis| {
            self.network.restore(&self.before);
            self.ball.centre_m = from_m;
            let probe_m = probe_m.copysign(way_m.dot(axis));
            (self.advance(centre_m + axis * probe_m, duration_s) - force_n) / probe_m
        });
        self.network.restore(&self.after);
        self.ball.centre_m = centre_m;
        ForceSlope { force_n, slope_n_per_m }
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
