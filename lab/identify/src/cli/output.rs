//! Results of `flotor identify`: text, JSON, and the files of `--out`.

use crate::curve::{at_rest, scene, to_table};
use crate::identification::{Estimate, Identification};
use crate::measurement::Measurement;
use crate::picture;
use flotor_command::options::JsonOption;
use flotor_command::tables::table;
use flotor_command::{CommandError, print_result, style, write_text};
use flotor_hal::math::powi;
use serde::Serialize;
use std::path::Path;

const CURVE: &str = "curve.csv";

/// JSON output.
#[derive(Serialize)]
struct Report<'a> {
    law: &'a str,
    closest: &'a str,
    parameters: &'a [Estimate],
    #[serde(skip_serializing_if = "Option::is_none")]
    delay_s: Option<&'a Estimate>,
    rms_n: f64,
    structure_n: f64,
    samples: usize,
    ladder: Vec<Score>,
}

#[derive(Serialize)]
struct Score {
    law: &'static str,
    score: f64,
    standard_error: f64,
}

/// Prints the result, and writes JSON and the files of a folder if requested.
pub(super) fn write(
    measurement: &Measurement,
    identified: &Identification,
    out: Option<&Path>,
    json: &JsonOption,
) -> Result<(), CommandError> {
    let ladder = identified.ladder.iter().map(|rung| Score {
        law: rung.law.id(),
        score: rung.score_n,
        standard_error: rung.standard_error_n,
    });
    let report = Report {
        law: identified.name(),
        closest: identified.closest.id(),
        // Omit the parameters of a rejected law: readers would take them for properties of the object.
        parameters: identified.law.map_or(&[], |_| &identified.parameters),
        delay_s: identified.delay_s.as_ref(),
        rms_n: identified.rms_n,
        structure_n: identified.structure_n,
        samples: measurement.force_n().len(),
        ladder: ladder.collect(),
    };
    if let Some(folder) = out {
        write_folder(folder, measurement, identified)?;
    }
    print_result(json.file(), &report, || to_text(identified))
}

/// Writes picture, curve and scene; without a law only the picture.
fn write_folder(
    folder: &Path,
    measurement: &Measurement,
    identified: &Identification,
) -> Result<(), CommandError> {
    std::fs::create_dir_all(folder)
        .map_err(|cause| CommandError::file(folder, "cannot create the folder", cause))?;
    write_text(Some(&folder.join("fit.svg")), || picture::to_svg(measurement, identified))?;
    if identified.law.is_none() {
        return Ok(());
    }
    let curve = at_rest(identified, measurement);
    write_text(Some(&folder.join(CURVE)), || to_table(&curve))?;
    write_text(Some(&folder.join("scene.toml")), || scene(identified, &curve, CURVE))
}

fn to_text(identified: &Identification) -> String {
    let mut lines = vec![style::title("law             prediction error by cross-validation")];
    for rung in &identified.ladder {
        let mark = if rung.law == identified.closest { "  <- selected" } else { "" };
        lines.push(format!(
            "  {:<13} {:>9.2} ± {:.2} mN{mark}",
            rung.law.id(),
            rung.score_n * 1.0e3,
            rung.standard_error_n * 1.0e3
        ));
    }
    lines.push(String::new());
    lines.push(style::title(&format!("law: {}", identified.name())));
    if identified.law.is_some() {
        let estimates = identified.parameters.iter().chain(&identified.delay_s);
        let row = |estimate: &Estimate| {
            let digits = digits(estimate);
            let text = |value: f64| format!("{value:.digits$}");
            [estimate.id.to_owned(), text(estimate.value), text(estimate.low), text(estimate.high)]
        };
        lines.extend(table(["parameter", "value", "from", "to (95 %)"], estimates.map(row)));
    } else {
        lines.push(format!(
            "  closest: {}; no law of the ladder explains the measurement",
            identified.closest.id()
        ));
    }
    lines.push(format!(
        "residual {:.4} N, of which {:.4} N is not noise",
        identified.rms_n, identified.structure_n
    ));
    lines.join("\n")
}

/// Returns the number of decimals that shows the width of an interval to two digits.
fn digits(estimate: &Estimate) -> usize {
    let width = estimate.high - estimate.low;
    let shows = |digits: &u8| width * powi(10.0, i32::from(*digits)) >= 10.0;
    usize::from((0..12).find(shows).unwrap_or(12))
}
