//! Extension `flotor.snapshot/1`: saves and restores the state of a model or of an active device.
//!
//! The state consists of all numbers of an instance that affect later outputs, except parameters and loop settings: an
//! instance of the same plugin with equal parameters and loop settings continues after a restore with the same bits. A
//! model without a history has an empty state and needs no extension.

use crate::abi::instance::call;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{CallStatus, DeviceAdapter, Instance, ModelAdapter};
use crate::{Device, ForceModel};
use glam::{BVec3, DMat2, DQuat, DVec2, DVec3};

/// State of a model, of an active device or of a part of them, which passes all its numbers in one order to count, save
/// or restore them. The number of bytes is constant while the instance is prepared or active.
///
/// ```
/// # use flotor_hal::*;
/// # struct Foam { depth_m: f64, stiffness_n_per_m: f64 }
/// # impl ForceModel for Foam {
/// #     const INFO: ModelInfo = ModelInfo::new("foam", "Foam", "A soft ball").with_memory(Memory::PathDependent);
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> { Ok(Self { depth_m: 0.0, stiffness_n_per_m: 9.0 }) }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// // Fields of the state, then all other fields: `export_model!(Foam, snapshot)`.
/// restorable!(Foam { depth_m } without { stiffness_n_per_m });
/// # export_model!(Foam, snapshot);
/// ```
pub trait Restorable {
    /// Passes every number of the state. Real-time: bounded by the size of the state, no allocation.
    fn pass(&mut self, bytes: &mut StateBytes<'_>);
}

/// Implements [`Restorable`] for a struct: `restorable!(Seat { tilt_rad, hold } without { radius_m })` lists the fields
/// of the state, then all others. A struct with type or constant parameters: `restorable!([const N: usize] Shape<N> { .. })`.
/// An enum without data: `restorable!(Branch = Unbuckled | Buckled)`, with all its variants.
#[macro_export]
macro_rules! restorable {
    ($name:ident = $($variant:ident)|+) => {
        impl $crate::Restorable for $name {
            fn pass(&mut self, bytes: &mut $crate::StateBytes<'_>) {
                match self { $(Self::$variant => {})+ } // a missing variant is a compile error
                bytes.choice(self, &[$(Self::$variant),+]);
            }
        }
    };
    ([$($generics:tt)*] $name:ty { $($field:ident),* $(,)? } $(without { $($other:ident),* $(,)? })?) => {
        impl<$($generics)*> $crate::Restorable for $name {
            fn pass(&mut self, bytes: &mut $crate::StateBytes<'_>) {
                let Self { $($field,)* $($($other: _,)*)? } = self;
                $($crate::Restorable::pass($field, bytes);)*
            }
        }
    };
    ($name:ident $($fields:tt)+) => { $crate::restorable!([] $name $($fields)+); };
}

/// Bytes of a state that are counted, saved or restored.
pub struct StateBytes<'a> {
    direction: Direction<'a>,
    /// Number of bytes so far.
    count: usize,
    is_valid: bool,
}

enum Direction<'a> {
    Count,
    Save(&'a mut [u8]),
    Restore(&'a [u8]),
}

impl StateBytes<'_> {
    /// Passes a state; returns its number of bytes, or `OutOfRange` if the bytes are not a state.
    fn run(state: &mut dyn Restorable, direction: Direction<'_>) -> Result<u64, CallStatus> {
        let mut bytes = StateBytes { direction, count: 0, is_valid: true };
        state.pass(&mut bytes);
        if bytes.is_valid { Ok(bytes.count as u64) } else { Err(CallStatus::OutOfRange) }
    }

    /// Passes a state to or from `given` bytes, if that is its number of bytes.
    fn run_all(state: &mut dyn Restorable, given: u64, direction: Direction<'_>) -> Result<(), CallStatus> {
        let count = StateBytes::run(state, Direction::Count)?;
        if count == given { StateBytes::run(state, direction).map(drop) } else { Err(CallStatus::OutOfRange) }
    }

    /// Saves the bytes of a number, or returns the saved bytes in their place. Real-time: bounded, no allocation.
    pub fn number<const N: usize>(&mut self, present: [u8; N]) -> [u8; N] {
        let place = self.count..self.count + N;
        self.count = place.end;
        match &mut self.direction {
            Direction::Count => {}
            Direction::Save(all) => {
                all.get_mut(place).into_iter().for_each(|to| to.copy_from_slice(&present))
            }
            Direction::Restore(all) => {
                return all.get(place).and_then(|from| from.try_into().ok()).unwrap_or(present);
            }
        }
        present
    }

    /// Passes one of several values as its index in `all`; an index without a value makes the restore fail. Real-time:
    /// bounded, no allocation.
    pub fn choice<T: Copy + PartialEq>(&mut self, value: &mut T, all: &[T]) {
        let index = all.iter().position(|one| one == value).unwrap_or(all.len());
        match all.get(usize::from(self.number([u8::try_from(index).unwrap_or(u8::MAX)])[0])) {
            Some(restored) => *value = *restored,
            None => self.is_valid = false,
        }
    }
}

macro_rules! numbers {
    ($($number:ty),+) => {
        $(impl Restorable for $number {
            #[inline]
            fn pass(&mut self, bytes: &mut StateBytes<'_>) {
                *self = Self::from_le_bytes(bytes.number(self.to_le_bytes()));
            }
        })+
    };
}
numbers!(u8, u32, u64, u128, i64, f64);
restorable!(BVec3 { x, y, z });
restorable!(DVec2 { x, y });
restorable!(DVec3 { x, y, z });
restorable!(DQuat { x, y, z, w });
restorable!(DMat2 { x_axis, y_axis });

impl Restorable for bool {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        bytes.choice(self, &[false, true]);
    }
}

impl Restorable for usize {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        let mut number = *self as u64;
        number.pass(bytes);
        *self = usize::try_from(number).unwrap_or(*self);
    }
}

impl<T: Restorable, const N: usize> Restorable for [T; N] {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        self.iter_mut().for_each(|element| element.pass(bytes));
    }
}

impl<A: Restorable, B: Restorable> Restorable for (A, B) {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        self.0.pass(bytes);
        self.1.pass(bytes);
    }
}

/// The number of elements is not part of the state.
impl<T: Restorable> Restorable for Vec<T> {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        self.iter_mut().for_each(|element| element.pass(bytes));
    }
}

/// The same number of bytes with a value and without.
impl<T: Restorable + Default + Copy> Restorable for Option<T> {
    fn pass(&mut self, bytes: &mut StateBytes<'_>) {
        let (mut is_some, mut value) = (self.is_some(), self.unwrap_or_default());
        is_some.pass(bytes);
        value.pass(bytes);
        *self = is_some.then_some(value);
    }
}

/// Function table `flotor.snapshot/1`: see [`Restorable`]. Real-time: bounded by the size of the state. Calls on a device
/// are valid in the active phase only. All return a [`crate::abi::CallStatus`] code.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct SnapshotTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the number of bytes of the state, constant while the instance is prepared or active.
    pub count: Option<unsafe extern "C" fn(instance: Instance, out: *mut u64) -> u32>,
    /// Writes the state to `count` bytes; `OutOfRange` for another number of bytes.
    pub save: Option<unsafe extern "C" fn(instance: Instance, bytes: *mut u8, count: u64) -> u32>,
    /// Restores a state from `count` bytes; `OutOfRange` for another number of bytes, and for bytes that are not a state:
    /// the caller then resets or destroys the instance.
    pub restore: Option<unsafe extern "C" fn(instance: Instance, bytes: *const u8, count: u64) -> u32>,
}

layout! {
    SnapshotTable { size, reserved, count, save, restore }
}

/// Plugin type with a restorable state. The compiler infers `Kind`, the main trait of the type.
#[doc(hidden)]
pub trait SnapshotPlugin<Kind>: Sized + 'static {
    /// Runs `body` on the state; returns a [`CallStatus`] code.
    ///
    /// # Safety
    /// The contract of every table call.
    unsafe fn with_state(instance: Instance, body: StateCall<'_>) -> u32;
}

#[doc(hidden)]
pub type StateCall<'a> = &'a mut dyn FnMut(&mut dyn Restorable) -> Result<(), CallStatus>;
#[doc(hidden)]
pub enum ModelKind {}
#[doc(hidden)]
pub enum DeviceKind {}

impl<M: ForceModel + Restorable> SnapshotPlugin<ModelKind> for M {
    unsafe fn with_state(instance: Instance, body: StateCall<'_>) -> u32 {
        // SAFETY: by the contract of this function.
        unsafe { call::<ModelAdapter<M>>(instance, |model| body(model)) }
    }
}

impl<D: Device<Active: Restorable>> SnapshotPlugin<DeviceKind> for D {
    unsafe fn with_state(instance: Instance, body: StateCall<'_>) -> u32 {
        // SAFETY: by the contract of this function.
        unsafe { call::<DeviceAdapter<D>>(instance, |phase| body(phase.active()?)) }
    }
}

unsafe extern "C" fn count<P: SnapshotPlugin<Kind>, Kind>(instance: Instance, out: *mut u64) -> u32 {
    // SAFETY: the contract of every table call; `out` is valid for a write.
    unsafe {
        P::with_state(instance, &mut |state| {
            out.write(StateBytes::run(state, Direction::Count)?);
            Ok(())
        })
    }
}

unsafe extern "C" fn save<P: SnapshotPlugin<Kind>, Kind>(
    instance: Instance,
    bytes: *mut u8,
    count: u64,
) -> u32 {
    let Ok(length) = usize::try_from(count) else { return CallStatus::OutOfRange as u32 };
    // SAFETY: the contract of every table call; `bytes` is not null and valid for `count` bytes.
    unsafe {
        let bytes = std::slice::from_raw_parts_mut(bytes, length);
        P::with_state(instance, &mut |state| StateBytes::run_all(state, count, Direction::Save(&mut *bytes)))
    }
}

unsafe extern "C" fn restore<P: SnapshotPlugin<Kind>, Kind>(
    instance: Instance,
    bytes: *const u8,
    count: u64,
) -> u32 {
    let Ok(length) = usize::try_from(count) else { return CallStatus::OutOfRange as u32 };
    // SAFETY: as in `save`.
    unsafe {
        let bytes = std::slice::from_raw_parts(bytes, length);
        P::with_state(instance, &mut |state| StateBytes::run_all(state, count, Direction::Restore(bytes)))
    }
}

table!(SnapshotTable: "flotor.snapshot/1", P of Kind: [SnapshotPlugin<Kind>] {
    reserved: 0,
    count: Some(count::<P, Kind>),
    save: Some(save::<P, Kind>),
    restore: Some(restore::<P, Kind>),
});
