//! Intervals cover the truth as often as they say, and the law is the right one: simulated things behind a simulated rig, each run with
//! contact, motion and noise of its own.
//!
//! `FLOTOR_TEST_SIZE=full cargo test --release -p flotor-identify --test monte_carlo -- --nocapture` makes a thousand runs of each thing.

mod plants;

use flotor_identify::{Device, Identification, Law, identify};
use plants::{Plant, Run};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Runs of each thing.
fn runs() -> u64 {
    match std::env::var("FLOTOR_TEST_SIZE").as_deref() {
        Ok("full") => 1000,
        Ok("daily") => 12,
        _ => 3,
    }
}

fn identified(plant: &Plant) -> Vec<(Run, Identification)> {
    let one = |seed| {
        let run = plant.measure(seed);
        let identified =
            identify(&run.measurement, &Law::ALL, Device::default()).expect("a law can be fitted");
        (run, identified)
    };
    (0..runs()).into_par_iter().map(one).collect()
}

/// Things of the ladder: at most one run in a hundred finds another law, and the intervals of each parameter, of all things that have it,
/// cover the truth in 93 to 97 % of the runs, as far as this number of runs tells: with these shares, as few or as many have a
/// probability above 1e-3. Things outside: `none of these`.
#[test]
fn laws_are_found_and_intervals_cover_the_truth() {
    let mut covered: BTreeMap<&str, (u64, u64)> = BTreeMap::new();
    for plant in plants::all() {
        let results = identified(&plant);
        let wrong = results.iter().filter(|(_, identified)| identified.name() != plant.law).count();
        println!("{:<20} {wrong} wrong of {}", plant.name, results.len());
        assert!(wrong * 100 <= results.len(), "{}: {wrong} of {}", plant.name, results.len());
        for (run, identified) in results.iter().filter(|(_, identified)| identified.law.is_some()) {
            for estimate in &identified.parameters {
                if let Some((_, truth)) =
                    run.truth.iter().find(|(id, _)| *id == estimate.id && plant.law != "table")
                {
                    let (hits, count) = covered.entry(estimate.id).or_default();
                    *hits += u64::from((estimate.low..=estimate.high).contains(truth));
                    *count += 1;
                }
            }
        }
    }
    for (id, (hits, count)) in covered {
        let share = hits as f64 / count as f64;
        println!("{id:<24} {:.1} % of {count}", share * 100.0);
        let as_few = at_most(hits, count, 0.93);
        // As many hits are as few misses.
        let as_many = at_most(count - hits, count, 1.0 - 0.97);
        assert!(as_few > 1.0e-3 && as_many > 1.0e-3, "{id}: {share} of {count}");
    }
}

/// Returns the probability of at most `hits` of `count` with the probability `each` (binomial distribution).
fn at_most(hits: u64, count: u64, each: f64) -> f64 {
    // By logarithms: the first terms of a thousand runs are below the smallest number.
    let mut term_ln = count as f64 * (1.0 - each).ln();
    let mut sum = term_ln.exp();
    for number in 0..hits {
        term_ln += ((count - number) as f64 / (number + 1) as f64 * each / (1.0 - each)).ln();
        sum += term_ln.exp();
    }
    sum
}

/// The same thing in millimetres, newtons of another scale or slower time has the same law and the same numbers in these units.
#[test]
fn units_change_nothing() {
    let plants = plants::all();
    let plant = plants.iter().find(|plant| plant.name == "zener").unwrap();
    let run = plant.measure(7);
    let (measurement, ids) = (&run.measurement, ["stiffness_n_per_m", "relaxation_s", "contact_m"]);
    let first = identify(measurement, &[Law::Zener], Device::default()).unwrap();
    let scaled = |values: &[f64], by: f64| values.iter().map(|value| value * by).collect::<Vec<f64>>();
    let stronger = flotor_identify::Measurement::new(
        measurement.time_s().map(<[f64]>::to_vec),
        scaled(measurement.displacement_m(), 64.0),
        scaled(measurement.force_n(), 1024.0),
    );
    let second = identify(&stronger.unwrap(), &[Law::Zener], Device::default()).unwrap();
    for (id, factor) in ids.into_iter().zip([16.0, 1.0, 64.0]) {
        let [one, other] = [&first, &second].map(|identified| identified.parameter(id).unwrap());
        // Powers of two scale without rounding; the scales of the search do not.
        assert!((other / one / factor - 1.0).abs() < 1.0e-5, "{id}: {one} {other}");
    }
}
