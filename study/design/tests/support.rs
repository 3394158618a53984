//! Designs for the tests, and observers that answer a whole course.

use flotor_study_design::answer::Reply;
use flotor_study_design::course::{Course, Handle, Session, Step};
use flotor_study_design::design::{Design, Draft};
use flotor_study_design::observer::{Population, SimulatedObserver};
use flotor_study_design::subject::SubjectNumber;
use serde_json::{Value, json};

/// Returns a design from the table of a study file, as JSON.
pub(crate) fn design(table: Value) -> Design {
    let draft: Draft = serde_json::from_value(table).expect("a draft");
    Design::try_from(draft).expect("a design")
}

/// Returns the error of a table that is no design.
pub(crate) fn error(table: Value) -> String {
    match serde_json::from_value::<Draft>(table) {
        Err(error) => error.to_string(),
        Ok(draft) => Design::try_from(draft).expect_err("an error").to_string(),
    }
}

/// Delay and stiffness by constant stimuli, as in the issue: a factor of blocks, a factor that is mixed, a questionnaire.
pub(crate) fn delay() -> Value {
    json!({
        "study": "delay",
        "factor": [
            { "name": "delay", "setting": "device.delay_ms", "values": [0, 10, 20, 40] },
            { "name": "base", "values": [17, 35] },
        ],
        "stimulus": { "setting": "spring.gamma_n", "standard": "base" },
        "task": { "ask": "choice", "question": "Which one was stiffer?" },
        "method": { "kind": "constant", "levels": [-0.3, -0.15, 0.15, 0.3], "repetitions": 3 },
        "blocks": { "by": ["delay"], "order": "williams", "practice": 3, "rest_every": 25 },
        "questionnaire": [{ "at": "after-block", "form": "nasa-tlx" }],
    })
}

/// Designs of every method and question.
pub(crate) fn all() -> Vec<Design> {
    let up_down = json!({ "initial_delta": 0.4, "first_step": 0.1 });
    let with = |task: Value, method: Value, stimulus: Value| {
        let mut table = delay();
        table["task"] = task;
        table["method"] = method;
        table["stimulus"] = stimulus;
        design(table)
    };
    let graded = || json!({ "setting": "spring.gamma_n", "standard": "base" });
    let buckling = || json!({ "setting": "spring.seat", "present": "free", "absent": "fixed" });
    let levels = json!([0.0, 0.1, 0.2, 0.3, 0.4]);
    let rating = json!({ "least": 1, "most": 7 });
    let confident = json!({ "ask": "choice", "unsure": true, "confidence": { "least": 1, "most": 5 } });
    let mut all = vec![
        design(delay()),
        with(
            json!({ "ask": "detection" }),
            json!({ "kind": "limits", "levels": levels, "series": 4 }),
            graded(),
        ),
        with(confident, json!({ "kind": "weighted-up-down", "tracks": 2, "rule": up_down }), graded()),
        with(json!({ "ask": "detection" }), json!({ "kind": "staircase" }), graded()),
        with(
            json!({ "ask": "choice", "unsure": true }),
            json!({ "kind": "quest-plus", "rule": { "trials": 9 } }),
            graded(),
        ),
        with(
            json!({ "ask": "rating", "scale": rating }),
            json!({ "kind": "target-rating", "tracks": 2, "rule": {
                "target": 4, "initial": 0.5, "gain": 0.1, "trials": 12, "floor": 0, "ceiling": 1 } }),
            graded(),
        ),
    ];
    // Buckling on and off needs no standard, so that no factor but the delay is left.
    let mut table = delay();
    table["factor"] = json!([{ "name": "delay", "setting": "device.delay_ms", "values": [0, 10, 20, 40] }]);
    table["stimulus"] = buckling();
    table["task"] = json!({ "ask": "detection" });
    table["method"] = json!({ "kind": "constant", "repetitions": 8 });
    table["blocks"]["sessions"] = json!(2);
    all.push(design(table));
    let mut table = delay();
    table.as_object_mut().expect("a table").remove("stimulus");
    table["factor"] = json!([
        { "name": "gamma", "setting": "spring.gamma_n", "values": [12, 24, 48] },
        { "name": "hand", "setting": "device.hand", "values": ["left", "right"], "vary": "between" },
    ]);
    table["task"] = json!({ "ask": "magnitude" });
    table["method"] = json!({ "kind": "constant", "repetitions": 4 });
    table["blocks"] = json!({ "repetitions": 2 });
    all.push(design(table));
    all
}

/// Returns the session of a subject.
pub(crate) fn session(seed: u64, subject: u16, session: u32) -> Session {
    Session { seed, subject: SubjectNumber::new(subject).expect("a number"), session }
}

/// Answers a course to its end; returns its steps with the answers.
pub(crate) fn sit(
    design: &Design,
    population: &Population,
    session: Session,
) -> (Vec<(Step, Reply)>, Course) {
    let mut course = Course::new(design, session);
    let observer = SimulatedObserver::new(population, session);
    let mut steps = Vec::new();
    while let Some(step) = course.next() {
        let reply = observer.respond(design, &step);
        course.answer(&reply, Handle::InRange).expect("an answer");
        steps.push((step, reply));
        assert!(steps.len() < 20_000, "the course ends");
    }
    (steps, course)
}
