//! Parallel work in blocks, with a result independent of the schedule.
//!
//! Every block starts with the model at home and reset, draws its poses from its own number, and results are merged in
//! the order of the blocks.

use super::Setup;
use crate::subject::Subject;
use crate::tally::Merge;
use flotor_loader::LoadError;
use rayon::prelude::*;

/// Runs `work` for every block and merges the results in order.
pub(super) fn sweep<'a, T: Merge + Send>(
    setup: &Setup<'a>,
    name: &str,
    blocks: u64,
    work: impl Fn(&mut Subject<'_>, u64) -> T + Sync,
) -> Result<T, LoadError> {
    setup.progress.begin(name, blocks);
    let block = |slot: &mut Option<Subject<'a>>, block| {
        let subject = match slot {
            Some(subject) => subject,
            None => slot.insert(setup.subject()?),
        };
        subject.restart();
        let done = work(subject, block);
        setup.progress.advance(1);
        Ok(done)
    };
    let together = |mut sum: T, later| {
        sum.merge(later);
        Ok(sum)
    };
    (0..blocks).into_par_iter().map_init(|| None, block).try_reduce(T::default, together)
}
