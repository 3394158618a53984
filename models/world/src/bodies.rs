//! Bodies of a world in the solver, with their joints.

use crate::file::{Joint, Kind, World};
use crate::vectors::{contract_pose, pose, vector};
use flotor_hal::{DQuat, DVec3, Pose};
use rapier3d_f64::dynamics::{
    GenericJoint, GenericJointBuilder, JointAxesMask, JointAxis, MotorModel, RigidBodyBuilder,
    RigidBodyHandle,
};
use rapier3d_f64::geometry::{ColliderBuilder, ColliderHandle};
use rapier3d_f64::math::Vector;
use rapier3d_f64::pipeline::PhysicsWorld;

/// Typical size of a hand-held body, m, by which the solver scales its tolerances.
const LENGTH_M: f64 = 0.02;
/// Damping of a joint with friction, per second: below its friction it creeps at `friction / (mass x this)`.
const STICKING_1_PER_S: f64 = 1.0e9;

/// Bodies of a world.
pub struct Bodies {
    pub(crate) physics: PhysicsWorld,
    /// Colliders in the order of the file: body by body, part by part.
    pub(crate) parts: Vec<ColliderHandle>,
    handles: Vec<RigidBodyHandle>,
}

/// Energies of all bodies, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Kinetic energy.
    pub kinetic_j: f64,
    /// Potential energy, zero at the height of home.
    pub potential_j: f64,
}

impl Bodies {
    /// Places the bodies of a world. Not real-time.
    #[must_use]
    pub fn new(world: &World) -> Self {
        let mut physics = PhysicsWorld {
            gravity: Vector::new(0.0, 0.0, -world.gravity_m_per_s2),
            ..PhysicsWorld::default()
        };
        physics.integration_parameters.length_unit = LENGTH_M;
        let mut parts = Vec::new();
        let mut handles = Vec::with_capacity(world.bodies.len());
        for body in &world.bodies {
            let builder = match body.mass_kg {
                Some(_) => RigidBodyBuilder::dynamic().can_sleep(false),
                None => RigidBodyBuilder::fixed(),
            };
            let handle = physics.insert_body(builder.pose(pose(&body.pose)));
            let volume_m3: f64 = body.parts.iter().map(|part| part.form.volume_m3()).sum();
            for part in &body.parts {
                let mass_kg = body.mass_kg.map_or(0.0, |mass_kg| mass_kg * part.form.volume_m3() / volume_m3);
                let collider = ColliderBuilder::new(part.form.shape())
                    .position(pose(&part.place))
                    .friction(body.friction)
                    .mass(mass_kg);
                parts.push(physics.insert_collider(collider, Some(handle)));
            }
            handles.push(handle);
        }
        let ground = physics.insert_body(RigidBodyBuilder::fixed());
        for joint in &world.joints {
            let other = joint.to.map_or(ground, |index| handles[index]);
            let other_pose = joint.to.map_or(Pose::HOME, |index| world.bodies[index].pose);
            let in_solver = in_solver(joint, &world.bodies[joint.body].pose, &other_pose);
            physics.insert_impulse_joint(other, handles[joint.body], in_solver);
        }
        Self { physics, parts, handles }
    }

    /// Moves the bodies by `step_s`, s, under the forces set before. Not real-time.
    pub(crate) fn step(&mut self, step_s: f64) {
        self.physics.integration_parameters.dt = step_s;
        self.physics.step();
        for handle in &self.handles {
            if let Some(body) = self.physics.bodies.get_mut(*handle) {
                body.reset_forces(false);
                body.reset_torques(false);
            }
        }
    }

    /// Returns the pose of a body, by its index in the file. Not real-time.
    #[must_use]
    pub fn pose(&self, index: usize) -> Option<Pose> {
        let body = self.physics.bodies.get(*self.handles.get(index)?)?;
        Some(contract_pose(body.position()))
    }

    /// Returns the energies of all bodies. Not real-time.
    #[must_use]
    pub fn energy(&self) -> Energy {
        let mut energy = Energy::default();
        let gravity = self.physics.gravity;
        for body in self.handles.iter().filter_map(|handle| self.physics.bodies.get(*handle)) {
            if body.is_dynamic() {
                energy.kinetic_j += body.kinetic_energy();
                energy.potential_j -= body.mass() * gravity.dot(body.center_of_mass());
            }
        }
        energy
    }
}

/// Returns a joint for the solver: its axis is x of a frame that both bodies carry.
fn in_solver(joint: &Joint, body: &Pose, other: &Pose) -> GenericJoint {
    let frame = DQuat::from_rotation_arc(DVec3::X, joint.axis);
    let frame_in = |holder: &Pose| {
        let back = holder.orientation().conjugate();
        pose(&Pose::new(back * (joint.at_m - holder.position()), back * frame))
    };
    let (locked, free) = match joint.kind {
        Kind::Slide => (JointAxesMask::LOCKED_PRISMATIC_AXES, JointAxis::LinX),
        Kind::Hinge => (JointAxesMask::LOCKED_REVOLUTE_AXES, JointAxis::AngX),
    };
    let mut built = GenericJointBuilder::new(locked)
        .local_frame1(frame_in(other))
        .local_frame2(frame_in(body))
        .contacts_enabled(false);
    if let Some(stops) = joint.stops {
        built = built.limits(free, stops);
    }
    if joint.friction > 0.0 {
        built = built
            .motor_model(free, MotorModel::AccelerationBased)
            .motor_velocity(free, 0.0, STICKING_1_PER_S)
            .motor_max_force(free, joint.friction);
    }
    built.build()
}

/// Returns the velocity of a point of a part, m/s.
pub(crate) fn velocity_at(physics: &PhysicsWorld, body: RigidBodyHandle, point_m: DVec3) -> DVec3 {
    let velocity = physics.bodies.get(body).map(|body| body.velocity_at_point(vector(point_m)));
    velocity.map_or(DVec3::ZERO, crate::vectors::dvec3)
}
