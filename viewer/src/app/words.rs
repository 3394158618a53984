//! Texts for the state of the run and the current messages.

use super::{Source, Viewer};
use crate::feed::FeedState;
use crate::ui::readout;
use crate::ui::top_bar::RunStatus;
use flotor_core::trace::Events;
use flotor_history::player::Motion;
use flotor_live::EndKind;
use flotor_record::Severity;
use std::time::Duration;

/// Display time of an event of one tick, s.
const IN_SIGHT_S: f64 = 1.0;
/// Events that end a run abnormally.
const FATAL: Events = Events::from_bits(Events::EMERGENCY_STOP.bits() | Events::DEVICE_FAULT.bits());
/// Display time of a remark.
const REMARK: Duration = Duration::from_secs(6);

/// Displayed state of the run.
pub(super) struct State {
    /// State in one or two words, for a bar of any width.
    pub(super) words: &'static str,
    /// Severity of the state.
    pub(super) status: RunStatus,
}

impl Viewer {
    /// Returns the displayed state of the run.
    pub(super) fn state(&self) -> State {
        let events = self.devices.newest_events();
        let (words, status) = match &self.source {
            Source::Waiting(_) => ("no run", RunStatus::Idle),
            Source::Recording if self.is_rehearsal() => ("running", RunStatus::InOrder),
            Source::Recording => ("recording", RunStatus::Idle),
            Source::Live { feed, .. } => match feed.state() {
                FeedState::Ended(_, EndKind::InOrder) if !events.intersects(FATAL) => {
                    ("ended", RunStatus::Idle)
                }
                FeedState::Ended(..) if events.intersects(Events::EMERGENCY_STOP) => {
                    ("stopped", RunStatus::Failed)
                }
                FeedState::Ended(..) => ("failed", RunStatus::Failed),
                FeedState::Lost(_) => ("connection lost", RunStatus::Failed),
                FeedState::Running if feed.is_stale() => ("no ticks come", RunStatus::Failed),
                FeedState::Running if events.intersects(Events::HOLDING) => ("holding", RunStatus::Warning),
                FeedState::Running if events.intersects(Events::RELEASING) => {
                    ("fading out", RunStatus::InOrder)
                }
                FeedState::Running if events.intersects(Events::RAMPING) => ("fading in", RunStatus::InOrder),
                FeedState::Running => ("running", RunStatus::InOrder),
            },
        };
        State { words, status }
    }

    /// Returns the current warnings, each once, the most urgent first.
    pub(super) fn warnings(&self) -> Vec<String> {
        let mut said = Vec::new();
        let mut known = Events::NONE;
        if let Source::Live { feed, .. } = &self.source {
            if feed.is_stale() {
                said.push("Stale data: no new ticks; check the terminal of `flotor run`".to_owned());
            }
            match feed.state() {
                // The reason is more specific than the event of the last tick.
                FeedState::Ended(reason, _) if self.state().status == RunStatus::Failed => {
                    said.push(reason);
                    known = FATAL;
                }
                FeedState::Lost(reason) => said.push(reason),
                FeedState::Ended(..) | FeedState::Running => {}
            }
        }
        let without_known = |events: Events| Events::from_bits(events.bits() & !known.bits());
        let events = self.recent_events().map(|(name, events)| (name, without_known(events)));
        let events: Vec<(&str, Events)> = events.collect();
        said.extend(readout::warnings(&events, &self.facts));
        said.extend(self.missing.iter().cloned());
        let notes = self.devices.history().notes().iter().filter(|note| note.severity == Severity::Error);
        said.extend(notes.map(|note| format!("{}: {}", note.source, note.text)));
        let remark = self.remark.as_ref().filter(|(_, since)| since.elapsed() < REMARK);
        said.extend(remark.map(|(remark, _)| remark.clone()));
        said
    }

    /// Returns the events of each device by name: at the displayed time, and while the run is followed in the last second, because
    /// an event of one tick is over in a millisecond.
    fn recent_events(&self) -> impl Iterator<Item = (&str, Events)> {
        let now_s = self.player.now_s;
        self.devices.all().map(move |(name, history)| {
            let mut events = history.at(now_s).map_or(Events::NONE, |sample| sample.events);
            if self.player.motion == Motion::Follow {
                history.between(now_s - IN_SIGHT_S, now_s).for_each(|past| events.insert(past.events));
            }
            (name, events)
        })
    }

    /// Returns the message about the last action, or the reason for the end of the run.
    pub(super) fn done(&self) -> Option<String> {
        let done = self.done.as_ref().filter(|(_, since)| since.elapsed() < REMARK);
        let end = || {
            let Source::Live { feed, .. } = &self.source else { return None };
            if let FeedState::Ended(reason, _) = feed.state() { Some(reason) } else { None }
        };
        done.map(|(text, _)| text.clone()).or_else(end)
    }
}
