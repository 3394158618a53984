//! Intervals of an axis in which a condition held, collected in bounded memory.

use super::axis::LARGEST_DRAWABLE;

/// Maximum number of intervals: about one for each pixel column of a figure.
const CAPACITY: usize = 1024;

/// Number of gap widths in the whole: a reduction merges intervals with gaps up to one width.
const REDUCED: f64 = 512.0;

/// Intervals with ascending x. Before an interval beyond 1 024 is added, neighbours with gaps up to 1/512 of the whole (about two
/// pixels) are merged.
///
/// Not real-time: adding an interval may allocate, at most 16 KiB.
#[derive(Debug, Clone, Default)]
pub struct Spans {
    /// Begin and end of each interval, in order.
    pub(super) stretches: Vec<[f64; 2]>,
    is_open: bool,
}

impl Spans {
    /// Extends the current interval to `x`, or begins an interval at `x` if there is none. An x that is not finite changes nothing.
    pub fn extend(&mut self, x: f64) {
        if x.abs() > LARGEST_DRAWABLE || x.is_nan() {
            return;
        }
        match self.stretches.last_mut().filter(|_| self.is_open) {
            Some(last) => last[1] = last[1].max(x),
            None => {
                if self.stretches.len() >= CAPACITY {
                    self.reduce();
                }
                self.stretches.push([x, x]);
            }
        }
        self.is_open = true;
    }

    /// Ends the current interval; the next [`Self::extend`] begins another.
    pub fn interrupt(&mut self) {
        self.is_open = false;
    }

    fn reduce(&mut self) {
        let Some(([first, _], [_, last])) = self.stretches.first().zip(self.stretches.last()) else { return };
        let near = (last - first) / REDUCED;
        let mut joined: Vec<[f64; 2]> = Vec::with_capacity(CAPACITY);
        for [from, to] in self.stretches.drain(..) {
            match joined.last_mut().filter(|before| from - before[1] <= near) {
                Some(before) => before[1] = to,
                None => joined.push([from, to]),
            }
        }
        self.stretches = joined;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_begin_and_end_where_the_condition_did() {
        let mut spans = Spans::default();
        for tick in 0..100 {
            match tick {
                10..20 | 50 => spans.extend(f64::from(tick)),
                _ => spans.interrupt(),
            }
        }
        spans.extend(f64::NAN);
        assert_eq!(spans.stretches, [[10.0, 19.0], [50.0, 50.0]]);
    }

    #[test]
    fn memory_is_bounded_and_no_stretch_is_lost() {
        let mut spans = Spans::default();
        for tick in 0..1_000_000 {
            if tick % 3 == 0 && !(400_000..600_000).contains(&tick) {
                spans.extend(f64::from(tick));
            } else {
                spans.interrupt();
            }
        }
        assert!(spans.stretches.len() <= CAPACITY && spans.stretches.capacity() <= CAPACITY);
        let covered = |x: f64| spans.stretches.iter().any(|[from, to]| *from <= x && x <= *to);
        assert!([0.0, 3.0, 300_000.0, 399_999.0, 600_000.0, 999_999.0].into_iter().all(covered));
        assert!(!covered(500_000.0), "the long gap remains");
    }
}
