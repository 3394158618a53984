//! Extension `flotor.world-contacts/1`: contacts at every port of one object, from a model that is too slow for the loop.
//!
//! Counterpart of `flotor.world/1` for a model that runs asynchronously: an instance has one state, and each call returns the
//! [`ContactSet`] of every port. The loop solves the contacts of each port at every tick, with a separate age and energy balance,
//! so that several hands can touch an object that needs milliseconds for a step.

use crate::abi::instance::call;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{CallStatus, Instance, ModelAdapter};
use crate::{ContactSet, ForceModel, Input, MAX_PORTS};

/// Force model that computes the contacts of several tools with one object: `export_model!(Bar, world_contacts)`.
///
/// ```
/// # use flotor_hal::*;
/// # struct Bar;
/// # impl ForceModel for Bar {
/// #     const INFO: ModelInfo = ModelInfo::new("bar", "Bar", "A floor that each hand presses down");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> { Ok(Self) }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// A floor of 2000 N/m, as high as the lowest hand.
/// impl WorldContactsModel for Bar {
///     fn contact_sets(&mut self, inputs: &[Input], sets: &mut [ContactSet]) {
///         let lowest_m = inputs.iter().map(|input| input.pose.position().z).fold(0.0, f64::min);
///         for (input, set) in inputs.iter().zip(sets) {
///             let gap_m = input.pose.position().z - lowest_m;
///             *set = ContactSet::at(input).with(Contact::of_handle(input, DVec3::Z, gap_m, 2000.0));
///         }
///     }
/// }
/// let at = |z_m| Input::at_rest(Pose::new(DVec3::Z * z_m, DQuat::IDENTITY));
/// let mut sets = [ContactSet::NONE; 2];
/// Bar.contact_sets(&[at(0.001), at(-0.002)], &mut sets);
/// assert_eq!(sets.map(|set| set.contacts()[0].gap_m), [0.003, 0.0]);
/// ```
pub trait WorldContactsModel: ForceModel {
    /// Writes the contacts at each of 1 to [`MAX_PORTS`] ports, after the time since the previous call (`dt_ns`, equal for all):
    /// `inputs` has the newest input of each port, on a real clock some ticks may lie between them, and `sets` as many
    /// elements, all [`ContactSet::NONE`]. A set is in the frame of its port.
    ///
    /// The number of ports is constant in a run, and a port keeps its index. With one port the set is that of
    /// [`crate::ContactSetModel::contact_set`], bit for bit, if the model offers both; a run uses one function of an instance
    /// alone. A handle that a device has lost stays at its last pose. Not real-time, but bounded: a call takes less than the
    /// period the model was prepared for.
    fn contact_sets(&mut self, inputs: &[Input], sets: &mut [ContactSet]);
}

/// Function table `flotor.world-contacts/1`: see [`WorldContactsModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct WorldContactsTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the contacts at the inputs of `count` ports, after the time since the previous call; `count` is at least 1 and at
    /// most `MAX_PORTS`, else the status is `OutOfRange`. Returns a [`CallStatus`] code. Not real-time, but bounded.
    pub contact_sets: Option<
        unsafe extern "C" fn(
            instance: Instance,
            count: u32,
            inputs: *const Input,
            sets: *mut ContactSet,
        ) -> u32,
    >,
}

layout! {
    WorldContactsTable { size, reserved, contact_sets }
}

unsafe extern "C" fn contact_sets<M: WorldContactsModel>(
    instance: Instance,
    count: u32,
    inputs: *const Input,
    sets: *mut ContactSet,
) -> u32 {
    let count = match usize::try_from(count) {
        Ok(count @ 1..=MAX_PORTS) => count,
        _ => return CallStatus::OutOfRange as u32,
    };
    // SAFETY: the contract of every table call; `inputs` and `sets` point at `count` structs each, which do not overlap.
    let (inputs, sets) =
        unsafe { (std::slice::from_raw_parts(inputs, count), std::slice::from_raw_parts_mut(sets, count)) };
    // SAFETY: the contract of every table call.
    unsafe {
        call::<ModelAdapter<M>>(instance, |model| {
            model.contact_sets(inputs, sets);
            Ok(())
        })
    }
}

table!(WorldContactsTable: "flotor.world-contacts/1", M: [WorldContactsModel] {
    reserved: 0,
    contact_sets: Some(contact_sets::<M>),
});
