//! The place of one model in a scene: who answers there now, and who answered before.
//!
//! A model is replaced while the loop runs by putting another layer in its place. The two are mixed until the new one
//! has faded in; then the old one is handed back, to be dropped off the loop. If a third one comes before that, the
//! oldest goes at once, and what it asked for last fades in its stead: nothing jumps however soon they follow.

use super::broad_phase::Bounds;
use super::fade::Fade;
use super::layer::{Layer, LayerReport, ModelHealth, Share};
use flotor_core::demand::TickDemand;
use flotor_core::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, DeviceState, Tick};

pub(super) struct Slot {
    /// Of the model in the scene.
    pub(super) number: usize,
    current: Box<Layer>,
    /// How far the current layer has come in.
    presence: Fade,
    /// The layer before, until then.
    leaving: Option<Box<Layer>>,
    /// What is missing since a layer went before it had faded out: it fades with the one that leaves.
    rest: Option<Share>,
    /// What all that leaves asked for more than the current layer, and in which tick that was.
    gap: Option<(u64, Share)>,
    pub(super) weight: Fade,
    pub(super) priority: u8,
    fade_s: f64,
}

impl Slot {
    /// Not real-time.
    pub(super) fn new(number: usize, layer: Layer) -> Self {
        let blend = *layer.blend();
        Self {
            number,
            current: Box::new(layer),
            presence: Fade::new(1.0, blend.fade_s),
            leaving: None,
            rest: None,
            gap: None,
            weight: Fade::new(blend.weight, blend.fade_s),
            priority: blend.priority,
            fade_s: blend.fade_s,
        }
    }

    /// How often a layer was put in: a change of a parameter names the layer it is for. Real-time: bounded, no
    /// allocation.
    #[inline]
    pub(super) fn generation(&self) -> u16 {
        self.current.generation
    }

    /// Puts a layer in, which fades in from now on; the one that was still fading out comes back.
    ///
    /// Real-time: bounded, no allocation.
    pub(super) fn put(&mut self, mut layer: Box<Layer>, generation: u16, tick: &Tick) -> Option<Box<Layer>> {
        self.rest = self.missing_without_leaving(tick);
        self.gap = None;
        layer.generation = generation;
        let before = std::mem::replace(&mut self.current, layer);
        self.presence = Fade::new(0.0, self.fade_s);
        self.presence.set_target(1.0, tick.time_ns);
        self.leaving.replace(before)
    }

    /// What would be missing from this tick on if what leaves went now and the current layer were all there is: as it
    /// was a tick ago. Nothing if nobody leaves, or nobody was asked then.
    fn missing_without_leaving(&self, tick: &Tick) -> Option<Share> {
        let (asked_at, gap) = self.gap?;
        let absence = 1.0 - self.presence.at(tick.time_ns);
        let is_felt = self.leaving.is_some() && absence > 0.0 && asked_at.saturating_add(1) == tick.index;
        is_felt.then(|| gap.times(absence))
    }

    /// Whether a layer is fading out. Real-time: bounded, no allocation.
    pub(super) fn is_fading(&self) -> bool {
        self.leaving.is_some()
    }

    /// The layer that has faded out, if there is one. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn take_faded(&mut self, tick: &Tick) -> Option<Box<Layer>> {
        if self.leaving.is_none() || self.presence.at(tick.time_ns) < 1.0 {
            return None;
        }
        (self.rest, self.gap) = (None, None);
        self.leaving.take()
    }

    /// True if the current model gives its stored energy.
    pub(super) fn gives_energy(&self) -> bool {
        self.current.serves().contains(Demand::ENERGY)
    }

    /// The box in the device frame in which its objects can act; `None` if that is everywhere. Real-time: bounded by
    /// their number, no allocation.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        // What fades of one that has gone does so wherever the handle is.
        if self.rest.is_some() {
            return None;
        }
        let current = self.current.bounds()?;
        self.leaving.as_ref().map_or(Some(current), |leaving| Some(current.with(leaving.bounds()?)))
    }

    /// What it asks for at a state of the device. Real-time: bounded by the objects that are near, no allocation.
    #[inline]
    pub(super) fn step(
        &mut self,
        tick: &Tick,
        state: &DeviceState,
        demand: TickDemand,
        events: &mut Events,
    ) -> Share {
        let share = self.current.step(tick, state, demand, events);
        let Some(leaving) = &mut self.leaving else { return share };
        // The current layer mixed with the one that leaves.
        let presence = self.presence.at(tick.time_ns);
        let mut before = leaving.step(tick, state, demand, events);
        if let Some(rest) = self.rest {
            before = before.plus(rest);
        }
        self.gap = Some((tick.index, before.plus(share.times(-1.0))));
        share.times(presence).plus(before.times(1.0 - presence))
    }

    /// Changes a live parameter of the current layer. Real-time: bounded by its objects, no allocation.
    pub(super) fn set_parameter(&mut self, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        self.current.set_parameter(tick, parameter, value)
    }

    /// How the current layer has behaved, and what it said last. Not real-time.
    pub(super) fn health(&mut self) -> (ModelHealth, String) {
        (self.current.health(), self.current.last_message())
    }

    /// What is known of all its layers. Not real-time.
    pub(super) fn reports(&mut self, asks: &impl Fn(usize)) -> impl Iterator<Item = LayerReport> {
        let Self { number, current, leaving, .. } = self;
        let number = *number;
        let layers = leaving.iter_mut().chain(std::iter::once(current));
        layers.map(move |layer| layer.report(number, || asks(number)))
    }

    /// All its layers, each with the number of the model. Not real-time.
    pub(super) fn into_layers(self) -> impl Iterator<Item = (usize, Box<Layer>)> {
        let Self { number, current, leaving, .. } = self;
        leaving.into_iter().chain(std::iter::once(current)).map(move |layer| (number, layer))
    }
}
