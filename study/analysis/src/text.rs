//! Text pages of results, beside the results of CMU-RI-TR-07-21.

use super::blinded::BlindedAnalysis;
use super::published::ThesisComparison;
use super::{JndAnalysis, KinematicMeasure, MagnitudeAnalysis, PairTest, PostHoc, order_note, published};
use flotor_statistics::anova::Effect;
use flotor_statistics::describe::MeanInterval;
use flotor_statistics::effect_size::EffectSize;
use flotor_statistics::not_testable_text;
use flotor_statistics::t_test::TTest;
use flotor_study::trial::Modality;

pub(super) fn jnd(analysis: &JndAnalysis) -> String {
    let mut page = Page { lines: Vec::new(), thesis: analysis.thesis };
    let JndAnalysis { subjects, pairs_per_subject, .. } = analysis;
    let thesis = analysis.thesis.text(" (thesis: about 200)");
    page.line(format!("{subjects} subjects, {pairs_per_subject:.1} pairs each{thesis}"));
    page.gap();
    page.row("Weber fraction", "here", "thesis");
    let fractions =
        [("vision + haptics", &analysis.weber_detail.vh), ("haptics alone", &analysis.weber_detail.h)];
    for ((name, detail), published) in fractions.into_iter().zip(published::WEBER) {
        let published = &format!("{:.1} %", published * 100.0);
        let [low, high] = detail.interval.map(|end| end * 100.0);
        page.row(name, &format!("{:.1} %  (95 %: {low:.1} to {high:.1})", detail.mean * 100.0), published);
    }
    page.row("difference", &analysis.t.to_text(t_text), published::T);
    page.gap();
    page.columns("Thresholds", "vision + haptics", "haptics alone");
    let of = |modality| analysis.thresholds.iter().filter(move |cell| cell.modality == modality);
    for (vh, h) in of(Modality::Vh).zip(of(Modality::H)) {
        let name = format!("base {}", vh.base);
        page.columns(&name, &interval_text(&vh.threshold), &interval_text(&h.threshold));
    }
    page.effects("thresholds", &analysis.anova, &published::JND);
    page.sizes(&analysis.anova);
    page.post_hoc(&analysis.post_hoc);
    let constancy = [
        ("fraction over base, vh", &analysis.constancy.vh, published::CONSTANCY[0]),
        ("fraction over base, h", &analysis.constancy.h, published::CONSTANCY[1]),
    ];
    for (name, effect, published) in constancy {
        if let Some(effect) = effect {
            page.row(name, &effect_text(effect), published);
        }
    }
    page.movements(analysis.task, &analysis.kinematics);
    let omitted = analysis.omitted_tracks();
    if omitted > 0 {
        page.gap();
        page.line(format!("{omitted} tracks did not reach a threshold and are omitted"));
    }
    page.end()
}

pub(super) fn magnitude(analysis: &MagnitudeAnalysis) -> String {
    let mut page = Page { lines: Vec::new(), thesis: analysis.thesis };
    let MagnitudeAnalysis { subjects, trials_per_subject, repeated, .. } = analysis;
    let thesis = analysis.thesis.text(" (thesis: 72)");
    page.line(format!("{subjects} subjects, {trials_per_subject} ratings each{thesis}"));
    page.line(format!("{repeated} presentations repeated because the handle left its range"));
    page.gap();
    let here = analysis.trend.to_text(|trend| format!("R² = {:.3}", trend.r_squared));
    page.row("Linear trend", &here, &format!("R² = {}", published::LINEAR_R2));
    page.gap();
    page.columns("Rating", "vision + haptics", "haptics alone");
    let of = |modality| analysis.ratings.iter().filter(move |cell| cell.modality == modality);
    for (vh, h) in of(Modality::Vh).zip(of(Modality::H)) {
        let name = format!("stimulus {:.2}", vh.stimulus);
        page.columns(&name, &interval_text(&vh.rating), &interval_text(&h.rating));
    }
    page.effects("ratings", &analysis.anova, &published::MAGNITUDE);
    page.sizes(&analysis.anova);
    page.post_hoc(&analysis.post_hoc);
    page.movements(analysis.task, &analysis.kinematics);
    page.end()
}

pub(super) fn blinded(analysis: &BlindedAnalysis) -> String {
    let mut page = Page::default();
    page.line(format!("{} subjects; conditions are codes", analysis.subjects));
    page.gap();
    for cell in &analysis.cells {
        page.row(&cell.condition, &format!("{:.3}", cell.mean), "");
    }
    page.effects("responses", &analysis.anova, &[]);
    page.end()
}

/// Text page under construction.
#[derive(Default)]
struct Page {
    lines: Vec<String>,
    thesis: ThesisComparison,
}

impl Page {
    fn line(&mut self, text: String) {
        self.lines.push(format!("  {text}"));
    }

    fn gap(&mut self) {
        self.lines.push(String::new());
    }

    /// Adds a row: name, value of this study, and value of the thesis if comparable.
    fn row(&mut self, name: &str, here: &str, published: &str) {
        let published = self.thesis.text(published);
        let line = format!("  {}{}{published}", column(name, 30), column(here, 46));
        self.lines.push(line.trim_end().to_owned());
    }

    fn columns(&mut self, name: &str, first: &str, second: &str) {
        self.lines.push(format!("  {}{}{second}", column(name, 30), column(first, 23)));
    }

    fn effects(&mut self, what: &str, table: &[Effect], published: &[(&str, &str)]) {
        self.gap();
        self.row(&format!("Effects on {what}"), "here", "thesis");
        for effect in table {
            let known =
                published.iter().find(|(name, _)| *name == effect.effect).filter(|_| effect.is_testable());
            self.row(&effect.effect, &effect_text(effect), known.map_or("", |(_, text)| text));
        }
    }

    /// Adds the effect sizes; first a note if the effect of the order is missing.
    fn sizes(&mut self, table: &[Effect]) {
        self.lines.extend(order_note(table).map(|note| format!("  {note}")));
        self.gap();
        self.row("Partial omega squared", "with its 95 % interval", "");
        for effect in table {
            if let Some(size) = &effect.partial_omega_squared {
                self.row(&effect.effect, &size_text(size), "");
            }
        }
    }

    fn post_hoc(&mut self, comparisons: &[PostHoc]) {
        if comparisons.is_empty() {
            return;
        }
        self.gap();
        self.columns("Comparisons", "paired t, p after Holm", "   Cohen's d of the pairs");
        for PostHoc { comparison, test } in comparisons {
            let here =
                |PairTest { t, p_holm, d }: &PairTest| column(&t_with_p_text(t, *p_holm), 26) + &size_text(d);
            self.lines.push(format!("  {}{}", column(comparison, 30), test.to_text(here)));
        }
    }

    fn movements(&mut self, task: &str, measures: &[KinematicMeasure]) {
        for measure in measures {
            self.effects(measure.measure, &measure.anova, published::movement(task, measure.measure));
            if let Some(exponent) = &measure.exponent {
                let beside = published::direction(measure.measure, exponent).unwrap_or_default();
                self.row("exponent of the stimulus", &exponent_text(exponent), &beside);
            }
        }
    }

    fn end(self) -> String {
        self.lines.join("\n")
    }
}

/// Pads a text to the width of a column; a text that fills the column is followed by two spaces.
fn column(text: &str, width: usize) -> String {
    let is_full = text.chars().count() + 2 > width;
    if is_full { format!("{text}  ") } else { format!("{text:<width$}") }
}

fn size_text(size: &EffectSize) -> String {
    format!("{:.2}  ({})", size.value, size_interval_text(size))
}

/// Formats the confidence interval of an effect size: `0.24 to 1.39`; an infinite limit gives `or more` or `or less`.
#[must_use]
pub fn size_interval_text(size: &EffectSize) -> String {
    match size.interval {
        [low, high] if high.is_infinite() => format!("{low:.2} or more"),
        [low, high] if low.is_infinite() => format!("{high:.2} or less"),
        [low, high] => format!("{low:.2} to {high:.2}"),
    }
}

/// Formats a t-test as in publications: `t(15) = 3.30, p = 0.005`.
#[must_use]
pub fn t_text(t: &TTest) -> String {
    t_with_p_text(t, t.p)
}

fn t_with_p_text(t: &TTest, p: f64) -> String {
    format!("t({}) = {:.2}, {}", t.df, t.value, p_text(p))
}

/// Formats an exponent with its 95 % confidence interval: `-0.512 (95 %: -0.630 to -0.394)`.
#[must_use]
pub fn exponent_text(exponent: &MeanInterval) -> String {
    let [low, high] = exponent.interval;
    format!("{:.3} (95 %: {low:.3} to {high:.3})", exponent.mean)
}

fn interval_text(value: &MeanInterval) -> String {
    format!("{:.3} (se {:.3})", value.mean, value.se)
}

/// Formats an effect as in publications: `F(2, 30) = 1.46, p = 0.250 (HF p = 0.251)`, the Huynh-Feldt p-value only if there is
/// one; for an effect without a test, the reason.
#[must_use]
pub fn effect_text(effect: &Effect) -> String {
    if let Some(reason) = &effect.not_testable {
        return not_testable_text(reason);
    }
    let corrected = effect.sphericity.map_or(String::new(), |s| format!(" (HF {})", p_text(s.p_hf)));
    format!("F({}, {}) = {:.2}, {}{corrected}", effect.df, effect.error_df, effect.f, p_text(effect.p))
}

/// Formats a p-value: `p = 0.250`, or `p < 0.001`.
#[must_use]
pub fn p_text(p: f64) -> String {
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {p:.3}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "(HF p < 0.001)F(11, 154)": two columns were one.
    #[test]
    fn a_full_column_keeps_its_distance() {
        let long = "F(11, 110) = 1127.73, p < 0.001 (HF p < 0.001)";
        assert_eq!(column(long, 46), format!("{long}  "));
        assert_eq!(column("R² = 1", 9), "R² = 1   ");
        assert_eq!(column("abcdefgh", 9), "abcdefgh  ");
    }
}
