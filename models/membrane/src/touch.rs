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

    /// Advances the network as [`Self::advance`] does, and returns the plane with the same force on the ball at the end, as
    /// [`Self::measure_planes`] does for one port. Real-time: bounded by twice [`Self::steps_in`], no allocation.
    pub fn measure_plane(&mut self, centre_m: DVec3, duration_s: f64, probe_m: f64) -> Option<SupportPlane> {
        let mut plane = [None];
        self.measure_planes(&[centre_m], duration_s, probe_m, &mut plane);
        let [plane] = plane;
        plane
    }

    /// Advances the network as [`Self::advance_among`] does, and writes for each port the plane with the same force on its ball at the
    /// end. The plane is as stiff as the change of the force along its normal by finite differences: the movement is repeated, with this
    /// ball to a point `probe_m` farther, in the direction of motion. The stiffness thus contains the network's inertia and compliance
    /// over this time, and upcoming contacts. With a short probe the impact of a single mass would count as stiffness.
    ///
    /// A ball that touches no mass gets the plane at the nearest mass, and the probe ends inside the network. A port has no plane if
    /// the nearest mass is farther from the ball than its radius, or does not push the probe. Real-time: bounded by the number of ports
    /// plus one times the steps of [`Self::advance_among`], no allocation.
    pub fn measure_planes(
        &mut self,
        centres_m: &[DVec3],
        duration_s: f64,
        probe_m: f64,
        planes: &mut [Option<SupportPlane>],
    ) {
        let (from, mut forces_n) = (self.balls, [DVec3::ZERO; MAX_PORTS]);
        self.before.clone_from(self.network.state());
        self.advance_among(centres_m, duration_s, &mut forces_n);
        self.after.clone_from(self.network.state());
        let to = self.balls;
        for (port, ((plane, force_n), centre_m)) in planes.iter_mut().zip(forces_n).zip(centres_m).enumerate()
        {
            let radius_m = to[port].radius_m;
            let (push_n, support) = match force_n.try_normalize() {
                Some(normal) => (force_n.length(), Some((normal, 0.0))),
                None => (0.0, self.nearest(port).filter(|(_, clearance_m)| *clearance_m <= radius_m)),
            };
            *plane = None;
            let Some((normal, clearance_m)) = support else { continue };
            let is_touching = push_n > 0.0;
            let inward_m = (*centre_m - from[port].centre_m).dot(normal);
            let outward_m = if is_touching { probe_m.copysign(inward_m) } else { -probe_m };
            let mut probed_m = [DVec3::ZERO; MAX_PORTS];
            probed_m[..centres_m.len()].copy_from_slice(centres_m);
            probed_m[port] = *centre_m + normal * (outward_m - clearance_m);
            self.network.restore(&self.before);
            self.balls = from;
            let mut probed_n = [DVec3::ZERO; MAX_PORTS];
            self.advance_among(&probed_m[..centres_m.len()], duration_s, &mut probed_n);
            self.network.restore(&self.after);
            self.balls = to;
            // Where an impact ends, the force may fall with depth; no plane is farther away than the radius.
            let probed_n = probed_n[port].dot(normal);
            let stiffness_n_per_m = ((push_n - probed_n) / outward_m).max(push_n / radius_m);
            let gap_m = if is_touching { -push_n / stiffness_n_per_m } else { clearance_m };
            *plane = (stiffness_n_per_m > 0.0).then_some(SupportPlane { normal, gap_m, stiffness_n_per_m });
        }
    }

    /// Returns the direction from the nearest mass to the centre of the ball of a port, and the distance of the mass from the ball, m,
    /// at least 0.
    fn nearest(&self, port: usize) -> Option<(DVec3, f64)> {
        let (positions_m, Ball { centre_m, radius_m }) = (self.network.positions_m(), self.balls[port]);
        let outward = (0..positions_m.x.len()).map(|index| centre_m - positions_m.get(index));
        let nearest = outward.min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?;
        Some((nearest.try_normalize()?, (nearest.length() - radius_m).max(0.0)))
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
