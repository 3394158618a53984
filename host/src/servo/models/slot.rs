//! The place of one model in a scene: who answers there now, and who answered before.
//!
//! A model is replaced while the loop runs by putting another layer in its place. The two are mixed until the new one
//! has faded in; then the old one is handed back, to be dropped off the loop.

use super::broad_phase::Bounds;
use super::fade::Fade;
use super::layer::{Layer, ModelHealth, Share};
use crate::trace::Events;
use flotor_hal::abi::CallStatus;
use flotor_hal::{DeviceState, Tick};

pub(super) struct Slot {
    /// Of the model in the scene.
    pub(super) number: usize,
    current: Box<Layer>,
    /// How far the current layer has come in.
    presence: Fade,
    /// The layer before, until then.
    leaving: Option<Box<Layer>>,
    /// How often a layer was put in: a change of a parameter names the layer it is for.
    pub(super) generation: u16,
    pub(super) weight: Fade,
    pub(super) priority: u8,
    fade_s: f64,
    pub(super) health: ModelHealth,
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
            generation: 0,
            weight: Fade::new(blend.weight, blend.fade_s),
            priority: blend.priority,
            fade_s: blend.fade_s,
            health: ModelHealth::default(),
        }
    }

    /// Puts a layer in, which fades in from now on; the one that was still fading out comes back.
    ///
    /// Real-time: bounded, no allocation.
    pub(super) fn put(&mut self, layer: Box<Layer>, generation: u16, tick: &Tick) -> Option<Box<Layer>> {
        let before = std::mem::replace(&mut self.current, layer);
        self.presence = Fade::new(0.0, self.fade_s);
        self.presence.set_target(1.0, tick.time_ns);
        self.generation = generation;
        self.leaving.replace(before)
    }

    /// The layer that has faded out, if there is one. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn take_faded(&mut self, tick: &Tick) -> Option<Box<Layer>> {
        if self.presence.at(tick.time_ns) < 1.0 { None } else { self.leaving.take() }
    }

    /// The box in the device frame in which its objects can act; `None` if that is everywhere. Real-time: bounded by
    /// their number, no allocation.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        let current = self.current.bounds()?;
        self.leaving.as_ref().map_or(Some(current), |leaving| Some(current.with(leaving.bounds()?)))
    }

    /// What it asks for at a state of the device. Real-time: bounded by the objects that are near, no allocation.
    #[inline(always)] // as `Layer::step`
    pub(super) fn step(&mut self, tick: &Tick, state: &DeviceState, events: &mut Events) -> Share {
        if self.leaving.is_some() {
            return self.mixed(tick, state, events);
        }
        self.current.step(tick, state, &mut self.health, events)
    }

    /// The current layer's share mixed with that of the one that leaves. Real-time: as [`Self::step`].
    #[inline(never)] // out of the way of the many ticks in which nobody leaves
    fn mixed(&mut self, tick: &Tick, state: &DeviceState, events: &mut Events) -> Share {
        let share = self.current.step(tick, state, &mut self.health, events);
        let Some(leaving) = &mut self.leaving else { return share };
        let presence = self.presence.at(tick.time_ns);
        let before = leaving.step(tick, state, &mut self.health, events);
        Share {
            wrench: share.wrench * presence + before.wrench * (1.0 - presence),
            energy_j: share.energy_j * presence + before.energy_j * (1.0 - presence),
        }
    }

    /// Changes a live parameter of the current layer. Real-time: bounded by its objects, no allocation.
    pub(super) fn set_parameter(&mut self, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        self.current.set_parameter(tick, parameter, value, &mut self.health)
    }

    /// What the current layer said last. Not real-time.
    pub(super) fn last_message(&mut self) -> String {
        self.current.last_message()
    }
}
