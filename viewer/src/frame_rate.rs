//! Frame rate of the window.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Time over which frames are counted.
const OVER: Duration = Duration::from_secs(1);

/// Counter of the frames drawn in the last second, for the frame rate.
#[derive(Clone, Debug, Default)]
pub struct FrameRate(VecDeque<Instant>);

impl FrameRate {
    /// Counts a frame drawn at `now`.
    pub fn count(&mut self, now: Instant) {
        self.0.push_back(now);
        while self.0.front().is_some_and(|first| now.duration_since(*first) > OVER) {
            self.0.pop_front();
        }
    }

    /// Returns the frame rate over the second before the last frame, Hz; `None` with fewer than two frames in this second.
    #[must_use]
    pub fn hz(&self) -> Option<f64> {
        let span = self.0.back()?.duration_since(*self.0.front()?).as_secs_f64();
        (span > 0.0).then(|| (self.0.len() - 1) as f64 / span)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_pictures_of_the_last_second_count() {
        let (mut rate, start) = (FrameRate::default(), Instant::now());
        assert_eq!(rate.hz(), None);
        (0..300).for_each(|number| rate.count(start + Duration::from_millis(10 * number)));
        assert!(rate.hz().is_some_and(|hz| (hz - 100.0).abs() < 1.0e-6));
        rate.count(start + Duration::from_secs(60));
        assert_eq!(rate.hz(), None, "one picture after a pause has no rate");
    }
}
