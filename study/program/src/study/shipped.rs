//! Flotor's own studies as designs, and designs that are presented as a protocol.
//!
//! A design whose factors are the picture, alternating by blocks, and a standard or the stimuli, with the method of the protocol, is
//! presented, logged and analysed as the protocol `jnd`, `force` or `magnitude`: screens, page and logs are those of the protocol, to the
//! bit.

use flotor_study_design::design::{Blocks, Design, TrackOrder};
use flotor_study_design::factor::{Factor, Vary};
use flotor_study_design::method::Method;
use flotor_study_design::order::Order;
use flotor_study_design::procedure::{QuestPlusRule, WeightedUpDownRule};
use flotor_study_design::stimulus::{Scale, Side, Standard, Stimulus};
use flotor_study_design::task::Ask;
use flotor_study_design::value::{Setting, Value};
use std::ffi::OsString;
use std::path::Path;

/// Flotor's own studies: name and text.
const OWN: [(&str, &str); 3] = [
    ("jnd", include_str!("../../studies/jnd.study.toml")),
    ("magnitude", include_str!("../../studies/magnitude.study.toml")),
    ("force", include_str!("../../studies/force.study.toml")),
];

/// Returns the text of Flotor's own study of a name; `None` if there is none.
pub(super) fn text_of(name: &Path) -> Option<&'static str> {
    OWN.iter().find(|(own, _)| Path::new(own) == name).map(|(_, text)| *text)
}

/// Returns the protocol's task of a design with its options as command-line arguments; `None` for a design that no protocol presents.
pub(super) fn task_of(design: &Design) -> Option<(&'static str, Vec<OsString>)> {
    let [picture, other] = design.factors() else { return None };
    let alternates = is_picture(picture)
        && other.vary == Vary::Within
        && design.blocks().by == [picture.name.clone()]
        && design.blocks().order == Order::Alternate
        && design.blocks().sessions == 1
        && design.questionnaires().is_empty()
        && design.task().confidence.is_none()
        && design.task().question.is_empty();
    if !alternates {
        return None;
    }
    match (&design.task().ask, design.stimulus(), design.method()) {
        (Ask::Choice { unsure: true }, Some(stimulus), method) => {
            difference(design.blocks(), other, stimulus, method)
        }
        (Ask::Magnitude, None, Method::Constant { repetitions, .. }) => {
            magnitude(design.blocks(), other, *repetitions)
        }
        _ => None,
    }
}

fn is_picture(factor: &Factor) -> bool {
    let states = [Setting::SHOWN, Setting::HIDDEN].map(|state| Value::Choice(state.to_owned()));
    factor.setting == Some(Setting::Picture) && factor.vary == Vary::Within && factor.values == states
}

/// Number of pairs that the protocol presents as practice.
const PRACTICE_PAIRS: u32 = 6;

fn difference(
    blocks: &Blocks,
    base: &Factor,
    stimulus: &Stimulus,
    method: &Method,
) -> Option<(&'static str, Vec<OsString>)> {
    let Stimulus::Graded { setting, standard: Standard::Factor(standard), scale: Scale::Share, side } =
        stimulus
    else {
        return None;
    };
    if *standard != base.name || base.setting.is_some() || blocks.tracks != TrackOrder::Successive {
        return None;
    }
    let mut words = vec![option("stimulus", setting), option("bases", numbers(&base.values)?)];
    words.push(option("replications", 2 * blocks.repetitions));
    match method {
        Method::WeightedUpDown { tracks: 1, rule } => words.extend(of_up_down(rule)?),
        Method::QuestPlus { tracks: 1, rule } => words.extend(of_quest_plus(rule)?),
        _ => return None,
    }
    match blocks.practice {
        0 => words.push("--no-demo".into()),
        PRACTICE_PAIRS => {}
        _ => return None,
    }
    words.push(option(
        "side",
        match side {
            Side::Above => "above",
            Side::Below => "below",
        },
    ));
    words.push(option("rest-every", blocks.rest_every));
    let is_force = setting.to_string().rsplit('.').next().is_some_and(|key| key.starts_with("force"));
    Some((if is_force { "force" } else { "jnd" }, words))
}

fn of_up_down(rule: &WeightedUpDownRule) -> Option<Vec<OsString>> {
    let usual = WeightedUpDownRule::default();
    if rule.trials_most != usual.trials_most
        || rule.averaging != usual.averaging
        || rule.step_at_reversal != usual.step_at_reversal
    {
        return None;
    }
    let halve_at: Vec<String> = rule.halve_at.iter().map(u32::to_string).collect();
    Some(vec![
        option("initial", rule.initial_delta),
        option("step", rule.first_step),
        option("target", rule.target),
        option("halve-at", halve_at.join(",")),
        option("stop-after", rule.stop_after),
        option("average-from", rule.average_from),
        option("floor", rule.floor),
        option("ceiling", rule.ceiling),
    ])
}

fn of_quest_plus(rule: &QuestPlusRule) -> Option<Vec<OsString>> {
    let usual = QuestPlusRule { trials: rule.trials, target: rule.target, ..QuestPlusRule::default() };
    (*rule == usual).then(|| {
        vec![option("procedure", "questplus"), option("trials", rule.trials), option("target", rule.target)]
    })
}

fn magnitude(blocks: &Blocks, stimuli: &Factor, repetitions: u32) -> Option<(&'static str, Vec<OsString>)> {
    let setting = stimuli.setting.as_ref()?;
    let values: Option<Vec<f64>> = stimuli.values.iter().map(Value::number).collect();
    let values = values?;
    let (least, most, count) = (*values.first()?, *values.last()?, u32::try_from(values.len()).ok()?);
    // The protocol has evenly spaced stimuli.
    let evenly = flotor_study::protocol::MagnitudeProtocol::evenly(least, most, count);
    if blocks.repetitions != 1 || values != evenly {
        return None;
    }
    let words = vec![
        option("stimulus", setting),
        option("range", format!("{least}-{most}")),
        option("stimuli", count),
        option("replications", repetitions),
        option("demo", blocks.practice),
        option("rest-every", blocks.rest_every),
    ];
    Some(("magnitude", words))
}

fn option(name: &str, value: impl std::fmt::Display) -> OsString {
    format!("--{name}={value}").into()
}

fn numbers(values: &[Value]) -> Option<String> {
    let numbers: Option<Vec<String>> = values.iter().map(|value| Some(value.number()?.to_string())).collect();
    numbers.map(|numbers| numbers.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::design_file::DesignFile;
    use crate::study::options_table::parsed;
    use crate::study::{FORCE, STIFFNESS, StudyArguments, Task};
    use flotor_study::protocol::{JndProtocol, MagnitudeProtocol};

    fn task(name: &str) -> Task {
        let file = Path::new(name);
        let study = DesignFile::read(file, text_of(file).expect("a study")).expect("a design");
        let (task, words) = task_of(&study.design).expect("a protocol");
        assert_eq!(task, name);
        let further = vec!["--out=data".into()];
        let (words, _) = study.words(file, task, words, further).expect("arguments");
        parsed::<StudyArguments>(file, words).expect("a task").task
    }

    /// The studies as files are the protocols of the commands, so that logs and tables are the same.
    #[test]
    fn studies_as_files_are_the_protocols_of_the_commands() {
        let Task::Jnd(jnd) = task("jnd") else { panic!("jnd") };
        assert_eq!(jnd.protocol(&STIFFNESS).expect("a protocol"), JndProtocol::default());
        let Task::Magnitude(magnitude) = task("magnitude") else { panic!("magnitude") };
        assert_eq!(magnitude.protocol().expect("a protocol"), MagnitudeProtocol::default());
        let Task::Force(force) = task("force") else { panic!("force") };
        let protocol = force.jnd.protocol(&FORCE).expect("a protocol");
        let stimulus = flotor_study::protocol::Stimulus { model: "load".into(), parameter: "force_n".into() };
        assert_eq!(protocol, JndProtocol { stimulus, bases: FORCE.bases.to_vec(), ..JndProtocol::default() });
    }

    /// A question of one's own makes it a design of one's own.
    #[test]
    fn a_changed_study_is_no_protocol() {
        let text = text_of(Path::new("jnd")).expect("a study");
        for (from, to) in [
            ("unsure = true", "unsure = true\nquestion = \"Harder?\""),
            ("\"alternate\"", "\"latin\""),
            ("\"successive\"", "\"interleaved\""),
            ("practice = 6", "practice = 4"),
            ("scale = \"share\"", "scale = \"difference\""),
        ] {
            let changed = text.replace(from, to);
            assert_ne!(changed, text);
            let study = DesignFile::read(Path::new("a.study.toml"), &changed).expect("a design");
            assert!(task_of(&study.design).is_none(), "{to}");
        }
    }
}
