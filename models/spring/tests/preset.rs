//! Presets of the reference tables.

use crate::table::Row;
use flotor_spring::preset::Preset;

/// The preset a row is about.
pub(crate) fn preset(row: &Row) -> Preset {
    match row.text("spring") {
        "1" => Preset::Thesis1,
        "2" => Preset::Thesis2,
        "3" => Preset::Thesis3,
        "4" => Preset::Slender,
        other => panic!("no spring {other}"),
    }
}
