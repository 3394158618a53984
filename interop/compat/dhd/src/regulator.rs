//! Commands of regulated devices: in real time a thread sends a command per tick, in lockstep every call that executes a tick does.

use crate::device::{Open, Switch, count, live};
use crate::error::Code;
use crate::regulation::Regulation;
use flotor_compat::{Pace, quietly, report_no_thread};
use std::sync::atomic::{AtomicBool, Ordering};

/// True while the regulation thread runs.
static HAS_THREAD: AtomicBool = AtomicBool::new(false);

/// Starts the regulation of a device at its current pose and enables its force; in real time also starts the regulation thread.
///
/// # Errors
/// [`Code::NoRegulation`], with the force disabled, if the system cannot start the thread; the cause is reported on standard error.
pub(crate) fn start(open: &Open) -> Result<(), Code> {
    let state = open.station.state();
    {
        let mut device = open.device();
        open.set_switch(&mut device, Switch::On);
        device.regulation = Regulation::started(&state);
        open.send_again(&mut device);
    }
    if open.host.pace() == Pace::Lockstep || HAS_THREAD.swap(true, Ordering::AcqRel) {
        return Ok(());
    }
    let thread = std::thread::Builder::new().name("flotor-drd".to_owned());
    if let Err(cause) = quietly(|| thread.spawn(regulate_all)) {
        HAS_THREAD.store(false, Ordering::Release);
        open.set_switch(&mut open.device(), Switch::Off);
        report_no_thread("the regulation", &cause);
        return Err(Code::NoRegulation);
    }
    Ok(())
}

/// Sends the commands of all regulated devices once per period, until no device is regulated.
fn regulate_all() {
    loop {
        let mut first = None;
        for id in (0..).take(count()) {
            let Ok(open) = live(id) else { continue };
            let mut device = open.device();
            if device.regulation.is_running {
                open.send_again(&mut device);
                drop(device);
                first = first.or(Some(open));
            }
        }
        let Some(open) = first else { break };
        // Sleep for a period: waiting for a tick would consume the program's tick.
        std::thread::sleep(std::time::Duration::from_nanos(open.host.period_ns()));
    }
    HAS_THREAD.store(false, Ordering::Release);
}

/// In lockstep, sends the command of a regulated device; in real time the regulation thread does.
pub(crate) fn follow(open: &Open) {
    if open.host.pace() == Pace::Lockstep {
        let mut device = open.device();
        if device.regulation.is_running {
            open.send_again(&mut device);
        }
    }
}

/// In lockstep, sends the commands of all regulated devices, before the next tick.
pub(crate) fn follow_all() {
    for id in (0..).take(count()) {
        if let Ok(open) = live(id) {
            follow(&open);
        }
    }
}

/// Returns the device of an id, if open and not lost, and counts a read of its sample.
pub(crate) fn sampled(id: i8) -> Result<Open, Code> {
    live(id).inspect(|open| open.host.note_read(follow_all))
}
