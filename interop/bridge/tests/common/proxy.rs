//! A long, bad way between two programs on this machine: a TCP forwarder that delays, loses and can be cut.
//!
//! What TCP makes of a lossy network is modelled, not the packets: a chunk that is lost comes a round trip later, when it has been
//! sent again, and all that was sent after it waits for it.

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{Duration, Instant};

/// Delay one way, and how far from it a chunk may be.
const DELAY: Duration = Duration::from_millis(20);
const JITTER: Duration = Duration::from_millis(5);
/// What it costs to send a lost chunk again: a round trip.
const SENT_AGAIN: Duration = Duration::from_millis(40);
/// One chunk in so many is lost.
const LOSS: u64 = 100;

/// The way; it ends with the test's process.
pub struct Proxy {
    pub port: u16,
    is_cut: Arc<AtomicBool>,
    lost: Arc<AtomicU64>,
}

impl Proxy {
    /// To a port of this machine.
    pub fn to(port: u16) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let (is_cut, lost) = (Arc::<AtomicBool>::default(), Arc::<AtomicU64>::default());
        let proxy =
            Self { port: listener.local_addr().unwrap().port(), is_cut: is_cut.clone(), lost: lost.clone() };
        std::thread::spawn(move || {
            for (number, near) in (0..).zip(listener.incoming().flatten()) {
                let Ok(far) = TcpStream::connect(("127.0.0.1", port)) else { continue };
                for (side, from, to) in [(0, &near, &far), (1, &far, &near)] {
                    let (from, to) = (from.try_clone().unwrap(), to.try_clone().unwrap());
                    to.set_nodelay(true).unwrap();
                    let (sender, receiver) = channel();
                    let (cut, lost, until) = (is_cut.clone(), lost.clone(), is_cut.clone());
                    let random = Random(2 * number + side);
                    std::thread::spawn(move || take(from, &sender, random, &cut, &lost));
                    std::thread::spawn(move || give(to, &receiver, &until));
                }
            }
        });
        proxy
    }

    /// Nothing gets through any more, nor what is under way.
    pub fn cut(&self) {
        self.is_cut.store(true, Ordering::SeqCst);
    }

    /// Chunks that had to be sent again.
    pub fn lost(&self) -> u64 {
        self.lost.load(Ordering::SeqCst)
    }
}

/// Reads chunks and says when each arrives, in order.
fn take(
    mut from: TcpStream,
    to: &Sender<(Instant, Vec<u8>)>,
    mut random: Random,
    is_cut: &AtomicBool,
    lost: &AtomicU64,
) {
    let mut last = Instant::now();
    let mut buffer = vec![0; 16 * 1024];
    loop {
        let length = match from.read(&mut buffer) {
            Ok(0) => return,
            Ok(length) => length,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(_) => return,
        };
        if is_cut.load(Ordering::SeqCst) {
            continue; // a cut cable takes what it is given
        }
        let mut arrives = Instant::now() + DELAY - JITTER + 2 * JITTER.mul_f64(random.next());
        if random.next() * (LOSS as f64) < 1.0 {
            lost.fetch_add(1, Ordering::SeqCst);
            arrives += SENT_AGAIN;
        }
        last = last.max(arrives);
        if to.send((last, buffer[..length].to_vec())).is_err() {
            return;
        }
    }
}

/// Writes each chunk when it arrives.
fn give(mut to: TcpStream, chunks: &Receiver<(Instant, Vec<u8>)>, is_cut: &AtomicBool) {
    for (arrives, chunk) in chunks {
        std::thread::sleep(arrives.saturating_duration_since(Instant::now()));
        if !is_cut.load(Ordering::SeqCst) && to.write_all(&chunk).is_err() {
            break;
        }
    }
    if !is_cut.load(Ordering::SeqCst) {
        let _ = to.shutdown(Shutdown::Write);
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014) as numbers in 0..1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (word ^ (word >> 31)) as f64 / u64::MAX as f64
    }
}
