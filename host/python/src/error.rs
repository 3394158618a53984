//! One exception for all that can go wrong: its text says what, where and what to do.

use pyo3::PyErr;
use pyo3::exceptions::PyException;

pyo3::create_exception!(
    flotor,
    FlotorError,
    PyException,
    "Something Flotor refuses or cannot do; the text says what, where and what to do."
);

/// Any error of the host as the one exception.
pub(crate) fn refuse(error: impl std::fmt::Display) -> PyErr {
    FlotorError::new_err(error.to_string())
}
