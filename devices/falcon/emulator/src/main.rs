//! Program `flotor emulate falcon`: a Novint Falcon without hardware.

use clap::{Parser, ValueEnum};
use flotor_emulation::clients::{Clients, Tenure};
use flotor_emulation::command_line::{arguments, say, warn, within};
use flotor_emulation::port::{Port, ReachArguments};
use flotor_emulation::rig::RigArguments;
use flotor_falcon::kinematics::CENTRE_M;
use flotor_falcon_emulator::in_process::InProcess;
use flotor_falcon_emulator::machine::{Machine, Motion, Power};
use flotor_falcon_emulator::{rig, server};
use flotor_hal::DVec3;
use std::error::Error;
use std::process::ExitCode;

/// Emulate a Novint Falcon: a hand moves its handle up and down.
#[derive(Parser)]
#[command(name = "flotor emulate falcon", version, max_term_width = 110)]
#[command(after_help = "A line on standard output has the address.\n\nExamples:\n  \
    flotor emulate falcon\n  \
    sudo modprobe vhci_hcd && sudo flotor emulate falcon --transport usb --power off\n  \
    flotor emulate falcon --calibration-rig /tmp/flotor-force")]
struct Arguments {
    /// Connection to the host
    #[arg(long, value_enum, default_value = "tcp")]
    transport: TransportOption,
    /// TCP: address to listen at (port 0: any free port)
    #[arg(long, default_value = "127.0.0.1:4108", value_name = "HOST:PORT")]
    listen: String,
    #[command(flatten)]
    reach: ReachArguments,
    /// Power state at the start: with or without running firmware
    #[arg(long, value_enum, default_value = "on")]
    power: Power,
    /// Amplitude, from the middle of the motion to its ends, in mm, 0 to 40; no effect with --calibration-rig
    #[arg(long, default_value_t = 15.0, value_name = "MM", value_parser = within(0.0, 40.0, "mm"))]
    amplitude_mm: f64,
    /// Frequency of the motion, in Hz, 0 to 10; no effect with --calibration-rig
    #[arg(long, default_value_t = 0.5, value_name = "HZ", value_parser = within(0.0, 10.0, "Hz"))]
    frequency_hz: f64,
    #[command(flatten)]
    rig: RigArguments,
    /// TCP: end when the first host disconnects
    #[arg(long)]
    once: bool,
}

impl Arguments {
    /// Returns the motion of the hand: a sine along the vertical.
    fn motion(&self) -> Motion {
        // Up is y in the maker's frame.
        Motion::ToAndFro {
            centre_m: CENTRE_M,
            amplitude_m: DVec3::Y * (self.amplitude_mm * 1.0e-3),
            frequency_hz: self.frequency_hz,
        }
    }
}

#[derive(Clone, Copy, ValueEnum)]
enum TransportOption {
    /// TCP connection; set `address = "tcp:HOST:PORT"` in the plugin
    Tcp,
    /// USB of this machine, for every program (with the module vhci_hcd, as root)
    #[cfg(target_os = "linux")]
    Usb,
}

fn main() -> ExitCode {
    match run(&arguments()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            warn(&format!("error: {error}"));
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let power = arguments.power;
    let device = match arguments.rig.rig() {
        Some((link, stand)) => {
            let (device, sensor) = rig::device_on(stand, link, power)?;
            say(&format!("force-sensor {}", sensor.display()));
            device
        }
        None => InProcess::new(Machine::new(power, arguments.motion())),
    };
    match arguments.transport {
        TransportOption::Tcp => {
            let port = Port::bind(&arguments.listen, arguments.reach.reach())?;
            say(&format!("listening tcp:{}", port.address()?));
            let mut clients = Clients::of(port)?;
            loop {
                let stream = clients.wait_for_one()?;
                // A host that disconnects is not a failure.
                let _ = server::serve(stream, &device, Tenure::begin(&mut clients));
                if arguments.once {
                    return Ok(());
                }
            }
        }
        #[cfg(target_os = "linux")]
        TransportOption::Usb => {
            let gadget = flotor_falcon_emulator::gadget::Gadget::plug_in(device)?;
            say("listening usb 0403:cb48");
            while gadget.is_plugged_in() {
                std::thread::sleep(std::time::Duration::from_millis(50));
            }
            Ok(())
        }
    }
}
