//! Settings of a scene and the values that they take in a design.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Value of a setting.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// Number, in the unit of the setting.
    Number(f64),
    /// Word of a choice, such as `free`.
    Choice(String),
}

impl Value {
    /// Returns the number; `None` for a choice.
    #[must_use]
    pub fn number(&self) -> Option<f64> {
        if let Self::Number(number) = self { Some(*number) } else { None }
    }

    /// Returns true for a finite number or a word that is not empty.
    pub(crate) fn is_usable(&self) -> bool {
        match self {
            Self::Number(number) => number.is_finite(),
            Self::Choice(word) => !word.is_empty(),
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Choice(word) => f.write_str(word),
        }
    }
}

/// Setting that a study changes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Setting {
    /// Presence of the picture on the subject's screen: [`Setting::SHOWN`] or [`Setting::HIDDEN`].
    Picture,
    /// Setting of the scene.
    Scene {
        /// Name of the model or device in the scene, or the name of another table of the scene.
        part: String,
        /// Key of the setting.
        key: String,
    },
}

impl Setting {
    /// Name of the picture's setting in a study file.
    pub const PICTURE: &str = "picture";
    /// Value of the picture's setting: the object is drawn.
    pub const SHOWN: &str = "shown";
    /// Value of the picture's setting: the object is not drawn.
    pub const HIDDEN: &str = "hidden";
}

impl TryFrom<String> for Setting {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        if text == Self::PICTURE {
            return Ok(Self::Picture);
        }
        let parts = text.split_once('.').filter(|(part, key)| !part.is_empty() && !key.is_empty());
        let (part, key) = parts.ok_or_else(|| {
            format!(
                "`{text}` is not a setting; write PART.KEY of the scene, like spring.gamma_n, or `picture`"
            )
        })?;
        Ok(Self::Scene { part: part.to_owned(), key: key.to_owned() })
    }
}

impl From<Setting> for String {
    fn from(setting: Setting) -> Self {
        setting.to_string()
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Picture => f.write_str(Self::PICTURE),
            Self::Scene { part, key } => write!(f, "{part}.{key}"),
        }
    }
}
