//! Extension `flotor.world/1`: one object that several devices touch at once.
//!
//! A *port* is the place at which one device touches the object: pose and twist in, wrench out. An instance has one state
//! and up to [`MAX_PORTS`] ports, so that each hand feels what the other hands do to the object. The host maps each port
//! as it maps a model on one device, limits each wrench by itself, and replaces the object at all ports in one tick.

use crate::abi::instance::call;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{CallStatus, Instance, ModelAdapter};
use crate::{ForceModel, Input, Output};

/// Largest number of ports of an object.
pub const MAX_PORTS: usize = 4;

/// Force model of an object with several ports: `export_model!(Bar, world)`.
///
/// ```
/// # use flotor_hal::*;
/// # struct Bar;
/// # impl ForceModel for Bar {
/// #     const INFO: ModelInfo = ModelInfo::new("bar", "Bar", "A spring between two hands");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> { Ok(Self) }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// A spring of 500 N/m between all handles: each is drawn to the middle of them.
/// impl WorldModel for Bar {
///     fn step_ports(&mut self, inputs: &[Input], outputs: &mut [Output]) {
///         let middle_m = inputs.iter().map(|input| input.pose.position()).sum::<DVec3>() / inputs.len() as f64;
///         for (input, output) in inputs.iter().zip(outputs) {
///             *output = Wrench::from_force(500.0 * (middle_m - input.pose.position())).into();
///         }
///     }
/// }
/// let at = |x_m| Input::at_rest(Pose::new(DVec3::X * x_m, DQuat::IDENTITY));
/// let mut outputs = [Output::default(); 2];
/// Bar.step_ports(&[at(-0.01), at(0.01)], &mut outputs);
/// assert_eq!(outputs.map(|output| output.wrench.force().x), [5.0, -5.0]);
/// ```
pub trait WorldModel: ForceModel {
    /// Steps the object once, for 1 to [`MAX_PORTS`] ports: `inputs` has the input of each port, all of the same tick, and
    /// `outputs` as many elements. An output has the wrench on the hand at its port, and a part of the stored energy: the
    /// energies of all ports add up to that of the object. A model that serves torque and energy computes an output at a
    /// port only if its input demands it; what one port demands does not change the numbers of another.
    ///
    /// The number of ports is constant in a run, and a port keeps its index. With one port the outputs are those of
    /// [`ForceModel::step`], bit for bit; a run uses either function of an instance, never both. A handle that a device has
    /// lost stays at its last pose. With [`crate::GripModel`] the effort of each port with a grip is computed after the
    /// step, in the order of the ports. Real-time: bounded, no allocation, lock, system call or unwinding.
    fn step_ports(&mut self, inputs: &[Input], outputs: &mut [Output]);
}

/// Function table `flotor.world/1`: see [`WorldModel`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct WorldTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Steps the object once, with the inputs of `count` ports, and writes an output for each; `count` is at least 1 and at
    /// most `MAX_PORTS`, else the status is `OutOfRange`. Returns a [`CallStatus`] code. Real-time.
    pub step_ports: Option<
        unsafe extern "C" fn(
            instance: Instance,
            count: u32,
            inputs: *const Input,
            outputs: *mut Output,
        ) -> u32,
    >,
}

layout! {
    WorldTable { size, reserved, step_ports }
}

unsafe extern "C" fn step_ports<M: WorldModel>(
    instance: Instance,
    count: u32,
    inputs: *const Input,
    outputs: *mut Output,
) -> u32 {
    let count = match usize::try_from(count) {
        Ok(count @ 1..=MAX_PORTS) => count,
        _ => return CallStatus::OutOfRange as u32,
    };
    // SAFETY: the contract of every table call; `inputs` and `outputs` point at `count` structs each, which do not overlap.
    let (inputs, outputs) = unsafe {
        (std::slice::from_raw_parts(inputs, count), std::slice::from_raw_parts_mut(outputs, count))
    };
    // SAFETY: the contract of every table call.
    unsafe {
        call::<ModelAdapter<M>>(instance, |model| {
            model.step_ports(inputs, outputs);
            Ok(())
        })
    }
}

table!(WorldTable: "flotor.world/1", M: [WorldModel] {
    reserved: 0,
    step_ports: Some(step_ports::<M>),
});
