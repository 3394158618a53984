//! Flotor's contract between a host, force models and devices.
//!
//! # The model in one page
//!
//! A **device** gives the pose of a handle and takes a wrench. A **force model** gives the wrench for a pose.
//! A host runs both in a loop of a thousand ticks a second and more; between them it maps frames and scales
//! and, after the model, enforces limits no plugin can bypass:
//!
//! ```text
//! device.read -> mapping -> model.step -> mapping -> envelope -> device.write
//! ```
//!
//! Everything is SI and `f64`, in right-handed frames with z up; units stand in the names. A wrench is always
//! the force and torque **on the hand**.
//!
//! # Thread classes
//!
//! Every function says one of:
//! - *Not real-time*: may allocate, block and talk to the system. Runs before the loop starts or beside it.
//! - *Real-time: bounded, no allocation*: runs inside a tick. No allocation, lock, system call, formatting or
//!   panic; the boundary catches a panic, but it costs the instance its life and the tick its force.
//!
//! # Writing a plugin
//!
//! Implement [`ForceModel`] or [`Device`] and write [`export_model!`] or [`export_device!`]; set
//! `crate-type = ["cdylib", "rlib"]`. The trait's documentation has a whole model in twenty lines. You never
//! see the binary contract; it is in [`abi`], and C authors get it as `include/flotor.h`.

pub mod abi;
mod activity;
mod calibration;
pub mod conformance;
mod detail;
mod device;
mod field;
mod frame;
pub mod math;
mod model;
mod pacing;
mod parameter;
mod reach;
mod refusal;
mod shape;
mod variant;

pub use activity::{ActivityRegion, ActivityShape, LocalModel};
pub use calibration::{CALIBRATION_COEFFICIENTS, InvalidCalibration, VerticalCalibration};
pub use detail::{Detail, DetailedModel};
pub use device::{
    ActiveDevice, Axes, Capabilities, Conditions, Cycle, Device, DeviceInfo, DeviceState, EnergyLedger,
    Fault, NothingToStop, SafeStop, Tick,
};
pub use field::{FieldModel, LinearField};
pub use frame::{Pose, Twist, Wrench, orientation_from_rotation_vector, rotation_vector};
pub use glam;
pub use glam::{DMat3, DQuat, DVec3};
pub use model::{Demand, ForceModel, Input, LoopConfig, Memory, ModelInfo, Output, StepStatus};
pub use pacing::{Pacing, SampleWait};
pub use parameter::{Mutability, OutOfRange, Parameter, ParameterKind, ParameterValue, Settings};
pub use reach::{BoundedModel, Reach};
pub use refusal::{Refusal, RefusalKind};
pub use shape::{CenterlineInfo, CenterlineModel};
pub use variant::{VariantInfo, VariantModel};
