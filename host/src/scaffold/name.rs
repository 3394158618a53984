//! Name of a new plugin: checked once, then converted to id, symbol, type name and title.

/// Names reserved by cargo or the compiler (Rust reference, "Keywords"; `cargo new` rejects the rest).
const TAKEN: [&str; 47] = [
    "abstract", "as", "async", "await", "become", "box", "break", "const", "continue", "crate", "do", "dyn",
    "else", "enum", "extern", "false", "final", "fn", "for", "gen", "if", "impl", "in", "let", "loop",
    "macro", "match", "mod", "move", "mut", "override", "priv", "pub", "ref", "return", "self", "static",
    "struct", "super", "trait", "true", "try", "type", "unsafe", "use", "where", "while",
];
/// Names of crates in every build, and of folders that cargo creates.
const CRATES: [&str; 7] = ["alloc", "core", "proc-macro", "std", "test", "build", "deps"];
/// Largest length of a name, characters: longer names make lists unreadable.
const LONGEST: usize = 32;

/// Valid name of a plugin, from which folder, crate, type and id are named.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PluginName(String);

/// Reason why a name is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum NameError {
    /// The name is empty or too long, does not start with a letter, or has other characters than lower-case letters, digits and
    /// single hyphens between them.
    #[error("invalid plugin name `{name}`: use lower-case letters, digits and single hyphens between \
        them, a letter first, at most {LONGEST} characters{}",
        nearest.as_ref().map_or(String::new(), |nearest| format!("; use `{nearest}`")))]
    Form {
        /// Given name.
        name: String,
        /// Valid name with the same letters and digits; `None` if there is none.
        nearest: Option<String>,
    },
    /// The name is reserved.
    #[error("`{name}` is reserved by {owner}; use `my-{name}`")]
    Taken {
        /// Given name.
        name: String,
        /// Tool or project that reserves the name.
        owner: &'static str,
    },
}

impl PluginName {
    /// Checks a name and creates the plugin name. Not real-time.
    ///
    /// # Errors
    /// [`NameError`] with a suggestion.
    pub fn new(name: &str) -> Result<Self, NameError> {
        if !well_formed(name) {
            let nearest = Some(tidied(name)).filter(|tidied| well_formed(tidied));
            return Err(NameError::Form { name: name.to_owned(), nearest });
        }
        let taken = |owner| NameError::Taken { name: name.to_owned(), owner };
        match name {
            _ if TAKEN.contains(&name) => Err(taken("the compiler")),
            _ if CRATES.contains(&name) => Err(taken("cargo")),
            _ if name.starts_with("flotor") => Err(taken("Flotor, for its own crates")),
            _ => Ok(Self(name.to_owned())),
        }
    }

    /// Returns the id, also the name of folder and crate: `soft-wall`.
    #[must_use]
    pub fn id(&self) -> &str {
        &self.0
    }

    /// Returns the name in library files and symbols: `soft_wall`.
    #[must_use]
    pub fn symbol(&self) -> String {
        self.0.replace('-', "_")
    }

    /// Returns the name of the type: `SoftWall`.
    #[must_use]
    pub fn type_name(&self) -> String {
        self.0.split('-').map(capitalised).collect()
    }

    /// Returns the title for users: `Soft wall`.
    #[must_use]
    pub fn title(&self) -> String {
        capitalised(&self.0.replace('-', " "))
    }
}

fn well_formed(name: &str) -> bool {
    let characters = name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-');
    let hyphens = !name.contains("--") && !name.ends_with('-');
    characters && hyphens && name.starts_with(|c: char| c.is_ascii_lowercase()) && name.len() <= LONGEST
}

/// Returns the letters and digits of a name in lower case, with single hyphens in place of other characters and before capital
/// letters.
fn tidied(name: &str) -> String {
    let mut words: Vec<String> = vec![String::new()];
    let mut after_lower = false;
    for c in name.chars() {
        let boundary = !c.is_ascii_alphanumeric() || (c.is_ascii_uppercase() && after_lower);
        if boundary {
            words.push(String::new());
        }
        if let Some(word) = words.last_mut().filter(|_| c.is_ascii_alphanumeric()) {
            word.push(c.to_ascii_lowercase());
        }
        after_lower = c.is_ascii_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words.join("-")
}

fn capitalised(word: &str) -> String {
    let mut characters = word.chars();
    let first = characters.next().map(|first| first.to_ascii_uppercase());
    first.into_iter().chain(characters).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_name_is_written_in_four_ways() {
        let name = PluginName::new("soft-wall-2").unwrap();
        assert_eq!(
            (name.id(), name.symbol(), name.type_name(), name.title()),
            ("soft-wall-2", "soft_wall_2".to_owned(), "SoftWall2".to_owned(), "Soft wall 2".to_owned())
        );
    }

    #[test]
    fn a_wrong_name_comes_back_right() {
        let nearest = |name: &str| match PluginName::new(name) {
            Err(NameError::Form { nearest, .. }) => nearest,
            other => panic!("{name}: {other:?}"),
        };
        for (wrong, right) in [
            ("SoftWall", "soft-wall"),
            ("soft_wall", "soft-wall"),
            ("soft wall", "soft-wall"),
            ("-soft--wall-", "soft-wall"),
            ("../wall", "wall"),
            ("MLHD", "mlhd"),
        ] {
            assert_eq!(nearest(wrong).as_deref(), Some(right), "{wrong}");
        }
        for hopeless in ["", "--", "2-walls", "ü", "a-name-of-more-than-thirty-two-characters"] {
            assert_eq!(nearest(hopeless), None, "{hopeless}");
        }
    }

    #[test]
    fn reserved_names_are_refused() {
        for name in ["fn", "self", "test", "std", "flotor-hal", "flotor"] {
            assert!(matches!(PluginName::new(name), Err(NameError::Taken { .. })), "{name}");
        }
    }
}
