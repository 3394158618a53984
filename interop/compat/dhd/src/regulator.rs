//! Commands of regulated devices: in real time a thread sends one per tick, in lockstep each call that makes a tick.

use crate::device::{Open, Switch, count, live};
use crate::error::Code;
use crate::regulation::Regulation;
use flotor_compat::{Pace, quietly};
use std::sync::atomic::{AtomicBool, Ordering};

/// True while the regulation thread runs.
static HAS_THREAD: AtomicBool = AtomicBool::new(false);

/// Starts the regulation of a device: in real time a thread sends a command per tick; in lockstep every call that makes a
/// tick does.
pub(crate) fn start(open: &Open) {
    let state = open.station.state();
    {
        let mut device = open.device();
        open.set_switch(&mut device, Switch::On);
        device.regulation = Regulation::started(&state);
        open.send_again(&mut device);
    }
    if open.host.pace() == Pace::Lockstep || HAS_THREAD.swap(true, Ordering::AcqRel) {
        return;
    }
    let thread = std::thread::Builder::new().name("flotor-drd".to_owned());
    if quietly(|| thread.spawn(regulate_all)).is_err() {
        HAS_THREAD.store(false, Ordering::Release);
    }
}

/// Sends the commands of all regulated devices, while there are any.
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
        // Sleeps a period instead of waiting for a tick, which would consume the program's.
        std::thread::sleep(std::time::Duration::from_nanos(open.host.period_ns()));
    }
    HAS_THREAD.store(false, Ordering::Release);
}

/// Sends the command of a regulated device, in lockstep, where no thread does.
pub(crate) fn follow(open: &Open) {
    if open.host.pace() == Pace::Lockstep {
        let mut device = open.device();
        if device.regulation.is_running {
            open.send_again(&mut device);
        }
    }
}

/// Updates the regulation of all devices, for the next tick in lockstep.
pub(crate) fn follow_all() {
    for id in (0..).take(count()) {
        if let Ok(open) = live(id) {
            follow(&open);
        }
    }
}

/// Returns the device of an id for a read of its sample, which is counted, if open and not lost.
pub(crate) fn sampled(id: i8) -> Result<Open, Code> {
    live(id).inspect(|open| open.host.note_read(follow_all))
}
