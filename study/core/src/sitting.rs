//! State machine of one subject's experiment, used for people, simulated observers and replay.
//!
//! [`Sitting::next`] returns the next trial, [`Sitting::answer`] processes its answer. Both depend only on the protocol, the seed,
//! the subject's number and the answers so far.

use crate::protocol::{
    AtBoundary, ComparisonSide, JndProtocol, MagnitudeProtocol, PresentationOrder, Protocol, SubjectNumber,
};
use crate::schedule;
use crate::trial::{Exploration, Judgement, Modality, Pair, Phase, Position, Presented, Response, Trial};
use flotor_study_design::estimate::NotBounded;
use flotor_study_design::procedure::Track;
use flotor_study_design::random::{Draws, Purpose};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Verdict on an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Answer does not count: the handle left its range, and the trial is repeated.
    Repeated,
    /// Answer accepted without judgement: practice, check or rating.
    Taken,
    /// Answer to a counted pair, judged.
    Judged {
        /// Judgement of the answer.
        judgement: Judgement,
        /// True for a reversal of the track.
        reversal: bool,
    },
}

/// Invalid answer to a trial.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnswerError {
    /// The answer does not fit the trial, such as a rating for a pair.
    #[error("`{}` is not a valid answer in this trial; give one of the offered answers", .0.word())]
    Kind(Response),
    /// A rating is not finite.
    #[error("a rating must be a finite number")]
    NotFinite,
    /// All trials were presented already.
    #[error("the experiment is complete; no further answer is accepted")]
    Over,
}

/// Result of a track.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrackResult {
    /// Track number, from 1.
    pub track: u32,
    /// Replication number, from 1.
    pub replication: u32,
    /// Modality of the track.
    pub modality: Modality,
    /// Base, in the stimulus's unit.
    pub base: f64,
    /// Threshold as a fraction of the base; `None` if the track ended without a threshold.
    pub threshold: Option<f64>,
    /// Sides on which the answers do not bound the threshold; `None` if the answers bound both sides, or for weighted up-down.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub not_bounded: Option<NotBounded>,
    /// Number of counted trials.
    pub trials: u32,
}

/// Remaining item of a sitting: a single presentation or an adaptive track.
#[derive(Clone, Debug)]
enum Item {
    Show { phase: Phase, replication: u32, modality: Modality, presented: Presented },
    Adapt { replication: u32, modality: Modality, base: f64 },
}

/// Track in progress.
#[derive(Clone, Debug)]
struct Running {
    track: Track,
    trials: u32,
    /// Remaining checks, each with the number of counted trials before it.
    checks: VecDeque<(u32, Phase)>,
    /// Counted pairs presented so far.
    pairs: Vec<Pair>,
}

impl Running {
    /// Returns the check that is due now; `None` if a counted trial is next.
    fn check(&self) -> Option<Phase> {
        self.checks.front().filter(|(after, _)| *after <= self.trials).map(|(_, check)| *check)
    }
}

/// Sitting of one subject.
#[derive(Clone, Debug)]
pub struct Sitting {
    protocol: Protocol,
    draws: Draws,
    items: VecDeque<Item>,
    running: Option<Running>,
    tracks_begun: u32,
    presented: u32,
    repeat: u32,
    results: Vec<TrackResult>,
}

impl Sitting {
    /// Creates the sitting at its first trial.
    #[must_use]
    pub fn new(protocol: &Protocol, seed: u64, subject: SubjectNumber) -> Self {
        let draws = Draws { seed, subject };
        let items = match protocol {
            Protocol::Jnd(jnd) => jnd_items(jnd, draws),
            Protocol::Magnitude(magnitude) => magnitude_items(magnitude, draws),
        };
        let mut sitting = Self {
            protocol: protocol.clone(),
            draws,
            items,
            running: None,
            tracks_begun: 0,
            presented: 0,
            repeat: 0,
            results: Vec::new(),
        };
        sitting.begin_track();
        sitting
    }

    /// Returns the number of the subject.
    #[must_use]
    pub fn subject(&self) -> SubjectNumber {
        self.draws.subject
    }

    /// Returns the number of answered presentations so far, practice, checks and repeats included.
    #[must_use]
    pub fn presented(&self) -> u32 {
        self.presented
    }

    /// Returns true if all trials were presented.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.items.is_empty()
    }

    /// Returns the results of the completed tracks, in order.
    #[must_use]
    pub fn results(&self) -> &[TrackResult] {
        &self.results
    }

    /// Returns the trial to present now, `None` if all trials were presented; does not change the state.
    #[must_use]
    pub fn next(&self) -> Option<Trial> {
        let item = self.items.front()?;
        let number = self.presented + 1;
        let (phase, replication, track, modality, presented) = match *item {
            Item::Show { phase, replication, modality, presented } => {
                (phase, replication, 0, modality, presented)
            }
            Item::Adapt { replication, modality, base } => {
                let (phase, pair) = self.of_track(base, number);
                (phase, replication, self.tracks_begun, modality, Presented::Pair(pair))
            }
        };
        Some(Trial { number, phase, replication, track, modality, presented, repeat: self.repeat })
    }

    /// Returns practice trials for a resumed sitting, in the modality of its next trial; these trials are not part of the sitting.
    /// Empty if the next trial is practice, the protocol has no practice, or the sitting is over.
    #[must_use]
    pub fn practice(&self) -> Vec<Trial> {
        let Some(Trial { modality, .. }) = self.next().filter(|next| next.phase != Phase::Practice) else {
            return Vec::new();
        };
        let draws = self.draws;
        let presented: Vec<Presented> = match &self.protocol {
            Protocol::Jnd(jnd) => {
                let demo = schedule::jnd_demo(jnd, draws).into_iter();
                demo.filter(|(of, _)| *of == modality).map(|(_, values)| practice_pair(values)).collect()
            }
            Protocol::Magnitude(magnitude) => {
                let demo = schedule::magnitude_demo(magnitude, draws, modality).into_iter();
                demo.map(|value| Presented::One { value }).collect()
            }
        };
        let (number, phase, replication, track, repeat) = (0, Phase::Practice, 0, 0, 0);
        let trial = |presented| Trial { number, phase, replication, track, modality, presented, repeat };
        presented.into_iter().map(trial).collect()
    }

    /// Processes the answer to the trial of [`Sitting::next`], and advances to the next trial or to a repeat.
    ///
    /// # Errors
    /// If the answer is of the wrong kind, a rating is not finite, or the sitting is over; the state is unchanged.
    pub fn answer(&mut self, response: Response, exploration: &Exploration) -> Result<Verdict, AnswerError> {
        let trial = self.next().ok_or(AnswerError::Over)?;
        check_kind(&trial, response)?;
        self.presented += 1;
        if exploration.boundary_hit
            && let AtBoundary::Repeat { most } = self.protocol.at_boundary()
            && self.repeat < most
        {
            self.repeat += 1;
            return Ok(Verdict::Repeated);
        }
        self.repeat = 0;
        if let (Phase::Catch | Phase::Obvious | Phase::RepeatCheck, Some(running)) =
            (trial.phase, &mut self.running)
        {
            running.checks.pop_front();
            return Ok(Verdict::Taken);
        }
        let judgement = match (trial.phase, trial.presented) {
            (Phase::Main, Presented::Pair(pair)) => judge(&pair, response),
            _ => None,
        };
        let (Some(judgement), Some(running)) = (judgement, &mut self.running) else {
            self.items.pop_front();
            self.begin_track();
            return Ok(Verdict::Taken);
        };
        running.trials += 1;
        if let Presented::Pair(pair) = trial.presented {
            running.pairs.push(pair);
        }
        let reversal = running.track.answer(judgement);
        if running.track.is_done() {
            self.end_track();
        }
        Ok(Verdict::Judged { judgement, reversal })
    }

    fn begin_track(&mut self) {
        if let (Some(Item::Adapt { .. }), Protocol::Jnd(jnd)) = (self.items.front(), &self.protocol) {
            self.tracks_begun += 1;
            let checks = schedule::track_checks(jnd, self.draws, self.tracks_begun).into();
            self.running =
                Some(Running { track: jnd.procedure.start(), trials: 0, checks, pairs: Vec::new() });
        }
    }

    fn end_track(&mut self) {
        if let (Some(Item::Adapt { replication, modality, base }), Some(running)) =
            (self.items.pop_front(), self.running.take())
        {
            let Running { track: ended, trials, .. } = running;
            let (track, threshold, not_bounded) = (self.tracks_begun, ended.threshold(), ended.not_bounded());
            let result = TrackResult { track, replication, modality, base, threshold, not_bounded, trials };
            self.results.push(result);
        }
        self.begin_track();
    }

    /// Returns phase and pair of the track's next trial, a counted one or a check.
    fn of_track(&self, base: f64, number: u32) -> (Phase, Pair) {
        let Some(running) = &self.running else { return (Phase::Main, self.pair(base, 0.0, number)) };
        match running.check() {
            Some(Phase::Catch) => (Phase::Catch, self.pair(base, 0.0, number)),
            Some(Phase::Obvious) => (Phase::Obvious, self.pair(base, self.obvious_delta(), number)),
            Some(Phase::RepeatCheck) => {
                // Do not repeat the last pair, if there are others: the subject would notice two equal pairs in a row.
                let earlier = running.pairs.len().saturating_sub(1).max(1);
                // If the check itself is repeated, present the same pair.
                let name = number - self.repeat;
                let which = self.draws.stream(Purpose::CheckTrial, name).below(earlier);
                let pair = running.pairs.get(which).copied();
                (Phase::RepeatCheck, pair.unwrap_or_else(|| self.pair(base, 0.0, number)))
            }
            _ => (Phase::Main, self.pair(base, running.track.delta(), number)),
        }
    }

    fn obvious_delta(&self) -> f64 {
        let Protocol::Jnd(jnd) = &self.protocol else { return 0.0 };
        jnd.checks.obvious.map_or(JndProtocol::LARGE_DELTA, |pairs| pairs.delta)
    }

    fn pair(&self, base: f64, delta: f64, number: u32) -> Pair {
        let Protocol::Jnd(jnd) = &self.protocol else {
            return pair(base, base, Position::Second, true);
        };
        let mut stream = self.draws.stream(Purpose::Presentation, number);
        // Both numbers are drawn in any case, so that the setting of order does not affect the draw of the side.
        let (second, above) = (stream.coin(), stream.coin());
        let comparison_at = match jnd.order {
            PresentationOrder::Random if second => Position::Second,
            PresentationOrder::Random | PresentationOrder::ComparisonFirst => Position::First,
            PresentationOrder::BaseFirst => Position::Second,
        };
        let above = match jnd.side {
            ComparisonSide::Above => true,
            ComparisonSide::Below => false,
            ComparisonSide::Random => above,
        };
        let comparison = if above { base * (1.0 + delta) } else { base * (1.0 - delta) };
        Pair { delta, ..pair(base, comparison, comparison_at, above) }
    }
}

fn pair(base: f64, comparison: f64, comparison_at: Position, above: bool) -> Pair {
    let larger_at = if above { comparison_at } else { comparison_at.other() };
    Pair { base, comparison, delta: (comparison - base).abs() / base, comparison_at, larger_at }
}

fn practice_pair([first, second]: [f64; 2]) -> Presented {
    Presented::Pair(pair(first, second, Position::Second, second > first))
}

pub(crate) fn check_kind(trial: &Trial, response: Response) -> Result<(), AnswerError> {
    match (trial.phase, trial.presented, response) {
        (Phase::Practice, _, Response::Seen)
        | (_, Presented::Pair(_), Response::First | Response::Second | Response::DontKnow) => Ok(()),
        (_, Presented::One { .. }, Response::Rating(rating)) if rating.is_finite() => Ok(()),
        (_, Presented::One { .. }, Response::Rating(_)) => Err(AnswerError::NotFinite),
        _ => Err(AnswerError::Kind(response)),
    }
}

fn judge(pair: &Pair, response: Response) -> Option<Judgement> {
    match response.named() {
        Some(named) if named == pair.larger_at => Some(Judgement::Correct),
        Some(_) => Some(Judgement::Wrong),
        None => (response == Response::DontKnow).then_some(Judgement::Unsure),
    }
}

fn jnd_items(jnd: &JndProtocol, draws: Draws) -> VecDeque<Item> {
    let demo = schedule::jnd_demo(jnd, draws).into_iter().map(|(modality, values)| {
        let presented = practice_pair(values);
        Item::Show { phase: Phase::Practice, replication: 0, modality, presented }
    });
    let first = jnd.first_modality.of(draws.subject);
    let orders = schedule::base_orders(jnd, draws).into_iter().zip(0_u32..);
    let tracks = orders.flat_map(|(order, index)| {
        let modality = schedule::alternating(first, index as usize);
        let bases = order.into_iter().filter_map(|base| jnd.bases.get(base).copied());
        bases.map(move |base| Item::Adapt { replication: index + 1, modality, base }).collect::<Vec<_>>()
    });
    demo.chain(tracks).collect()
}

fn magnitude_items(magnitude: &MagnitudeProtocol, draws: Draws) -> VecDeque<Item> {
    let first = magnitude.first_modality.of(draws.subject);
    let mut items = VecDeque::new();
    for (block, modality) in [first, first.other()].into_iter().enumerate() {
        let show = |phase, replication| {
            move |value| Item::Show { phase, replication, modality, presented: Presented::One { value } }
        };
        let demo = schedule::magnitude_demo(magnitude, draws, modality);
        items.extend(demo.into_iter().map(show(Phase::Practice, 0)));
        for replication in 1..=magnitude.replications {
            let stream = if block == 0 { replication } else { magnitude.replications + replication };
            let order = schedule::magnitude_order(magnitude, draws, stream);
            let order = schedule::with_repeat_checks(magnitude, draws, stream, &order);
            items.extend(order.into_iter().map(|(phase, value)| show(phase, replication)(value)));
        }
    }
    items
}

#[cfg(test)]
mod tests;
