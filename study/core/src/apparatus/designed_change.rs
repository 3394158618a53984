//! Changes of the settings of a designed study: fades out the models that change, changes them, and fades them in.
//!
//! A live number of a model changes while the model is faded out; any other setting of a model replaces the model then. A setting of a
//! device is fixed for a run: a new run begins when it changes.

use super::designed_setup::{Change, DesignedApparatus};
use crate::conduct::ApparatusOrFrontEndError;
use flotor_session::scene::{PluginKeyValue, Scene};
use flotor_session::{ControlError, Controls, NewValue};
use flotor_study_design::value::{Setting, Value};
use std::collections::BTreeMap;

/// Values of settings, by part and key.
pub(super) type Settings = BTreeMap<(String, String), String>;

/// Run whose settings change.
pub(super) trait Changeable {
    /// Returns the handle that changes models and parameters.
    fn controls(&self) -> &Controls;

    /// Lets a time in seconds pass.
    ///
    /// # Errors
    /// If the run ends.
    fn pass(&mut self, seconds: f64) -> Result<(), ApparatusOrFrontEndError>;
}

/// Settings of one interval, by the way in which they change.
pub(super) struct IntervalSettings {
    /// Settings that need a new run.
    pub(super) fixed: Settings,
    /// Live numbers of models.
    live: Settings,
    /// Settings that replace models.
    replaced: Settings,
}

impl IntervalSettings {
    pub(super) fn of(apparatus: &DesignedApparatus, settings: &[(Setting, Value)]) -> Self {
        let of = |change: Change| -> Settings {
            let all = settings.iter().filter_map(|(setting, value)| match setting {
                Setting::Scene { part, key } if apparatus.change(setting) == change => {
                    Some(((part.clone(), key.clone()), value.to_string()))
                }
                _ => None,
            });
            all.collect()
        };
        Self { fixed: of(Change::NewRun), live: of(Change::Live), replaced: of(Change::Replacement) }
    }

    /// Applies the settings that need a new run to its scene.
    pub(super) fn apply_fixed(&self, scene: &mut Scene) -> Result<(), String> {
        self.fixed.iter().try_for_each(|((part, key), value)| {
            format!("{part}.{key}={value}").parse::<PluginKeyValue>()?.apply(scene)
        })
    }

    /// Returns the models whose settings change, sorted.
    pub(super) fn models(&self) -> Vec<String> {
        let mut parts: Vec<String> =
            self.live.keys().chain(self.replaced.keys()).map(|(part, _)| part.clone()).collect();
        parts.sort();
        parts.dedup();
        parts
    }
}

/// Starts to fade models in (`shown`) or out, and returns the time of the longest fade, s.
pub(super) fn start_fade(
    controls: &Controls,
    scene: &Scene,
    parts: &[String],
    fade: Fade,
) -> Result<f64, ControlError> {
    let mut longest_s = 0.0_f64;
    for model in scene.models.iter().filter(|model| parts.contains(&model.name)) {
        let weight = match fade {
            Fade::In => model.blend.weight,
            Fade::Out => 0.0,
        };
        controls.set_weight(&model.name, weight)?;
        longest_s = longest_s.max(model.blend.fade_s);
    }
    Ok(longest_s)
}

/// Direction of a fade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fade {
    /// Up to the weight in the scene.
    In,
    /// To zero.
    Out,
}

/// Fades models in or out, and waits for the end of the fade.
pub(super) fn fade(
    run: &mut dyn Changeable,
    scene: &Scene,
    parts: &[String],
    direction: Fade,
) -> Result<(), ApparatusOrFrontEndError> {
    let longest_s = start_fade(run.controls(), scene, parts, direction)?;
    // One tick more: the loop applies a change at the next tick.
    let tick_s = 1.0 / scene.rate_hz;
    if parts.is_empty() { Ok(()) } else { run.pass(longest_s + tick_s) }
}

/// Changes the settings of models that are faded out; `replaced` are the settings of replaced models, before and after.
pub(super) fn change(
    run: &mut dyn Changeable,
    apparatus: &DesignedApparatus,
    settings: &IntervalSettings,
    replaced: &mut Settings,
) -> Result<(), ApparatusOrFrontEndError> {
    for part in &settings.models() {
        let own = |settings: &Settings| -> Vec<(String, String)> {
            let own = settings.iter().filter(|((of, _), _)| of == part);
            own.map(|((_, key), value)| (key.clone(), value.clone())).collect()
        };
        if own(replaced) == own(&settings.replaced) {
            set(run.controls(), part, &own(&settings.live))?;
        } else {
            let values = [own(&settings.replaced), own(&settings.live)].concat();
            replace(run, apparatus, part, &values)?;
        }
    }
    replaced.clone_from(&settings.replaced);
    Ok(())
}

fn set(controls: &Controls, part: &str, values: &[(String, String)]) -> Result<(), ControlError> {
    let values: Vec<NewValue<'_>> =
        values.iter().map(|(parameter, value)| NewValue { plugin: part, parameter, value }).collect();
    if values.is_empty() { Ok(()) } else { controls.set_parameters_at_once(&values) }
}

fn replace(
    run: &mut dyn Changeable,
    apparatus: &DesignedApparatus,
    part: &str,
    values: &[(String, String)],
) -> Result<(), ApparatusOrFrontEndError> {
    let model = apparatus.stage.scene.models.iter().find(|model| model.name == part);
    let fade_s = model.map_or(0.0, |model| model.blend.fade_s);
    let values: Vec<(&str, &str)> =
        values.iter().map(|(key, value)| (key.as_str(), value.as_str())).collect();
    let swap = |run: &dyn Changeable| run.controls().swap(&apparatus.stage.registry, part, None, &values);
    let mut done = swap(run);
    if let Err(ControlError::Busy) = done {
        // A replaced model is dropped after its fade-out; only then can another replacement start.
        run.pass(fade_s)?;
        done = swap(run);
    }
    Ok(done?)
}
