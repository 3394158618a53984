//! A log survives what can happen to it, or is refused with line and reason.

use super::*;
use crate::conduct::{Ending, NoApparatus, conduct};
use crate::observer::{Population, SimulatedSubject};
use crate::protocol::JndProtocol;
use crate::sitting::Sitting;
use crate::trial::{Exploration, Response};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// A folder that goes away with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("flotor-study-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn file(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn begin() -> Begin {
    let mut jnd = JndProtocol { replications: 1, bases: vec![26.0], ..JndProtocol::default() };
    jnd.demo.shown = false;
    Begin {
        format: FORMAT,
        person: None,
        version: "0.0.0".to_owned(),
        subject: SubjectNumber::new(3).unwrap(),
        seed: 11,
        plan: None,
        protocol: Protocol::Jnd(jnd),
        observer: serde_json::Value::Null,
        apparatus: serde_json::Value::Null,
        inputs: Vec::new(),
    }
}

fn subject(begin: &Begin) -> SimulatedSubject {
    SimulatedSubject::new(&Population::default(), begin.seed, begin.subject, 30.0)
}

/// A whole sitting on disk.
fn sit(path: &Path) {
    let begin = begin();
    let mut sitting = Sitting::new(&begin.protocol, begin.seed, begin.subject);
    let subject = subject(&begin);
    let mut log = LogWriter::create(path).unwrap();
    log.write(&Event::Begin(Box::new(begin))).unwrap();
    let ending =
        conduct(&mut sitting, &mut log, &mut NoApparatus, &subject, &|| (), &AtomicBool::default()).unwrap();
    assert_eq!(ending, Ending::Complete);
}

#[test]
fn what_is_written_is_read() {
    let folder = Folder::new("round");
    let path = folder.file("log.jsonl");
    sit(&path);
    let log = SittingLog::read(&path).unwrap();
    assert!(log.complete);
    assert_eq!(log.begin, begin());
    assert!(log.trials.len() >= 8);
    assert_eq!(log.tracks().len(), 1);
    assert_eq!(log.trials.last().unwrap().track, log.tracks().first().copied());
    assert!(LogWriter::create(&path).is_err(), "an existing log is not overwritten");
}

#[test]
fn a_log_has_one_writer_at_a_time() {
    let folder = Folder::new("owner");
    let path = folder.file("log.jsonl");
    let is_in_use =
        |result: Result<(), LogError>| matches!(result, Err(LogError { problem: LogProblem::InUse, .. }));
    let mut first = LogWriter::create(&path).unwrap();
    assert!(is_in_use(LogWriter::create(&path).map(drop)), "before its first line too");
    first.write(&Event::Begin(Box::new(begin()))).unwrap();
    let read = || SittingLog::read(&path).unwrap();
    assert!(is_in_use(read().resume("0").map(drop)) && is_in_use(read().annotate("late")));
    assert!(is_in_use(LogWriter::check_free(&path)));
    let before = read();
    first.write(&Event::Note { text: "meanwhile".to_owned() }).unwrap();
    drop(first);
    LogWriter::check_free(&path).unwrap();
    let written = std::fs::read(&path).unwrap();
    assert!(is_in_use(before.resume("0").map(drop)), "a line has come since it was read");
    assert_eq!(std::fs::read(&path).unwrap(), written);
    read().resume("0").unwrap();
}

#[test]
fn a_file_without_a_complete_line_becomes_a_log() {
    let folder = Folder::new("half-a-line");
    let path = folder.file("log.jsonl");
    std::fs::write(&path, "{\"chain\":\"half a li").unwrap();
    LogWriter::create(&path).unwrap().write(&Event::Begin(Box::new(begin()))).unwrap();
    assert_eq!(SittingLog::read(&path).unwrap().begin, begin());
}

#[test]
fn line_ends_of_windows_change_nothing() {
    let folder = Folder::new("ends");
    let path = folder.file("log.jsonl");
    sit(&path);
    let before = SittingLog::read(&path).unwrap();
    std::fs::write(&path, std::fs::read_to_string(&path).unwrap().replace('\n', "\r\n")).unwrap();
    let after = SittingLog::read(&path).unwrap();
    assert_eq!((after.complete, after.trials), (true, before.trials));
    SittingLog::read(&path).unwrap().annotate("copied").unwrap();
    assert_eq!(SittingLog::read(&path).unwrap().notes.len(), before.notes.len() + 1);
}

#[test]
fn a_file_is_what_is_in_it() {
    let input = |used_as: &str, hash: &str| InputFile {
        used_as: used_as.to_owned(),
        name: "curve.csv".to_owned(),
        hash: hash.to_owned(),
    };
    let with = |inputs: Vec<InputFile>| Begin { inputs, ..begin() };
    let then = with(vec![input("spring", "a"), input("measured.curve", "b")]);
    assert_eq!(then.changed_input(&then), None);
    assert_eq!(then.changed_input(&begin()), None, "a log of an earlier revision has none");
    let now = with(vec![input("spring", "a"), input("measured.curve", "c")]);
    let (changed, before) = now.changed_input(&then).unwrap();
    assert_eq!((changed.used_as.as_str(), before.hash.as_str()), ("measured.curve", "b"));
    assert_eq!(now.differs(&then), None, "what differs is the content of a file");
}

/// Whatever rules a study file may have, the log that follows it is read again.
#[test]
fn every_rule_of_a_study_file_is_read_again() {
    let folder = Folder::new("rules");
    let path = folder.file("log.jsonl");
    let exclusion = ExclusionRules {
        most_false_alarms: Some(0.5),
        least_agreement: Some(0.0),
        most_retest_deviation: Some(f64::MAX),
        most_dont_know: Some(1.0),
        most_missed_ticks: Some(1.0e-300),
        least_movement_mm: Some(f64::MAX),
        response_time_s: Some([0.0, f64::MAX]),
        most_excluded_trials: Some(0.1),
        most_missed_obvious: Some(0.5),
        most_wrong_at_large: Some(0.2),
    };
    let plan = Plan { file: "a.study.toml".to_owned(), sha256: digest("a"), text: "a".to_owned(), exclusion };
    let begin = Begin { plan: Some(plan), ..begin() };
    LogWriter::create(&path).unwrap().write(&Event::Begin(Box::new(begin.clone()))).unwrap();
    assert_eq!(SittingLog::read(&path).unwrap().begin, begin);
}

/// Every single byte of the file matters: changed, it is refused, with the line it stands in or, for a line end, the
/// line whose text it spoils.
#[test]
fn every_changed_byte_is_found() {
    let folder = Folder::new("bytes");
    let path = folder.file("log.jsonl");
    sit(&path);
    let bytes = std::fs::read(&path).unwrap();
    let last = bytes.len() - 1; // without it the last line was never completed, which is legal
    let mut line = 1;
    for at in (0..last).step_by(7) {
        line += bytes[at.saturating_sub(7)..at].iter().filter(|byte| **byte == b'\n').count();
        let mut changed = bytes.clone();
        changed[at] = if changed[at] == b'7' { b'3' } else { b'7' };
        std::fs::write(&path, &changed).unwrap();
        let error = SittingLog::read(&path).err().unwrap_or_else(|| panic!("byte {at} was not missed"));
        assert_eq!(error.line, line, "byte {at}: {error}");
    }
}

#[test]
fn a_line_removed_or_exchanged_is_found() {
    let folder = Folder::new("lines");
    let path = folder.file("log.jsonl");
    sit(&path);
    let text = std::fs::read_to_string(&path).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    let refused = |lines: Vec<&str>| {
        std::fs::write(&path, lines.join("\n") + "\n").unwrap();
        SittingLog::read(&path).err().expect("refused")
    };
    let mut removed = lines.clone();
    removed.remove(4);
    let error = refused(removed);
    assert!(error.line == 5 && matches!(error.problem, LogProblem::Chain), "{error}");
    assert!(error.to_string().contains("log.jsonl:5: the hash chain is broken"), "{error}");
    let mut exchanged = lines.clone();
    exchanged.swap(3, 4);
    assert_eq!(refused(exchanged).line, 4);
    assert_eq!(refused(lines[1..].to_vec()).line, 1);
}

/// Somebody who rewrites the chain as well is caught by the experiment itself: the trials no longer follow from the
/// answers.
#[test]
fn a_forged_answer_is_found_by_replay() {
    let folder = Folder::new("forged");
    let path = folder.file("log.jsonl");
    sit(&path);
    let text = std::fs::read_to_string(&path).unwrap();
    let mut forged = String::new();
    let mut before = CHAIN_START.to_owned();
    let mut changed = false;
    for text in text.lines() {
        let (_, event) = parts(text).unwrap();
        let mut event: Event = serde_json::from_str(event).unwrap();
        if let Event::Trial(trial) = &mut event
            && !changed
        {
            let other = if trial.response == Response::First { Response::Second } else { Response::First };
            (trial.response, changed) = (other, true);
        }
        let event = serde_json::to_string(&event).unwrap();
        before = chain(&before, &event);
        forged += &(line(&before, &event) + "\n");
    }
    std::fs::write(&path, forged).unwrap();
    let error = SittingLog::read(&path).err().expect("refused");
    assert!(error.line == 2 && matches!(error.problem, LogProblem::Diverges { number: 1 }), "{error}");
}

/// Cut anywhere, the log has every trial whose line was complete, and going on from there gives the sitting that was
/// never interrupted.
#[test]
fn cut_anywhere_it_goes_on_as_if_nothing_had_happened() {
    let folder = Folder::new("cut");
    let path = folder.file("log.jsonl");
    sit(&path);
    let whole = std::fs::read(&path).unwrap();
    let uninterrupted = SittingLog::read(&path).unwrap().trials;
    let first_line = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
    for cut in (first_line..whole.len()).step_by(61) {
        std::fs::write(&path, &whole[..cut]).unwrap();
        let log = SittingLog::read(&path).unwrap();
        let complete_lines = whole[..cut].iter().filter(|byte| **byte == b'\n').count();
        assert_eq!(log.trials.len(), (complete_lines - 1).min(uninterrupted.len()));
        let subject = subject(&log.begin);
        if log.complete {
            continue;
        }
        let (mut sitting, mut writer) = log.resume("0.0.1").unwrap();
        conduct(&mut sitting, &mut writer, &mut NoApparatus, &subject, &|| (), &AtomicBool::default())
            .unwrap();
        drop(writer);
        let resumed = SittingLog::read(&path).unwrap();
        assert!(resumed.complete && resumed.resumed == 1);
        assert_eq!(resumed.trials, uninterrupted, "cut at byte {cut}");
    }
}

#[test]
fn an_empty_log_says_so() {
    let folder = Folder::new("empty");
    let path = folder.file("log.jsonl");
    for nothing in ["", "{\"chain\":\"12"] {
        std::fs::write(&path, nothing).unwrap();
        let error = SittingLog::read(&path).err().expect("refused");
        assert!(matches!(error.problem, LogProblem::Empty), "{error}");
    }
}

#[test]
fn notes_are_kept_with_their_place_and_change_nothing_else() {
    let folder = Folder::new("notes");
    let path = folder.file("log.jsonl");
    sit(&path);
    let before = SittingLog::read(&path).unwrap();
    let trials = before.trials.clone();
    before.annotate("asked for a break").unwrap();
    let after = SittingLog::read(&path).unwrap();
    assert!(after.complete);
    assert_eq!(after.trials, trials);
    let number = u32::try_from(trials.len()).unwrap();
    assert_eq!(after.notes, [(number, "asked for a break".to_owned())]);
}

/// Who resumes with other options is told which, and a changed study file is another study.
#[test]
fn a_sitting_of_another_study_says_where_it_differs() {
    let earlier = begin();
    let mut now = begin();
    let Protocol::Jnd(jnd) = &mut now.protocol else { unreachable!("it is one") };
    jnd.bases = vec![17.0, 26.0];
    let said = now.differs(&earlier).expect("another base");
    assert!(said.starts_with("begun with another protocol: "), "{said}");
    assert!(said.ends_with("bases [26.0], not [17.0,26.0]"), "{said}");
    let plan = |text: &str| {
        let (file, text, sha256) = ("a.study.toml".to_owned(), text.to_owned(), digest(text));
        Some(Plan { file, sha256, text, exclusion: ExclusionRules::default() })
    };
    let (one, other) = (Begin { plan: plan("a"), ..begin() }, Begin { plan: plan("b"), ..begin() });
    assert!(one.differs(&one.clone()).is_none());
    for (before, after, expected) in [
        ("a", "b", "from line 1 on: `a`, now `b`"),
        (
            "x\nbases = [17, 26]\ny",
            "x\nbases = [17]\ny",
            "from line 2 on: `bases = [17, 26]`, now `bases = [17]`",
        ),
        ("x\ny", "x\nseed = 2\ny", "from line 2 on: nothing, now `seed = 2`"),
        ("x\ny\nz", "x\nz", "from line 2 on: `y`, now nothing"),
        ("x\n  y\nz", "x\n  z\nz", "from line 2 on: `  y`, now `  z`"),
        ("x\n\n y", "x\nz\n y", "from line 2 on: nothing, now `z`"),
    ] {
        let (one, other) = (Begin { plan: plan(before), ..begin() }, Begin { plan: plan(after), ..begin() });
        let said = other.differs(&one).expect("another file");
        assert_eq!(said, format!("begun with another version of a.study.toml: {expected}"));
    }
    // How many people take part is no part of what they feel.
    for after in ["x\nsubjects = 4\ny", "x\n subjects=4 # pilot\ny"] {
        let (one, other) =
            (Begin { plan: plan("x\nsubjects = 3\ny"), ..begin() }, Begin { plan: plan(after), ..begin() });
        assert_eq!(other.differs(&one), None, "{after}");
    }
    for after in ["x\n y = 1\n", "x\n\ny = 1\n", "x\ny = 1", "x\ny=1\n", "x\ny = 1\r\n"] {
        let (one, other) =
            (Begin { plan: plan("x\ny = 1\n"), ..begin() }, Begin { plan: plan(after), ..begin() });
        let said = other.differs(&one).expect("another file");
        let line = if after.ends_with('1') { 3 } else { 2 };
        let expected =
            format!("another version of a.study.toml: from line {line} on, only blanks or line ends differ");
        assert_eq!(said, format!("begun with {expected}"), "{after:?}");
    }
    // Logs of early versions have the digest alone; another name is not another file.
    let mut early = one.clone();
    early.plan = plan("a").map(|plan| Plan { text: String::new(), file: "b.study.toml".to_owned(), ..plan });
    assert_eq!((one.differs(&early), early.differs(&one)), (None, None));
    assert_eq!(other.differs(&early), Some("begun with another version of a.study.toml".to_owned()));
    let said = begin().differs(&other).expect("none now");
    assert_eq!(said, "begun with the study file a.study.toml; now there is no study file");
    assert!(!serde_json::to_string(&begin()).unwrap().contains("plan"), "logs without one are as before");
}

/// An answer that was taken back is a line of its own, and the sitting goes on from the log as it would without both.
#[test]
fn an_answer_taken_back_is_told_and_counts_for_nothing() {
    let folder = Folder::new("withdrawn");
    let path = folder.file("log.jsonl");
    let begin = begin();
    let start = || Sitting::new(&begin.protocol, begin.seed, begin.subject);
    let answer = |sitting: &mut Sitting, response: Response| {
        let (trial, exploration) = (sitting.next().unwrap(), Exploration::default());
        let verdict = sitting.answer(response, &exploration).unwrap();
        Event::Trial(Box::new(TrialEvent { trial, response, verdict, exploration }))
    };
    // Trials of which every second answer is taken back, up to the one that ends the track.
    let (mut sitting, mut writer) = (start(), LogWriter::create(&path).unwrap());
    writer.write(&Event::Begin(Box::new(begin.clone()))).unwrap();
    let (mut withdrawn, mut count) = (0, 0_usize);
    while let Some(trial) = sitting.next() {
        if trial.number % 2 == 0 {
            writer.write(&answer(&mut sitting.clone(), Response::DontKnow)).unwrap();
            writer.write(&Event::Withdrawn { trial: trial.number }).unwrap();
            withdrawn += 1;
        }
        let response = if trial.number % 3 == 0 { Response::First } else { Response::Second };
        let event = answer(&mut sitting, response);
        writer.write(&event).unwrap();
        count += 1;
        let log = SittingLog::read(&path).unwrap();
        assert_eq!((log.trials.len(), log.withdrawn.len()), (count, withdrawn));
        assert_eq!(log.tracks(), sitting.results());
        let copy = folder.file("copy.jsonl");
        std::fs::copy(&path, &copy).unwrap();
        let (resumed, _) = SittingLog::read(&copy).unwrap().resume("0.0.0").unwrap();
        assert_eq!(resumed.next(), sitting.next(), "it goes on with the trial that is open");
    }
    drop(writer);
    let bytes = std::fs::read(&path).unwrap();
    let log = SittingLog::read(&path).unwrap();
    let last = log.trials.last().unwrap().event.trial.number;
    let with = |event: &Event| {
        std::fs::write(&path, &bytes).unwrap();
        SittingLog::read(&path).unwrap().resume("0.0.0").unwrap().1.write(event).unwrap();
        SittingLog::read(&path)
    };
    let twice = with(&Event::Withdrawn { trial: last }).unwrap();
    assert!(twice.is_answered_anew());
    for trial in [0, 1, last - 1, last + 1] {
        let error = with(&Event::Withdrawn { trial }).err().expect("refused");
        assert!(matches!(error.problem, LogProblem::Order(_)), "{trial}: {error}");
    }
}
