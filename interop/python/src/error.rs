//! Exception class of the package: its text states the problem, the place and the remedy; `exit_code` is that of the command line.

use flotor_command::CommandError;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;

pyo3::create_exception!(
    flotor,
    FlotorError,
    PyException,
    "Error of Flotor; the text has place, cause and remedy, `exit_code` is the exit code of the command line for it."
);

/// Remedies for the command line, and their replacements in Python.
const REMEDIES: [(&str, &str); 3] = [
    ("`flotor plugins` lists", "`flotor.plugins()` lists"),
    ("`flotor plugins ID` lists", "`flotor.Model(ID).parameters` lists"),
    (" (`flotor scenes` lists Flotor's own scenes)", ""),
];

/// Returns the text of an error with remedies for Python.
pub(crate) fn sentence(error: impl std::fmt::Display) -> String {
    REMEDIES.iter().fold(error.to_string(), |text, (command, call)| text.replace(command, call))
}

/// Converts any error of the host to the exception.
pub(crate) fn refuse(error: impl std::fmt::Display) -> PyErr {
    FlotorError::new_err(sentence(error))
}

/// Converts an error of a command to the exception with its exit code.
pub(crate) fn refuse_run(error: impl Into<CommandError>) -> PyErr {
    let error = error.into();
    let exception = refuse(&error);
    Python::attach(|py| {
        // The class allows attributes: this cannot fail but for want of memory.
        let _ = exception.value(py).setattr("exit_code", error.exit_code());
    });
    exception
}
