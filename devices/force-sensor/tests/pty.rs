//! Plugin with an emulated sensor at a pseudo terminal, called through the device contract as by a host.

use flotor_hal::{Cycle, DVec3, DeviceState, Fault, LoopConfig, Tick, Wrench};
use flotor_loader::{ActiveDevice, OpenedDevice, Plugin, Setting};
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What the emulated sensor answers to a question; nothing ends it.
type Answers = dyn FnMut() -> Option<String> + Send;

/// A sensor on a thread of its own, at the path of a pseudo terminal.
struct Emulated {
    path: String,
    questions: Arc<Mutex<u64>>,
    thread: Option<JoinHandle<()>>,
}

fn emulated(mut answers: Box<Answers>) -> Emulated {
    let (mut ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
    ours.set_timeout(Duration::from_secs(20)).expect("it is ours");
    let path = theirs.name().expect("a pseudo terminal has a path");
    let questions = Arc::new(Mutex::new(0));
    let asked = Arc::clone(&questions);
    let thread = std::thread::spawn(move || {
        let (_theirs, mut byte, mut text) = (theirs, [0], Vec::new());
        while ours.read(&mut byte).is_ok_and(|length| length == 1) {
            text.extend(byte);
            if !text.ends_with(b"R\n") {
                continue;
            }
            text.clear();
            *asked.lock().expect("nobody panics with it") += 1;
            match answers() {
                Some(answer) => ours.write_all(answer.as_bytes()).expect("somebody listens"),
                None => return,
            }
        }
    });
    Emulated { path, questions, thread: Some(thread) }
}

impl Emulated {
    /// By a host that waits for long: a machine may delay every answer.
    fn open(&self) -> Result<OpenedDevice, String> {
        self.open_waiting_ms(8000.0)
    }

    fn open_waiting_ms(&self, timeout_ms: f64) -> Result<OpenedDevice, String> {
        let plugin = Plugin::in_process(&flotor_force_sensor::FLOTOR_ENTRY).expect("it is a plugin");
        let settings = [
            Setting::parse(plugin.parameters(), "port", &self.path).expect("a path is a text"),
            Setting::number(plugin.parameters(), "timeout_ms", timeout_ms).expect("it is a number"),
        ];
        plugin.open_device(&settings).map_err(|error| error.to_string())
    }

    /// Asked until it says something.
    fn next(device: &mut ActiveDevice, index: &mut u64) -> (Cycle, DeviceState) {
        let (mut state, started) = (DeviceState::HOME, Instant::now());
        loop {
            let tick = Tick { index: *index, time_ns: *index * 1_000_000, dt_ns: 1_000_000 };
            *index += 1;
            match device.read(&tick, &mut state) {
                Cycle::Stale => assert!(started.elapsed() < Duration::from_secs(10), "it says nothing"),
                said => return (said, state),
            }
            assert_eq!(device.write(&tick, &Wrench::ZERO), Cycle::Fresh);
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Emulated {
    fn drop(&mut self) {
        if let Some(thread) = self.thread.take()
            && thread.is_finished()
        {
            let _ = thread.join();
        }
    }
}

const CONFIG: LoopConfig = LoopConfig { period_ns: 1_000_000, seed: 1 };

fn active(opened: OpenedDevice) -> ActiveDevice {
    opened.activate(&CONFIG).map_err(|(_, refusal)| refusal).expect("it measures")
}

#[test]
fn each_reading_is_fresh_once_and_one_question_waits_at_a_time() {
    let mut newtons = 0.0;
    let sensor = emulated(Box::new(move || {
        newtons += 1.25;
        Some(format!("F {newtons}\r\n"))
    }));
    // The first reading proved that there is a sensor.
    let mut device = active(sensor.open().expect("it answers"));
    let mut index = 0;
    for reading in 2..30_u32 {
        let (cycle, state) = Emulated::next(&mut device, &mut index);
        assert_eq!((cycle, state.delivered.force()), (Cycle::Fresh, DVec3::Z * 1.25 * f64::from(reading)));
    }
    let questions = *sensor.questions.lock().expect("nobody panics with it");
    assert!((29..=30).contains(&questions), "{questions} questions for 29 answers");
}

#[test]
fn silence_nonsense_and_a_pulled_cable_are_faults() {
    let script = |last: Option<&'static str>| {
        let mut asked = 0;
        emulated(Box::new(move || {
            asked += 1;
            if asked < 3 { Some("F 1\n".to_owned()) } else { last.map(str::to_owned) }
        }))
    };
    for (last, fault, timeout_ms) in [
        (Some("E overload\n"), Fault::Protocol, 8000.0),
        (Some(""), Fault::Timeout, 2000.0),
        (None, Fault::Disconnected, 8000.0),
    ] {
        let sensor = script(last);
        let (mut device, mut index) = (active(sensor.open_waiting_ms(timeout_ms).expect("it answers")), 0);
        assert_eq!(Emulated::next(&mut device, &mut index).0, Cycle::Fresh);
        assert_eq!(Emulated::next(&mut device, &mut index).0, Cycle::Fault(fault), "{last:?}");
    }
}

#[test]
fn what_is_no_sensor_is_refused_in_one_sentence() {
    let nonsense = emulated(Box::new(|| Some("hello\n".to_owned()))).open().err().unwrap_or_default();
    assert!(nonsense.contains("answers `hello` instead of a force like `F 1.234`"), "{nonsense}");
    let silent = emulated(Box::new(|| Some(String::new())));
    let silent = silent.open_waiting_ms(200.0).err().unwrap_or_default();
    assert!(silent.contains("does not answer within 200 ms"), "{silent}");
    let sensor = emulated(Box::new(|| Some("F 1\n".to_owned())));
    let held = sensor.open().expect("it answers");
    let busy = sensor.open().err().unwrap_or_default();
    assert!(busy.contains("another program uses the port"), "{busy}");
    drop(held);
}
