//! Changes of a running loop by other threads: new values of parameters, weights, replacements of models.
//!
//! Values given as text are checked against the plugin's schema and converted here; the loop receives numbers only.

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

/// Handle with which any thread changes a running loop; clones are cheap. No method makes the loop wait.
#[derive(Clone)]
pub struct Controls {
    shared: Arc<Shared>,
}

/// Live numbers of a run, resolved: the changes of each.
pub struct LiveNumbers(Vec<Vec<ParameterChange>>);

struct Shared {
    plugins: PluginTable,
    /// Queue to the loop; locked by the threads that change the run, never by the loop.
    changes: Mutex<ChangeSender>,
    /// Models of the scene, from which a replacement takes positions, mapping and blending.
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

    /// Returns name and parameter schema of each plugin of the run, replacements included: devices, then models, in the scene's order.
    #[must_use]
    pub fn plugins(&self) -> Vec<(String, &'static [Parameter])> {
        let plugins = self.shared.plugins.lock();
        plugins.iter().map(|plugin| (plugin.now().name.clone(), plugin.now().schema)).collect()
    }

    /// Moves a live parameter to a new value at a rate of a tenth of its [soft range](flotor_hal::SoftRange) per 50 ms; a parameter
    /// without a soft range, for example of a simulated device, changes before the next tick. Not real-time.
    ///
    /// The plugin may still reject a value that does not fit its other values: observers receive the outcome
    /// ([`super::Observer::change`]).
    ///
    /// # Errors
    /// [`ControlError`]: unknown plugin or parameter, illegal value, parameter not live, queue to the loop full, or run over.
    pub fn set_parameter(&self, plugin: &str, parameter: &str, value: &str) -> Result<(), ControlError> {
        self.set_parameters(&[NewValue { plugin, parameter, value }])
    }

    /// Moves several live parameters to new values, all from the same tick on; each as [`Controls::set_parameter`] does. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]; then no parameter changes.
    pub fn set_parameters(&self, values: &[NewValue<'_>]) -> Result<(), ControlError> {
        let Shared { plugins, .. } = &*self.shared;
        let slowed = |change: &ParameterChange| ParameterChange { pace: plugins.pace(change), ..*change };
        let checked =
            values.iter().map(|value| plugins.check(value)).collect::<Result<Vec<_>, _>>()?.concat();
        self.send(&checked.iter().map(slowed).collect::<Vec<_>>())
    }

    /// Sets several live parameters before the same tick, without a gradual change: for changes that no hand feels, such as the next
    /// stimulus of an experiment. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]; then no parameter changes.
    pub fn set_parameters_at_once(&self, values: &[NewValue<'_>]) -> Result<(), ControlError> {
        let checked = values.iter().map(|value| self.shared.plugins.check(value));
        self.send(&checked.collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// Returns live numbers of the run, each by plugin and parameter, for changes in quick succession. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]: unknown plugin or parameter, a parameter that is not live, or not a number that may be 0.
    pub fn numbers(&self, names: &[(&str, &str)]) -> Result<LiveNumbers, ControlError> {
        let check = |(plugin, parameter): &(&str, &str)| {
            self.shared.plugins.check(&NewValue { plugin, parameter, value: "0" })
        };
        Ok(LiveNumbers(names.iter().map(check).collect::<Result<_, _>>()?))
    }

    /// Sets live numbers before the same tick, without a gradual change, as [`Controls::set_parameters_at_once`] does; the plugin
    /// refuses a value out of range. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]: queue to the loop full, or run over.
    pub fn set_numbers(&self, numbers: &LiveNumbers, values: &[f64]) -> Result<(), ControlError> {
        let each = numbers.0.iter().zip(values);
        let change = |(changes, value): (&Vec<ParameterChange>, &f64)| {
            changes.iter().map(|change| ParameterChange { value: *value, ..*change }).collect::<Vec<_>>()
        };
        self.send(&each.flat_map(change).collect::<Vec<_>>())
    }

    /// Sets the target weight of a model, clamped to 0 to 1, which the loop approaches at the rate of the model's fade from the
    /// next tick on. A model with weight 0 is not stepped. Not real-time.
    ///
    /// # Errors
    /// [`ControlError`]: unknown model, queue to the loop full, or run over.
    pub fn set_weight(&self, model: &str, weight: f64) -> Result<(), ControlError> {
        self.send(&self.shared.plugins.check_weight(model, weight)?)
    }

    fn send(&self, checked: &[ParameterChange]) -> Result<(), ControlError> {
        let mut changes = lock(&self.shared.changes);
        if changes.is_abandoned() {
            return Err(ControlError::Ended);
        }
        // All changes or none; the loop applies them together.
        changes.push_entire_slice(checked).map_err(|_| ControlError::Busy)
    }

    /// Replaces a model with another plugin, or with a new instance of the same plugin (hot swap): loads and creates the new model,
    /// which then fades in from the next tick on while the old model fades out. Not real-time: takes as long as creating the model.
    ///
    /// Without `plugin`, the new model has the plugin and parameters of the scene; a given plugin starts from its own defaults.
    /// `settings`, as key and value, are added. Positions, mapping and weight stay.
    ///
    /// # Errors
    /// [`ControlError`]: unknown model, rejected plugin, a previous replacement pending or still fading, or run over.
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
        // Without the lock: the run continues meanwhile, and may end.
        let made = numbers.iter().map(make).collect::<Result<Vec<_>, _>>();
        let mut swaps = self.swaps();
        let made = made.inspect_err(|_| swaps.release(&numbers))?;
        for (number, (layer, report)) in numbers.into_iter().zip(made) {
            swaps.warnings.extend(report.warning());
            let generation = plugins.add(number, report, ChosenBy::Name);
            swaps.send(Replacement { model: number, generation, layer })?;
        }
        Ok(())
    }

    /// Removes and returns the warnings about replacements, a sentence each. Not real-time.
    pub(super) fn warnings(&self) -> Vec<String> {
        std::mem::take(&mut self.swaps().warnings)
    }

    fn swaps(&self) -> MutexGuard<'_, Swaps> {
        lock(&self.shared.swaps)
    }

    /// Frees models that the loop has returned, unless another thread holds the lock. Not real-time.
    pub(super) fn sweep(&self) {
        if let Ok(mut swaps) = self.shared.swaps.try_lock() {
            swaps.sweep(&self.shared.plugins);
        }
    }

    /// Removes and returns the models that a finished loop has returned, each with its number. Not real-time.
    pub(super) fn take_retired(&self) -> Vec<(usize, Layer)> {
        self.swaps().take_retired()
    }

    /// Returns health and faults of all models of a finished run; `in_loop` has a report on each model still in the loop. Not
    /// real-time.
    pub(super) fn settle(&self, in_loop: Vec<LayerReport>) -> Settled {
        let Shared { plugins, models, .. } = &*self.shared;
        self.swaps().settle(plugins, models.len(), in_loop)
    }
}
