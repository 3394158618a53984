//! Screens for a person in a sitting: few words, large, in the middle, which give no hint of the stiffness.
//!
//! All sizes are fractions of the height, so that a text is readable from the same distance on every display. The keys stand beneath
//! their text.

use super::texts::Texts;
use super::{Prompt, StudyKey};
use crate::palette::Palette;
use crate::ui::key::pressed_alone;
use egui::{Align, Color32, Key, Layout, Rect, RichText, ScrollArea, Ui, UiBuilder, vec2};
use flotor_study::protocol::Quality;
use flotor_study::screen::{May, Pause, Question, Screen, TrialView};
use flotor_study::trial::{Phase, Position};

/// Fraction of the height for texts beneath a visible scene.
const WORDS_PART: f32 = 0.27;
/// Fraction of the height above the texts without a visible scene.
const ABOVE_PART: f32 = 0.2;
/// Largest fraction of the height for a text to read; a longer text is scrolled.
const READ_PART: f32 = 0.6;
/// Upper limit of the height to which text sizes are relative, as a fraction of the width: in portrait orientation, the lines
/// still fit.
const HEIGHT_OF_WIDTH: f32 = 0.75;

/// Sizes of text, points.
struct Sizes {
    headline: f32,
    text: f32,
    keys: f32,
    typed: f32,
    count: f32,
    gap: f32,
}

impl Sizes {
    fn of(area: Rect) -> Self {
        let height = area.height().min(HEIGHT_OF_WIDTH * area.width());
        let [headline, text, keys, typed, count, gap] =
            [0.058, 0.036, 0.032, 0.09, 0.024, 0.02].map(|share| share * height);
        Self { headline, text, keys, typed, count, gap }
    }
}

/// Texts of a screen.
struct Words<'a> {
    headline: &'a str,
    text: String,
    keys: String,
}

/// Returns the areas of the scene and of the texts beneath the scene.
#[must_use]
pub fn beneath_scene(area: Rect) -> (Rect, Rect) {
    area.split_top_bottom_at_y((area.bottom() - WORDS_PART * area.height()).round())
}

/// Shows the current screen in an area, beneath the scene if the scene is visible.
pub fn show(ui: &mut Ui, area: Rect, prompt: &Prompt, palette: &Palette) {
    let Some(screen) = prompt.screen() else { return };
    let sizes = Sizes::of(area);
    let place = if prompt.shows_scene() { beneath_scene(area).1 } else { area };
    let centred = Layout::top_down(Align::Center);
    let mut inner = ui.new_child(UiBuilder::new().max_rect(place).id_salt("screen").layout(centred));
    inner.spacing_mut().item_spacing.y = 0.5 * sizes.gap;
    if let Screen::Read { text } = screen {
        inner.add_space(0.05 * area.height());
        read(&mut inner, text, &sizes, area, palette);
        below(&mut inner, prompt, &prompt.texts.key_go_on, &sizes, palette);
        return;
    }
    let Words { headline, text, keys } = words(screen, &prompt.texts);
    inner.add_space(if prompt.shows_scene() { 0.0 } else { ABOVE_PART * area.height() });
    inner.label(RichText::new(headline).size(sizes.headline).color(palette.text));
    if !text.is_empty() {
        inner.label(RichText::new(text).size(sizes.text).color(palette.faint));
    }
    if matches!(screen, Screen::Ask { question: Question::HowMuch, .. }) {
        inner.add_space(sizes.gap);
        let (typed, color) =
            if prompt.typed().is_empty() { ("–", palette.faint) } else { (prompt.typed(), palette.text) };
        inner.label(RichText::new(typed).size(sizes.typed).monospace().color(color));
    }
    inner.add_space(if prompt.shows_scene() { 0.0 } else { sizes.gap });
    below(&mut inner, prompt, &keys, &sizes, palette);
}

/// Shows a message and, smaller, the action required.
pub fn line(ui: &mut Ui, area: Rect, [first, second]: [&str; 2], palette: &Palette) {
    let (sizes, centred) = (Sizes::of(area), Layout::top_down(Align::Center));
    let mut inner = ui.new_child(UiBuilder::new().max_rect(area).layout(centred));
    inner.add_space(0.4 * area.height());
    inner.label(RichText::new(first).size(sizes.headline));
    inner.label(RichText::new(second).size(sizes.text).color(palette.faint));
}

/// Shows a text of the experimenter, from the top; a long text is scrolled by the wheel.
fn read(ui: &mut Ui, text: &str, sizes: &Sizes, area: Rect, palette: &Palette) {
    let (title, rest) = text.split_once('\n').unwrap_or((text, ""));
    let width = 0.76 * area.width();
    ui.allocate_ui_with_layout(vec2(width, area.height()), Layout::top_down(Align::Min), |ui| {
        ui.set_width(width);
        ui.label(RichText::new(title).size(sizes.headline).color(palette.text));
        ui.add_space(sizes.gap);
        ScrollArea::vertical().max_height(READ_PART * area.height()).auto_shrink([false, true]).show(
            ui,
            |ui| {
                ui.label(RichText::new(rest.trim()).size(sizes.text).color(palette.text));
            },
        );
    });
}

/// Shows the lines beneath the text of a screen: active keys, count of trials, warnings.
fn below(ui: &mut Ui, prompt: &Prompt, keys: &str, sizes: &Sizes, palette: &Palette) {
    let texts = &prompt.texts;
    let (keys, color) =
        if prompt.is_persons_turn() { (keys, accent(palette)) } else { (texts.wait.as_str(), palette.faint) };
    ui.label(RichText::new(keys).size(sizes.keys).color(color));
    if let Some(trial) = prompt.screen().and_then(Screen::trial) {
        let count = texts.count.replace("{number}", &trial.number.to_string());
        let count = count.replace("{of_about}", &trial.of_about.to_string());
        ui.label(RichText::new(count).size(sizes.count).color(palette.faint));
    }
    let warning = prompt.is_warned().then_some(texts.handle_out_of_range.as_str());
    if let Some(warning) = warning.or(prompt.refused()) {
        ui.label(RichText::new(warning).size(sizes.text).strong().color(palette.warning));
    }
}

fn accent(palette: &Palette) -> Color32 {
    palette.components[2]
}

fn words<'a>(screen: &Screen, texts: &'a Texts) -> Words<'a> {
    match screen {
        Screen::Ready { reason, next } => pause(*reason, next, texts),
        Screen::Feel { trial, position } => feel(trial, *position, texts),
        Screen::Ask { trial, question } => ask(trial, *question, texts),
        // Shown by `read`.
        Screen::Read { .. } => Words { headline: "", text: String::new(), keys: String::new() },
        Screen::Over => {
            Words { headline: &texts.over, text: texts.over_how.clone(), keys: texts.key_close.clone() }
        }
    }
}

fn pause<'a>(reason: Pause, next: &TrialView, texts: &'a Texts) -> Words<'a> {
    let seen = match (next.object_is_shown, next.quality) {
        (true, Quality::Stiffness) => &texts.seen_stiffness,
        (true, Quality::Force) => &texts.seen_force,
        (false, _) => &texts.not_seen,
    };
    let (headline, text) = match reason {
        Pause::Welcome => {
            let (task, how) = task(next, texts);
            (task, format!("{how}\n\n{}\n\n{seen}", texts.press_often))
        }
        Pause::PhaseChanges if next.phase == Phase::Main => (&texts.main_begins, seen.clone()),
        Pause::PhaseChanges => (&texts.practice_begins, format!("{}\n{seen}", texts.practice_does_not_count)),
        Pause::ModalityChanges if next.object_is_shown => (&texts.vision_begins, seen.clone()),
        Pause::ModalityChanges => (&texts.vision_ends, seen.clone()),
        Pause::Rest => (&texts.rest, texts.rest_how.clone()),
        Pause::OutOfRange => (&texts.out_of_range, texts.out_of_range_how.clone()),
    };
    let keys = if reason == Pause::Welcome { &texts.key_begin } else { &texts.key_go_on };
    Words { headline, text, keys: keys.to_owned() + &others(next, texts) }
}

/// Returns the texts for the keys of optional actions.
fn others(trial: &TrialView, texts: &Texts) -> String {
    let key = |may: &May| match may {
        May::Again { left } => {
            let again = if trial.stimuli == 1 { &texts.key_again_one } else { &texts.key_again_pair };
            let most = match left {
                None => String::new(),
                Some(1) => texts.again_last.clone(),
                Some(left) => texts.again_left.replace("{left}", &left.to_string()),
            };
            format!("{again}{most}")
        }
        May::Practise => texts.key_practise.clone(),
        May::Withdraw => texts.key_withdraw.clone(),
    };
    trial.may.iter().map(|may| format!("          {}", key(may))).collect()
}

/// Returns the task of a trial and its instructions.
fn task<'a>(trial: &TrialView, texts: &'a Texts) -> (&'a String, &'a str) {
    match (trial.stimuli, trial.quality) {
        (1, Quality::Stiffness) => (&texts.task_rate_stiffness, &texts.how_rate_stiffness),
        (1, Quality::Force) => (&texts.task_rate_force, &texts.how_rate_force),
        (_, Quality::Stiffness) => (&texts.task_pair_stiffness, &texts.how_pair_stiffness),
        (_, Quality::Force) => (&texts.task_pair_force, &texts.how_pair_force),
    }
}

fn feel<'a>(trial: &TrialView, position: Option<Position>, texts: &'a Texts) -> Words<'a> {
    let headline = match (position, trial.quality) {
        (None, Quality::Stiffness) => &texts.feel_stiffness,
        (Some(Position::First), Quality::Stiffness) => &texts.feel_first_stiffness,
        (Some(Position::Second), Quality::Stiffness) => &texts.feel_second_stiffness,
        (None, Quality::Force) => &texts.feel_force,
        (Some(Position::First), Quality::Force) => &texts.feel_first_force,
        (Some(Position::Second), Quality::Force) => &texts.feel_second_force,
    };
    let text = if trial.phase == Phase::Practice { &texts.press_in_practice } else { &texts.press };
    Words { headline, text: text.clone(), keys: texts.key_felt.clone() + &others(trial, texts) }
}

fn ask<'a>(trial: &TrialView, question: Question, texts: &'a Texts) -> Words<'a> {
    let is_practice = trial.phase == Phase::Practice;
    let headline = match (question, trial.quality) {
        (Question::WhichIsMore, Quality::Stiffness) => &texts.ask_pair_stiffness,
        (Question::WhichIsMore, Quality::Force) => &texts.ask_pair_force,
        (Question::HowMuch, Quality::Stiffness) => &texts.ask_rate_stiffness,
        (Question::HowMuch, Quality::Force) => &texts.ask_rate_force,
    };
    let (text, keys) = match question {
        Question::WhichIsMore if is_practice => (texts.answer_in_practice.clone(), &texts.key_answer_pair),
        Question::WhichIsMore => (String::new(), &texts.key_answer_pair),
        Question::HowMuch if is_practice => (texts.type_number_in_practice.clone(), &texts.key_answer_rate),
        Question::HowMuch => (texts.type_number.clone(), &texts.key_answer_rate),
    };
    Words { headline, text, keys: keys.to_owned() + &others(trial, texts) }
}

/// Returns the keys of a sitting pressed in this frame.
#[must_use]
pub fn keys(ui: &Ui) -> Vec<StudyKey> {
    ui.input(|input| {
        let pressed =
            |digit: &u8| Key::from_name(&digit.to_string()).is_some_and(|key| pressed_alone(input, key));
        let mut keys: Vec<StudyKey> = (0..=9).filter(pressed).map(StudyKey::Digit).collect();
        let others = [
            (Key::Period, StudyKey::Point),
            (Key::Comma, StudyKey::Point),
            (Key::Backspace, StudyKey::Back),
            (Key::Enter, StudyKey::Enter),
            (Key::A, StudyKey::Again),
            (Key::U, StudyKey::Withdraw),
            (Key::P, StudyKey::Practise),
        ];
        keys.extend(others.into_iter().filter(|(key, _)| pressed_alone(input, *key)).map(|(_, means)| means));
        keys
    })
}
