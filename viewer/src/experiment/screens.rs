//! What the subject sees: few words, large, in the middle; nothing that tells how stiff anything is.

use super::{Experiment, Screen};
use crate::palette::Palette;
use egui::{Align, Color32, Key, Layout, Rect, RichText, Ui, UiBuilder};
use flotor_study::trial::{Phase, Presented};

use super::StudyKey;

/// Sizes of text, points: read from an arm's length and more.
const HEADLINE_PT: f32 = 34.0;
const TEXT_PT: f32 = 21.0;
const TYPED_PT: f32 = 54.0;

/// The words of a screen.
struct Words {
    headline: String,
    text: String,
    keys: &'static str,
}

/// Shows the screen of a moment over an area; the scene, if it may be seen, lies beneath.
pub fn show(ui: &mut Ui, area: Rect, experiment: &Experiment, palette: &Palette) {
    let Words { headline, text, keys } = words(experiment);
    let over_scene = experiment.shows_scene();
    let mut inner = ui
        .new_child(UiBuilder::new().max_rect(area).id_salt("screen").layout(Layout::top_down(Align::Center)));
    // Over the scene the words keep out of its way.
    inner.add_space(if over_scene { 0.05 } else { 0.30 } * area.height());
    inner.label(RichText::new(headline).size(HEADLINE_PT).color(palette.text));
    inner.add_space(14.0);
    inner.label(RichText::new(text).size(TEXT_PT).color(palette.faint));
    if experiment.screen() == Screen::Answer
        && experiment.trial().is_some_and(|trial| matches!(trial.presented, Presented::One { .. }))
    {
        inner.add_space(24.0);
        let typed = if experiment.typed().is_empty() { "–" } else { experiment.typed() };
        let color = if experiment.typed().is_empty() { palette.faint } else { palette.text };
        inner.label(RichText::new(typed).size(TYPED_PT).monospace().color(color));
    }
    let below = Rect::from_min_max(
        egui::pos2(area.left(), area.bottom() - if over_scene { 58.0 } else { 84.0 }),
        area.max,
    );
    let mut inner = ui
        .new_child(UiBuilder::new().max_rect(below).id_salt("keys").layout(Layout::top_down(Align::Center)));
    inner.label(RichText::new(keys).size(TEXT_PT - 3.0).color(accent(palette)));
    inner.add_space(6.0);
    let (presented, _) = experiment.progress();
    if presented > 0 && experiment.screen() != Screen::Over {
        inner.label(RichText::new(format!("{presented} done")).small().color(palette.faint));
    }
}

fn accent(palette: &Palette) -> Color32 {
    palette.components[2]
}

fn words(experiment: &Experiment) -> Words {
    let words = |headline: &str, text: &str, keys: &'static str| Words {
        headline: headline.to_owned(),
        text: text.to_owned(),
        keys,
    };
    let Some(trial) = experiment.trial() else {
        return words("Thank you", "That was all. Please let go of the handle.", "");
    };
    let is_pair = matches!(trial.presented, Presented::Pair(_));
    match experiment.screen() {
        Screen::Instruction if is_pair => words(
            "Which spring is stiffer?",
            "You will feel two springs, one after the other.\nThen say which of the two was stiffer.\n\nPress the handle \
             down and let it come up, as often as you like.",
            "Enter to begin",
        ),
        Screen::Instruction => words(
            "How stiff is the spring?",
            "You will feel one spring at a time.\nGive each a number that says how stiff it is to you:\ntwice as stiff, twice \
             the number. Any number above zero will do.\n\nPress the handle down and let it come up, as often as you like.",
            "Enter to begin",
        ),
        Screen::Present(index) => {
            let practice = if trial.phase == Phase::Practice { "To get used to it. " } else { "" };
            let name =
                if is_pair { ["First spring", "Second spring"][index.min(1)] } else { "Feel the spring" };
            words(
                name,
                &format!("{practice}Press the handle down and let it come up."),
                "Enter when you have felt it",
            )
        }
        Screen::Answer if is_pair => words(
            "Which one was stiffer?",
            "",
            "1  the first          2  the second          0  I don't know",
        ),
        Screen::Answer => {
            words("How stiff was it?", "Type a number", "Enter when it is right, Backspace to correct")
        }
        Screen::Break => words("Time for a rest", "Let go of the handle for a while.", "Enter to go on"),
        Screen::Over => words("Thank you", "That was all. Please let go of the handle.", ""),
    }
}

/// The keys pressed in this picture that mean something here.
#[must_use]
pub fn keys(ui: &Ui) -> Vec<StudyKey> {
    const DIGITS: [Key; 10] = [
        Key::Num0,
        Key::Num1,
        Key::Num2,
        Key::Num3,
        Key::Num4,
        Key::Num5,
        Key::Num6,
        Key::Num7,
        Key::Num8,
        Key::Num9,
    ];
    ui.input(|input| {
        let digits = DIGITS.iter().zip(0_u8..).filter(|(key, _)| input.key_pressed(**key));
        let mut keys: Vec<StudyKey> = digits.map(|(_, digit)| StudyKey::Digit(digit)).collect();
        let others = [
            (Key::Period, StudyKey::Point),
            (Key::Comma, StudyKey::Point),
            (Key::Backspace, StudyKey::Back),
            (Key::Enter, StudyKey::Enter),
        ];
        keys.extend(others.into_iter().filter(|(key, _)| input.key_pressed(*key)).map(|(_, means)| means));
        keys
    })
}
