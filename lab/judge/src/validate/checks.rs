//! Check of one rule in this process.

use super::path::CONFIG;
use super::rule::Check;
use super::untouched::{Host, untouched};
use super::{Figures, Outcome, device, guarded, life, live_parameters, model, passive};
use crate::platform::locked;
use crate::subject::prepared;
use flotor_hal::abi::PluginKind;
use flotor_hal::abi::loader::{LoadError, Model, OpenedDevice, Plugin, Setting, read_metadata};
use flotor_hal::conformance::Rule;
use flotor_hal::{Parameter, ParameterKind, RefusalKind};
use flotor_session::THREAD_ADVICE;
use flotor_session::registry::load_file;
use flotor_session::scene::KeyValue;
use std::path::Path;

/// Checks one rule on instances with these settings; returns measured figures, if any. Not real-time; runs the plugin's
/// code in this process, which may hang or crash.
///
/// # Errors
/// The violation of the rule, or the reason why it could not be checked.
pub fn check(path: &Path, settings: &[KeyValue], wanted: Check) -> Result<Option<Figures>, Outcome> {
    if wanted == Check::Contract(Rule::Metadata) {
        read_metadata(path)?;
        return Ok(None);
    }
    let told = |error: LoadError| error.to_string();
    let before = Host::now();
    let plugin = load_file(path)?;
    let parse = |set: &KeyValue| {
        let (key, value) = set.pair();
        Setting::parse(plugin.parameters(), key, value).map_err(|error| Outcome::Missing(error.to_string()))
    };
    let settings = settings.iter().map(parse).collect::<Result<Vec<_>, Outcome>>()?;
    let subject = Subject { plugin, settings };
    let of_model = |check: fn(&mut Model) -> Result<(), String>| check(&mut subject.prepared_model()?);
    match wanted {
        Check::FiniteInMotion => of_model(model::finite_in_motion)?,
        Check::Demand => of_model(model::demand)?,
        Check::LiveParameters => live_parameters::live_parameters(&subject)?,
        Check::Activity => model::activity(&mut subject.prepared_model()?)?,
        Check::Passive => return passive::passive(&mut subject.prepared_model()?),
        Check::SystemCalls => locked::system_calls(subject.prepared_model()?)?,
        Check::Contract(rule) => match rule {
            Rule::Metadata | Rule::Loads => {}
            Rule::Schema => schema(subject.plugin.parameters())?,
            Rule::Defaults if subject.is_device() => drop(subject.device()?),
            Rule::Defaults => drop(subject.plugin.create_model(&subject.settings).map_err(told)?),
            Rule::Extensions => life::live(&subject, &mut |_, _| Ok(()))?,
            Rule::HostUntouched => untouched(&subject, &before)?,
            Rule::InsideMemory => guarded::inside_memory(&subject)?,
            Rule::DeviceTime => device::time(subject.device()?)?,
            Rule::Capabilities => device::capabilities(subject.device()?)?,
            Rule::Lifecycle => device::lifecycle(subject.device()?)?,
            Rule::SafeStop => device::safe_stop(subject.device()?)?,
            Rule::FiniteNearHome => of_model(model::near_home)?,
            Rule::SurvivesNotFinite => of_model(model::not_finite)?,
            Rule::SurvivesFarPoses => of_model(model::far_poses)?,
            Rule::ResetRepeats => of_model(model::reset_repeats)?,
            Rule::TimeBudget => of_model(model::time_budget)?,
            Rule::Independent => model::independent(&subject)?,
            Rule::NoThreads => model::no_threads(subject.prepared_model()?, before.threads()?)?,
            Rule::EnergyGradient => model::energy_gradient(&mut subject.prepared_model()?)?,
            unknown => return Err(format!("this host cannot check `{}`", unknown.id()).into()),
        },
    }
    Ok(None)
}

impl Outcome {
    /// Returns the finding for a check whose thread could not be started.
    pub(crate) fn no_thread(cause: &std::io::Error) -> Self {
        Self::Missing(format!("cannot start a thread for the check: {cause}; {THREAD_ADVICE}"))
    }

    /// Returns the finding that the rule does not apply, for this reason.
    pub(super) fn nothing_to_judge(why: &str) -> Self {
        Self::NothingToJudge(why.to_owned())
    }
}

impl From<String> for Outcome {
    fn from(violation: String) -> Self {
        Self::Violation(violation)
    }
}

/// Converts a load error; a missing, busy or forbidden resource is no violation.
impl From<LoadError> for Outcome {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::Refused { refusal, .. }
                if refusal.kind == RefusalKind::Resource && is_told(&refusal.reason) =>
            {
                Self::Missing(refusal.reason)
            }
            other => Self::Violation(other.to_string()),
        }
    }
}

/// Returns true if a refusal names a reason; the loader replaces a missing one, or invalid text.
fn is_told(reason: &str) -> bool {
    !reason.starts_with("no reason given") && !reason.contains(char::REPLACEMENT_CHARACTER)
}

/// Checked plugin with the settings of its instances.
pub(super) struct Subject {
    pub(super) plugin: Plugin,
    settings: Vec<Setting>,
}

impl Subject {
    /// Creates and prepares an instance, as for a loop.
    pub(super) fn prepared_model(&self) -> Result<Model, String> {
        prepared(&self.plugin, &self.settings, CONFIG.seed).map_err(|error| error.to_string())
    }

    pub(super) fn is_device(&self) -> bool {
        self.plugin.metadata().kind == PluginKind::Device
    }

    pub(super) fn settings(&self) -> &[Setting] {
        &self.settings
    }

    pub(super) fn device(&self) -> Result<OpenedDevice, LoadError> {
        self.plugin.open_device(&self.settings)
    }
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
