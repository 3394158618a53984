//! Runs on emulated devices, each with its own log of the force on the hand. A device outlives its host.

use crate::board::{Board, Where, dies, run_on};
use crate::force_log::ForceLog;
use crate::post::Post;
use flotor_falcon::kinematics::CENTRE_M;
use flotor_falcon_emulator::clients::{Clients, Tenure};
use flotor_falcon_emulator::in_process::InProcess;
use flotor_falcon_emulator::machine::{Machine, Motion, Power};
use flotor_falcon_emulator::port::{Port, Reach};
use flotor_hal::Wrench;
use flotor_loader::Plugin;
use flotor_maglev::protocol::Mode;
use flotor_maglev::transport::Transport;
use flotor_maglev::transport::stream::StreamLink;
use flotor_maglev::transport::tcp::prepared;
use flotor_maglev_emulator::controller::Sample;
use flotor_maglev_emulator::{Emulator, Pace, Plant, controller_config};
use flotor_tests::TestSize;
use flotor_tests::library::build_folder;
use flotor_tests::process::Owned;
use flotor_tests::program::Flotor;
use flotor_tests::scratch::Scratch;
use serialport::{SerialPort, TTYPort};
use std::any::Any;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::ops::Deref;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Devices that are driven here.
pub(crate) const EMULATED: [Emulated; 5] =
    [Emulated::Haply, Emulated::Maglev, Emulated::MaglevOnACable, Emulated::Falcon, Emulated::Inverse3];

/// An emulated device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Emulated {
    /// A board that keeps its last torque for ever.
    Haply,
    /// The controller over a connection, whose end it notices.
    Maglev,
    /// The same over a serial line, which does not end with the host.
    MaglevOnACable,
    /// A device that keeps its last force for ever.
    Falcon,
    /// An arm of Haply's service, which drives a device that keeps its last force for ever.
    Inverse3,
}

impl Emulated {
    /// Whether the programs of the device are built for the tests of this size.
    pub(crate) fn is_for_this_size(self) -> bool {
        self != Self::Inverse3 || !TestSize::of_this_run().leaves_out_long_tests()
    }

    /// Starts the device; returns it and a run on it for longer than any test, which pushes with 3 N and has not started.
    pub(crate) fn start(self) -> (Driven, Flotor) {
        match self {
            Self::Haply => on_board(),
            Self::Maglev => on_maglev(),
            Self::MaglevOnACable => on_maglev_on_a_cable(),
            Self::Falcon => on_falcon(),
            Self::Inverse3 => on_inverse3(),
        }
    }
}

/// A device that is there until this value is dropped, and the files of a run on it.
pub(crate) struct Driven {
    log: ForceLog,
    _scratch: Scratch,
    _device: Box<dyn Any>,
}

impl Deref for Driven {
    type Target = ForceLog;

    fn deref(&self) -> &ForceLog {
        &self.log
    }
}

/// Returns a device and a run of a weight of 3 N on it.
fn weight_on(plugin: &str, parameters: &str, log: ForceLog, device: impl Any + 'static) -> (Driven, Flotor) {
    let scratch = Scratch::default();
    let scene = format!(
        "duration_s = 120\n[device]\nplugin = \"{plugin}\"\n[device.parameters]\ntimeout_ms = 9000\n{parameters}\n\
         [[model]]\nplugin = \"load\"\n[limits]\nramp_s = 0.05\nwatchdog_ms = 60000\n"
    );
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let run = Flotor::with(["run", &scene]);
    (Driven { log, _scratch: scratch, _device: Box::new(device) }, run)
}

fn on_board() -> (Driven, Flotor) {
    let (board, scratch) = (Board::start(), Scratch::default());
    let run = run_on(&board, &scratch, dies(), Where::InTheHost);
    (Driven { log: board.clone(), _scratch: scratch, _device: Box::new(board) }, run)
}

/// Ends a thread when it is dropped.
struct Until(Arc<AtomicBool>);

impl Drop for Until {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

// ---------------------------------------------------------------- maglev

/// A host that takes command of a handle at home at once, and a controller that bears a delayed one.
const MAGLEV: &str = "takeoff_ms = 0\nwatchdog_ms = 700\n";

/// A flotor at rest at home, whatever pushes it.
struct Held(ForceLog);

impl Plant for Held {
    fn advance(&mut self, _: u64, wrench: &Wrench) -> Sample {
        self.0.push(wrench.force().length());
        Sample::HOME
    }

    fn restart(&mut self) {}
}

/// Serves one host on a link on a thread; returns the log of its coils, and the end of the thread.
fn controller<L: Transport>(connect: impl FnOnce() -> L + Send + 'static) -> (ForceLog, Until) {
    let (log, until) = (ForceLog::default(), Until(Arc::default()));
    let (coils, is_over) = (log.clone(), Arc::clone(&until.0));
    let flotor = Plugin::in_process(&flotor_simulated::FLOTOR_ENTRY).expect("it is a plugin");
    let mut flotor = flotor.open_device(&[]).expect("it opens");
    let capabilities = flotor.capabilities().expect("it has some");
    let config = controller_config(&capabilities, Pace::RealTime, "held");
    std::thread::spawn(move || {
        let mut link = connect();
        let mut emulator = Emulator::new(config, Pace::RealTime, Held(coils.clone()));
        emulator.serve(&mut link, &is_over, &mut |_| ());
        // Without a link no cycle follows.
        if emulator.controller.mode() == Mode::Disarmed {
            coils.push(0.0);
        }
    });
    (log, until)
}

fn on_maglev() -> (Driven, Flotor) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
    let address = listener.local_addr().expect("it is bound");
    let (log, until) = controller(move || {
        let (stream, _) = listener.accept().expect("a host connects");
        StreamLink::new(prepared(stream).expect("it is a connection"))
    });
    weight_on("maglev", &format!("address = \"{address}\"\n{MAGLEV}"), log, until)
}

fn on_maglev_on_a_cable() -> (Driven, Flotor) {
    let (mut ours, theirs) = TTYPort::pair().expect("the system has pseudo terminals");
    ours.set_timeout(Duration::ZERO).expect("it is ours");
    let name = theirs.name().expect("it has a path");
    let (log, until) = controller(move || StreamLink::new(ours));
    let parameters = format!("transport = \"serial\"\naddress = \"{name}\"\n{MAGLEV}");
    weight_on("maglev", &parameters, log, (until, theirs))
}

// ---------------------------------------------------------------- Falcon

/// Period in which the motors are looked at.
const LOOK: Duration = Duration::from_micros(100);

fn on_falcon() -> (Driven, Flotor) {
    let (log, until) = (ForceLog::default(), Until(Arc::default()));
    let device = InProcess::new(Machine::new(Power::On, Motion::held(CENTRE_M)));
    let port = Port::bind("127.0.0.1:0", Reach::ThisUser).expect("there is a port");
    let address = port.address().expect("it is bound");
    let mut clients = Clients::of(port).expect("it is a port");
    let served = device.clone();
    std::thread::spawn(move || {
        while let Ok(stream) = clients.wait_for_one() {
            // A host that goes is no failure.
            let _ = flotor_falcon_emulator::server::serve(stream, &served, Tenure::begin(&mut clients));
        }
    });
    let (motors, is_over) = (log.clone(), Arc::clone(&until.0));
    std::thread::spawn(move || {
        let mut commands = 0;
        while !is_over.load(Ordering::Acquire) {
            let machine = device.machine();
            let (newest, force_n) = (machine.commands(), machine.force_n(device.now()));
            drop(machine);
            if newest != commands {
                commands = newest;
                motors.push(force_n.expect("the handle is held in the range").length());
            }
            std::thread::sleep(LOOK);
        }
    });
    weight_on("falcon", &format!("address = \"tcp:{address}\"\n"), log, until)
}

// ---------------------------------------------------------------- Inverse3

fn on_inverse3() -> (Driven, Flotor) {
    let post = Post::new();
    let program = build_folder().join("flotor-haply-service-emulator");
    let (name, value) = post.variable();
    let mut command = Command::new(program);
    command.args([
        "--listen",
        "127.0.0.1:0",
        "--events",
        "127.0.0.1:0",
        &post.scene("[[model]]\nplugin = \"program\"\n"),
    ]);
    command.env(name, value).env("XDG_RUNTIME_DIR", post.folder());
    let mut service = Owned::start(command.stdout(Stdio::piped()));
    let mut output = BufReader::new(service.stdout.take().expect("a pipe was requested"));
    let mut first = String::new();
    output.read_line(&mut first).expect("its output is text");
    let address = first.split("listening ws://").nth(1).and_then(|rest| rest.split('/').next());
    let address = address.expect("the first line says where it is").to_owned();
    let log = post.clone();
    weight_on("inverse3", &format!("address = \"{address}\"\n"), log, (service, output, post))
}
