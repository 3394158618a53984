//! Walls at the edge of the sensors' range and limits of rotation: the walls of the thesis, made stable and passive.
//!
//! The thesis keeps the flotor in range by a sphere of springs and dampers and limits its tilt to 2.86° (0.05 rad;
//! Varadharajan 2007, section 3.2 and appendix A). This module differs in three points:
//! - Damping acts once. The program of the thesis damps rotation at every angle, and a second time beyond the limit.
//! - Damping in a wall resists outward motion only: a wall does not hold back a handle that returns by itself.
//! - Every stiffness is at most [half of the stability limit](SampledLoop::largest_stiffness) for its damping, period and
//!   latency, and the resulting stiffness is reported.
//!
//! Real-time: bounded, no allocation.

use flotor_hal::{DVec3, Damper, DeviceState, SampledLoop, Wrench, rotation_vector};

/// A spring and a damper that act beyond a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Position or angle at which the wall begins, m or rad.
    pub limit: f64,
    /// Stiffness, N/m or N·m/rad.
    pub stiffness: f64,
    /// Damping, N·s/m or N·m·s/rad.
    pub damping: f64,
}

impl Wall {
    /// Returns this wall with its stiffness reduced, if necessary, to the largest stiffness to render in the loop
    /// ([`SampledLoop::largest_stiffness`]). The damper of the wall resists outward motion only, except for the part `everywhere`
    /// of its damping (N·s/m or N·m·s/rad), which acts in both directions.
    #[must_use]
    pub fn stabilised(self, sampled: &SampledLoop, everywhere: f64) -> Self {
        let most = sampled.largest_stiffness(everywhere, Damper::OneWay(self.damping - everywhere));
        Self { stiffness: self.stiffness.min(most), ..self }
    }

    /// Returns the penetration into the wall of a handle with `inertia` (kg or kg·m²) that arrives at `speed` (m/s or
    /// rad/s) under a constant `push` (N or N·m), in a loop with samples every `period_s` and a force that acts `delay_s`
    /// later.
    ///
    /// At rest the spring balances the push. The upper bound is the depth at which the spring has stored the work of the
    /// push and the kinetic energy, `F x + m v² / 2 = K x² / 2` without any damping, plus the way at the highest speed
    /// during a period and a delay. The damper of a [stabilised](Self::stabilised) wall dissipates more than sampling
    /// generates (Gil et al. 2009).
    #[must_use]
    pub fn penetration(
        &self,
        push: f64,
        speed: f64,
        inertia: f64,
        period_s: f64,
        delay_s: f64,
    ) -> Penetration {
        let at_rest = push / self.stiffness;
        let swing = (at_rest * at_rest + inertia * speed * speed / self.stiffness).sqrt();
        let fastest = (speed * speed + push * at_rest / inertia).sqrt();
        Penetration { at_rest, at_most: at_rest + swing + fastest * (period_s + delay_s) }
    }

    /// Returns the force at `depth` beyond the limit, moving outwards at `speed`; 0 inside the limit.
    fn push(&self, depth: f64, speed: f64) -> f64 {
        if depth > 0.0 { self.stiffness * depth + self.damping * speed.max(0.0) } else { 0.0 }
    }

    /// Returns the force of two opposite walls on one axis.
    fn push_axis(&self, position: f64, speed: f64) -> f64 {
        let side = position.signum();
        -side * self.push(position.abs() - self.limit, speed * side)
    }
}

/// Penetration into a wall, m or rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penetration {
    /// Depth at rest, m or rad.
    pub at_rest: f64,
    /// Upper bound of the depth on the way to rest, m or rad.
    pub at_most: f64,
}

/// All walls of the device.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Walls {
    /// Sphere about the origin.
    pub sphere: Wall,
    /// Pairs of planes on each axis; a limit beyond the sphere has no effect.
    pub planes: [Wall; 3],
    /// Limits of rotation about x and y.
    pub tilt: Wall,
    /// Limit of rotation about z.
    pub yaw: Wall,
    /// Stiffness of a spring about home in yaw, N·m/rad: the thesis's substitute for the yaw torque that its spring model
    /// lacks.
    pub yaw_spring_nm_per_rad: f64,
    /// Damping of rotation at every angle, N·m·s/rad; replaces a smaller damping of `tilt` or `yaw`.
    pub rotation_damping_nms_per_rad: f64,
}

/// Stiffness and damping of the makers' boundary mode: N/m, N·s/m, N·m/rad, N·m·s/rad (client program of the
/// University of Utah).
const MAKER: [f64; 4] = [15_000.0, 15.0, 50.0, 0.15];
/// Least proportional gain of the thesis's angle limit, N·m/rad, and gain per gamma in N.
const THESIS_LEAST_NM_PER_RAD: f64 = 30.0;
const THESIS_PER_GAMMA: f64 = 2.5;
/// Angle limit of the thesis, rad: 2.86 degrees.
pub const THESIS_ANGLE_LIMIT_RAD: f64 = 0.05;

/// Returns the stiffness of the thesis's angle limit, N·m/rad, for a spring of compression rigidity `gamma_n`, N.
#[must_use]
pub fn thesis_nm_per_rad(gamma_n: f64) -> f64 {
    (THESIS_PER_GAMMA * gamma_n).max(THESIS_LEAST_NM_PER_RAD)
}

impl Walls {
    /// Returns the walls of the makers' boundary mode, with a sphere of `radius_m` and the thesis's angle limit.
    pub fn maker(radius_m: f64) -> Self {
        let [stiffness, damping, rotational, rotational_damping] = MAKER;
        let wall = Wall { limit: radius_m, stiffness, damping };
        let turn = Wall { limit: THESIS_ANGLE_LIMIT_RAD, stiffness: rotational, damping: rotational_damping };
        Self {
            sphere: wall,
            planes: [Wall { limit: f64::INFINITY, ..wall }; 3],
            tilt: turn,
            yaw: turn,
            yaw_spring_nm_per_rad: 0.0,
            rotation_damping_nms_per_rad: 0.0,
        }
    }

    /// Returns the thesis's walls for a spring of compression rigidity `gamma_n`, with a sphere of `radius_m`: the angular
    /// stiffness grows with gamma. Values missing in the thesis (translational gains, damping) come from [`Self::maker`].
    pub fn thesis(radius_m: f64, gamma_n: f64) -> Self {
        let maker = Self::maker(radius_m);
        let stiffness = thesis_nm_per_rad(gamma_n);
        Self {
            tilt: Wall { stiffness, ..maker.tilt },
            yaw: Wall { stiffness, ..maker.yaw },
            rotation_damping_nms_per_rad: maker.tilt.damping,
            ..maker
        }
    }

    /// Returns these walls with each stiffness at most half of its stability limit in the loop.
    pub fn stabilised(mut self, sampled: &SampledLoop) -> Self {
        let everywhere = self.rotation_damping_nms_per_rad;
        self.sphere = self.sphere.stabilised(sampled, 0.0);
        self.planes = self.planes.map(|plane| plane.stabilised(sampled, 0.0));
        // One damper at a time: the larger, so that the damping of the wall matches its stability limit.
        for turn in [&mut self.tilt, &mut self.yaw] {
            turn.damping = turn.damping.max(everywhere);
            *turn = turn.stabilised(sampled, everywhere);
        }
        let stable = sampled.largest_stiffness(0.0, Damper::BothWays(everywhere));
        self.yaw_spring_nm_per_rad = self.yaw_spring_nm_per_rad.min(stable);
        self
    }

    /// Returns force and torque of all walls on the hand, at the pose and velocity of `state`.
    #[must_use]
    pub fn wrench(&self, state: &DeviceState) -> Wrench {
        let (position, velocity) = (state.pose.position(), state.twist.linear());
        let distance = position.length();
        let mut force = DVec3::ZERO;
        if distance > 0.0 {
            let outward = position / distance;
            force -= outward * self.sphere.push(distance - self.sphere.limit, velocity.dot(outward));
        }
        let [x, y, z] = &self.planes;
        force += DVec3::new(
            x.push_axis(position.x, velocity.x),
            y.push_axis(position.y, velocity.y),
            z.push_axis(position.z, velocity.z),
        );
        let (turn, spin) = (rotation_vector(state.pose.orientation()), state.twist.angular());
        let axis = |wall: &Wall, angle: f64, speed: f64| {
            // The common damper acts everywhere; beyond the limit act the spring and the excess of the wall's damping.
            let everywhere = self.rotation_damping_nms_per_rad;
            let more = Wall { damping: wall.damping - everywhere, ..*wall };
            -everywhere * speed + more.push_axis(angle, speed)
        };
        let mut torque = DVec3::new(
            axis(&self.tilt, turn.x, spin.x),
            axis(&self.tilt, turn.y, spin.y),
            axis(&self.yaw, turn.z, spin.z),
        );
        torque.z -= self.yaw_spring_nm_per_rad * turn.z;
        Wrench::new(force, torque)
    }
}

#[cfg(test)]
mod tests;
