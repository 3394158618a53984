//! Handshake of the boot loader: succeeds with any bytes as firmware; each failure has its own error.

use flotor_falcon::boot::{BootFailure, start};
use flotor_falcon::kinematics::CENTRE_M;
use flotor_falcon::protocol::ALL_HOMED;
use flotor_falcon_emulator::in_process::InProcess;
use flotor_falcon_emulator::machine::{Fault, Machine, Motion, Power, place_of};
use flotor_hal::DVec3;
use std::time::Duration;

/// No firmware of anybody's: bytes without a pattern.
fn dummy(length: u32) -> Vec<u8> {
    (0..length).map(|number| number.wrapping_mul(2_654_435_761).to_be_bytes()[0]).collect()
}

fn device(power: Power, fault: Option<Fault>) -> InProcess {
    let mut machine = Machine::new(power, Motion::held(CENTRE_M));
    machine.breaks(fault);
    InProcess::new(machine)
}

#[test]
fn a_firmware_is_loaded_once_and_stays() {
    let device = device(Power::Off, None);
    assert_eq!(start(&device, None), Err(BootFailure::NoFirmware));
    let report = start(&device, Some(&dummy(8492))).expect("it is loaded");
    assert_eq!((report.homed, report.encoders), (0, [0; 3]), "no arm has met its end");
    assert_eq!(start(&device, None), Ok(report), "it runs already");
}

/// As incremental encoders do: a program that never homes the device sees them move.
#[test]
fn arms_that_have_not_met_their_ends_count_from_where_the_firmware_began() {
    let motion = Motion::ToAndFro { centre_m: CENTRE_M, amplitude_m: DVec3::Y * 0.02, frequency_hz: 2.0 };
    let device = InProcess::new(Machine::new(Power::Off, motion));
    let first = start(&device, Some(&dummy(500))).expect("it is loaded");
    assert_eq!((first.homed, first.encoders), (0, [0; 3]));
    let mut most = 0;
    for _ in 0..100 {
        let report = start(&device, None).expect("it runs already");
        assert_eq!(report.homed, 0);
        most = report.encoders.map(i16::abs).into_iter().fold(most, i16::max);
        if most > 100 {
            return;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    panic!("no arm moved by more than {most} counts");
}

#[test]
fn a_device_that_runs_reports_at_once() {
    let report = start(&device(Power::On, None), None).expect("it runs");
    assert_eq!(report.homed, ALL_HOMED);
    let place_m = place_of(report.encoders).expect("its arms can have these counts");
    // Half a count of each arm.
    assert!((place_m - CENTRE_M).length() < 40.0e-6, "{place_m}");
}

#[test]
fn each_failure_has_its_own_name_and_leaves_the_motors_at_rest() {
    let firmware = dummy(500);
    let byte = firmware[137];
    let cases = [
        (Power::Off, Fault::NoPrompt, BootFailure::NoPrompt),
        (Power::Off, Fault::NotAgreed(0x3f), BootFailure::NotAgreed(Some(0x3f))),
        (Power::Off, Fault::WrongEcho(137), BootFailure::Echo { at: 137, sent: byte, came: byte ^ 1 }),
        (Power::Off, Fault::NoEcho(499), BootFailure::NoEcho { at: 499 }),
        (Power::Off, Fault::NoReport, BootFailure::NoReport),
        (Power::On, Fault::StaleReport(1), BootFailure::StaleReports),
        (Power::On, Fault::ShortPacket(0), BootFailure::ShortPacket),
        (Power::On, Fault::HubReset(1), BootFailure::Lost),
    ];
    // Each waits for what does not come, some of them three times.
    std::thread::scope(|scope| {
        for (power, fault, failure) in cases {
            let firmware = &firmware;
            scope.spawn(move || {
                let device = device(power, Some(fault));
                assert_eq!(start(&device, Some(firmware)), Err(failure), "{fault:?}");
                assert_eq!(device.machine().command().motors, [0; 3]);
                let words = failure.to_string();
                assert!(words.contains(';') && words.lines().count() == 1, "what to do: {words}");
            });
        }
    });
}
