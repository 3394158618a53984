//! The time of an emergency stop, on devices in C that are slow at a place of it (`tests/c/device_that.c`).

use flotor_core::trace::TickRecord;
use flotor_servo::{Clock, EmergencySource, StopSwitch};
use flotor_session::{Observer, Outcome};
use flotor_tests::library::compile_c_file;
use flotor_tests::scratch::Scratch;
use flotor_tests::watched::prepared;
use flotor_tests::workspace_root;
use std::time::Duration;

/// Presses the emergency stop once there is force.
struct PressOnForce(StopSwitch);

impl Observer for PressOnForce {
    fn observe(&mut self, record: &TickRecord) {
        if record.commanded.force().length() > 0.5 {
            self.0.press(EmergencySource::Key);
        }
    }
}

/// Runs a constant force of 1 N in real time until an emergency stop, on a device with statements in C at some of its places.
fn stopped(statements: &[&str]) -> Outcome {
    let scratch = Scratch::default();
    let library = scratch.path().join("libdevice_that.so");
    compile_c_file(&workspace_root().join("tests/c/device_that.c"), statements, &library);
    let scene = format!(
        "rate_hz = 1000\nduration_s = 60\n[device]\nplugin = \"{}\"\nname = \"slow\"\n[[model]]\nplugin = \"load\"\n\
         [model.parameters]\nforce_n = 1\n[limits]\nwatchdog_ms = 30000\nramp_s = 0\n",
        library.display()
    );
    let stop = StopSwitch::default();
    let outcome = prepared(Clock::Real, &scene).run(&mut PressOnForce(stop.clone()), &stop);
    outcome.unwrap_or_else(|error| panic!("it does not run: {error}"))
}

/// The summary names it; the time was in one of `parts`.
#[track_caller]
fn assert_named(outcome: &Outcome, parts: &[&str]) {
    let warnings = outcome.later_warnings().join("\n");
    assert!(
        warnings.contains("the emergency stop took longer than 20.0 ms: zero force at `slow`"),
        "{warnings}"
    );
    let named = warnings.split([',', ';']).filter(|text| parts.iter().any(|part| text.contains(part)));
    let longest_ms =
        named.filter_map(|text| text.split_whitespace().find_map(|word| word.parse::<f64>().ok()));
    assert!(longest_ms.fold(0.0, f64::max) > 20.0, "{parts:?}: {warnings}");
    assert!(
        outcome.stop_time.as_ref().and_then(|time| time.of_device(0)) > Some(Duration::from_millis(20)),
        "{warnings}"
    );
}

#[test]
fn a_device_whose_stop_takes_long_is_named() {
    assert_named(&stopped(&["IN_STOP=usleep(40000);"]), &["in `safe_stop`"]);
}

/// The request comes while the second command is under way, or just before: the command is then of the last tick.
#[test]
fn a_stop_that_waits_for_a_slow_command_is_named() {
    let slow = "IN_WRITE=static int writes; if (++writes > 1) { sleep(2); }";
    assert_named(&stopped(&[slow]), &["before the last tick", "ms during it"]);
}
