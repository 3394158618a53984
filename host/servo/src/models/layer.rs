//! Layer of a run as its owner sees it: created, replaced and dropped outside the loop.

use super::model_layer::{LayerReport, ModelLayer};
use super::objects::Objects;
use super::shared_object::SharedObject;
use crate::budget::TimeBudget;
use crate::engine::Engine;
use flotor_core::mapping::{Blend, Mapping};
use flotor_hal::SampledLoop;

/// Force model with all its instances: the unit of blending and replacement. Boxed inside: the loop moves it without freeing memory.
pub struct Layer(pub(crate) Kind);

/// The two kinds of layers.
pub(crate) enum Kind {
    /// Instances on one device, one for each position.
    OnDevice(Box<ModelLayer<Objects>>),
    /// One instance that several devices share.
    Shared(Box<ModelLayer<SharedObject>>),
}

/// Replacement of a model in a running loop.
pub struct Replacement {
    /// Number of the model to replace.
    pub model: usize,
    /// Generation of the new layer, named in changes of its parameters.
    pub generation: u16,
    /// New layer.
    pub layer: Layer,
}

impl Layer {
    /// Creates a layer on one device from a model's instances, each with its mapping, and their common time budget. Not real-time.
    ///
    /// A model with workspace bounds gets a wall at the bounds, with the largest stable stiffness of the loop up to 7500 N/m.
    pub fn new(
        instances: Vec<(Engine, Mapping)>,
        blend: &Blend,
        budget: TimeBudget,
        sampled: &SampledLoop,
    ) -> Self {
        let (objects, serves) = Objects::new(instances, sampled);
        Self(Kind::OnDevice(Box::new(ModelLayer::new(objects, serves, blend, budget))))
    }

    /// Creates a layer of one instance that several devices share, with its mapping at the first of them, and at the further ones in
    /// the order of the ports, at most [`flotor_hal::MAX_PORTS`] in all. The instance runs in the loop ([`Engine::Here`]); any
    /// other is disabled at its first step. Walls as in [`Self::new`]. Not real-time.
    pub fn shared(
        (instance, first): (Engine, Mapping),
        further: Vec<Mapping>,
        blend: &Blend,
        budget: TimeBudget,
        sampled: &SampledLoop,
    ) -> Self {
        let (object, serves) = SharedObject::new(instance, [vec![first], further].concat(), sampled);
        Self(Kind::Shared(Box::new(ModelLayer::new(object, serves, blend, budget))))
    }

    /// Returns a report on the layer of the model numbered `model`. Queries the last message of an unhealthy model only, and calls
    /// `on_query` before the query. Not real-time.
    pub fn report(&mut self, model: usize, on_query: impl FnOnce()) -> LayerReport {
        match &mut self.0 {
            Kind::OnDevice(layer) => layer.report(model, on_query),
            Kind::Shared(layer) => layer.report(model, on_query),
        }
    }
}

impl From<Box<ModelLayer<Objects>>> for Layer {
    fn from(layer: Box<ModelLayer<Objects>>) -> Self {
        Self(Kind::OnDevice(layer))
    }
}

impl From<Box<ModelLayer<SharedObject>>> for Layer {
    fn from(layer: Box<ModelLayer<SharedObject>>) -> Self {
        Self(Kind::Shared(layer))
    }
}
