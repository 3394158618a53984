//! Drafts that are no designs: each error names the key and the remedy.

use super::support::{delay, error};
use serde_json::{Value, json};

/// Returns the delay study with a part replaced, by a path of keys and indices.
fn with(path: &str, value: Value) -> Value {
    let mut table = delay();
    if let Some(place) = table.pointer_mut(path) {
        *place = value;
    } else {
        let (parent, key) = path.rsplit_once('/').expect("a path");
        table.pointer_mut(parent).expect("a parent")[key] = value;
    }
    table
}

#[test]
fn each_error_names_its_key_and_the_remedy() {
    let cases = [
        (
            "/study",
            json!("My study"),
            "study: `My study` is not a valid study name; write 1 to 30 lower-case letters",
        ),
        ("/factor/0/name", json!("Delay"), "factor.name: `Delay` is not a valid column name"),
        ("/factor/0/name", json!("trial"), "factor.trial: another column has this name; rename"),
        ("/factor/0/values", json!([]), "factor.delay.values: the factor has no level; write at least one"),
        (
            "/factor/0/values",
            json!([1, 1]),
            "factor.delay.values: level 1 is listed twice or not finite; write each",
        ),
        ("/factor/0/values", json!([1, "on"]), "factor.delay.values: the levels mix numbers and words"),
        ("/factor/0/setting", json!("delay"), "`delay` is not a setting; write PART.KEY of the scene"),
        (
            "/factor/0/setting",
            json!("spring.gamma_n"),
            "factor.delay.setting: spring.gamma_n is set by another factor",
        ),
        (
            "/factor/0/setting",
            json!("picture"),
            "factor.delay.values: `0` is not a state of the picture; write shown",
        ),
        ("/stimulus/standard", json!(26), "factor.base: the factor changes nothing; give it a `setting`"),
        ("/stimulus/standard", json!("bse"), "factor.base: the factor changes nothing"),
        ("/stimulus/present", json!("on"), "stimulus: write `standard`"),
        ("/task", json!({ "ask": "rating" }), "task: a rating needs `scale"),
        ("/task/absent_share", json!(0.5), "task: `unsure` belongs to a choice"),
        ("/task", json!({ "ask": "magnitude" }), ""),
        ("/method/levels", json!([]), "method.levels: no levels; write at least one"),
        (
            "/method/levels",
            json!([0.1, 0.1]),
            "method.levels: level 0.1 is listed twice or not finite; write finite",
        ),
        (
            "/method/levels",
            json!([-1.5, 0.1]),
            "method.levels: the value of a level is 0 or has the opposite sign; write shares",
        ),
        ("/method/repetitions", json!(0), "method.repetitions: 0 repetitions: write 1 or more"),
        (
            "/method",
            json!({ "kind": "limits", "levels": [0.2, 0.1], "series": 2 }),
            "method.levels: a series needs",
        ),
        (
            "/method",
            json!({ "kind": "target-rating", "rule": { "target": 4, "initial": 0.5, "gain": 0.1, "trials": 2, "floor": 0, "ceiling": 1 } }),
            "method.kind: `target-rating` cannot follow answers to `choice`",
        ),
        (
            "/method",
            json!({ "kind": "staircase", "rule": { "down_after": 0 } }),
            "method.rule.down_after: 0: write 1",
        ),
        ("/method", json!({ "kind": "staircase", "tracks": 0 }), "method.tracks: 0 tracks: write 1 or more"),
        ("/blocks/by", json!(["dely"]), "blocks.by: there is no factor `dely`"),
        ("/blocks/by", json!(["delay", "delay"]), "blocks.by: `delay` is listed twice; remove one"),
        ("/blocks/sessions", json!(0), "blocks.sessions: 0: write 1 to 99"),
        ("/questionnaire/0/texts", json!(["a"]), "questionnaire: 1 texts for the 6 scales of nasa-tlx"),
        ("/questionnaire/0/form", json!(null), "questionnaire: no items; write `form"),
    ];
    for (path, value, expected) in cases {
        let table = with(path, value.clone());
        if expected.is_empty() {
            super::support::design(table);
            continue;
        }
        let found = error(table);
        assert!(found.contains(expected), "{path} = {value}: {found}");
    }
    let mut many = delay();
    many["factor"][0]["values"] = json!([0, 1, 2, 3, 4, 5]);
    many["blocks"]["order"] = json!("balanced");
    assert!(error(many).contains("blocks.order: 6 blocks have too many permutations"));
}

#[test]
fn a_population_is_checked_against_its_design() {
    use flotor_study_design::observer::Population;
    let design = super::support::design(delay());
    for (table, expected) in [
        (json!({ "effect": { "dely": [1] } }), "simulated.effect.dely: there is no such factor"),
        (json!({ "effect": { "delay": [1, 2] } }), "simulated.effect.delay: 2 effects for 4 levels"),
        (json!({ "threshold": 0 }), "simulated.threshold: 0: write a number above 0"),
        (json!({ "lapse": 1 }), "simulated.lapse: 1: write a share"),
    ] {
        let population: Population = serde_json::from_value(table).expect("a table");
        let error = population.check(&design).expect_err(expected).to_string();
        assert!(error.contains(expected), "{error}");
    }
}
