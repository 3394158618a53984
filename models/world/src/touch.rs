//! Contact between tool and bodies: proximity, force and friction.

use crate::bodies::{Bodies, velocity_at};
use crate::file::Tool;
use crate::vectors::{dvec3, pose, vector};
use flotor_hal::{Contact, ContactSet, DVec3, Input, Pose};
use rapier3d_f64::dynamics::RigidBodyHandle;
use rapier3d_f64::parry::query::{
    ContactManifold, ContactManifoldsWorkspace, DefaultQueryDispatcher, PersistentQueryDispatcher,
};
use rapier3d_f64::parry::shape::SharedShape;

/// Maximum distance of surfaces considered near the tool, m.
pub const NEAR_M: f64 = 5.0e-3;
/// Maximum distance of two points on the tool that count as one contact in successive steps, m.
const SAME_PLACE_M: f64 = 5.0e-3;

/// Law of the force between tool and bodies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Law {
    /// Stiffness of a tool that rests flat on a body, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping along the normal, N·s/m.
    pub damping_ns_per_m: f64,
}

/// Pair of nearby points on tool and body.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Index of the part of the world.
    part: usize,
    body: RigidBodyHandle,
    /// Point on the tool, and closest point on the body, m.
    tool_m: DVec3,
    body_m: DVec3,
    /// Unit normal, from the body to the tool.
    normal: DVec3,
    friction: f64,
}

/// Tangential spring of a contact.
#[derive(Clone, Copy, Debug)]
struct Spring {
    part: usize,
    /// Place of the contact in the frames of handle and body, m: their motion against each other stretches the spring.
    in_handle_m: DVec3,
    in_body_m: DVec3,
    stretch_m: DVec3,
}

/// Tool in a world.
pub struct Touch {
    tool: Tool,
    shape: SharedShape,
    places: Vec<Place>,
    springs: Vec<Spring>,
    manifolds: Vec<ContactManifold<(), ()>>,
    workspace: Option<ContactManifoldsWorkspace>,
}

impl Touch {
    /// Creates a tool in the hand. Not real-time.
    #[must_use]
    pub fn new(tool: &Tool) -> Self {
        Self {
            tool: *tool,
            shape: tool.form.shape(),
            places: Vec::new(),
            springs: Vec::new(),
            manifolds: Vec::new(),
            workspace: None,
        }
    }

    /// Finds the places near the tool of a handle at `handle`.
    fn find(&mut self, bodies: &Bodies, handle: &Pose) {
        self.places.clear();
        let place = &self.tool.place;
        let position_m = handle.position() + handle.orientation() * place.position();
        let tool = pose(&Pose::new(position_m, handle.orientation() * place.orientation()));
        let around = self.shape.compute_aabb(&tool);
        for (part, handle) in bodies.parts.iter().enumerate() {
            let Some(collider) = bodies.physics.colliders.get(*handle) else { continue };
            let Some(body) = collider.parent() else { continue };
            let at = *collider.position();
            let there = collider.shape().compute_aabb(&at);
            let is_near = (0..3).all(|axis| {
                around.mins[axis] - NEAR_M <= there.maxs[axis]
                    && there.mins[axis] <= around.maxs[axis] + NEAR_M
            });
            if !is_near {
                continue;
            }
            self.manifolds.clear();
            self.workspace = None;
            let between = at.inv_mul(&tool);
            let found = DefaultQueryDispatcher.contact_manifolds(
                &between,
                collider.shape(),
                &*self.shape,
                NEAR_M,
                &mut self.manifolds,
                &mut self.workspace,
            );
            if found.is_err() {
                continue;
            }
            let friction = 0.5 * (self.tool.friction + collider.friction());
            for manifold in &self.manifolds {
                let Some(normal) = dvec3(at.rotation * manifold.local_n1).try_normalize() else { continue };
                for point in &manifold.points {
                    let tool_m = dvec3(tool * point.local_p2);
                    // The foot of the normal through the point of the tool.
                    let on_body_m = dvec3(at * point.local_p1);
                    let body_m = tool_m - normal * (tool_m - on_body_m).dot(normal);
                    if (tool_m - body_m).dot(normal) <= NEAR_M {
                        self.places.push(Place { part, body, tool_m, body_m, normal, friction });
                    }
                }
            }
        }
    }

    /// Pushes the bodies for one step with the tool of a handle at `handle`, which moves with `velocity_m_per_s` and `turn_rad_per_s`.
    /// Returns the force on the hand, N. Not real-time.
    pub(crate) fn push(
        &mut self,
        bodies: &mut Bodies,
        handle: &Pose,
        [velocity_m_per_s, turn_rad_per_s]: [DVec3; 2],
        law: &Law,
    ) -> DVec3 {
        self.find(bodies, handle);
        let share = 1.0 / self.tool.form.feet();
        let (stiffness, damping) = (law.stiffness_n_per_m * share, law.damping_ns_per_m * share);
        let mut old = std::mem::take(&mut self.springs);
        let mut on_hand_n = DVec3::ZERO;
        for place in &self.places {
            let Place { part, body, tool_m, body_m, normal, friction } = *place;
            let depth_m = (body_m - tool_m).dot(normal);
            if depth_m <= 0.0 {
                continue;
            }
            let arm_m = tool_m - handle.position();
            let tool_m_per_s = velocity_m_per_s + turn_rad_per_s.cross(arm_m);
            let slip_m_per_s = tool_m_per_s - velocity_at(&bodies.physics, body, body_m);
            let normal_n = (stiffness * depth_m - damping * slip_m_per_s.dot(normal)).max(0.0);
            let in_handle_m = handle.orientation().conjugate() * arm_m;
            let Some(at) = bodies.physics.bodies.get(body).map(|body| *body.position()) else { continue };
            let across = |of: DVec3| of - normal * of.dot(normal);
            let mut stretch_m = take(&mut old, part, in_handle_m).map_or(DVec3::ZERO, |spring| {
                let of_tool_m = handle.position() + handle.orientation() * spring.in_handle_m;
                across(spring.stretch_m + of_tool_m - dvec3(at * vector(spring.in_body_m)))
            });
            let most_m = friction * normal_n / stiffness;
            if stretch_m.length() > most_m {
                stretch_m *= most_m / stretch_m.length();
            }
            let drag_n = stretch_m * stiffness + across(slip_m_per_s) * damping;
            let drag_n = drag_n.clamp_length_max(friction * normal_n);
            let force_n = normal * normal_n - drag_n;
            on_hand_n += force_n;
            let in_body_m = dvec3(at.inverse_transform_point(vector(tool_m)));
            self.springs.push(Spring { part, in_handle_m, in_body_m, stretch_m });
            if let Some(body) = bodies.physics.bodies.get_mut(body)
                && body.is_dynamic()
            {
                body.add_force_at_point(vector(-force_n), vector(body_m), true);
            }
        }
        on_hand_n
    }

    /// Returns the contacts of the tool at an input. Not real-time.
    pub(crate) fn contacts(&mut self, bodies: &Bodies, input: &Input, law: &Law) -> ContactSet {
        self.find(bodies, &input.pose);
        let share = 1.0 / self.tool.form.feet();
        let back = input.pose.orientation().conjugate();
        let set = ContactSet { valid_m: NEAR_M, ..ContactSet::at(input) };
        self.places.iter().fold(set, |set, place| {
            set.with(Contact {
                tool_point_m: (back * (place.tool_m - input.pose.position())).to_array(),
                surface_point_m: place.body_m.to_array(),
                normal: place.normal.to_array(),
                gap_m: (place.tool_m - place.body_m).dot(place.normal),
                surface_velocity_m_per_s: velocity_at(&bodies.physics, place.body, place.body_m).to_array(),
                stiffness_n_per_m: law.stiffness_n_per_m * share,
                tangential_stiffness_n_per_m: law.stiffness_n_per_m * share,
                damping_ns_per_m: law.damping_ns_per_m * share,
                friction: place.friction,
            })
        })
    }
}

/// Takes the spring of a part that is closest to a place in the frame of the handle.
fn take(springs: &mut Vec<Spring>, part: usize, in_handle_m: DVec3) -> Option<Spring> {
    let near = |spring: &Spring| (spring.in_handle_m - in_handle_m).length();
    let same = springs.iter().enumerate().filter(|(_, spring)| spring.part == part);
    let closest = same.min_by(|(_, a), (_, b)| near(a).total_cmp(&near(b)))?;
    let (index, is_same) = (closest.0, near(closest.1) <= SAME_PLACE_M);
    is_same.then(|| springs.remove(index))
}
