//! Stability score: JSON fields and text table.

use super::continuity::Jump;
use super::measure::{Measure, PoseRecord, Verdict};
use super::poses::Reach;
use super::{Decades, Setup, Size};
use crate::tally::tally;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Stability score of a force model. The field names are a stable interface: scripts rely on them.
#[derive(Clone, Debug, Serialize)]
pub struct StressReport {
    /// Id of the model.
    pub model: String,
    /// Version of the plugin.
    pub version: String,
    /// Settings by parameter id, as text.
    pub settings: BTreeMap<String, String>,
    /// Extent of the measurements.
    pub size: Size,
    /// Seed of poses and motions.
    pub seed: u64,
    /// Workspace in the model frame.
    pub reach: Reach,
    /// Fraction of the measures that passed.
    pub score: f64,
    /// Measures, M0 to M11.
    pub measures: Vec<Measure>,
    /// Distributions for pictures.
    pub distributions: Distributions,
    /// Description of the first step that did not return; its measure has failed. `None` if all steps returned.
    #[serde(skip)]
    pub stuck: Option<String>,
}

tally! {
    /// Distributions of measured quantities.
    #[derive(Clone, Debug, Serialize, Deserialize)]
    pub struct Distributions {
        /// M1: largest change of wrench over pieces of each length.
        pub jumps: Vec<Jump>,
        /// M2: largest gain at each pose, N/m.
        pub gains_n_per_m: Decades,
        /// M4: energy generated on a lap, less its uncertainty, divided by the absolute work exchanged with the hand; a lap without
        /// generated energy counts as 1e-18.
        pub loop_energies: Decades,
        /// M7: shortest time of each repeated call, ns.
        pub calls_ns: Decades,
    }
}

impl StressReport {
    pub(super) fn new(setup: &Setup<'_>, mut measures: Vec<Measure>, distributions: Distributions) -> Self {
        // Sorts "M2" before "M10".
        measures.sort_by_key(|measure| (measure.id.len(), measure.id.clone()));
        let schema = setup.plugin.parameters();
        let named = |setting: &flotor_loader::Setting| {
            let parameter = schema.get(setting.index())?;
            Some((parameter.id().to_owned(), setting.display()))
        };
        let passed = measures.iter().filter(|measure| measure.verdict == Verdict::Pass).count();
        let metadata = setup.plugin.metadata();
        Self {
            model: metadata.id.clone(),
            version: metadata.version.clone(),
            settings: setup.settings.iter().filter_map(named).collect(),
            size: setup.options.size,
            seed: setup.options.seed,
            reach: setup.options.reach,
            score: passed as f64 / measures.len().max(1) as f64,
            measures,
            distributions,
            stuck: None,
        }
    }

    /// Returns model, version, settings, size and seed, in one line.
    #[must_use]
    pub fn subject(&self) -> String {
        let settings = self.settings_text();
        let settings = if settings.is_empty() { settings } else { format!(" ({settings})") };
        format!("{} {}{settings}, {}, seed {}", self.model, self.version, self.size.word(), self.seed)
    }

    pub(super) fn settings_text(&self) -> String {
        let settings: Vec<String> =
            self.settings.iter().map(|(key, value)| format!("{key}={value}")).collect();
        settings.join(", ")
    }

    /// Formats a human-readable table, with rows for each measure.
    #[must_use]
    pub fn to_text(&self) -> String {
        let width = self.measures.iter().map(|measure| measure.verdict.word().len()).fold(5, usize::max);
        let mut lines: Vec<String> = self.measures.iter().flat_map(|measure| rows(measure, width)).collect();
        let count = |verdict| self.measures.iter().filter(|measure| measure.verdict == verdict).count();
        lines.push(format!(
            "  score {:.2}: {} passed, {} noted, {} failed, {} not judged",
            self.score,
            count(Verdict::Pass),
            count(Verdict::Note),
            count(Verdict::Fail),
            count(Verdict::NothingToJudge) + count(Verdict::NotResolved)
        ));
        lines.join("\n")
    }
}

fn rows(measure: &Measure, width: usize) -> Vec<String> {
    let bound = measure.bound.map_or(String::new(), |bound| format!("<= {}", number(bound, &measure.unit)));
    let value = number(measure.value, &measure.unit);
    let Measure { id, name, verdict, comment, pose, .. } = measure;
    let mut rows =
        vec![format!("  {:<width$} {id}  {name:<19} {value:>15}  {bound:<18} {comment}", verdict.word())];
    // The worst pose is printed only if the measure did not pass.
    if let (Some(pose), true) = (pose, *verdict != Verdict::Pass) {
        rows.push(format!("            worst at {}", place(pose)));
    }
    rows.into_iter().map(|row| row.trim_end().to_owned()).collect()
}

fn place(pose: &PoseRecord) -> String {
    let [x, y, z] = pose.position_m.map(|metres| short(metres * 1.0e3));
    if let Some(quaternion) = pose.orientation_xyzw {
        let [i, j, k, w] = quaternion.map(short);
        return format!("({x}, {y}, {z}) mm, quaternion ({i}, {j}, {k}, {w})");
    }
    let [rx, ry, rz] = pose.rotation_rad.map(short);
    format!("({x}, {y}, {z}) mm, ({rx}, {ry}, {rz}) rad")
}

/// Formats a number with four digits, with an exponent only for very small or large ones.
fn short(number: f64) -> String {
    match number.abs() {
        magnitude if magnitude == 0.0 || (1.0e-3..1.0e4).contains(&magnitude) => {
            format!("{number:.4}").trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        _ => format!("{number:.2e}"),
    }
}

fn number(value: f64, unit: &str) -> String {
    format!("{} {unit}", short(value)).trim_end().to_owned()
}
