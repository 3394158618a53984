//! Validation of a plugin's parameter schema: counts and texts come from a foreign library and are checked before use.

use super::static_list;
use crate::Parameter;
use crate::abi::{Choices, Str};

/// Maximum number of parameters of a plugin, and of choices of a parameter.
const MOST_ENTRIES: usize = 4096;
/// Maximum length of a text, bytes.
const MOST_BYTES: usize = 64 * 1024;

/// Returns the schema of a table, or the problem if a count or a text is invalid.
///
/// # Safety
/// `parameters` is null or the address of `count` parameters that stay for ever, as far as `count` is legal.
pub(super) unsafe fn checked(
    parameters: *const Parameter,
    count: u32,
) -> Result<&'static [Parameter], String> {
    if !parameters.is_null() && count as usize > MOST_ENTRIES {
        return Err(format!("the plugin has {count} parameters, above the limit of {MOST_ENTRIES}"));
    }
    // SAFETY: as this function demands.
    let schema = unsafe { static_list(parameters, count) };
    schema.iter().enumerate().try_for_each(|(number, parameter)| check(number, parameter))?;
    Ok(schema)
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
    if choices.count() > MOST_ENTRIES {
        return Err(format!(
            "the parameter has {} choices, above the limit of {MOST_ENTRIES}",
            choices.count()
        ));
    }
    choices.as_slice().iter().try_for_each(|choice| check_text("choice", choice))
}

/// Checks a text for display: length, UTF-8, and no control characters except line breaks.
pub(super) fn check_text(name: &str, text: &Str) -> Result<(), String> {
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
        // SAFETY: it is refused before it is read.
        let refused = unsafe { checked(&raw const one, 1_000_000) };
        assert_eq!(
            refused.err(),
            Some("the plugin has 1000000 parameters, above the limit of 4096".to_owned())
        );
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
