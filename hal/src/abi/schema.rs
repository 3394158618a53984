//! Validation of a plugin's parameter schema: counts and texts come from a foreign library and are checked before use.

use super::{Choices, Str};
use crate::Parameter;

/// Maximum number of choices of a parameter.
const MOST_CHOICES: usize = 4096;
/// Maximum length of a text, bytes.
const MOST_BYTES: usize = 64 * 1024;

/// Checks the schema of a foreign plugin, before use.
///
/// # Errors
/// The number of the first malformed parameter, counted from 0, and what is wrong with it.
pub fn check_schema(schema: &[Parameter]) -> Result<(), String> {
    schema.iter().enumerate().try_for_each(|(number, parameter)| check(number, parameter))
}

fn check(number: usize, parameter: &Parameter) -> Result<(), String> {
    let wrong = |what: String| format!("parameter {number}: {what}");
    let Parameter { id, unit, doc, choices, .. } = parameter;
    for (name, text) in [("id", id), ("unit", unit), ("doc", doc)] {
        check_text(name, text).map_err(wrong)?;
    }
    check_choices(choices).map_err(wrong)
}

fn check_choices(choices: &Choices) -> Result<(), String> {
    if choices.count() > MOST_CHOICES {
        return Err(format!(
            "the parameter has {} choices, above the limit of {MOST_CHOICES}",
            choices.count()
        ));
    }
    choices.as_slice().iter().try_for_each(|choice| check_text("choice", choice))
}

/// Checks a text for display: length, UTF-8, and no control characters except line breaks.
fn check_text(name: &str, text: &Str) -> Result<(), String> {
    let bytes = text.bytes();
    if bytes > MOST_BYTES {
        return Err(format!("`{name}` has {bytes} bytes, above the limit of {MOST_BYTES}"));
    }
    if text.as_str().len() != bytes {
        return Err(format!("`{name}` is not UTF-8"));
    }
    match text.as_str().chars().find(|character| character.is_control() && *character != '\n') {
        Some(control) => Err(format!("`{name}` contains the control character {}", control.escape_default())),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(parameter: &Parameter) -> String {
        check(0, parameter).expect_err("it is wrong")
    }

    const HONEST: Parameter = Parameter::real("stiffness_n_per_m", "N/m", 0.0, 1.0, 0.5, "Stiffness");

    #[test]
    fn counts_that_cannot_be_are_refused_before_anything_is_read() {
        let one = HONEST;
        let choices = Choices::of_raw(&raw const one.id, 1 << 50);
        let said = told(&Parameter { choices, ..HONEST });
        assert_eq!(said, "parameter 0: the parameter has 1125899906842624 choices, above the limit of 4096");
        let doc = Str::of_raw(b"x".as_ptr(), 1 << 40);
        assert_eq!(
            told(&Parameter { doc, ..HONEST }),
            "parameter 0: `doc` has 1099511627776 bytes, above the limit of 65536"
        );
    }

    #[test]
    fn texts_that_no_terminal_should_get_are_refused() {
        assert_eq!(check(0, &HONEST), Ok(()));
        let unit = Str::of_raw(b"\xff".as_ptr(), 1);
        assert_eq!(told(&Parameter { unit, ..HONEST }), "parameter 0: `unit` is not UTF-8");
        let doc = Str::new("\x1b[2J");
        let said = told(&Parameter { doc, ..HONEST });
        assert_eq!(said, "parameter 0: `doc` contains the control character \\u{1b}");
    }
}
