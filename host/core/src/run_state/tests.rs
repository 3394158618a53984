use super::*;

const RAMP_NS: u64 = 100;
const NOW_NS: u64 = 1_000;
const FAULT: Cause = Cause::Device(Fault::OverTemperature);

const YOUNG: RunState = RunState::Ramping { since_ns: NOW_NS - 50 };
const GROWN: RunState = RunState::Ramping { since_ns: NOW_NS - RAMP_NS };
const LEAVING: RunState = RunState::Releasing { since_ns: NOW_NS - 50, from: 1.0 };
const LEFT: RunState = RunState::Releasing { since_ns: NOW_NS - RAMP_NS, from: 1.0 };
const FAULTED: RunState = RunState::Faulted(FAULT);
const PRESSED: RunState = RunState::EmergencyStopped(EmergencySource::Key);

const STATES: [RunState; 9] =
    [YOUNG, GROWN, RunState::Active, RunState::Holding, LEAVING, LEFT, RunState::Stopped, FAULTED, PRESSED];
const EVENTS: [RunEvent; 7] = [
    RunEvent::Time,
    RunEvent::SamplesLost,
    RunEvent::SamplesBack,
    RunEvent::StopRequested,
    RunEvent::Failed(Cause::Watchdog),
    RunEvent::Failed(Cause::Device(Fault::EmergencyStop)),
    RunEvent::Emergency(EmergencySource::Signal),
];

/// Every state, every event, and where it leads: rows as [`STATES`], columns as [`EVENTS`].
#[test]
fn every_transition_is_the_one_that_is_drawn() {
    use RunState::{Active, Holding, Stopped};
    let bitten = RunState::Faulted(Cause::Watchdog);
    let device = RunState::EmergencyStopped(EmergencySource::Device);
    let signal = RunState::EmergencyStopped(EmergencySource::Signal);
    let release = |from| RunState::Releasing { since_ns: NOW_NS, from };
    let again = RunState::Ramping { since_ns: NOW_NS };
    let table = [
        [YOUNG, Holding, YOUNG, release(0.5), bitten, device, signal],
        [Active, Holding, GROWN, release(1.0), bitten, device, signal],
        [Active, Holding, Active, release(1.0), bitten, device, signal],
        [Holding, Holding, again, Stopped, bitten, device, signal],
        [LEAVING, Stopped, LEAVING, LEAVING, bitten, device, signal],
        [Stopped, Stopped, LEFT, LEFT, bitten, device, signal],
        [Stopped; 7],
        [FAULTED, FAULTED, FAULTED, FAULTED, FAULTED, FAULTED, signal],
        [PRESSED; 7],
    ];
    for (state, row) in STATES.iter().zip(table) {
        for (event, expected) in EVENTS.iter().zip(row) {
            let found = state.after(*event, NOW_NS, RAMP_NS);
            assert_eq!(found, expected, "{state:?} after {event:?}");
        }
    }
}

#[test]
fn no_state_that_is_over_lets_anything_pass_or_ever_leads_back() {
    for state in STATES.into_iter().filter(|state| state.is_over()) {
        for event in EVENTS {
            let next = state.after(event, NOW_NS, RAMP_NS);
            assert!(next.is_over(), "{state:?} after {event:?}: {next:?}");
            assert_eq!(next.gate(NOW_NS, RAMP_NS), Gate::SHUT);
        }
    }
}

#[test]
fn the_gate_opens_and_shuts_without_a_step() {
    let mut state = RunState::START;
    let mut last = state.gate(0, RAMP_NS);
    assert_eq!(last, Gate { models: 0.0, boundary: 1.0 });
    let mut highest = 0.0_f64;
    // Stopped half-way through the ramp, where a careless fade-out would start from 1.
    for now_ns in 0..=200 {
        let event = if now_ns == 50 { RunEvent::StopRequested } else { RunEvent::Time };
        state = state.after(event, now_ns, RAMP_NS);
        let gate = state.gate(now_ns, RAMP_NS);
        // Steepest slope of 3 p^2 - 2 p^3 is 1.5 per ramp.
        assert!((gate.models - last.models).abs() <= 1.5 / 100.0 + 1.0e-12, "{now_ns}: {last:?} {gate:?}");
        highest = highest.max(gate.models);
        last = gate;
    }
    assert_eq!((state, last), (RunState::Stopped, Gate::SHUT));
    assert!((highest - 0.5).abs() < 0.02, "{highest}");
}

/// Out of `Holding` nothing may push before there are samples again: the boundary would, on a pose that is old.
#[test]
fn a_gate_that_is_shut_opens_with_new_samples_only() {
    for event in EVENTS {
        let next = RunState::Holding.after(event, NOW_NS, RAMP_NS);
        let is_shut = next.gate(NOW_NS, RAMP_NS) == Gate::SHUT;
        assert_eq!(is_shut, event != RunEvent::SamplesBack, "{event:?}");
    }
}

#[test]
fn without_a_ramp_the_gate_is_open_at_once() {
    assert_eq!(RunState::START.gate(0, 0), Gate::OPEN);
    assert_eq!(RunState::START.after(RunEvent::Time, 0, 0), RunState::Active);
}
