//! Program `flotor emulate haply-service`: Haply's Inverse Service, served by the devices of a Flotor scene.
//!
//! ```text
//!  program -> WebSocket 10001 -> session: view, commands -> sum of all sessions -> force model `program` -> envelope -> device
//!          <- one state for each message                 <- newest tick <---------------------------------------------+
//! ```
//!
//! - [`access`]: access control: origins of web pages, names of this machine.
//! - [`channels`]: the simulation channel with HTTP, and the events channel, port 10020.
//! - [`connection`]: a thread for each connection; the head of a request.
//! - [`session`]: a client of the simulation channel, with its pace and replies.
//! - [`message`]: parser of a client's messages. [`state`]: encoder of the replies.
//! - [`view`]: axes, mount and workspace of a session. [`force`]: the sum of all sessions' commands.
//! - [`http`]: version, devices, sessions, settings. [`events`]: queues of events. [`device`]: ids and nominal arm.
//!
//! Source: the public documentation of the service, version 3.5, and its open clients: names, shapes and units only. Positions in
//! m, velocities in m/s, forces in N, joint angles in degrees; x right, y away from the user, z up. Not real-time: the loop has a
//! thread of its own.

mod access;
mod channels;
mod connection;
mod device;
mod events;
mod force;
mod http;
mod message;
mod service;
mod session;
mod state;
mod view;

use access::Access;
use clap::{Parser, ValueEnum};
use connection::accept;
use flotor_command::options::{LendOptions, arguments, seed};
use flotor_command::stopping::stop_on_signals;
use flotor_command::{CommandError, say, supervised};
use flotor_compat::{Pace, Settings, SharedControlGroup, no_thread, prepare};
use flotor_emulation::port::{Port, Reach, ReachArguments};
use rustix::process::{Signal, set_parent_process_death_signal};
use service::Service;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

/// Serve Haply's Inverse Service with any Flotor device.
#[derive(Parser)]
#[command(name = "flotor emulate haply-service", version, max_term_width = 110)]
#[command(
    after_help = "The first line on standard output has the addresses. FLOTOR_RECORD and FLOTOR_JSON replace a missing \
    --record and --json,\nFLOTOR_REPORT names a file for the text of the summary (default: standard error).\n\nExamples:\n  \
    flotor emulate haply-service                            a simulated flotor, held by a hand\n  \
    flotor emulate haply-service proxy.toml --record run.mcap   the device of a scene, within the scene's limits\n  \
    flotor lend --api haply -- python3 my_program.py        the same for one program"
)]
struct Arguments {
    /// Scene file (TOML), or name of one of Flotor's own scenes (default: FLOTOR_SCENE, else a simulated flotor held by a hand)
    scene: Option<PathBuf>,
    /// Address of the simulation channel and HTTP (port 0: any free port)
    #[arg(long, default_value = "127.0.0.1:10001", value_name = "HOST:PORT")]
    listen: String,
    /// Address of the events channel (port 0: any free port)
    #[arg(long, default_value = "127.0.0.1:10020", value_name = "HOST:PORT")]
    events: String,
    #[command(flatten)]
    reach: ReachArguments,
    /// Accept connections from web pages of this origin, for example http://localhost:3000 (repeatable; default: none)
    #[arg(long, value_name = "ORIGIN")]
    allow_origin: Vec<String>,
    /// Clock of the run (default: FLOTOR_PACE, else real)
    #[arg(long, value_enum, value_name = "WHO")]
    pace: Option<PaceOption>,
    /// Seed of all random numbers (default: FLOTOR_SEED, else 0)
    #[arg(long, value_parser = seed, value_name = "N")]
    seed: Option<u64>,
    #[command(flatten)]
    options: LendOptions,
    /// End with the parent process
    #[arg(long, hide = true)]
    lent: bool,
}

/// Clock of the run.
#[derive(Clone, Copy, ValueEnum)]
enum PaceOption {
    /// The machine's clock
    Real,
    /// The clients: each message that commands a device starts a tick
    Lockstep,
}

/// Poll interval for the end of the run.
const LOOK: Duration = Duration::from_millis(20);

fn main() -> ExitCode {
    let arguments = arguments::<Arguments>();
    if arguments.lent {
        // On failure this process may outlive its parent.
        let _ = set_parent_process_death_signal(Some(Signal::TERM));
    }
    supervised(|| run(arguments))
}

fn run(arguments: Arguments) -> Result<(), CommandError> {
    // First: a signal during the preparation also ends the run.
    let stop = stop_on_signals()?;
    let mut settings = Settings::from_environment().map_err(CommandError::Usage)?.of_own_process();
    settings.scene = arguments.scene.or(settings.scene);
    settings.plugin_folders = arguments.options.plugin_path.folders().to_vec();
    settings.record = arguments.options.record.or(settings.record);
    settings.json = arguments.options.json.or(settings.json);
    settings.seed = arguments.seed.unwrap_or(settings.seed);
    settings.pace = match arguments.pace {
        Some(PaceOption::Real) => Pace::Real,
        Some(PaceOption::Lockstep) => Pace::Lockstep,
        None => settings.pace,
    };
    if arguments.options.control_group.is_accepted() {
        settings.shared_control_group = SharedControlGroup::Accepted;
    }
    if settings.report.is_none() {
        settings.report = Some("-".into());
    }
    let reach = arguments.reach.reach();
    let (simulation, simulation_at) = listen("--listen", &arguments.listen, reach)?;
    let (events, events_at) = listen("--events", &arguments.events, reach)?;
    let access = Access::new(arguments.allow_origin, simulation_at);
    let host = prepare(settings, &stop).map_err(CommandError::Usage)?;
    if (0..host.stations().len()).any(|number| !host.open(number)) {
        return Err(CommandError::Failed("the run did not start; its message is above".to_owned()));
    }
    let service = Service::leak(host, access);
    let started = service.follow().and_then(|()| {
        accept(events, "flotor-events", |stream| channels::send_events(service, stream))?;
        accept(simulation, "flotor-accept", |stream| channels::answer_client(service, stream))
    });
    started.map_err(|cause| CommandError::Failed(no_thread("the service", &cause)))?;
    say!("listening ws://{simulation_at}/ events ws://{events_at}/");
    while !stop.is_stop_requested() && host.is_running() {
        std::thread::sleep(LOOK);
    }
    let was_asked = stop.is_stop_requested();
    service.device_lost();
    host.end();
    if was_asked {
        Ok(())
    } else {
        Err(CommandError::Failed("the run ended before the service; its summary has the cause".to_owned()))
    }
}

/// Binds a port; returns the port and its address.
fn listen(option: &str, at: &str, reach: Reach) -> Result<(Port, SocketAddr), CommandError> {
    let bound = Port::bind(at, reach).and_then(|port| {
        let address = port.address()?;
        Ok((port, address))
    });
    bound.map_err(|cause| {
        let is_in_use = cause.kind() == std::io::ErrorKind::AddrInUse;
        let advice =
            if is_in_use { "; end the program that uses the port, such as Haply's own service" } else { "" };
        CommandError::Usage(format!("{option}: {cause}{advice}"))
    })
}
