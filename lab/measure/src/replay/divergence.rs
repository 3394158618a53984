//! Coverage of a run by a recording, and causes of a divergence without changes.

use flotor_core::Clock;
use flotor_core::trace::{Events, TickRecord};
use flotor_record::RunDescription;
use flotor_servo::Port;
use serde::Serialize;

/// Ticks of a run that can be compared. A tick without the record of a device counts as missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Coverage {
    /// First comparable tick: above 0 if the recording began after the start of the run. `None` without a comparable tick.
    pub begins_at_tick: Option<u64>,
    /// Last comparable tick; `None` without a comparable tick.
    pub ends_at_tick: Option<u64>,
    /// Number of missing ticks after the first comparable tick.
    pub missing_ticks: u64,
    /// First missing tick; `None` if none is missing.
    pub first_missing_tick: Option<u64>,
}

impl Coverage {
    /// Adds a complete tick; returns the number of missing ticks just before.
    fn add(&mut self, tick: u64) -> u64 {
        let missing = self.ends_at_tick.map_or(0, |last| tick.saturating_sub(last).saturating_sub(1));
        self.miss(missing);
        self.begins_at_tick.get_or_insert(tick);
        self.ends_at_tick = Some(tick);
        missing
    }

    /// Ends the coverage in the middle of `tick`, which counts as missing.
    pub(super) fn break_off(&mut self, tick: u64) {
        self.miss(self.ends_at_tick.map_or(1, |last| tick.saturating_sub(last)));
    }

    fn miss(&mut self, ticks: u64) {
        self.missing_ticks = self.missing_ticks.saturating_add(ticks);
        if ticks > 0 {
            let first = self.ends_at_tick.map_or(0, |last| last.saturating_add(1));
            self.first_missing_tick.get_or_insert(first);
        }
    }

    /// Returns true if no tick is missing from the first tick of the run to the last recorded tick.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.missing_ticks == 0 && !self.is_joined_late()
    }

    /// Returns true if the recording began after the start of the run.
    #[must_use]
    pub fn is_joined_late(&self) -> bool {
        self.begins_at_tick.is_some_and(|first| first > 0)
    }
}

/// Cause of a difference between replayed and recorded outputs of the models.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "cause", rename_all = "snake_case")]
#[non_exhaustive]
pub enum DivergenceCause {
    /// A model ran asynchronously, and the recording lacks the times of its results.
    #[error(
        "`{model}` ran asynchronously in real time, and the recording lacks the arrival times of its results"
    )]
    FieldOnRealClock {
        /// Name of the model.
        model: String,
    },
    /// A model was disabled in the run, because of its time budget or its process.
    #[error(
        "in tick {tick} of the run a model was disabled (time budget or process failure), but not in the replay"
    )]
    #[serde(rename = "model_out")]
    ModelDisabled {
        /// First tick of the run in which the model's absence made a difference.
        tick: u64,
    },
    /// A model was late, and the loop used its previous answer.
    #[error(
        "in tick {tick} of the run the result of a model was late, and the loop used the previous result; in the \
         replay no result is late"
    )]
    ModelLate {
        /// First tick of the run in which the delay made a difference.
        tick: u64,
    },
    /// Ticks are missing; before them the wrench is equal bit for bit.
    #[error(
        "ticks are missing after tick {after_tick} ({ticks} of them), so the states of models and couplings are unknown"
    )]
    Gap {
        /// Last tick before the missing ones.
        after_tick: u64,
        /// Number of missing ticks.
        ticks: u64,
    },
    /// The recording began after the start of the run.
    #[error(
        "the recording begins at tick {first_tick} of the run, so the earlier changes and the states of models and \
         couplings are unknown"
    )]
    JoinedLate {
        /// First recorded tick.
        first_tick: u64,
    },
    /// The recording shows no cause.
    #[error(
        "probably another build of the plugin, or another machine: replay with the plugin file and on the machine of the run"
    )]
    OtherBuild,
}

/// Evidence collected during the replay, to find the cause.
#[derive(Default)]
pub(super) struct Evidence {
    pub(super) coverage: Coverage,
    /// Cause by a model with a field of unknown arrival times.
    field: Option<DivergenceCause>,
    /// Last gap: tick before it, and number of missing ticks.
    gap: Option<(u64, u64)>,
    /// First tick in which a model was disabled in the run only.
    disabled_at: Option<u64>,
    /// Cause of the first differing tick; `None` if no tick differs.
    pub(super) cause: Option<DivergenceCause>,
}

impl Evidence {
    pub(super) fn of(run: &RunDescription) -> Self {
        let is_timed = run.clock == Clock::Real;
        let beside = run.plugins.iter().find(|plugin| is_timed && plugin.field.is_some());
        let field = beside.map(|plugin| DivergenceCause::FieldOnRealClock { model: plugin.name.clone() });
        Self { field, ..Self::default() }
    }

    /// Records the evidence of a tick before its comparison: one record and one port for each device.
    pub(super) fn look(&mut self, tick: u64, records: &[TickRecord], ports: &[Port]) {
        let last = self.coverage.ends_at_tick;
        let missing = self.coverage.add(tick);
        if let (Some(after_tick), true) = (last, missing > 0) {
            self.gap = Some((after_tick, missing));
        }
        if happened_then(Events::MODEL_FAULT, records, ports) {
            self.disabled_at.get_or_insert(tick);
        }
    }

    /// Records that the last tick differs. The events of this tick take precedence over earlier events: all earlier ticks
    /// were equal.
    pub(super) fn differs(&mut self, tick: u64, records: &[TickRecord], ports: &[Port]) {
        if self.cause.is_some() {
            return;
        }
        let first_tick = self.coverage.begins_at_tick.filter(|_| self.coverage.is_joined_late());
        let cause = if let Some(field) = &self.field {
            field.clone()
        } else if happened_then(Events::MODEL_FAULT, records, ports) {
            DivergenceCause::ModelDisabled { tick }
        } else if happened_then(Events::MODEL_OVERRUN, records, ports) {
            DivergenceCause::ModelLate { tick }
        } else if let Some((after_tick, ticks)) = self.gap {
            DivergenceCause::Gap { after_tick, ticks }
        } else if let Some(first_tick) = first_tick {
            DivergenceCause::JoinedLate { first_tick }
        } else {
            DivergenceCause::OtherBuild
        };
        self.cause = Some(cause);
    }

    /// Returns a cause of a difference besides the change; `None` if no tick differs or the recording shows no such cause.
    pub(super) fn other_cause(&self) -> Option<DivergenceCause> {
        let disabled = self.disabled_at.map(|tick| DivergenceCause::ModelDisabled { tick });
        self.field.clone().or(disabled).filter(|_| self.cause.is_some())
    }
}

/// Returns true if an event occurred in a tick of the run and not in the replay: events of the model itself recur.
fn happened_then(event: Events, records: &[TickRecord], ports: &[Port]) -> bool {
    let then_only = |(record, port): (&TickRecord, &Port)| {
        record.events.intersects(event) && !port.events.intersects(event)
    };
    records.iter().zip(ports).any(then_only)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coverage(ticks: &[u64]) -> Coverage {
        let mut coverage = Coverage::default();
        ticks.iter().for_each(|tick| {
            coverage.add(*tick);
        });
        coverage
    }

    #[test]
    fn missing_ticks_are_counted_between_the_first_and_the_last() {
        assert!(coverage(&[0, 1, 2]).is_whole() && coverage(&[]).is_whole());
        let gaps = coverage(&[0, 1, 4, 5, 7]);
        assert_eq!((gaps.missing_ticks, gaps.first_missing_tick, gaps.is_whole()), (3, Some(2), false));
        let late = coverage(&[10, 11]);
        assert_eq!((late.missing_ticks, late.is_joined_late(), late.is_whole()), (0, true, false));
        let wild = coverage(&[u64::MAX, 3, u64::MAX]); // a damaged file: any number, no panic
        assert_eq!(wild.missing_ticks, u64::MAX - 4);
    }

    #[test]
    fn a_tick_that_is_there_in_part_is_missing() {
        let mut broken = coverage(&[0, 1]);
        broken.break_off(2);
        assert_eq!((broken.missing_ticks, broken.first_missing_tick), (1, Some(2)));
    }
}
