//! A force sensor beside a handle: a run has its readings, however slow it is, and ends when it falls silent.

use flotor_core::trace::Events;
use flotor_hal::Fault;
use flotor_servo::Clock;
use flotor_servo::RunEnd;
use flotor_tests::TestSize;
use flotor_tests::watched::{Watched, watch_on};
use serialport::{SerialPort, TTYPort};
use std::io::{Read, Write};
use std::time::Duration;

/// How long the sensor takes for a reading: many ticks.
const READING: Duration = Duration::from_millis(30);

/// Runs a scene in real time, beside a sensor that answers `answers` questions with the number of each; it is borne for `timeout_ms`
/// that an answer does not come.
fn run_beside_a_sensor(answers: u32, duration_s: f64, timeout_ms: u32) -> Watched {
    let (mut ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
    ours.set_timeout(Duration::from_secs(5)).expect("it is ours");
    let port = theirs.name().expect("a pseudo terminal has a path");
    let sensor = std::thread::spawn(move || {
        let (mut byte, mut asked) = ([0], 0);
        while ours.read(&mut byte).is_ok_and(|length| length == 1) {
            if byte != *b"R" {
                continue;
            }
            asked += 1;
            if asked <= answers {
                std::thread::sleep(READING);
                if ours.write_all(format!("F {asked}\n").as_bytes()).is_err() {
                    break; // nobody listens any more
                }
            }
        }
    });
    let run = watch_on(
        Clock::Real,
        &format!(
            "duration_s = {duration_s}\n[limits]\nwatchdog_ms = 60000\n\
             [[device]]\nname = \"handle\"\nplugin = \"simulated\"\n\
             [[device]]\nname = \"scale\"\nplugin = \"force-sensor\"\n[device.parameters]\nport = \"{port}\"\n\
             timeout_ms = {timeout_ms}\n[[model]]\nplugin = \"spring\"\ndevice = \"handle\"\n"
        ),
    );
    drop(theirs); // the sensor's read ends
    sensor.join().expect("it gave up nothing");
    run
}

#[test]
fn a_slow_sensor_costs_the_handle_nothing() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let run = run_beside_a_sensor(u32::MAX, 3.0, 10_000);
    assert_eq!(run.outcome.end, RunEnd::Finished);
    assert!(!run.records.iter().any(|record| record.events.intersects(Events::HOLDING)));
    let readings: Vec<f64> = run
        .records
        .iter()
        .filter(|record| record.device == 1)
        .map(|record| record.delivered.force().z)
        .collect();
    assert!(readings.is_sorted(), "each reading counts one more");
    assert!(readings.last().is_some_and(|last| *last > 3.0), "{:?}", readings.last());
}

#[test]
fn a_sensor_that_falls_silent_is_a_fault() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    // A machine may delay the three answers; the run ends with the silence, long before its time.
    let run = run_beside_a_sensor(3, 20.0, 1000);
    assert_eq!(run.outcome.end, RunEnd::DeviceFault(Fault::Timeout));
}
