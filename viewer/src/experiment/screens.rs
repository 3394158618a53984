//! What a person in a sitting sees: few words, large, in the middle; nothing that tells how stiff anything is.

use super::{Prompt, StudyKey};
use crate::palette::Palette;
use egui::{Align, Color32, Key, Layout, Rect, RichText, Ui, UiBuilder};
use flotor_study::protocol::Quality;
use flotor_study::screen::{May, Pause, Question, Screen, TrialView};
use flotor_study::trial::{Phase, Position};

/// Sizes of text, points: read from an arm's length and more.
const HEADLINE_PT: f32 = 34.0;
const TEXT_PT: f32 = 21.0;
const KEYS_PT: f32 = 18.0;
const TYPED_PT: f32 = 54.0;

/// The words of a screen.
struct Words {
    headline: &'static str,
    text: String,
    keys: String,
}

/// Shows the screen of a moment over an area; the scene, if it may be seen, lies beneath.
pub fn show(ui: &mut Ui, area: Rect, prompt: &Prompt, palette: &Palette) {
    let Some(screen) = prompt.screen() else { return };
    if let Screen::Read { text } = screen {
        read(ui, area, text, palette);
        below(ui, area, prompt, "Enter to go on", palette);
        return;
    }
    let Words { headline, text, keys } = words(screen);
    let over_scene = prompt.shows_scene();
    let centred = Layout::top_down(Align::Center);
    let mut inner = ui.new_child(UiBuilder::new().max_rect(area).id_salt("screen").layout(centred));
    // Over the scene the words keep out of its way.
    inner.add_space(if over_scene { 0.05 } else { 0.30 } * area.height());
    inner.label(RichText::new(headline).size(HEADLINE_PT).color(palette.text));
    inner.add_space(14.0);
    inner.label(RichText::new(text).size(TEXT_PT).color(palette.faint));
    if matches!(screen, Screen::Ask { question: Question::HowMuch, .. }) {
        inner.add_space(24.0);
        let (typed, color) =
            if prompt.typed().is_empty() { ("–", palette.faint) } else { (prompt.typed(), palette.text) };
        inner.label(RichText::new(typed).size(TYPED_PT).monospace().color(color));
    }
    below(ui, area, prompt, &keys, palette);
}

/// A text of the experimenter, from the top; a long one is scrolled by the wheel.
fn read(ui: &mut Ui, area: Rect, text: &str, palette: &Palette) {
    let (title, rest) = text.split_once('\n').unwrap_or((text, ""));
    let inside = area.shrink2(egui::vec2(0.12 * area.width(), 20.0));
    let inside = Rect::from_min_max(inside.min, egui::pos2(inside.right(), area.bottom() - 130.0));
    let mut inner = ui.new_child(UiBuilder::new().max_rect(inside).id_salt("read"));
    inner.label(RichText::new(title).size(HEADLINE_PT).color(palette.text));
    inner.add_space(14.0);
    egui::ScrollArea::vertical().show(&mut inner, |ui| {
        ui.label(RichText::new(rest.trim()).size(TEXT_PT).color(palette.text));
    });
}

/// The foot of a screen: warnings, which keys mean something, how far it is.
fn below(ui: &mut Ui, area: Rect, prompt: &Prompt, keys: &str, palette: &Palette) {
    let top = area.bottom() - if prompt.shows_scene() { 92.0 } else { 118.0 };
    let area = Rect::from_min_max(egui::pos2(area.left(), top), area.max);
    let centred = Layout::top_down(Align::Center);
    let mut inner = ui.new_child(UiBuilder::new().max_rect(area).id_salt("keys").layout(centred));
    let warning = prompt.is_warned().then_some("The handle is out of its range: let it come back");
    if let Some(warning) = warning.or(prompt.refused()) {
        inner.label(RichText::new(warning).size(TEXT_PT).strong().color(palette.warning));
    } else {
        inner.add_space(TEXT_PT + 8.0);
    }
    let color = if prompt.is_persons_turn() { accent(palette) } else { palette.faint };
    inner.label(
        RichText::new(if prompt.is_persons_turn() { keys } else { "One moment" }).size(KEYS_PT).color(color),
    );
    inner.add_space(6.0);
    if let Some(trial) = prompt.screen().and_then(Screen::trial) {
        let text = format!("{} of about {}", trial.number, trial.of_about);
        inner.label(RichText::new(text).small().color(palette.faint));
    }
}

fn accent(palette: &Palette) -> Color32 {
    palette.components[2]
}

fn words(screen: &Screen) -> Words {
    match screen {
        Screen::Ready { reason, next } => pause(*reason, next),
        Screen::Feel { trial, position } => feel(trial, *position),
        Screen::Ask { trial, question } => ask(trial, *question),
        // Shown by itself.
        Screen::Read { .. } => Words { headline: "", text: String::new(), keys: String::new() },
        Screen::Over => Words {
            headline: "Thank you",
            text: "That was all. Please let go of the handle.".to_owned(),
            keys: "Enter closes the window".to_owned(),
        },
    }
}

fn pause(reason: Pause, next: &TrialView) -> Words {
    let seen = match (next.object_is_shown, next.quality) {
        (true, Quality::Stiffness) => "You will see the spring while you feel it.",
        (true, Quality::Force) => "You will see what you feel.",
        (false, _) => "There will be nothing to see, only to feel.",
    };
    let (headline, text, keys) = match reason {
        Pause::Welcome => (task(next), format!("{}\n\n{seen}", how(next)), "Enter to begin"),
        Pause::PhaseChanges if next.phase == Phase::Main => {
            ("From now on it counts", seen.to_owned(), "Enter to go on")
        }
        Pause::PhaseChanges => {
            ("A few to get used to it", format!("They do not count.\n{seen}"), "Enter to go on")
        }
        Pause::ModalityChanges if next.object_is_shown => {
            ("From now on you see what you feel", seen.to_owned(), "Enter to go on")
        }
        Pause::ModalityChanges => ("From now on you feel only", seen.to_owned(), "Enter to go on"),
        Pause::Rest => ("Time for a rest", "Let go of the handle for a while.".to_owned(), "Enter to go on"),
        Pause::OutOfRange => (
            "Once more",
            "The handle was pushed out of its range, so this one comes again.\nPress a little less far."
                .to_owned(),
            "Enter to go on",
        ),
    };
    Words { headline, text, keys: keys.to_owned() + &others(next) }
}

/// The keys for what a person may do but need not.
fn others(trial: &TrialView) -> String {
    let key = |may: &May| match (may, trial.stimuli) {
        (May::Again { left }, stimuli) => {
            let what = if stimuli == 1 { "it" } else { "them" };
            let most = match left {
                None => String::new(),
                Some(1) => ", once more at most".to_owned(),
                Some(left) => format!(", {left} times more at most"),
            };
            format!("          A  feel {what} again{most}")
        }
        (May::Practise, _) => "          P  practise first".to_owned(),
        (May::Withdraw, _) => "          U  take the last answer back".to_owned(),
    };
    trial.may.iter().map(key).collect()
}

fn task(trial: &TrialView) -> &'static str {
    match (trial.stimuli, trial.quality) {
        (1, Quality::Stiffness) => "How stiff is the spring?",
        (1, Quality::Force) => "How strong is the force?",
        (_, Quality::Stiffness) => "Which spring is stiffer?",
        (_, Quality::Force) => "Which force is stronger?",
    }
}

fn how(trial: &TrialView) -> String {
    let (noun, more, how) = match trial.quality {
        Quality::Stiffness => ("spring", "stiffer", "stiff"),
        Quality::Force => ("force", "stronger", "strong"),
    };
    let press = "Press the handle down and let it come up, as often as you like.";
    if trial.stimuli == 1 {
        format!(
            "You will feel one {noun} at a time.\nGive each a number that says how {how} it is to you:\ntwice as {how}, twice \
             the number. Any number will do.\n\n{press}"
        )
    } else {
        format!(
            "You will feel two, one after the other.\nThen say which of the two was {more}, or that you do not know.\n\n{press}"
        )
    }
}

fn feel(trial: &TrialView, position: Option<Position>) -> Words {
    let headline = match (position, trial.quality) {
        (None, Quality::Stiffness) => "Feel the spring",
        (Some(Position::First), Quality::Stiffness) => "First spring",
        (Some(Position::Second), Quality::Stiffness) => "Second spring",
        (None, Quality::Force) => "Feel the force",
        (Some(Position::First), Quality::Force) => "First force",
        (Some(Position::Second), Quality::Force) => "Second force",
    };
    let practice = if trial.phase == Phase::Practice { "To get used to it. " } else { "" };
    let text = format!("{practice}Press the handle down and let it come up.");
    Words { headline, text, keys: "Enter when you have felt it".to_owned() + &others(trial) }
}

fn ask(trial: &TrialView, question: Question) -> Words {
    let is_practice = trial.phase == Phase::Practice;
    let (headline, text, keys) = match (question, trial.quality) {
        (Question::WhichIsMore, quality) => (
            if quality == Quality::Stiffness { "Which one was stiffer?" } else { "Which one was stronger?" },
            if is_practice { "To practise: this answer does not count" } else { "" },
            "1  the first          2  the second          0  I don't know",
        ),
        (Question::HowMuch, quality) => (
            if quality == Quality::Stiffness { "How stiff was it?" } else { "How strong was it?" },
            if is_practice {
                "Type a number above 0; to practise, it does not count"
            } else {
                "Type a number above 0"
            },
            "Enter when it is right          Backspace corrects",
        ),
    };
    Words { headline, text: text.to_owned(), keys: keys.to_owned() + &others(trial) }
}

/// The keys pressed in this picture that mean something here.
#[must_use]
pub fn keys(ui: &Ui) -> Vec<StudyKey> {
    ui.input(|input| {
        let pressed =
            |digit: &u8| Key::from_name(&digit.to_string()).is_some_and(|key| input.key_pressed(key));
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
        keys.extend(others.into_iter().filter(|(key, _)| input.key_pressed(*key)).map(|(_, means)| means));
        keys
    })
}
