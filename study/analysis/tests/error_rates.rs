//! How often each test of a report is wrong, and how often an interval has the true value: over many data sets whose truth is known.
//!
//! ```console
//! $ FLOTOR_TEST_SIZE=full cargo test --release -p flotor-analysis --test error_rates -- --nocapture --test-threads 1
//! ```
//!
//! prints every share over 10 000 data sets, with the bounds that it is held to: 4.4 to 5.6 % where the assumptions of a test of 5 % hold,
//! at most 5.6 % where a test is exact or conservative, 93 to 97 % of intervals of 95 %. Fewer data sets (`daily` 200, else 40) have
//! bounds of three standard errors, where these are wider.

#![allow(clippy::unwrap_used)] // tests may panic

use flotor_analysis::{AnalysisOptions, PostHoc, SubjectRecord, analyse_jnd, analyse_magnitude};
use flotor_statistics::anova::Effect;
use flotor_statistics::distribution::binomial_at_least;
use flotor_study::estimate::{Observation, Prior, Psychometric, psychometric};
use flotor_study::log::TrialEvent;
use flotor_study::observer::TernaryObserver;
use flotor_study::procedure::{Procedure, QuestPlusRule};
use flotor_study::protocol::{JndProtocol, MagnitudeProtocol, SubjectNumber};
use flotor_study::sitting::{TrackResult, Verdict};
use flotor_study::trial::{Exploration, Judgement, Modality, Phase, Presented, Response, Trial};
use random::Random;
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

#[allow(unreachable_pub)] // another crate's, included
#[path = "../../../tests/src/printed.rs"]
mod printed;
#[path = "../../../tests/src/random.rs"]
mod random;

const LEVEL: f64 = 0.05;
/// The table of the book has the shares over so many.
const DATA_SETS_OF_THE_BOOK: u64 = 10_000;
/// People of a data set.
const SUBJECTS: u16 = 16;

fn data_sets() -> u64 {
    match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => DATA_SETS_OF_THE_BOOK,
        Ok("daily") => 200,
        _ => 40,
    }
}

impl Random {
    fn of(seed: u64) -> Self {
        // Seeds that follow each other name streams far apart.
        Self(Self(seed).bits())
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(std::f64::consts::TAU * self.uniform())
    }
}

/// What a share is held to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Held {
    /// The assumptions of the test hold: its level.
    Level,
    /// An exact or a conservative test: at most its level.
    AtMost,
    /// An interval of 95 %: its coverage.
    Coverage,
    /// Nothing: as measured.
    Nothing,
}

impl Held {
    fn bounds(self) -> [f64; 2] {
        match self {
            Self::Level => [0.044, 0.056],
            Self::AtMost => [0.0, 0.056],
            Self::Coverage => [0.93, 0.97],
            Self::Nothing => [0.0, 1.0],
        }
    }
}

/// Counts of events by name.
#[derive(Default)]
struct Shares(BTreeMap<(String, Held), [u64; 2]>);

impl Shares {
    fn take(&mut self, name: &str, held: Held, is_so: bool) {
        let [yes, all] = self.0.entry((name.to_owned(), held)).or_default();
        *yes += u64::from(is_so);
        *all += 1;
    }

    /// An effect with its corrections; `held` is what the test without a correction is held to.
    fn effect(&mut self, of: &str, effect: &Effect, held: Held) {
        let name = format!("{of}: {}", effect.effect);
        if !effect.is_testable() {
            return;
        }
        self.take(&name, held, effect.p < LEVEL);
        if let Some(sphericity) = effect.sphericity {
            let corrected = if held == Held::Level { Held::AtMost } else { Held::Nothing };
            self.take(&format!("{name}, Greenhouse and Geisser"), corrected, sphericity.p_gg < LEVEL);
            self.take(&format!("{name}, Huynh and Feldt"), Held::Nothing, sphericity.p_hf < LEVEL);
        }
    }

    /// One or more false alarms in a family of comparisons.
    fn family(&mut self, of: &str, name: &str, comparisons: &[PostHoc]) {
        let here = comparisons.iter().filter(|one| one.comparison.starts_with(name));
        let smallest = here.filter_map(|one| one.test.tested()).map(|test| test.p_holm).fold(1.0, f64::min);
        self.take(&format!("{of}: {name}, Holm"), Held::AtMost, smallest < LEVEL);
    }

    fn add(&mut self, other: Self) {
        for (name, counts) in other.0 {
            let sum = self.0.entry(name).or_default();
            sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
    }

    /// Prints every share and holds it to its bounds.
    fn check(&self) {
        let (mut outside, mut rows) = (Vec::new(), Vec::new());
        for ((name, held), [yes, all]) in &self.0 {
            let share = *yes as f64 / *all as f64;
            let [low, high] = held.bounds();
            let middle = if *held == Held::Coverage { 0.95 } else { LEVEL };
            let is_full = data_sets() == DATA_SETS_OF_THE_BOOK;
            let spread = if is_full { 0.0 } else { 3.0 * (LEVEL * (1.0 - LEVEL) / *all as f64).sqrt() };
            let (low, high) = (low.min(middle - spread), high.max(middle + spread));
            let said = match held {
                Held::Nothing => "as measured".to_owned(),
                Held::AtMost => format!("at most {:.1} %", high * 100.0),
                Held::Level | Held::Coverage => format!("{:.1} to {:.1} %", low * 100.0, high * 100.0),
            };
            let row = format!("| {name} | {said} | {:.1} % |", share * 100.0);
            println!("{row}");
            rows.push(row);
            if *held == Held::AtMost && share > high
                || matches!(held, Held::Level | Held::Coverage) && !(low..=high).contains(&share)
            {
                outside.push(format!("{name}: {share}"));
            }
        }
        assert!(outside.is_empty(), "{outside:#?}");
        if data_sets() == DATA_SETS_OF_THE_BOOK {
            rows.iter().for_each(|row| printed::assert_chapter_prints("experiments.md", row));
        }
    }
}

/// Counts over all data sets, on every core.
fn over_data_sets(of: impl Fn(u64, &mut Shares) + Sync) -> Shares {
    let (next, total) = (AtomicU64::new(0), Mutex::new(Shares::default()));
    let work = || {
        let mut shares = Shares::default();
        loop {
            let set = next.fetch_add(1, Ordering::Relaxed);
            if set >= data_sets() {
                break;
            }
            of(set, &mut shares);
        }
        total.lock().unwrap().add(shares);
    };
    std::thread::scope(|scope| {
        let cores = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
        (0..cores).for_each(|_| {
            scope.spawn(work);
        });
    });
    total.into_inner().unwrap()
}

/// How the noise of a subject's responses hangs together.
#[derive(Clone, Copy)]
enum Noise {
    /// Independent, of one variance: spherical.
    Equal,
    /// Each follows the one before, with a correlation of 0.8.
    Correlated,
}

/// Noise of so many responses.
fn noise(kind: Noise, count: usize, random: &mut Random) -> Vec<f64> {
    let mut before = random.normal();
    let mut one = || match kind {
        Noise::Equal => random.normal(),
        Noise::Correlated => {
            before = 0.8 * before + 0.6 * random.normal();
            before
        }
    };
    (0..count).map(|_| one()).collect()
}

fn people() -> impl Iterator<Item = SubjectNumber> {
    (1..=SUBJECTS).filter_map(SubjectNumber::new)
}

/// Thresholds without any effect: `unit` turns a base into what a threshold of 1 is there, as a share of the base.
fn thresholds(
    protocol: &JndProtocol,
    unit: fn(f64) -> f64,
    noises: Noise,
    random: &mut Random,
) -> Vec<SubjectRecord> {
    let record = |subject: SubjectNumber| {
        let own = 5.0 + random.normal();
        let noise = noise(noises, 2 * protocol.bases.len(), random);
        let cells = Modality::ALL
            .into_iter()
            .flat_map(|modality| protocol.bases.iter().map(move |base| (modality, *base)));
        let track = |((modality, base), noise): ((Modality, f64), f64)| TrackResult {
            track: 1,
            replication: 1,
            modality,
            base,
            threshold: Some((own + noise) * unit(base)),
            not_bounded: None,
            trials: 1,
        };
        SubjectRecord {
            subject,
            first_modality: protocol.first_modality.of(subject),
            trials: Vec::new(),
            tracks: cells.zip(noise).map(track).collect(),
        }
    };
    people().map(record).collect()
}

/// Ratings without any effect.
fn ratings(protocol: &MagnitudeProtocol, noises: Noise, random: &mut Random) -> Vec<SubjectRecord> {
    let record = |subject: SubjectNumber| {
        let own = 40.0 + 5.0 * random.normal();
        let noise = noise(noises, 2 * protocol.values.len(), random);
        let cells = Modality::ALL
            .into_iter()
            .flat_map(|modality| protocol.values.iter().map(move |value| (modality, *value)));
        let event = |(((modality, value), noise), number): (((Modality, f64), f64), u32)| TrialEvent {
            trial: Trial {
                number,
                phase: Phase::Main,
                replication: 1,
                track: 0,
                modality,
                presented: Presented::One { value },
                repeat: 0,
            },
            response: Response::Rating(own + noise),
            verdict: Verdict::Taken,
            exploration: Exploration::default(),
        };
        SubjectRecord {
            subject,
            first_modality: protocol.first_modality.of(subject),
            trials: cells.zip(noise).zip(1..).map(event).collect(),
            tracks: Vec::new(),
        }
    };
    people().map(record).collect()
}

#[test]
fn tests_of_thresholds_are_wrong_as_often_as_they_say() {
    let protocol = JndProtocol::default();
    let options = AnalysisOptions::default();
    over_data_sets(|set, shares| {
        let mut random = Random::of(set);
        // Equal in the unit of the stimulus, as the analysis of variance has them.
        let analysis = analyse_jnd(
            &protocol,
            &thresholds(&protocol, |base| 1.0 / base, Noise::Equal, &mut random),
            &options,
        )
        .unwrap();
        for effect in &analysis.anova {
            shares.effect("thresholds", effect, Held::Level);
        }
        shares.family("thresholds", "h - vh", &analysis.post_hoc);
        // Equal as shares of the base.
        let analysis =
            analyse_jnd(&protocol, &thresholds(&protocol, |_| 0.03, Noise::Equal, &mut random), &options)
                .unwrap();
        shares.take(
            "Weber fractions: difference of the modalities, t",
            Held::Level,
            analysis.t.tested().unwrap().p < LEVEL,
        );
        shares.family("Weber fractions", "fraction", &analysis.post_hoc);
        shares.effect(
            "Weber fractions, vision + haptics",
            analysis.constancy.vh.as_ref().unwrap(),
            Held::Level,
        );
        shares.effect("Weber fractions, haptics alone", analysis.constancy.h.as_ref().unwrap(), Held::Level);
        let is_covered = |[low, high]: [f64; 2]| low <= 0.15 && 0.15 <= high;
        shares.take(
            "interval of a Weber fraction",
            Held::Coverage,
            is_covered(analysis.weber_detail.vh.interval),
        );
    })
    .check();
}

#[test]
fn tests_of_ratings_are_wrong_as_often_as_they_say() {
    let protocol = MagnitudeProtocol::default();
    let options = AnalysisOptions::default();
    over_data_sets(|set, shares| {
        let mut random = Random::of(1 << 32 | set);
        for (noise, name, held) in [
            (Noise::Equal, "ratings", Held::Level),
            (Noise::Correlated, "ratings, correlated noise", Held::Nothing),
        ] {
            let analysis =
                analyse_magnitude(&protocol, &ratings(&protocol, noise, &mut random), &options).unwrap();
            for effect in &analysis.anova {
                // What is compared within a subject's modalities is not spherical with correlated noise; the modalities are two.
                let held = if effect.sphericity.is_none() { Held::Level } else { held };
                shares.effect(name, effect, held);
            }
            if matches!(noise, Noise::Equal) {
                let trend = analysis.trend.tested().unwrap().test.tested().unwrap();
                shares.take("ratings: linear trend", Held::Level, trend.p < LEVEL);
                shares.family("ratings", "h - vh", &analysis.post_hoc);
            }
        }
    })
    .check();
}

/// An observer that the prior of the estimators holds possible.
fn observer(prior: &Prior, random: &mut Random) -> (TernaryObserver, f64) {
    let threshold = prior.threshold_median * libm::exp(prior.threshold_spread * random.normal());
    let criterion = loop {
        let drawn = prior.criterion_mode + prior.criterion_spread * random.normal();
        if drawn >= 0.0 {
            break drawn;
        }
    };
    // Exponential with a mean of 2 %.
    let lapse = (-0.02 * libm::log(1.0 - random.uniform())).min(1.0);
    let unit = TernaryObserver { sigma: 1.0, criterion, bias: 0.0, lapse: 0.0 };
    (TernaryObserver { sigma: threshold / unit.threshold(0.75), lapse, ..unit }, threshold)
}

fn walk(
    procedure: &Procedure,
    tracks: usize,
    observer: &TernaryObserver,
    random: &mut Random,
) -> Vec<Observation> {
    let mut answers = Vec::new();
    for _ in 0..tracks {
        let mut track = procedure.start();
        while !track.is_done() {
            let delta = track.delta();
            let [correct, wrong] = observer.correct_and_wrong(delta);
            let judgement = match random.uniform() {
                draw if draw < correct => Judgement::Correct,
                draw if draw < correct + wrong => Judgement::Wrong,
                _ => Judgement::Unsure,
            };
            answers.push(Observation { delta, judgement });
            track.answer(judgement);
        }
    }
    answers
}

/// Answers of somebody who guesses.
const GUESSES: usize = 36;

/// Who names one of the two by tossing a coin.
fn guess(random: &mut Random) -> Vec<Observation> {
    let one = |_| Observation {
        delta: 0.4,
        judgement: if random.uniform() < 0.5 { Judgement::Correct } else { Judgement::Wrong },
    };
    (0..GUESSES).map(one).collect()
}

#[test]
fn intervals_of_thresholds_cover_the_truth_and_fits_are_rarely_refused() {
    let prior = Prior::default();
    let procedures = [
        ("weighted up-down", Procedure::default()),
        ("QUEST+", Procedure::QuestPlus(QuestPlusRule::default())),
    ];
    over_data_sets(|set, shares| {
        let mut random = Random::of(2 << 32 | set);
        let (observer, threshold) = observer(&prior, &mut random);
        for (name, procedure) in &procedures {
            let answers = walk(procedure, 2, &observer, &mut random);
            let Psychometric {
                threshold_interval: [low, high], lapse_most, p_chance, fit, not_bounded, ..
            } = psychometric(&answers, &prior, 0.75).unwrap();
            let is_covered =
                low.is_none_or(|low| low <= threshold) && high.is_none_or(|high| threshold <= high);
            shares.take(&format!("{name}: interval of a threshold"), Held::Coverage, is_covered);
            shares.take(
                &format!("{name}: largest lapse above the lapse"),
                Held::Nothing,
                observer.lapse <= lapse_most,
            );
            shares.take(&format!("{name}: an end is not bounded"), Held::Nothing, not_bounded.is_some());
            shares.take(&format!("{name}: the fit is refused"), Held::AtMost, fit.p < LEVEL);
            shares.take(&format!("{name}: worse than chance"), Held::AtMost, p_chance < LEVEL);
        }
        let attained = (1..=GUESSES).map(|wrong| binomial_at_least(wrong, GUESSES, 0.5));
        let attained = attained.filter(|p| *p < LEVEL).fold(0.0, f64::max);
        let name = format!("{GUESSES} coins: worse than chance, can attain {:.1} %", attained * 100.0);
        let guessed = psychometric(&guess(&mut random), &prior, 0.75).unwrap();
        shares.take(&name, Held::AtMost, guessed.p_chance < LEVEL);
    })
    .check();
}
