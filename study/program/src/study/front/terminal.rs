//! Front end on a terminal, with answers by keyboard.

use super::{lines_of, next_input};
use flotor_command::{CommandError, say, style};
use flotor_study::apparatus::attend::{FrontEnd, PollResult};
use flotor_study::conduct::ApparatusOrFrontEndError;
use flotor_study::protocol::Quality;
use flotor_study::screen::{Input, May, Pause, Question, Screen, TrialView};
use flotor_study::trial::{Phase, Position, Response};
use std::io::{BufReader, IsTerminal, Write};
use std::sync::mpsc::Receiver;

/// Front end on the terminal of this process.
pub(in crate::study) struct Terminal {
    pub(super) lines: Receiver<String>,
}

impl Terminal {
    /// Creates the front end and starts a thread that reads standard input.
    pub(in crate::study) fn listen() -> Result<Self, CommandError> {
        Ok(Self { lines: lines_of(BufReader::new(std::io::stdin()))? })
    }

    /// Discards input typed before a screen was shown. Piped input is kept: a script knows the sequence.
    pub(super) fn discard_typed(&mut self) {
        if std::io::stdin().is_terminal() {
            while self.lines.try_recv().is_ok() {}
        }
    }
}

impl FrontEnd for Terminal {
    fn show(&mut self, screen: &Screen) -> Result<(), ApparatusOrFrontEndError> {
        self.discard_typed();
        say!("{}", words(screen));
        Ok(())
    }

    fn poll(&mut self, screen: &Screen) -> Result<PollResult, ApparatusOrFrontEndError> {
        let polled = next_input(&self.lines, |line| typed(line, screen).map(PollResult::Input));
        Ok(polled.unwrap_or_else(|why| {
            hint(&why);
            PollResult::Nothing
        }))
    }

    fn warn_out_of_range(&mut self) -> Result<(), ApparatusOrFrontEndError> {
        warn_of_range();
        Ok(())
    }

    fn refuse(&mut self, why: &str) -> Result<(), ApparatusOrFrontEndError> {
        hint(why);
        Ok(())
    }
}

/// Warns visibly and audibly that the handle is out of its range. The bell of the terminal replaces the beep of the thesis.
pub(super) fn warn_of_range() {
    let _ = std::io::stdout().write_all(b"\x07");
    say!("  {} the handle is out of its range: move it back", style::warning("!"));
}

/// Prints the reason for the rejection of an input.
pub(super) fn hint(why: &str) {
    say!("  {why}");
}

/// Formats a text by the experimenter, with its keys.
pub(super) fn text_to_read(text: &str) -> String {
    let (title, rest) = text.split_once('\n').unwrap_or((text, ""));
    let rest: String = rest.trim().lines().map(|line| format!("  {line}\n")).collect();
    format!("\n{}\n{rest}  Enter continues, q stops", style::title(title))
}

/// Formats a screen, with its keys, as text.
fn words(screen: &Screen) -> String {
    match screen {
        Screen::Read { text } => text_to_read(text),
        Screen::Ready { reason, next } => {
            format!(
                "\n{}\n{}\n  Enter continues, n TEXT adds a note, q stops{}",
                style::title(pause(*reason, next)),
                place(next),
                others(next)
            )
        }
        Screen::Feel { trial, position } => {
            let which = match position {
                None => "Feel it",
                Some(Position::First) => "Feel the first",
                Some(Position::Second) => "Feel the second",
            };
            format!("\n{}\n  {which}; Enter when done{}", place(trial), others(trial))
        }
        Screen::Ask { question, trial } => {
            let (more, how) = match trial.quality {
                Quality::Stiffness => ("stiffer", "stiff"),
                Quality::Force => ("stronger", "strong"),
            };
            let question = match question {
                Question::WhichIsMore => {
                    format!("  Which was {more}?  1 first, 2 second, 0 I don't know")
                }
                Question::HowMuch => format!("  How {how}? Any number of your own, larger for {more}"),
            };
            question + &others(trial)
        }
        Screen::Over => format!("\n{}\n  Everything is on disk. Thank you.", style::title("Done")),
    }
}

/// Describes the keys of the optional inputs that the trial permits.
fn others(trial: &TrialView) -> String {
    let key = |may: &May| match may {
        May::Practise => "; p practises first".to_owned(),
        May::Withdraw => "; u takes the last answer back".to_owned(),
        May::Again { left: None } => "; a repeats the trial".to_owned(),
        May::Again { left: Some(left) } => format!("; a repeats the trial, at most {left} more times"),
    };
    trial.may.iter().map(key).collect()
}

fn place(trial: &TrialView) -> String {
    let phase = if trial.phase == Phase::Practice { "practice, does not count" } else { "counts" };
    format!("  {} of about {}  {phase}", trial.number, trial.of_about)
}

fn pause(reason: Pause, next: &TrialView) -> &'static str {
    match (reason, next.phase, next.object_is_shown) {
        (Pause::Welcome, ..) => "Ready",
        (Pause::PhaseChanges, Phase::Practice, _) => "Practice: these answers do not count",
        (Pause::PhaseChanges, ..) => "Practice is over: the next answers count",
        (Pause::ModalityChanges, _, true) => "From now on you see what you feel",
        (Pause::ModalityChanges, _, false) => "From now on you feel only",
        (Pause::Rest, ..) => "Time to rest your hand",
        (Pause::OutOfRange, ..) => "The handle left its range: this trial is repeated",
    }
}

/// Parses a typed line; the error is a hint for the person.
fn typed(line: &str, screen: &Screen) -> Result<Input, String> {
    let line = line.trim();
    let answer = |response| Ok(Input::Answer { response });
    match line {
        "" => return Ok(Input::Continue),
        "q" => return Ok(Input::Stop),
        "a" => return Ok(Input::Again),
        "u" => return Ok(Input::Withdraw),
        "p" => return Ok(Input::Practise),
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
            |_| Err(format!("invalid number `{line}`; write a number such as 25")),
            |rating: f64| answer(Response::Rating(rating)),
        ),
        _ => Err("no question is open; Enter continues".to_owned()),
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
            repeat: 0,
            stimuli: 2,
            quality: Quality::Stiffness,
            may: Vec::new(),
        };
        Screen::Ask { trial, question }
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
        for (line, input) in
            [("", Input::Continue), ("a", Input::Again), ("u", Input::Withdraw), ("q", Input::Stop)]
        {
            assert_eq!(typed(line, &one), Ok(input));
        }
    }
}
