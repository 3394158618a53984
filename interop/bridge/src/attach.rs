//! Republishes a remote run locally, for the viewer and all other clients of runs on this machine.

use crate::link::LinkError;
use crate::remote::{Remote, RemoteEvent, RequestClient};
use crate::request::Request;
use flotor_core::demand::ObserverDemand;
use flotor_live::{Ask, Directory, End, EndKind, Publication, PublishError, RefusalCause, Serve};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Timeout for the next event, and so the poll interval of the stop flag.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Error of republishing a remote run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AttachError {
    /// Error of the network.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Error of the local publication.
    #[error(transparent)]
    Publish(#[from] PublishError),
}

impl Serve for RequestClient {
    /// Forwards the request to the remote host and waits for the reply. Rejects a swap, and the stop of all runs of this machine; ignores
    /// requests for ticks, which are sent anyway.
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)> {
        let reject = |words: &str| Err((RefusalCause::Request, words.to_owned()));
        match ask {
            Ask::Swap { .. } => reject(
                "a remote model cannot be swapped; swap the model on the machine of the host, which has the plugin file",
            ),
            Ask::MachineStop => reject(
                "the run is on another machine, and continues; press its emergency stop there or in `flotor view`",
            ),
            ask => {
                let done = Request::of_ask(ask).map_or(Ok(()), |request| self.run(request));
                done.map_err(|words| (RefusalCause::Other, words))
            }
        }
    }
}

/// Republishes each remote run in turn until `stop` is set; `report_line` receives a human-readable line at the start and at the
/// end of each run. Not real-time.
///
/// # Errors
/// [`AttachError`] of the network or of this machine.
pub fn attach(
    remote: &Remote,
    directory: &Directory,
    stop: &AtomicBool,
    report_line: &mut dyn FnMut(&str),
) -> Result<(), AttachError> {
    while let Some((greeting, run)) = remote.wait_for_run(stop)? {
        let title = greeting.title.clone();
        let publication = Publication::open(
            directory,
            greeting,
            &run,
            Arc::new(remote.requests()),
            ObserverDemand::default(),
        )?;
        report_line(&format!(
            "`{title}` is republished at {}; show the run with `flotor view`",
            publication.path().display()
        ));
        let lost_before = remote.lost();
        let End { words, kind } = show(remote, &publication, stop);
        let lost = remote.lost() - lost_before;
        report_line(&match lost {
            0 => words.clone(),
            lost => format!("{words}; the network lost {lost} ticks"),
        });
        publication.end(&words, kind);
    }
    Ok(())
}

/// Republishes one run until it ends or `stop` is set; returns its end.
fn show(remote: &Remote, publication: &Publication, stop: &AtomicBool) -> End {
    while !stop.load(Ordering::Relaxed) {
        match remote.next(LOOK_PERIOD) {
            None => {}
            Some(RemoteEvent::Tick(record)) => publication.observe(&record),
            Some(RemoteEvent::Change(change)) => publication.change(&change),
            Some(RemoteEvent::End(end)) => return end,
            Some(RemoteEvent::Gone) => {
                let words = "the bridge is no longer reachable".to_owned();
                return End { words, kind: EndKind::Failed };
            }
        }
    }
    End { words: "stopped watching".to_owned(), kind: EndKind::InOrder }
}
