//! The model under test: one instance that is asked for wrenches, and replaced when it breaks.
//!
//! A model without history is asked directly. One with history is walked to each pose in small steps, the way
//! a hand would take it there, and held until it has converged.

use crate::PERIOD_NS;
use crate::watch::calling;
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::{LoadError, Model, Plugin, Setting};
use flotor_hal::{
    DVec3, Demand, Input, LoopConfig, Memory, Output, Pose, StepStatus, Twist,
    orientation_from_rotation_vector, rotation_vector,
};

/// Largest step of a walk, m.
const STEP_M: f64 = 0.05e-3;
/// Largest turn of a walk, rad.
const STEP_RAD: f64 = 0.002;
/// Longest way that is walked in such steps; a pose farther away is approached in as many, larger ones.
const MOST_STEPS: f64 = 4000.0;
/// Ticks a handle is held for the model to converge.
const MOST_HOLDS: usize = 2000;

/// An instance for a loop of 1 kHz.
///
/// # Errors
/// [`LoadError`] if the plugin is no model, or it refuses the settings or the loop.
pub fn prepared(plugin: &Plugin, settings: &[Setting], seed: u64) -> Result<Model, LoadError> {
    let mut model = plugin.create_model(settings)?;
    model.prepare(&LoopConfig { period_ns: PERIOD_NS, seed }).map_err(|refusal| {
        let metadata = plugin.metadata();
        LoadError::Refused { path: metadata.path.clone(), id: metadata.id.clone(), refusal }
    })?;
    Ok(model)
}

/// The input of a tick of a 1 kHz loop whose handle is at rest.
#[must_use]
pub fn input_of(tick: u64, pose: Pose) -> Input {
    Input { tick, time_ns: tick * PERIOD_NS, dt_ns: PERIOD_NS, ..Input::at_rest(pose) }
}

/// One call, watched.
///
/// # Errors
/// What the model returned in the place of an answer.
pub fn call(model: &mut Model, input: &Input) -> Result<Output, CallStatus> {
    let mut output = Output::default();
    let _call = calling(std::slice::from_ref(input));
    match model.step(input, &mut output) {
        CallStatus::Ok => Ok(output),
        other => Err(other),
    }
}

/// Steps of a way, of at most 0.05 mm and 2 mrad.
#[must_use]
pub fn steps(way_m: DVec3, way_rad: DVec3) -> f64 {
    (way_m.length() / STEP_M).max(way_rad.length() / STEP_RAD).ceil()
}

/// Calls `step` along a way, whose parameter goes from 0 to 1, and at its end until the model has converged.
///
/// # Errors
/// The first of `step`.
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

/// How a model failed to answer, and where.
#[derive(Clone, Debug)]
pub struct Trouble {
    /// What went wrong.
    pub kind: TroubleKind,
    /// Where.
    pub pose: Pose,
}

/// The ways not to answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TroubleKind {
    /// It panicked, with this message.
    Panicked(String),
    /// NaN or infinity came back.
    NotFinite,
    /// The status is none the contract knows.
    UnknownStatus,
    /// The call was refused.
    Refused(CallStatus),
    /// It calls an input sound that is not finite.
    CallsNonsenseSound,
}

/// One instance of the model under test.
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
    /// A new instance, at home.
    ///
    /// # Errors
    /// [`LoadError`] as of [`prepared`].
    pub fn new(plugin: &'a Plugin, settings: &'a [Setting], seed: u64) -> Result<Self, LoadError> {
        let model = prepared(plugin, settings, seed)?;
        let demand = Demand::ALL.limited_to(model.serves());
        Ok(Self { plugin, settings, seed, model, demand, at: Pose::HOME, tick: 0, time_ns: 0 })
    }

    /// Back to home, history forgotten; a new instance if the old one is broken.
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

    /// The wrench at a pose, reached the way the model's memory asks for.
    ///
    /// # Errors
    /// How it failed to answer.
    pub fn ask(&mut self, pose: Pose) -> Result<Output, Trouble> {
        match self.memory() {
            Memory::Stateless => self.step(&self.at_rest(pose)),
            Memory::PathDependent => self.walk(pose, &mut || ()),
        }
    }

    /// Walks to a pose, and says so after every step.
    ///
    /// # Errors
    /// How it failed to answer.
    pub fn walk(&mut self, end: Pose, on_the_way: &mut dyn FnMut()) -> Result<Output, Trouble> {
        let from = self.at;
        let way_m = end.position() - from.position();
        let way_rad = rotation_vector(end.orientation() * from.orientation().conjugate());
        let steps = steps(way_m, way_rad);
        // Nowhere to walk to where a number is missing: the model sees the pose once.
        let steps = if steps.is_finite() { steps.clamp(1.0, MOST_STEPS) } else { 1.0 };
        let between = |part: f64| {
            let turn = orientation_from_rotation_vector(way_rad * part);
            Pose::new(from.position() + way_m * part, turn * from.orientation())
        };
        walk(steps, between, end, |pose| self.advance(pose, Twist::ZERO, PERIOD_NS).inspect(|_| on_the_way()))
    }

    /// One tick of a loop: the pose `dt_ns` after the one before.
    ///
    /// # Errors
    /// How it failed to answer.
    pub fn advance(&mut self, pose: Pose, twist: Twist, dt_ns: u64) -> Result<Output, Trouble> {
        let input = self.input(pose, twist, dt_ns);
        if pose.is_finite() {
            self.at = pose;
        }
        self.step(&input)
    }

    /// The input of a pose without history.
    #[must_use]
    pub fn at_rest(&self, pose: Pose) -> Input {
        Input { demand: self.demand, ..Input::at_rest(pose) }
    }

    /// The input of the next tick.
    pub fn input(&mut self, pose: Pose, twist: Twist, dt_ns: u64) -> Input {
        let Self { time_ns, tick, demand, .. } = *self;
        let input = Input { twist, time_ns, dt_ns, tick, demand, ..Input::at_rest(pose) };
        self.tick += 1;
        self.time_ns += dt_ns;
        input
    }

    /// One call, checked: an answer is finite and has a known status. A model that panicked is replaced by a new
    /// instance.
    ///
    /// # Errors
    /// How it failed to answer.
    pub fn step(&mut self, input: &Input) -> Result<Output, Trouble> {
        let trouble = |kind| Err(Trouble { kind, pose: input.pose });
        let output = match call(&mut self.model, input) {
            Ok(output) => output,
            Err(CallStatus::Panicked) => {
                let words = self.model.last_message();
                self.replace();
                return trouble(TroubleKind::Panicked(words));
            }
            Err(refused) => return trouble(TroubleKind::Refused(refused)),
        };
        match output.status() {
            None => trouble(TroubleKind::UnknownStatus),
            // NaN is how a model says that it has no energy here.
            _ if !output.wrench.is_finite() || output.energy_j.is_infinite() => {
                trouble(TroubleKind::NotFinite)
            }
            Some(StepStatus::Ok) if !input.pose.is_finite() => trouble(TroubleKind::CallsNonsenseSound),
            Some(_) => Ok(output),
        }
    }

    /// The instance itself, for measures that time it or compare bits.
    pub fn model(&mut self) -> &mut Model {
        &mut self.model
    }

    /// Whether it remembers.
    #[must_use]
    pub fn memory(&self) -> Memory {
        self.model.memory()
    }

    fn replace(&mut self) {
        // If no new instance can be had, the broken one stays and every call is one more trouble.
        if let Ok(model) = prepared(self.plugin, self.settings, self.seed) {
            self.model = model;
        }
        self.forget_way();
    }
}
