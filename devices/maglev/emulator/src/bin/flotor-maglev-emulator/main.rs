//! Emulator of the maglev device's controller: firmware and protocol on a real link, over the simulated flotor. `flotor
//! emulate maglev` starts this program.

mod ml_api;
mod plant;
mod proxy;
mod rig;
mod stator;
#[cfg(target_os = "linux")]
mod usb;

use clap::{Parser, ValueEnum};
use flotor_emulation::clients::{Clients, Tenure};
use flotor_emulation::command_line::{arguments, link_to, say, warn};
use flotor_emulation::port::{Port, ReachArguments};
use flotor_emulation::rig::{RigArguments, serve};
use flotor_hal::Refusal;
use flotor_loader::{LoadError, Setting};
use flotor_maglev::protocol::FRAME_BYTES;
use flotor_maglev::transport::stream::StreamLink;
use flotor_maglev::transport::tcp::{self, prepared};
use flotor_maglev::transport::{Incoming, LinkLost, Transport};
#[cfg(target_os = "linux")]
use flotor_maglev_emulator::gadget::Personality;
use flotor_maglev_emulator::{Emulator, Event, Pace, controller_config};
use plant::LoadedPlant;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Emulate the controller of the magnetic-levitation device.
#[derive(Parser)]
#[command(name = "flotor emulate maglev", version, max_term_width = 110)]
#[command(after_help = "The first lines on standard output have the addresses.\n\nExamples:\n  \
    flotor emulate maglev\n  \
    flotor emulate maglev --protocol ml-api\n  \
    flotor emulate maglev --transport pty --link /tmp/flotor-tty\n  \
    sudo modprobe vhci_hcd && sudo flotor emulate maglev --transport usb\n  \
    flotor emulate maglev --pace lockstep --set preset=full --set hand=press --once\n  \
    flotor emulate maglev --calibration-rig /tmp/flotor-force")]
struct Arguments {
    /// Protocol of the controller
    #[arg(long, value_enum, default_value = "flotor")]
    protocol: ProtocolOption,
    /// Transport to the host
    #[arg(long, value_enum, default_value = "tcp")]
    transport: TransportOption,
    /// TCP: address to listen at (port 0: any free port; default 127.0.0.1:5679, with the ML API 127.0.0.1:5678)
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
    #[command(flatten)]
    reach: ReachArguments,
    /// Pty: path of a symbolic link to the terminal (default: none)
    #[arg(long, value_name = "PATH")]
    link: Option<PathBuf>,
    /// Clock of the controller's cycles
    #[arg(long, value_enum, default_value = "real")]
    pace: Pace,
    /// Set a parameter of the simulated flotor, or of the plugin of --plant or --device (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<String>,
    #[command(flatten)]
    rig: RigArguments,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Serial number of the controller; no effect with the ML API, which has none
    #[arg(long, default_value = "emulated", value_name = "TEXT")]
    serial: String,
    /// Plugin file of the plant (default: the simulated flotor beside this program)
    #[arg(long, value_name = "FILE")]
    plant: Option<PathBuf>,
    /// End when the first host disconnects (not with the ML API)
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    ml_api: ml_api::MlApiArguments,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ProtocolOption {
    /// Flotor's own protocol, on every transport
    Flotor,
    /// The ML API 1.5b of the Maglev 200, on TCP: for every program written for that device
    MlApi,
}

#[derive(Clone, Copy, ValueEnum)]
enum TransportOption {
    /// TCP connection
    Tcp,
    /// A pseudo terminal: a serial port to the host
    Pty,
    /// A USB device with interrupt endpoints (with the module vhci_hcd, as root)
    #[cfg(target_os = "linux")]
    Usb,
    /// A USB device with bulk endpoints (with the module vhci_hcd, as root)
    #[cfg(target_os = "linux")]
    UsbBulk,
    /// A USB HID device (with the module vhci_hcd, as root)
    #[cfg(target_os = "linux")]
    Hid,
    /// A USB serial port (with the module vhci_hcd, as root)
    #[cfg(target_os = "linux")]
    Cdc,
}

fn main() -> ExitCode {
    match run(&arguments()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            warn(&format!("error: {error}"));
            let is_plugins = error.downcast_ref().is_some_and(LoadError::is_configuration);
            ExitCode::from(if is_plugins || error.is::<Refusal>() { 2 } else { 1 })
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if let Some(device) = &arguments.ml_api.device {
        return proxy::become_host(device, arguments);
    }
    let pace = arguments.pace;
    let plugin = plant::load(arguments.plant.as_deref())?;
    let parse = |source: &str, key: &str, value: &str| {
        Setting::parse(plugin.parameters(), key, value)
            .map_err(|error| Refusal::parameter(format!("{source} {key}={value}: {error}")))
    };
    let mut settings = Vec::new();
    let defaults = match arguments.protocol {
        ProtocolOption::MlApi if arguments.rig.rig().is_none() => arguments.ml_api.plant_defaults(),
        ProtocolOption::MlApi | ProtocolOption::Flotor => &[],
    };
    let is_set =
        |key: &str| arguments.sets.iter().any(|text| text.split('=').next().map(str::trim) == Some(key));
    for (key, value) in defaults.iter().filter(|(key, _)| !is_set(key)) {
        settings.push(parse("--hand none sets", key, value)?);
    }
    if let Some((link, stand)) = arguments.rig.rig() {
        for (key, value) in rig::settings(link, stand)? {
            settings.push(parse("--calibration-rig sets", key, &value)?);
        }
    }
    for text in &arguments.sets {
        let (key, value) = key_value(text)?;
        settings.push(parse("--set", key, value)?);
    }
    let (mut plant, capabilities) = LoadedPlant::open(plugin, settings, arguments.seed)?;
    if let Some((link, _)) = arguments.rig.rig() {
        let force = rig::SensedForce::default();
        let sensed = force.clone();
        let port = serve(link, move || sensed.value_n())?;
        plant.sense(force)?;
        say(&format!("force-sensor {}", port.display()));
    }
    if arguments.protocol == ProtocolOption::MlApi {
        return ml_api::serve(plant, pace, arguments);
    }
    let config = controller_config(&capabilities, pace, &arguments.serial);
    let mut emulator = Emulator::new(config, pace, plant);
    match arguments.transport {
        TransportOption::Tcp => serve_tcp(&mut emulator, arguments),
        TransportOption::Pty => serve_pty(&mut emulator, arguments),
        #[cfg(target_os = "linux")]
        TransportOption::Usb => usb::serve(&mut emulator, arguments, Personality::Interrupt),
        #[cfg(target_os = "linux")]
        TransportOption::UsbBulk => usb::serve(&mut emulator, arguments, Personality::Bulk),
        #[cfg(target_os = "linux")]
        TransportOption::Hid => usb::serve(&mut emulator, arguments, Personality::Hid),
        #[cfg(target_os = "linux")]
        TransportOption::Cdc => usb::serve(&mut emulator, arguments, Personality::Serial),
    }
}

/// Splits a value of `--set`.
fn key_value(text: &str) -> Result<(&str, &str), Refusal> {
    let pair = text.split_once('=').map(|(key, value)| (key.trim(), value.trim()));
    pair.ok_or_else(|| Refusal::parameter(format!("--set {text} has no `=`; write KEY=VALUE")))
}

/// Listens at the given address, or at this port of the loopback interface, and prints the address.
fn listen(arguments: &Arguments, port: u16) -> Result<Port, Box<dyn Error>> {
    let at = arguments.listen.clone().unwrap_or_else(|| format!("127.0.0.1:{port}"));
    let port =
        Port::bind(&at, arguments.reach.reach()).map_err(|error| Refusal::parameter(error.to_string()))?;
    say(&format!("listening tcp {}", port.address()?));
    Ok(port)
}

fn serve_tcp(emulator: &mut Emulator<LoadedPlant>, arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut clients = Clients::of(listen(arguments, tcp::PORT)?)?;
    loop {
        let stream = clients.wait_for_one()?;
        // A client that has already disconnected is not an error.
        let (Ok(from), Ok(stream)) = (stream.peer_addr(), prepared(stream)) else { continue };
        say(&format!("connected {from}"));
        let mut link = ServedHost { link: StreamLink::new(stream), tenure: Tenure::begin(&mut clients) };
        emulator.serve(&mut link, &AtomicBool::new(false), &mut tell);
        if arguments.once {
            return Ok(());
        }
    }
}

/// A link with the time limits of its client, lost when a limit is exceeded; each answered request counts as a message.
struct ServedHost<'c, L> {
    link: L,
    tenure: Tenure<'c>,
}

impl<L: Transport> Transport for ServedHost<'_, L> {
    fn send(&mut self, frame: &[u8; FRAME_BYTES]) -> Result<(), LinkLost> {
        self.tenure.message();
        self.link.send(frame)
    }

    fn receive(&mut self) -> Result<Incoming, LinkLost> {
        if self.tenure.is_over() {
            return Err(LinkLost);
        }
        self.link.receive()
    }
}

fn serve_pty(emulator: &mut Emulator<LoadedPlant>, arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    use serialport::{SerialPort, TTYPort};
    use std::time::Duration;
    /// Poll interval of the terminal while the other end is closed.
    const NAP: Duration = Duration::from_millis(2);

    let (mut ours, theirs) = TTYPort::pair()?;
    ours.set_timeout(Duration::ZERO)?;
    let name = theirs.name().ok_or("the pseudo terminal has no name; start the emulator again")?;
    drop(theirs);
    if let Some(link) = &arguments.link {
        link_to(Path::new(&name), link)?;
    }
    say(&format!("listening pty {name}"));
    let mut link = StreamLink::new(ours);
    loop {
        // A read reports the other end as closed until a program opens it.
        while !link.is_open() {
            std::thread::sleep(NAP);
        }
        say(&format!("connected {name}"));
        emulator.serve(&mut link, &AtomicBool::new(false), &mut tell);
        if arguments.once {
            return Ok(());
        }
    }
}

/// Prints one line per event, unbuffered, as another program may wait for it.
fn tell(event: Event) {
    match event {
        Event::Mode { mode, condition, silence_us, at_us } => {
            let faults = condition.faults();
            let why = if faults.is_empty() { String::new() } else { format!(" faults={faults}") };
            say(&format!("mode {mode:?} at_us={at_us} silence_us={silence_us}{why}"));
        }
        Event::Closed { rejections } => say(&format!("closed rejected={} {rejections}", rejections.total())),
    }
}
