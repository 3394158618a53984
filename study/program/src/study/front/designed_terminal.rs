//! Screens of designed studies on a terminal, with answers by keyboard.

use super::next_input;
use super::terminal::{Terminal, hint, text_to_read, warn_of_range};
use flotor_command::{say, style};
use flotor_study::apparatus::attend::{FrontEnd, PollResult};
use flotor_study::conduct::ApparatusOrFrontEndError;
use flotor_study::designed::screen::{Again, Input, Pause, Picture, Screen, TrialPlace};
use flotor_study_design::answer::Answer;
use flotor_study_design::course::Phase;
use flotor_study_design::form::Item;
use flotor_study_design::task::{AnswerScale, Ask, Task};
use flotor_study_design::value::Value;

impl FrontEnd<Screen, Input> for Terminal {
    fn show(&mut self, screen: &Screen) -> Result<(), ApparatusOrFrontEndError> {
        self.discard_typed();
        say!("{}", words(screen));
        Ok(())
    }

    fn poll(&mut self, screen: &Screen) -> Result<PollResult<Input>, ApparatusOrFrontEndError> {
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

/// Formats a screen, with its keys, as text.
fn words(screen: &Screen) -> String {
    match screen {
        Screen::Read { text } => text_to_read(text),
        Screen::Ready { reason, next } => {
            let place = next.as_ref().map_or(String::new(), |next| format!("{}\n", place(next)));
            let title = style::title(pause(*reason, next.as_ref()));
            format!("\n{title}\n{place}  Enter continues, n TEXT adds a note, q stops")
        }
        Screen::Feel { trial, interval, of } => {
            let which = match (interval, of) {
                (_, 1) => "Feel it",
                (1, _) => "Feel the first",
                (_, 2) => "Feel the second",
                _ => "Feel the next",
            };
            format!("\n{}\n  {which}; Enter when done", place(trial))
        }
        Screen::Ask { task, again } => {
            let again = match again {
                Again::Unlimited => "; a repeats the trial".to_owned(),
                Again::Left(0) => String::new(),
                Again::Left(left) => format!("; a repeats the trial, at most {left} more times"),
            };
            format!("  {}  {}{again}", question(task), keys(&task.ask))
        }
        Screen::Confidence { scale } => format!("  How sure are you?  {}", points(scale)),
        Screen::Item { title, item, number, of } => {
            let heading = if *number == 1 && !title.is_empty() {
                format!("\n{}\n", style::title(title))
            } else {
                String::new()
            };
            format!("{heading}  {number} of {of}  {}  {}", item.text(), item_keys(item))
        }
        Screen::Over => format!("\n{}\n  Everything is on disk. Thank you.", style::title("Done")),
    }
}

fn place(trial: &TrialPlace) -> String {
    let phase = match trial.phase {
        Phase::Practice => "practice, does not count",
        Phase::Main => "counts",
    };
    format!("  {}  block {}  {phase}", trial.number, trial.block)
}

fn pause(reason: Pause, next: Option<&TrialPlace>) -> &'static str {
    let is_practice = next.is_some_and(|next| next.phase == Phase::Practice);
    match (reason, next.and_then(|next| next.picture)) {
        (Pause::Start, _) => "Ready",
        (Pause::PhaseChanges, _) if is_practice => "Practice: these answers do not count",
        (Pause::PhaseChanges, _) => "Practice is over: the next answers count",
        (Pause::PictureChanges, Some(Picture::Shown)) => "From now on you see what you feel",
        (Pause::PictureChanges, _) => "From now on you feel only",
        (Pause::BlockBegins, _) => "A new part begins",
        (Pause::Rest, _) => "Time to rest your hand",
        (Pause::OutOfRange, _) => "The handle left its range: this trial is repeated",
    }
}

/// Returns the question of the study file, or the usual one.
fn question(task: &Task) -> &str {
    match task.ask {
        _ if !task.question.is_empty() => &task.question,
        Ask::Choice { .. } => "Which was more?",
        Ask::Detection { .. } => "Did you notice it?",
        Ask::Rating { .. } => "Your rating?",
        Ask::Magnitude => "How much?",
    }
}

fn keys(ask: &Ask) -> String {
    match ask {
        Ask::Choice { unsure: true } => "1 first, 2 second, 0 I don't know".to_owned(),
        Ask::Choice { unsure: false } => "1 first, 2 second".to_owned(),
        Ask::Detection { .. } => "1 yes, 0 no".to_owned(),
        Ask::Rating { scale } => points(scale),
        Ask::Magnitude => "any number of your own, larger for more".to_owned(),
    }
}

fn points(scale: &AnswerScale) -> String {
    let end = |number: f64, text: &str| {
        if text.is_empty() { number.to_string() } else { format!("{number} ({text})") }
    };
    let step = if scale.step == 1.0 { String::new() } else { format!(" in steps of {}", scale.step) };
    format!("{} to {}{step}", end(scale.least, &scale.low), end(scale.most, &scale.high))
}

fn item_keys(item: &Item) -> String {
    match item {
        Item::Scale { scale, .. } => points(scale),
        Item::Choice { options, .. } => {
            let options = options.iter().zip(1..).map(|(option, number)| format!("{number} {option}"));
            options.collect::<Vec<_>>().join(", ")
        }
        Item::Number { least, most, .. } => format!("a number from {least} to {most}"),
        Item::Text { .. } => "one line".to_owned(),
    }
}

/// Parses a typed line; the error is a hint for the person.
fn typed(line: &str, screen: &Screen) -> Result<Input, String> {
    let line = line.trim();
    match (line, screen) {
        ("q", _) => return Ok(Input::Stop),
        (_, Screen::Item { item: Item::Text { .. }, .. }) => {
            return Ok(Input::Item(Value::Choice(line.replace('\t', " "))));
        }
        ("", _) => return Ok(Input::Continue),
        ("a", _) => return Ok(Input::Again),
        _ => {}
    }
    if let Some(text) = line.strip_prefix("n ") {
        return Ok(Input::Note(text.trim().to_owned()));
    }
    match screen {
        Screen::Ask { task, .. } => answer(line, &task.ask).map(Input::Answer),
        Screen::Confidence { scale } => point(line, scale).map(Input::Point),
        Screen::Item { item, .. } => item_answer(line, item).map(Input::Item),
        _ => Err("no question is open; Enter continues".to_owned()),
    }
}

fn answer(line: &str, ask: &Ask) -> Result<Answer, String> {
    let of = |known: &[(&str, Answer)]| {
        let found = known.iter().find(|(key, _)| *key == line).map(|(_, answer)| answer.clone());
        found.ok_or_else(|| format!("type {}", keys(ask)))
    };
    match ask {
        Ask::Choice { unsure: true } => {
            of(&[("1", Answer::First), ("2", Answer::Second), ("0", Answer::Unsure)])
        }
        Ask::Choice { unsure: false } => of(&[("1", Answer::First), ("2", Answer::Second)]),
        Ask::Detection { .. } => of(&[("1", Answer::Present), ("0", Answer::Absent)]),
        Ask::Rating { scale } => point(line, scale).map(Answer::Rating),
        Ask::Magnitude => match number(line)? {
            number if number > 0.0 => Ok(Answer::Magnitude(number)),
            _ => Err("write a number above 0".to_owned()),
        },
    }
}

fn item_answer(line: &str, item: &Item) -> Result<Value, String> {
    match item {
        Item::Scale { scale, .. } => point(line, scale).map(Value::Number),
        Item::Choice { options, .. } => {
            let index = line.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            let option = index.and_then(|index| options.get(index)).cloned();
            option.map(Value::Choice).ok_or_else(|| format!("type {}", item_keys(item)))
        }
        Item::Number { least, most, .. } => match number(line)? {
            number if (*least..=*most).contains(&number) => Ok(Value::Number(number)),
            _ => Err(format!("write {}", item_keys(item))),
        },
        Item::Text { .. } => Ok(Value::Choice(line.to_owned())),
    }
}

fn point(line: &str, scale: &AnswerScale) -> Result<f64, String> {
    let number = number(line)?;
    if scale.has(number) { Ok(number) } else { Err(format!("write a number from {}", points(scale))) }
}

fn number(line: &str) -> Result<f64, String> {
    let number = line.replace(',', ".").parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| format!("invalid number `{line}`; write a number such as 25"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(ask: Ask) -> Screen {
        let task = Task { ask, question: String::new(), confidence: None };
        Screen::Ask { task, again: Again::Unlimited }
    }

    fn scale(least: f64, most: f64, step: f64) -> AnswerScale {
        AnswerScale { least, most, step, low: "calm".to_owned(), high: String::new() }
    }

    #[test]
    fn keys_mean_answers() {
        let answer = |answer| Ok(Input::Answer(answer));
        let pair = ask(Ask::Choice { unsure: false });
        assert_eq!(typed("2", &pair), answer(Answer::Second));
        assert!(typed("0", &pair).is_err());
        assert_eq!(typed("0", &ask(Ask::Choice { unsure: true })), answer(Answer::Unsure));
        assert_eq!(typed("0", &ask(Ask::Detection { absent_share: 0.5 })), answer(Answer::Absent));
        assert_eq!(typed("7,5", &ask(Ask::Magnitude)), answer(Answer::Magnitude(7.5)));
        for wrong in ["-1", "0", "nan", "seven"] {
            assert!(typed(wrong, &ask(Ask::Magnitude)).is_err(), "{wrong}");
        }
        let rating = ask(Ask::Rating { scale: scale(0.0, 10.0, 5.0) });
        assert_eq!(typed("5", &rating), answer(Answer::Rating(5.0)));
        assert_eq!(typed("6", &rating).unwrap_err(), "write a number from 0 (calm) to 10 in steps of 5");
        for (line, input) in [("", Input::Continue), ("a", Input::Again), ("q", Input::Stop)] {
            assert_eq!(typed(line, &pair), Ok(input));
        }
        assert_eq!(typed("n 5 o'clock", &pair), Ok(Input::Note("5 o'clock".to_owned())));
    }

    #[test]
    fn items_take_points_words_numbers_and_text() {
        let (key, text) = ("key".to_owned(), "Text?".to_owned());
        let screen = |item| Screen::Item { title: String::new(), item, number: 1, of: 1 };
        let options = vec!["left".to_owned(), "right".to_owned()];
        let choice = screen(Item::Choice { key: key.clone(), text: text.clone(), options });
        let word = |word: &str| Ok(Input::Item(Value::Choice(word.to_owned())));
        assert_eq!(typed("2", &choice), word("right"));
        assert_eq!(typed("3", &choice).unwrap_err(), "type 1 left, 2 right");
        let number = screen(Item::Number { key: key.clone(), text: text.clone(), least: 18.0, most: 99.0 });
        assert_eq!(typed("20", &number), Ok(Input::Item(Value::Number(20.0))));
        assert!(typed("7", &number).is_err());
        let line = screen(Item::Text { key, text });
        // Everything but the stop is an answer, also no text.
        assert_eq!(typed("a", &line), word("a"));
        assert_eq!(typed("", &line), word(""));
        assert_eq!(typed("q", &line), Ok(Input::Stop));
    }
}
