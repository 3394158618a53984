//! Built-in worlds.

use flotor_hal::{Choices, choices};

/// Names of the worlds, for the parameter `file`.
pub(crate) const NAMES: Choices = choices!["stack", "drawer"];

/// Returns the text of a built-in world.
#[must_use]
pub fn text(name: &str) -> Option<&'static str> {
    match name {
        "stack" => Some(include_str!("../worlds/stack.toml")),
        "drawer" => Some(include_str!("../worlds/drawer.toml")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_a_world_that_is_right() {
        for name in NAMES.as_slice() {
            let text = text(name.as_str()).expect("it has a text");
            assert!(crate::file::parse(text).is_ok(), "{}", name.as_str());
        }
    }
}
