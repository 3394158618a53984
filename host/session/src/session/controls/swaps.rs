//! Hot swaps of models: pending replacements, and plugins that the loop has returned.

use super::super::plugin_report::PluginReport;
use super::error::ControlError;
use super::plugin_table::PluginTable;
use crate::calls::{Call, CallThread, PendingCall, Unresponsive, end_limit};
use flotor_core::health::ModelHealth;
use flotor_servo::{HostSwaps, Layer, LayerReport, Replacement};
use std::time::Duration;

/// Model plugin of a run with faults: the plugin that the run began with, or a replacement.
#[derive(Clone, Debug)]
pub struct FaultyPlugin {
    /// Report on the plugin, with the name of the model.
    pub plugin: PluginReport,
    /// Health of the model, with counts of its faults.
    pub health: ModelHealth,
    /// Last message of the plugin; may be empty.
    pub words: String,
}

/// Hot swaps of models: their queues, models with a pending replacement, and faults of plugins that the loop has returned.
pub(super) struct Swaps {
    queues: HostSwaps,
    busy: Vec<bool>,
    /// Plugins with faults, each with model number and generation; of the replacements of a model at most one per plugin file, which
    /// bounds the list.
    faulty_plugins: Vec<(usize, u16, FaultyPlugin)>,
    /// Warnings about replacements, a sentence each.
    pub(super) warnings: Vec<String>,
    /// Plugins being freed on helper threads: `sweep` does not wait for plugin code.
    freeing: Vec<PendingCall<LayerReport>>,
    /// First plugin that was not freed in time.
    hung: Option<Unresponsive>,
}

/// Health and replacements of the models of a finished run.
pub(in super::super) struct Settled {
    /// Health and last message of the models that the run began with, in the scene's order.
    pub(in super::super) first: Vec<(ModelHealth, String)>,
    /// Replacements with faults.
    pub(in super::super) faulty_plugins: Vec<FaultyPlugin>,
    /// Replacements in place at the end.
    pub(in super::super) replacements: Vec<PluginReport>,
    /// First plugin that was not freed in time.
    pub(in super::super) hung: Option<Unresponsive>,
}

impl Swaps {
    pub(super) fn new(queues: HostSwaps, models: usize) -> Self {
        Self {
            queues,
            busy: vec![false; models],
            faulty_plugins: Vec::new(),
            warnings: Vec::new(),
            freeing: Vec::new(),
            hung: None,
        }
    }

    /// Starts to free plugins that the loop has returned, and records the faults of freed plugins. Not real-time; does not wait.
    pub(super) fn sweep(&mut self, plugins: &PluginTable) {
        while let Ok((model, mut layer)) = self.queues.retired.pop() {
            let who = plugins.name(model);
            let freed = CallThread::default().begin(end_limit(), move |progress| {
                let report = layer.report(model, || progress.enter(&who, Call::LastMessage));
                progress.enter(&who, Call::Destroy);
                drop(layer);
                report
            });
            self.freeing.extend(freed);
            self.release(&[model]);
        }
        self.collect(plugins, Duration::ZERO);
    }

    /// Reserves models for a replacement, all or none.
    ///
    /// # Errors
    /// [`ControlError::Busy`] if a replacement of one of the models is pending.
    pub(super) fn reserve(&mut self, plugins: &PluginTable, numbers: &[usize]) -> Result<(), ControlError> {
        self.sweep(plugins);
        if numbers.iter().any(|number| self.busy.get(*number).is_none_or(|busy| *busy)) {
            return Err(ControlError::Busy);
        }
        self.set_busy(numbers, true);
        Ok(())
    }

    /// Cancels a reservation.
    pub(super) fn release(&mut self, numbers: &[usize]) {
        self.set_busy(numbers, false);
    }

    fn set_busy(&mut self, numbers: &[usize], is_busy: bool) {
        for number in numbers {
            self.busy.get_mut(*number).into_iter().for_each(|busy| *busy = is_busy);
        }
    }

    /// Records the faults of freed plugins; waits up to `time` for each plugin that is being freed.
    pub(super) fn collect(&mut self, plugins: &PluginTable, time: Duration) {
        for call in std::mem::take(&mut self.freeing) {
            match call.poll(time) {
                None => self.freeing.push(call),
                Some(Ok(report)) => {
                    let (model, generation) = (report.model, report.generation);
                    self.note(plugins, report);
                    plugins.retire(model, generation);
                }
                Some(Err(hung)) => {
                    self.hung.get_or_insert(hung);
                }
            }
        }
    }

    /// Records the faults of a layer, if it has any.
    pub(super) fn note(&mut self, plugins: &PluginTable, report: LayerReport) {
        let LayerReport { model, generation, health, words } = report;
        if health.is_good() {
            return;
        }
        let Some(plugin) = plugins.plugin(model, generation) else { return };
        let is_known = |(of, which, known): &(usize, u16, FaultyPlugin)| {
            *of == model
                && (*which == 0) == (generation == 0)
                && known.plugin.metadata.path == plugin.metadata.path
        };
        if !self.faulty_plugins.iter().any(is_known) {
            self.faulty_plugins.push((model, generation, FaultyPlugin { plugin, health, words }));
        }
    }

    /// Sends a replacement to the loop. The queue has room: each model has at most one pending replacement.
    ///
    /// # Errors
    /// [`ControlError::Busy`].
    pub(super) fn send(&mut self, replacement: Replacement) -> Result<(), ControlError> {
        let model = replacement.model;
        let sent = self.queues.leaving_for_the_loop.push(replacement);
        self.set_busy(&[model], sent.is_ok());
        sent.map_err(|_| ControlError::Busy)
    }

    /// Removes and returns the models that a finished loop has returned, each with its number.
    pub(super) fn take_retired(&mut self) -> Vec<(usize, Layer)> {
        std::iter::from_fn(|| self.queues.retired.pop().ok()).collect()
    }

    /// Returns health and faults of all models of a finished run; `in_loop` has a report on each model still in the loop. Not
    /// real-time.
    pub(super) fn settle(
        &mut self,
        plugins: &PluginTable,
        models: usize,
        in_loop: Vec<LayerReport>,
    ) -> Settled {
        self.collect(plugins, end_limit());
        let mut first = vec![(ModelHealth::default(), String::new()); models];
        for report in in_loop {
            if let (0, Some(first)) = (report.generation, first.get_mut(report.model)) {
                *first = (report.health, report.words);
            } else {
                self.note(plugins, report);
            }
        }
        let mut later = Vec::new();
        for (model, generation, faulty) in &self.faulty_plugins {
            match first.get_mut(*model) {
                Some(first) if *generation == 0 => *first = (faulty.health, faulty.words.clone()),
                _ => later.push(faulty.clone()),
            }
        }
        Settled { first, faulty_plugins: later, replacements: plugins.replacements(), hung: self.hung.take() }
    }
}
