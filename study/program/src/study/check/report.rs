//! Table and picture of what a study file does.

use super::rows::SessionRow;
use super::tally::Balance;
use flotor_analysis::designed::EffectPower;
use flotor_command::style;
use flotor_plot::{Axis, Figure, Panel, Series};
use flotor_study_design::design::Design;
use serde::Serialize;

/// Preview of a study file.
#[derive(Serialize)]
pub(super) struct Check {
    pub(super) study: String,
    pub(super) title: String,
    pub(super) subjects: u16,
    /// Sessions in the order of subjects.
    pub(super) sessions: Vec<SessionRow>,
    pub(super) balance: Balance,
    /// First steps of the first subject.
    pub(super) sees: Vec<String>,
    pub(super) power: Vec<EffectPower>,
}

pub(super) fn to_text(check: &Check) -> String {
    let mut lines =
        vec![style::title(&format!("{}: {} subjects", check.title, check.subjects)), String::new()];
    lines.push(format!(
        "  {:<8}{:>8}{:>10}{:>8}{:>7}{:>7}{:>9}  blocks",
        "subject", "session", "practice", "trials", "rests", "forms", "minutes"
    ));
    for row in &check.sessions {
        let blocks: Vec<&str> = row.blocks.iter().map(|block| block.condition.as_str()).collect();
        lines.push(format!(
            "  {:<8}{:>8}{:>10}{:>8}{:>7}{:>7}{:>9.1}  {}",
            row.subject,
            row.session,
            row.practice,
            row.trials,
            row.rests,
            row.questionnaires,
            row.minutes,
            blocks.join(" | ")
        ));
    }
    let minutes = || check.sessions.iter().map(|row| row.minutes);
    let (least, most) = (minutes().fold(f64::INFINITY, f64::min), minutes().fold(0.0, f64::max));
    let mean = minutes().sum::<f64>() / check.sessions.len().max(1) as f64;
    lines.push(String::new());
    lines.push(format!("  Length of a session      {mean:.1} min ({least:.1} to {most:.1})"));
    let Balance { at_each_place, after_each_other, subjects_in_each_group, comparison_first } =
        &check.balance;
    let counts = |[least, most]: &[usize; 2]| {
        if least == most {
            format!("{least} times each")
        } else {
            format!("{least} to {most} times each: not balanced")
        }
    };
    lines.push(format!("  Block at each place      {}", counts(at_each_place)));
    lines.push(format!("  Block after each other   {}", counts(after_each_other)));
    lines.push(format!("  Subjects in each group   {}", counts(subjects_in_each_group)));
    if let Some(share) = comparison_first {
        lines.push(format!("  Comparison first         {:.1} % of the pairs", share * 100.0));
    }
    if let Some(first) = check.sessions.first() {
        lines.push(String::new());
        lines.push(format!("  What {} does first", first.subject));
        lines.extend(check.sees.iter().zip(1..).map(|(step, number)| format!("  {number:>4}  {step}")));
    }
    if !check.power.is_empty() {
        lines.push(String::new());
        lines.push("  Power at 5 %, simulated observers".to_owned());
        lines.extend(check.power.iter().map(|effect| {
            let EffectPower { effect, share, standard_error, studies } = effect;
            format!(
                "  {effect:<25}{:.1} % (standard error {:.1} %, {studies} studies)",
                share * 100.0,
                standard_error * 100.0
            )
        }));
    }
    lines.join("\n")
}

/// Largest number of block conditions that a picture has colours for.
const MOST_SERIES: usize = 8;

/// Draws the blocks of every session over time: one series for each condition.
pub(super) fn picture(check: &Check, design: &Design) -> Figure {
    let mut conditions: Vec<&str> = Vec::new();
    for block in check.sessions.iter().flat_map(|row| &row.blocks) {
        if !conditions.contains(&block.condition.as_str()) {
            conditions.push(&block.condition);
        }
    }
    conditions.sort_unstable();
    let figure = Figure::new(check.title.clone(), Axis::linear("Time from the start of the session", "min"));
    let figure = figure.subtitle(format!("Blocks of {} sessions, each at its middle", check.sessions.len()));
    if conditions.len() > MOST_SERIES {
        let count = design.block_conditions().len();
        return figure.panel_or_note(Err(format!(
            "{count} conditions of blocks: too many for a picture; the table has them"
        )));
    }
    let mut panel = Panel::new(Axis::linear("Session, in the order of subjects", ""));
    for condition in conditions {
        let places = check.sessions.iter().zip(1_u32..).flat_map(|(row, number)| {
            let own = row.blocks.iter().filter(|block| block.condition == condition);
            own.map(move |block| (0.5 * (block.from_minute + block.to_minute), f64::from(number)))
                .collect::<Vec<_>>()
        });
        panel = panel.series(Series::points(condition, places));
    }
    figure.panel(panel)
}
