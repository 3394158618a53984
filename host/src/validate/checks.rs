//! One rule, checked in this process.

use super::path::CONFIG;
use super::rule::Check;
use super::{Figures, Seen, device, live, locked, model, passive};
use crate::registry::load_file;
use crate::scene::KeyValue;
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{LoadError, Model, Plugin, Setting, read_metadata};
use flotor_hal::conformance::Rule;
use flotor_hal::{Parameter, ParameterKind, RefusalKind};
use std::path::Path;

/// Checks one rule, of instances with these settings; what was measured on the way, if anything was. Not
/// real-time; runs the plugin's code in this process, which it may hang or end.
///
/// # Errors
/// What was seen that violates the rule, or what is missing to check it.
pub fn check(path: &Path, settings: &[KeyValue], wanted: Check) -> Result<Option<Figures>, Seen> {
    let words = |error: LoadError| error.to_string();
    if wanted == Check::Contract(Rule::Metadata) {
        return read_metadata(path).map(|_| None).map_err(|error| Seen::Violation(words(error)));
    }
    let plugin = load_file(path).map_err(|error| Seen::Violation(words(error)))?;
    let parse = |set: &KeyValue| {
        let (key, value) = set.pair();
        Setting::parse(plugin.parameters(), key, value).map_err(|error| Seen::Missing(error.to_string()))
    };
    let settings = settings.iter().map(parse).collect::<Result<Vec<_>, Seen>>()?;
    let subject = Subject { plugin, settings };
    let is_held = |()| None;
    match wanted {
        Check::Contract(rule) if subject.plugin.metadata().kind == PluginKind::Device && opens(rule) => {
            check_device(&subject, rule).map(is_held)
        }
        Check::Contract(rule) => check_without_device(&subject, rule).map_err(Seen::Violation).map(is_held),
        Check::FiniteInMotion => with_model(&subject, model::finite_in_motion).map(is_held),
        Check::LiveParameters => live::live_parameters(&subject).map_err(Seen::Violation).map(is_held),
        Check::Activity => with_model(&subject, model::activity).map(is_held),
        Check::Passive => with_model(&subject, passive::passive),
        Check::SystemCalls => {
            let model = subject.prepared_model().map_err(Seen::Violation)?;
            locked::system_calls(model).map(is_held)
        }
    }
}

/// What is checked: a plugin, and how its instances are set.
pub(super) struct Subject {
    pub(super) plugin: Plugin,
    settings: Vec<Setting>,
}

impl Subject {
    fn model(&self) -> Result<Model, String> {
        self.plugin.create_model(&self.settings).map_err(|error| error.to_string())
    }

    /// An instance as a loop meets it.
    pub(super) fn prepared_model(&self) -> Result<Model, String> {
        let mut model = self.model()?;
        model.prepare(&CONFIG).map_err(|refusal| refusal.to_string())?;
        Ok(model)
    }
}

/// True for rules that open a device plugin.
fn opens(rule: Rule) -> bool {
    matches!(rule, Rule::Defaults | Rule::Capabilities | Rule::Lifecycle | Rule::SafeStop)
}

/// Rules of a device. One that is not there, busy or forbidden is nobody's violation.
fn check_device(subject: &Subject, rule: Rule) -> Result<(), Seen> {
    let opened = subject.plugin.open_device(&subject.settings).map_err(|error| match error {
        LoadError::Refused { refusal, .. } if refusal.kind == RefusalKind::Resource => {
            Seen::Missing(refusal.reason)
        }
        other => Seen::Violation(other.to_string()),
    })?;
    let checked = match rule {
        Rule::Capabilities => device::capabilities(opened),
        Rule::Lifecycle => device::lifecycle(opened),
        Rule::SafeStop => device::safe_stop(opened),
        _ => Ok(()),
    };
    checked.map_err(Seen::Violation)
}

fn check_without_device(subject: &Subject, rule: Rule) -> Result<(), String> {
    let one = |check: fn(&mut Model) -> Result<(), String>| check(&mut subject.prepared_model()?);
    match rule {
        Rule::Metadata | Rule::Loads => Ok(()),
        Rule::Schema => schema(subject.plugin.parameters()),
        Rule::Defaults => subject.model().map(|_| ()),
        Rule::FiniteNearHome => one(model::near_home),
        Rule::SurvivesNotFinite => one(model::not_finite),
        Rule::SurvivesFarPoses => one(model::far_poses),
        Rule::ResetRepeats => one(model::reset_repeats),
        Rule::TimeBudget => one(model::time_budget),
        Rule::Independent => model::independent(subject),
        Rule::NoThreads => one(model::no_threads),
        Rule::EnergyGradient => one(model::energy_gradient),
        unknown => Err(format!("this host cannot check `{}`", unknown.id())),
    }
}

fn with_model<T>(subject: &Subject, check: impl FnOnce(&mut Model) -> Result<T, String>) -> Result<T, Seen> {
    subject.prepared_model().and_then(|mut model| check(&mut model)).map_err(Seen::Violation)
}

fn schema(parameters: &[Parameter]) -> Result<(), String> {
    for (index, parameter) in parameters.iter().enumerate() {
        let id = parameter.id();
        if id.is_empty() || parameter.doc().is_empty() {
            return Err(format!("parameter {index} (`{id}`) lacks an id or a doc"));
        }
        if parameters.iter().take(index).any(|earlier| earlier.id() == id) {
            return Err(format!("`{id}` occurs twice"));
        }
        if !matches!(parameter.kind(), ParameterKind::Text | ParameterKind::File)
            && let Err(range) = parameter.check(parameter.default())
        {
            return Err(format!("the default of `{id}`: {range}"));
        }
    }
    Ok(())
}
