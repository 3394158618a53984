//! The model under test: one instance that is asked for wrenches, and replaced when it breaks.
//!
//! A model without history is asked directly. One with history is walked to each pose in small steps, the way
//! a hand would take it there, and held until it has converged.

use super::Setup;
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::{LoadError, Model};
use flotor_hal::{
    Demand, Input, LoopConfig, Memory, Output, Pose, StepStatus, Twist, Wrench,
    orientation_from_rotation_vector, rotation_vector,
};

/// Largest step of a walk, m: what `flotor eval` takes.
const STEP_M: f64 = 0.05e-3;
/// Largest turn of a walk, rad.
const STEP_RAD: f64 = 0.002;
/// Longest way that is walked in such steps; a pose farther away is approached in as many, larger ones.
const MOST_STEPS: f64 = 4000.0;
/// Ticks a handle is held for the model to converge.
const MOST_HOLDS: usize = 2000;
/// Time between the steps of a walk, and between ticks unless said otherwise, ns.
pub(super) const PERIOD_NS: u64 = 1_000_000;

/// What a model answered: finite, with a known status.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answer {
    pub(super) wrench: Wrench,
    pub(super) status: StepStatus,
}

/// How a model failed to answer, and where.
#[derive(Clone, Debug)]
pub(super) struct Trouble {
    pub(super) kind: TroubleKind,
    pub(super) pose: Pose,
}

/// The ways not to answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TroubleKind {
    /// It panicked, with these words.
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
pub(super) struct Subject<'a> {
    setup: &'a Setup<'a>,
    model: Model,
    demand: Demand,
    memory: Memory,
    at: Pose,
    tick: u64,
    time_ns: u64,
}

impl<'a> Subject<'a> {
    pub(super) fn new(setup: &'a Setup<'a>) -> Result<Self, LoadError> {
        let model = create(setup)?;
        let demand = Demand::ALL.limited_to(model.serves());
        let memory = model.memory();
        Ok(Self { setup, model, demand, memory, at: Pose::HOME, tick: 0, time_ns: 0 })
    }

    /// Back to home, history forgotten; a new instance if the old one is broken.
    pub(super) fn restart(&mut self) {
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
    pub(super) fn ask(&mut self, pose: Pose) -> Result<Answer, Trouble> {
        match self.memory {
            Memory::Stateless => self.step(&Input { demand: self.demand, ..Input::at_rest(pose) }),
            Memory::PathDependent => self.walk(pose, &mut |_| ()),
        }
    }

    /// Walks to a pose and looks at every answer on the way.
    pub(super) fn walk(
        &mut self,
        target: Pose,
        on_the_way: &mut dyn FnMut(&Answer),
    ) -> Result<Answer, Trouble> {
        let from = self.at;
        let way_m = target.position() - from.position();
        let way_rad = rotation_vector(target.orientation() * from.orientation().conjugate());
        let steps = (way_m.length() / STEP_M).max(way_rad.length() / STEP_RAD).ceil();
        // Nowhere to walk to where a number is missing: the model sees the pose once.
        let steps = if steps.is_finite() { steps.clamp(1.0, MOST_STEPS) } else { 1.0 };
        let mut step = 1.0;
        while step < steps {
            let part = step / steps;
            let turn = orientation_from_rotation_vector(way_rad * part);
            let between = Pose::new(from.position() + way_m * part, turn * from.orientation());
            on_the_way(&self.advance(between, Twist::ZERO, PERIOD_NS)?);
            step += 1.0;
        }
        let mut answer = self.advance(target, Twist::ZERO, PERIOD_NS)?;
        on_the_way(&answer);
        for _ in 0..MOST_HOLDS {
            if answer.status != StepStatus::NotConverged {
                break;
            }
            answer = self.advance(target, Twist::ZERO, PERIOD_NS)?;
            on_the_way(&answer);
        }
        Ok(answer)
    }

    /// One tick of a loop: the pose `dt_ns` after the one before.
    pub(super) fn advance(&mut self, pose: Pose, twist: Twist, dt_ns: u64) -> Result<Answer, Trouble> {
        let input = self.input(pose, twist, dt_ns);
        if pose.is_finite() {
            self.at = pose;
        }
        self.step(&input)
    }

    /// The input of the next tick.
    pub(super) fn input(&mut self, pose: Pose, twist: Twist, dt_ns: u64) -> Input {
        let input = Input {
            pose,
            twist,
            time_ns: self.time_ns,
            dt_ns,
            tick: self.tick,
            buttons: 0,
            demand: self.demand,
        };
        self.tick += 1;
        self.time_ns += dt_ns;
        input
    }

    /// One call, checked. A model that panicked is replaced by a new instance.
    pub(super) fn step(&mut self, input: &Input) -> Result<Answer, Trouble> {
        let mut output = Output::default();
        let call = self.model.step(input, &mut output);
        self.check(call, input, &output)
    }

    /// The instance itself, for measures that time it or compare bits.
    pub(super) fn model(&mut self) -> &mut Model {
        &mut self.model
    }

    pub(super) fn memory(&self) -> Memory {
        self.memory
    }

    fn check(&mut self, call: CallStatus, input: &Input, output: &Output) -> Result<Answer, Trouble> {
        let trouble = |kind| Err(Trouble { kind, pose: input.pose });
        match call {
            CallStatus::Ok => {}
            CallStatus::Panicked => {
                let words = self.model.last_message();
                self.replace();
                return trouble(TroubleKind::Panicked(words));
            }
            refused => return trouble(TroubleKind::Refused(refused)),
        }
        let Some(status) = output.status() else { return trouble(TroubleKind::UnknownStatus) };
        // NaN is how a model says that it has no energy here.
        if !output.wrench.is_finite() || output.energy_j.is_infinite() {
            return trouble(TroubleKind::NotFinite);
        }
        if status == StepStatus::Ok && !input.pose.is_finite() {
            return trouble(TroubleKind::CallsNonsenseSound);
        }
        Ok(Answer { wrench: output.wrench, status })
    }

    fn replace(&mut self) {
        // If no new instance can be had, the broken one stays and every call is one more trouble.
        if let Ok(model) = create(self.setup) {
            self.model = model;
        }
        self.forget_way();
    }
}

fn create(setup: &Setup<'_>) -> Result<Model, LoadError> {
    let mut model = setup.plugin.create_model(setup.settings)?;
    let config = LoopConfig { period_ns: PERIOD_NS, seed: setup.options.seed };
    model.prepare(&config).map_err(|refusal| {
        let metadata = setup.plugin.metadata();
        LoadError::Refused { path: metadata.path.clone(), id: metadata.id.clone(), refusal }
    })?;
    Ok(model)
}
