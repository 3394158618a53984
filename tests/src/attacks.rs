//! Random attacks of strangers on a service: half-open, slow, huge, random, reordered and abandoned connections, then thousands of
//! silent connections at a time.
//!
//! The file uses no other module of this crate: the emulators, the service and the bridge include it with `#[path]`.

#![allow(dead_code)] // each test program uses its part

use rustix::process::{Resource, getrlimit, getuid};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of connections held open during the random attacks.
const HELD: usize = 100;
/// File descriptors of this process not available to attacks.
const OWN_DESCRIPTORS: u64 = 200;
/// Maximum increase of threads and of memory, kB, that attacks may cause.
const MOST_THREADS: u64 = 64;
const MOST_KB: u64 = 64 << 10;
/// Timeout for serving a client during attacks: twice the timeout of a silent connection, and a margin for a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);
/// User id that owns no process of a test.
const STRANGER: u32 = 65_534;

static ALONE: Mutex<()> = Mutex::new(());

/// Returns the number of random attacks, and of silent connections opened after them, for the size of this test run.
fn size() -> (usize, usize) {
    match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => (500, 10_000),
        Ok("daily") => (200, 1000),
        _ => (100, 300),
    }
}

/// Address of a service: TCP port or Unix socket.
#[derive(Clone, Debug)]
pub(crate) enum Place {
    Port(SocketAddr),
    Socket(PathBuf),
}

impl Place {
    /// Connects to the address. A Unix socket is returned as a `TcpStream` too: reads and writes work on both.
    pub(crate) fn connect(&self) -> io::Result<TcpStream> {
        match self {
            Self::Port(at) => TcpStream::connect_timeout(at, Duration::from_secs(5)),
            Self::Socket(path) => Ok(TcpStream::from(OwnedFd::from(UnixStream::connect(path)?))),
        }
    }

    /// Sends a request on a new connection; returns true if a reply of at least one byte arrives within a second.
    pub(crate) fn answers(&self, request: &[u8]) -> bool {
        let asked = self.connect().and_then(|mut stream| {
            stream.set_read_timeout(Some(Duration::from_secs(1)))?;
            stream.write_all(request)?;
            stream.read(&mut [0; 16])
        });
        asked.is_ok_and(|length| length > 0)
    }
}

/// Service under attack: process id and address.
pub(crate) struct Target {
    pub(crate) process: u32,
    pub(crate) place: Place,
}

impl Target {
    /// Returns the number of threads, and the anonymous memory in kB.
    fn usage(&self) -> [u64; 2] {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process)).expect("it runs");
        ["Threads:", "RssAnon:"].map(|key| {
            let line = status.lines().find_map(|line| line.strip_prefix(key)).expect("Linux tells");
            line.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
        })
    }

    /// Attacks the service, and asserts that clients are served during and after the attacks and that the increase of threads and
    /// memory stays within its bounds. `request`: request of a client; `is_served`: true if a new client is served.
    pub(crate) fn withstand(&self, request: &[u8], is_served: impl Fn(&Place) -> bool) {
        // The file descriptors of this process suffice for one attack at a time.
        let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
        assert!(is_served(&self.place), "before the attacks");
        let idle = self.usage();
        let mut most = Most(idle);
        let (attacks, connections) = size();
        let mut attackers = Attackers::new(self.place.clone(), request);
        for _ in 0..attacks {
            attackers.attack();
            most.see(self.usage());
        }
        let held = attackers.held.len();
        assert!(held > HELD / 4, "the attacks held {held} connections");
        self.assert_serves(&is_served, "during the attacks");
        let mut opened = 0;
        for number in 0..connections {
            opened += usize::from(attackers.hold_one_more());
            if number % 100 == 0 {
                most.see(self.usage());
            }
        }
        assert!(opened > connections / 2, "{opened} of {connections} connections came about");
        self.assert_serves(&is_served, "with all that are held");
        most.see(self.usage());
        let [threads, kb] = [0, 1].map(|at| most.0[at] - idle[at]);
        println!(
            "{attacks} attacks with {held} connections held, then {opened} of {connections} opened and {} held: {threads} threads and \
             {kb} kB above {} and {}",
            attackers.held.len(),
            idle[0],
            idle[1]
        );
        assert!(threads <= MOST_THREADS, "{most:?} above {idle:?}");
        assert!(kb <= MOST_KB, "{most:?} above {idle:?}");
    }

    /// Asserts that a new client is served within [`PATIENCE`]; `when` completes the message of a failure.
    #[track_caller]
    fn assert_serves(&self, is_served: &impl Fn(&Place) -> bool, when: &str) {
        let since = Instant::now();
        while !is_served(&self.place) {
            assert!(since.elapsed() < PATIENCE, "no client is served {when} after {PATIENCE:?}");
        }
    }

    /// Asserts that the service, after a client has been served and is silent, serves another client.
    pub(crate) fn makes_room(&self, request: &[u8], is_served: impl Fn(&Place) -> bool) {
        let mut silent = self.place.connect().expect("it listens");
        silent.write_all(request).expect("it reads");
        assert!(silent.peek(&mut [0]).expect("it answers") > 0, "the first is served");
        self.assert_serves(&is_served, "while one is silent");
    }

    /// Sends a request as another user, and returns the number of bytes received: 0 or 1. `None` on a Unix socket, or if this test
    /// does not run as root.
    pub(crate) fn answers_to_stranger(&self, request: &[u8]) -> Option<usize> {
        let Place::Port(at) = self.place else { return None };
        if !getuid().is_root() {
            println!("skipped: only root can be another user");
            return None;
        }
        let bytes: String = request.iter().map(|byte| format!("\\x{byte:02x}")).collect();
        let script = format!(
            "exec 3<>/dev/tcp/{}/{}; printf '{bytes}' >&3; timeout 3 head -c 1 <&3 2>/dev/null",
            at.ip(),
            at.port()
        );
        let mut shell = Command::new("bash");
        shell.args(["-c", &script]).uid(STRANGER).current_dir("/").stderr(Stdio::null());
        Some(shell.output().expect("bash starts").stdout.len())
    }
}

/// Largest observed number of threads, and largest observed memory, kB.
#[derive(Debug)]
struct Most([u64; 2]);

impl Most {
    fn see(&mut self, usage: [u64; 2]) {
        self.0 = [self.0[0].max(usage[0]), self.0[1].max(usage[1])];
    }
}

/// Running program with a service; dropping it kills the program.
pub(crate) struct Listening {
    supervisor: Child,
    pub(crate) target: Target,
}

impl Listening {
    /// Starts a program and reads the address of its service from the first line of its output, after the text `before`.
    pub(crate) fn start(program: &str, arguments: &[&str], before: &str) -> Self {
        let mut process =
            Command::new(program).args(arguments).stdout(Stdio::piped()).spawn().expect("it starts");
        let mut output = BufReader::new(process.stdout.take().expect("a pipe was requested"));
        let mut line = String::new();
        output.read_line(&mut line).expect("its output is text");
        // A program whose output nobody reads stops at a full pipe.
        std::thread::spawn(move || io::copy(&mut output, &mut io::sink()));
        let address = line.split(before).nth(1).expect("the first line says where it is");
        let address = address.split(['/', '\n']).next().unwrap_or_default();
        let place = Place::Port(address.parse().expect("it is an address"));
        // The process that listens is the only child of one that supervises it.
        let own = process.id();
        let children = std::fs::read_to_string(format!("/proc/{own}/task/{own}/children"));
        let listening = children.unwrap_or_default().trim().parse().unwrap_or(own);
        Self { supervisor: process, target: Target { process: listening, place } }
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        let _ = self.supervisor.kill();
        let _ = self.supervisor.wait();
    }
}

/// Attackers of one service, with the connections that they hold open.
pub(crate) struct Attackers {
    place: Place,
    request: Vec<u8>,
    dice: Dice,
    held: Vec<Attacker>,
    most_held: usize,
}

impl Attackers {
    /// Creates attackers of a service without connections. `request`: request of a client; attackers send only parts of it.
    pub(crate) fn new(place: Place, request: &[u8]) -> Self {
        let limit = getrlimit(Resource::Nofile).current.unwrap_or(u64::MAX);
        let most_held = usize::try_from(limit.saturating_sub(OWN_DESCRIPTORS)).unwrap_or(usize::MAX);
        Self {
            place,
            request: request.to_vec(),
            dice: Dice(0x9e37_79b9_7f4a_7c15),
            held: Vec::new(),
            most_held,
        }
    }

    /// Carries out a random attack, and sends one more byte on a random connection if it is slow. At most [`HELD`] connections stay
    /// open: a random one is closed for a new one.
    pub(crate) fn attack(&mut self) {
        if let Ok(stream) = self.place.connect()
            && let Some(attacker) = attacked(stream, &self.request, &mut self.dice)
        {
            if self.held.len() == HELD {
                self.held.swap_remove(self.dice.below(HELD));
            }
            self.held.push(attacker);
        }
        let byte = self.dice.byte() | 0x80;
        if let Some(Attacker { stream, is_slow: true }) = self.held.get_mut(self.dice.below(HELD)) {
            let _ = stream.write_all(&[byte]);
        }
    }

    /// Closes all connections.
    pub(crate) fn leave(&mut self) {
        self.held.clear();
    }

    /// Opens a silent connection and holds it open; closes the oldest one first at the limit of this process. Returns true if the
    /// connection was accepted.
    fn hold_one_more(&mut self) -> bool {
        if self.held.len() >= self.most_held {
            self.held.remove(0);
        }
        let opened = self.place.connect();
        let is_open = opened.is_ok();
        self.held.extend(opened.map(|stream| Attacker { stream, is_slow: false }));
        is_open
    }
}

/// Connection that an attacker holds open.
struct Attacker {
    stream: TcpStream,
    /// True for a connection on which single bytes are sent.
    is_slow: bool,
}

/// Carries out a random attack; returns the connection if the attack holds it open.
fn attacked(mut stream: TcpStream, request: &[u8], dice: &mut Dice) -> Option<Attacker> {
    let _ = stream.set_write_timeout(Some(Duration::from_millis(200)));
    // The random bytes are not ASCII, so they complete no request: the sender of a complete request would be a client.
    let random: Vec<u8> = (0..1 + dice.below(2000)).map(|_| dice.byte() | 0x80).collect();
    let (part, rest) = request.split_at(dice.below(request.len()));
    let attack = dice.below(7);
    let bytes = match attack {
        0 => Vec::new(),
        1 => part.to_vec(),
        2 => (0..1 + dice.below(2000)).map(|_| dice.byte()).collect(),
        3 => [part, &random].concat(),
        4 => [rest.get(1..).unwrap_or_default(), part].concat(),
        5 => random.repeat(100),
        _ => return None,
    };
    // The service may close the connection before it has read all bytes.
    let _ = stream.write_all(&bytes);
    Some(Attacker { stream, is_slow: attack == 0 })
}

/// Pseudo-random numbers (xorshift), the same in every run.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, count: usize) -> usize {
        usize::from(u16::from_le_bytes([self.byte(), self.byte()])) % count.max(1)
    }

    fn byte(&mut self) -> u8 {
        self.next().to_le_bytes()[3]
    }
}
