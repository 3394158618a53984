//! `flotor study check`: what a study file does, without a person.

use super::design_file::DesignFile;
use super::plan::file_and_text;
use clap::Args;
use flotor_analysis::designed::{EffectPower, power_of, study_of};
use flotor_command::options::{JsonOption, count, duration_s};
use flotor_command::{CommandError, print_result, progress_bar, style, write_text};
use flotor_plot::{Axis, Figure, Panel, Series};
use flotor_study::protocol::SubjectNumber;
use flotor_study_design::answer::Position;
use flotor_study_design::course::{Course, Handle, Phase, Session, Step, Trial};
use flotor_study_design::design::{Condition, Design};
use flotor_study_design::observer::SimulatedObserver;
use flotor_study_design::value::Setting;
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(Args)]
#[command(
    after_help = "Every subject of the file is simulated with the table [simulated]: the schedule is that of a person, the number of \
    trials of an adaptive method that of these observers. The power is the share of simulated studies in which the analysis of \
    variance finds an effect at 5 %.\n\n\
    Examples:\n  \
    flotor study check delay.study.toml\n  \
    flotor study check delay.study.toml --plot schedule.svg --runs 1000\n  \
    flotor study check jnd"
)]
pub(super) struct CheckArguments {
    /// Study file with a design (default: the only NAME.study.toml in this folder)
    #[arg(value_name = "FILE")]
    file: Option<PathBuf>,
    /// Number of simulated studies for the power, 0: no power
    #[arg(long, default_value_t = 200, value_parser = count(0..=100_000_u32), value_name = "N")]
    runs: u32,
    /// Number of subjects (default: that of the file, or 16)
    #[arg(long, value_parser = count(1..=SubjectNumber::MOST), value_name = "N")]
    subjects: Option<u16>,
    /// Time for each interval of a trial, its answer included
    #[arg(long, default_value = "8s", value_parser = duration_s, value_name = "TIME")]
    interval_time: f64,
    /// Time for each item of a questionnaire
    #[arg(long, default_value = "10s", value_parser = duration_s, value_name = "TIME")]
    item_time: f64,
    /// Time for each rest
    #[arg(long, default_value = "60s", value_parser = duration_s, value_name = "TIME")]
    rest_time: f64,
    /// Write a picture of the schedule
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

/// What a study file does.
#[derive(Serialize)]
struct Check {
    study: String,
    title: String,
    subjects: u16,
    /// Sessions in the order of subjects.
    sessions: Vec<SessionRow>,
    balance: Balance,
    /// First steps of the first subject.
    sees: Vec<String>,
    power: Vec<EffectPower>,
}

/// One session of a subject.
#[derive(Serialize)]
struct SessionRow {
    subject: String,
    session: u32,
    /// Blocks in order.
    blocks: Vec<BlockRow>,
    practice: u32,
    trials: u32,
    rests: u32,
    questionnaires: u32,
    minutes: f64,
}

/// One block of a session.
#[derive(Clone, Serialize)]
struct BlockRow {
    condition: String,
    from_minute: f64,
    to_minute: f64,
}

/// Balance of a study over all its subjects; each range is the smallest and the largest count.
#[derive(Serialize)]
struct Balance {
    /// How often each block condition is at each place.
    at_each_place: [usize; 2],
    /// How often each block condition follows each other one.
    after_each_other: [usize; 2],
    /// How many subjects each combination of levels between subjects has.
    subjects_in_each_group: [usize; 2],
    /// Share of the pairs whose comparison is first; `None` without pairs.
    comparison_first: Option<f64>,
}

pub(super) fn run(arguments: &CheckArguments) -> Result<(), CommandError> {
    let (file, text) = file_and_text(arguments.file.clone())?;
    if !DesignFile::is_in(&text) {
        return Err(CommandError::Usage(format!(
            "{}: the file names a protocol, not a design; `flotor study power` and `flotor study run {0}` are for protocols",
            file.display()
        )));
    }
    let study = DesignFile::read(&file, &text)?;
    let option = |name: &str| study.option(name).and_then(|value| u64::try_from(value).ok());
    let subjects = arguments.subjects.or(option("subjects").and_then(|count| u16::try_from(count).ok()));
    let (subjects, seed) = (subjects.unwrap_or(16), option("seed").unwrap_or(1));
    let mut tally = Tally::default();
    let mut sessions = Vec::new();
    let mut sees = Vec::new();
    for subject in (1..=subjects).filter_map(SubjectNumber::new) {
        for session in 1..=study.design.blocks().sessions {
            let session = Session { seed, subject, session };
            sessions.push(walk(arguments, &study, session, &mut tally, &mut sees));
        }
    }
    let check = Check {
        study: study.design.study().to_owned(),
        title: study.title.clone(),
        subjects,
        sessions,
        balance: tally.balance(&study.design),
        sees,
        power: power(arguments, &study, subjects, seed),
    };
    write_text(arguments.plot.as_deref(), || picture(&check, &study.design).to_svg())?;
    print_result(arguments.json.file(), &check, || to_text(&check))
}

/// Number of steps of the first subject that are shown.
const SHOWN: usize = 12;

/// Walks through a session of a simulated subject.
fn walk(
    arguments: &CheckArguments,
    study: &DesignFile,
    session: Session,
    tally: &mut Tally,
    sees: &mut Vec<String>,
) -> SessionRow {
    let design = &study.design;
    let mut course = Course::new(design, session);
    let observer = SimulatedObserver::new(&study.population, session);
    let mut row = SessionRow {
        subject: session.subject.to_string(),
        session: session.session,
        blocks: Vec::new(),
        practice: 0,
        trials: 0,
        rests: 0,
        questionnaires: 0,
        minutes: 0.0,
    };
    let mut block = 0;
    let is_first = session.subject.get() == 1 && session.session == 1;
    while let Some(step) = course.next() {
        if is_first && sees.len() < SHOWN {
            sees.push(step_text(design, &course, &step));
        }
        let before = row.minutes;
        match &step {
            Step::Trial(trial) => {
                row.minutes += arguments.interval_time * design.task().intervals() as f64 / 60.0;
                match trial.phase {
                    Phase::Practice => row.practice += 1,
                    Phase::Main => {
                        row.trials += 1;
                        tally.pair(trial.comparison_at);
                        if trial.block != block {
                            block = trial.block;
                            let condition = block_text(design, trial);
                            row.blocks.push(BlockRow { condition, from_minute: before, to_minute: before });
                        }
                    }
                }
            }
            Step::Form { questionnaire, .. } => {
                let items = design.questionnaires().get(*questionnaire).map_or(0, |form| form.items.len());
                row.minutes += arguments.item_time * items as f64 / 60.0;
                row.questionnaires += 1;
            }
            Step::Rest { .. } => {
                row.minutes += arguments.rest_time / 60.0;
                row.rests += 1;
            }
        }
        if let (Some(last), Step::Trial(_) | Step::Rest { .. }) = (row.blocks.last_mut(), &step) {
            last.to_minute = row.minutes;
        }
        // The observer gives valid answers: an error would be one of the program, and ends the walk.
        if course.answer(&observer.respond(design, &step), Handle::InRange).is_err() {
            break;
        }
        if let Step::Trial(trial) = &step {
            tally.group(session, design, &trial.condition);
        }
    }
    tally.blocks(&row.blocks);
    row
}

/// Counts for the balance.
#[derive(Default)]
struct Tally {
    places: BTreeMap<(usize, String), usize>,
    transitions: BTreeMap<(String, String), usize>,
    groups: BTreeMap<u16, String>,
    first: usize,
    pairs: usize,
}

impl Tally {
    fn pair(&mut self, comparison_at: Option<Position>) {
        self.pairs += usize::from(comparison_at.is_some());
        self.first += usize::from(comparison_at == Some(Position::First));
    }

    fn group(&mut self, session: Session, design: &Design, condition: &Condition) {
        use flotor_study_design::factor::Vary;
        let between = design.factors().iter().filter(|factor| factor.vary != Vary::Within);
        let levels: Vec<String> =
            between.filter_map(|factor| condition.get(&factor.name).map(ToString::to_string)).collect();
        self.groups.entry(session.subject.get()).or_insert_with(|| levels.join(" "));
    }

    fn blocks(&mut self, blocks: &[BlockRow]) {
        for (place, block) in blocks.iter().enumerate() {
            *self.places.entry((place, block.condition.clone())).or_default() += 1;
        }
        for two in blocks.windows(2) {
            if let [before, after] = two {
                *self.transitions.entry((before.condition.clone(), after.condition.clone())).or_default() +=
                    1;
            }
        }
    }

    fn balance(&self, design: &Design) -> Balance {
        let blocks = design.block_conditions().len();
        let places = blocks * self.places.keys().map(|(place, _)| place + 1).max().unwrap_or(0);
        let mut groups: BTreeMap<&String, usize> = BTreeMap::new();
        self.groups.values().for_each(|group| *groups.entry(group).or_default() += 1);
        Balance {
            at_each_place: range(self.places.values(), places),
            after_each_other: range(
                self.transitions
                    .iter()
                    .filter(|((before, after), _)| before != after)
                    .map(|(_, count)| count),
                blocks * blocks.saturating_sub(1),
            ),
            subjects_in_each_group: range(groups.values(), groups.len()),
            comparison_first: (self.pairs > 0).then(|| self.first as f64 / self.pairs as f64),
        }
    }
}

/// Returns the smallest and the largest of the counts of `cells` cells; a cell without a count has 0.
fn range<'a>(counts: impl Iterator<Item = &'a usize>, cells: usize) -> [usize; 2] {
    let counts: Vec<usize> = counts.copied().collect();
    let most = counts.iter().copied().max().unwrap_or(0);
    let least = if counts.len() < cells { 0 } else { counts.iter().copied().min().unwrap_or(0) };
    [least, most]
}

fn power(arguments: &CheckArguments, study: &DesignFile, subjects: u16, seed: u64) -> Vec<EffectPower> {
    if arguments.runs == 0 {
        return Vec::new();
    }
    let progress = progress_bar(u64::from(arguments.runs), "{percent:>3} %  {elapsed}");
    let one = |run: u32| {
        let seed = seed.wrapping_mul(1_000_003).wrapping_add(u64::from(run) + 1);
        progress.inc(1);
        study_of(&study.design, &study.population, subjects, seed)
    };
    let studies: Vec<_> = (0..arguments.runs).into_par_iter().map(one).collect();
    progress.finish_and_clear();
    power_of(&studies)
}

/// Describes a step as the person sees it.
fn step_text(design: &Design, course: &Course, step: &Step) -> String {
    match step {
        Step::Rest { .. } => "rest".to_owned(),
        Step::Form { questionnaire, .. } => {
            let form = design.questionnaires().get(*questionnaire);
            form.map_or(String::new(), |form| {
                format!("questionnaire {} ({} items)", form.title, form.items.len())
            })
        }
        Step::Trial(trial) => {
            let phase = if trial.phase == Phase::Practice { "practice  " } else { "" };
            let intervals: Vec<String> = course
                .settings(trial)
                .iter()
                .map(|settings| {
                    let shown = settings.iter().filter(|(setting, _)| *setting != Setting::Picture);
                    shown.map(|(setting, value)| format!("{setting} {value}")).collect::<Vec<_>>().join(", ")
                })
                .collect();
            let question = &design.task().question;
            let question = if question.is_empty() { design.task().word() } else { question };
            format!("{phase}{}  -> {question}", intervals.join("  |  "))
        }
    }
}

/// Names the condition of a block: levels of the factors that are constant in it.
fn block_text(design: &Design, trial: &Trial) -> String {
    let by = &design.blocks().by;
    let levels = trial.condition.iter().filter(|(name, _)| by.contains(name));
    let text: Vec<String> = levels.map(|(name, value)| format!("{name} {value}")).collect();
    if text.is_empty() { "all".to_owned() } else { text.join(", ") }
}

fn to_text(check: &Check) -> String {
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
fn picture(check: &Check, design: &Design) -> Figure {
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
