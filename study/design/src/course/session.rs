//! Name of a course.

use crate::random::{Draws, Purpose, Stream};
use crate::subject::SubjectNumber;
use serde::{Deserialize, Serialize};

/// Name of a course: everything that determines its steps besides the design and the answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Session {
    /// Seed of the study.
    pub seed: u64,
    /// Number of the subject.
    pub subject: SubjectNumber,
    /// Number of the session, from 1.
    pub session: u32,
}

impl Session {
    /// Creates the stream of a purpose; sessions have streams of their own.
    pub(crate) fn stream(self, purpose: Purpose, index: u32) -> Stream {
        let draws = Draws { seed: self.seed, subject: self.subject };
        draws.stream(purpose, self.session.saturating_sub(1) << 24 | index)
    }
}
