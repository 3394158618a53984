//! Lateness of a loop while strangers attack a port of its machine, compared with the same strangers at a port of the test, in turn.
//!
//! The file uses `attacks.rs` beside it and nothing else of this crate: the bridge includes both with `#[path]`.

#![allow(dead_code)] // each test program uses its part

use super::attacks::{Attackers, Place};
use std::collections::VecDeque;
use std::net::TcpListener;
use std::os::unix::net::UnixListener;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Threads of attackers, each with up to a hundred connections, and the pause after an attack of each.
const ATTACKERS: usize = 2;
const PAUSE: Duration = Duration::from_millis(1);
/// Connections that a stand-in holds, as a live socket does.
const HELD: usize = 20;

/// Carries out attacks on the place that a number selects, until the body returns.
pub(crate) fn under_attack<T>(
    places: &[Place],
    request: &[u8],
    selected: &AtomicUsize,
    body: impl FnOnce() -> T,
) -> T {
    /// Ends the attackers, also by a panic.
    struct End<'e>(&'e AtomicBool);
    impl Drop for End<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }
    let is_over = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let _end = End(&is_over);
        for _ in 0..ATTACKERS {
            scope.spawn(|| {
                let attackers = |place: &Place| Attackers::new(place.clone(), request);
                let mut attackers: Vec<_> = places.iter().map(attackers).collect();
                while !is_over.load(Ordering::Relaxed) {
                    let place = selected.load(Ordering::Relaxed);
                    attackers[place].attack();
                    // Nobody stays at the other place.
                    attackers[1 - place].leave();
                    std::thread::sleep(PAUSE);
                }
            });
        }
        body()
    })
}

/// Opens a port of this process that accepts, and holds some connections: of the family of the place that it stands in for; a socket in a
/// folder.
pub(crate) fn stand_in(place: &Place, folder: &Path) -> Place {
    fn hold<T>(mut accept: impl FnMut() -> std::io::Result<T> + Send + 'static)
    where
        T: 'static,
    {
        std::thread::spawn(move || {
            let mut held = VecDeque::new();
            while let Ok(stream) = accept() {
                held.push_back(stream);
                if held.len() > HELD {
                    held.pop_front();
                }
            }
        });
    }
    match place {
        Place::Socket(_) => {
            let path = folder.join("stand-in");
            let listener = UnixListener::bind(&path).expect("a scratch folder takes a socket");
            hold(move || listener.accept().map(|(stream, _)| stream));
            Place::Socket(path)
        }
        Place::Port(_) => {
            let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
            let at = listener.local_addr().expect("it is bound");
            hold(move || listener.accept().map(|(stream, _)| stream));
            Place::Port(at)
        }
    }
}

/// Time of a window, and the beginning of it that is not judged: batches of ticks come up to 10 ms late.
const WINDOW: Duration = Duration::from_millis(1500);
const SETTLING: Duration = Duration::from_millis(100);

/// Returns the lateness of the ticks, ns, of each window; the strangers are at the place in the even ones, at a stand-in for it in the others.
/// `next` returns the lateness of the newest ticks after a few milliseconds.
pub(crate) fn windows(
    place: &Place,
    folder: &Path,
    request: &[u8],
    count: usize,
    mut next: impl FnMut() -> Vec<u64>,
) -> Vec<Vec<u64>> {
    let places = [place.clone(), stand_in(place, folder)];
    let selected = AtomicUsize::new(0);
    under_attack(&places, request, &selected, || {
        let mut windows = Vec::new();
        for number in 0..count {
            selected.store(number % 2, Ordering::Relaxed);
            let (begun, mut window) = (Instant::now(), Vec::new());
            while begun.elapsed() < WINDOW {
                let lateness_ns = next();
                if begun.elapsed() > SETTLING {
                    window.extend(lateness_ns);
                }
            }
            windows.push(window);
        }
        windows
    })
}

/// The median, and its standard error from the spread of the values.
fn median(mut values: Vec<f64>) -> (f64, f64) {
    fn middle(values: &mut [f64]) -> f64 {
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    }
    let centre = middle(&mut values);
    let mut distances: Vec<f64> = values.iter().map(|value| (value - centre).abs()).collect();
    // Of a normal distribution: 1.4826 distances are a standard deviation, and the median varies by 1.2533 / sqrt(n) of it.
    let error = 1.4826 * 1.2533 * middle(&mut distances) / (values.len() as f64).sqrt();
    (centre, error)
}

/// The ratio of the 99th percentiles of the lateness, strangers at the run to strangers elsewhere, and its standard error.
#[track_caller]
pub(crate) fn judge(name: &str, windows: &[Vec<u64>]) {
    let p99 = |window: &Vec<u64>| {
        let mut window = window.clone();
        window.sort_unstable();
        assert!(window.len() > 200, "{name}: ticks come: {}", window.len());
        window[window.len() * 99 / 100] as f64
    };
    let of = |first: usize| median(windows.iter().skip(first).step_by(2).map(p99).collect());
    let ((at_the_run, error), (elsewhere, error_elsewhere)) = (of(0), of(1));
    let ratio = at_the_run / elsewhere;
    let ratio_error = ratio * ((error / at_the_run).powi(2) + (error_elsewhere / elsewhere).powi(2)).sqrt();
    println!(
        "{name}: lateness p99 {:.0} µs, strangers elsewhere {:.0} µs, ratio {ratio:.2} +- {ratio_error:.2}",
        at_the_run * 1e-3,
        elsewhere * 1e-3
    );
    // Beyond twice its standard error the ratio is none of chance.
    assert!(ratio - 2.0 * ratio_error <= 1.2, "{name}: {ratio:.2} +- {ratio_error:.2}");
}
