//! Commands and reports in the two threads: one command in flight; each fault has its own error and sets the motors to zero torque.

use flotor_falcon::DeviceError;
use flotor_falcon::boot::start;
use flotor_falcon::chip::Chip;
use flotor_falcon::exchange::{Exchange, ForceSwitch};
use flotor_falcon::kinematics::CENTRE_M;
use flotor_falcon::protocol::{Command, Homing, Lamp};
use flotor_falcon_emulator::in_process::InProcess;
use flotor_falcon_emulator::machine::{Fault, Machine, Motion, Power};
use flotor_hal::SafeStop;
use std::sync::Arc;
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(20);
const PUSH: Command = Command { motors: [100, -200, 300], lamp: Lamp::Green, homing: Homing::Done };

struct Running {
    device: InProcess,
    exchange: Exchange,
    switch: ForceSwitch,
}

fn running(timeout: Duration) -> Running {
    let device = InProcess::new(Machine::new(Power::On, Motion::held(CENTRE_M)));
    start(&device, None).expect("it runs");
    let (chip, switch): (Arc<dyn Chip>, _) = (Arc::new(device.clone()), ForceSwitch::default());
    let exchange = Exchange::start(&chip, &switch, timeout).expect("there are threads");
    Running { device, exchange, switch }
}

fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "{what}");
        std::thread::sleep(Duration::from_micros(300));
    }
}

#[test]
fn each_command_has_one_report() {
    let Running { device, mut exchange, .. } = running(PATIENCE);
    let before = device.machine().commands();
    let mut reports = 0;
    until("reports come", || {
        exchange.post(PUSH);
        reports += u64::from(exchange.take().expect("nothing is wrong").is_some());
        reports == 200
    });
    let commands = device.machine().commands() - before;
    // The newest may not be answered yet, and reports that nobody took are replaced.
    assert!(commands >= reports, "{commands} commands, {reports} reports");
    assert_eq!(device.machine().command(), PUSH);
    assert_eq!(exchange.end(), None);
    assert_eq!(device.machine().command(), Command::REST);
}

#[test]
fn every_fault_is_its_own_and_leaves_the_motors_at_rest() {
    for (fault, error) in [
        (Fault::ShortPacket(30), DeviceError::ShortPacket),
        (Fault::StaleReport(30), DeviceError::StaleReport),
        (Fault::IdlePackets(30), DeviceError::Silent),
        (Fault::Noise(30), DeviceError::Noise),
        (Fault::HubReset(30), DeviceError::Gone),
    ] {
        let timeout = if error == DeviceError::Silent { Duration::from_millis(200) } else { PATIENCE };
        let Running { device, exchange, .. } = running(timeout);
        device.machine().breaks(Some(fault));
        let mut found = None;
        until("it is noticed", || {
            exchange.post(PUSH);
            found = exchange.take().err();
            found.is_some()
        });
        assert_eq!(found, Some(error), "{fault:?}");
        // What is gone hears nothing any more.
        if error != DeviceError::Gone {
            until("the motors rest", || device.machine().command().motors == [0; 3]);
        }
        assert_eq!(exchange.take(), Err(error), "it stays");
    }
}

#[test]
fn a_stop_and_a_tick_that_never_comes_take_the_force_away() {
    let Running { device, exchange, switch } = running(PATIENCE);
    until("there is force", || {
        exchange.post(PUSH);
        device.machine().command() == PUSH
    });
    // Nothing else is left for the thread: it stops by itself.
    until("the motors rest", || device.machine().command().motors == [0; 3]);
    until("there is force again", || {
        exchange.post(PUSH);
        device.machine().command() == PUSH
    });
    std::thread::spawn(move || switch.safe_stop()).join().expect("it does not panic");
    until("the motors rest", || {
        exchange.post(PUSH);
        device.machine().command().motors == [0; 3]
    });
    for _ in 0..50 {
        exchange.post(PUSH);
        std::thread::sleep(Duration::from_millis(1));
        assert_eq!(device.machine().command().motors, [0; 3]);
    }
}
