//! Questionnaires: own items, and the NASA Task Load Index.

use crate::task::AnswerScale;
use crate::value::Value;
use serde::{Deserialize, Serialize};

/// Questionnaire of a design.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "FormTable", into = "FormTable")]
pub struct Questionnaire {
    /// Place in the session.
    pub at: At,
    /// Title on the screen.
    pub title: String,
    /// Items in order; never empty.
    pub items: Vec<Item>,
}

/// Place of a questionnaire in a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum At {
    /// Before the first trial.
    Start,
    /// After each block.
    AfterBlock,
    /// After the last trial.
    End,
}

/// Item of a questionnaire.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "answer", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Item {
    /// Point on a scale.
    Scale {
        /// Name of the column.
        key: String,
        /// Text on the screen.
        text: String,
        /// The scale.
        scale: AnswerScale,
    },
    /// One of several words.
    Choice {
        /// Name of the column.
        key: String,
        /// Text on the screen.
        text: String,
        /// The words.
        options: Vec<String>,
    },
    /// Number in a range.
    Number {
        /// Name of the column.
        key: String,
        /// Text on the screen.
        text: String,
        /// Smallest number.
        least: f64,
        /// Largest number.
        most: f64,
    },
    /// Free text of one line.
    Text {
        /// Name of the column.
        key: String,
        /// Text on the screen.
        text: String,
    },
}

impl Item {
    /// Returns the name of the column.
    #[must_use]
    pub fn key(&self) -> &str {
        match self {
            Self::Scale { key, .. }
            | Self::Choice { key, .. }
            | Self::Number { key, .. }
            | Self::Text { key, .. } => key,
        }
    }

    /// Returns the text on the screen.
    #[must_use]
    pub fn text(&self) -> &str {
        match self {
            Self::Scale { text, .. }
            | Self::Choice { text, .. }
            | Self::Number { text, .. }
            | Self::Text { text, .. } => text,
        }
    }

    /// Returns true for an answer to this item.
    #[must_use]
    pub fn accepts(&self, answer: &Value) -> bool {
        match (self, answer) {
            (Self::Scale { scale, .. }, Value::Number(point)) => scale.has(*point),
            (Self::Choice { options, .. }, Value::Choice(word)) => options.contains(word),
            (Self::Number { least, most, .. }, Value::Number(number)) => (*least..=*most).contains(number),
            (Self::Text { .. }, Value::Choice(text)) => !text.contains(['\n', '\r', '\t']),
            _ => false,
        }
    }

    /// Describes the defect of an item; `None` for an item that can be answered.
    fn defect(&self) -> Option<String> {
        let key = self.key();
        let is_name = !key.is_empty() && key.chars().all(|one| one.is_ascii_alphanumeric() || one == '_');
        if !is_name {
            return Some(format!("item key `{key}`: write letters, digits and _"));
        }
        let defect = match self {
            Self::Scale { scale, .. } => scale.defect(),
            Self::Choice { options, .. } if options.len() < 2 => {
                Some("a choice needs two or more `options`".to_owned())
            }
            Self::Number { least, most, .. } if least >= most => {
                Some("a number needs `least` below `most`".to_owned())
            }
            _ => None,
        };
        defect.map(|defect| format!("item {key}: {defect}"))
    }
}

/// The six scales of the NASA Task Load Index (Hart and Staveland 1988): key, text, and both ends. From 0 to 100 in steps of 5; the mean
/// of all six is the raw index.
const TLX: [(&str, &str, [&str; 2]); 6] = [
    ("mental_demand", "How mentally demanding was the task?", ["very low", "very high"]),
    ("physical_demand", "How physically demanding was the task?", ["very low", "very high"]),
    ("temporal_demand", "How hurried or rushed was the pace of the task?", ["very low", "very high"]),
    (
        "performance",
        "How successful were you in accomplishing what you were asked to do?",
        ["perfect", "failure"],
    ),
    (
        "effort",
        "How hard did you have to work to accomplish your level of performance?",
        ["very low", "very high"],
    ),
    (
        "frustration",
        "How insecure, discouraged, irritated, stressed and annoyed were you?",
        ["very low", "very high"],
    ),
];

/// Returns the items of the NASA Task Load Index; `texts` replaces the English texts, in the order of the form.
fn task_load_index(texts: &[String]) -> Vec<Item> {
    let item = |(index, (key, text, [low, high])): (usize, (&str, &str, [&str; 2]))| Item::Scale {
        key: key.to_owned(),
        text: texts.get(index).cloned().unwrap_or_else(|| text.to_owned()),
        scale: AnswerScale { least: 0.0, most: 100.0, step: 5.0, low: low.to_owned(), high: high.to_owned() },
    };
    TLX.into_iter().enumerate().map(item).collect()
}

/// Table of a questionnaire in a study file.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FormTable {
    at: At,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    title: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    form: Option<StandardForm>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    texts: Vec<String>,
    #[serde(default, rename = "item", skip_serializing_if = "Vec::is_empty")]
    items: Vec<Item>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum StandardForm {
    NasaTlx,
}

impl TryFrom<FormTable> for Questionnaire {
    type Error = String;

    fn try_from(table: FormTable) -> Result<Self, String> {
        let FormTable { at, title, form, texts, mut items } = table;
        match form {
            Some(StandardForm::NasaTlx) if texts.is_empty() || texts.len() == TLX.len() => {
                items = task_load_index(&texts).into_iter().chain(items).collect();
            }
            Some(StandardForm::NasaTlx) => {
                let count = texts.len();
                return Err(format!(
                    "questionnaire: {count} texts for the {} scales of nasa-tlx; write one for each",
                    TLX.len()
                ));
            }
            None if texts.is_empty() => {}
            None => {
                return Err(
                    "questionnaire: `texts` belong to a `form`; write the text of an own item in the item"
                        .to_owned(),
                );
            }
        }
        if items.is_empty() {
            return Err(
                "questionnaire: no items; write `form = \"nasa-tlx\"` or a table [[questionnaire.item]]"
                    .to_owned(),
            );
        }
        if let Some(defect) = items.iter().find_map(Item::defect) {
            return Err(format!("questionnaire: {defect}"));
        }
        let twice = items
            .iter()
            .enumerate()
            .find(|(index, item)| items.iter().take(*index).any(|earlier| earlier.key() == item.key()));
        if let Some((_, item)) = twice {
            return Err(format!("questionnaire: two items have the key `{}`; rename one", item.key()));
        }
        Ok(Self { at, title, items })
    }
}

impl From<Questionnaire> for FormTable {
    fn from(Questionnaire { at, title, items }: Questionnaire) -> Self {
        Self { at, title, form: None, texts: Vec::new(), items }
    }
}
