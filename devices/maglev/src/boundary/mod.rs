//! Walls at the edge of what the sensors see, and limits of rotation: those of the thesis, made stable and passive.
//!
//! The thesis keeps the flotor in range by a sphere of springs and dampers and limits its tilt to 2.86° (0.05 rad;
//! Varadharajan 2007, section 3.2 and appendix A). Here, too, with three differences:
//! - Damping acts once. The program of the thesis damps rotation always, and again beyond the limit.
//! - Damping in a wall resists going out only: it does not pull a handle that comes back by itself.
//! - Every stiffness is at most [half of what is stable](SampledLoop::largest_stiffness) for its damping, period and
//!   latency, and the stiffness in force is reported.
//!
//! Real-time: bounded, no allocation.

use flotor_hal::{DVec3, Damper, DeviceState, SampledLoop, Wrench, rotation_vector};

/// A spring and a damper that begin at a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// Where it begins, m or rad.
    pub limit: f64,
    /// Stiffness, N/m or N·m/rad.
    pub stiffness: f64,
    /// Damping, N·s/m or N·m·s/rad.
    pub damping: f64,
}

impl Wall {
    /// Returns this wall with a stiffness that is stable in a loop. Its damper acts outwards only; `everywhere` of its
    /// damping (N·s/m or N·m·s/rad) acts in both directions.
    #[must_use]
    pub fn stabilised(self, sampled: &SampledLoop, everywhere: f64) -> Self {
        let most = sampled.largest_stiffness(everywhere, Damper::OneWay(self.damping - everywhere));
        Self { stiffness: self.stiffness.min(most), ..self }
    }

    /// How deep `push` (N or N·m) drives an inertia (kg or kg·m²) into it that arrives at `speed`, sampled every
    /// `period_s` and answered after `delay_s` more.
    ///
    /// At rest the spring carries the push. On the way there push and speed have done work that the spring takes up,
    /// `F x + m v² / 2 = K x² / 2` with no damping at all; and what moves at its fastest is seen a period and a delay
    /// late. The damper of a [stabilised](Self::stabilised) wall takes more than sampling adds (Gil et al. 2009), so
    /// this is a bound.
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

    /// What it answers `depth` beyond its limit, going out at `speed`; nothing inside.
    fn push(&self, depth: f64, speed: f64) -> f64 {
        if depth > 0.0 { self.stiffness * depth + self.damping * speed.max(0.0) } else { 0.0 }
    }

    /// The same on one axis, to both sides.
    fn push_axis(&self, position: f64, speed: f64) -> f64 {
        let side = position.signum();
        -side * self.push(position.abs() - self.limit, speed * side)
    }
}

/// How deep something gets into a wall, m or rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penetration {
    /// Where it comes to rest.
    pub at_rest: f64,
    /// The deepest point on the way there.
    pub at_most: f64,
}

/// All walls.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walls {
    /// A sphere about the origin.
    pub sphere: Wall,
    /// Planes on each axis; a limit beyond the sphere does nothing.
    pub planes: [Wall; 3],
    /// Limits of rotation about x and y.
    pub tilt: Wall,
    /// Limit of rotation about z.
    pub yaw: Wall,
    /// Spring of yaw about home, N·m/rad: the thesis's stand-in for the torque its spring has none for.
    pub yaw_spring_nm_per_rad: f64,
    /// Damping of rotation everywhere, N·m·s/rad; takes the place of the walls' own where that is larger.
    pub rotation_damping_nms_per_rad: f64,
}

/// Stiffness and damping of the makers' boundary mode: N/m, N·s/m, N·m/rad, N·m·s/rad (client program of the
/// University of Utah).
const MAKER: [f64; 4] = [15_000.0, 15.0, 50.0, 0.15];
/// Least proportional constant of the thesis's angle limit, N·m/rad, and its multiple of gamma in N.
const THESIS_LEAST_NM_PER_RAD: f64 = 30.0;
const THESIS_PER_GAMMA: f64 = 2.5;
/// Angle limit of the thesis, rad: 2.86 degrees.
pub const THESIS_ANGLE_LIMIT_RAD: f64 = 0.05;

/// Stiffness of the thesis's angle limit for a spring of `gamma_n`, N·m/rad.
#[must_use]
pub fn thesis_nm_per_rad(gamma_n: f64) -> f64 {
    (THESIS_PER_GAMMA * gamma_n).max(THESIS_LEAST_NM_PER_RAD)
}

impl Walls {
    /// The makers' boundary mode, at a radius in m.
    #[must_use]
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

    /// The thesis's walls for a spring of `gamma_n`: the sphere ends where its coils touch (or at `radius_m`, if that
    /// is nearer), the angular constant grows with gamma. What the thesis does not print (translational gains,
    /// damping) is the makers'.
    #[must_use]
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

    /// Returns these walls, each stable in a loop.
    #[must_use]
    pub fn stabilised(mut self, sampled: &SampledLoop) -> Self {
        let everywhere = self.rotation_damping_nms_per_rad;
        self.sphere = self.sphere.stabilised(sampled, 0.0);
        self.planes = self.planes.map(|plane| plane.stabilised(sampled, 0.0));
        // One damper at a time: the larger, so that the wall is as damped as it was stabilised for.
        for turn in [&mut self.tilt, &mut self.yaw] {
            turn.damping = turn.damping.max(everywhere);
            *turn = turn.stabilised(sampled, everywhere);
        }
        let stable = sampled.largest_stiffness(0.0, Damper::BothWays(everywhere));
        self.yaw_spring_nm_per_rad = self.yaw_spring_nm_per_rad.min(stable);
        self
    }

    /// Force and torque of all walls on the hand.
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
            // Everywhere the one damper; beyond the limit the spring, and what the wall's damper has more.
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
