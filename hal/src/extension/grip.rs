//! Extension `flotor.grip/1`: one more axis of a handle, between its fingers or at a trigger, with a force in a model.
//!
//! A positive effort opens the grip. The host limits it as it limits a wrench: by range, largest effort and slew rate, and
//! to zero whenever the force has to go. A device offers the axis, a model the effort; each works without the other.

use crate::abi::instance::{call, fill};
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{CallStatus, DeviceAdapter, Instance, ModelAdapter};
use crate::{ActiveDevice, Device, DeviceInfo, ForceModel, Input, ModelInfo, Refusal};

/// Kind of a grip, which decides the units of all its numbers. In C, a `uint32_t` with these values.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GripKind {
    /// Opening in m, velocity in m/s, effort in N.
    Linear = 0,
    /// Opening in rad, velocity in rad/s, effort in N·m.
    Angular = 1,
}

/// Grip of a device as numbers that a host enforces, in the units of its kind. 40 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct GripAxis {
    /// Code of a [`GripKind`].
    kind: u32,
    reserved: u32,
    /// Opening of the closed and of the open grip.
    pub range: [f64; 2],
    /// Largest effort in both directions; 0: the grip is sensed only.
    pub max_effort: f64,
    /// Maximum slew rate of the effort, per s.
    pub max_slew_per_s: f64,
}

impl GripAxis {
    /// Builds the declaration of a grip with an effort up to `max_effort`, which it reaches in 0.5 ms.
    pub const fn new(kind: GripKind, range: [f64; 2], max_effort: f64) -> Self {
        Self { kind: kind as u32, reserved: 0, range, max_effort, max_slew_per_s: max_effort / 0.5e-3 }
    }

    /// Sets the maximum slew rate of the effort, per s.
    pub const fn with_slew(self, max_slew_per_s: f64) -> Self {
        Self { max_slew_per_s, ..self }
    }

    /// Returns the kind of the grip; a host rejects a declaration of another kind.
    #[must_use]
    pub const fn kind(&self) -> GripKind {
        if self.kind == GripKind::Angular as u32 { GripKind::Angular } else { GripKind::Linear }
    }

    /// Returns the state of the grip at rest at the closed end of its range.
    pub const fn at_rest(&self) -> GripState {
        let [opening, _] = self.range;
        GripState { opening, velocity: 0.0, delivered: 0.0, kind: self.kind, reserved: 0 }
    }

    /// Rejects a declaration that no host can enforce. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] for an unknown kind, or a number outside its limits.
    pub fn check(&self) -> Result<(), Refusal> {
        let [closed, open] = self.range;
        let is_possible = self.kind <= GripKind::Angular as u32
            && (closed.abs() <= 100.0 && closed < open && open <= 100.0)
            && (0.0..=1.0e5).contains(&self.max_effort)
            && (self.max_effort == 0.0 || (self.max_slew_per_s > 0.0 && self.max_slew_per_s <= 1.0e10));
        is_possible.then_some(()).ok_or_else(|| {
            Refusal::broken(format!(
                "the grip is of kind {} with range {closed} to {open}, effort {} and slew rate {}: the kind must be 0 or 1, \
                 the range within ±100 with the closed end first, the effort 0 to 1e5, and the slew rate above 0, at most 1e10",
                self.kind, self.max_effort, self.max_slew_per_s
            ))
        })
    }
}

/// Sample of a grip, in the units of its kind. 32 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct GripState {
    /// Opening, larger when the grip is more open.
    pub opening: f64,
    /// Velocity of the opening, positive while the grip opens.
    pub velocity: f64,
    /// Effort delivered since the previous tick, as reported by the device.
    pub delivered: f64,
    /// Code of a [`GripKind`], set by the host.
    kind: u32,
    reserved: u32,
}

impl GripState {
    /// Returns the kind of the grip. Real-time: bounded, no allocation.
    #[must_use]
    pub const fn kind(&self) -> GripKind {
        if self.kind == GripKind::Angular as u32 { GripKind::Angular } else { GripKind::Linear }
    }

    /// Builds a sample without delivered effort, of a grip of this kind. Real-time: bounded, no allocation.
    pub const fn new(kind: GripKind, opening: f64, velocity: f64) -> Self {
        Self { opening, velocity, delivered: 0.0, kind: kind as u32, reserved: 0 }
    }

    /// Sets the delivered effort. Real-time: bounded, no allocation.
    pub const fn with_delivered(self, delivered: f64) -> Self {
        Self { delivered, ..self }
    }
}

/// Opened device that may have a grip: `export_device!(Crank, grip)`.
pub trait GripDevice: Device<Active: ActiveGrip> {
    /// Returns the grip, the same at every call; `None` for a device without one. Not real-time.
    fn grip_axis(&self) -> Option<GripAxis>;
}

/// Energised device with a grip. A stop, a fault and the device's watchdog remove its effort together with the wrench.
pub trait ActiveGrip: ActiveDevice {
    /// Writes opening, velocity and delivered effort of the sample that the last `read` took. Called after each `read`
    /// with a new sample. Real-time: bounded, no allocation.
    fn read_grip(&mut self, state: &mut GripState);

    /// Sets the effort that the next `write` commands together with its wrench. Called before each `write`. Real-time:
    /// bounded, no allocation.
    fn write_grip(&mut self, effort: f64);
}

/// Force model with an effort at the grip: `export_model!(Tongs, grip)`.
pub trait GripModel: ForceModel {
    /// Returns the effort on the hand at this grip, in the units of its kind; positive: it opens the grip. Lengths and
    /// forces are in the scale of the model; the stored energy of a step does not contain the grip. Called on devices with
    /// a grip, right after the step with the same input. Real-time: bounded, no allocation.
    fn grip(&mut self, input: &Input, grip: &GripState) -> f64;
}

/// Function table `flotor.grip/1`: see [`GripDevice`], [`ActiveGrip`] and [`GripModel`]. A device sets the first three
/// functions, a model the last. All return a [`crate::abi::CallStatus`] code.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct GripTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the grip of an opened device; `Unsupported` without one. Not real-time.
    pub axis: Option<unsafe extern "C" fn(instance: Instance, axis: *mut GripAxis) -> u32>,
    /// Writes the sample that the last `read` of an active device took. Real-time.
    pub read: Option<unsafe extern "C" fn(instance: Instance, state: *mut GripState) -> u32>,
    /// Sets the effort that the next `write` of an active device commands. Real-time.
    pub write: Option<unsafe extern "C" fn(instance: Instance, effort: f64) -> u32>,
    /// Writes the effort of a model at a grip, right after the step with the same input. Real-time.
    pub effort: Option<
        unsafe extern "C" fn(
            instance: Instance,
            input: *const Input,
            grip: *const GripState,
            effort: *mut f64,
        ) -> u32,
    >,
}

layout! {
    GripAxis { kind, reserved, range, max_effort, max_slew_per_s }
    GripState { opening, velocity, delivered, kind, reserved }
    GripTable { size, reserved, axis, read, write, effort }
}

/// Plugin type with its functions. The compiler infers `Info`, the declaration of a model or a device.
#[doc(hidden)]
pub trait GripPlugin<Info>: Sized + 'static {
    const FUNCTIONS: GripTable;
}

const NONE: GripTable = GripTable { size: 0, reserved: 0, axis: None, read: None, write: None, effort: None };

impl<M: GripModel> GripPlugin<ModelInfo> for M {
    const FUNCTIONS: GripTable = GripTable { effort: Some(effort::<M>), ..NONE };
}

impl<D: GripDevice> GripPlugin<DeviceInfo> for D {
    const FUNCTIONS: GripTable =
        GripTable { axis: Some(axis::<D>), read: Some(read::<D>), write: Some(write::<D>), ..NONE };
}

unsafe extern "C" fn axis<D: GripDevice>(instance: Instance, axis: *mut GripAxis) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe {
        fill::<DeviceAdapter<D>, _>(instance, axis, |phase| {
            phase.opened()?.grip_axis().ok_or(CallStatus::Unsupported)
        })
    }
}

unsafe extern "C" fn read<D: GripDevice>(instance: Instance, state: *mut GripState) -> u32 {
    // SAFETY: the contract of every table call; `state` is the callee's for the call.
    unsafe {
        call::<DeviceAdapter<D>>(instance, |phase| {
            phase.active()?.read_grip(&mut *state);
            Ok(())
        })
    }
}

unsafe extern "C" fn write<D: GripDevice>(instance: Instance, effort: f64) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe {
        call::<DeviceAdapter<D>>(instance, |phase| {
            phase.active()?.write_grip(effort);
            Ok(())
        })
    }
}

unsafe extern "C" fn effort<M: GripModel>(
    instance: Instance,
    input: *const Input,
    grip: *const GripState,
    effort: *mut f64,
) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, effort, |model| Ok(model.grip(&*input, &*grip))) }
}

table!(GripTable: "flotor.grip/1", P of Info: [GripPlugin<Info>] { ..P::FUNCTIONS });

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_grip_that_can_be_enforced_is_accepted() {
        let pincers = GripAxis::new(GripKind::Linear, [0.0, 0.025], 8.0);
        let trigger = GripAxis::new(GripKind::Angular, [-0.5, 0.1], 0.0).with_slew(f64::INFINITY);
        assert_eq!((pincers.check(), trigger.check()), (Ok(()), Ok(())), "driven, and sensed only");
        assert_eq!((pincers.max_slew_per_s, trigger.kind()), (16.0e3, GripKind::Angular));
        let wrong = [
            GripAxis { kind: 2, ..pincers },
            GripAxis { range: [0.025, 0.0], ..pincers },
            GripAxis { range: [0.0, f64::NAN], ..pincers },
            GripAxis { range: [f64::NEG_INFINITY, 0.0], ..pincers },
            GripAxis { max_effort: f64::INFINITY, ..pincers },
            GripAxis { max_effort: -1.0, ..pincers },
            pincers.with_slew(0.0),
            pincers.with_slew(f64::NAN),
        ];
        for axis in wrong {
            let reason = axis.check().expect_err("no host can enforce it").reason;
            assert!(reason.starts_with("the grip is of kind ") && !reason.contains('\n'), "{reason}");
        }
    }
}
