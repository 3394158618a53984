//! Text page of a designed study.

use super::measure::Detail;
use super::{CellMeasure, DesignAnalysis};
use crate::text::{effect_text, p_text};
use flotor_statistics::describe::MeanInterval;
use flotor_statistics::rank::TailBy;
use flotor_study_design::design::Condition;

pub(super) fn analysis(analysis: &DesignAnalysis) -> String {
    let heading = analysis.measure.heading();
    let mut lines =
        vec![format!("  {} subjects; {heading} in each condition", analysis.subjects), String::new()];
    for mean in &analysis.means {
        lines.push(row(&condition_text(&mean.condition), &mean.mean.to_text(mean_text)));
    }
    // With few subjects, what each of them did is the result; with many it is in the JSON.
    if analysis.subjects <= 3 {
        lines.push(String::new());
        for cell in &analysis.cells {
            let name = format!("{} {}", cell.subject, condition_text(&cell.condition));
            lines.push(row(&name, &cell.measure.to_text(cell_text)));
        }
    }
    lines.push(String::new());
    lines.push(format!("  Effects on the {heading}, {} subjects", analysis.effects.subjects));
    match analysis.effects.anova.result() {
        Ok(effects) => lines.extend(effects.iter().map(|effect| row(&effect.effect, &effect_text(effect)))),
        Err(reason) => lines.push(format!("  {}", flotor_statistics::not_testable_text(reason))),
    }
    if !analysis.effects.ranks.is_empty() {
        lines.push(String::new());
        lines.push("  By ranks".to_owned());
    }
    for effect in &analysis.effects.ranks {
        let text = effect
            .test
            .to_text(|test| format!("chi-square({}) = {:.2}, {}", test.df, test.chi_square, p_text(test.p)));
        lines.push(row(&effect.factor, &text));
    }
    for pair in &analysis.effects.pairs {
        let text = pair.test.to_text(|test| {
            let by = match test.by {
                TailBy::Counting => "",
                TailBy::Normal => " (normal approximation)",
            };
            format!("V = {}, {}, Holm {}{by}", test.v, p_text(test.p), p_text(pair.p_holm))
        });
        lines.push(row(&pair.comparison, &text));
    }
    if !analysis.omitted.is_empty() {
        lines.push(String::new());
        lines.push(format!(
            "  excluded from the effects, without a measure in some condition: {}",
            analysis.omitted.join(", ")
        ));
    }
    lines.join("\n")
}

fn row(name: &str, value: &str) -> String {
    format!("  {name:<38}{value}").trim_end().to_owned()
}

fn condition_text(condition: &Condition) -> String {
    let parts: Vec<String> = condition.iter().map(|(factor, value)| format!("{factor} {value}")).collect();
    if parts.is_empty() { "all".to_owned() } else { parts.join(", ") }
}

fn mean_text(mean: &MeanInterval) -> String {
    let [low, high] = mean.interval;
    format!("{:.4}  (95 %: {low:.4} to {high:.4}), n = {}", mean.mean, mean.n)
}

fn cell_text(cell: &CellMeasure) -> String {
    let end = |end: Option<f64>| end.map_or("not bounded".to_owned(), |end| format!("{end:.4}"));
    let detail = match &cell.detail {
        Detail::Mean => String::new(),
        Detail::Tracks { tracks, with_threshold } => format!("; {with_threshold} of {tracks} tracks"),
        Detail::Psychometric(fit) => {
            let [low, high] = fit.location_interval.map(end);
            let [narrow, wide] = fit.spread_interval.map(end);
            format!(
                "; 50 % at {:.4} ({low} to {high}), spread {:.4} ({narrow} to {wide})",
                fit.location, fit.spread
            )
        }
        Detail::Detection(found) => {
            let [low, high] = found.d_prime_interval;
            let [lax, strict] = found.criterion_interval;
            format!(
                "  (95 %: {low:.4} to {high:.4}), criterion {:.4} ({lax:.4} to {strict:.4})",
                found.criterion
            )
        }
    };
    format!("{:.4}{detail}; {} trials", cell.value, cell.trials)
}
