//! Figure of a subject's adaptive tracks, one panel per track: differences, answers and reversals.

use super::MODALITIES;
use flotor_analysis::SubjectRecord;
use flotor_plot::{Axis, Figure, Mark, Panel, Series};
use flotor_study::protocol::Stimulus;
use flotor_study::sitting::{TrackResult, Verdict};
use flotor_study::trial::Judgement;

/// Style slots of wrong answers, "I don't know", and reversals.
const WRONG: usize = 6;
const UNSURE: usize = 4;
const REVERSAL: usize = 7;

/// Judged answer of a track.
struct Answer {
    /// Number of the trial in the track, from 1.
    trial: f64,
    difference_percent: f64,
    judgement: Judgement,
    is_reversal: bool,
}

/// Plots the completed tracks of a subject, in the order of their bases.
pub(in super::super) fn tracks(record: &SubjectRecord, stimulus: &Stimulus) -> Figure {
    let answers: Vec<(&TrackResult, Vec<Answer>)> =
        record.tracks.iter().map(|track| (track, answers(record, track))).collect();
    let largest = answers
        .iter()
        .flat_map(|(_, answers)| answers)
        .map(|answer| answer.difference_percent)
        .fold(1.0, f64::max);
    let figure = Figure::new(format!("Adaptive tracks of {}", record.subject), Axis::linear("Trial of the track", ""))
        .subtitle(
            "Difference in % of the base. Filled in colour: right; cross: wrong; orange triangle: \"I don't know\"; ring: reversal; \
             dashed: threshold of the procedure",
        )
        .columns(3)
        .panel_height_px(110.0);
    let (_, unit) = stimulus.name_and_unit();
    let mut panels: Vec<_> = answers.iter().collect();
    panels.sort_by(|(one, _), (other, _)| one.base.total_cmp(&other.base));
    panels
        .into_iter()
        .fold(figure, |figure, (track, answers)| figure.panel(panel(track, answers, unit, largest)))
}

/// Returns the judged answers of a track, in order.
fn answers(record: &SubjectRecord, track: &TrackResult) -> Vec<Answer> {
    let here = record.judged().filter(|(event, ..)| event.trial.track == track.track);
    (1_u32..)
        .zip(here)
        .map(|(trial, (event, observation, _))| Answer {
            trial: f64::from(trial),
            difference_percent: observation.delta * 100.0,
            judgement: observation.judgement,
            is_reversal: matches!(event.verdict, Verdict::Judged { reversal: true, .. }),
        })
        .collect()
}

fn panel(track: &TrackResult, answers: &[Answer], unit: &str, largest: f64) -> Panel {
    let (slot, name) = MODALITIES
        .into_iter()
        .enumerate()
        .find(|(_, (modality, _))| *modality == track.modality)
        .map_or((0, ""), |(slot, (_, name))| (slot, name));
    let place = |answer: &Answer| (answer.trial, answer.difference_percent);
    let of =
        |judgement: Judgement| answers.iter().filter(move |answer| answer.judgement == judgement).map(place);
    let reversals = answers.iter().filter(|answer| answer.is_reversal).map(place);
    // The unit is in the subtitle: panel headings are too narrow.
    let panel = Panel::new(Axis::linear("", "").range(0.0, 1.08 * largest))
        .title(format!("{} {unit}, {name}, track {}", track.base, track.track))
        .series(Series::line("", answers.iter().map(place)).slot(slot).faint())
        .series(Series::points("", of(Judgement::Correct)).slot(slot))
        .series(Series::points("", of(Judgement::Wrong)).slot(WRONG))
        .series(Series::points("", of(Judgement::Unsure)).slot(UNSURE))
        .series(Series::points("", reversals).slot(REVERSAL));
    match track.threshold {
        Some(threshold) => panel.mark(Mark::at_y(threshold * 100.0, format!("{:.1} %", threshold * 100.0))),
        None => panel,
    }
}
