#![doc = include_str!("../README.md")]
//!
//! # The loop
//!
//! A **device** gives the pose of a handle and takes a wrench. A **force model** gives the wrench for a pose.
//! A host runs both in a loop at a thousand ticks per second or more. The host maps frames and scales between device and
//! model and, after the model, enforces limits that no plugin can bypass:
//!
//! ```text
//! device.read -> mapping -> model.step -> mapping -> envelope -> device.write
//! ```
//!
//! Everything is SI and `f64`, in right-handed frames with z up; names contain the unit. A wrench is always
//! the force and torque **on the hand**.
//!
//! # Thread classes
//!
//! Every function is documented as one of:
//! - *Not real-time*: may allocate, block and call the system. Runs before the loop starts, or in another thread.
//! - *Real-time: bounded, no allocation*: runs inside a tick. No allocation, lock, system call, formatting or panic;
//!   the boundary catches a panic, but disables the instance, and the tick has no force.
//!
//! # Where to look
//!
//! - Models: [`ForceModel`], [`export_model!`]; parameters: [`Parameter`], [`Settings`].
//! - Devices: [`SimpleDevice`], or [`Device`] and [`ActiveDevice`] where phases differ; [`SafeStop`], [`export_device!`].
//! - Optional interfaces of a plugin: [`extension`].
//! - Rules for every plugin: [`conformance`]; functions with the same bits on every machine: [`math`]; text for a
//!   terminal: [`terminal`].
//! - The binary contract, not needed by authors in Rust: [`abi`].

pub mod abi;
pub mod conformance;
mod device;
pub mod extension;
mod frame;
pub mod math;
mod model;
mod parameter;
mod refusal;
mod sampled_loop;
mod simple_device;
mod table;
pub mod terminal;
mod text_file;
mod velocity_filter;

pub use abi::Choices;
pub use device::{
    ActiveDevice, Axes, Capabilities, Conditions, Cycle, Device, DeviceInfo, DeviceState, Embodiment, Fault,
    NothingToStop, SafeStop, Tick,
};
pub use extension::active_region::{ActiveRegion, ActiveRegionModel, RegionShape};
pub use extension::calibration::{
    CALIBRATION_COEFFICIENTS, CalibrationDevice, InvalidCalibration, VerticalCalibration,
};
pub use extension::centerline::{CenterlineInfo, CenterlineModel};
pub use extension::connection::{ConnectionDevice, UsbAccess, UsbKind};
pub use extension::contact_set::{Contact, ContactSet, ContactSetModel, MAX_CONTACTS};
pub use extension::details::{Detail, DetailsModel};
pub use extension::energy_ledger::{EnergyLedger, EnergyLedgerDevice};
pub use extension::grip::{ActiveGrip, GripAxis, GripDevice, GripKind, GripModel, GripState};
pub use extension::independent_stop::{
    IndependentStop, IndependentStopDevice, STOP_MESSAGE_BYTES, StoppedState,
};
pub use extension::linear_field::{LinearField, LinearFieldModel};
pub use extension::pacing::{PacingDevice, SampleWait};
pub use extension::shape::{
    Form, InvalidShape, Part, Primitive, ScalarField, Shape, ShapeModel, Sides, Surface, SurfaceVertex,
};
pub use extension::snapshot::{Restorable, StateBytes};
pub use extension::soft_range::{SoftRange, SoftRangeModel};
pub use extension::variant::{VariantInfo, VariantModel};
pub use extension::workspace_bounds::{WorkspaceBounds, WorkspaceBoundsModel};
pub use extension::world::{MAX_PORTS, WorldModel};
pub use extension::world_contacts::WorldContactsModel;
pub use frame::{Pose, Twist, Wrench, orientation_from_rotation_vector, rotation_vector};
pub use glam;
pub use glam::{DMat3, DQuat, DVec3};
pub use model::{Demand, ForceModel, Input, LoopConfig, Memory, ModelInfo, Output, StepStatus};
pub use parameter::{
    Mutability, OutOfRange, Parameter, ParameterKind, ParameterValue, SetParameterError, Settings,
};
pub use refusal::{Refusal, RefusalKind};
pub use sampled_loop::{Damper, SampledLoop};
pub use simple_device::{ActiveSimple, Opened, Simple, SimpleDevice, SimpleStop, StopFlag};
pub use table::{HashLines, Row, Table};
pub use text_file::{TextProblem, open_file, read_file, read_text, text_from_bytes};
pub use velocity_filter::VelocityFilter;
