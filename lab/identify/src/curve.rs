//! Curve of an identified law for the force model `measured`, and a scene that renders it.

use crate::identification::Identification;
use crate::law::{Connection, Law, Motion, Scales};
use crate::measurement::Measurement;

/// Number of rows of the curve; the first has no force.
const ROWS: u32 = 65;
/// Drawn length of an object, as a multiple of its largest compression.
const DRAWN: f64 = 1.5;

/// Returns the static force over the depth, m and N, up to the largest measured depth; the force never decreases. Not real-time.
pub(crate) fn at_rest(identification: &Identification, measurement: &Measurement) -> Vec<(f64, f64)> {
    let scales = Scales::of(measurement);
    let deepest_m = scales.lowest_m + scales.span_m;
    let contact_m = identification.parameter("contact_m").unwrap_or(scales.lowest_m).min(deepest_m);
    let law = identification.closest;
    let values: Vec<f64> = identification
        .parameters
        .iter()
        .filter(|estimate| law != Law::Table || estimate.id != "contact_m")
        // Friction has either sign at rest: use its mean, zero.
        .map(|estimate| if estimate.id == "friction_n" { 0.0 } else { estimate.value })
        .collect();
    let places: Vec<f64> = (0..ROWS)
        .map(|row| contact_m + (deepest_m - contact_m) * f64::from(row) / f64::from(ROWS - 1))
        .collect();
    // Time between the positions, long enough for every transient to decay.
    let times: Vec<f64> = (0..ROWS).map(|row| f64::from(row) * 1.0e9).collect();
    let motion = Motion { time_s: &times, displacement_m: &places, smooth_m: &places };
    let level_n = law.respond(&values, Connection::Presses, &scales, motion).level_n;
    let mut most_n = 0.0_f64;
    let rows = places.iter().zip(level_n).enumerate().map(|(row, (place_m, level_n))| {
        most_n = if row == 0 { 0.0 } else { most_n.max(level_n) };
        (place_m - contact_m, most_n)
    });
    rows.collect()
}

/// Formats a curve as a table for the force model `measured`.
pub(crate) fn to_table(curve: &[(f64, f64)]) -> String {
    let rows: String = curve.iter().map(|(x_m, f_n)| format!("{:.6},{f_n:.6}\n", x_m * 1.0e3)).collect();
    format!("compression_mm,force_n\n{rows}")
}

/// Returns a scene (TOML) that renders the curve with the simulated device, at scale 1.
pub(crate) fn scene(identification: &Identification, curve: &[(f64, f64)], table: &str) -> String {
    let deepest_m = curve.last().map_or(0.0, |(x_m, _)| *x_m);
    let law = identification.closest;
    let note = match (law.has_rate(), law) {
        (true, _) => "# The force at rest: the model has no velocity.\n",
        (false, Law::Hysteresis) => "# Without the friction, which the model does not have.\n",
        _ => "",
    };
    format!(
        "# A thing as `flotor identify` measured it: law {}.\n{note}title = \"A measured thing ({})\"\nrate_hz = 1000\n\n\
         [device]\nplugin = \"simulated\"\n\n[[model]]\nplugin = \"measured\"\n\n[model.parameters]\ncurve = {table:?}\n\
         # Only for the drawing.\nfree_length_mm = {:.6}\n\n[model.mapping]\nmotion_scale = 1.0\nforce_scale = 1.0\n",
        law.id(),
        law.id(),
        (DRAWN * deepest_m).max(1.0e-3) * 1.0e3
    )
}
