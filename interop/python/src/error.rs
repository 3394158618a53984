//! One exception for all that can go wrong: its text says what, where and what to do.

use pyo3::PyErr;
use pyo3::exceptions::PyException;

pyo3::create_exception!(
    flotor,
    FlotorError,
    PyException,
    "Something Flotor refuses or cannot do; the text says what, where and what to do."
);

/// Remedies of the command line, and what Python has in their place: the wheel has no command.
const REMEDIES: [(&str, &str); 2] = [
    ("`flotor plugins` lists", "`flotor.plugins()` lists"),
    ("`flotor plugins ID` lists", "`flotor.Model(ID).parameters` lists"),
];

/// Any error of the host as the one exception.
pub(crate) fn refuse(error: impl std::fmt::Display) -> PyErr {
    let text = REMEDIES.iter().fold(error.to_string(), |text, (command, call)| text.replace(command, call));
    FlotorError::new_err(text)
}
