//! Whole simulated studies, many of them: does the method give what CMU-RI-TR-07-21 reports, and does the staircase
//! err as it is known to?

#![allow(clippy::unwrap_used, clippy::cast_possible_truncation, clippy::cast_sign_loss)] // tests may panic

use flotor_analysis::{
    Analysis, AnalysisOptions, Estimator, JndAnalysis, SubjectRecord, analyse_jnd, analyse_magnitude,
};
use flotor_study::bias::{BiasRow, Method, rows};
use flotor_study::log::TrialEvent;
use flotor_study::observer::TernaryObserver;
use flotor_study::observer::{Population, Sensitivity, SimulatedSubject};
use flotor_study::procedure::{Procedure, WeightedUpDownRule};
use flotor_study::protocol::{JndProtocol, MagnitudeProtocol, Protocol, SubjectNumber};
use flotor_study::sitting::Sitting;
use flotor_study::trial::Exploration;

/// Studies of one experiment; `FLOTOR_TEST_SIZE=full` takes more of them, with the same bounds.
fn studies() -> u64 {
    if std::env::var("FLOTOR_TEST_SIZE").as_deref() == Ok("full") { 400 } else { 40 }
}

/// A sitting without apparatus and without a log.
fn rehearse(mut sitting: Sitting, subject: &SimulatedSubject) -> (Sitting, Vec<TrialEvent>) {
    let mut events = Vec::new();
    while let Some(trial) = sitting.next() {
        let response = subject.respond(&trial);
        let exploration = Exploration::default();
        let Ok(verdict) = sitting.answer(response, &exploration) else { break };
        events.push(TrialEvent { trial, response, verdict, exploration });
    }
    (sitting, events)
}

fn subjects(protocol: &Protocol, population: &Population, seed: u64) -> Vec<SubjectRecord> {
    let subjects = (1..=16).filter_map(SubjectNumber::new);
    let sit = |subject| {
        let simulated = SimulatedSubject::new(population, seed, subject, 30.0);
        let (sitting, trials) = rehearse(Sitting::new(protocol, seed, subject), &simulated);
        let first_modality = protocol.first_modality().of(subject);
        SubjectRecord { subject, first_modality, trials, tracks: sitting.results().to_vec() }
    };
    subjects.map(sit).collect()
}

fn jnd(population: &Population, seed: u64) -> JndAnalysis {
    let protocol = JndProtocol::default();
    let subjects = subjects(&Protocol::Jnd(protocol.clone()), population, seed);
    analyse_jnd(&protocol, &subjects, &AnalysisOptions::default()).unwrap()
}

fn f_of(analysis: &JndAnalysis, effect: &str) -> f64 {
    analysis.anova.iter().find(|line| line.effect == effect).unwrap().f
}

/// Share of the values within a band.
fn share(values: &[f64], band: [f64; 2]) -> f64 {
    let inside = values.iter().filter(|value| (band[0]..=band[1]).contains(value)).count();
    inside as f64 / values.len() as f64
}

fn mean(values: &[f64]) -> f64 {
    flotor_statistics::describe::mean(values)
}

/// The bands hold 95 % of studies, found by an independent simulation of the same population: Weber fractions of .147
/// and .177 with a standard error of .011, t(15) 1.8 to 5.8, F for the base 43 to 124, 212 pairs with a deviation of
/// 13.
#[test]
fn simulated_studies_reproduce_the_thesis() {
    let analyses: Vec<JndAnalysis> = (0..studies()).map(|seed| jnd(&Population::default(), seed)).collect();
    let of = |value: fn(&JndAnalysis) -> f64| analyses.iter().map(value).collect::<Vec<f64>>();

    // Means over studies: four standard errors of 40.
    assert!((mean(&of(|a| a.weber.vh)) - 0.147).abs() < 4.0 * 0.011 / 40.0_f64.sqrt());
    assert!((mean(&of(|a| a.weber.h)) - 0.177).abs() < 4.0 * 0.011 / 40.0_f64.sqrt());
    assert!((mean(&of(|a| a.pairs_per_subject)) - 212.0).abs() < 8.0);
    // Single studies: at least 80 % where 95 % are expected, 4.4 standard errors of a share of 40.
    assert!(share(&of(|a| a.t.tested().unwrap().value), [1.8, 5.8]) >= 0.8);
    assert!(share(&of(|a| f_of(a, "base")), [43.0, 124.0]) >= 0.8);
    assert!(share(&of(|a| a.weber.vh), [0.142 - 0.033, 0.142 + 0.033]) >= 0.8);
    assert!(share(&of(|a| a.weber.h), [0.172 - 0.033, 0.172 + 0.033]) >= 0.8);
    assert!(
        analyses
            .iter()
            .all(|a| a.t.tested().unwrap().df == 15.0 && (a.pairs_per_subject - 212.0).abs() < 40.0)
    );
    // Which modality comes first does nothing: p is even between 0 and 1, a tenth of them below 0.1.
    let order = of(|a| a.anova.iter().find(|line| line.effect == "order").unwrap().p);
    assert!(share(&order, [0.0, 0.1]) < 0.3);
}

/// The answers of a track without a threshold count for the most likely observer, and were "omitted" in its text too.
#[test]
fn only_the_estimate_of_the_procedure_omits_a_track_without_a_threshold() {
    let protocol = Protocol::Jnd(JndProtocol::default());
    let mut subjects = subjects(&protocol, &Population::default(), 0);
    let unfinished = subjects.iter().flat_map(|subject| &subject.tracks).filter(|t| t.threshold.is_none());
    let count = unfinished.count() + 1;
    let track = subjects[0].tracks.iter_mut().find(|track| track.threshold.is_some()).unwrap();
    track.threshold = None;
    let text = |estimator| {
        let options = AnalysisOptions { estimator, ..AnalysisOptions::default() };
        Analysis::of(&protocol, &subjects, &options).unwrap().to_text()
    };
    let note = format!("{count} tracks did not reach a threshold and are omitted");
    assert!(text(Estimator::Procedure).contains(&note), "{}", text(Estimator::Procedure));
    assert!(!text(Estimator::Map).contains("omitted"), "{}", text(Estimator::Map));
}

#[test]
fn simulated_ratings_rise_linearly() {
    let protocol = MagnitudeProtocol::default();
    let r2: Vec<f64> = (0..studies())
        .map(|seed| {
            let subjects = subjects(&Protocol::Magnitude(protocol.clone()), &Population::default(), seed);
            let analysis = analyse_magnitude(&protocol, &subjects, &AnalysisOptions::default()).unwrap();
            assert_eq!(analysis.trials_per_subject, 72.0);
            assert_eq!((analysis.anova[2].df, analysis.anova[2].error_df), (1.0, 14.0));
            analysis.linear_r2
        })
        .collect();
    // Published: 0.983; expected of this population: 0.988.
    assert!((mean(&r2) - 0.983).abs() < 0.012, "mean R² {}", mean(&r2));
}

/// What the eight-reversal rule makes of a true threshold of 14.2 %: mean, deviation and trials as an independent
/// simulation of 1e5 tracks gives them.
#[test]
fn the_staircase_errs_as_it_is_known_to() {
    // Criterion, threshold in units of sigma, mean estimate, deviation, trials per track.
    let table = [
        (0.0, 0.6745, 0.209, 0.071, 25.1),
        (0.25, 0.6958, 0.199, 0.071, 21.2),
        (0.5, 0.7622, 0.192, 0.066, 19.1),
        (0.75, 0.8797, 0.186, 0.058, 18.0),
        (1.0, 1.0505, 0.180, 0.050, 17.6),
    ];
    // The other simulation has no floor.
    let rule = WeightedUpDownRule { floor: 0.0, ..WeightedUpDownRule::default() };
    let procedure = Procedure::WeightedUpDown(rule);
    let mut jnd = JndProtocol { bases: vec![26.0], replications: 20, procedure, ..JndProtocol::default() };
    jnd.demo.shown = false;
    let protocol = Protocol::Jnd(jnd);
    for (criterion, ratio, expected, deviation, trials) in table {
        let all = Sensitivity { sigma: 0.142 / ratio, criterion };
        let population = Population {
            vh: all,
            h: all,
            subject_spread: 0.0,
            modality_spread: 0.0,
            criterion_spread: 0.0,
            ..Population::default()
        };
        let (mut thresholds, mut lengths) = (Vec::new(), Vec::new());
        for seed in 0..studies().min(100) {
            for subject in subjects(&protocol, &population, seed) {
                thresholds.extend(subject.tracks.iter().filter_map(|track| track.threshold));
                lengths.extend(subject.tracks.iter().map(|track| f64::from(track.trials)));
            }
        }
        let n = thresholds.len() as f64;
        let error = mean(&thresholds) - expected;
        // Four standard errors, and half a unit of the last printed digit twice: the table is rounded.
        let bound = 4.0 * deviation / n.sqrt() + 1.0e-3;
        assert!(error.abs() < bound, "criterion {criterion}: {} for {expected}", mean(&thresholds));
        let found = flotor_statistics::describe::deviation(&thresholds);
        assert!((found / deviation - 1.0).abs() < 0.05, "criterion {criterion}: deviation {found}");
        assert!((mean(&lengths) - trials).abs() < 0.25, "criterion {criterion}: {} trials", mean(&lengths));
    }
}

/// The better estimators find the threshold, where the thesis's rule is a quarter or more too high. Observers of the
/// default population, and some who say "I don't know" less often or never; two tracks make an estimate, as in the experiment.
#[test]
fn better_estimators_find_the_threshold() {
    let runs = match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => 10_000,
        Ok("daily") => 150,
        _ => 60,
    };
    for (threshold, criterion) in [(0.1114, 1.0), (0.1357, 1.0), (0.142, 0.0), (0.142, 0.25), (0.142, 0.5)] {
        let rows = rows(&TernaryObserver::with_threshold(threshold, criterion), 2, runs, 5);
        let of = |method| *rows.iter().find(|row| row.method == method).unwrap();
        let (thesis, map, quest) = (of(Method::Thesis), of(Method::Map), of(Method::QuestPlus));
        // Four standard errors of the mean beside the promised bound.
        let within = |row: &BiasRow, bound: f64| {
            row.bias.abs() <= bound + 4.0 * row.deviation / f64::from(row.runs).sqrt()
        };
        assert!(within(&map, 0.03), "{map:?}");
        assert!(within(&quest, 0.08), "{quest:?}");
        assert_eq!(quest.trials, 18.0);
        assert!(thesis.bias > 0.2, "{thesis:?}");
        // The error of a root mean square is a share of 1 / sqrt(2 n) of it.
        let half = 0.5 * thesis.rms_error * (1.0 + 4.0 / f64::from(2 * runs).sqrt());
        assert!(map.rms_error <= half && quest.rms_error <= half, "{thesis:?} {map:?} {quest:?}");
    }
}

/// The table is of an independent simulation, `tests/generators/estimators.py`.
#[test]
fn estimators_err_as_an_independent_simulation_does() {
    let table = include_str!("../../../tests/data/cases/estimators.csv");
    let runs = match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => 10_000,
        Ok("daily") => 150,
        _ => 60,
    };
    let lines: Vec<Vec<&str>> = table.lines().skip(1).map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 7 * Method::ALL.len());
    for observer in lines.chunks(Method::ALL.len()) {
        let number = |line: &[&str], column: usize| line[column].parse::<f64>().unwrap();
        let (criterion, threshold) = (number(&observer[0], 0), number(&observer[0], 1));
        let found = rows(&TernaryObserver::with_threshold(threshold, criterion), 2, runs, 19);
        for (line, row) in observer.iter().zip(found) {
            assert_eq!(line[2], row.method.word());
            let [estimates, bias, deviation, trials] = [3, 4, 5, 6].map(|column| number(line, column));
            // Four standard errors of a difference of means, and of a ratio of deviations; the length of a track scatters by a third.
            let counts = 1.0 / f64::from(runs) + 1.0 / estimates;
            assert!((row.bias - bias).abs() <= 4.0 * deviation * counts.sqrt(), "{bias}: {row:?}");
            let ratio = (row.deviation / deviation).ln();
            assert!(ratio.abs() <= 4.0 * (0.5 * counts).sqrt(), "{deviation}: {row:?}");
            let length = (row.trials / trials - 1.0).abs();
            assert!(length <= 4.0 / 3.0 * (0.5 * counts).sqrt(), "{trials}: {row:?}");
        }
    }
}

/// Every printed p is one: with equal observers in both modalities a paired test and the comparisons after Holm's correction
/// say yes in 5 % of the studies.
#[test]
fn false_alarms_are_as_often_as_they_should_be_and_power_grows_with_the_subjects() {
    use flotor_analysis::power::{population, power, study};
    // Ten seconds of a core.
    if !matches!(std::env::var("FLOTOR_TEST_SIZE").as_deref(), Ok("daily" | "full")) {
        return;
    }
    let protocol = JndProtocol { replications: 2, ..JndProtocol::default() };
    let runs = 5 * studies();
    let of = |ratio: f64, subjects: u16| {
        let observers = population(ratio, 0.0);
        let all = (0..runs).filter_map(|seed| study(&protocol, &observers, subjects, 7000 + seed).ok());
        power(subjects, &all.collect::<Vec<_>>())
    };
    let none = of(1.0, 8);
    let se = (0.05 * 0.95 / runs as f64).sqrt();
    assert!((none.power - 0.05).abs() <= 3.0 * se, "{none:?}");
    let (few, many) = (of(1.3, 5), of(1.3, 20));
    assert!(few.power + 3.0 * few.standard_error < many.power, "{few:?} {many:?}");
}
