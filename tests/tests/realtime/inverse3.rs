//! The plugin of the Inverse3 against its stand-in: neither a tick nor the thread's exchange of messages allocates.

use super::counted;
use flotor_hal::{Cycle, DVec3, DeviceState, LoopConfig, Tick, Wrench};
use flotor_inverse3::session::{GripRequest, Request, Session};
use flotor_loader::{Plugin, Setting};
use flotor_tests::TestSize;
use service_with_faults::{ARM, Said, StandIn, configured, state};
use std::time::Duration;

#[path = "../../../devices/inverse3/tests/stand_in/mod.rs"]
#[allow(dead_code, unused_imports)] // the tests of the plugin use the rest
mod service_with_faults;

fn stand_in() -> StandIn {
    let answer = state(DVec3::new(0.0123, -0.0456, 0.0789), DVec3::ZERO);
    StandIn::start(move |number, _| Said::Text(if number == 1 { configured(0.0) } else { answer.clone() }))
        .expect("there is a port")
}

/// A force that changes, within what its stand-in's silence about forces explains.
fn force_n(number: usize) -> DVec3 {
    DVec3::new(1.0, -0.3, 0.1) * (number % 97) as f64 / 97.0
}

#[test]
fn an_exchange_of_messages_allocates_nothing() {
    let service = stand_in();
    let request = Request {
        address: service.address.clone(),
        arm: Some(ARM.to_owned()),
        grip: GripRequest::OnlyOne,
        force_gate: 0.0,
        timeout: Duration::from_secs(9),
        foreign_force_n: 0.5,
    };
    let mut session = Session::open(&request).expect("the service agrees");
    let exchanges = TestSize::of_this_run().pick(1000, 60_000);
    let allocations = counted(|| {
        for number in 0..exchanges {
            session.exchange(force_n(number)).expect("the service answers");
        }
    });
    assert_eq!(allocations, 0);
}

#[test]
fn a_tick_on_an_inverse3_allocates_nothing() {
    let service = stand_in();
    let plugin = Plugin::in_process(&flotor_inverse3::FLOTOR_ENTRY).expect("it is a plugin");
    let settings = [("address", &*service.address), ("device", ARM), ("timeout_ms", "9000")];
    let settings =
        settings.map(|(key, value)| Setting::parse(plugin.parameters(), key, value).expect("it is legal"));
    let opened = plugin.open_device(&settings).expect("the service agrees");
    let config = LoopConfig { period_ns: 1_000_000, seed: 1 };
    let mut active = opened.activate(&config).map_err(|(_, refusal)| refusal).expect("it starts");
    let (mut fresh, mut state) = (0, DeviceState::HOME);
    let allocations = counted(|| {
        for number in 0..300 {
            let tick = Tick { index: number, time_ns: number * 1_000_000, dt_ns: 1_000_000 };
            fresh += u32::from(active.read(&tick, &mut state) == Cycle::Fresh);
            let wrench = Wrench::from_force(force_n(usize::try_from(number).unwrap_or(0)));
            assert!(!matches!(active.write(&tick, &wrench), Cycle::Fault(_)));
            std::thread::sleep(Duration::from_millis(1));
        }
    });
    assert_eq!(allocations, 0);
    assert!(fresh > 10, "{fresh} samples in 300 ticks");
}
