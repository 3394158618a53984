//! Intake of new data from a running host, and the search for a run.

use super::source::{Parts, connect};
use super::{RunSelection, Source, Viewer};
use crate::devices::Devices;
use crate::feed::{Arrivals, FeedState, STALE_AFTER};
use crate::panel::Panel;
use egui::Context;
use flotor_core::trace::Events;
use flotor_history::player::Player;
use flotor_history::{History, Retention};
use flotor_live::{ChangeMessage, Outcome, Subject};
use std::time::{Duration, Instant};

/// Poll interval of the search for a run.
const LOOK_PERIOD: Duration = Duration::from_millis(500);
/// Time span of the retained ticks of a running host, s, and their largest number.
const KEPT_S: f64 = 60.0;
const MOST_KEPT: usize = 120_000;
/// Events that trigger a warning sound.
const EXCESS: Events = Events::from_bits(
    Events::FORCE_LIMITED.bits() | Events::TORQUE_LIMITED.bits() | Events::EXCESS_FORCE.bits(),
);

impl Viewer {
    /// Processes all data received since the last frame, and searches for a run while there is none.
    pub(super) fn poll(&mut self, context: &Context) {
        let due = self.last_look.is_none_or(|last| last.elapsed() >= LOOK_PERIOD);
        let wanted = match &self.source {
            Source::Waiting(wanted) => Some(wanted),
            Source::Live { feed, wanted } if feed.state() != FeedState::Running => Some(wanted),
            _ => None,
        };
        if let Some(wanted) = wanted {
            // The next run may start at any time.
            context.request_repaint_after(LOOK_PERIOD);
            if due {
                self.last_look = Some(Instant::now());
                let wanted = wanted.clone();
                self.look_for(&wanted, context);
            }
        }
        if let Source::Live { feed, .. } = &self.source {
            // Read the state before the arrivals: if the run is over by then, the arrivals are complete.
            let is_running = feed.state() == FeedState::Running;
            let arrivals = feed.arrivals();
            self.devices.set_dropped(feed.dropped());
            if is_running {
                context.request_repaint_after(STALE_AFTER); // to detect stale data
            } else {
                self.panels.iter_mut().for_each(Panel::freeze);
            }
            self.digest(arrivals);
            if !is_running {
                self.player.stop_following(self.devices.history().span_s());
            }
        }
    }

    fn look_for(&mut self, wanted: &RunSelection, context: &Context) {
        let Ok(feed) = connect(wanted, context, &self.pace) else { return };
        let parts = Parts::of_host(&feed);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a minute of ticks
        let kept = ((feed.run.rate_hz * KEPT_S) as usize).clamp(1, MOST_KEPT);
        let devices = Devices::new(History::of_each_device(&feed.run, Retention::Newest(kept)));
        let wanted = wanted.clone();
        self.replace_run(Source::Live { feed: Box::new(feed), wanted }, devices, parts);
        self.player = Player::live();
    }

    fn digest(&mut self, arrivals: Arrivals) {
        for record in &arrivals.records {
            self.devices.push(record);
            if record.events.intersects(EXCESS) {
                self.bell.ring();
            }
        }
        for change in &arrivals.changes {
            self.panels.iter_mut().for_each(|panel| panel.apply(change));
            self.take_in_guide(change);
            if change.outcome == Outcome::Applied {
                self.devices.push_change(change.time_ns, &change.parameter);
            }
        }
        to_draw(&arrivals.changes).into_iter().for_each(|change| self.follow(change));
        for answer in arrivals.answers {
            if let Some(reason) = answer.refused {
                self.panels.iter_mut().for_each(Panel::take_back);
                self.say(reason);
            }
        }
    }

    /// Applies a new parameter value to the drawn instance and its panels.
    fn follow(&mut self, change: &ChangeMessage) {
        if self.is_for_subject() {
            return; // the picture of a subject is independent of the felt force
        }
        if let Some(shape) = self.shapes.iter_mut().find(|shape| shape.name() == change.plugin) {
            shape.set_parameter(&change.parameter, change.number);
            self.shape_version += 1;
            for panel in self.panels.iter_mut().filter(|panel| panel.name == change.plugin) {
                panel.follow(shape);
            }
        }
    }
}

/// Selects the applied parameter changes to draw: the last change of each parameter, because a moving number changes with every
/// tick.
fn to_draw(changes: &[ChangeMessage]) -> Vec<&ChangeMessage> {
    let is_in_force =
        |change: &&ChangeMessage| change.outcome == Outcome::Applied && change.subject == Subject::Parameter;
    let mut drawn: Vec<&ChangeMessage> = Vec::new();
    for change in changes.iter().filter(is_in_force) {
        drawn.retain(|earlier| !earlier.is_of_the_same(change));
        drawn.push(change);
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    fn change(subject: Subject, parameter: &str, number: f64, outcome: Outcome) -> ChangeMessage {
        ChangeMessage {
            tick: 0,
            time_ns: 0,
            plugin: "spring".to_owned(),
            subject,
            parameter: parameter.to_owned(),
            value: number.to_string(),
            number,
            outcome,
            settings: Vec::new(),
        }
    }

    #[test]
    fn the_last_value_in_force_is_drawn_whatever_was_refused_after_it() {
        let applied = |parameter, number| change(Subject::Parameter, parameter, number, Outcome::Applied);
        let changes = [
            applied("gamma_n", 3.0),
            applied("turns", 7.0),
            applied("gamma_n", 5.0),
            change(Subject::Weight, "gamma_n", 0.5, Outcome::Applied),
            change(Subject::Parameter, "gamma_n", 9.0, Outcome::Refused),
            change(Subject::Parameter, "gamma_n", 11.0, Outcome::Broke),
        ];
        let drawn: Vec<_> =
            to_draw(&changes).into_iter().map(|change| (change.parameter.as_str(), change.number)).collect();
        assert_eq!(drawn, [("turns", 7.0), ("gamma_n", 5.0)]);
    }
}
