//! How things stand, in words: the state of the run, and what a person should know at this moment.

use super::{Source, Viewer};
use crate::feed::FeedState;
use crate::history::Sample;
use crate::player::Motion;
use crate::ui::readout;
use crate::ui::top_bar::RunStatus;
use flotor_core::trace::Events;
use flotor_live::EndKind;
use flotor_record::Severity;
use std::time::Duration;

/// How long something that happened in one tick stays in sight, s.
const IN_SIGHT_S: f64 = 1.0;
/// What ends a run that should go on.
const FATAL: Events = Events::from_bits(Events::EMERGENCY_STOP.bits() | Events::DEVICE_FAULT.bits());
/// How long a remark stays in sight.
const REMARK: Duration = Duration::from_secs(6);

impl Viewer {
    /// How the run stands, and how well that is.
    pub(super) fn standing(&self) -> (String, RunStatus) {
        let events = self.devices.newest_events();
        match &self.source {
            Source::Waiting(_) => ("no run".to_owned(), RunStatus::Idle),
            Source::Recording if self.is_rehearsal() => ("running".to_owned(), RunStatus::InOrder),
            Source::Recording => ("recording".to_owned(), RunStatus::Idle),
            Source::Live { feed, .. } => match feed.state() {
                FeedState::Ended(words, EndKind::InOrder) if !events.intersects(FATAL) => {
                    (words, RunStatus::Idle)
                }
                FeedState::Ended(words, _) => (words, RunStatus::Failed),
                FeedState::Lost(_) => ("connection lost".to_owned(), RunStatus::Failed),
                FeedState::Running if feed.is_stale() => ("no ticks come".to_owned(), RunStatus::Failed),
                FeedState::Running if events.intersects(Events::HOLDING) => {
                    ("holding".to_owned(), RunStatus::Warning)
                }
                FeedState::Running if events.intersects(Events::RELEASING) => {
                    ("fading out".to_owned(), RunStatus::InOrder)
                }
                FeedState::Running if events.intersects(Events::RAMPING) => {
                    ("fading in".to_owned(), RunStatus::InOrder)
                }
                FeedState::Running => ("running".to_owned(), RunStatus::InOrder),
            },
        }
    }

    /// What a person should know at this moment.
    pub(super) fn warnings(&self, sample: &Sample) -> Vec<String> {
        let mut said = Vec::new();
        if let Source::Live { feed, .. } = &self.source {
            if feed.is_stale() {
                said.push("Stale data: no ticks come; look at the terminal of `flotor run`".to_owned());
            }
            if let FeedState::Lost(reason) = feed.state() {
                said.push(reason);
            }
        }
        // What happens in a tick is over in a millisecond: it stays in sight a while.
        let now_s = sample.time_s();
        let several = self.devices.count() > 1;
        for (name, history) in self.devices.all() {
            let mut events = history.at(self.player.now_s).map_or(Events::NONE, |sample| sample.events);
            if self.player.motion == Motion::Follow {
                history.between(now_s - IN_SIGHT_S, now_s).for_each(|past| events.insert(past.events));
            }
            let of = if several { format!("{name}: ") } else { String::new() };
            said.extend(readout::happened(events).map(|words| format!("{of}{words}")));
        }
        said.extend(readout::of_shapes(&self.facts).map(str::to_owned));
        said.extend(self.missing.iter().cloned());
        let notes = self.devices.history().notes().iter().filter(|note| note.severity == Severity::Error);
        said.extend(notes.map(|note| format!("{}: {}", note.source, note.text)));
        let remark = self.remark.as_ref().filter(|(_, since)| since.elapsed() < REMARK);
        said.extend(remark.map(|(remark, _)| remark.clone()));
        said
    }

    /// That something was done, which is no warning.
    pub(super) fn done(&self) -> Option<&str> {
        let done = self.done.as_ref().filter(|(_, since)| since.elapsed() < REMARK);
        done.map(|(text, _)| text.as_str())
    }
}
