//! Extension `flotor.contact-set/1`: contacts of the tool with surfaces, from a model that is too slow for the loop.
//!
//! A model that needs milliseconds (finite elements, rigid bodies, a solver in another process) runs asynchronously, at
//! its own rate. Each call returns the contacts near one pose, the anchor: points of the tool, and the planes that stand
//! for the surface near them. The loop computes the force of the newest set at every tick, at the current pose of the
//! handle. Surfaces only push, and a new set adds no energy of its own. A force that really pulls is the bilateral part of
//! a set, a [`LinearField`].

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{Instance, ModelAdapter};
use crate::{DVec3, ForceModel, Input, LinearField, Pose};

/// Largest number of contacts in a set.
pub const MAX_CONTACTS: usize = 16;

/// Contact between a point of the tool and a plane that stands for the surface nearby, in the model frame. 136 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Contact {
    /// Point on the tool, relative to the handle and in its orientation, m; zero for a tool that is a point.
    pub tool_point_m: [f64; 3],
    /// Closest point on the surface at the anchor, m.
    pub surface_point_m: [f64; 3],
    /// Unit normal of the surface, towards the tool.
    pub normal: [f64; 3],
    /// Distance of the point on the tool from the surface at the anchor, along the normal, m; below 0 inside.
    pub gap_m: f64,
    /// Velocity of the surface, m/s. Its power is the model's: a host limits it.
    pub surface_velocity_m_per_s: [f64; 3],
    /// Stiffness along the normal, N/m; above 0.
    pub stiffness_n_per_m: f64,
    /// Stiffness across the normal while the contact sticks, N/m; 0: no friction.
    pub tangential_stiffness_n_per_m: f64,
    /// Damping along the normal, N·s/m.
    pub damping_ns_per_m: f64,
    /// Coefficient of friction.
    pub friction: f64,
}

impl Contact {
    /// Builds a contact of the handle itself with a plane at a distance `gap_m` along its unit normal: at rest, without
    /// damping and friction.
    #[must_use]
    pub fn of_handle(input: &Input, normal: DVec3, gap_m: f64, stiffness_n_per_m: f64) -> Self {
        Self {
            surface_point_m: (input.pose.position() - normal * gap_m).to_array(),
            normal: normal.to_array(),
            gap_m,
            stiffness_n_per_m,
            ..Self::default()
        }
    }

    /// Sets the damping along the normal, N·s/m.
    #[must_use]
    pub const fn with_damping(self, damping_ns_per_m: f64) -> Self {
        Self { damping_ns_per_m, ..self }
    }

    /// Sets the coefficient of friction, and the stiffness across the normal while the contact sticks, N/m.
    #[must_use]
    pub const fn with_friction(self, friction: f64, tangential_stiffness_n_per_m: f64) -> Self {
        Self { friction, tangential_stiffness_n_per_m, ..self }
    }

    /// Sets the velocity of the surface, m/s.
    #[must_use]
    pub const fn moving(self, surface_velocity_m_per_s: [f64; 3]) -> Self {
        Self { surface_velocity_m_per_s, ..self }
    }
}

/// Contacts near a pose, in the model frame. 2688 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ContactSet {
    /// Pose of the handle for which the contacts were computed.
    pub anchor: Pose,
    /// Contacts; only the first [`Self::count`] count.
    pub contacts: [Contact; MAX_CONTACTS],
    /// Number of contacts.
    pub count: u32,
    /// 1 with a bilateral part, 0 without.
    pub has_field: u32,
    /// Largest displacement from the anchor for which the set is valid, m; above 0, may be infinite. Beyond, a host continues the
    /// planes and counts the ticks.
    pub valid_m: f64,
    /// Largest rotation from the anchor for which the set is valid, rad; above 0, may be infinite.
    pub valid_rad: f64,
    /// Longest age for which the set is valid, s; 0: three periods of the model. The forces of an older set fade.
    pub valid_s: f64,
    /// Bilateral part, a force that also pulls; read only if [`Self::has_field`] is not 0.
    pub field: LinearField,
    /// Loop time for which the set was computed, ns.
    pub time_ns: u64,
}

impl ContactSet {
    /// Set without contacts, valid everywhere.
    pub const NONE: Self = Self {
        anchor: Pose::HOME,
        contacts: [NO_CONTACT; MAX_CONTACTS],
        count: 0,
        has_field: 0,
        valid_m: f64::INFINITY,
        valid_rad: f64::INFINITY,
        valid_s: 0.0,
        field: LinearField::NONE,
        time_ns: 0,
    };

    /// Builds a set without contacts at the pose and time of an input.
    #[must_use]
    pub const fn at(input: &Input) -> Self {
        Self { anchor: input.pose, time_ns: input.time_ns, ..Self::NONE }
    }

    /// Adds a contact; a full set keeps the contacts with the smallest gaps.
    #[must_use]
    pub fn with(mut self, contact: Contact) -> Self {
        if let Some(free) = self.contacts.get_mut(self.count as usize) {
            *free = contact;
            self.count += 1;
        } else if let Some(farthest) = self.contacts.iter_mut().max_by(|a, b| a.gap_m.total_cmp(&b.gap_m))
            && contact.gap_m < farthest.gap_m
        {
            *farthest = contact;
        }
        self
    }

    /// Sets the bilateral part.
    #[must_use]
    pub const fn with_field(self, field: LinearField) -> Self {
        Self { field, has_field: 1, ..self }
    }

    /// Returns the bilateral part; [`LinearField::NONE`] without one. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn bilateral(&self) -> LinearField {
        if self.has_field == 0 { LinearField::NONE } else { self.field }
    }

    /// Returns the contacts. Real-time: bounded, no allocation.
    #[must_use]
    pub fn contacts(&self) -> &[Contact] {
        self.contacts.get(..self.count as usize).unwrap_or(&self.contacts)
    }
}

const NO_CONTACT: Contact = Contact {
    tool_point_m: [0.0; 3],
    surface_point_m: [0.0; 3],
    normal: [0.0; 3],
    gap_m: 0.0,
    surface_velocity_m_per_s: [0.0; 3],
    stiffness_n_per_m: 0.0,
    tangential_stiffness_n_per_m: 0.0,
    damping_ns_per_m: 0.0,
    friction: 0.0,
};

/// Force model that computes the contacts of the tool.
///
/// ```
/// # use flotor_hal::*;
/// # struct Wall;
/// # impl ForceModel for Wall {
/// #     const INFO: ModelInfo = ModelInfo::new("wall", "Wall", "A floor at z = 0");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> { Ok(Self) }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// A floor of 2000 N/m at z = 0, wherever the handle is: `export_model!(Wall, contact_set)`.
/// impl ContactSetModel for Wall {
///     fn contact_set(&mut self, input: &Input) -> ContactSet {
///         let floor = Contact::of_handle(input, DVec3::Z, input.pose.position().z, 2000.0);
///         ContactSet::at(input).with(floor)
///     }
/// }
/// let set = Wall.contact_set(&Input::at_rest(Pose::new(DVec3::Z * 0.001, DQuat::IDENTITY)));
/// assert_eq!((set.contacts().len(), set.contacts()[0].surface_point_m), (1, [0.0; 3]));
/// ```
pub trait ContactSetModel: ForceModel {
    /// Returns the contacts at an input, after the time since the previous call (`input.dt_ns`). A contact that is still
    /// open belongs to the set, so that the loop knows the surface before the tool reaches it. A run uses either this
    /// function or [`ForceModel::step`] of an instance, never both. Not real-time, but bounded: a call takes less than
    /// the period the model was prepared for.
    fn contact_set(&mut self, input: &Input) -> ContactSet;
}

/// Function table `flotor.contact-set/1`: see [`ContactSetModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ContactSetTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the contacts at an input, after the time since the previous call; returns a [`crate::abi::CallStatus`]
    /// code. Not real-time, but bounded.
    pub contact_set:
        Option<unsafe extern "C" fn(instance: Instance, input: *const Input, set: *mut ContactSet) -> u32>,
}

layout! {
    Contact {
        tool_point_m, surface_point_m, normal, gap_m, surface_velocity_m_per_s, stiffness_n_per_m,
        tangential_stiffness_n_per_m, damping_ns_per_m, friction,
    }
    ContactSet { anchor, contacts, count, has_field, valid_m, valid_rad, valid_s, field, time_ns }
    ContactSetTable { size, reserved, contact_set }
}
unsafe extern "C" fn contact_set<M: ContactSetModel>(
    instance: Instance,
    input: *const Input,
    set: *mut ContactSet,
) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, set, |model| Ok(model.contact_set(&*input))) }
}

table!(ContactSetTable: "flotor.contact-set/1", M: [ContactSetModel] {
    reserved: 0,
    contact_set: Some(contact_set::<M>),
});

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DQuat;

    fn wall(gap_m: f64) -> Contact {
        Contact::of_handle(&Input::at_rest(Pose::HOME), DVec3::Z, gap_m, 100.0)
    }

    #[test]
    fn a_contact_of_the_handle_has_its_gap_between_its_two_points() {
        let input = Input::at_rest(Pose::new(DVec3::new(0.01, 0.02, 0.003), DQuat::IDENTITY));
        let normal = DVec3::new(0.6, 0.0, 0.8);
        let contact = Contact::of_handle(&input, normal, -0.001, 100.0);
        let between_m = input.pose.position() - DVec3::from_array(contact.surface_point_m);
        assert!((between_m.dot(normal) - contact.gap_m).abs() < 1.0e-17);
    }

    #[test]
    fn a_full_set_keeps_the_deepest_contacts() {
        let gaps = (0..20).map(|number| 0.001 * f64::from(number * 7 % 20));
        let set = gaps.fold(ContactSet::NONE, |set, gap_m| set.with(wall(gap_m)));
        let mut kept: Vec<f64> = set.contacts().iter().map(|contact| contact.gap_m).collect();
        kept.sort_by(f64::total_cmp);
        assert_eq!(kept, (0..16).map(|number| 0.001 * f64::from(number)).collect::<Vec<_>>());
    }

    #[test]
    fn a_count_beyond_the_array_is_the_array() {
        assert_eq!(ContactSet { count: 17, ..ContactSet::NONE }.contacts().len(), MAX_CONTACTS);
        assert_eq!(ContactSet::NONE.contacts(), &[]);
    }
}
