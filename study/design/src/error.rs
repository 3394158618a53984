//! Error of a design.

/// Error of a design: a key of the study file, and what is wrong with it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {problem}")]
pub struct DesignError {
    /// Key of the study file, such as `factor.delay.values`.
    pub key: String,
    /// Problem and remedy.
    pub problem: String,
}

impl DesignError {
    /// Creates the error.
    pub(crate) fn new(key: &str, problem: &str) -> Self {
        Self { key: key.to_owned(), problem: problem.to_owned() }
    }
}
