//! Delay of peer states by a number of ticks.

use super::PeerState;

/// Delay line: returns each state a fixed number of ticks later, in order.
#[derive(Clone)]
pub(super) struct DelayLine {
    /// One place for each tick of delay; empty without a delay.
    places: Box<[Option<PeerState>]>,
    next: usize,
}

impl DelayLine {
    /// Creates an empty delay line. Not real-time.
    pub(super) fn new(delay_ticks: u32) -> Self {
        Self { places: vec![None; delay_ticks as usize].into(), next: 0 }
    }

    /// Stores the peer state of this tick and returns the peer state that arrives in this tick; `None` until the first
    /// state has passed the delay.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn pass(&mut self, state: PeerState) -> Option<PeerState> {
        let length = self.places.len();
        let Some(place) = self.places.get_mut(self.next) else { return Some(state) };
        self.next = (self.next + 1) % length;
        place.replace(state)
    }
}
