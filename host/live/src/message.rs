//! JSON messages of the live protocol.

use flotor_core::{Change, ChangeOutcome, ChangeSubject};
use flotor_hal::{Mutability, Parameter, ParameterKind, SoftRange};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::PathBuf;

/// First message of a host: plugins with their parameters, and limits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Greeting {
    /// Version of the protocol: [`crate::PROTOCOL`].
    pub protocol: u32,
    /// Version of the host.
    pub flotor_version: String,
    /// Process id of the host, as users see it.
    pub process: u32,
    /// Title of the scene.
    pub title: String,
    /// The devices, then the models, both in the scene's order.
    pub plugins: Vec<PanelPlugin>,
    /// Largest force and torque that may reach the hand at any device.
    pub limits: WrenchLimits,
}

/// Largest force and torque that may reach the hand, along and about each axis of the device frame, and as norms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WrenchLimits {
    /// Largest force along each axis, N; `None`: no limit.
    pub force_n: [Option<f64>; 3],
    /// Largest torque about each axis, N·m; `None`: no limit.
    pub torque_nm: [Option<f64>; 3],
    /// Largest norm of the force, N; `None`: no limit.
    #[serde(default)]
    pub force_norm_n: Option<f64>,
    /// Largest norm of the torque, N·m; `None`: no limit.
    #[serde(default)]
    pub torque_norm_nm: Option<f64>,
}

/// Plugin of the run with its parameters, as shown in a client's panel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelPlugin {
    /// Name in the scene; `device` for a single device without a name.
    pub name: String,
    /// Id of the plugin.
    pub id: String,
    /// Path of the plugin's shared library.
    pub file: PathBuf,
    /// True for a simulated device, whose force reaches no person.
    #[serde(default)]
    pub is_simulated: bool,
    /// Parameters in the order of the plugin's schema.
    pub parameters: Vec<PanelParameter>,
}

/// Parameter of a plugin with its present value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelParameter {
    /// Id of the parameter.
    pub id: String,
    /// Unit, human-readable; empty for a parameter without a unit.
    pub unit: String,
    /// Human-readable description, one sentence.
    pub doc: String,
    /// Type and range of the values.
    pub shape: ParameterShape,
    /// True if the parameter may change while the loop runs.
    pub live: bool,
    /// Present value, as a person would type it.
    pub value: String,
    /// Value at the start of the run, as a person would type it; empty if unknown.
    #[serde(default)]
    pub first: String,
    /// Range of a slider; `None`: no range.
    #[serde(default)]
    pub soft: Option<SoftLimits>,
}

/// Range of a slider for a number, in the parameter's unit; values beyond this range have to be typed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SoftLimits {
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Change per key press.
    pub step: f64,
}

impl From<&SoftRange> for SoftLimits {
    fn from(range: &SoftRange) -> Self {
        Self { min: range.min(), max: range.max(), step: range.step() }
    }
}

/// Type and range of a parameter's values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum ParameterShape {
    /// A number, in the parameter's unit.
    Real {
        /// Smallest valid value.
        min: f64,
        /// Largest valid value.
        max: f64,
        /// Default value.
        default: f64,
    },
    /// One of a list of choices.
    Choice {
        /// Names of the choices.
        choices: Vec<String>,
        /// Index of the default choice.
        default: usize,
    },
    /// Text; can be set only when the plugin is created.
    Text,
    /// Path of a file, or name of a built-in file; can be set only when the plugin is created.
    File,
}

impl Greeting {
    /// Updates the present value of a parameter after an applied change, for clients that connect later; ignores other changes.
    pub fn keep(&mut self, change: &Change) {
        if change.outcome != ChangeOutcome::Applied || change.subject != ChangeSubject::Parameter {
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
    /// Creates the description from a schema: `values` are present values by parameter id, which are also the initial values;
    /// `soft` are slider ranges, in the order of the schema. `is_simulated` is false.
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

/// Request of a client.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Number chosen by the client, which the answer repeats.
    pub number: u64,
    /// Requested action.
    #[serde(flatten)]
    pub ask: Ask,
}

impl Request {
    /// Parses a request. An unknown key is an error, except in a request for an emergency stop.
    ///
    /// # Errors
    /// Number of the request (0 if it has none) and error of the parser.
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

/// Returns a JSON key that deserialisation has ignored; `None` if there is none.
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

/// Action that a client requests.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "ask", rename_all = "kebab-case")]
pub enum Ask {
    /// Send the ticks with an index that is a multiple of `every` (0 counts as 1), each with the events of the skipped ticks before.
    Watch {
        /// Interval of the sent ticks, in ticks.
        every: u32,
    },
    /// Send no more ticks.
    #[serde(rename = "look-away")]
    Unwatch,
    /// Set new values of live parameters, all before the same tick.
    Set {
        /// New values.
        values: Vec<SetValue>,
    },
    /// Set the blend weight of a model, 0 to 1.
    Weight {
        /// Name of the model in the scene.
        model: String,
        /// New weight, 0 to 1.
        weight: f64,
    },
    /// Replace a model with another plugin, or with the same plugin after a rebuild (hot swap): the new model fades in while the
    /// old model fades out. The answer is sent after the new model has been created.
    Swap {
        /// Name of the model in the scene.
        model: String,
        /// Id of a plugin, or the absolute path of its file; `None`: the plugin of the scene, with the scene's settings.
        #[serde(default)]
        plugin: Option<String>,
        /// Additional parameters, id and value as a person would type it.
        #[serde(default)]
        settings: Vec<(String, String)>,
    },
    /// End the run in order: the force fades out.
    Stop,
    /// Emergency stop: remove the force at once, and end the run.
    EmergencyStop,
    /// Emergency stop because of another run of the machine: as [`Ask::EmergencyStop`], but not forwarded to other runs.
    MachineStop,
}

/// New value of a parameter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SetValue {
    /// Name of a device or model in the scene (`device` for a single device without a name), or id of a plugin.
    pub plugin: String,
    /// Id of the parameter.
    pub parameter: String,
    /// Value, as a person would type it.
    pub value: String,
}

/// Result of a request.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Answer {
    /// Number of the request.
    pub number: u64,
    /// Human-readable reason for a rejection; `None` if the request was executed, or forwarded to the loop.
    pub refused: Option<String>,
    /// Kind of reason, if the request was rejected; otherwise without meaning.
    #[serde(default)]
    pub cause: RefusalCause,
}

/// Kind of reason for a rejected request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RefusalCause {
    /// The request is wrong: it has an unknown name, or an invalid value.
    Request,
    /// The plugin named in the request has failed or rejected the request.
    Plugin,
    /// Another reason, such as the state of the run.
    #[default]
    Other,
}

/// Message with the outcome of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct End {
    /// Human-readable outcome, one line.
    pub words: String,
    /// Kind of outcome.
    #[serde(default)]
    pub kind: EndKind,
}

/// Kind of outcome of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EndKind {
    /// The run reached its duration, or was stopped.
    #[default]
    InOrder,
    /// The run ended otherwise, such as by a fault, an emergency stop or the watchdog.
    Failed,
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
}
