//! What is said, as JSON.

use flotor_core::{Change, ChangeOutcome, ChangeSubject};
use flotor_hal::{Mutability, Parameter, ParameterKind, SoftRange};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::PathBuf;

/// The first thing a host says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Greeting {
    /// Version of what follows: [`crate::PROTOCOL`].
    pub protocol: u32,
    /// Version of the host.
    pub flotor_version: String,
    /// Process of the host.
    pub process: u32,
    /// Title of the scene.
    pub title: String,
    /// The device, then the models in the scene's order.
    pub plugins: Vec<PanelPlugin>,
    /// The most that may reach the hand.
    pub limits: WrenchLimits,
}

/// The most that may reach the hand, along and about each axis of the device frame, and in any direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WrenchLimits {
    /// Force, N; without one, no limit.
    pub force_n: [Option<f64>; 3],
    /// Torque, N·m; without one, no limit.
    pub torque_nm: [Option<f64>; 3],
    /// The norm of the force, N; without one, no limit.
    #[serde(default)]
    pub force_norm_n: Option<f64>,
    /// The norm of the torque, N·m; without one, no limit.
    #[serde(default)]
    pub torque_norm_nm: Option<f64>,
}

/// A plugin of the run and what it can be told: all that a panel is made of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelPlugin {
    /// What the scene calls it; `device` for the device.
    pub name: String,
    /// Id.
    pub id: String,
    /// Its library.
    pub file: PathBuf,
    /// Whether it is a device that exists in numbers only: nothing that it does reaches a person.
    #[serde(default)]
    pub is_simulated: bool,
    /// Its parameters, in the order of its schema.
    pub parameters: Vec<PanelParameter>,
}

/// A parameter, with its value in force.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelParameter {
    /// Id.
    pub id: String,
    /// Unit for people; empty where there is none.
    pub unit: String,
    /// One sentence for people.
    pub doc: String,
    /// What values it takes.
    pub shape: ParameterShape,
    /// Whether it may change while the loop runs.
    pub live: bool,
    /// The value in force, as a person would type it.
    pub value: String,
    /// The value it began the run with, as a person would type it; empty if that is not known.
    #[serde(default)]
    pub first: String,
    /// Where a number is usefully moved by hand.
    #[serde(default)]
    pub soft: Option<SoftLimits>,
}

/// Where a number is usefully moved by hand: a slider goes no farther, and a larger number is typed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SoftLimits {
    /// Smallest.
    pub min: f64,
    /// Largest.
    pub max: f64,
    /// The step of a key.
    pub step: f64,
}

impl From<&SoftRange> for SoftLimits {
    fn from(range: &SoftRange) -> Self {
        Self { min: range.min(), max: range.max(), step: range.step() }
    }
}

/// What values a parameter takes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum ParameterShape {
    /// A number.
    Real {
        /// Smallest legal.
        min: f64,
        /// Largest legal.
        max: f64,
        /// What it is when nothing is set.
        default: f64,
    },
    /// One of a list.
    Choice {
        /// The list.
        choices: Vec<String>,
        /// Index of what it is when nothing is set.
        default: usize,
    },
    /// Text; only when the plugin is created.
    Text,
    /// A file; only when the plugin is created.
    File,
}

impl Greeting {
    /// Keeps the values in force up to date, for those who come later.
    pub fn keep(&mut self, change: &ChangeMessage) {
        if change.outcome != Outcome::Applied || change.subject != Subject::Parameter {
            return;
        }
        let plugin = self.plugins.iter_mut().find(|plugin| plugin.name == change.plugin);
        let parameters = plugin.into_iter().flat_map(|plugin| &mut plugin.parameters);
        for parameter in parameters.filter(|parameter| parameter.id == change.parameter) {
            parameter.value.clone_from(&change.value);
        }
    }
}

impl PanelPlugin {
    /// Of a schema, with the values in force.
    #[must_use]
    pub fn new(
        name: &str,
        id: &str,
        file: PathBuf,
        schema: &[Parameter],
        values: &[(String, String)],
        soft: &[Option<SoftRange>],
    ) -> Self {
        let value = |id: &str| {
            let known = values.iter().find(|(key, _)| key == id);
            known.map(|(_, value)| value.clone()).unwrap_or_default()
        };
        let parameter = |(index, parameter): (usize, &Parameter)| PanelParameter {
            id: parameter.id().to_owned(),
            unit: parameter.unit().to_owned(),
            doc: parameter.doc().to_owned(),
            shape: ParameterShape::of(parameter),
            live: parameter.mutability() == Mutability::Live,
            value: value(parameter.id()),
            first: value(parameter.id()),
            soft: soft.get(index).and_then(|range| range.as_ref()).map(SoftLimits::from),
        };
        Self {
            name: name.to_owned(),
            id: id.to_owned(),
            file,
            is_simulated: false,
            parameters: schema.iter().enumerate().map(parameter).collect(),
        }
    }
}

impl ParameterShape {
    fn of(parameter: &Parameter) -> Self {
        match parameter.kind() {
            ParameterKind::Real => {
                Self::Real { min: parameter.min(), max: parameter.max(), default: parameter.default() }
            }
            ParameterKind::Choice => Self::Choice {
                choices: parameter.choices().iter().map(|choice| choice.as_str().to_owned()).collect(),
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // an index of the schema's
                default: parameter.default() as usize,
            },
            ParameterKind::Text => Self::Text,
            ParameterKind::File => Self::File,
        }
    }
}

/// Something a client asks for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Number the answer will carry.
    pub number: u64,
    /// What is asked for.
    #[serde(flatten)]
    pub ask: Ask,
}

impl Request {
    /// Reads one. A key that we do not know is a misunderstanding; the emergency stop is followed whatever stands beside it.
    ///
    /// # Errors
    /// Its number, as far as there is one, and what is wrong.
    pub(crate) fn read(json: &[u8]) -> Result<Self, (u64, serde_json::Error)> {
        let said: Value = serde_json::from_slice(json).map_err(|error| (0, error))?;
        let number = said.get("number").and_then(Value::as_u64).unwrap_or(0);
        let read = || {
            let request = Self::deserialize(&said)?;
            let unknown = unknown_key(&said, &serde_json::to_value(&request)?);
            match unknown.filter(|_| !matches!(request.ask, Ask::EmergencyStop | Ask::MachineStop)) {
                Some(key) => Err(serde::de::Error::custom(format!("unknown key `{key}`"))),
                None => Ok(request),
            }
        };
        read().map_err(|error| (number, error))
    }
}

/// A key that was said and not read, wherever it is.
fn unknown_key(said: &Value, read: &Value) -> Option<String> {
    match (said, read) {
        (Value::Object(said), Value::Object(read)) => {
            said.iter().find_map(|(key, said)| match read.get(key) {
                Some(read) => unknown_key(said, read),
                None => Some(key.clone()),
            })
        }
        (Value::Array(said), Value::Array(read)) => {
            said.iter().zip(read).find_map(|(said, read)| unknown_key(said, read))
        }
        _ => None,
    }
}

/// What can be asked for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
pub enum Ask {
    /// Ticks from now on: those whose number is a multiple of `every` (0 counts as 1), with the events of the ones
    /// between them.
    Watch {
        /// Which ticks.
        every: u32,
    },
    /// No more ticks.
    LookAway,
    /// New values for live parameters, all before the same tick.
    Set {
        /// The values.
        values: Vec<SetValue>,
    },
    /// How much of a model is felt, 0 to 1.
    Weight {
        /// Its name in the scene.
        model: String,
        /// The new weight.
        weight: f64,
    },
    /// Hot swap of a model by another plugin, or by the same one rebuilt, faded in while the old one fades out. It is
    /// created before the answer comes.
    Swap {
        /// Its name in the scene.
        model: String,
        /// Id of a plugin, or the whole path of its file; without it the one of the scene, with the scene's settings.
        #[serde(default)]
        plugin: Option<String>,
        /// Parameters set on top, each with its value as a person would type it.
        #[serde(default)]
        settings: Vec<(String, String)>,
    },
    /// An orderly end: force fades out.
    Stop,
    /// The emergency stop: no force at once, and the run is over.
    EmergencyStop,
    /// The emergency stop of another run of the machine: the same, and is not passed on.
    MachineStop,
}

/// A new value for a parameter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetValue {
    /// `device`, a model's name in the scene, or a plugin's id.
    pub plugin: String,
    /// Id of the parameter.
    pub parameter: String,
    /// Its value, as a person would type it.
    pub value: String,
}

/// What became of a request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// The request's number.
    pub number: u64,
    /// Why not, in words; nothing if it was done, or passed on to the loop.
    pub refused: Option<String>,
    /// What is wrong, if it was refused.
    #[serde(default)]
    pub cause: RefusalCause,
}

/// What is wrong with a request that is refused.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RefusalCause {
    /// The request: what it names is not there, or not legal.
    Request,
    /// The plugin it names.
    Plugin,
    /// Something else, such as the moment.
    #[default]
    Other,
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct End {
    /// One line for people.
    pub words: String,
    /// Whether that is as it should be.
    #[serde(default)]
    pub kind: EndKind,
}

/// Whether a run ended as it should.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndKind {
    /// Its time was over, or somebody stopped it.
    #[default]
    InOrder,
    /// A fault, or an emergency stop.
    Failed,
}

/// A parameter that changed, or was to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangeMessage {
    /// The tick before which it changed.
    pub tick: u64,
    /// The time of that tick, ns.
    pub time_ns: u64,
    /// Name of the plugin in the scene.
    pub plugin: String,
    /// What of it.
    pub subject: Subject,
    /// Id of the parameter, or the host's word for what is none.
    pub parameter: String,
    /// The value as a person would type it.
    pub value: String,
    /// The value as a number.
    pub number: f64,
    /// What the plugin made of it.
    pub outcome: Outcome,
    /// If the plugin was replaced, what was set for the new one.
    #[serde(default)]
    pub settings: Vec<(String, String)>,
}

impl ChangeMessage {
    /// True if both are of the same parameter and had the same outcome, whatever the values: of two such messages the later one
    /// says what is in force. A value that was refused says nothing of the one in force.
    #[must_use]
    pub fn is_of_the_same(&self, other: &Self) -> bool {
        let of = |message: &Self| (message.subject, message.outcome);
        of(self) == of(other) && self.parameter == other.parameter && self.plugin == other.plugin
    }
}

/// What of a plugin changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Subject {
    /// A parameter of its schema.
    Parameter,
    /// How much of it is felt.
    Weight,
    /// The plugin itself.
    Plugin,
}

/// How a plugin took a change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// In force from this tick on.
    Applied,
    /// The old value stays.
    Refused,
    /// The plugin panicked over it.
    Broke,
}

impl From<&ChangeMessage> for Change {
    fn from(message: &ChangeMessage) -> Self {
        let ChangeMessage { tick, time_ns, plugin, subject, parameter, value, number, outcome, settings } =
            message.clone();
        let subject = match subject {
            Subject::Parameter => ChangeSubject::Parameter,
            Subject::Weight => ChangeSubject::Weight,
            Subject::Plugin => ChangeSubject::Plugin,
        };
        let outcome = match outcome {
            Outcome::Applied => ChangeOutcome::Applied,
            Outcome::Refused => ChangeOutcome::Refused,
            Outcome::Broke => ChangeOutcome::Broke,
        };
        Self { tick, time_ns, plugin, subject, parameter, value, number, settings, outcome }
    }
}

impl From<&Change> for ChangeMessage {
    fn from(change: &Change) -> Self {
        let Change { tick, time_ns, plugin, subject, parameter, value, number, settings, outcome } =
            change.clone();
        let subject = match subject {
            ChangeSubject::Parameter => Subject::Parameter,
            ChangeSubject::Weight => Subject::Weight,
            ChangeSubject::Plugin => Subject::Plugin,
        };
        let outcome = match outcome {
            ChangeOutcome::Applied => Outcome::Applied,
            ChangeOutcome::Refused => Outcome::Refused,
            ChangeOutcome::Broke => Outcome::Broke,
        };
        Self { tick, time_ns, plugin, subject, parameter, value, number, outcome, settings }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_reads_as_the_book_prints_it() {
        let text =
            r#"{"number":7,"ask":"set","values":[{"plugin":"spring","parameter":"gamma_n","value":"20"}]}"#;
        let request: Request = serde_json::from_str(text).unwrap();
        let Ask::Set { values } = &request.ask else { panic!("{request:?}") };
        assert_eq!((request.number, values[0].parameter.as_str()), (7, "gamma_n"));
        assert_eq!(serde_json::to_string(&request).unwrap(), text);
        let swap: Request = serde_json::from_str(
            r#"{"number":2,"ask":"swap","model":"spring","settings":[["gamma_n","9"]]}"#,
        )
        .unwrap();
        let Ask::Swap { model, plugin, settings } = swap.ask else { panic!("something else was read") };
        assert_eq!((model.as_str(), plugin), ("spring", None));
        assert_eq!(settings, [("gamma_n".to_owned(), "9".to_owned())]);
        assert!(serde_json::from_str::<Request>(r#"{"number":1,"ask":"fly"}"#).is_err());
    }

    #[test]
    fn an_unknown_key_anywhere_is_refused_but_beside_an_emergency_stop() {
        let read = |text: &str| Request::read(text.as_bytes());
        for (text, key) in [
            (r#"{"number":7,"ask":"stop","x":1}"#, "x"),
            (r#"{"number":7,"ask":"look-away","every":1}"#, "every"),
            (r#"{"number":7,"ask":"watch","every":1,"from":3}"#, "from"),
            (
                r#"{"number":7,"ask":"set","values":[{"plugin":"a","parameter":"b","value":"1","tick":5}]}"#,
                "tick",
            ),
            (r#"{"number":7,"ask":"swap","model":"spring","weight":0.5}"#, "weight"),
        ] {
            let (number, error) = read(text).unwrap_err();
            assert_eq!((number, error.to_string()), (7, format!("unknown key `{key}`")), "{text}");
        }
        assert_eq!(read(r#"{"number":3,"ask":"fly"}"#).unwrap_err().0, 3);
        assert_eq!(read("[").unwrap_err().0, 0);
        let known = read(r#"{"number":2,"ask":"swap","model":"spring","settings":[["gamma_n","9"]]}"#);
        assert!(known.is_ok(), "{known:?}");
        let stop = read(r#"{"number":1,"ask":"emergency-stop","why":"later"}"#).unwrap();
        assert_eq!(stop.ask, Ask::EmergencyStop, "a stop too many is safe");
    }

    #[test]
    fn two_changes_are_of_the_same_whatever_their_values() {
        let change = ChangeMessage {
            tick: 1,
            time_ns: 1_000_000,
            plugin: "spring".to_owned(),
            subject: Subject::Parameter,
            parameter: "gamma_n".to_owned(),
            value: "9".to_owned(),
            number: 9.0,
            outcome: Outcome::Applied,
            settings: Vec::new(),
        };
        let later = ChangeMessage {
            tick: 2,
            time_ns: 2_000_000,
            value: "5".to_owned(),
            number: 5.0,
            ..change.clone()
        };
        assert!(change.is_of_the_same(&later) && later.is_of_the_same(&change));
        for other in [
            ChangeMessage { plugin: "load".to_owned(), ..change.clone() },
            ChangeMessage { subject: Subject::Weight, ..change.clone() },
            ChangeMessage { parameter: "turns".to_owned(), ..change.clone() },
            ChangeMessage { outcome: Outcome::Refused, ..change.clone() },
        ] {
            assert!(!change.is_of_the_same(&other), "{other:?}");
        }
    }
}
