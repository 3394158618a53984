//! Tests by ranks, psychometric functions and quantiles against R: relative 1e-9.
//!
//! `tests/data/ranks.R` made the numbers.

#![allow(clippy::unwrap_used)] // tests may panic

use flotor_statistics::distribution::{chi_square_above, normal_quantile};
use flotor_statistics::probit::{Counts, probit, spread};
use flotor_statistics::rank::{friedman, kruskal_wallis, signed_rank};
use serde_json::Value;

/// What the project promises.
const RELATIVE_BOUND: f64 = 1.0e-9;

fn reference() -> Value {
    serde_json::from_str(include_str!("data/ranks.json")).unwrap()
}

#[track_caller]
fn near(what: &str, found: f64, expected: &Value) {
    let expected = expected.as_f64().unwrap_or_else(|| panic!("{what}: no reference value"));
    let error = if expected == 0.0 { found.abs() } else { (found / expected - 1.0).abs() };
    assert!(error < RELATIVE_BOUND, "{what}: {found} for {expected}, relative error {error:e}");
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

fn lists(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}

fn each(name: &str) -> Vec<Value> {
    let all = reference()[name].as_array().unwrap().clone();
    assert!(all.len() > 4, "{name}");
    all
}

#[test]
fn pairs() {
    for one in each("pairs") {
        let found = signed_rank(&numbers(&one["first"]), &numbers(&one["second"])).unwrap();
        near("V", found.v, &one["v"]);
        near("p of V", found.p, &one["p"]);
    }
}

#[test]
fn conditions_and_groups() {
    for one in each("friedman") {
        let found = friedman(&lists(&one["rows"])).unwrap();
        near("Friedman", found.chi_square, &one["chi_square"]);
        near("df", found.df, &one["df"]);
        near("p of Friedman", found.p, &one["p"]);
    }
    for one in each("kruskal") {
        let found = kruskal_wallis(&lists(&one["groups"])).unwrap();
        near("Kruskal", found.chi_square, &one["chi_square"]);
        near("df", found.df, &one["df"]);
        near("p of Kruskal", found.p, &one["p"]);
    }
}

#[test]
fn psychometric_functions() {
    for one in each("curves") {
        let [level, positive, answers] = ["level", "positive", "answers"].map(|name| numbers(&one[name]));
        let counts: Vec<Counts> = (0..level.len())
            .map(|index| Counts { level: level[index], positive: positive[index], answers: answers[index] })
            .collect();
        let found = probit(&counts).unwrap();
        near("location", found.location, &one["location"]);
        near("spread", found.spread, &one["spread"]);
        near("spread alone", spread(&counts).unwrap(), &one["spread"]);
        near("deviance", found.deviance, &one["deviance"]);
    }
}

#[test]
fn quantiles_and_tails() {
    for one in each("quantiles") {
        let (found, expected) = (normal_quantile(one["p"].as_f64().unwrap()), one["z"].as_f64().unwrap());
        assert!((found - expected).abs() < RELATIVE_BOUND, "{found} for {expected}");
    }
    for one in each("chi_squares") {
        let [x, df] = ["x", "df"].map(|name| one[name].as_f64().unwrap());
        near("chi-square", chi_square_above(x, df), &one["p"]);
    }
}
