//! Program `flotor bridge`: a running host on a network.

use clap::{Args, Parser, Subcommand};
use flotor_bridge::access::{AccessError, Members, write_keys};
use flotor_bridge::attach::attach;
use flotor_bridge::couple::couple;
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, Link, LinkError, LinkOptions, open, stop_channel};
use flotor_bridge::record::{RecordingEnd, record};
use flotor_bridge::remote::{Remote, bridges};
use flotor_bridge::request::{Request, Right};
use flotor_bridge::serve::{Launcher, Service, serve};
use flotor_bridge::stop_channel::press_both_ways;
use flotor_hal::terminal::{escaped, escaped_arguments};
use flotor_live::Directory;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Publish a running host on a network (Zenoh), or show a remote host on this machine
#[derive(Parser)]
#[command(
    name = "flotor bridge",
    version,
    subcommand_required = true,
    after_help = "Without --config, --listen and --connect only programs of this user are reached: a bridge listens on a socket in\n\
    the folder of the user's runs, and visitors connect there. For other users, `flotor bridge keys` writes keys \
    and configurations.\n\n\
    Examples:\n  \
    flotor bridge serve --name lab                        publish your runs on this machine\n  \
    flotor bridge list                                    bridges on the network\n  \
    flotor bridge attach lab                              then `flotor view` shows the run here\n  \
    flotor bridge record lab run.mcap\n  \
    flotor bridge couple lab                              couple two hands on two hosts (book: Several devices)\n  \
    flotor bridge ask lab emergency-stop\n  \
    flotor bridge keys keys --host lab.example.org --own ada --operate grace --watch alan\n  \
    flotor bridge serve --name lab --config keys/bridge.json5 --allow own --scene scene.toml"
)]
struct Arguments {
    #[command(flatten)]
    link: LinkOptions,
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Publish your runs on this machine on the network, one at a time: the newest, until it ends
    Serve(ServeArguments),
    /// Republish a remote run on this machine, for `flotor view`
    Attach {
        /// Name of the bridge, such as lab or zenoh/lab, as `flotor bridge list` prints it
        name: Name,
    },
    /// Couple a hand here to a remote hand: forward the peer state of couplings with `partner = "elsewhere"`
    Couple {
        /// Name of the bridge, such as lab or zenoh/lab, as `flotor bridge list` prints it
        name: Name,
    },
    /// Record a remote run until it ends
    Record {
        /// Name of the bridge, such as lab or zenoh/lab, as `flotor bridge list` prints it
        name: Name,
        /// Recording to write
        #[arg(value_name = "FILE.mcap")]
        file: PathBuf,
    },
    /// Send a request to a bridge and its run
    Ask {
        /// Name of the bridge, such as lab or zenoh/lab, as `flotor bridge list` prints it
        name: Name,
        #[command(subcommand)]
        request: Request,
    },
    /// List the bridges on the network
    List,
    /// Write keys and configurations: the members of the network and their rights
    Keys(KeysArguments),
}

#[derive(Args)]
struct ServeArguments {
    /// Name of this bridge on the network: 1 to 40 letters a to z, digits or hyphens (default: the machine's name)
    #[arg(long)]
    name: Option<Name>,
    /// Highest right whose requests are accepted; the access control of the network sets the right of each member
    #[arg(long, value_enum, default_value = "watch")]
    allow: Right,
    /// Scene file (TOML), or name of one of Flotor's own scenes, that members may start, with `--allow own` (default: none)
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Publish every Nth tick only
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
}

#[derive(Args)]
struct KeysArguments {
    /// New folder for keys and configurations
    folder: PathBuf,
    /// Name or address under which the bridge is reached, without a port: members connect to port 7447 (repeatable)
    #[arg(long = "host", required = true, value_name = "HOST")]
    hosts: Vec<String>,
    /// A member who may watch and press the emergency stop (repeatable)
    #[arg(long, value_name = "NAME")]
    watch: Vec<Name>,
    /// A member who may also change parameters and blend weights, stop a run in the normal way, and couple a hand (repeatable)
    #[arg(long, value_name = "NAME")]
    operate: Vec<Name>,
    /// A member who may also start the bridge's scene and release an emergency stop (repeatable)
    #[arg(long, value_name = "NAME")]
    own: Vec<Name>,
    /// Validity of the keys in days, at most 36500
    #[arg(long, value_name = "DAYS", default_value = "365", value_parser = clap::value_parser!(u64).range(1..=36_500))]
    days: u64,
}

/// Exit code for errors of the command line or the configuration.
const USAGE: u8 = 2;

fn main() -> ExitCode {
    let arguments = Arguments::try_parse().unwrap_or_else(|error| {
        let _ = Arguments::parse_from(escaped_arguments());
        error.exit()
    });
    match run(arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", escaped(&error.to_string()));
            let is_usage = error
                .downcast_ref::<LinkError>()
                .is_some_and(|e| !matches!(e, LinkError::Open(_) | LinkError::Network(_)));
            if is_usage { ExitCode::from(USAGE) } else { ExitCode::FAILURE }
        }
    }
}

fn run(arguments: Arguments) -> Result<(), Box<dyn Error>> {
    let Arguments { link, command } = arguments;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let directory = Directory::of_this_user();
    match command {
        Command::Serve(serving) => serve_runs(link, serving, &directory, &stop)?,
        Command::Attach { name } => {
            let remote = Remote::listen(&visit(link, &directory)?, &name)?;
            report_line(&format!("waiting for a run of zenoh/{name} (Ctrl-C ends)"));
            attach(&remote, &directory, &stop, &mut report_line)?;
        }
        Command::Couple { name } => {
            let session = visit(link, &directory)?;
            report_line(&format!("waiting for a coupling with zenoh/{name} (Ctrl-C ends)"));
            couple(&session, &directory, &name, &stop, &mut report_line)?;
        }
        Command::Record { name, file } => {
            let remote = Remote::listen(&visit(link, &directory)?, &name)?;
            report_line(&format!("waiting for a run of zenoh/{name} (Ctrl-C ends)"));
            record_run(&remote, &file, &stop)?;
        }
        Command::Ask { name, request: Request::EmergencyStop } => {
            let link = link.or_this_user(&directory, None);
            let datagrams = stop_channel(&link)?;
            press_both_ways(link, datagrams, &name)?;
        }
        Command::Ask { name, request } => {
            let remote = Remote::listen(&visit(link, &directory)?, &name)?;
            remote.requests().run(request)?;
        }
        Command::List => list(&visit(link, &directory)?)?,
        Command::Keys(arguments) => make_keys(arguments)?,
    }
    Ok(())
}

/// Writes a human-readable line to standard error.
fn report_line(line: &str) {
    eprintln!("{}", escaped(line));
}

/// Opens the session of a visitor, and warns of its keys.
fn visit(link: LinkOptions, directory: &Directory) -> Result<Link, LinkError> {
    let link = open(&link.or_this_user(directory, None), End::Visiting)?;
    report_keys(&link);
    Ok(link)
}

/// Serves the runs of this machine until stopped.
fn serve_runs(
    link: LinkOptions,
    serving: ServeArguments,
    directory: &Directory,
    stop: &AtomicBool,
) -> Result<(), Box<dyn Error>> {
    let service = service(serving)?;
    directory.make()?;
    let link = link.or_this_user(directory, Some(&service.name));
    let session = open(&link, End::Serving)?;
    report_keys(&session);
    if let (None, Some(endpoint)) = (&link.config, link.open_to_others()) {
        report_line(&format!(
            "without keys: every user who can reach {endpoint}, including all users of this machine, has \
             the rights of --allow"
        ));
    }
    report_line(&format!("zenoh/{}: waiting for a run on this machine (Ctrl-C ends)", service.name));
    Ok(serve(&session, directory, service, stop, &mut report_line)?)
}

/// Records a run, and prints the result.
fn record_run(remote: &Remote, file: &Path, stop: &AtomicBool) -> Result<(), Box<dyn Error>> {
    let recorded = record(remote, file, stop)?;
    let words = match &recorded.end {
        RecordingEnd::Over(words) => words,
        RecordingEnd::Stopped => "stopped recording",
        RecordingEnd::Cut => "the bridge is no longer reachable",
    };
    let (ticks, lost) = (recorded.ticks, recorded.lost);
    let shown = format!("{}: {ticks} ticks, {lost} lost by the network; {words}", file.display());
    println!("{}", escaped(&shown));
    if recorded.end == RecordingEnd::Cut {
        return Err(
            "the bridge became unreachable before the run ended, so the recording is incomplete; the file \
             contains the ticks received until then. Check the network, or record on the remote host with \
             `flotor run --record`"
                .into(),
        );
    }
    Ok(())
}

/// Prints the bridges on the network, with their states.
fn list(session: &Link) -> Result<(), LinkError> {
    let names = bridges(session)?;
    if names.is_empty() {
        report_line(
            "no bridge found; start a bridge with `flotor bridge serve`, or give its endpoint with --connect or --config",
        );
    }
    for name in names {
        let status = Remote::listen(session, &name)?.status()?.unwrap_or_default();
        println!("zenoh/{name:<20} {:<18} {}", status.state.word(), escaped(&status.title));
    }
    Ok(())
}

/// Writes the keys and configurations of all members.
fn make_keys(arguments: KeysArguments) -> Result<(), AccessError> {
    let KeysArguments { folder, hosts, watch, operate, own, days } = arguments;
    let with = |names: Vec<Name>, right| names.into_iter().map(move |name| (name, right));
    let peers =
        with(watch, Right::Watch).chain(with(operate, Right::Operate)).chain(with(own, Right::Own)).collect();
    let members = Members { hosts, peers, valid: Duration::from_secs(days * 86_400) };
    for written in write_keys(&folder, &members)? {
        println!("{}", written.display());
    }
    report_line(
        "Give each member its .json5, .pem, .key and .stop, and authority.pem; keep the .key and .stop files secret.",
    );
    Ok(())
}

/// Warns of keys that expire soon, and of missing stop keys.
fn report_keys(link: &Link) {
    if link.lacks_stop_keys() {
        report_line(
            "the keys have no stop key, so a flood of connections can delay the emergency stop of a new member; \
             make new keys for the bridge and all members with `flotor bridge keys`",
        );
    }
    const SOON_DAYS: u64 = 30;
    if let Some(days) = link.days_left().filter(|days| *days < SOON_DAYS) {
        let most = days + 1;
        report_line(&format!(
            "the keys expire in less than {most} d, or have expired; make new keys with `flotor bridge keys`"
        ));
    }
}

fn service(arguments: ServeArguments) -> Result<Service, Box<dyn Error>> {
    let ServeArguments { name, allow, scene, every } = arguments;
    let program = std::env::current_exe()?.with_file_name(format!("flotor{}", std::env::consts::EXE_SUFFIX));
    let launcher = scene.map(|scene| Launcher::new(program, scene));
    Ok(Service { name: name.unwrap_or_else(Name::of_this_machine), allow, every, launcher })
}
