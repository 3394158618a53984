//! Cost of an open window: frames, and processor time and memory of the whole process, the driver's threads included.

use crate::platform::{processor, resident_mib};
use egui::{Context, ViewportCommand, ViewportId};
use std::fmt;
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// Cost of a window over a time span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Duration of the measurement.
    pub elapsed: Duration,
    /// Number of frames.
    pub pictures: u64,
    /// Processor time of all threads.
    pub processor: Duration,
    /// Resident memory at the end, MiB; 0 if unknown.
    pub resident_mib: u64,
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { elapsed, pictures, processor, resident_mib } = self;
        let percent = 100.0 * processor.as_secs_f64() / elapsed.as_secs_f64().max(f64::MIN_POSITIVE);
        write!(f, "{pictures} pictures in {:.1} s, {percent:.2} % of a core", elapsed.as_secs_f64())?;
        if *pictures > 0 {
            let each_ms = processor.as_secs_f64() * 1.0e3 / *pictures as f64;
            write!(f, " ({each_ms:.2} ms a picture)")?;
        }
        write!(f, ", {resident_mib} MiB of memory")
    }
}

/// Measures the cost of a window over `duration` on a separate thread, after a start-up of at most 30 s; then sends the result, and
/// closes the window. Sends nothing if no thread starts.
pub fn watch(context: &Context, duration: Duration, tells: Sender<Cost>) {
    let context = context.clone();
    // The window is in its first picture, possibly drawn by this thread.
    let mut opening = Opening::at(Instant::now(), context.cumulative_frame_nr_for(ViewportId::ROOT));
    let watching = move || {
        let pictures = || context.cumulative_frame_nr_for(ViewportId::ROOT);
        while opening.goes_on(Instant::now(), pictures()) {
            std::thread::sleep(LOOK_PERIOD);
        }
        let (start, before, used) = (Instant::now(), pictures(), processor());
        std::thread::sleep(duration);
        let cost = Cost {
            elapsed: start.elapsed(),
            pictures: pictures() - before,
            processor: processor().saturating_sub(used),
            resident_mib: resident_mib().unwrap_or(0),
        };
        let _ = tells.send(cost); // the receiver is gone once the window was closed by hand
        context.send_viewport_cmd_to(ViewportId::ROOT, ViewportCommand::Close);
    };
    let _ = std::thread::Builder::new().name("flotor-cost".to_owned()).spawn(watching);
}

/// Poll interval of an opening window.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Start-up phase of a window (fonts, shaders, first ticks), left out of the measurement.
struct Opening {
    opened: Instant,
    first: u64,
    /// Number of pictures so far, and time of the last picture.
    pictures: u64,
    last: Instant,
    /// Longest interval between two pictures.
    longest: Duration,
}

impl Opening {
    /// Number of pictures after which the start-up is over: the window then draws continuously.
    const MOST_PICTURES: u64 = 60;
    /// Pause after a picture that ends the start-up, and its smallest multiple of the longest interval: on a busy machine this
    /// may be seconds.
    const QUIET: Duration = Duration::from_secs(1);
    const QUIET_TIMES: u32 = 3;
    /// Timeout of the start-up.
    const LONGEST: Duration = Duration::from_secs(30);

    fn at(now: Instant, pictures: u64) -> Self {
        Self { opened: now, first: pictures, pictures, last: now, longest: Duration::ZERO }
    }

    /// Updates the intervals between pictures; returns true until the start-up is over.
    fn goes_on(&mut self, now: Instant, pictures: u64) -> bool {
        if pictures != self.pictures {
            self.longest = self.longest.max(now - self.last);
            (self.pictures, self.last) = (pictures, now);
        }
        let made = pictures - self.first;
        let is_quiet = made > 0 && now - self.last >= Self::QUIET.max(self.longest * Self::QUIET_TIMES);
        let goes_on_for_good = made >= Self::MOST_PICTURES;
        !is_quiet && !goes_on_for_good && now - self.opened < Self::LONGEST
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// When a window has opened that makes its pictures at these times, s.
    fn opens_after_s(pictures_s: &[f64]) -> f64 {
        let start = Instant::now();
        let mut opening = Opening::at(start, 7);
        let looks = (0..).map(|look| LOOK_PERIOD * look);
        let opened = looks.skip_while(|time| {
            let made = pictures_s.iter().filter(|picture_s| **picture_s <= time.as_secs_f64()).count();
            opening.goes_on(start + *time, 7 + made as u64)
        });
        opened.map(|time| time.as_secs_f64()).next().expect("it does not take for ever")
    }

    #[test]
    fn a_window_has_opened_when_it_rests_or_goes_on_for_good() {
        let close = |a: f64, b: f64| (a - b).abs() < 2.5 * LOOK_PERIOD.as_secs_f64();
        assert!(close(opens_after_s(&[]), 30.0));
        assert!(close(opens_after_s(&[0.1, 0.2, 0.4]), 1.4));
        // A busy machine: a picture every two seconds is no rest in between.
        assert!(close(opens_after_s(&[0.9, 2.9, 4.9, 6.9]), 12.9));
        let steadily =
            |rate_hz: f64| (1..6000).map(|picture| f64::from(picture) / rate_hz).collect::<Vec<_>>();
        assert!(close(opens_after_s(&steadily(60.0)), 1.0));
        assert!(close(opens_after_s(&steadily(5.0)), 12.0));
        assert!(close(opens_after_s(&steadily(0.9)), 30.0));
    }
}
