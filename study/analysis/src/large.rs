//! Wrong answers to differences that nobody misses: a question misread, keys the wrong way round, no attention.

use crate::SubjectRecord;
use flotor_study::protocol::JndProtocol;
use flotor_study::sitting::Verdict;
use flotor_study::trial::{Judgement, Presented};

/// Answers to large differences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct AtLarge {
    /// Answers.
    pub(crate) answers: usize,
    /// Those of them that are wrong.
    pub(crate) wrong: usize,
}

impl AtLarge {
    /// Share of wrong answers.
    pub(crate) fn share(self) -> Option<f64> {
        (self.answers > 0).then(|| self.wrong as f64 / self.answers as f64)
    }
}

/// Counts the answers to differences of [`JndProtocol::LARGE_DELTA`] and more. No fit decides what is large: the fit of somebody who is
/// always wrong has a threshold above every difference.
pub(crate) fn wrong_at_large(record: &SubjectRecord) -> AtLarge {
    let mut found = AtLarge::default();
    for event in record.counted() {
        if let (Presented::Pair(pair), Verdict::Judged { judgement, .. }) =
            (event.trial.presented, event.verdict)
            && pair.delta >= JndProtocol::LARGE_DELTA
        {
            found.answers += 1;
            found.wrong += usize::from(judgement == Judgement::Wrong);
        }
    }
    found
}
