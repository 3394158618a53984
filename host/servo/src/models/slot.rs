//! Slot of one model in a scene: the current layer, and a layer that is fading out.
//!
//! A model is replaced while the loop runs by putting another layer into its slot. Both layers are blended until the new layer has
//! faded in; then the old layer is returned, to be dropped outside the loop. If a third layer arrives before that, the oldest is
//! removed at once and its last contribution fades instead: the force does not jump however soon replacements follow each other.

use super::body::Body;
use super::contribution::Share;
use super::model_layer::{LayerReport, ModelLayer, SavedLayer};
use super::objects::Objects;
use crate::Unsaved;
use flotor_core::PluginIndex;
use flotor_core::broad_phase::Bounds;
use flotor_core::health::ModelHealth;
use flotor_core::weight::Fade;
use flotor_hal::abi::CallStatus;
use flotor_hal::{Demand, Tick};
use flotor_loader::InstanceState;

pub(crate) struct Slot<B: Body> {
    /// Number of the model in the scene.
    pub(crate) number: usize,
    current: Box<ModelLayer<B>>,
    /// Weight of the current layer while the old one fades out.
    presence: Fade,
    /// Old layer, while it fades out.
    leaving: Option<Box<ModelLayer<B>>>,
    /// Last contribution of a layer removed before it had faded out; fades out with `leaving`.
    rest: Option<B::Share>,
    /// Tick of the last step, and the old contributions less the current one in that step.
    gap: Option<(u64, B::Share)>,
    pub(super) weight: Fade,
    pub(super) priority: u8,
    fade_s: f64,
}

/// Saved state of a slot, without the states of its instances.
pub(crate) struct SavedSlot<B: Body> {
    generation: u16,
    fades: [Fade; 2],
    layer: SavedLayer<B>,
    parameters: Vec<f64>,
}

impl<B: Body> Slot<B> {
    /// Saves the state; an error while a layer fades out. Not real-time.
    pub(crate) fn save(&mut self, plugin: PluginIndex) -> Result<SavedSlot<B>, Unsaved> {
        let Self { current, presence, leaving: None, rest: None, weight, .. } = self else {
            return Err(Unsaved::Fading(plugin));
        };
        let layer = current.save().ok_or(Unsaved::Plugin(plugin))?;
        let parameters = current.body.parameters();
        Ok(SavedSlot { generation: current.generation, fades: [*presence, *weight], layer, parameters })
    }

    /// Restores a state, without parameters. Not real-time.
    pub(crate) fn restore(&mut self, saved: &SavedSlot<B>, plugin: PluginIndex) -> Result<(), Unsaved> {
        let is_same = (self.generation(), self.is_fading()) == (saved.generation, false);
        (is_same).then_some(()).ok_or(Unsaved::Replaced(plugin))?;
        self.current.restore(&saved.layer).ok_or(Unsaved::Plugin(plugin))?;
        [self.presence, self.weight] = saved.fades;
        Ok(())
    }

    /// Returns the parameters that have another value than the saved one, with the saved value. Not real-time.
    pub(crate) fn changed(&mut self, saved: &SavedSlot<B>) -> Vec<(usize, f64)> {
        let both = self.current.body.parameters().into_iter().zip(&saved.parameters).enumerate();
        let others = both.filter(|(_, (now, saved))| now.to_bits() != saved.to_bits());
        others.map(|(index, (_, saved))| (index, *saved)).collect()
    }

    /// Creates a slot with its first layer. Not real-time.
    pub(super) fn new(number: usize, layer: Box<ModelLayer<B>>) -> Self {
        let blend = layer.blend;
        Self {
            number,
            current: layer,
            presence: Fade::new(1.0, blend.fade_s),
            leaving: None,
            rest: None,
            gap: None,
            weight: Fade::new(blend.weight, blend.fade_s),
            priority: blend.priority,
            fade_s: blend.fade_s,
        }
    }

    /// Returns the generation of the current layer, named in changes of its parameters. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn generation(&self) -> u16 {
        self.current.generation
    }

    /// Installs a layer, which fades in from this tick on; returns the layer that was still fading out, if there was one.
    ///
    /// Real-time: bounded, no allocation.
    pub(crate) fn put(
        &mut self,
        mut layer: Box<ModelLayer<B>>,
        generation: u16,
        tick: &Tick,
    ) -> Option<Box<ModelLayer<B>>> {
        self.rest = self.missing_without_leaving(tick);
        self.gap = None;
        layer.generation = generation;
        let before = std::mem::replace(&mut self.current, layer);
        self.presence = Fade::new(0.0, self.fade_s);
        self.presence.set_target(1.0, tick.time_ns);
        self.leaving.replace(before)
    }

    /// Returns the contribution that would be missing without the leaving layer, as of the last tick; `None` if no layer is
    /// leaving, or the slot was not stepped in the last tick.
    fn missing_without_leaving(&self, tick: &Tick) -> Option<B::Share> {
        let (asked_at, gap) = self.gap?;
        let absence = 1.0 - self.presence.at(tick.time_ns);
        let is_felt = self.leaving.is_some() && absence > 0.0 && asked_at.saturating_add(1) == tick.index;
        is_felt.then(|| gap.times(absence))
    }

    /// Returns true while a layer is fading out. Real-time: bounded, no allocation.
    pub(crate) fn is_fading(&self) -> bool {
        self.leaving.is_some()
    }

    /// Removes the layer that has faded out, if there is one. Real-time: bounded, no allocation.
    #[inline]
    pub(crate) fn take_faded(&mut self, tick: &Tick) -> Option<Box<ModelLayer<B>>> {
        if self.leaving.is_none() || self.presence.at(tick.time_ns) < 1.0 {
            return None;
        }
        (self.rest, self.gap) = (None, None);
        self.leaving.take()
    }

    /// Returns true if the current model computes its stored energy.
    pub(super) fn gives_energy(&self) -> bool {
        self.current.serves.contains(Demand::ENERGY)
    }

    /// Steps the current and the leaving layer, and returns the blend of their contributions. Real-time: bounded by the objects
    /// that are near, no allocation.
    #[inline]
    pub(super) fn step(&mut self, tick: &Tick, samples: &B::Samples<'_>, events: &mut B::Marks) -> B::Share {
        let share = self.current.step(tick, samples, events);
        let Some(leaving) = &mut self.leaving else { return share };
        let presence = self.presence.at(tick.time_ns);
        let mut before = leaving.step(tick, samples, events);
        if let Some(rest) = self.rest {
            before = before.plus(rest);
        }
        self.gap = Some((tick.index, before.plus(share.times(-1.0))));
        share.times(presence).plus(before.times(1.0 - presence))
    }

    /// Sets the target, 0 to 1, to which the weight moves at the fade rate. Real-time: bounded, no allocation.
    pub(crate) fn set_weight(&mut self, tick: &Tick, weight: f64) {
        self.weight.set_target(weight, tick.time_ns);
    }

    /// Changes a live parameter of the current layer. Real-time: bounded by its objects, no allocation.
    pub(crate) fn set_parameter(&mut self, tick: &Tick, parameter: usize, value: f64) -> CallStatus {
        self.current.set_parameter(tick, parameter, value)
    }

    /// Iterates over the states of the current layer's instances before a tick; `None` for one whose state cannot be saved.
    pub(crate) fn states(&mut self, tick: u64) -> impl Iterator<Item = Option<InstanceState<'_>>> {
        self.current.body.states(tick)
    }

    /// Returns health and last message of the current layer. Not real-time.
    pub(crate) fn health(&mut self) -> (ModelHealth, String) {
        (self.current.health(), self.current.body.last_message())
    }

    /// Returns reports on all layers of the slot. Not real-time.
    pub(crate) fn reports(&mut self, on_query: &impl Fn(usize)) -> impl Iterator<Item = LayerReport> {
        let Self { number, current, leaving, .. } = self;
        let number = *number;
        let layers = leaving.iter_mut().chain(std::iter::once(current));
        layers.map(move |layer| layer.report(number, || on_query(number)))
    }

    /// Returns all layers of the slot, each with the model's number. Not real-time.
    pub(crate) fn into_layers(self) -> impl Iterator<Item = (usize, Box<ModelLayer<B>>)> {
        let Self { number, current, leaving, .. } = self;
        leaving.into_iter().chain(std::iter::once(current)).map(move |layer| (number, layer))
    }
}

impl Slot<Objects> {
    /// Returns the bounding box, device frame, in which the objects can act; `None` for everywhere. Real-time: bounded by their
    /// number, no allocation.
    pub(super) fn bounds(&self) -> Option<Bounds> {
        // The contribution of a removed layer fades wherever the handle is.
        if self.rest.is_some() {
            return None;
        }
        let current = self.current.body.bounds()?;
        self.leaving.as_ref().map_or(Some(current), |leaving| Some(current.with(leaving.body.bounds()?)))
    }
}
