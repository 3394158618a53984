//! Every result against R on published data: relative 1e-9, p-values included.
//!
//! `tests/data/reference.R` made the numbers and says where the data come from.

#![allow(clippy::unwrap_used, clippy::cast_possible_truncation, clippy::cast_sign_loss)] // tests may panic

use flotor_statistics::anova::{BetweenFactor, Design, Effect, SumOfSquares, WithinFactor, analyse};
use flotor_statistics::distribution::{
    fisher_above, normal_below, student_two_sided, student_two_sided_quantile,
};
use flotor_statistics::t_test::{TTest, Variances, one_sample, paired, two_groups};
use flotor_statistics::{regression, trend};
use serde_json::Value;

/// What the project promises.
const RELATIVE_BOUND: f64 = 1.0e-9;

fn reference() -> Value {
    serde_json::from_str(include_str!("data/reference.json")).unwrap()
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

fn rows(value: &Value) -> Vec<Vec<f64>> {
    value.as_array().unwrap().iter().map(numbers).collect()
}

fn list(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn index(value: &Value) -> usize {
    value.as_f64().unwrap() as usize
}

#[test]
fn t_tests() {
    let sleep = &reference()["t_tests"];
    let (first, second) = (numbers(&sleep["first"]), numbers(&sleep["second"]));
    let check = |what: &str, found: TTest| {
        let expected = &sleep[what];
        near(what, found.df, &expected["df"]);
        near(what, found.value, &expected["value"]);
        near(what, found.p, &expected["p"]);
        near(what, found.difference, &expected["difference"]);
        near(what, found.interval[0], &expected["interval"][0]);
        near(what, found.interval[1], &expected["interval"][1]);
    };
    check("paired", paired(&first, &second).unwrap());
    check("one_sample", one_sample(&second, 0.0).unwrap());
    check("welch", two_groups(&first, &second, Variances::Separate).unwrap());
    check("pooled", two_groups(&first, &second, Variances::Pooled).unwrap());
}

fn design(set: &Value) -> Design {
    let name = |factor: &Value| factor["name"].as_str().unwrap().to_owned();
    let between = list(&set["between"]).iter().map(|factor| BetweenFactor {
        name: name(factor),
        groups: list(&factor["groups"]).iter().map(index).collect(),
    });
    let within = list(&set["within"])
        .iter()
        .map(|factor| WithinFactor { name: name(factor), levels: index(&factor["levels"]) });
    Design::new(between.collect(), within.collect(), &rows(&set["responses"])).unwrap()
}

fn check_effect(what: &str, found: &Effect, expected: &Value) {
    near(what, found.sum_of_squares, &expected["sum_of_squares"]);
    near(what, found.df, &expected["df"]);
    near(what, found.error_sum_of_squares, &expected["error_sum_of_squares"]);
    near(what, found.error_df, &expected["error_df"]);
    near(what, found.f, &expected["f"]);
    near(what, found.p, &expected["p"]);
    assert_eq!(found.sphericity.is_some(), expected["epsilon_gg"].is_number(), "{what}");
    if let Some(sphericity) = found.sphericity {
        near(what, sphericity.epsilon_gg, &expected["epsilon_gg"]);
        near(what, sphericity.p_gg, &expected["p_gg"]);
        near(what, sphericity.epsilon_hf, &expected["epsilon_hf"]);
        near(what, sphericity.p_hf, &expected["p_hf"]);
    }
}

/// Seven published data sets: mixed, within only, between only, groups of equal and unequal size.
#[test]
fn analyses_of_variance() {
    let reference = reference();
    let sets = list(&reference["anova"]);
    assert_eq!(sets.len(), 7);
    for set in sets {
        let design = design(set);
        for (kind, key) in [(SumOfSquares::Two, "type_2"), (SumOfSquares::Three, "type_3")] {
            let found = analyse(&design, kind);
            let expected = list(&set[key]);
            assert_eq!(found.len(), expected.len(), "{}", set["name"]);
            for expected in expected {
                let name = expected["effect"].as_str().unwrap();
                let effect = found.iter().find(|effect| effect.effect == name);
                let effect = effect.unwrap_or_else(|| panic!("{}: no effect {name}", set["name"]));
                check_effect(&format!("{} {key} {name}", set["name"]), effect, expected);
            }
        }
    }
}

/// Where the groups are of unequal size the two kinds of sums of squares are different questions.
#[test]
fn the_kinds_differ_where_groups_are_unequal_and_only_there() {
    let reference = reference();
    for (name, differ) in [("Moore", true), ("ToothGrowth", false)] {
        let set = list(&reference["anova"]).iter().find(|set| set["name"] == name).unwrap();
        let design = design(set);
        let (two, three) = (analyse(&design, SumOfSquares::Two), analyse(&design, SumOfSquares::Three));
        assert_eq!((two[0].f / three[0].f - 1.0).abs() > 1.0e-3, differ, "{name}");
    }
}

#[test]
fn trend_and_line() {
    let reference = reference();
    let set = &reference["trend"];
    let found = trend::linear(&numbers(&set["levels"]), &rows(&set["responses"])).unwrap();
    near("slope", found.slope, &set["slope"]);
    near("intercept", found.intercept, &set["intercept"]);
    near("R squared", found.r_squared, &set["r_squared"]);
    let test = found.test.tested().unwrap();
    near("F", test.f, &set["f"]);
    near("error df", test.error_df, &set["error_df"]);
    near("p", test.p, &set["p"]);

    let set = &reference["line"];
    let found = regression::line(&numbers(&set["x"]), &numbers(&set["y"])).unwrap();
    near("intercept", found.intercept, &set["intercept"]);
    near("slope", found.slope, &set["slope"]);
    near("intercept se", found.intercept_se, &set["intercept_se"]);
    near("slope se", found.slope_se, &set["slope_se"]);
    near("interval", found.slope_interval[0], &set["slope_interval"][0]);
    near("interval", found.slope_interval[1], &set["slope_interval"][1]);
    near("p", found.slope_p, &set["slope_p"]);
    near("R squared", found.r_squared, &set["r_squared"]);
    near("residual sd", found.residual_sd, &set["residual_sd"]);
    near("F", found.f, &set["f"]);
}

#[test]
fn tails_and_quantiles() {
    let reference = reference();
    for row in list(&reference["fisher_above"]) {
        let [f, df, error_df] = ["f", "df", "error_df"].map(|key| row[key].as_f64().unwrap());
        near(&format!("F {f} on {df} and {error_df}"), fisher_above(f, df, error_df), &row["p"]);
    }
    for row in list(&reference["student_two_sided"]) {
        let [t, df] = ["t", "df"].map(|key| row[key].as_f64().unwrap());
        near(&format!("t {t} on {df}"), student_two_sided(t, df), &row["p"]);
    }
    for row in list(&reference["student_quantile"]) {
        let [p, df] = ["p", "df"].map(|key| row[key].as_f64().unwrap());
        near(&format!("t quantile {p} on {df}"), student_two_sided_quantile(p, df), &row["t"]);
    }
    for row in list(&reference["normal_below"]) {
        let z = row["z"].as_f64().unwrap();
        near(&format!("normal {z}"), normal_below(z), &row["below"]);
    }
}

/// Each subject's responses divided by their mean: what differs between subjects is gone, and no F is made of what is left.
#[test]
fn an_effect_that_scaling_removed_is_not_tested() {
    let responses: Vec<Vec<f64>> = (0..16)
        .map(|subject| {
            let raw: Vec<f64> =
                (0..6).map(|cell| 2.0 + f64::from(subject * 7 % 5) + f64::from(cell * subject % 3)).collect();
            let mean = raw.iter().sum::<f64>() / 6.0;
            raw.iter().map(|value| value / mean).collect()
        })
        .collect();
    let order =
        BetweenFactor { name: "order".to_owned(), groups: (0..16).map(|subject| subject % 2).collect() };
    let within = WithinFactor { name: "stimulus".to_owned(), levels: 6 };
    let design = Design::new(vec![order], vec![within], &responses).unwrap();
    let effects = analyse(&design, SumOfSquares::Three);
    let order = effects.iter().find(|effect| effect.effect == "order").unwrap();
    assert!(!order.is_testable() && order.p.is_nan() && order.partial_eta_squared.is_nan(), "{order:?}");
    assert!(effects.iter().filter(|effect| effect.effect != "order").all(|effect| effect.is_testable()));
    assert!(serde_json::to_string(order).unwrap().contains(r#""f":null,"p":null"#));
}

/// Holm (1979), as `p.adjust(p, "holm")` of R: the example of its help, and what is no probability.
/// One factor within subjects, one row for each.
fn within(rows: &[[f64; 3]]) -> Effect {
    let rows: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
    let level = WithinFactor { name: "level".to_owned(), levels: 3 };
    let design = Design::new(Vec::new(), vec![level], &rows).unwrap();
    analyse(&design, SumOfSquares::Three).remove(0)
}

/// A single degree of freedom of the residuals says nothing of how contrasts vary: the degrees of freedom are scaled by the least
/// value, whatever rounding makes of the formula.
#[test]
fn two_subjects_have_the_least_epsilon() {
    for step in 0..200 {
        let at = f64::from(step) * 0.37;
        let effect = within(&[[1.0 + at, 2.0, 4.5 + at.sin()], [1.5, 3.1 + at.cos(), 5.9]]);
        let sphericity = effect.sphericity.unwrap();
        let least = fisher_above(effect.f, 1.0, 1.0);
        assert_eq!((sphericity.epsilon_hf, sphericity.p_hf), (0.5, least), "{effect:?}");
    }
}

/// Errors that vary equally in all directions there are need no correction, and rounding makes none.
#[test]
fn equal_variation_is_not_corrected() {
    for scale in [0.1, 0.3, 1.0 / 3.0, 0.7, 1.0, 1.1] {
        let mut rows = [[0.0, 1.7, 2.9].map(|level| level * scale); 3];
        for (own, row) in rows.iter_mut().enumerate() {
            row[own] += scale;
        }
        let effect = within(&rows);
        let sphericity = effect.sphericity.unwrap();
        assert!(sphericity.epsilon_hf > 1.0 && sphericity.p_hf == effect.p, "{effect:?}");
    }
}

#[test]
fn several_tests_are_corrected_by_holm() {
    use flotor_statistics::multiple::holm;
    let corrected = holm(&[0.01, 0.04, 0.03, f64::NAN, 0.005]);
    let expected = [0.03, 0.06, 0.06, f64::NAN, 0.02];
    for (found, expected) in corrected.iter().zip(expected) {
        assert!(found.is_nan() && expected.is_nan() || (found - expected).abs() < 1e-15, "{corrected:?}");
    }
    assert_eq!(holm(&[0.9, 0.8]), [1.0, 1.0]);
    assert!(holm(&[]).is_empty());
}

/// Sizes of effects and their intervals, as SciPy's noncentral t and F give them by root finding.
#[test]
fn sizes_of_effects_have_the_intervals_of_the_noncentral_distributions() {
    use flotor_statistics::effect_size::{EffectSize, of_pairs, partial_omega_squared};
    use flotor_statistics::t_test::TTest;
    let is = |found: EffectSize, expected: [f64; 3]| {
        let found = [found.value, found.interval[0], found.interval[1]];
        for (found, expected) in found.iter().zip(expected) {
            // Ten digits of the reference.
            assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
        }
    };
    for (value, df, expected) in T_SIZES {
        is(of_pairs(&TTest { df, value, p: 0.0, difference: 0.0, interval: [0.0; 2] }), expected);
    }
    for (f, df, error_df, expected) in F_SIZES {
        is(partial_omega_squared(f, df, error_df), expected);
    }
}

/// The estimate of an effect's share lies in its own interval, which eta squared does not: `F(77, 154) = 500` has 0.996.
#[test]
fn an_estimate_lies_in_its_interval() {
    use flotor_statistics::effect_size::{EffectSize, of_pairs, partial_omega_squared};
    use flotor_statistics::t_test::TTest;
    let holds = |what: &str, size: EffectSize| {
        let EffectSize { value, interval: [low, high] } = size;
        assert!(low <= value && value <= high && low < 1.0e9, "{what}: {size:?}");
    };
    for (df, error_df) in [(1.0, 1.0), (1.0, 10.0), (2.0, 28.0), (11.0, 110.0), (11.0, 154.0), (77.0, 154.0)]
    {
        for power in -4..=4 {
            for f in [1.0, 1.7, 3.1, 6.0].map(|digit| digit * 10.0_f64.powi(power)) {
                holds(&format!("F({df}, {error_df}) = {f}"), partial_omega_squared(f, df, error_df));
            }
        }
    }
    for df in [1.0, 2.0, 11.0, 154.0] {
        for value in [-2000.0, -300.0, -37.0, -4.0, 0.0, 0.3, 2.0, 12.0, 60.0, 700.0] {
            let t = TTest { df, value, p: 0.0, difference: 0.0, interval: [0.0; 2] };
            holds(&format!("t({df}) = {value}"), of_pairs(&t));
        }
    }
}

/// What does not vary is no error of the analysis: its reason stands in its place.
#[test]
fn differences_without_variation_are_not_testable_for_a_reason() {
    use flotor_statistics::{Outcome, StatisticsError};
    let base = [0.3, 1.7, 2.9, 1.1];
    let tenth = base.map(|value| value + 0.1);
    for (first, reason) in [(base, StatisticsError::NoDifference), (tenth, StatisticsError::SameDifference)] {
        let outcome = Outcome::from(paired(&first, &base));
        let json = serde_json::to_string(&outcome).unwrap();
        assert_eq!(json, format!(r#"{{"not_testable":"{reason}"}}"#));
        assert_eq!(outcome, Outcome::NotTestable { not_testable: reason });
    }
    let all_alike = within(&[[1.0, 2.0, 4.0]; 3]);
    assert_eq!(all_alike.not_testable, Some(StatisticsError::NoError), "{all_alike:?}");
    let flat = within(&[[1.0; 3], [2.0; 3], [0.5; 3]]);
    assert_eq!(flat.not_testable, Some(StatisticsError::RemovedByScaling), "{flat:?}");
    let levels = [1.0, 2.0, 3.0];
    let flat: Vec<Vec<f64>> = [5.0, 1.0, 0.1].iter().map(|value| vec![*value; 3]).collect();
    assert_eq!(trend::linear(&levels, &flat).unwrap_err(), StatisticsError::EqualMeans);
    let alike = trend::linear(&levels, &vec![vec![1.0, 2.0, 3.5]; 3]).unwrap();
    assert_eq!(alike.test, Outcome::NotTestable { not_testable: StatisticsError::SameDifference });
    assert!(alike.r_squared > 0.9, "{alike:?}");
}

/// Beyond a noncentrality of 37 SciPy has no t: its normal density and chi-square tail, summed, have.
const T_SIZES: [(f64, f64, [f64; 3]); 7] = [
    (3.3, 15.0, [0.825, 0.244_200_668_6, 1.385_636_383_7]),
    (0.4, 7.0, [0.141_421_356_2, -0.560_219_492_8, 0.833_282_324_2]),
    (-2.5, 11.0, [-0.721_687_836_5, -1.348_467_143_6, -0.069_579_992_5]),
    (12.0, 9.0, [3.794_733_192_2, 1.956_402_239_9, 5.614_578_461_6]),
    (25.0, 15.0, [6.25, 3.979_320_216_4, 8.510_107_927_2]),
    (60.0, 11.0, [17.320_508_075_7, 10.176_061_616_8, 24.470_637_789_2]),
    (-200.0, 15.0, [-50.0, -67.692_257_671_6, -32.298_702_645_2]),
];

const F_SIZES: [(f64, f64, f64, [f64; 3]); 5] = [
    (11.94, 1.0, 14.0, [0.406_087_602_1, 0.067_559_447_1, 0.673_614_076_5]),
    (23.01, 2.0, 28.0, [0.586_776_859_5, 0.340_832_843_6, 0.737_448_589_3]),
    (0.5, 2.0, 28.0, [0.0, 0.0, 0.184_477_025_4]),
    (3.1, 2.0, 28.0, [0.119_318_181_8, 0.0, 0.383_069_510_8]),
    (370.0, 2.0, 20.0, [0.969_776_609_7, 0.937_445_366_9, 0.982_325_633_5]),
];
