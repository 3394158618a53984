//! Plan of a session: its steps as far as no answer determines them.

use super::session::Session;
use super::step::{Phase, Signal};
use crate::design::{Condition, Design, TrackOrder};
use crate::factor::{between_levels, groups};
use crate::form::At;
use crate::method::{Method, Track};
use crate::order::Order;
use crate::random::Purpose;
use crate::task::Ask;
use std::collections::VecDeque;

/// Part of a session.
#[derive(Clone, Debug)]
pub(super) enum Item {
    Form {
        questionnaire: usize,
        block: u32,
    },
    Trial(Planned),
    /// Tracks of a block that are not over; never empty.
    Tracks(Vec<Running>),
}

/// Trial without the draws of its presentation.
#[derive(Clone, Debug)]
pub(super) struct Planned {
    pub(super) phase: Phase,
    pub(super) block: u32,
    pub(super) condition: Condition,
    pub(super) level: Option<f64>,
    pub(super) signal: Signal,
}

/// Track in progress.
#[derive(Clone, Debug)]
pub(super) struct Running {
    pub(super) number: u32,
    pub(super) block: u32,
    pub(super) condition: Condition,
    pub(super) track: Track,
    pub(super) trials: u32,
}

/// Plans a session.
pub(super) fn items(design: &Design, session: Session) -> VecDeque<Item> {
    let mut items = VecDeque::new();
    let forms = |at: At, block: u32| {
        let all = design.questionnaires().iter().enumerate();
        let here = all.filter(move |(_, form)| form.at == at);
        here.map(move |(questionnaire, _)| Item::Form { questionnaire, block }).collect::<Vec<_>>()
    };
    items.extend(forms(At::Start, 0));
    let between = between_condition(design, session);
    let mut tracks = 0;
    for (condition, block) in block_order(design, session).into_iter().zip(1..) {
        let condition: Condition = between.clone().into_iter().chain(condition).collect();
        if block == 1 {
            items.extend(practice(design, session, &condition).into_iter().map(Item::Trial));
        }
        match design.method() {
            Method::Constant { levels, repetitions } => {
                let trials = constant(design, session, (&condition, block), levels, *repetitions);
                items.extend(trials.into_iter().map(Item::Trial));
            }
            _ => items.push_back(Item::Tracks(start(design, session, (&condition, block), &mut tracks))),
        }
        items.extend(forms(At::AfterBlock, block));
    }
    let last = items.iter().rev().find_map(|item| match item {
        Item::Trial(planned) => Some(planned.block),
        Item::Tracks(tracks) => tracks.first().map(|track| track.block),
        Item::Form { .. } => None,
    });
    items.extend(forms(At::End, last.unwrap_or(0)));
    items
}

/// Returns the levels of the factors that vary between subjects.
fn between_condition(design: &Design, session: Session) -> Condition {
    let levels = between_levels(design.factors(), session.seed, session.subject);
    let pairs = design.factors().iter().zip(levels);
    pairs
        .filter_map(|(factor, level)| Some((factor.name.clone(), factor.values.get(level?)?.clone())))
        .collect()
}

/// Returns the conditions of the blocks in order. Each group of subjects, each repetition and each session takes the next row of the
/// order.
fn block_order(design: &Design, session: Session) -> Vec<Condition> {
    let conditions = design.block_conditions();
    let blocks = design.blocks();
    // The number of a subject within the group of subjects with the same levels.
    let in_group = (usize::from(session.subject.get()) - 1) / groups(design.factors()).max(1);
    let earlier = session.session.saturating_sub(1) * blocks.repetitions;
    let row = |repetition: u32| {
        let before = if blocks.order == Order::Alternate {
            session.session.saturating_sub(1)
        } else {
            earlier + repetition
        };
        let row = in_group + before as usize;
        let draw = (session.subject.get(), earlier + repetition + 1);
        blocks.order.row(conditions.len(), row, session.seed, draw)
    };
    let order = (0..blocks.repetitions).flat_map(row);
    order.filter_map(|index| conditions.get(index).cloned()).collect()
}

/// Offsets of the streams of a block among the streams of the schedule, above those of orders (at most 99 sessions of 99 repetitions).
const OF_BLOCKS: u32 = 100_000;
const OF_PRACTICE: u32 = 50_000;

/// Returns the trials of a block with constant stimuli, in random order.
fn constant(
    design: &Design,
    session: Session,
    (condition, block): (&Condition, u32),
    levels: &[f64],
    repetitions: u32,
) -> Vec<Planned> {
    let levels: Vec<Option<f64>> = match (levels, design.stimulus()) {
        ([], None) => vec![None],
        // Two choices: level 1 has the signal.
        ([], Some(_)) => vec![Some(1.0)],
        (levels, _) => levels.iter().copied().map(Some).collect(),
    };
    let absent = absent_trials(design, levels.len() as f64 * f64::from(repetitions));
    let mut trials = Vec::new();
    for mixed in design.mixed_conditions() {
        let condition: Condition = condition.clone().into_iter().chain(mixed).collect();
        let planned = |level, signal| Planned {
            phase: Phase::Main,
            block,
            condition: condition.clone(),
            level,
            signal,
        };
        for level in &levels {
            trials.extend((0..repetitions).map(|_| planned(*level, Signal::Present)));
        }
        trials.extend((0..absent).map(|_| planned(levels.first().copied().flatten(), Signal::Absent)));
    }
    session.stream(Purpose::Schedule, OF_BLOCKS + block).shuffle(&mut trials);
    trials
}

/// Returns the number of trials without the signal beside a number of trials with it.
fn absent_trials(design: &Design, present: f64) -> u32 {
    let Ask::Detection { absent_share } = design.task().ask else { return 0 };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a share of some thousand trials
    let absent = (present * absent_share / (1.0 - absent_share)).round() as u32;
    absent
}

/// Starts the tracks of a block, in random order; `tracks` is the number of tracks so far.
fn start(
    design: &Design,
    session: Session,
    (condition, block): (&Condition, u32),
    tracks: &mut u32,
) -> Vec<Running> {
    let method = design.method();
    let mut started: Vec<(Condition, Track)> = Vec::new();
    for mixed in design.mixed_conditions() {
        let condition: Condition = condition.clone().into_iter().chain(mixed).collect();
        let each = (0..method.tracks()).filter_map(|index| method.start(index));
        started.extend(each.map(|track| (condition.clone(), track)));
    }
    if design.blocks().tracks == TrackOrder::Successive {
        session.stream(Purpose::Schedule, OF_BLOCKS + block).shuffle(&mut started);
    }
    let number = |(condition, track)| {
        *tracks += 1;
        Running { number: *tracks, block, condition, track, trials: 0 }
    };
    started.into_iter().map(number).collect()
}

/// Returns the practice trials, in conditions of the first block in random order, at the level that is easiest to judge.
fn practice(design: &Design, session: Session, condition: &Condition) -> Vec<Planned> {
    let mut mixed = design.mixed_conditions();
    session.stream(Purpose::Schedule, OF_PRACTICE).shuffle(&mut mixed);
    let level = design.stimulus().map(|_| design.method().practice_level());
    let with = mixed.into_iter().cycle().take(design.blocks().practice as usize);
    let planned = |(mixed, index): (Condition, u32)| {
        // Every other trial of a detection has no signal.
        let is_absent = index % 2 == 1 && matches!(design.task().ask, Ask::Detection { .. });
        Planned {
            phase: Phase::Practice,
            block: 1,
            condition: condition.clone().into_iter().chain(mixed).collect(),
            level,
            signal: if is_absent { Signal::Absent } else { Signal::Present },
        }
    };
    with.zip(0..).map(planned).collect()
}
