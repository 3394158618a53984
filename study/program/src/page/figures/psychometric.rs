//! Figure of the psychometric functions: proportion of correct answers over the difference, with the fitted function of each
//! subject.

use super::{HEIGHT_PX, MODALITIES};
use flotor_analysis::SubjectRecord;
use flotor_plot::{Axis, ErrorBar, Figure, Mark, Panel, Series};
use flotor_statistics::describe::mean;
use flotor_study::estimate::{Observation, Prior, most_likely};
use flotor_study::observer::TernaryObserver;
use flotor_study::protocol::JndProtocol;
use flotor_study::trial::{Judgement, Modality};

/// Width of a group of differences, as a fraction of the base; below, the minimum number of answers in a plotted group.
const GROUP: f64 = 0.05;
const FEWEST_ANSWERS: usize = 5;

/// Number of line segments of a curve.
const CURVE_POINTS: u32 = 80;

/// Style slot of the functions of single subjects.
const GREY: usize = 7;

/// Plots the answers of all subjects, pooled over bases, and the most likely function of each subject, one panel per modality.
pub(in super::super) fn psychometric(protocol: &JndProtocol, subjects: &[SubjectRecord]) -> Figure {
    let target = protocol.procedure.target();
    let figure = Figure::new("Psychometric functions", Axis::linear("Difference", "% of the base"))
        .subtitle(
            "Share of right answers, \"I don't know\" counts half; all bases together. Points: groups of 5 % of the base, ± 1 standard \
             error; lines: the most likely function",
        )
        .columns(2)
        .panel_height_px(0.7 * HEIGHT_PX);
    let all: Vec<Vec<Vec<Observation>>> = MODALITIES
        .iter()
        .map(|(modality, _)| subjects.iter().map(|subject| observations(subject, *modality)).collect())
        .collect();
    let largest = all.iter().flatten().flatten().map(|one| one.delta).fold(GROUP, f64::max);
    let panels = MODALITIES.into_iter().zip(&all).enumerate();
    panels
        .map(|(slot, ((_, name), of_subjects))| panel(slot, name, of_subjects, target, largest))
        .fold(figure, Figure::panel)
}

/// Returns the judged answers of a subject in a modality.
fn observations(record: &SubjectRecord, modality: Modality) -> Vec<Observation> {
    let here = record.judged().filter(|(event, ..)| event.trial.modality == modality);
    here.map(|(_, observation, _)| observation).collect()
}

fn panel(slot: usize, name: &str, of_subjects: &[Vec<Observation>], target: f64, largest: f64) -> Panel {
    let differences = || (0..=CURVE_POINTS).map(|step| largest * f64::from(step) / f64::from(CURVE_POINTS));
    let observers: Vec<TernaryObserver> = of_subjects
        .iter()
        .filter(|observations| !observations.is_empty())
        .map(|observations| observer(observations, target))
        .collect();
    let mut panel = Panel::new(Axis::linear("Right", "%").range(0.0, 100.0)).title(name);
    for (index, observer) in observers.iter().enumerate() {
        let curve = differences().map(|delta| (100.0 * delta, 100.0 * share_right(observer, delta)));
        panel =
            panel.series(Series::line(if index == 0 { "a subject" } else { "" }, curve).slot(GREY).faint());
    }
    if !observers.is_empty() {
        let curve = differences().map(|delta| {
            let shares: Vec<f64> = observers.iter().map(|observer| share_right(observer, delta)).collect();
            (100.0 * delta, 100.0 * mean(&shares))
        });
        panel = panel.series(Series::line("mean of the subjects", curve).slot(slot));
    }
    let groups = groups(of_subjects);
    let points = groups.iter().map(|bar| (bar.x, 0.5 * (bar.low + bar.high)));
    panel
        .series(Series::errors("", groups.iter().copied()).slot(slot))
        .series(Series::points("answers", points).slot(slot))
        .mark(Mark::at_y(100.0 * target, format!("{:.0} %", 100.0 * target)))
}

/// Returns the most likely observer for the answers.
fn observer(observations: &[Observation], target: f64) -> TernaryObserver {
    let prior = Prior::default();
    let estimate = most_likely(observations, &prior, target);
    TernaryObserver { sigma: estimate.sigma, criterion: estimate.criterion, bias: 0.0, lapse: prior.lapse }
}

/// Returns an observer's expected proportion of correct answers, 0 to 1; "I don't know" counts half.
fn share_right(observer: &TernaryObserver, delta: f64) -> f64 {
    let [correct, wrong] = observer.correct_and_wrong(delta);
    0.5 * (1.0 + correct - wrong)
}

/// Returns the proportion of correct answers in groups of differences, both in %, with error bars of ± 1 standard error.
fn groups(of_subjects: &[Vec<Observation>]) -> Vec<ErrorBar> {
    let all: Vec<&Observation> = of_subjects.iter().flatten().collect();
    let largest = all.iter().map(|one| one.delta).fold(0.0, f64::max);
    let mut found = Vec::new();
    let mut from = 0.0;
    while from <= largest {
        let here: Vec<&&Observation> =
            all.iter().filter(|one| (from..from + GROUP).contains(&one.delta)).collect();
        if here.len() >= FEWEST_ANSWERS {
            let count = here.len() as f64;
            let right: Vec<f64> = here.iter().map(|one| worth(one.judgement)).collect();
            let differences: Vec<f64> = here.iter().map(|one| one.delta).collect();
            let share = mean(&right);
            let variance = right.iter().map(|one| (one - share) * (one - share)).sum::<f64>() / (count - 1.0);
            let error = (variance / count).sqrt();
            found.push(ErrorBar::around(100.0 * mean(&differences), 100.0 * share, 100.0 * error));
        }
        from += GROUP;
    }
    found
}

/// Returns the score of an answer: 1 if correct, 0.5 for "I don't know", 0 if wrong.
fn worth(judgement: Judgement) -> f64 {
    match judgement {
        Judgement::Correct => 1.0,
        Judgement::Unsure => 0.5,
        Judgement::Wrong => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_have_the_share_of_right_answers_and_its_error() {
        let answers = |delta: f64, judgement, count: usize| vec![Observation { delta, judgement }; count];
        let subject = [
            answers(0.12, Judgement::Correct, 6),
            answers(0.12, Judgement::Wrong, 2),
            answers(0.13, Judgement::Unsure, 2),
            answers(0.31, Judgement::Correct, 4),
        ];
        let groups = groups(&[subject.concat()]);
        // 6 + 2/2 of 10 are right; four answers are too few for a group of their own.
        assert_eq!(groups.len(), 1);
        let [low, high] = [groups[0].low, groups[0].high];
        assert!((0.5 * (low + high) - 70.0).abs() < 1.0e-9, "{groups:?}");
        assert!((groups[0].x - 12.2).abs() < 1.0e-9, "{groups:?}");
        // The variance of six ones, two halves and two zeros about 0.7.
        let expected = 100.0 * ((6.0 * 0.09 + 2.0 * 0.04 + 2.0 * 0.49_f64) / 9.0 / 10.0).sqrt();
        assert!((0.5 * (high - low) - expected).abs() < 1.0e-9, "{groups:?}");
    }
}
