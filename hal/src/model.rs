//! Force models: the trait that an author implements, and the data of one step.

use crate::abi::Str;
use crate::abi::layout::layout;
use crate::{Parameter, Pose, Refusal, SetParameterError, Settings, Twist, Wrench};

layout! {
    Demand { bits }
    Input { pose, twist, time_ns, dt_ns, tick, buttons, demand }
    Output { wrench, energy_j, status, reserved }
    ModelInfo { id, name, doc, serves, memory }
    LoopConfig { period_ns, seed }
}

/// Outputs that a scene needs from a step; other outputs need not be computed.
///
/// The shape is not an output of a step: observers query the shape outside the loop, through the extensions
/// [`crate::extension::centerline`] and [`crate::extension::shape`].
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Demand {
    bits: u32,
}

impl Demand {
    /// Force without torque.
    pub const FORCE: Demand = Demand { bits: 1 };
    /// Torque without force.
    pub const TORQUE: Demand = Demand { bits: 2 };
    /// Stored energy.
    pub const ENERGY: Demand = Demand { bits: 4 };
    /// Force and torque.
    pub const WRENCH: Demand = Demand { bits: 3 };
    /// All outputs of a step.
    pub const ALL: Demand = Demand { bits: 7 };

    /// Returns the union of both sets. Real-time: bounded, no allocation.
    pub const fn with(self, other: Demand) -> Demand {
        Demand { bits: self.bits | other.bits }
    }

    /// Returns the intersection of both sets. Real-time: bounded, no allocation.
    pub const fn limited_to(self, other: Demand) -> Demand {
        Demand { bits: self.bits & other.bits }
    }

    /// Returns true if all of `other` is demanded. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn contains(self, other: Demand) -> bool {
        self.bits & other.bits == other.bits
    }
}

/// Input of a force model for one step. 136 bytes, in the **model frame**.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Input {
    /// Pose of the handle relative to the model's home, m and unit quaternion.
    pub pose: Pose,
    /// Velocity of the handle, m/s and rad/s; the linear part is scaled like the position.
    pub twist: Twist,
    /// Time since the loop started, ns.
    pub time_ns: u64,
    /// Time since the previous step, ns (0 on the first).
    pub dt_ns: u64,
    /// Number of the tick, from 0.
    pub tick: u64,
    /// Buttons of the device, one bit each: 1 while pressed.
    pub buttons: u32,
    /// Outputs that the model must compute.
    pub demand: Demand,
}

impl Input {
    /// Builds the input at a pose, at rest, at time zero, with all outputs demanded: for tests and off-line evaluation.
    pub const fn at_rest(pose: Pose) -> Self {
        Self { pose, twist: Twist::ZERO, time_ns: 0, dt_ns: 0, tick: 0, buttons: 0, demand: Demand::ALL }
    }

    /// Returns the time since the previous step, s; 0 on the first step. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub fn dt_s(&self) -> f64 {
        self.dt_ns as f64 * 1.0e-9
    }
}

/// Status of a model's output.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StepStatus {
    /// The law is valid at this input.
    #[default]
    Ok = 0,
    /// The output was saturated to stay finite and safe.
    Clamped = 1,
    /// The pose is outside the model's domain; the wrench is the best safe continuation.
    OutOfDomain = 2,
    /// An iteration has not reached its tolerance yet.
    NotConverged = 3,
    /// The input was not finite; the wrench is zero.
    InvalidInput = 4,
}

impl StepStatus {
    /// Converts a step status code of the ABI; `None` for an unknown code.
    #[inline]
    #[must_use]
    pub const fn from_code(code: u32) -> Option<Self> {
        match code {
            0 => Some(Self::Ok),
            1 => Some(Self::Clamped),
            2 => Some(Self::OutOfDomain),
            3 => Some(Self::NotConverged),
            4 => Some(Self::InvalidInput),
            _ => None,
        }
    }

    /// Returns the name that `flotor eval` prints.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Clamped => "clamped",
            Self::OutOfDomain => "out_of_domain",
            Self::NotConverged => "not_converged",
            Self::InvalidInput => "invalid_input",
        }
    }
}

/// Output of one step. 64 bytes, in the model frame.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Output {
    /// Force and torque on the hand, N and N·m.
    pub wrench: Wrench,
    /// Stored energy, J, if demanded and served; NaN where the model has none.
    pub energy_j: f64,
    pub(crate) status: u32,
    pub(crate) reserved: u32,
}

impl Output {
    /// Builds an output with its status. Real-time: bounded, no allocation.
    #[inline]
    #[must_use]
    pub const fn new(wrench: Wrench, energy_j: f64, status: StepStatus) -> Self {
        Self { wrench, energy_j, status: status as u32, reserved: 0 }
    }

    /// Returns the status; `None` if a foreign plugin wrote an unknown code.
    #[inline]
    #[must_use]
    pub const fn status(&self) -> Option<StepStatus> {
        StepStatus::from_code(self.status)
    }
}

impl From<Wrench> for Output {
    #[inline]
    fn from(wrench: Wrench) -> Self {
        Self::new(wrench, f64::NAN, StepStatus::Ok)
    }
}

/// Path dependence of the force: a path-dependent model has an internal state.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum Memory {
    /// The wrench depends on the current input only: inputs may be evaluated in any order.
    Stateless = 0,
    /// The wrench also depends on earlier inputs (iteration, friction, contact, branches).
    PathDependent = 1,
}

impl Memory {
    /// Converts a path dependence code of the ABI; an unknown code counts as path-dependent, the safe choice.
    pub(crate) const fn from_code(code: u32) -> Self {
        if code == Self::Stateless as u32 { Self::Stateless } else { Self::PathDependent }
    }
}

/// Declaration of a force model; constant, readable without creating an instance.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct ModelInfo {
    pub(crate) id: Str,
    pub(crate) name: Str,
    pub(crate) doc: Str,
    pub(crate) serves: Demand,
    pub(crate) memory: u32,
}

impl ModelInfo {
    /// Builds a declaration: `id` for scenes and commands ("spring"), `name` and `doc` for display.
    pub const fn new(id: &'static str, name: &'static str, doc: &'static str) -> Self {
        Self {
            id: Str::new(id),
            name: Str::new(name),
            doc: Str::new(doc),
            serves: Demand::WRENCH,
            memory: Memory::Stateless as u32,
        }
    }

    /// Declares the demands that the model can serve (default: force and torque).
    pub const fn serving(mut self, demand: Demand) -> Self {
        self.serves = demand;
        self
    }

    /// Declares the path dependence of the output. If this depends on settings, declare [`Memory::PathDependent`] here
    /// and the path dependence of each instance with [`crate::VariantModel`].
    pub const fn with_memory(mut self, memory: Memory) -> Self {
        self.memory = memory as u32;
        self
    }

    /// Returns the id used in scenes and commands.
    #[must_use]
    pub const fn id(&self) -> &str {
        self.id.as_str()
    }

    /// Returns the display name.
    #[must_use]
    pub const fn name(&self) -> &str {
        self.name.as_str()
    }

    /// Returns the description, one sentence.
    #[must_use]
    pub const fn doc(&self) -> &str {
        self.doc.as_str()
    }

    /// Returns the demands that the model can serve.
    pub const fn serves(&self) -> Demand {
        self.serves
    }

    /// Returns the path dependence of the output; an unknown code counts as path-dependent, the safe choice.
    pub const fn memory(&self) -> Memory {
        Memory::from_code(self.memory)
    }
}

/// Loop settings that a plugin receives before the start. 16 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct LoopConfig {
    /// Nominal time between ticks, ns.
    pub period_ns: u64,
    /// Seed of all random numbers of this run.
    pub seed: u64,
}

/// Force model: computes the wrench for a pose. Implement this trait, then export the type with [`crate::export_model!`].
///
/// ```
/// use flotor_hal::{DVec3, ForceModel, Input, ModelInfo, Output, Parameter, Refusal, Settings, Wrench};
///
/// /// A floor: pushes up where the handle is below home.
/// struct Floor { stiffness_n_per_m: f64 }
///
/// impl ForceModel for Floor {
///     const INFO: ModelInfo = ModelInfo::new("floor", "Floor", "A flat elastic floor");
///     const PARAMETERS: &'static [Parameter] =
///         &[Parameter::real("stiffness_n_per_m", "N/m", 0.0, 5000.0, 500.0, "Stiffness of the floor")];
///
///     fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
///         Ok(Floor { stiffness_n_per_m: settings.number_or_default("stiffness_n_per_m") })
///     }
///
///     fn step(&mut self, input: &Input) -> Output {
///         let depth_m = (-input.pose.position().z).max(0.0);
///         Wrench::from_force(DVec3::Z * self.stiffness_n_per_m * depth_m).into()
///     }
/// }
/// flotor_hal::export_model!(Floor);
/// ```
pub trait ForceModel: Sized + Send + 'static {
    /// Declaration of the model.
    const INFO: ModelInfo;
    /// Parameter schema of the model.
    const PARAMETERS: &'static [Parameter] = &[];

    /// Creates an instance. The settings are already checked against the schema. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if the values are inconsistent.
    fn create(settings: &Settings<'_>) -> Result<Self, Refusal>;

    /// Prepares the model for the loop: its last opportunity to allocate. Not real-time.
    ///
    /// # Errors
    /// A [`Refusal`] if the model cannot run at this rate.
    fn prepare(&mut self, _config: &LoopConfig) -> Result<(), Refusal> {
        Ok(())
    }

    /// Computes the output (wrench, energy, status) for an input. Real-time: bounded, no allocation, lock, system call or
    /// unwinding.
    fn step(&mut self, input: &Input) -> Output;

    /// Computes the outputs for several inputs of one handle, in order. Real-time per input; override this function if a
    /// batch can be computed faster.
    fn step_batch(&mut self, inputs: &[Input], outputs: &mut [Output]) {
        for (input, output) in inputs.iter().zip(outputs) {
            *output = self.step(input);
        }
    }

    /// Changes the live parameter at `index` of [`Self::PARAMETERS`] at a tick boundary; the range is already checked.
    /// Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// [`SetParameterError`]; the old value stays.
    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        let _ = (index, value);
        Err(SetParameterError::Fixed)
    }

    /// Returns the current value of the parameter at `index` of [`Self::PARAMETERS`], including values set by a preset;
    /// NaN if unknown. Real-time: bounded, no allocation.
    fn parameter(&self, index: usize) -> f64 {
        Self::PARAMETERS.get(index).map_or(f64::NAN, Parameter::default)
    }

    /// Restores the state after `create`: clears the history, keeps the parameters. Real-time: bounded, no allocation.
    fn reset(&mut self) {}
}
