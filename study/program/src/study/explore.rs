//! `flotor study explore`: presents a spring whose dimensions and material can be changed while it is felt, without trials; the
//! immediate use that the thesis suggests (CMU-RI-TR-07-21, section 7).

use super::front::lines_of;
use clap::Args;
use flotor_command::options::{PluginKeyValue, SceneOptions};
use flotor_command::say;
use flotor_command::stopping::stop_run_on_signals;
use flotor_command::{CommandError, note, style};
use flotor_core::Change;
use flotor_hal::{Parameter, ParameterKind};
use flotor_live::Directory;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::run_description::describe;
use flotor_session::scene::Scene;
use flotor_session::telemetry::{ObservedRun, publish};
use flotor_session::{ControlError, Controls, NewValue, RunError, RunOptions, Session, stop_waits_with};
use flotor_study::apparatus::watch::{RunThread, Shared, spawn_run};
use flotor_study::kinematics::{KinematicsMeter, StimulusKinematics};
use std::io::{BufReader, stdin};
use std::path::{Path, PathBuf};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

/// Materials of spring wire with Young's and shear modulus, MPa: music wire as in the thesis, the other materials from
/// Shigley's Mechanical Engineering Design, table 10-5.
const MATERIALS: [(&str, [&str; 2]); 4] = [
    ("music-wire", ["203395", "75842"]),
    ("stainless", ["193000", "69000"]),
    ("phosphor-bronze", ["103400", "41400"]),
    ("inconel", ["213700", "77200"]),
];

#[derive(Args)]
#[command(after_help = "During the session, type:\n  \
    wire_diameter_mm 0.8      a new value; the host creates a new model if the parameter cannot change during a run\n  \
    material phosphor-bronze  music-wire, stainless, phosphor-bronze, inconel\n  \
    (Enter)                   stiffness and largest force at the hand since the previous command\n  \
    ?                         all parameters\n  \
    q                         end of the session\n\n\
    Examples:\n  \
    flotor study explore\n  \
    flotor study explore --set spring.preset=thesis-3 --set spring.variant=rod")]
pub(super) struct ExploreArguments {
    /// Scene to explore: a scene file (TOML), or the name of one of Flotor's own scenes (default: a spring of wire on the simulated
    /// flotor)
    #[arg(long, value_name = "FILE")]
    scene: Option<PathBuf>,
    /// Set a parameter of a plugin of the scene (repeatable)
    #[arg(long = "set", value_name = "PLUGIN.KEY=VALUE")]
    sets: Vec<PluginKeyValue>,
    #[command(flatten)]
    options: SceneOptions,
}

pub(super) fn run(arguments: &ExploreArguments) -> Result<(), CommandError> {
    let stop = stop_run_on_signals()?;
    stop_waits_with(&stop);
    let scene = scene(arguments)?;
    let registry = Registry::search(&scene.plugin_folders);
    let options = RunOptions { clock: Clock::Real, seed: 0 };
    let session = Session::prepare(&scene, &registry, &options)?;
    let session = session.with_strength(arguments.options.strength());
    session.notices().into_iter().for_each(note);
    session.warnings().iter().for_each(note);
    let model = scene.models.first().ok_or_else(|| {
        let file = arguments.scene.as_deref().unwrap_or(Path::new("built-in study")).display();
        CommandError::Usage(format!(
            "{file}: the scene has no model to explore; name a scene with a `[[model]]`"
        ))
    })?;
    let mapping = model.mapping.motion_scale * model.mapping.force_scale;
    let watch = Shared::default();
    watch.lock().meter = Some(KinematicsMeter::default());
    let description = describe(&scene, &options, session.plugins());
    let publication = publish(&Directory::of_this_user(), &scene, &description, &session, &stop);
    let hint = if publication.is_ok() { "; `flotor view` shows the session and has sliders" } else { "" };
    let mut prompt = Prompt {
        controls: session.controls(),
        registry,
        model: model.name.clone(),
        settings: Vec::new(),
        watch: watch.clone(),
        mapping,
    };
    let observers = ObservedRun { observer: watch, publication: publication.ok() };
    let run = spawn_run(session, observers, stop.clone(), "the exploration ended");
    let run = run.map_err(|_| RunError::NoThread("the exploration"))?;
    say!("{}", style::title(&scene.title));
    say!("  type a parameter and its value; ? lists the parameters, q ends{hint}");
    let lines = lines_of(BufReader::new(stdin()))?;
    while !(stop.is_stop_requested() || run.is_finished()) {
        match lines.recv_timeout(Duration::from_millis(50)) {
            Ok(line) if line.trim() == "q" => break,
            Ok(line) => say!("{}", prompt.take(line.trim())),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    end(&stop, run, scene.rate_hz)
}

fn end(stop: &StopSwitch, run: RunThread, rate_hz: f64) -> Result<(), CommandError> {
    stop.stop();
    let end = run.join().map_err(|_| RunError::Thread("panicked"))??.end;
    if end.is_in_order() { Ok(()) } else { Err(CommandError::run_ended(end, rate_hz)) }
}

/// Returns the scene to explore; by default a spring in the mode `physical`, so that all dimensions and the material are
/// parameters.
fn scene(arguments: &ExploreArguments) -> Result<Scene, CommandError> {
    let scene = match &arguments.scene {
        Some(path) => Scene::load(path),
        None => Scene::parse(
            Path::new("built-in study"),
            &flotor_session::scene::STUDY
                .replace("mode = \"gamma\"", "mode = \"physical\"")
                .replace("A spring to be judged", "A spring to explore"),
        ),
    };
    let mut scene = scene.map_err(RunError::Scene)?;
    arguments.options.apply(&mut scene);
    arguments.sets.iter().try_for_each(|set| set.apply(&mut scene)).map_err(CommandError::Usage)?;
    scene.duration_s = 86_400.0;
    Ok(scene)
}

/// Command prompt, which changes the model and reports stiffness and force at the hand.
struct Prompt {
    controls: Controls,
    registry: Registry,
    model: String,
    /// All changes so far, applied again to a replacement model.
    settings: Vec<(String, String)>,
    watch: Shared,
    /// Ratio of the stiffness at the hand to the stiffness of the model.
    mapping: f64,
}

impl Prompt {
    fn take(&mut self, line: &str) -> String {
        match line.split_whitespace().collect::<Vec<_>>().as_slice() {
            [] => self.felt(),
            ["?"] => self.list(),
            ["material", name] => match MATERIALS.iter().find(|(known, _)| known == name) {
                Some((_, [young, shear])) => {
                    self.change(&[("youngs_modulus_mpa", young), ("shear_modulus_mpa", shear)])
                }
                None => {
                    format!("  unknown material `{name}`; use {}", MATERIALS.map(|(name, _)| name).join(", "))
                }
            },
            [key, value] => self.change(&[(key, value)]),
            _ => "  type a parameter and its value, such as wire_diameter_mm 0.8".to_owned(),
        }
    }

    fn change(&mut self, changes: &[(&str, &str)]) -> String {
        let values: Vec<NewValue<'_>> = changes
            .iter()
            .map(|(parameter, value)| NewValue { plugin: &self.model, parameter, value })
            .collect();
        let result = match self.controls.set_parameters(&values) {
            Err(ControlError::Fixed { .. }) => self.swap(changes),
            other => other,
        };
        if let Err(error) = result {
            return format!("  {error}");
        }
        self.settings.extend(changes.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())));
        // Wait for the fade-in, or the model's rejection of the change.
        std::thread::sleep(Duration::from_millis(200));
        let refused = self.watch.lock().refused.take();
        if let Some(Change { parameter, value, .. }) = refused {
            self.settings.truncate(self.settings.len() - changes.len());
            return format!("  the model rejected {parameter} = {value}, which contradicts its other values");
        }
        self.watch.lock().meter = Some(KinematicsMeter::default());
        // Wait for one up-and-down movement of the hand.
        std::thread::sleep(Duration::from_millis(700));
        self.felt()
    }

    /// Replaces the model with a new one that has all changes so far, because fixed parameters are read at creation.
    fn swap(&self, changes: &[(&str, &str)]) -> Result<(), ControlError> {
        let before = self.settings.iter().map(|(key, value)| (key.as_str(), value.as_str()));
        let all: Vec<(&str, &str)> = before.chain(changes.iter().copied()).collect();
        self.controls.swap(&self.registry, &self.model, None, &all)
    }

    fn list(&self) -> String {
        let plugins = self.controls.plugins();
        let schema =
            plugins.iter().find(|(name, _)| *name == self.model).map_or(&[][..], |(_, schema)| schema);
        let line = |parameter: &Parameter| {
            let legal = match parameter.kind() {
                ParameterKind::Real => {
                    format!("{} to {} {}", parameter.min(), parameter.max(), parameter.unit())
                }
                _ => parameter.choices().iter().map(|name| name.as_str()).collect::<Vec<_>>().join(" | "),
            };
            format!("  {:<22}{:<34}{}", parameter.id(), legal, parameter.doc())
        };
        schema.iter().map(line).collect::<Vec<_>>().join("\n")
    }

    /// Describes stiffness and peak force at the hand since the last call, and restarts the measurement.
    fn felt(&self) -> String {
        let felt = self.watch.lock().meter.replace(KinematicsMeter::default());
        let words = |felt: StimulusKinematics| {
            let stiffness = felt.felt_stiffness_n_per_m;
            let at_hand = stiffness.map_or("no".to_owned(), |k| format!("{:.3} N/mm", k * 1.0e-3));
            let model = stiffness.map(|k| model_text(k, self.mapping)).unwrap_or_default();
            format!("  at the hand: {at_hand} stiffness{model}, up to {:.2} N", felt.peak_force_n)
        };
        felt.and_then(|meter| meter.finish()).map_or("  no force at the hand yet".to_owned(), words)
    }
}

/// Describes the model's stiffness if the mapping makes it differ from the stiffness at the hand, `at_hand`, N/m; else returns
/// an empty text.
fn model_text(at_hand: f64, mapping: f64) -> String {
    if (mapping - 1.0).abs() < 1.0e-6 || mapping <= 0.0 {
        return String::new();
    }
    format!(" ({:.3} N/mm of the model, times {mapping:.4} by the mapping)", at_hand / mapping * 1.0e-3)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 1.471 N/mm of wire are 2.452 N/mm at a hand whose 15 mm are 25 mm of the spring.
    #[test]
    fn the_stiffness_of_the_model_stands_beside_that_at_the_hand() {
        let text = model_text(2452.0, 25.0 / 15.0);
        assert_eq!(text, " (1.471 N/mm of the model, times 1.6667 by the mapping)");
        assert_eq!(model_text(2452.0, 1.0), "");
    }
}
