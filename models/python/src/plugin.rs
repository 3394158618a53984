//! Plugin: parameters, and the requests to the interpreter.

use crate::interpreter::Interpreter;
use crate::message::{VALUES, floor};
use flotor_hal::{
    Choices, Contact, ContactSet, ContactSetModel, DVec3, ForceModel, Input, LoopConfig, Memory, ModelInfo,
    Output, Parameter, Refusal, SetParameterError, Settings, StepStatus, Wrench, choices,
};
use std::path::PathBuf;

/// Built-in models, computed without an interpreter.
const BUILT_IN: Choices = choices!["floor"];
/// Stiffness of the built-in floor, N/m.
const FLOOR_N_PER_M: f64 = 800.0;
/// Indices of the live values in the schema.
const FIRST_VALUE: usize = 2;

const fn value(id: &'static str) -> Parameter {
    Parameter::real(id, "", -1.0e9, 1.0e9, 0.0, "Number that the function reads as `handle.values`").live()
}

/// Model in Python.
pub struct PythonModel {
    source: Source,
    values: [f64; VALUES],
}

/// Source of the contacts.
enum Source {
    /// Built-in floor.
    Floor,
    /// File not loaded yet, with the argument for its `create`.
    Unloaded(PathBuf, String),
    /// Running interpreter.
    Running(Box<Interpreter>),
    /// Interpreter that has ended, failed or timed out.
    Failed,
}

impl ForceModel for PythonModel {
    const INFO: ModelInfo = ModelInfo::new(
        "python",
        "Python",
        "Contacts and fields that a function in Python computes, in an interpreter of its own",
    )
    .with_memory(Memory::PathDependent);
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::file(
            "file",
            BUILT_IN,
            "Python file with a function `contacts(handle)`; `floor` is built in, and needs no Python",
        ),
        Parameter::text("argument", "Text that the file's function `create` receives"),
        value("value_1"),
        value("value_2"),
        value("value_3"),
        value("value_4"),
    ];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let argument = settings.text("argument").unwrap_or_default().to_owned();
        let source = match settings.text("file") {
            None | Some("floor") => Source::Floor,
            Some(file) => Source::Unloaded(PathBuf::from(file), argument),
        };
        let values = ["value_1", "value_2", "value_3", "value_4"].map(|id| settings.number_or_default(id));
        Ok(Self { source, values })
    }

    /// Starts the interpreter, which loads the file: an import may take longer than the loop waits for a first answer.
    fn prepare(&mut self, _: &LoopConfig) -> Result<(), Refusal> {
        if let Source::Unloaded(file, argument) = &self.source {
            let interpreter = Interpreter::start(file, argument).map_err(Refusal::resource)?;
            self.source = Source::Running(Box::new(interpreter));
        }
        Ok(())
    }

    /// Returns no force, with the status `OutOfDomain`: the model runs asynchronously only.
    fn step(&mut self, input: &Input) -> Output {
        let is_finite = input.pose.is_finite();
        let status = if is_finite { StepStatus::OutOfDomain } else { StepStatus::InvalidInput };
        Output::new(Wrench::ZERO, f64::NAN, status)
    }

    fn set_parameter(&mut self, index: usize, value: f64) -> Result<(), SetParameterError> {
        let place = index.checked_sub(FIRST_VALUE).and_then(|index| self.values.get_mut(index));
        *place.ok_or(SetParameterError::Fixed)? = value;
        Ok(())
    }

    fn parameter(&self, index: usize) -> f64 {
        let value = index.checked_sub(FIRST_VALUE).and_then(|index| self.values.get(index));
        value.copied().unwrap_or(f64::NAN)
    }

    fn reset(&mut self) {
        if let Source::Running(interpreter) = &mut self.source
            && interpreter.reset().is_err()
        {
            self.source = Source::Failed;
        }
    }
}

impl ContactSetModel for PythonModel {
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let answer = match &mut self.source {
            Source::Floor => return floor(input, FLOOR_N_PER_M),
            _ if !input.pose.is_finite() => return ContactSet::NONE,
            Source::Running(interpreter) => interpreter.contacts(input, &self.values),
            Source::Unloaded(..) | Source::Failed => return refused(input),
        };
        match answer {
            Ok(set) => *set,
            Err(_) => {
                self.source = Source::Failed;
                refused(input)
            }
        }
    }
}
flotor_hal::export_model!(PythonModel, contact_set);

/// Returns an invalid set: the host keeps the last valid one until its force has faded, and reports the model by name.
fn refused(input: &Input) -> ContactSet {
    ContactSet::at(input).with(Contact::of_handle(input, DVec3::Z, f64::NAN, f64::NAN))
}
