//! What an open window costs: pictures made, and processor time and memory of the whole process, the driver's threads included.

use egui::{Context, ViewportCommand, ViewportId};
use std::fmt;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// A window that has just opened (fonts, shaders, the first ticks) is at rest once no picture has been made for so long, or goes on
/// making them: after so long at most.
const QUIET: Duration = Duration::from_secs(1);
const SETTLES: Duration = Duration::from_secs(4);

/// What a window has cost over a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// How long it was watched.
    pub elapsed: Duration,
    /// Pictures made.
    pub pictures: u64,
    /// Processor time of all threads.
    pub processor: Duration,
    /// Memory in use at the end, MiB.
    pub resident_mib: u64,
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { elapsed, pictures, processor, resident_mib } = self;
        let percent = 100.0 * processor.as_secs_f64() / elapsed.as_secs_f64().max(f64::MIN_POSITIVE);
        write!(f, "{pictures} pictures in {:.1} s, {percent:.2} % of a core", elapsed.as_secs_f64())?;
        if *pictures > 0 {
            #[allow(clippy::cast_precision_loss)] // pictures of a few minutes
            let each_ms = processor.as_secs_f64() * 1.0e3 / *pictures as f64;
            write!(f, " ({each_ms:.2} ms a picture)")?;
        }
        write!(f, ", {resident_mib} MiB")
    }
}

/// Watches a window for a time on a thread of its own, tells what it cost, and closes it. Without a thread nobody is told.
pub fn watch(context: &Context, duration: Duration, tells: Sender<Cost>) {
    let context = context.clone();
    let watching = move || {
        let pictures = || context.cumulative_frame_nr_for(ViewportId::ROOT);
        settle(pictures);
        let (start, before, used) = (Instant::now(), pictures(), processor());
        std::thread::sleep(duration);
        let cost = Cost {
            elapsed: start.elapsed(),
            pictures: pictures() - before,
            processor: processor().saturating_sub(used),
            resident_mib: resident_mib().unwrap_or(0),
        };
        let _ = tells.send(cost); // nobody listens any more once the window was closed by hand
        context.send_viewport_cmd_to(ViewportId::ROOT, ViewportCommand::Close);
    };
    let _ = std::thread::Builder::new().name("flotor-cost".to_owned()).spawn(watching);
}

/// Waits until the number of pictures stays what it is, or goes on growing.
fn settle(pictures: impl Fn() -> u64) {
    const LOOK_PERIOD: Duration = Duration::from_millis(50);
    let opened = Instant::now();
    let (mut last, mut since) = (pictures(), opened);
    while since.elapsed() < QUIET && opened.elapsed() < SETTLES {
        std::thread::sleep(LOOK_PERIOD);
        let now = pictures();
        if now != last {
            (last, since) = (now, Instant::now());
        }
    }
}

/// Processor time of this process so far.
fn processor() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Duration::try_from(time).unwrap_or_default()
}

/// Memory of this process that is in use, MiB, where the system tells.
fn resident_mib() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: u64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kib / 1024)
}
