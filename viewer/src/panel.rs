//! Panel for the parameters of a plugin, generated from the schema, so that any plugin has a panel.
//!
//! The plugin decides which parameters follow from others (the spring's rigidity follows from its physical
//! parameters, or the other way round, by its `mode`). The panel tests a separate instance: a parameter that refuses
//! its own value follows from others, or has no effect. Such a parameter is shown and updated, but is not editable.

use crate::guide::is_for_guides;
use crate::shape::Shape;
use flotor_live::{ChangeMessage, Outcome, PanelParameter, PanelPlugin, ParameterShape, SetValue, Subject};

/// Value of a parameter in a panel.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A number in the parameter's unit.
    Number(f64),
    /// Index of a choice.
    Choice(usize),
    /// Text, or a value that cannot be parsed as a number or choice.
    Words(String),
}

/// Editability of a parameter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Editability {
    /// Editable.
    Free,
    /// Not editable: follows from other parameters, or has no effect with them; with the plugin's message.
    Follows(String),
    /// Not editable: set only when the plugin is created, or part of a recording or of a run that is over.
    Fixed,
}

/// Parameter in a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct PanelEntry {
    /// Entry in the schema.
    pub parameter: PanelParameter,
    /// Display name: the id without its unit, in words; with the unit if another parameter of the panel has the same name.
    pub name: String,
    /// Displayed value.
    pub value: Value,
    /// Permission to edit the parameter, or the reason against edits.
    pub editability: Editability,
    /// Current value in the loop.
    in_force: Value,
    /// Requested value that is not in force yet: the loop moves a number gradually.
    wanted: Option<Value>,
}

/// Use of a panel: for changing values, or only for reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PanelPurpose {
    /// Changing values of a running host.
    Change,
    /// Reading values of a recording, or of a run that is over.
    Read,
}

/// Panel of one plugin.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Name of the plugin in the scene.
    pub name: String,
    /// Id of the plugin.
    pub id: String,
    /// Parameters in the order of the schema.
    pub entries: Vec<PanelEntry>,
    /// Reason for the failure of a change; `None` once a change was applied.
    pub refusal: Option<String>,
    /// Undo history: index of the parameter and its value before each change of the user.
    earlier: Vec<(usize, Value)>,
}

impl Panel {
    /// Creates a panel from the description of a plugin, by a running host or for a recording; leaves out parameters that guide a
    /// hand.
    #[must_use]
    pub fn new(plugin: &PanelPlugin, purpose: PanelPurpose) -> Self {
        // Guidance parameters are left out: a hand is guided in the 3D view.
        let shown = || plugin.parameters.iter().filter(|parameter| !is_for_guides(plugin, &parameter.id));
        let plain: Vec<String> = shown().map(plain_name).collect();
        let may_change = purpose == PanelPurpose::Change;
        let entry = |(parameter, name): (&PanelParameter, &String)| PanelEntry {
            name: if plain.iter().filter(|other| *other == name).count() > 1 {
                format!("{name} ({})", parameter.unit)
            } else {
                name.clone()
            },
            value: Value::read(parameter, &parameter.value),
            in_force: Value::read(parameter, &parameter.value),
            editability: if parameter.live && may_change { Editability::Free } else { Editability::Fixed },
            parameter: parameter.clone(),
            wanted: None,
        };
        Self {
            name: plugin.name.clone(),
            id: plugin.id.clone(),
            entries: shown().zip(&plain).map(entry).collect(),
            refusal: None,
            earlier: Vec::new(),
        }
    }

    /// Applies the outcome of a change: displays the value in force, or the reason for the rejection. Ignores other plugins.
    pub fn apply(&mut self, change: &ChangeMessage) {
        if change.plugin != self.name || change.subject != Subject::Parameter {
            return;
        }
        let Some(entry) = self.entries.iter_mut().find(|entry| entry.parameter.id == change.parameter) else {
            return;
        };
        match change.outcome {
            Outcome::Applied => {
                entry.settle(Value::read(&entry.parameter, &change.value));
                self.refusal = None;
            }
            Outcome::Refused => {
                entry.give_up();
                let name = &entry.name;
                self.refusal = Some(format!(
                    "{name} = {} does not fit the other values, so the model keeps its value",
                    change.value
                ));
            }
            Outcome::Broke => {
                self.refusal = Some(format!("{} caused an error of the plugin; stop the run", entry.name))
            }
        }
    }

    /// Updates editability and dependent numbers from an instance with the same settings.
    pub fn follow(&mut self, shape: &mut Shape) {
        for (index, entry) in self.entries.iter_mut().enumerate() {
            if entry.editability == Editability::Fixed
                || !matches!(entry.parameter.shape, ParameterShape::Real { .. })
            {
                continue;
            }
            match shape.accepts_its_own(index) {
                Ok(()) => entry.editability = Editability::Free,
                Err(reason) => {
                    entry.editability = Editability::Follows(reason);
                    if let Some(number) = shape.parameter(index) {
                        entry.value = Value::Number(number);
                    }
                }
            }
        }
    }

    /// Makes all parameters read-only, at the end of the run.
    pub fn freeze(&mut self) {
        self.entries.iter_mut().for_each(|entry| entry.editability = Editability::Fixed);
    }

    /// Discards all requested values that are not in force yet, and displays the values in force.
    pub fn take_back(&mut self) {
        self.entries.iter_mut().filter(|entry| entry.wanted.is_some()).for_each(PanelEntry::give_up);
    }

    /// Stores the value of a parameter before a change of the user, for undo; at most the last hundred changes.
    pub fn begin(&mut self, index: usize, before: Value) {
        const MOST: usize = 100;
        if self.earlier.len() == MOST {
            self.earlier.remove(0);
        }
        self.earlier.push((index, before));
    }

    /// Returns whether there is a change to undo.
    #[must_use]
    pub fn can_undo(&self) -> bool {
        !self.earlier.is_empty()
    }

    /// Restores the displayed value before the last change; returns the index of its parameter, to be sent. `None` without a change,
    /// or if the parameter is no longer editable.
    pub fn undo(&mut self) -> Option<usize> {
        let (index, before) = self.earlier.pop()?;
        let entry = self.entries.get_mut(index).filter(|entry| entry.editability == Editability::Free)?;
        entry.value = before;
        Some(index)
    }

    /// Displays the initial value of a parameter; returns true if the displayed value has changed and must be sent.
    pub fn reset(&mut self, index: usize) -> bool {
        let Some(entry) = self.entries.get(index).filter(|entry| entry.is_moved()) else { return false };
        let (before, first) = (entry.value.clone(), Value::read(&entry.parameter, &entry.parameter.first));
        self.begin(index, before);
        self.entries[index].value = first;
        true
    }

    /// Marks the displayed value of a parameter as requested; returns the change to send, `None` for an unknown index.
    pub fn change(&mut self, index: usize) -> Option<SetValue> {
        let entry = self.entries.get_mut(index)?;
        entry.wanted = Some(entry.value.clone());
        Some(SetValue {
            plugin: self.name.clone(),
            parameter: entry.parameter.id.clone(),
            value: entry.typed(),
        })
    }
}

impl PanelEntry {
    /// Sets the value in force. A requested value stays displayed while the loop approaches it, but not if the loop moves away from it.
    fn settle(&mut self, now: Value) {
        if let Some(wanted) = &self.wanted
            && (wanted.is_about(&now) || wanted.distance(&now) > wanted.distance(&self.in_force))
        {
            self.wanted = None;
        }
        self.in_force = now;
        self.value = self.wanted.clone().unwrap_or_else(|| self.in_force.clone());
    }

    /// Discards the requested value and displays the value in force.
    fn give_up(&mut self) {
        self.wanted = None;
        self.value = self.in_force.clone();
    }

    /// Returns whether the parameter is editable and its displayed value differs from its initial value.
    #[must_use]
    pub fn is_moved(&self) -> bool {
        let first = &self.parameter.first;
        self.editability == Editability::Free
            && !first.is_empty()
            && !Value::read(&self.parameter, first).is_about(&self.value)
    }

    /// Returns the unit for display; empty for a dimensionless number.
    #[must_use]
    pub fn unit(&self) -> &str {
        if self.parameter.unit == "1" { "" } else { &self.parameter.unit }
    }

    /// Returns the displayed value as a user would type it.
    #[must_use]
    pub fn typed(&self) -> String {
        match (&self.value, &self.parameter.shape) {
            (Value::Number(number), _) => number.to_string(),
            (Value::Choice(index), ParameterShape::Choice { choices, .. }) => {
                choices.get(*index).cloned().unwrap_or_default()
            }
            (Value::Choice(index), _) => index.to_string(),
            (Value::Words(words), _) => words.clone(),
        }
    }
}

/// Returns the id of a parameter without its unit, in words.
fn plain_name(parameter: &PanelParameter) -> String {
    let plain = |text: &str| {
        let text = text.replace('²', "2").replace('³', "3").to_lowercase();
        text.chars().filter(char::is_ascii_alphanumeric).collect::<String>()
    };
    let (id, unit) = (&parameter.id, plain(&parameter.unit));
    let cut = id.char_indices().filter(|(_, c)| *c == '_').map(|(at, _)| at);
    let named = cut.into_iter().find(|at| {
        let end = plain(&id[*at..]);
        !unit.is_empty() && (end == unit || end.replace("per", "") == unit)
    });
    id[..named.unwrap_or(id.len())].replace('_', " ")
}

impl Value {
    /// Returns whether both values are equal up to the rounding of a text.
    fn is_about(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Number(one), Self::Number(two)) => (one - two).abs() <= 1.0e-9 * one.abs().max(two.abs()),
            _ => self == other,
        }
    }

    /// Returns the distance of two numbers, in their unit; 0 for other values.
    fn distance(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::Number(one), Self::Number(two)) => (one - two).abs(),
            _ => 0.0,
        }
    }

    fn read(parameter: &PanelParameter, typed: &str) -> Self {
        let read = match &parameter.shape {
            ParameterShape::Real { .. } => typed.parse().ok().map(Self::Number),
            ParameterShape::Choice { choices, .. } => {
                choices.iter().position(|choice| choice == typed).map(Self::Choice)
            }
            ParameterShape::Text | ParameterShape::File => None,
        };
        read.unwrap_or_else(|| Self::Words(typed.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameter(id: &str, unit: &str) -> PanelParameter {
        PanelParameter {
            id: id.to_owned(),
            unit: unit.to_owned(),
            doc: "A number".to_owned(),
            shape: ParameterShape::Real { min: 0.0, max: 10.0, default: 1.0 },
            live: true,
            value: "2.5".to_owned(),
            first: "2.5".to_owned(),
            soft: None,
        }
    }

    fn plugin(parameters: Vec<PanelParameter>) -> PanelPlugin {
        let (name, id) = ("s".to_owned(), "spring".to_owned());
        PanelPlugin { name, id, file: "".into(), is_simulated: false, parameters }
    }

    #[test]
    fn names_leave_out_the_unit() {
        for (id, unit, name) in [
            ("free_length_mm", "mm", "free length"),
            ("gamma_n", "N", "gamma"),
            ("alpha_n_mm2", "N mm²", "alpha"),
            ("alpha_n_mm2", "N mm2", "alpha"),
            ("stiffness_n_per_m", "N/m", "stiffness"),
            ("wall_damping_ns_per_m", "N s/m", "wall damping"),
            ("seat_friction", "1", "seat friction"),
            ("preset", "", "preset"),
        ] {
            assert_eq!(plain_name(&parameter(id, unit)), name);
        }
    }

    #[test]
    fn two_of_one_name_are_distinguished_by_their_units() {
        let twins = [("damping_ns_per_m", "N s/m"), ("hand", ""), ("damping_nms_per_rad", "N m s/rad")];
        let panel =
            Panel::new(&plugin(twins.map(|(id, unit)| parameter(id, unit)).into()), PanelPurpose::Change);
        let names: Vec<&str> = panel.entries.iter().map(|entry| entry.name.as_str()).collect();
        assert_eq!(names, ["damping (N s/m)", "hand", "damping (N m s/rad)"]);
    }

    #[test]
    fn a_change_is_taken_in_and_a_refused_one_is_said() {
        let plugin = plugin(vec![parameter("gamma_n", "N")]);
        let mut panel = Panel::new(&plugin, PanelPurpose::Change);
        let change = |value: &str, outcome| ChangeMessage {
            tick: 1,
            time_ns: 1,
            plugin: "s".to_owned(),
            subject: Subject::Parameter,
            parameter: "gamma_n".to_owned(),
            value: value.to_owned(),
            number: 0.0,
            outcome,
            settings: Vec::new(),
        };
        panel.apply(&change("4", Outcome::Applied));
        assert_eq!(panel.entries[0].value, Value::Number(4.0));
        panel.entries[0].value = Value::Number(9.0);
        assert_eq!(panel.change(0).map(|set| set.value), Some("9".to_owned()));
        panel.apply(&change("5", Outcome::Applied));
        assert_eq!(panel.entries[0].value, Value::Number(9.0), "the loop is on its way");
        panel.apply(&change("9", Outcome::Refused));
        assert_eq!(panel.entries[0].value, Value::Number(5.0), "as far as it came");
        assert!(panel.refusal.is_some_and(|reason| reason.contains("gamma = 9")));
        assert_eq!(Panel::new(&plugin, PanelPurpose::Read).entries[0].editability, Editability::Fixed);
    }
}
