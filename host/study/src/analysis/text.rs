//! Results for people, next to what CMU-RI-TR-07-21 reports.

use super::{JndAnalysis, KinematicMeasure, MagnitudeAnalysis};
use crate::trial::Modality;
use flotor_statistics::anova::Effect;
use flotor_statistics::describe::MeanInterval;

/// What the report says about effects on thresholds (section 4.3.2) and on ratings (4.3.1).
const PUBLISHED_JND: [(&str, &str); 3] = [
    ("modality", "F(1, 14) = 11.94, p = 0.004"),
    ("base", "F(2, 28) = 23.01, p < 0.001"),
    ("modality:base", "F(2, 28) = 3.10, p = 0.061"),
];
const PUBLISHED_MAGNITUDE: [(&str, &str); 2] =
    [("modality", "F(1, 14) < 0.02, p = 0.88"), ("stimulus", "F(11, 154) = 13.57, p < 0.001")];

pub(super) fn jnd(analysis: &JndAnalysis) -> String {
    let mut page = Page::default();
    let JndAnalysis { subjects, pairs_per_subject, .. } = analysis;
    page.line(format!("{subjects} subjects, {pairs_per_subject:.1} pairs each (report: about 200)"));
    page.gap();
    page.row("Weber fraction", "here", "report");
    let fractions = [
        ("vision + haptics", &analysis.weber_detail.vh, "14.2 %"),
        ("haptics alone", &analysis.weber_detail.h, "17.2 %"),
    ];
    for (name, detail, published) in fractions {
        let [low, high] = detail.interval.map(|end| end * 100.0);
        page.row(name, &format!("{:.1} %  (95 %: {low:.1} to {high:.1})", detail.mean * 100.0), published);
    }
    let t = &analysis.t;
    let here = format!("t({}) = {:.2}, {}", t.df, t.value, p_text(t.p));
    page.row("difference", &here, "t(15) = 3.30, p = 0.005");
    page.gap();
    page.columns("Thresholds", "vision + haptics", "haptics alone");
    let of = |modality| analysis.thresholds.iter().filter(move |cell| cell.modality == modality);
    for (vh, h) in of(Modality::Vh).zip(of(Modality::H)) {
        let name = format!("base {}", vh.base);
        page.columns(&name, &interval_text(&vh.threshold), &interval_text(&h.threshold));
    }
    page.effects("thresholds", &analysis.anova, &PUBLISHED_JND);
    let constancy = [
        ("fraction over base, vh", &analysis.constancy.vh, "F(2, 30) = 1.46, p = 0.25"),
        ("fraction over base, h", &analysis.constancy.h, "F(2, 30) = 0.80, p = 0.46"),
    ];
    for (name, effect, published) in constancy {
        if let Some(effect) = effect {
            page.row(name, &effect_text(effect), published);
        }
    }
    page.movements(&analysis.kinematics);
    if analysis.unfinished_tracks > 0 {
        page.gap();
        page.line(format!(
            "{} tracks never came to a threshold and are left out",
            analysis.unfinished_tracks
        ));
    }
    page.end()
}

pub(super) fn magnitude(analysis: &MagnitudeAnalysis) -> String {
    let mut page = Page::default();
    let MagnitudeAnalysis { subjects, trials_per_subject, repeated, linear_r2, .. } = analysis;
    page.line(format!("{subjects} subjects, {trials_per_subject} ratings each (report: 72)"));
    page.line(format!("{repeated} presentations repeated because the handle left its range"));
    page.gap();
    page.row("Linear trend", &format!("R² = {linear_r2:.3}"), "R² = 0.983");
    page.gap();
    page.columns("Rating", "vision + haptics", "haptics alone");
    let of = |modality| analysis.ratings.iter().filter(move |cell| cell.modality == modality);
    for (vh, h) in of(Modality::Vh).zip(of(Modality::H)) {
        let name = format!("stimulus {:.2}", vh.stimulus);
        page.columns(&name, &interval_text(&vh.rating), &interval_text(&h.rating));
    }
    page.effects("ratings", &analysis.anova, &PUBLISHED_MAGNITUDE);
    page.movements(&analysis.kinematics);
    page.end()
}

/// Lines in the making.
#[derive(Default)]
struct Page {
    lines: Vec<String>,
}

impl Page {
    fn line(&mut self, text: String) {
        self.lines.push(format!("  {text}"));
    }

    fn gap(&mut self) {
        self.lines.push(String::new());
    }

    /// What, what it is here, and what it is in the report.
    fn row(&mut self, name: &str, here: &str, published: &str) {
        self.lines.push(format!("  {name:<25}{here:<46}{published}").trim_end().to_owned());
    }

    fn columns(&mut self, name: &str, first: &str, second: &str) {
        self.lines.push(format!("  {name:<25}{first:<23}{second}"));
    }

    fn effects(&mut self, what: &str, table: &[Effect], published: &[(&str, &str)]) {
        self.gap();
        self.row(&format!("Effects on {what}"), "here", "report");
        for effect in table {
            let known = published.iter().find(|(name, _)| *name == effect.effect);
            self.row(&effect.effect, &effect_text(effect), known.map_or("", |(_, text)| text));
        }
    }

    fn movements(&mut self, measures: &[KinematicMeasure]) {
        for measure in measures {
            self.effects(measure.measure, &measure.anova, &[]);
        }
    }

    fn end(self) -> String {
        self.lines.join("\n")
    }
}

fn interval_text(value: &MeanInterval) -> String {
    format!("{:.3} (se {:.3})", value.mean, value.se)
}

fn effect_text(effect: &Effect) -> String {
    let corrected = effect.sphericity.map_or(String::new(), |s| format!(" (GG {})", p_text(s.p_gg)));
    format!("F({}, {}) = {:.2}, {}{corrected}", effect.df, effect.error_df, effect.f, p_text(effect.p))
}

fn p_text(p: f64) -> String {
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {p:.3}") }
}
