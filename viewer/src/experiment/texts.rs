//! Texts of the screens of a sitting, from a file; English texts unless the study names a file.
//!
//! The file has one text for each key (`viewer/texts/english.toml`). A key that is missing or unknown is an error, so that no
//! screen is partly in another language.

use flotor_hal::read_text;
use serde::Deserialize;
use std::path::Path;
use std::sync::OnceLock;

/// The English texts.
const ENGLISH: &str = include_str!("../../texts/english.toml");

/// Texts of the screens, one field for each key of the file.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Texts {
    pub(crate) task_rate_stiffness: String,
    pub(crate) task_rate_force: String,
    pub(crate) task_pair_stiffness: String,
    pub(crate) task_pair_force: String,
    pub(crate) how_rate_stiffness: String,
    pub(crate) how_rate_force: String,
    pub(crate) how_pair_stiffness: String,
    pub(crate) how_pair_force: String,
    pub(crate) press_often: String,
    pub(crate) seen_stiffness: String,
    pub(crate) seen_force: String,
    pub(crate) not_seen: String,
    pub(crate) practice_begins: String,
    pub(crate) practice_does_not_count: String,
    pub(crate) main_begins: String,
    pub(crate) vision_begins: String,
    pub(crate) vision_ends: String,
    pub(crate) rest: String,
    pub(crate) rest_how: String,
    pub(crate) out_of_range: String,
    pub(crate) out_of_range_how: String,
    pub(crate) feel_stiffness: String,
    pub(crate) feel_first_stiffness: String,
    pub(crate) feel_second_stiffness: String,
    pub(crate) feel_force: String,
    pub(crate) feel_first_force: String,
    pub(crate) feel_second_force: String,
    pub(crate) press: String,
    pub(crate) press_in_practice: String,
    pub(crate) handle_out_of_range: String,
    pub(crate) ask_pair_stiffness: String,
    pub(crate) ask_pair_force: String,
    pub(crate) ask_rate_stiffness: String,
    pub(crate) ask_rate_force: String,
    pub(crate) type_number: String,
    pub(crate) type_number_in_practice: String,
    pub(crate) answer_in_practice: String,
    pub(crate) key_begin: String,
    pub(crate) key_go_on: String,
    pub(crate) key_felt: String,
    pub(crate) key_answer_pair: String,
    pub(crate) key_answer_rate: String,
    pub(crate) key_again_one: String,
    pub(crate) key_again_pair: String,
    pub(crate) again_last: String,
    pub(crate) again_left: String,
    pub(crate) key_practise: String,
    pub(crate) key_withdraw: String,
    pub(crate) key_close: String,
    pub(crate) count: String,
    pub(crate) wait: String,
    pub(crate) starting: String,
    pub(crate) over: String,
    pub(crate) over_how: String,
    pub(crate) stop: String,
    pub(crate) device_stopped: String,
    pub(crate) experiment_stopped: String,
    pub(crate) call: String,
}

impl Texts {
    /// Returns the English texts.
    ///
    /// # Panics
    /// Never: a test parses the English texts.
    #[must_use]
    pub fn english() -> Self {
        static TEXTS: OnceLock<Texts> = OnceLock::new();
        TEXTS.get_or_init(|| Self::parse(ENGLISH).expect("the English texts are complete")).clone()
    }

    /// Reads the texts from a file.
    ///
    /// # Errors
    /// A message of one line if the file cannot be read, or a key is missing or unknown, or lacks the placeholder of its number.
    pub fn read(file: &Path) -> Result<Self, String> {
        let text = read_text(file, "the texts").map_err(|wrong| wrong.problem)?;
        Self::parse(&text)
    }

    fn parse(text: &str) -> Result<Self, String> {
        let texts: Self = toml::from_str(text).map_err(|error| {
            // Without the picture of the line, whose lines contain a bar.
            error.to_string().lines().filter(|line| !line.contains('|')).collect::<Vec<_>>().join(": ")
        })?;
        for (key, text, place) in [
            ("count", &texts.count, "{number}"),
            ("count", &texts.count, "{of_about}"),
            ("again_left", &texts.again_left, "{left}"),
        ] {
            if !text.contains(place) {
                return Err(format!(
                    "`{key}` lacks `{place}`, the placeholder of its number; insert the placeholder"
                ));
            }
        }
        Ok(texts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_language_of_the_repository_is_complete() {
        let german = Texts::parse(include_str!("../../texts/german.toml")).expect("a translation");
        assert_ne!(german, Texts::english());
    }

    #[test]
    fn a_file_with_a_key_too_few_or_too_many_or_without_a_number_is_refused() {
        let missing = Texts::parse(&ENGLISH.replace("rest = ", "# rest = ")).expect_err("`rest` is missing");
        assert!(missing.contains("rest"), "{missing}");
        let unknown = Texts::parse(&format!("{ENGLISH}\nnext = \"Next\"\n")).expect_err("`next` is unknown");
        assert!(unknown.contains("next"), "{unknown}");
        let number = Texts::parse(&ENGLISH.replace("{left} times", "some")).expect_err("without its number");
        assert!(number.contains("again_left") && number.contains("{left}"), "{number}");
    }

    #[test]
    fn a_file_without_an_end_is_not_read() {
        // Where there is no such file it cannot be read either.
        let refused = Texts::read(Path::new("/dev/zero")).expect_err("a device file");
        assert!(refused.starts_with("cannot read the texts: "), "{refused}");
    }
}
