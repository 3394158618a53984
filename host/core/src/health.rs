//! Health of a model in a run: counters of its problems, and their text.

/// Reason for which a model was disabled: too many steps longer than the time limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrun {
    /// Last tick in which the model was stepped.
    pub tick: u64,
    /// Longest step, ns.
    pub longest_ns: u64,
    /// Time limit of a step, ns.
    pub limit_ns: u64,
}

/// Number of ticks with a problem, and the first of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TickCount {
    /// Number of ticks.
    pub ticks: u64,
    /// First tick; `None` without any.
    pub first: Option<u64>,
}

impl TickCount {
    /// Counts a tick. Real-time: bounded, no allocation.
    #[cold]
    pub fn count(&mut self, tick: u64) {
        self.ticks += 1;
        self.first.get_or_insert(tick);
    }

    /// Returns a value of the number of ticks and the first of them; `None` without any.
    fn map<T>(&self, value: impl FnOnce(u64, u64) -> T) -> Option<T> {
        self.first.map(|first| value(self.ticks, first))
    }
}

/// Contacts of an asynchronous model in a run, as far as the loop rendered them differently than published. No fault of the model.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactHealth {
    /// Ticks in which the newest set was older than it is valid: its forces faded.
    pub aged: TickCount,
    /// Ticks in which the iterations ended before the forces were exact to rounding.
    pub unsolved: TickCount,
    /// Stiffness of a contact and the smaller stiffness that the hand felt, N/m at the hand, where they differ most; `None` without a
    /// reduction.
    pub reduced_n_per_m: Option<[f64; 2]>,
    /// Largest stiffness of a contact for which no damping is known, N/m at the hand; 0 without such a contact.
    pub undamped_n_per_m: f64,
}

/// Health counters of a model, summed over its instances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ModelHealth {
    /// Tick of the first panic or violation of the contract by an instance; the instance is disabled from then on.
    pub panicked_at: Option<u64>,
    /// Outputs with non-finite numbers or an unknown status; each was replaced by no force.
    pub rejected: TickCount,
    /// Tick at which the process of an instance was found to have ended; the instance is disabled from then on.
    pub lost_at: Option<u64>,
    /// Ticks in which the last answer of an asynchronous model was too old.
    pub late: TickCount,
    /// Sets of contacts with numbers that are out of range or contradict each other; each was ignored.
    pub refused_sets: TickCount,
    /// Contacts of an asynchronous model.
    pub contacts: ContactHealth,
    /// Number of ticks without a reply in time from a worker process. Not a fault by themselves: the time budget limits them.
    pub late_answers: u64,
    /// Overrun for which the model was disabled; `None` if it was not.
    pub overrun: Option<Overrun>,
    /// Ticks in which the model changed the floating-point environment; the host restored it each time.
    pub float_changes: TickCount,
}

impl ModelHealth {
    /// Returns true without a problem to report; late replies and what a [notice](Self::notice) says are not problems.
    #[must_use]
    pub fn is_good(&self) -> bool {
        *self == Self { late_answers: self.late_answers, contacts: self.contacts, ..Self::default() }
    }

    /// Returns the worst problem as text, with the model's last message where it explains the problem; `None` without a problem. Not
    /// real-time.
    #[must_use]
    pub fn problem(&self, message: &str) -> Option<String> {
        let us = |ns: u64| ns as f64 * 1.0e-3;
        let message = if message.is_empty() { "no message" } else { message };
        if let Some(tick) = self.panicked_at {
            return Some(format!("panicked at tick {tick}, no force since: {message}"));
        }
        if let Some(tick) = self.lost_at {
            return Some(format!("process lost at tick {tick}, no force since: {message}"));
        }
        if let Some(Overrun { tick, longest_ns, limit_ns }) = self.overrun {
            let (longest_us, limit_us) = (us(longest_ns), us(limit_ns));
            return Some(format!(
                "took up to {longest_us:.0} µs a step, more than its {limit_us:.0} µs, and was faded out at tick {tick}"
            ));
        }
        let late = self.late.map(|ticks, first| format!("late in {ticks} ticks, the first at tick {first}"));
        let rejected = || {
            self.rejected.map(|ticks, first| {
                format!(
                    "{ticks} results were not finite, the first at tick {first}; the host replaced each by zero force"
                )
            })
        };
        let refused = || {
            self.refused_sets.map(|ticks, first| {
                format!("{ticks} sets of contacts were ignored, the first at tick {first}: {message}")
            })
        };
        let float_changes = || {
            self.float_changes.map(|ticks, first| {
                format!(
                    "changed the floating-point environment in {ticks} ticks, the first at tick {first}; the host \
                     restored it each time"
                )
            })
        };
        late.or_else(rejected).or_else(refused).or_else(float_changes)
    }

    /// Returns a sentence for users about contacts that were rendered differently than published; `None` otherwise. Not real-time.
    #[must_use]
    pub fn notice(&self, model: &str) -> Option<String> {
        let ContactHealth { aged, unsolved, reduced_n_per_m, undamped_n_per_m } = self.contacts;
        let reduced = reduced_n_per_m.map(|[asked, felt]| {
            format!(
                "have {felt:.0} N/m instead of {asked:.0}, the largest stable stiffness with the known damping (`cap = false` in \
                 `[model.field]` renders the full stiffness)"
            )
        });
        let undamped = (undamped_n_per_m > 0.0).then(|| {
            format!(
                "have no damping up to {undamped_n_per_m:.0} N/m, so only hand and device keep them stable \
                 (`damping_ns_per_m` in `[device]` limits them to the stable stiffness)"
            )
        });
        let aged = aged.map(|ticks, first| {
            format!("exceeded their validity time in {ticks} ticks, the first at tick {first}, and faded")
        });
        let unsolved = unsolved
            .map(|ticks, first| format!("did not converge in {ticks} ticks, the first at tick {first}"));
        let parts: Vec<_> = [reduced, undamped, aged, unsolved].into_iter().flatten().collect();
        (!parts.is_empty()).then(|| format!("the contacts of `{model}` {}", parts.join(", ")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_that_fade_are_no_fault_but_said() {
        let mut health = ModelHealth::default();
        assert_eq!((health.is_good(), health.problem(""), health.notice("gel")), (true, None, None));
        health.contacts.aged.count(7);
        health.contacts.aged.count(8);
        health.contacts.reduced_n_per_m = Some([2000.0, 500.0]);
        assert!(health.is_good() && health.problem("").is_none());
        let told = health.notice("gel").expect("they faded");
        assert!(told.starts_with("the contacts of `gel` have 500 N/m instead of 2000"), "{told}");
        assert!(told.ends_with("in 2 ticks, the first at tick 7, and faded"), "{told}");
    }

    #[test]
    fn a_refused_set_is_a_fault_with_its_reason() {
        let mut health = ModelHealth::default();
        health.refused_sets.count(3);
        let problem = health.problem("contact 0: `normal` does not have length 1: normalize it");
        assert!(
            !health.is_good()
                && problem
                    .is_some_and(|text| text
                        .ends_with("tick 3: contact 0: `normal` does not have length 1: normalize it"))
        );
    }
}
