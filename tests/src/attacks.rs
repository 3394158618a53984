//! Random attacks of strangers on a service: half-open, slow, huge, random, reordered and abandoned connections, then many at a time.
//!
//! Needs nothing of this crate: the emulators, the service and the bridge include this file with `#[path]`.

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

/// Connections that an attacker holds open during the random attacks.
const HELD: usize = 100;
/// Descriptors of this process that attacks leave alone.
const OWN_DESCRIPTORS: u64 = 200;
/// Threads and memory that strangers may cost.
const MOST_THREADS: u64 = 64;
const MOST_KB: u64 = 64 << 10;
/// Longest time until a client is served after the attacks: twice that of a silent connection, and a margin for a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);
/// A user who owns no process of a test.
const STRANGER: u32 = 65_534;

static ALONE: Mutex<()> = Mutex::new(());

/// Number of random attacks, and of connections that are then opened in turn.
fn size() -> (usize, usize) {
    match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => (500, 10_000),
        Ok("daily") => (200, 1000),
        _ => (100, 300),
    }
}

/// The place that a service listens at.
#[derive(Clone, Debug)]
pub(crate) enum Place {
    Port(SocketAddr),
    Socket(PathBuf),
}

impl Place {
    /// Connects; the calls of a stream serve either family.
    pub(crate) fn connect(&self) -> io::Result<TcpStream> {
        match self {
            Self::Port(at) => TcpStream::connect_timeout(at, Duration::from_secs(5)),
            Self::Socket(path) => Ok(TcpStream::from(OwnedFd::from(UnixStream::connect(path)?))),
        }
    }

    /// Sends a request; returns whether anything is answered in time.
    pub(crate) fn answers(&self, request: &[u8]) -> bool {
        let asked = self.connect().and_then(|mut stream| {
            stream.set_read_timeout(Some(Duration::from_secs(1)))?;
            stream.write_all(request)?;
            stream.read(&mut [0; 16])
        });
        asked.is_ok_and(|length| length > 0)
    }
}

/// A process that listens.
pub(crate) struct Target {
    pub(crate) process: u32,
    pub(crate) place: Place,
}

impl Target {
    /// Threads and anonymous memory in kB.
    fn usage(&self) -> [u64; 2] {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.process)).expect("it runs");
        ["Threads:", "RssAnon:"].map(|key| {
            let line = status.lines().find_map(|line| line.strip_prefix(key)).expect("Linux tells");
            line.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
        })
    }

    /// Attacks the service, then expects a client to be served; meanwhile threads and memory stay within their bounds.
    pub(crate) fn withstand(&self, request: &[u8], is_served: impl Fn(&Place) -> bool) {
        // The descriptors of a process are for one attack at a time.
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

    /// Serves a client in time, while others hold connections.
    #[track_caller]
    fn assert_serves(&self, is_served: &impl Fn(&Place) -> bool, when: &str) {
        let since = Instant::now();
        while !is_served(&self.place) {
            assert!(since.elapsed() < PATIENCE, "no client is served {when} after {PATIENCE:?}");
        }
    }

    /// A client that was served and is silent then makes room for another one.
    pub(crate) fn makes_room(&self, request: &[u8], is_served: impl Fn(&Place) -> bool) {
        let mut silent = self.place.connect().expect("it listens");
        silent.write_all(request).expect("it reads");
        assert!(silent.peek(&mut [0]).expect("it answers") > 0, "the first is served");
        self.assert_serves(&is_served, "while one is silent");
    }

    /// Bytes that a program of another user gets for a request; none where only root could be another user.
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

/// The most threads and kB seen.
#[derive(Debug)]
struct Most([u64; 2]);

impl Most {
    fn see(&mut self, usage: [u64; 2]) {
        self.0 = [self.0[0].max(usage[0]), self.0[1].max(usage[1])];
    }
}

/// A program that listens, ended with the test.
pub(crate) struct Listening {
    supervisor: Child,
    pub(crate) target: Target,
}

impl Listening {
    /// Starts a program whose first line names its address after `before`.
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

/// Strangers with the connections that they hold.
pub(crate) struct Attackers {
    place: Place,
    request: Vec<u8>,
    dice: Dice,
    held: Vec<Attacker>,
    most_held: usize,
}

impl Attackers {
    /// Attackers of a place; a request that would make them clients, of which they send parts.
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

    /// Carries out a random attack, and sends a byte more on a connection that is slow.
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

    /// Opens a silent connection, and holds as many as this process may; returns whether it came about.
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

/// A connection that stays open.
struct Attacker {
    stream: TcpStream,
    /// Whether it sends single bytes.
    is_slow: bool,
}

/// Carries out a random attack; returns a connection that stays open.
fn attacked(mut stream: TcpStream, request: &[u8], dice: &mut Dice) -> Option<Attacker> {
    let _ = stream.set_write_timeout(Some(Duration::from_millis(200)));
    // Completes no request: whoever sends one is a client.
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
    // What the other end does not take is no failure.
    let _ = stream.write_all(&bytes);
    Some(Attacker { stream, is_slow: attack == 0 })
}

/// Numbers that are the same in every run.
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
