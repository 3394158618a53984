//! Front ends of lines: words on a terminal, or JSON for a window that runs as another program.

use crate::cli::style;
use crate::study::attend::FrontEnd;
use clap::ValueEnum;
use flotor_study::conduct::OutsideError;
use flotor_study::protocol::Quality;
use flotor_study::screen::{Input, Pause, Question, Screen, TrialView};
use flotor_study::trial::{Phase, Position, Response};
use std::io::{BufRead, stdin};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

/// How long the handle goes unwatched at most while somebody thinks.
const MOMENT: Duration = Duration::from_millis(50);

/// `--screen`
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum ScreenOption {
    /// The viewer's window, in front of the person
    #[default]
    Viewer,
    /// Words on this terminal, answers by keyboard
    Terminal,
    /// A screen per line of JSON on standard output, an input per line on standard input
    Json,
}

/// Lines of standard input as they come.
pub(super) fn typed_lines() -> std::io::Result<Receiver<String>> {
    let (sender, lines) = channel();
    // Ends with the process: nothing can call it back from a read.
    std::thread::Builder::new().name("flotor-answers".to_owned()).spawn(move || {
        for line in stdin().lock().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                break;
            }
        }
    })?;
    Ok(lines)
}

/// Reads lines as they come, and shows screens in one of two languages.
pub(super) struct LineFront {
    language: ScreenOption,
    lines: Receiver<String>,
}

impl LineFront {
    /// Listens to standard input from now on.
    pub(super) fn listen(language: ScreenOption) -> std::io::Result<Self> {
        Ok(Self { language, lines: typed_lines()? })
    }
}

impl FrontEnd for LineFront {
    fn show(&mut self, screen: &Screen) -> Result<(), OutsideError> {
        match self.language {
            ScreenOption::Terminal | ScreenOption::Viewer => say!("{}", words(screen)),
            ScreenOption::Json => say!("{}", serde_json::to_string(screen)?),
        }
        Ok(())
    }

    fn poll(&mut self, screen: &Screen) -> Result<Option<Input>, OutsideError> {
        let line = match self.lines.recv_timeout(MOMENT) {
            Ok(line) => line,
            Err(RecvTimeoutError::Timeout) => return Ok(None),
            // Nobody types any more.
            Err(RecvTimeoutError::Disconnected) => return Ok(Some(Input::Stop)),
        };
        let input = match self.language {
            ScreenOption::Terminal | ScreenOption::Viewer => typed(&line, screen),
            ScreenOption::Json => serde_json::from_str(&line).map_err(|error| error.to_string()),
        };
        match input {
            Ok(input) => Ok(Some(input)),
            Err(why) => {
                self.refuse(&why)?;
                Ok(None)
            }
        }
    }

    fn warn_out_of_range(&mut self) -> Result<(), OutsideError> {
        match self.language {
            // The bell is the beep of the report; it is not the noise that masks it.
            ScreenOption::Terminal | ScreenOption::Viewer => {
                say!("\x07  {} the handle is out of its range: let it come back", style::warning("!"))
            }
            ScreenOption::Json => say!("{}", serde_json::json!({ "warning": "out-of-range" })),
        }
        Ok(())
    }

    fn refuse(&mut self, why: &str) -> Result<(), OutsideError> {
        match self.language {
            ScreenOption::Terminal | ScreenOption::Viewer => say!("  {why}"),
            ScreenOption::Json => say!("{}", serde_json::json!({ "refused": why })),
        }
        Ok(())
    }
}

/// A screen in words.
fn words(screen: &Screen) -> String {
    match screen {
        Screen::Ready { reason, next } => {
            format!(
                "\n{}\n{}\n  Enter goes on, n TEXT takes a note, q stops",
                style::title(pause(*reason, next)),
                place(next)
            )
        }
        Screen::Feel { trial, position } => {
            let which = match position {
                None => "Feel it",
                Some(Position::First) => "Feel the first",
                Some(Position::Second) => "Feel the second",
            };
            format!("\n{}\n  {which}; Enter when done", place(trial))
        }
        Screen::Ask { question, quality, .. } => {
            let (more, how) = match quality {
                Quality::Stiffness => ("stiffer", "stiff"),
                Quality::Force => ("stronger", "strong"),
            };
            match question {
                Question::Nothing => "  That was practice: Enter goes on, a feels it again".to_owned(),
                Question::WhichIsMore => {
                    format!("  Which was {more}?  1 first, 2 second, 0 I don't know; a feels them again")
                }
                Question::HowMuch => {
                    format!("  How {how}? Any number of your own, larger for {more}; a feels it again")
                }
            }
        }
        Screen::Over => format!("\n{}\n  Everything is on disk. Thank you.", style::title("Done")),
    }
}

fn place(trial: &TrialView) -> String {
    let phase = if trial.phase == Phase::Practice { "practice" } else { "counts" };
    let seen = if trial.object_is_shown { "object shown" } else { "object hidden" };
    format!("  {} of about {}  {phase}, {seen}, condition {}", trial.number, trial.of_about, trial.condition)
}

fn pause(reason: Pause, next: &TrialView) -> &'static str {
    match (reason, next.phase, next.object_is_shown) {
        (Pause::Welcome, ..) => "Ready",
        (Pause::PhaseChanges, Phase::Main, _) => "Practice is over: from now on it counts",
        (Pause::PhaseChanges, Phase::Practice, _) => "A few to practise first; they do not count",
        (Pause::ModalityChanges, _, true) => "From now on you see what you feel",
        (Pause::ModalityChanges, _, false) => "From now on you feel only",
        (Pause::Rest, ..) => "Time to rest your hand",
        (Pause::OutOfRange, ..) => "The handle left its range, so this one comes again",
    }
}

/// What a typed line means.
fn typed(line: &str, screen: &Screen) -> Result<Input, String> {
    let line = line.trim();
    let answer = |response| Ok(Input::Answer { response });
    match line {
        "" => return Ok(Input::Continue),
        "q" => return Ok(Input::Stop),
        "a" => return Ok(Input::Again),
        _ => {}
    }
    if let Some(text) = line.strip_prefix("n ") {
        return Ok(Input::Note { text: text.trim().to_owned() });
    }
    match screen {
        Screen::Ask { question: Question::WhichIsMore, .. } => match line {
            "1" => answer(Response::First),
            "2" => answer(Response::Second),
            "0" => answer(Response::DontKnow),
            _ => Err("type 1, 2 or 0".to_owned()),
        },
        Screen::Ask { question: Question::HowMuch, .. } => line.replace(',', ".").parse().map_or_else(
            |_| Err(format!("`{line}` is no number")),
            |rating| answer(Response::Rating(rating)),
        ),
        _ => Err("nothing is asked just now; Enter goes on".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(question: Question) -> Screen {
        let trial = TrialView {
            number: 1,
            of_about: 2,
            phase: Phase::Main,
            object_is_shown: true,
            condition: "A1".to_owned(),
            repeat: 0,
        };
        Screen::Ask { trial, question, quality: Quality::Stiffness }
    }

    #[test]
    fn keys_mean_answers() {
        let answer = |response| Ok(Input::Answer { response });
        let pair = ask(Question::WhichIsMore);
        assert_eq!(typed("1", &pair), answer(Response::First));
        assert_eq!(typed(" 0 ", &pair), answer(Response::DontKnow));
        assert!(typed("3", &pair).is_err());
        let one = ask(Question::HowMuch);
        assert_eq!(typed("7,5", &one), answer(Response::Rating(7.5)));
        assert!(typed("seven", &one).is_err());
        assert_eq!(typed("n 5 o'clock", &one), Ok(Input::Note { text: "5 o'clock".to_owned() }));
        for (line, input) in [("", Input::Continue), ("a", Input::Again), ("q", Input::Stop)] {
            assert_eq!(typed(line, &one), Ok(input));
        }
    }
}
