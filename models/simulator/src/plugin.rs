//! Plugin of the simulator: parameters and contacts.

use crate::answers::{Answers, LONGEST_VALID_S};
use crate::link::{Link, LinkError};
use crate::messages::PoseMessage;
use flotor_hal::{
    Choices, Contact, ContactSet, ContactSetModel, DVec3, ForceModel, Input, LoopConfig, Memory, ModelInfo,
    Output, Parameter, Refusal, Settings, StepStatus, Wrench, choices,
};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Program if none is named: a floor in this process.
const FLOOR: &str = "floor";
const BUILT_IN: Choices = choices!["floor"];
const PACES: Choices = choices!["free", "lockstep"];
/// Stiffness, N/m, and damping, N·s/m, of the floor.
const FLOOR_N_PER_M: f64 = 500.0;
const FLOOR_NS_PER_M: f64 = 2.0;
/// Time for a program to answer its first pose in lockstep.
const START: Duration = Duration::from_secs(20);
/// Time between the last force of a failed simulator and the end of its model, ns: its contacts have faded.
const FADED_NS: u64 = 100_000_000;

/// Parameters of the simulator.
const SCHEMA: &[Parameter] = &[
    Parameter::file(
        "program",
        BUILT_IN,
        "Program to start, an executable file (flotor_simulator.h); a floor at home if not set",
    ),
    Parameter::choice(
        "pace",
        PACES,
        0,
        "free: the newest set counts; lockstep: each pose waits for its set, for the virtual clock",
    ),
    Parameter::real(
        "valid_ms",
        "ms",
        1.0,
        1.0e3 * LONGEST_VALID_S,
        50.0,
        "Longest age of a set that does not say how long it is valid",
    ),
    Parameter::real(
        "patience_ms",
        "ms",
        1.0,
        60_000.0,
        1000.0,
        "Lockstep: longest wait for a set; after one in vain none is waited for until the next set comes",
    ),
];

/// When a set is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pace {
    Free,
    Lockstep,
}

/// Contacts of a program.
pub struct Simulator {
    /// `None`: the floor.
    program: Option<PathBuf>,
    pace: Pace,
    valid_s: f64,
    patience: Duration,
    period_ns: u64,
    parameters: [f64; SCHEMA.len()],
    state: State,
    answers: Answers,
    /// Number of the newest pose.
    number: u64,
    /// True after a wait in vain.
    is_silent: bool,
}

/// State of the program.
enum State {
    NotStarted,
    Running(Box<Link>),
    /// Failed; time of the first answer without contacts, ns.
    Failed {
        message: String,
        since_ns: u64,
    },
}

impl ForceModel for Simulator {
    const INFO: ModelInfo = ModelInfo::new(
        "simulator",
        "Simulator",
        "Contacts computed by a program of one's own; needs [model.field]",
    )
    .with_memory(Memory::PathDependent);

    const PARAMETERS: &'static [Parameter] = SCHEMA;

    /// Creates a model whose program starts with its first question.
    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let program = settings.text("program").filter(|program| *program != FLOOR);
        let program = program.map(|program| {
            // An absolute path: a name alone would be looked for among the system's programs.
            Path::new(program).canonicalize().map_err(|cause| {
                Refusal::resource(format!("{program}: {cause}; `program` is the path of an executable file"))
            })
        });
        let program = program.transpose()?;
        let ms = |id| settings.number_or_default(id);
        Ok(Self {
            program,
            pace: settings.one_of("pace", [Pace::Free, Pace::Lockstep]),
            valid_s: ms("valid_ms") * 1.0e-3,
            patience: Duration::from_secs_f64(ms("patience_ms") * 1.0e-3),
            period_ns: 0,
            parameters: std::array::from_fn(|index| ms(SCHEMA[index].id())),
            state: State::NotStarted,
            answers: Answers::default(),
            number: 0,
            is_silent: false,
        })
    }

    fn prepare(&mut self, config: &LoopConfig) -> Result<(), Refusal> {
        self.period_ns = config.period_ns;
        Ok(())
    }

    /// Returns no force, with the status `OutOfDomain`: a program is too slow for the loop.
    fn step(&mut self, input: &Input) -> Output {
        let is_finite = input.pose.is_finite() && input.twist.is_finite();
        let status = if is_finite { StepStatus::OutOfDomain } else { StepStatus::InvalidInput };
        Output::new(Wrench::ZERO, f64::NAN, status)
    }

    fn parameter(&self, index: usize) -> f64 {
        self.parameters.get(index).copied().unwrap_or(f64::NAN)
    }

    /// Ends the program; the next question starts it anew.
    fn reset(&mut self) {
        self.state = State::NotStarted;
        self.answers.clear();
        (self.number, self.is_silent) = (0, false);
    }
}

impl ContactSetModel for Simulator {
    /// Sends the pose to the program, and returns its newest set. After a failure of the program there are no contacts, and once
    /// they have faded the model ends with the reason.
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let Some(program) = &self.program else { return floor(input) };
        if let State::Failed { message, since_ns } = &self.state {
            if input.time_ns.saturating_sub(*since_ns) > FADED_NS {
                // Caught at the boundary of the plugin, which gives the message to the host; no hook prints it.
                std::panic::resume_unwind(Box::new(message.clone()));
            }
            return ContactSet::at(input);
        }
        let mut is_first = false;
        if let State::NotStarted = self.state {
            match Link::start(program) {
                Ok(link) => (self.state, is_first) = (State::Running(Box::new(link)), true),
                Err(error) => return self.fail(&error, input),
            }
        }
        match self.exchange(input, is_first) {
            Ok(()) => self.answers.at(input, self.valid_s),
            Err(error) => self.fail(&error, input),
        }
    }
}

impl Simulator {
    fn exchange(&mut self, input: &Input, is_first: bool) -> Result<(), LinkError> {
        let State::Running(link) = &mut self.state else { return Ok(()) };
        let is_sent = input.pose.is_finite() && input.twist.is_finite();
        if is_sent {
            self.number += 1;
            let pose = PoseMessage::of(input, self.number, self.period_ns);
            self.answers.sent(pose);
            link.send(&pose)?;
        }
        if self.pace == Pace::Lockstep && is_sent && !self.is_silent {
            let patience = if is_first { START.max(self.patience) } else { self.patience };
            self.is_silent = !link.wait(self.number, &mut self.answers, patience)?;
        } else {
            link.read(&mut self.answers)?;
            self.is_silent &= !self.answers.has(self.number);
        }
        Ok(())
    }

    fn fail(&mut self, error: &LinkError, input: &Input) -> ContactSet {
        self.state = State::Failed { message: error.to_string(), since_ns: input.time_ns };
        ContactSet::at(input)
    }
}

/// Returns the contact of the handle with a floor at home.
fn floor(input: &Input) -> ContactSet {
    if !input.pose.is_finite() {
        return ContactSet { time_ns: input.time_ns, ..ContactSet::NONE };
    }
    let contact = Contact::of_handle(input, DVec3::Z, input.pose.position().z, FLOOR_N_PER_M);
    ContactSet::at(input).with(contact.with_damping(FLOOR_NS_PER_M))
}

flotor_hal::export_model!(Simulator, contact_set);
