//! Messages between a sitting and the separate window program, one line of JSON each.

use super::{Input, Screen};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Message to the window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum WindowMessage {
    /// New screen.
    Screen(Screen),
    /// Warning to show at once, visibly and audibly; the screen does not change.
    Warning {
        /// Kind of warning.
        warning: Warning,
    },
    /// Input rejected; the screen does not change.
    Refused {
        /// Reason for the rejection.
        refused: String,
    },
}

/// Kind of warning to a person.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Warning {
    /// The handle was pushed out of its range.
    OutOfRange,
}

/// Message from the window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum WindowReply {
    /// Input of the person.
    Input(Input),
    /// State of the window; not sent by front ends without one.
    Window {
        /// State of the window.
        window: WindowState,
    },
}

impl WindowReply {
    /// Parses a line from the window.
    ///
    /// # Errors
    /// The syntax error, as text.
    pub fn read(line: &str) -> Result<Self, String> {
        let value: Value =
            serde_json::from_str(line).map_err(|error| format!("the line is not JSON: {error}"))?;
        let wrong = |error: serde_json::Error| error.to_string();
        match (value.get("input"), value.get("window")) {
            (Some(_), _) => serde_json::from_value(value).map(Self::Input).map_err(wrong),
            (None, Some(window)) => {
                serde_json::from_value(window.clone()).map(|window| Self::Window { window }).map_err(wrong)
            }
            (None, None) => {
                Err("the line has neither `input` nor `window`, like {\"input\":\"continue\"}".to_owned())
            }
        }
    }
}

/// State of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WindowState {
    /// The window is visible to the person.
    Open,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Scripts rely on these lines.
    #[test]
    fn lines_are_what_they_say() {
        let lines = [
            (WindowMessage::Screen(Screen::Over), r#"{"screen":"over"}"#),
            (WindowMessage::Warning { warning: Warning::OutOfRange }, r#"{"warning":"out-of-range"}"#),
            (
                WindowMessage::Refused { refused: "give an answer first".to_owned() },
                r#"{"refused":"give an answer first"}"#,
            ),
        ];
        for (message, line) in lines {
            assert_eq!(serde_json::to_string(&message).unwrap(), line);
            assert_eq!(serde_json::from_str::<WindowMessage>(line).unwrap(), message);
        }
        let said = [
            (WindowReply::Input(Input::Continue), r#"{"input":"continue"}"#),
            (WindowReply::Window { window: WindowState::Open }, r#"{"window":"open"}"#),
        ];
        for (said, line) in said {
            assert_eq!(serde_json::to_string(&said).unwrap(), line);
            assert_eq!(serde_json::from_str::<WindowReply>(line).unwrap(), said);
            assert_eq!(WindowReply::read(line), Ok(said));
        }
    }

    #[test]
    fn a_wrong_line_is_named_in_words() {
        for (line, reason) in [
            ("continue", "the line is not JSON: "),
            ("{\"key\":\"1\"}", "the line has neither `input` nor `window`"),
            ("[1]", "the line has neither `input` nor `window`"),
            ("{\"input\":\"contine\"}", "unknown variant `contine`, expected one of `continue`"),
            ("{\"input\":\"answer\"}", "missing field `response`"),
            ("{\"window\":\"shut\"}", "unknown variant `shut`, expected `open`"),
        ] {
            let error = WindowReply::read(line).expect_err(line);
            assert!(error.starts_with(reason) && !error.contains("untagged"), "{line}: {error}");
        }
    }
}
