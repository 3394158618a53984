//! Check of one rule in this process.

use super::outcome::{Figures, Outcome};
use super::rule::Check;
use super::subject::Subject;
use super::untouched::{Host, untouched};
use super::{device, guarded, life, live_parameters, model, passive, ports, restore};
use crate::platform::locked;
use flotor_hal::conformance::Rule;
use flotor_hal::{Parameter, ParameterKind};
use flotor_loader::{LoadError, Model, Setting, read_metadata};
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
            Rule::RestoreRepeats => restore::restore_repeats(&subject)?,
            Rule::Ports => ports::ports(&subject)?,
            Rule::TimeBudget => of_model(model::time_budget)?,
            Rule::Independent => model::independent(&subject)?,
            Rule::NoThreads => model::no_threads(subject.prepared_model()?, before.threads()?)?,
            Rule::EnergyGradient => model::energy_gradient(&mut subject.prepared_model()?)?,
            unknown => return Err(format!("this host cannot check `{}`; update Flotor", unknown.id()).into()),
        },
    }
    Ok(None)
}

fn schema(parameters: &[Parameter]) -> Result<(), String> {
    for (index, parameter) in parameters.iter().enumerate() {
        let id = parameter.id();
        if id.is_empty() {
            return Err(format!("parameter {index} (from 0) has no id; give each parameter an id"));
        }
        if parameter.doc().is_empty() {
            return Err(format!("parameter `{id}` has no doc; describe the parameter in a sentence"));
        }
        if parameters.iter().take(index).any(|earlier| earlier.id() == id) {
            return Err(format!("two parameters have the id `{id}`; rename one of them"));
        }
        if !matches!(parameter.kind(), ParameterKind::Text | ParameterKind::File)
            && let Err(range) = parameter.check(parameter.default())
        {
            return Err(format!("the default of `{id}` is invalid: {range}"));
        }
    }
    Ok(())
}
