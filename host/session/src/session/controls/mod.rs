//! Changes of a running loop by other threads: new values of parameters, weights, replacements of models.
//!
//! Texts are checked against the schema of a plugin here; only numbers enter the loop.

mod change_log;
mod error;
mod plugin_table;
mod swaps;
mod versions;

pub(super) use change_log::ChangeLog;
pub use error::ControlError;
pub use plugin_table::NewValue;
pub(super) use plugin_table::{PluginTable, understands};
pub use swaps::FaultyPlugin;
pub(super) use swaps::Settled;
pub(super) use versions::ChosenBy;

use super::error::RunError;
use super::prepare::prepare_model_while;
use crate::calls::is_to_begin;
use crate::registry::Registry;
use crate::scene::{Location, ModelUse};
use flotor_core::lock;
use flotor_hal::{LoopConfig, Parameter};
use flotor_live::RefusalCause;
use flotor_servo::{ChangeSender, Clock, HostSwaps, Layer, LayerReport, ParameterChange, Replacement};
use std::sync::{Arc, Mutex, MutexGuard};
use swaps::Swaps;

/// Handle to a running loop, for any thread, with cheap clones. No method makes the loop wait.
#[derive(Clone)]
pub struct Controls {
    shared: Arc<Shared>,
}

struct Shared {
    plugins: PluginTable,
    /// Locked by panels and scripts, never by the loop.
    changes: Mutex<ChangeSender>,
    /// Models of the scene, for place and mixing of a replacement.
    models: Vec<ModelUse>,
    config: LoopConfig,
    clock: Clock,
    swaps: Mutex<Swaps>,
}

impl Controls {
    pub(super) fn new(
        plugins: PluginTable,
        changes: ChangeSender,
        models: &[ModelUse],
        (config, clock): (LoopConfig, Clock),
        queues: HostSwaps,
    ) -> Self {
        let (changes, swaps) = (Mutex::new(changes), Mutex::new(Swaps::new(queues, models.len())));
        Self { shared: Arc::new(Shared { plugins, changes, models: models.to_vec(), config, clock, swaps }) }
    }

    /// Returns every plugin of the run with its schema: the devices, then the models in the scene's order.
    #[must_use]
    pub fn plugins(&self) -> Vec<(String, &'static [Parameter])> {
        let plugins = self.shared.plugins.lock();
        plugins.iter().map(|plugin| (plugin.now().name.clone(), plugin.now().schema)).collect()
    }

    /// Moves a live parameter to a new value, by a tenth of its [soft range](flotor_hal::SoftRange) in 50 ms; a value that is no
    /// number changes before the next tick. Not real-time.
    ///
    /// The plugin may still refuse a value that does not fit its other values: observers get the outcome ([`super::Observer::change`]).
    ///
    /// # Errors
    /// [`ControlError`]: no such plugin, parameter or value; not a live one; the loop is busy or over.
    pub fn set_parameter(&self, plugin: &str, parameter: &str, value: &str) -> Result<(), ControlError> {
        self.set_parameters(&[NewValue { plugin, parameter, value }])
    }

    /// Moves several live parameters to new values, all from the same tick on; each as [`Controls::set_parameter`] does. Not
    /// real-time.
    ///
    /// # Errors
    /// [`ControlError`]; then none of them changes.
    pub fn set_parameters(&self, values: &[NewValue<'_>]) -> Result<(), ControlError> {
        let Shared { plugins, .. } = &*self.shared;
        let slowed = |change: &ParameterChange| ParameterChange { pace: plugins.pace(change), ..*change };
        let checked =
            values.iter().map(|value| plugins.check(value)).collect::<Result<Vec<_>, _>>()?.concat();
        self.send(&checked.iter().map(slowed).collect::<Vec<_>>())
    }

    /// Sets several live parameters, all before the same tick: for changes that no hand feels, such as the next stimulus of an
    /// experiment. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]; then none of them changes.
    pub fn set_parameters_at_once(&self, values: &[NewValue<'_>]) -> Result<(), ControlError> {
        let checked = values.iter().map(|value| self.shared.plugins.check(value));
        self.send(&checked.collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// Sets the weight of a model, approached at the rate of its fade from the next tick on. A model with a weight of 0 is not
    /// stepped any more. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]: no such model; the loop is busy or over.
    pub fn set_weight(&self, model: &str, weight: f64) -> Result<(), ControlError> {
        self.send(&self.shared.plugins.check_weight(model, weight)?)
    }

    fn send(&self, checked: &[ParameterChange]) -> Result<(), ControlError> {
        let mut changes = lock(&self.shared.changes);
        if changes.is_abandoned() {
            return Err(ControlError::Ended);
        }
        // All or none, and the loop applies them together.
        changes.push_entire_slice(checked).map_err(|_| ControlError::Busy)
    }

    /// Replaces a model by another plugin, or by the same one rebuilt (hot swap): the new one is loaded and created here, and fades
    /// in from the next tick on while the old one fades out. Not real-time: takes as long as creating the model.
    ///
    /// Without `plugin`, plugin and settings are those of the scene; another plugin starts from its own defaults. `settings` are
    /// added. Places, mapping and weight stay.
    ///
    /// # Errors
    /// [`ControlError`]: no such model; the plugin is refused; the model replaced last is still fading; the loop is over.
    pub fn swap(
        &self,
        registry: &Registry,
        model: &str,
        plugin: Option<&str>,
        settings: &[(&str, &str)],
    ) -> Result<(), ControlError> {
        let Shared { plugins, models, config, clock, .. } = &*self.shared;
        let numbers = plugins.models(model)?;
        if lock(&self.shared.changes).is_abandoned() {
            return Err(ControlError::Ended);
        }
        self.swaps().reserve(plugins, &numbers)?;
        let refused = |error: RunError| ControlError::Refused {
            model: model.to_owned(),
            problem: error.to_string(),
            cause: if error.is_configuration() { RefusalCause::Request } else { RefusalCause::Plugin },
        };
        let make = |number: &usize| {
            let mut other = models.get(*number).ok_or(ControlError::Ended)?.replaced_by(plugin, settings);
            if plugin.is_some() {
                other.plugin.location = Location { file: "--plugin".into(), line: 0 };
            }
            // After the end of a run, or a request for it, no thread waits for plugin code.
            let is_wanted = || !lock(&self.shared.changes).is_abandoned() && is_to_begin();
            prepare_model_while(registry, &other, config, *clock, is_wanted).map_err(refused)
        };
        // Without the lock: the run goes on meanwhile, and may end.
        let made = numbers.iter().map(make).collect::<Result<Vec<_>, _>>();
        let mut swaps = self.swaps();
        let made = made.inspect_err(|_| swaps.release(&numbers))?;
        for (number, (layer, report)) in numbers.into_iter().zip(made) {
            swaps.warn(report.warning());
            let generation = plugins.add(number, report, ChosenBy::Name);
            swaps.send(Replacement { model: number, generation, layer: Box::new(layer) })?;
        }
        Ok(())
    }

    /// Returns warnings about replacements, a sentence each. Not real-time.
    pub(super) fn warnings(&self) -> Vec<String> {
        self.swaps().take_warnings()
    }

    fn swaps(&self) -> MutexGuard<'_, Swaps> {
        lock(&self.shared.swaps)
    }

    /// Frees models that the loop has returned, unless another thread does. Not real-time.
    pub(super) fn sweep(&self) {
        if let Ok(mut swaps) = self.shared.swaps.try_lock() {
            swaps.sweep(&self.shared.plugins);
        }
    }

    /// Returns the models that a finished loop has returned last, each with its number. Not real-time.
    pub(super) fn take_retired(&self) -> Vec<(usize, Box<Layer>)> {
        self.swaps().take_retired()
    }

    /// Returns the faults of all plugins of a run that is over; `in_loop` has those still in the loop. Not real-time.
    pub(super) fn settle(&self, in_loop: Vec<LayerReport>) -> Settled {
        let Shared { plugins, models, .. } = &*self.shared;
        self.swaps().settle(plugins, models.len(), in_loop)
    }
}
