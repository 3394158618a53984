//! Extension `flotor.centerline/1`: centreline of a slender deformable body, for visualisation.
//!
//! An observer creates its own instance of the model with the same parameters and queries the instance at its own rate;
//! the servo loop never calls this extension. A curve with a frame along it draws a rod, a rope or (with turns) a coil
//! spring.

use crate::abi::instance::{call, fill};
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{CallStatus, Instance, ModelAdapter};
use crate::{ForceModel, Input, Pose};

/// Drawing style of the body around its centreline: a tube, or a wire wound about the centreline. 40 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct CenterlineInfo {
    /// Radius of the drawn tube or wire, m.
    pub tube_radius_m: f64,
    /// Radius of the wire's helix about the centreline, m; 0 draws a plain tube.
    pub helix_radius_m: f64,
    /// Turns of the helix over the whole length; 0 for a plain tube.
    pub helix_turns: f64,
    /// Radius of the end plates, m; 0 for none.
    pub plate_radius_m: f64,
    /// Recommended number of points on the centreline.
    pub suggested_points: u32,
    pub(crate) reserved: u32,
}

impl CenterlineInfo {
    /// Returns the style of a wire of radius `wire_radius_m` wound `turns` times at `helix_radius_m` between plates.
    #[must_use]
    pub const fn coil(wire_radius_m: f64, helix_radius_m: f64, turns: f64, plate_radius_m: f64) -> Self {
        Self {
            tube_radius_m: wire_radius_m,
            helix_radius_m,
            helix_turns: turns,
            plate_radius_m,
            suggested_points: 65,
            reserved: 0,
        }
    }
}

/// Force model with a centreline. Not real-time.
///
/// ```
/// # use flotor_hal::*;
/// # struct Foam { depth_m: f64, look: Shape }
/// # impl ForceModel for Foam {
/// #     const INFO: ModelInfo = ModelInfo::new("foam", "Foam", "A soft ball");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Self { depth_m: 0.0, look: Shape::default() })
/// #     }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// A tube from home to the handle: `export_model!(Foam, centerline)`.
/// impl CenterlineModel for Foam {
///     fn centerline_info(&self) -> CenterlineInfo {
///         let mut info = CenterlineInfo::default();
///         info.tube_radius_m = 0.002;
///         info
///     }
///
///     fn centerline(&mut self, input: &Input, points: &mut [Pose]) -> usize {
///         let last = points.len().saturating_sub(1).max(1) as f64;
///         for (number, point) in points.iter_mut().enumerate() {
///             *point = Pose::new(input.pose.position() * (number as f64 / last), DQuat::IDENTITY);
///         }
///         points.len()
///     }
/// }
/// # let mut foam = Foam { depth_m: 0.0, look: Shape::default() };
/// let (handle, mut points) = (Pose::new(DVec3::Z * -0.004, DQuat::IDENTITY), [Pose::HOME; 5]);
/// assert_eq!(foam.centerline(&Input::at_rest(handle), &mut points), 5);
/// assert_eq!(points[2].position(), DVec3::Z * -0.002); // halfway
/// ```
pub trait CenterlineModel: ForceModel {
    /// Returns the drawing style of the body with the current parameters.
    fn centerline_info(&self) -> CenterlineInfo;

    /// Fills `points` from the fixed end to the handle, evenly in arc length of the undeformed body: position (m, model
    /// frame) and section frame (z along the section normal). Returns the number of valid points.
    fn centerline(&mut self, input: &Input, points: &mut [Pose]) -> usize;
}

/// Function table `flotor.centerline/1`: see [`CenterlineModel`]. Not real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct CenterlineTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the drawing style of the body; returns a [`crate::abi::CallStatus`] code.
    pub info: Option<unsafe extern "C" fn(instance: Instance, out: *mut CenterlineInfo) -> u32>,
    /// Fills up to `capacity` points from the fixed end to the handle and writes the number of valid points to `count`;
    /// returns a [`crate::abi::CallStatus`] code.
    pub centerline: Option<
        unsafe extern "C" fn(
            instance: Instance,
            input: *const Input,
            points: *mut Pose,
            capacity: u32,
            count: *mut u32,
        ) -> u32,
    >,
}

layout! {
    CenterlineInfo { tube_radius_m, helix_radius_m, helix_turns, plate_radius_m, suggested_points, reserved }
    CenterlineTable { size, reserved, info, centerline }
}
unsafe extern "C" fn info<M: CenterlineModel>(instance: Instance, out: *mut CenterlineInfo) -> u32 {
    // SAFETY: the contract of every table call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, out, |model| Ok(model.centerline_info())) }
}

unsafe extern "C" fn centerline<M: CenterlineModel>(
    instance: Instance,
    input: *const Input,
    points: *mut Pose,
    capacity: u32,
    count: *mut u32,
) -> u32 {
    if capacity == 0 {
        return CallStatus::OutOfRange as u32;
    }
    // SAFETY: the contract of every table call; `points` has room for `capacity` poses.
    unsafe {
        call::<ModelAdapter<M>>(instance, |model| {
            let points = std::slice::from_raw_parts_mut(points, capacity as usize);
            let valid = model.centerline(&*input, points);
            count.write(u32::try_from(valid).unwrap_or(capacity).min(capacity));
            Ok(())
        })
    }
}

table!(CenterlineTable: "flotor.centerline/1", M: [CenterlineModel] {
    reserved: 0,
    info: Some(info::<M>),
    centerline: Some(centerline::<M>),
});
