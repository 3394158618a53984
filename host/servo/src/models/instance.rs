//! One instance of a model in the loop: the ticks of its steps, and its end after a panic.

use crate::engine::{Engine, Stepped};
use flotor_contact::Shortcoming;
use flotor_core::health::ModelHealth;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Memory, Tick};
use flotor_loader::InstanceState;

/// Instance of a model.
pub(super) struct Instance {
    pub(super) model: Engine,
    /// Tick of the last step.
    stepped_at: Option<u64>,
    /// Number of calls so far that changed the floating-point environment.
    float_changes: u64,
    /// True after a panic or process exit: the model is not called any more.
    pub(super) is_disabled: bool,
}

/// Output to use after a step.
pub(super) enum Usable {
    /// Output of the step.
    Output,
    /// Output of an earlier tick.
    Last,
    /// None: the model is disabled.
    Nothing,
}

impl Instance {
    pub(super) const fn new(model: Engine) -> Self {
        Self { model, stepped_at: None, float_changes: 0, is_disabled: false }
    }

    /// Resets a path-dependent model that was not stepped in the tick before `tick`; false if the reset fails. Real-time: bounded by
    /// the model, no allocation.
    #[inline(always)]
    fn forget_before(&mut self, tick: u64, memory: Memory) -> bool {
        let was_inactive = self.stepped_at.is_some_and(|last| last + 1 != tick);
        !(was_inactive && memory == Memory::PathDependent) || self.model.reset() == CallStatus::Ok
    }

    /// Prepares a step in this tick; returns false if the model is disabled. Real-time: bounded by the model, no allocation.
    #[inline(always)]
    pub(super) fn begin(&mut self, tick: u64, memory: Memory, health: &mut ModelHealth) -> bool {
        if self.is_disabled {
            return false;
        }
        if !self.forget_before(tick, memory) {
            self.fail(tick, health);
            return false;
        }
        self.stepped_at = Some(tick);
        true
    }

    /// Returns true if the last calls changed the floating-point environment, and counts the tick. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(super) fn has_changed_floats(&mut self, tick: u64, health: &mut ModelHealth) -> bool {
        let has_changed = self.model.float_changes() != self.float_changes;
        if has_changed {
            self.float_changes = self.model.float_changes();
            health.float_changes.count(tick);
        }
        has_changed
    }

    /// Counts the result of a step without an output of this tick, or with an imperfect one, and returns the usable output.
    /// Real-time: bounded, no allocation.
    #[inline(never)] // seldom called
    pub(super) fn count(&mut self, stepped: Stepped, tick: u64, health: &mut ModelHealth) -> Usable {
        match stepped {
            Stepped::Answered => {}
            Stepped::Short(Shortcoming::Aged) => health.contacts.aged.count(tick),
            Stepped::Short(Shortcoming::Unsolved) => health.contacts.unsolved.count(tick),
            Stepped::Refused => health.refused_sets.count(tick),
            Stepped::Late => {
                health.late_answers += 1;
                return Usable::Last;
            }
            Stepped::Silent => {
                health.late.count(tick);
                return Usable::Last;
            }
            Stepped::Broken => {
                self.fail(tick, health);
                return Usable::Nothing;
            }
            Stepped::Gone => {
                self.is_disabled = true;
                health.lost_at.get_or_insert(tick);
                return Usable::Nothing;
            }
        }
        Usable::Output
    }

    /// Disables the model after a panic or a violation of the contract. Real-time: bounded, no allocation.
    #[inline(never)] // once in a run
    pub(super) fn fail(&mut self, tick: u64, health: &mut ModelHealth) {
        self.is_disabled = true;
        health.panicked_at.get_or_insert(tick);
    }

    /// Changes a live parameter. Real-time: bounded, no allocation.
    pub(super) fn set_parameter(
        &mut self,
        tick: &Tick,
        parameter: usize,
        value: f64,
        health: &mut ModelHealth,
    ) -> CallStatus {
        let status = self.model.set_parameter(parameter, value);
        if status == CallStatus::Panicked {
            self.fail(tick.index, health);
        }
        status
    }

    /// Returns the state of the model before a tick; `None` if it cannot be saved. A path-dependent model that was not stepped in
    /// the last tick is reset first, as before its next step.
    pub(super) fn state(&mut self, tick: u64, memory: Memory) -> Option<InstanceState<'_>> {
        let is_ready = self.forget_before(tick, memory);
        self.stepped_at = tick.checked_sub(1);
        self.model.state().filter(|_| is_ready)
    }
}
