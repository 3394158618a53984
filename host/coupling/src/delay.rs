//! Peer states on their way for a number of ticks.

use super::PeerState;

/// What goes in comes out so many ticks later, in order.
pub(super) struct DelayLine {
    /// As many places as the delay has ticks; empty without a delay.
    places: Box<[Option<PeerState>]>,
    next: usize,
}

impl DelayLine {
    /// Not real-time.
    pub(super) fn new(delay_ticks: u32) -> Self {
        Self { places: vec![None; delay_ticks as usize].into(), next: 0 }
    }

    /// Takes the peer state of this tick in and gives the one that arrives in it; nothing has yet, in the first ticks.
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
