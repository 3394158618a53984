//! What a sitting and a window that is another program say to each other, one line of JSON each.

use super::{Input, Screen};
use serde::{Deserialize, Serialize};

/// A line for a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Told {
    /// What is shown from now on.
    Screen(Screen),
    /// To be seen and heard at once; the screen stays.
    Warning {
        /// Of what.
        warning: Warning,
    },
    /// An input was not taken; the screen stays.
    Refused {
        /// Why.
        refused: String,
    },
}

/// What a person has to be warned of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Warning {
    /// The handle was pushed out of its range.
    OutOfRange,
}

/// A line from a window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Said {
    /// What the person does.
    Input(Input),
    /// How the window stands; not needed by who has none.
    Window {
        /// Its state.
        window: WindowState,
    },
}

/// How a window stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WindowState {
    /// In front of the person.
    Open,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scripts rely on these lines.
    #[test]
    fn lines_are_what_they_say() {
        let lines = [
            (Told::Screen(Screen::Over), r#"{"screen":"over"}"#),
            (Told::Warning { warning: Warning::OutOfRange }, r#"{"warning":"out-of-range"}"#),
            (
                Told::Refused { refused: "an answer is expected".to_owned() },
                r#"{"refused":"an answer is expected"}"#,
            ),
        ];
        for (told, line) in lines {
            assert_eq!(serde_json::to_string(&told).unwrap(), line);
            assert_eq!(serde_json::from_str::<Told>(line).unwrap(), told);
        }
        let said = [
            (Said::Input(Input::Continue), r#"{"input":"continue"}"#),
            (Said::Window { window: WindowState::Open }, r#"{"window":"open"}"#),
        ];
        for (said, line) in said {
            assert_eq!(serde_json::to_string(&said).unwrap(), line);
            assert_eq!(serde_json::from_str::<Said>(line).unwrap(), said);
        }
    }
}
