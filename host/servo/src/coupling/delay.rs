//! News on its way for a number of ticks.

use super::News;

/// What goes in comes out so many ticks later, in order.
pub(super) struct DelayLine {
    /// As many places as the delay has ticks; empty without a delay.
    places: Box<[Option<News>]>,
    next: usize,
}

impl DelayLine {
    /// Not real-time.
    pub(super) fn new(delay_ticks: u32) -> Self {
        Self { places: vec![None; delay_ticks as usize].into(), next: 0 }
    }

    /// Takes the news of this tick in and gives what arrives in it; nothing has yet, in the first ticks.
    ///
    /// Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn pass(&mut self, news: News) -> Option<News> {
        let length = self.places.len();
        let Some(place) = self.places.get_mut(self.next) else { return Some(news) };
        self.next = (self.next + 1) % length;
        place.replace(news)
    }
}
