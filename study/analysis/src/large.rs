//! Wrong answers to obvious differences, which indicate a misread question, swapped keys, or inattention.

use crate::SubjectRecord;
use flotor_study::protocol::JndProtocol;
use flotor_study::trial::Judgement;

/// Counts of answers to large differences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct AtLarge {
    /// Number of answers, "I don't know" included.
    pub(crate) answers: usize,
    /// Number of wrong answers.
    pub(crate) wrong: usize,
}

impl AtLarge {
    /// Returns the fraction of wrong answers; `None` without answers.
    pub(crate) fn share(self) -> Option<f64> {
        (self.answers > 0).then(|| self.wrong as f64 / self.answers as f64)
    }
}

/// Counts the answers to differences of [`JndProtocol::LARGE_DELTA`] or more. The limit is fixed rather than fitted: the fitted
/// threshold of a subject who is always wrong exceeds every difference.
pub(crate) fn wrong_at_large(record: &SubjectRecord) -> AtLarge {
    let mut found = AtLarge::default();
    for (_, one, _) in record.judged().filter(|(_, one, _)| one.delta >= JndProtocol::LARGE_DELTA) {
        found.answers += 1;
        found.wrong += usize::from(one.judgement == Judgement::Wrong);
    }
    found
}
