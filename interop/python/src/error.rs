//! Exception class of the package: its text states the problem, the place and the remedy.

use pyo3::PyErr;
use pyo3::exceptions::PyException;

pyo3::create_exception!(
    flotor,
    FlotorError,
    PyException,
    "Error of Flotor; the text has place, cause and remedy."
);

/// Remedies for the command line, and their replacements in Python: the wheel has no command.
const REMEDIES: [(&str, &str); 3] = [
    ("`flotor plugins` lists", "`flotor.plugins()` lists"),
    ("`flotor plugins ID` lists", "`flotor.Model(ID).parameters` lists"),
    (" (`flotor scenes` lists Flotor's own scenes)", ""),
];

/// Converts any error of the host to the exception.
pub(crate) fn refuse(error: impl std::fmt::Display) -> PyErr {
    let text = REMEDIES.iter().fold(error.to_string(), |text, (command, call)| text.replace(command, call));
    FlotorError::new_err(text)
}
