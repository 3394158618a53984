//! Random attacks of strangers on a TCP port: half-open, slow, huge, random and abandoned connections, up to a hundred at a time.
//!
//! Needs nothing of this crate: the emulators and the service include this file with `#[path]`.

use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Attacks of one test; 500 at full size.
const ATTACKS: u64 = if cfg!(debug_assertions) { 200 } else { 500 };
/// Connections that an attacker holds open at most.
const HELD: usize = 100;
/// Threads and memory that strangers may cost.
const MOST_THREADS: u64 = 64;
const MOST_KB: u64 = 64 << 10;
/// Longest time until a client is served after the attacks: twice that of a silent connection, and a margin for a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

/// A program that listens, ended with the test.
pub(crate) struct Listening {
    process: Child,
    at: SocketAddr,
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
        std::thread::spawn(move || std::io::copy(&mut output, &mut std::io::sink()));
        let address = line.split(before).nth(1).expect("the first line says where it is");
        let address = address.split(['/', '\n']).next().unwrap_or_default();
        Self { at: address.parse().expect("it is an address"), process }
    }

    /// The process that listens: the child of one that only supervises.
    fn number(&self) -> u32 {
        let own = self.process.id();
        let children =
            std::fs::read_to_string(format!("/proc/{own}/task/{own}/children")).unwrap_or_default();
        children.trim().parse().unwrap_or(own)
    }

    /// Threads and anonymous memory in kB.
    fn usage(&self) -> [u64; 2] {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.number())).expect("it runs");
        ["Threads:", "RssAnon:"].map(|key| {
            let line = status.lines().find_map(|line| line.strip_prefix(key)).expect("Linux tells");
            line.split_whitespace().next().and_then(|number| number.parse().ok()).expect("a number")
        })
    }

    /// Attacks the port, then expects a client to be served; meanwhile threads and memory stay within their bounds.
    pub(crate) fn withstand(&self, request: &[u8], is_served: impl Fn(SocketAddr) -> bool) {
        assert!(is_served(self.at), "before the attacks");
        let [threads, kb] = self.usage();
        let (mut dice, mut held) = (Dice(0x9e37_79b9_7f4a_7c15), Vec::new());
        let mut most = [threads, kb];
        for _ in 0..ATTACKS {
            if let Ok(stream) = TcpStream::connect_timeout(&self.at, Duration::from_secs(5))
                && let Some(attacker) = attacked(stream, request, &mut dice)
            {
                if held.len() == HELD {
                    held.swap_remove(dice.below(HELD));
                }
                held.push(attacker);
            }
            // One byte more on a connection that is slow.
            if let Some(Attacker { stream, is_slow: true }) = held.get_mut(dice.below(HELD)) {
                let _ = stream.write_all(&[dice.byte() | 0x80]);
            }
            let usage = self.usage();
            most = [most[0].max(usage[0]), most[1].max(usage[1])];
        }
        println!(
            "{ATTACKS} attacks, {} connections held: {} threads and {} kB above {threads} and {kb}",
            held.len(),
            most[0] - threads,
            most[1] - kb
        );
        assert!(held.len() > HELD / 4, "the attacks held connections");
        assert!(most[0] - threads <= MOST_THREADS, "{most:?} above {threads}");
        assert!(most[1] - kb <= MOST_KB, "{most:?} above {kb}");
        // Those that are held stay open.
        let since = Instant::now();
        while !is_served(self.at) {
            assert!(since.elapsed() < PATIENCE, "no client is served after {PATIENCE:?}");
        }
    }
}

impl Drop for Listening {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
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
    let random: Vec<u8> = (0..1 + dice.below(2000)).map(|_| dice.byte()).collect();
    let part = &request[..dice.below(request.len())];
    // What the other end does not take is no failure.
    let attack = dice.below(6);
    match attack {
        0 => {}
        1 => drop(stream.write_all(part)),
        2 => drop(stream.write_all(&random)),
        // Completes no request: whoever sends one is a client.
        3 => drop(
            stream.write_all(&[part, &random.iter().map(|byte| byte | 0x80).collect::<Vec<u8>>()].concat()),
        ),
        4 => drop(stream.write_all(&random.repeat(100))),
        _ => return None,
    }
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
