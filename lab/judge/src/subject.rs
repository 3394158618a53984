//! Model under test: one instance that is stepped, and replaced after a panic.
//!
//! A stateless model is stepped directly. A model with memory is walked to each pose in small steps, as a hand would
//! take it there, and held until it has converged.

use crate::PERIOD_NS;
use crate::watch::enter_call;
use flotor_hal::abi::CallStatus;
use flotor_hal::{
    DVec3, Demand, Input, LoopConfig, Memory, Output, Pose, StepStatus, Twist,
    orientation_from_rotation_vector, rotation_vector,
};
use flotor_loader::{LoadError, Model, Plugin, Setting};

/// Largest translation in a step of a walk, m.
const STEP_M: f64 = 0.05e-3;
/// Largest rotation in a step of a walk, rad.
const STEP_RAD: f64 = 0.002;
/// Maximum number of steps of a walk; a pose farther away is approached in larger steps.
const MOST_STEPS: f64 = 4000.0;
/// Maximum number of ticks for which a handle is held for the model to converge.
const MOST_HOLDS: usize = 2000;

/// Creates and prepares an instance for a loop of 1 kHz.
///
/// # Errors
/// [`LoadError`] if the plugin is not a model, or rejects the settings or the loop.
pub fn prepared(plugin: &Plugin, settings: &[Setting], seed: u64) -> Result<Model, LoadError> {
    prepared_for(plugin, settings, &LoopConfig { period_ns: PERIOD_NS, seed })
}

/// Creates and prepares an instance for a loop.
///
/// # Errors
/// As [`prepared`].
pub fn prepared_for(plugin: &Plugin, settings: &[Setting], config: &LoopConfig) -> Result<Model, LoadError> {
    let mut model = plugin.create_model(settings)?;
    model.prepare(config).map_err(|refusal| {
        let metadata = plugin.metadata();
        LoadError::Refused { path: metadata.path.clone(), id: metadata.id.clone(), refusal }
    })?;
    Ok(model)
}

/// Returns the input of a tick of a 1 kHz loop with the handle at rest.
pub fn input_of(tick: u64, pose: Pose) -> Input {
    Input { tick, time_ns: tick * PERIOD_NS, dt_ns: PERIOD_NS, ..Input::at_rest(pose) }
}

/// Steps a model once; while the call lasts, the watchdog ([`crate::watch`]) monitors it.
///
/// # Errors
/// The call status of the model, if not `Ok`.
pub fn call(model: &mut Model, input: &Input) -> Result<Output, CallStatus> {
    let mut output = Output::default();
    let _call = enter_call(std::slice::from_ref(input));
    match model.step(input, &mut output) {
        CallStatus::Ok => Ok(output),
        other => Err(other),
    }
}

/// Returns the number of steps for a path, each of at most 0.05 mm and 2 mrad.
#[must_use]
pub fn steps(way_m: DVec3, way_rad: DVec3) -> f64 {
    (way_m.length() / STEP_M).max(way_rad.length() / STEP_RAD).ceil()
}

/// Calls `step` along a path, whose parameter grows from 0 to 1, and at its end until the model has converged, at most 2000
/// times more; returns the last output.
///
/// # Errors
/// The first error of `step`.
pub fn walk<E>(
    steps: f64,
    between: impl Fn(f64) -> Pose,
    end: Pose,
    mut step: impl FnMut(Pose) -> Result<Output, E>,
) -> Result<Output, E> {
    let mut number = 1.0;
    while number < steps {
        step(between(number / steps))?;
        number += 1.0;
    }
    let mut output = step(end)?;
    for _ in 0..MOST_HOLDS {
        if output.status() != Some(StepStatus::NotConverged) {
            break;
        }
        output = step(end)?;
    }
    Ok(output)
}

/// Failure of a model to answer, with the pose.
#[derive(Clone, Debug)]
pub struct Trouble {
    /// Kind of the failure.
    pub kind: TroubleKind,
    /// Pose of the failure.
    pub pose: Pose,
}

/// Kinds of failures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TroubleKind {
    /// The model panicked, with this message.
    Panicked(String),
    /// The wrench contains NaN or infinity, or the energy is infinite.
    NotFinite,
    /// The status is not one of the contract.
    UnknownStatus,
    /// The call returned this error status.
    Refused(CallStatus),
    /// The status for a non-finite input is `Ok`.
    AcceptsNonFiniteInput,
}

/// Instance of the model under test.
pub struct Subject<'a> {
    plugin: &'a Plugin,
    settings: &'a [Setting],
    seed: u64,
    model: Model,
    demand: Demand,
    at: Pose,
    tick: u64,
    time_ns: u64,
}

impl<'a> Subject<'a> {
    /// Creates an instance at home.
    ///
    /// # Errors
    /// [`LoadError`] from [`prepared`].
    pub fn new(plugin: &'a Plugin, settings: &'a [Setting], seed: u64) -> Result<Self, LoadError> {
        let model = prepared(plugin, settings, seed)?;
        let demand = Demand::ALL.limited_to(model.serves());
        Ok(Self { plugin, settings, seed, model, demand, at: Pose::HOME, tick: 0, time_ns: 0 })
    }

    /// Resets the model to home; replaces it by a new instance after a panic.
    pub fn restart(&mut self) {
        match self.model.reset() {
            CallStatus::Panicked => self.replace(),
            _ => self.forget_way(),
        }
    }

    fn forget_way(&mut self) {
        self.at = Pose::HOME;
        self.tick = 0;
        self.time_ns = 0;
    }

    /// Returns the answer at a pose, after a walk there if the model has memory.
    ///
    /// # Errors
    /// [`Trouble`] with the kind of the failure and its pose.
    pub fn answer_at(&mut self, pose: Pose) -> Result<Output, Trouble> {
        match self.memory() {
            Memory::Stateless => self.step(&self.at_rest(pose)),
            Memory::PathDependent => self.walk(pose, &mut || ()),
        }
    }

    /// Moves the handle to a pose in small steps and holds it there until the model has converged; calls `on_the_way` after every
    /// step. Returns the last output.
    ///
    /// # Errors
    /// [`Trouble`] with the kind of the failure and its pose.
    pub fn walk(&mut self, end: Pose, on_the_way: &mut dyn FnMut()) -> Result<Output, Trouble> {
        let from = self.at;
        let way_m = end.position() - from.position();
        let way_rad = rotation_vector(end.orientation() * from.orientation().conjugate());
        let steps = steps(way_m, way_rad);
        // A non-finite pose has no path: the model is stepped there once.
        let steps = if steps.is_finite() { steps.clamp(1.0, MOST_STEPS) } else { 1.0 };
        let between = |part: f64| {
            let turn = orientation_from_rotation_vector(way_rad * part);
            Pose::new(from.position() + way_m * part, turn * from.orientation())
        };
        walk(steps, between, end, |pose| self.advance(pose, Twist::ZERO, PERIOD_NS).inspect(|_| on_the_way()))
    }

    /// Steps the model as in one tick of a loop, at a pose `dt_ns` after the previous tick.
    ///
    /// # Errors
    /// [`Trouble`] with the kind of the failure and its pose.
    pub fn advance(&mut self, pose: Pose, twist: Twist, dt_ns: u64) -> Result<Output, Trouble> {
        let input = self.input(pose, twist, dt_ns);
        if pose.is_finite() {
            self.at = pose;
        }
        self.step(&input)
    }

    /// Returns the input of a pose without history.
    pub fn at_rest(&self, pose: Pose) -> Input {
        Input { demand: self.demand, ..Input::at_rest(pose) }
    }

    /// Returns the input of the next tick, `dt_ns` after the previous one; advances tick and time of this subject.
    pub fn input(&mut self, pose: Pose, twist: Twist, dt_ns: u64) -> Input {
        let Self { time_ns, tick, demand, .. } = *self;
        let input = Input { twist, time_ns, dt_ns, tick, demand, ..Input::at_rest(pose) };
        self.tick += 1;
        self.time_ns += dt_ns;
        input
    }

    /// Steps the model once and checks the output: known status, finite wrench, energy finite or NaN, and no [`StepStatus::Ok`] for
    /// a non-finite pose. After a panic, replaces the model with a new instance.
    ///
    /// # Errors
    /// [`Trouble`] with the kind of the failure and its pose.
    pub fn step(&mut self, input: &Input) -> Result<Output, Trouble> {
        let trouble = |kind| Err(Trouble { kind, pose: input.pose });
        let output = match call(&mut self.model, input) {
            Ok(output) => output,
            Err(panicked @ CallStatus::Panicked) => {
                let words = self.model.reason(panicked);
                self.replace();
                return trouble(TroubleKind::Panicked(words));
            }
            Err(refused) => return trouble(TroubleKind::Refused(refused)),
        };
        match output.status() {
            None => trouble(TroubleKind::UnknownStatus),
            // NaN as energy is valid: none available here.
            _ if !output.wrench.is_finite() || output.energy_j.is_infinite() => {
                trouble(TroubleKind::NotFinite)
            }
            Some(StepStatus::Ok) if !input.pose.is_finite() => trouble(TroubleKind::AcceptsNonFiniteInput),
            Some(_) => Ok(output),
        }
    }

    /// Returns the instance, for measures that time it or compare bits.
    pub fn model(&mut self) -> &mut Model {
        &mut self.model
    }

    /// Returns the memory of the model: stateless or path-dependent.
    pub fn memory(&self) -> Memory {
        self.model.memory()
    }

    fn replace(&mut self) {
        // If creation fails, the broken instance remains and every call fails.
        if let Ok(model) = prepared(self.plugin, self.settings, self.seed) {
            self.model = model;
        }
        self.forget_way();
    }
}
