//! Work in blocks on two threads, with a result that does not depend on who did what.
//!
//! Every block starts with the model at home and its history forgotten, draws its poses from its own number,
//! and results are put together in the order of the blocks.

use super::Setup;
use super::subject::Subject;
use flotor_hal::abi::loader::LoadError;
use std::sync::atomic::{AtomicU64, Ordering};

/// Does `work` for every block; results in the order of the blocks. Two threads, an instance each.
pub(super) fn sweep<T: Send>(
    setup: &Setup<'_>,
    name: &str,
    blocks: u64,
    work: impl Fn(&mut Subject<'_>, u64) -> T + Sync,
) -> Result<Vec<T>, LoadError> {
    setup.progress.begin(name, blocks);
    let next = AtomicU64::new(0);
    let worker = || -> Result<Vec<(u64, T)>, LoadError> {
        let mut subject = Subject::new(setup)?;
        let mut done = Vec::new();
        loop {
            let block = next.fetch_add(1, Ordering::Relaxed);
            if block >= blocks {
                return Ok(done);
            }
            subject.restart();
            done.push((block, work(&mut subject, block)));
            setup.progress.advance(1);
        }
    };
    let (here, there) = std::thread::scope(|scope| {
        let other = scope.spawn(worker);
        (worker(), other.join())
    });
    let mut done = here?;
    done.extend(there.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
    done.sort_by_key(|(block, _)| *block);
    Ok(done.into_iter().map(|(_, result)| result).collect())
}
