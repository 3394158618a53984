//! Checks of a draft: each error names the key of the study file and the remedy.

use super::draft::{Blocks, Draft};
use crate::error::DesignError;
use crate::factor::{Factor, Vary};
use crate::method::Method;
use crate::order::Order;
use crate::stimulus::{Scale, Side, Standard, Stimulus};
use crate::task::{AnswerScale, Ask};
use crate::value::{Setting, Value};

/// Checks a draft; returns the first error.
pub(super) fn draft(draft: &Draft) -> Result<(), DesignError> {
    check_name(draft)?;
    check_factors(draft)?;
    check_blocks(draft)?;
    draft.method.check()?;
    check_task(draft)?;
    check_stimulus(draft)
}

fn check_name(draft: &Draft) -> Result<(), DesignError> {
    let is_label = |one: char| one.is_ascii_lowercase() || one.is_ascii_digit();
    if !draft.study.is_empty() && draft.study.len() <= 30 && draft.study.chars().all(is_label) {
        return Ok(());
    }
    let problem = format!(
        "`{}` is not a valid study name; write 1 to 30 lower-case letters and digits, like delay2",
        draft.study
    );
    Err(DesignError::new("study", &problem))
}

/// Columns of the tables that no factor may have as its name.
const COLUMNS: [&str; 12] = [
    "subject",
    "session",
    "trial",
    "block",
    "track",
    "phase",
    "level",
    "answer",
    "confidence",
    "repeat",
    "correct",
    "observer",
];

fn check_factors(draft: &Draft) -> Result<(), DesignError> {
    let standard = match &draft.stimulus {
        Some(Stimulus::Graded { standard: Standard::Factor(name), .. }) => Some(name),
        _ => None,
    };
    for (index, factor) in draft.factors.iter().enumerate() {
        let Factor { name, setting, values, .. } = factor;
        let key = |part: &str| format!("factor.{name}{part}");
        let earlier = || draft.factors.iter().take(index);
        let is_name = |one: char| one.is_ascii_lowercase() || one.is_ascii_digit() || one == '_';
        if name.is_empty() || !name.chars().all(is_name) {
            let problem =
                format!("`{name}` is not a valid column name; write lower-case letters, digits and _");
            return Err(DesignError::new("factor.name", &problem));
        }
        if COLUMNS.contains(&name.as_str()) || earlier().any(|other| other.name == *name) {
            return Err(DesignError::new(&key(""), "another column has this name; rename the factor"));
        }
        if values.is_empty() {
            return Err(DesignError::new(&key(".values"), "the factor has no level; write at least one"));
        }
        let is_right =
            |value: &Value| value.is_usable() && values.iter().filter(|other| *other == value).count() == 1;
        if let Some(wrong) = values.iter().find(|value| !is_right(value)) {
            return Err(DesignError::new(
                &key(".values"),
                &format!(
                    "level {wrong} is listed twice or not finite; write each level once, as a finite number or a word"
                ),
            ));
        }
        let numbers = values.iter().filter(|value| value.number().is_some()).count();
        if numbers != 0 && numbers != values.len() {
            return Err(DesignError::new(
                &key(".values"),
                "the levels mix numbers and words; write only numbers or only words",
            ));
        }
        match setting {
            None if standard != Some(name) => {
                let problem = "the factor changes nothing; give it a `setting`, or name it as `standard` of the stimulus";
                return Err(DesignError::new(&key(""), problem));
            }
            None => {}
            Some(Setting::Picture) => {
                let wrong = values.iter().find(|value| {
                    !matches!(value, Value::Choice(word) if [Setting::SHOWN, Setting::HIDDEN].contains(&word.as_str()))
                });
                if let Some(wrong) = wrong {
                    let problem = format!("`{wrong}` is not a state of the picture; write shown or hidden");
                    return Err(DesignError::new(&key(".values"), &problem));
                }
            }
            Some(setting) => {
                let is_taken = earlier().any(|other| other.setting.as_ref() == Some(setting))
                    || draft.stimulus.as_ref().is_some_and(|stimulus| stimulus.setting() == setting);
                if is_taken {
                    let problem =
                        format!("{setting} is set by another factor or by the stimulus; remove one of them");
                    return Err(DesignError::new(&key(".setting"), &problem));
                }
            }
        }
    }
    match standard {
        None => Ok(()),
        Some(name) => {
            let factor = draft.factors.iter().find(|factor| factor.name == *name);
            let values = factor.map(|factor| factor.values.as_slice());
            match values {
                Some(values) if values.iter().all(|value| value.number().is_some()) => Ok(()),
                Some(_) => Err(DesignError::new(
                    "stimulus.standard",
                    &format!("the levels of `{name}` are words; a standard needs numbers"),
                )),
                None => Err(DesignError::new(
                    "stimulus.standard",
                    &format!("there is no factor `{name}`; write a number or the name of a factor"),
                )),
            }
        }
    }
}

fn check_blocks(draft: &Draft) -> Result<(), DesignError> {
    let Blocks { by, order, repetitions, sessions, .. } = &draft.blocks;
    for (index, name) in by.iter().enumerate() {
        let factor = draft.factors.iter().find(|factor| factor.name == *name);
        let problem = match factor {
            None => format!("there is no factor `{name}`; write names of factors"),
            Some(factor) if factor.vary != Vary::Within => {
                format!("`{name}` varies between subjects, so it is constant in every block; remove it")
            }
            Some(_) if by.iter().take(index).any(|other| other == name) => {
                format!("`{name}` is listed twice; remove one")
            }
            Some(_) => continue,
        };
        return Err(DesignError::new("blocks.by", &problem));
    }
    let counts = draft.factors.iter().filter(|factor| by.contains(&factor.name)).map(|one| one.values.len());
    let blocks: usize = counts.product();
    if *order == Order::Balanced && blocks > Order::MOST_PERMUTED {
        let most = Order::MOST_PERMUTED;
        let problem = format!(
            "{blocks} blocks have too many permutations; write at most {most} blocks, or order = \"williams\""
        );
        return Err(DesignError::new("blocks.order", &problem));
    }
    for (key, value) in [("blocks.repetitions", repetitions), ("blocks.sessions", sessions)] {
        if !(1..=99).contains(value) {
            return Err(DesignError::new(key, &format!("{value}: write 1 to 99")));
        }
    }
    Ok(())
}

/// Checks that method and question fit.
fn check_task(draft: &Draft) -> Result<(), DesignError> {
    let Draft { task, method, .. } = draft;
    let (asked, used) = (task.word(), method.word());
    if let Some(defect) = task.confidence.as_ref().and_then(AnswerScale::defect) {
        return Err(DesignError::new("task.confidence", &defect));
    }
    if let Ask::Rating { scale } = &task.ask
        && let Some(defect) = scale.defect()
    {
        return Err(DesignError::new("task.scale", &defect));
    }
    if let Ask::Detection { absent_share } = task.ask
        && !(0.0..1.0).contains(&absent_share)
    {
        return Err(DesignError::new(
            "task.absent_share",
            &format!("the share is {absent_share}; write a share from 0 to below 1"),
        ));
    }
    let fits = match method {
        Method::Constant { .. } => true,
        Method::TargetRating { .. } => matches!(task.ask, Ask::Rating { .. }),
        Method::QuestPlus { .. } => matches!(task.ask, Ask::Choice { .. }),
        Method::Limits { .. } | Method::WeightedUpDown { .. } | Method::Staircase { .. } => {
            matches!(task.ask, Ask::Choice { .. } | Ask::Detection { .. })
        }
    };
    if fits {
        return Ok(());
    }
    let problem = format!(
        "`{used}` cannot follow answers to `{asked}`; constant goes with every question, quest-plus with choice, limits, \
         weighted-up-down and staircase with choice or detection, target-rating with rating"
    );
    Err(DesignError::new("method.kind", &problem))
}

/// Checks that the stimulus fits question and method.
fn check_stimulus(draft: &Draft) -> Result<(), DesignError> {
    let Draft { task, method, stimulus, .. } = draft;
    let levels = method.extremes();
    match stimulus {
        None => {
            if matches!(task.ask, Ask::Choice { .. } | Ask::Detection { .. }) {
                let problem = "the question needs a stimulus that differs; write a table [stimulus]";
                return Err(DesignError::new("stimulus", problem));
            }
            if levels.is_some() {
                let problem = "the method has levels, but the study has no stimulus; write a table [stimulus], or remove the levels";
                return Err(DesignError::new("method.levels", problem));
            }
            Ok(())
        }
        Some(Stimulus::Categorical { present, absent, .. }) => {
            if levels.is_some() {
                let problem = "a stimulus of two choices has no levels; write kind = \"constant\" with repetitions only";
                return Err(DesignError::new("method.kind", problem));
            }
            if present == absent || !present.is_usable() || !absent.is_usable() {
                let problem =
                    format!("present is `{present}` and absent is `{absent}`; write two different values");
                return Err(DesignError::new("stimulus.present", &problem));
            }
            Ok(())
        }
        Some(Stimulus::Graded { standard, scale, side, .. }) => {
            let Some([least, most]) = levels else {
                return Err(DesignError::new("method.levels", "no levels; write at least one"));
            };
            let lowest = match side {
                Side::Above => least,
                Side::Below => -most,
            };
            if *scale == Scale::Share && lowest <= -1.0 {
                let problem = "the value of a level is 0 or has the opposite sign; write shares above -1, and below 1 with side = \"below\"";
                return Err(DesignError::new("method.levels", problem));
            }
            if let (Scale::Share, Standard::Number(number)) = (scale, standard)
                && *number == 0.0
            {
                let problem =
                    "shares of a standard of 0 are 0; write another standard, or scale = \"difference\"";
                return Err(DesignError::new("stimulus.standard", problem));
            }
            if matches!(method, Method::QuestPlus { .. }) && *scale != Scale::Share {
                return Err(DesignError::new("stimulus.scale", "quest-plus needs scale = \"share\""));
            }
            if matches!(method, Method::WeightedUpDown { .. } | Method::Staircase { .. }) && least < 0.0 {
                let problem = format!(
                    "a floor of {least}: an adaptive track needs levels of 0 and above; write side = \"below\" for the other side"
                );
                return Err(DesignError::new("method.rule.floor", &problem));
            }
            Ok(())
        }
    }
}
