//! Mapping between the device frame and a model's frame: the only place that scales motion, force and torque.
//!
//! With `x_model = m R x_device` (rotation `R`, motion scale `m`, force scale `f`), a model's force `F` and torque `M` become the
//! force `f R^T F` and the torque `(f / m) R^T M` at the device: gradients of the model's energy times `f / m`, so a conservative
//! model stays conservative at the hand (PHYSICS D6). A model stiffness `k` becomes `f m k` at the hand.
#![deny(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros)] // see clippy.toml
#![deny(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use crate::asynchronous::ContactLimits;
use flotor_hal::{DQuat, DVec3, Demand, DeviceState, GripKind, GripState, Input, Pose, Tick, Twist, Wrench};

/// Scales and rotation between the device frame and a model's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MappingConfig {
    /// Rotation from the device frame to the model frame, unit quaternion.
    pub rotation_xyzw: [f64; 4],
    /// Model displacement per device displacement.
    pub motion_scale: f64,
    /// Device force per model force.
    pub force_scale: f64,
    /// Device torque per model torque; `None`: `force_scale / motion_scale`, with which the field stays conservative.
    pub torque_scale: Option<f64>,
}

impl Default for MappingConfig {
    fn default() -> Self {
        Self { rotation_xyzw: [0.0, 0.0, 0.0, 1.0], motion_scale: 1.0, force_scale: 1.0, torque_scale: None }
    }
}

/// Port of a shared model at one of its devices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PortConfig {
    /// Number of the device, from 0 in the scene's order.
    pub device: u16,
    /// Mapping between the frame of this device and that of the model.
    pub mapping: MappingConfig,
    /// Home of the model in the device frame, m.
    pub place_m: [f64; 3],
    /// Limits of the contacts at this device; `None` for a model in the loop.
    pub contacts: Option<ContactLimits>,
}

/// Weight, priority and fade time of a model among the models of its scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blend {
    /// Weight of the model's wrench, 0 to 1.
    pub weight: f64,
    /// Priority: a model with a force suppresses the models of lower priority.
    pub priority: u8,
    /// Time in which the weight changes from 0 to 1, s.
    pub fade_s: f64,
}

impl Default for Blend {
    fn default() -> Self {
        // A tenth of a second: long enough for a hand to follow, short enough to feel prompt.
        Self { weight: 1.0, priority: 0, fade_s: 0.1 }
    }
}

/// Mapping between a device and one instance of a model: frames, scales and home position.
#[derive(Clone, Copy, Debug)]
#[must_use]
pub struct Mapping {
    home_m: DVec3,
    model_from_device: Turn,
    motion_scale: f64,
    force_scale: f64,
    torque_scale: f64,
    energy_scale: f64,
}

/// Rotation from the device frame to the model frame. Most scenes have none, which saves the multiplications.
#[derive(Clone, Copy, Debug)]
enum Turn {
    None,
    By(DQuat),
}

impl Turn {
    fn of(rotation: DQuat) -> Self {
        if rotation == DQuat::IDENTITY { Self::None } else { Self::By(rotation) }
    }

    /// Rotates a vector from the device frame into the model frame.
    #[inline]
    fn there(self, vector: DVec3) -> DVec3 {
        match self {
            Self::None => vector,
            Self::By(rotation) => rotation * vector,
        }
    }

    /// Rotates a vector from the model frame into the device frame.
    #[inline]
    fn back(self, vector: DVec3) -> DVec3 {
        match self {
            Self::None => vector,
            Self::By(rotation) => rotation.conjugate() * vector,
        }
    }

    /// Expresses a rotation of the device frame in the model frame.
    #[inline]
    fn rotation_there(self, turned: DQuat) -> DQuat {
        match self {
            Self::None => turned,
            Self::By(rotation) => rotation * turned * rotation.conjugate(),
        }
    }
}

impl Mapping {
    /// Creates a mapping from its checked configuration. Not real-time.
    pub fn new(config: &MappingConfig) -> Self {
        let energy_scale = config.force_scale / config.motion_scale;
        Self {
            home_m: DVec3::ZERO,
            model_from_device: Turn::of(DQuat::from_array(config.rotation_xyzw)),
            motion_scale: config.motion_scale,
            force_scale: config.force_scale,
            // The scale with which force and torque stay gradients of one energy.
            torque_scale: config.torque_scale.unwrap_or(energy_scale),
            energy_scale,
        }
    }

    /// Returns the rotation from the device frame to the model frame.
    #[must_use]
    pub fn rotation(&self) -> DQuat {
        match self.model_from_device {
            Turn::None => DQuat::IDENTITY,
            Turn::By(rotation) => rotation,
        }
    }

    /// Returns the mapping with the home of the model at the position `home_m` (m, device frame) instead of the
    /// device's home. Not real-time.
    pub fn at(self, home_m: [f64; 3]) -> Self {
        Self { home_m: DVec3::from_array(home_m), ..self }
    }

    /// Returns the ratio of the stiffness at the hand to the stiffness of the model.
    #[must_use]
    pub fn stiffness_scale(&self) -> f64 {
        self.force_scale * self.motion_scale
    }

    /// Returns the ratio of energy at the device to energy of the model.
    #[inline]
    #[must_use]
    pub fn energy_scale(&self) -> f64 {
        self.energy_scale
    }

    /// Returns true if the mapping conserves energy: forces and torques at the hand are gradients of one energy if the forces and
    /// torques of the model are.
    #[must_use]
    pub fn is_conservative(&self) -> bool {
        let conservative = self.energy_scale();
        (self.torque_scale - conservative).abs() <= 4.0 * f64::EPSILON * conservative
    }

    /// Maps a pose from the device frame to the model frame. Real-time: bounded, no allocation.
    #[inline(always)] // as `wrench_to_device`
    pub fn pose_to_model(&self, pose: &Pose) -> Pose {
        let turn = self.model_from_device;
        let position_m = turn.there(pose.position() - self.home_m) * self.motion_scale;
        Pose::new(position_m, turn.rotation_there(pose.orientation()))
    }

    /// Maps a position from the model frame to the device frame. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn position_to_device(&self, position_m: DVec3) -> DVec3 {
        self.home_m + self.vector_to_device(position_m)
    }

    /// Maps a difference of positions from the model frame to the device frame. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn vector_to_device(&self, vector_m: DVec3) -> DVec3 {
        self.model_from_device.back(vector_m) / self.motion_scale
    }

    /// Maps a length from the model frame to the device frame. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn length_to_device(&self, length_m: f64) -> f64 {
        length_m / self.motion_scale
    }

    /// Returns the half extents, m, of the bounding box along the device axes of a box along the model axes. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn half_sides_to_device(&self, half_sides_m: DVec3) -> DVec3 {
        let turn = self.model_from_device;
        let side = |axis: DVec3, half_m: f64| turn.back(axis).abs() * self.length_to_device(half_m);
        side(DVec3::X, half_sides_m.x) + side(DVec3::Y, half_sides_m.y) + side(DVec3::Z, half_sides_m.z)
    }

    /// Returns the input of a model for a tick: the motion in the model frame, and the demanded outputs. Real-time:
    /// bounded, no allocation.
    #[inline]
    pub fn input(&self, tick: &Tick, state: &DeviceState, demand: Demand) -> Input {
        Input {
            pose: self.pose_to_model(&state.pose),
            twist: self.twist_to_model(&state.twist),
            time_ns: tick.time_ns,
            dt_ns: tick.dt_ns,
            tick: tick.index,
            buttons: state.buttons,
            demand,
        }
    }

    /// Maps a twist from the device frame to the model frame. Real-time: bounded, no allocation.
    #[inline(always)] // as `wrench_to_device`
    #[must_use]
    pub fn twist_to_model(&self, twist: &Twist) -> Twist {
        let turn = self.model_from_device;
        Twist::new(turn.there(twist.linear()) * self.motion_scale, turn.there(twist.angular()))
    }

    /// Maps a wrench from the model frame to the device frame. Real-time: bounded, no allocation.
    #[inline(always)] // 5 ns: a call returns it in memory, and the reader waits for that
    #[must_use]
    pub fn wrench_to_device(&self, wrench: &Wrench) -> Wrench {
        let turn = self.model_from_device;
        Wrench::new(
            turn.back(wrench.force()) * self.force_scale,
            turn.back(wrench.torque()) * self.torque_scale,
        )
    }

    /// Maps the sample of a grip to the scale of the model: lengths of a linear grip as positions, angles unchanged.
    /// Real-time: bounded, no allocation.
    pub fn grip_to_model(&self, grip: &GripState) -> GripState {
        let (motion, _) = self.grip_scales(grip.kind());
        GripState::new(grip.kind(), grip.opening * motion, grip.velocity * motion)
            .with_delivered(self.effort_to_model(grip.kind(), grip.delivered))
    }

    /// Maps the effort of a model at a grip of this kind to the scale of the device. Real-time: bounded, no allocation.
    #[must_use]
    pub fn effort_to_device(&self, kind: GripKind, effort: f64) -> f64 {
        effort * self.grip_scales(kind).1
    }

    /// Maps an effort at a grip of this kind to the scale of the model: the inverse of [`Self::effort_to_device`]. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn effort_to_model(&self, kind: GripKind, effort: f64) -> f64 {
        effort / self.grip_scales(kind).1
    }

    /// Returns the scales of motion and effort of a grip of this kind: those of positions and forces, or of rotations and torques.
    fn grip_scales(&self, kind: GripKind) -> (f64, f64) {
        match kind {
            GripKind::Linear => (self.motion_scale, self.force_scale),
            GripKind::Angular => (1.0, self.torque_scale),
        }
    }

    /// Maps a wrench from the device frame to the model frame: the inverse of [`Self::wrench_to_device`]. Real-time:
    /// bounded, no allocation.
    #[must_use]
    pub fn wrench_to_model(&self, wrench: &Wrench) -> Wrench {
        let turn = self.model_from_device;
        Wrench::new(
            turn.there(wrench.force()) / self.force_scale,
            turn.there(wrench.torque()) / self.torque_scale,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thesis() -> MappingConfig {
        // A turned device, so that a missing conjugate cannot hide.
        let turned = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(-1.1);
        MappingConfig {
            rotation_xyzw: turned.to_array(),
            motion_scale: 25.0 / 15.0,
            ..MappingConfig::default()
        }
    }

    #[test]
    fn power_at_the_device_is_the_scaled_power_of_the_model() {
        let mapping = Mapping::new(&thesis());
        let twist = Twist::new(DVec3::new(0.01, -0.02, 0.03), DVec3::new(0.4, 0.5, -0.6));
        let wrench = Wrench::new(DVec3::new(1.0, 2.0, -3.0), DVec3::new(0.04, -0.05, 0.06));
        let at_model = mapping.twist_to_model(&twist);
        let model_w = wrench.force().dot(at_model.linear()) + wrench.torque().dot(at_model.angular());
        let at_device = mapping.wrench_to_device(&wrench);
        let device_w = at_device.force().dot(twist.linear()) + at_device.torque().dot(twist.angular());
        assert!((device_w - mapping.energy_scale() * model_w).abs() < 1.0e-15);
        assert!(mapping.is_conservative());
    }

    #[test]
    fn power_at_a_grip_is_the_scaled_power_of_the_model_in_either_kind() {
        let mapping = Mapping::new(&MappingConfig { force_scale: 0.7, ..thesis() });
        for kind in [GripKind::Linear, GripKind::Angular] {
            let grip = GripState::new(kind, 0.012, -0.3);
            let at_model = mapping.grip_to_model(&grip);
            let device_w = mapping.effort_to_device(kind, 2.5) * grip.velocity;
            // Two roundings of a number of the size of one.
            assert!(
                (device_w - mapping.energy_scale() * 2.5 * at_model.velocity).abs() < 1.0e-15,
                "{kind:?}"
            );
            assert_eq!(at_model.kind(), kind);
        }
    }

    #[test]
    fn a_wrench_comes_back_as_it_went() {
        let mapping = Mapping::new(&MappingConfig { force_scale: 0.7, ..thesis() });
        let wrench = Wrench::new(DVec3::new(1.0, 2.0, -3.0), DVec3::new(0.04, -0.05, 0.06));
        let back = mapping.wrench_to_model(&mapping.wrench_to_device(&wrench));
        // Two turns of a vector of length 4, each a few roundings.
        assert!((back.force() - wrench.force()).length() < 1.0e-14, "{back:?}");
        assert!((back.torque() - wrench.torque()).length() < 1.0e-15, "{back:?}");
    }

    #[test]
    fn the_thesis_spring_feels_like_gamma_over_v() {
        // gamma / L0 = 16.97 N / 25 mm in the model is gamma / V = 16.97 N / 15 mm at the hand (PHYSICS D6).
        let mapping = Mapping::new(&thesis());
        let felt = 16.97 / 0.025 * mapping.stiffness_scale();
        assert!((felt - 16.97 / 0.015).abs() < 1.0e-9);
    }

    #[test]
    fn a_model_put_elsewhere_has_its_home_there() {
        let mapping = Mapping::new(&thesis()).at([0.001, -0.002, 0.003]);
        let home = Pose::new(DVec3::new(0.001, -0.002, 0.003), DQuat::IDENTITY);
        assert_eq!(mapping.pose_to_model(&home).position(), DVec3::ZERO);
        let away = DVec3::new(0.004, 0.001, -0.002);
        let there = mapping.pose_to_model(&Pose::new(away, DQuat::IDENTITY)).position();
        assert!((mapping.position_to_device(there) - away).length() < 1.0e-17);
    }

    #[test]
    fn a_box_that_is_turned_lies_in_the_box_given_for_it_and_touches_its_sides() {
        let mapping = Mapping::new(&thesis());
        let half_m = DVec3::new(0.001, 0.002, 0.003);
        let around = mapping.half_sides_to_device(half_m);
        let mut reached = DVec3::ZERO;
        for corner in 0..8_u8 {
            let sign = |bit: u8| if corner >> bit & 1 == 0 { -1.0 } else { 1.0 };
            let at = mapping.position_to_device(half_m * DVec3::new(sign(0), sign(1), sign(2)));
            reached = reached.max(at.abs());
        }
        assert!((reached - around).abs().max_element() < 1.0e-17, "{reached} in {around}");
    }

    #[test]
    fn a_torque_scale_of_its_own_is_reported_as_not_conservative() {
        let config = MappingConfig { torque_scale: Some(1.0), ..thesis() };
        assert!(!Mapping::new(&config).is_conservative());
    }
}
