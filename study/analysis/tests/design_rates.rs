//! How often the tests of a designed study are wrong, and its intervals miss: rates over simulated data without an effect, and over
//! observers with known parameters. Bounds are the nominal rate and four standard errors of the count.

use flotor_analysis::designed::{power_of, study_of};
use flotor_statistics::detection::detection;
use flotor_statistics::distribution::normal_below;
use flotor_statistics::probit::{Counts, probit};
use flotor_statistics::rank::{friedman, kruskal_wallis, signed_rank};
use flotor_study_design::design::Design;
use flotor_study_design::observer::Population;
use flotor_study_design::random::{Purpose, Stream};
use serde_json::json;

/// Number of data sets.
const RUNS: u32 = 1500;

fn stream(kind: u16, run: u32) -> Stream {
    Stream::new(2026, Purpose::Answer, kind, run)
}

/// Returns four standard errors of a share of the runs.
fn four_errors(share: f64) -> f64 {
    4.0 * (share * (1.0 - share) / f64::from(RUNS)).sqrt()
}

fn share(of: impl Fn(u32) -> bool) -> f64 {
    f64::from((0..RUNS).map(|run| u32::from(of(run))).sum::<u32>()) / f64::from(RUNS)
}

/// Tests by ranks: at most 5 % false alarms, for normal and for skewed data.
#[test]
fn tests_by_ranks_keep_their_level() {
    let most = 0.05 + four_errors(0.05);
    for skewed in [0.0, 1.0] {
        let draw = |stream: &mut Stream| {
            let x = stream.normal();
            if skewed > 0.0 { libm::exp(x) } else { x }
        };
        let wilcoxon = share(|run| {
            let stream = &mut stream(1, run);
            let [first, second]: [Vec<f64>; 2] =
                std::array::from_fn(|_| (0..12).map(|_| draw(stream)).collect());
            signed_rank(&first, &second).expect("pairs").p < 0.05
        });
        let of_friedman = share(|run| {
            let stream = &mut stream(2, run);
            let rows: Vec<Vec<f64>> = (0..12).map(|_| (0..4).map(|_| draw(stream)).collect()).collect();
            friedman(&rows).expect("conditions").p < 0.05
        });
        let kruskal = share(|run| {
            let stream = &mut stream(3, run);
            let groups: Vec<Vec<f64>> = (0..3).map(|_| (0..8).map(|_| draw(stream)).collect()).collect();
            kruskal_wallis(&groups).expect("groups").p < 0.05
        });
        println!("false alarms: Wilcoxon {wilcoxon:.3}, Friedman {of_friedman:.3}, Kruskal {kruskal:.3}");
        assert!(wilcoxon < most && of_friedman < most && kruskal < most);
        // A test that never fires would keep its level, too.
        assert!(wilcoxon > 0.02 && of_friedman > 0.02 && kruskal > 0.02);
    }
}

/// Intervals of the psychometric function: 95 % of them have the location and the spread of the observer; an end without a bound counts as
/// open. Answers without a function are left out, and are few.
#[test]
fn intervals_of_psychometric_functions_cover() {
    let (location, spread) = (0.03, 0.2);
    let levels = [-0.4, -0.2, 0.0, 0.2, 0.4];
    let (mut fitted, mut of_location, mut of_spread) = (0_u32, 0_u32, 0_u32);
    for run in 0..RUNS / 3 {
        let stream = &mut stream(4, run);
        let counts = levels.map(|level| {
            let probability = normal_below((level - location) / spread);
            let positive = (0..24).filter(|_| stream.uniform() < probability).count() as f64;
            Counts { level, positive, answers: 24.0 }
        });
        let Ok(found) = probit(&counts) else { continue };
        let covers = |[low, high]: [Option<f64>; 2], truth: f64| {
            low.is_none_or(|low| low <= truth) && high.is_none_or(|high| truth <= high)
        };
        fitted += 1;
        of_location += u32::from(covers(found.location_interval, location));
        of_spread += u32::from(covers(found.spread_interval, spread));
    }
    let n = f64::from(fitted);
    let four = 4.0 * (0.95 * 0.05 / n).sqrt();
    let [of_location, of_spread] = [of_location, of_spread].map(|count| f64::from(count) / n);
    println!("coverage: location {of_location:.3}, spread {of_spread:.3} of {fitted}");
    assert!(f64::from(RUNS / 3) - n < 0.02 * n, "{fitted} fitted");
    assert!((of_location - 0.95).abs() < four && (of_spread - 0.95).abs() < four);
}

/// Intervals of sensitivity and criterion cover in at least 95 % less four standard errors: with rates near 0 or 1 they are too wide
/// rather than too narrow.
#[test]
fn intervals_of_sensitivity_cover() {
    for (d_prime, criterion) in [(0.0, 0.0), (1.0, 0.3), (1.5, -0.4)] {
        let mut covered = [0_u32; 2];
        for run in 0..RUNS {
            let stream = &mut stream(5, run);
            let mut reports =
                |shift: f64| (0..40).filter(|_| shift + stream.normal() > 0.5 * d_prime + criterion).count();
            let (hits, false_alarms) = (reports(d_prime), reports(0.0));
            let found = detection([hits, 40], [false_alarms, 40]).expect("both kinds");
            let inside = |[low, high]: [f64; 2], truth: f64| u32::from(low <= truth && truth <= high);
            covered[0] += inside(found.d_prime_interval, d_prime);
            covered[1] += inside(found.criterion_interval, criterion);
        }
        let shares = covered.map(|count| f64::from(count) / f64::from(RUNS));
        println!("d' {d_prime}, c {criterion}: coverage {shares:?}");
        assert!(shares.iter().all(|share| *share > 0.95 - four_errors(0.95) && *share < 0.99));
    }
}

/// Without an effect the power is the level of the test; with a large one it is found.
#[test]
fn power_without_an_effect_is_the_level() {
    let design: Design = serde_json::from_value(json!({
        "study": "rated",
        "factor": [
            { "name": "delay", "setting": "device.delay", "values": [0, 20] },
            { "name": "hand", "setting": "device.hand", "values": ["left", "right"], "vary": "between" },
        ],
        "task": { "ask": "rating", "scale": { "least": 1, "most": 100 } },
        "method": { "kind": "constant", "repetitions": 2 },
    }))
    .expect("a design");
    let with = |effect: f64| {
        let effect = [("delay".to_owned(), vec![0.0, effect])].into();
        let population = Population {
            noise: 5.0,
            subject_spread: 8.0,
            condition_spread: 3.0,
            effect,
            ..Population::default()
        };
        let studies: Vec<_> =
            (0..RUNS).map(|run| study_of(&design, &population, 12, u64::from(run))).collect();
        power_of(&studies)
    };
    let none = with(0.0);
    assert_eq!(none.len(), 3, "{none:?}");
    for effect in &none {
        assert!((effect.share - 0.05).abs() < four_errors(0.05), "{effect:?}");
    }
    let delay = |powers: &[flotor_analysis::designed::EffectPower]| {
        powers.iter().find(|one| one.effect == "delay").map_or(0.0, |one| one.share)
    };
    assert!(delay(&with(8.0)) > 0.5 && delay(&none) < 0.1);
}
