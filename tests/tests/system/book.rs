//! What the README and the book show is what the program does: their blocks run chapter by chapter, in order, in a folder of the
//! chapter's own with `flotor` on the path, and what the commands print is compared.
//!
//! | Block | What is done with it |
//! |---|---|
//! | `console` | each line `$ ...` runs; the lines after it, if any, must be all that it prints (`…`: any lines) |
//! | `text` | is all that the command before it prints |
//! | `toml` | a scene, or tables of one that the demo completes: runs on the virtual clock |
//! | `python` | is read by Python, and runs after the chapter's blocks before it where `FLOTOR_PYTHON` names one with the wheel |
//! | `formula`, `diagram` | nothing; `rust` is for doctests |
//!
//! A comment right before a block, invisible in the book, says what else holds for it:
//! - `<!-- test: skip, needs hardware: a GPU -->`: no test can run it; the reasons for commands are those of [`REASONS`];
//! - `<!-- test: full, takes a minute -->`: it runs with `FLOTOR_TEST_SIZE=full` only;
//! - `<!-- test: build, takes a minute -->`: likewise, in the root of the repository and the profile of these tests;
//! - `<!-- test: step NAME -->`: this step of `.ci/full` runs the commands, by itself or by these tests with `FLOTOR_BOOK_STEP=NAME`,
//!   which run the chapters with such blocks one after the other;
//! - `<!-- test: numbers, real clock -->`: they and digests differ from run to run, and only words are compared;
//! - `<!-- test: columns mean | p99, times -->`: in tables, the columns of these headings differ from run to run; all others and
//!   all other numbers are compared;
//! - `<!-- test: run COMMAND -->`: this has to happen first; a block of TOML after it is what the command prints;
//! - `<!-- test: file NAME -->`: it is that file, and the commands after it use it.

mod output;

use flotor_session::scene::DEMO;
use flotor_tests::library::build_folder;
use flotor_tests::program::Flotor;
use flotor_tests::scratch::Scratch;
use flotor_tests::tools::{Tool, required, skipped};
use flotor_tests::{TestSize, files_under, workspace_root};
use output::{Noisy, all_comparable, fits};
use rayon::prelude::*;
use std::fmt::Write;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Environment variable: a Python interpreter that has the wheel and its extras for tests.
const PYTHON: &str = "FLOTOR_PYTHON";
/// Environment variable: the step of `.ci/full` whose blocks run.
const STEP: &str = "FLOTOR_BOOK_STEP";
/// What chapters name by its place in the repository.
const REPOSITORY: [&str; 5] = ["devices", "hal", "host", "interop", "models"];

// ---------------------------------------------------------------- blocks

/// Reasons why no test runs a command.
const REASONS: [&str; 4] = [
    "needs hardware: ",
    "needs a person",
    "needs a second machine",
    "needs a program that no package index has: ",
];

/// Conditions under which blocks run.
#[derive(Clone, Debug)]
struct Conditions {
    size: TestSize,
    /// The step of `.ci/full` whose blocks run.
    step: Option<String>,
}

impl Conditions {
    fn of_this_run() -> Self {
        Self { size: TestSize::of_this_run(), step: std::env::var(STEP).ok() }
    }

    fn of_size(size: TestSize) -> Self {
        Self { size, step: None }
    }
}

/// What a comment before a block asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Mark {
    Skip(String),
    Full(String),
    Build(String),
    Step(String),
    Numbers,
    Columns(Vec<String>),
    Run(String),
    File(String),
}

impl Mark {
    /// The mark of a line, if it has one.
    fn of(line: &str) -> Result<Option<Self>, String> {
        let Some(said) = line.trim().strip_prefix("<!-- test:") else { return Ok(None) };
        let said = said.trim_end_matches("-->").trim();
        let (word, rest) = said.split_once(' ').unwrap_or((said, ""));
        let rest = rest.to_owned();
        match word {
            "skip," if rest.starts_with("needs ") => Ok(Some(Self::Skip(rest))),
            "full," if rest.starts_with("takes ") => Ok(Some(Self::Full(rest))),
            "build," if rest.starts_with("takes ") => Ok(Some(Self::Build(rest))),
            "step" if is_step(&rest) => Ok(Some(Self::Step(rest))),
            "numbers," if !rest.is_empty() => Ok(Some(Self::Numbers)),
            "columns" if rest.contains(", ") => {
                let headings = rest.split(", ").next().unwrap_or_default().split(" | ");
                Ok(Some(Self::Columns(headings.map(str::to_owned).collect())))
            }
            "run" if !rest.is_empty() => Ok(Some(Self::Run(rest))),
            "file" if !rest.is_empty() => Ok(Some(Self::File(rest))),
            _ => Err(format!(
                "`{said}`: a marker is `skip, needs ...`, `full, takes ...`, `build, takes ...`, `step NAME` of .ci/full, `numbers, WHY`, `columns A | B, WHY`, `run ...`, `file ...`"
            )),
        }
    }
}

/// Whether `.ci/full` has a step of this name.
fn is_step(name: &str) -> bool {
    let full = std::fs::read_to_string(workspace_root().join(".ci/full")).expect("it is there");
    full.lines()
        .any(|line| line.strip_prefix("step ").is_some_and(|step| step.split(' ').next() == Some(name)))
}

/// A folder in which a command runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// The folder of the chapter's own.
    Chapter,
    /// The root of the repository.
    Repository,
}

/// A fenced block of a chapter.
#[derive(Debug)]
struct Block {
    line: usize,
    language: String,
    marks: Vec<Mark>,
    text: String,
}

impl Block {
    /// Returns the reason why it does not run under these conditions.
    fn left_out(&self, conditions: &Conditions) -> Option<&str> {
        let is_of_step = self.is_of_step(conditions);
        self.marks.iter().find_map(|mark| match mark {
            Mark::Skip(why) => Some(why.as_str()),
            Mark::Step(_) if !is_of_step => Some("runs in a step of .ci/full"),
            Mark::Full(why) | Mark::Build(why) if !is_of_step && conditions.size < TestSize::Full => {
                Some(why)
            }
            _ => None,
        })
    }

    fn is_of_step(&self, conditions: &Conditions) -> bool {
        let is_step =
            |mark: &Mark| matches!(mark, Mark::Step(name) if Some(name) == conditions.step.as_ref());
        self.marks.iter().any(is_step)
    }

    /// Where its commands run.
    fn place(&self) -> Place {
        match self.marks.iter().any(|mark| matches!(mark, Mark::Build(_))) {
            true => Place::Repository,
            false => Place::Chapter,
        }
    }

    fn file(&self) -> Option<&str> {
        self.marks.iter().find_map(|mark| match mark {
            Mark::File(name) => Some(name.as_str()),
            _ => None,
        })
    }

    fn commands_before(&self) -> impl Iterator<Item = &str> {
        self.marks.iter().filter_map(|mark| match mark {
            Mark::Run(command) => Some(command.as_str()),
            _ => None,
        })
    }
}

/// The blocks of a chapter, in order.
fn blocks(markdown: &str) -> Result<Vec<Block>, String> {
    let (mut found, mut marks) = (Vec::new(), Vec::new());
    let mut lines = (1..).zip(markdown.lines());
    while let Some((line, text)) = lines.next() {
        if let Some(mark) = Mark::of(text).map_err(|error| format!("{line}: {error}"))? {
            marks.push(mark);
        } else if let Some(fence) = text.trim_start().strip_prefix("```") {
            let language = fence.split(',').next().unwrap_or_default().to_owned();
            let inside =
                lines.by_ref().map(|(_, text)| text).take_while(|text| !text.trim_start().starts_with("```"));
            let text = inside.flat_map(|text| [text, "\n"]).collect();
            found.push(Block { line, language, marks: std::mem::take(&mut marks), text });
        } else if !marks.is_empty() {
            return Err(format!("{line}: a comment `test:` stands right before a block"));
        }
    }
    Ok(found)
}

// ---------------------------------------------------------------- what a chapter does

/// A command, and what the chapter says it prints: nothing, if it does not say.
#[derive(Debug)]
struct Step {
    line: usize,
    command: String,
    shown: Vec<String>,
    noisy: Noisy,
    place: Place,
}

/// A chapter as a list of commands, and the files they are given, in a folder of their own.
struct Chapter {
    name: String,
    given: PathBuf,
    steps: Vec<Step>,
    python: String,
    left_out: Vec<String>,
}

impl Chapter {
    fn read(name: &str, markdown: &str, given: &Path, conditions: &Conditions) -> Result<Self, String> {
        let mut chapter = Self {
            name: name.to_owned(),
            given: given.to_owned(),
            steps: Vec::new(),
            python: String::new(),
            left_out: Vec::new(),
        };
        for block in blocks(markdown).map_err(|error| format!("{name}:{error}"))? {
            chapter.take(&block, conditions).map_err(|error| format!("{name}:{}: {error}", block.line))?;
        }
        Ok(chapter)
    }

    fn take(&mut self, block: &Block, conditions: &Conditions) -> Result<(), String> {
        let left_out = block.left_out(conditions);
        self.left_out.extend(left_out.map(|why| format!("{}:{}: {why}", self.name, block.line)));
        if block.language == "python" {
            return self.take_python(block, left_out.is_none());
        }
        if left_out.is_some() {
            return Ok(());
        }
        for command in block.commands_before() {
            self.step(block, command);
        }
        if let Some(name) = block.file() {
            let file = self.keep(block, "file", &block.text)?;
            self.step(block, &format!("cp '{file}' '{name}'"));
            return Ok(());
        }
        let printed_before = block.commands_before().next().is_some();
        match block.language.as_str() {
            "console" => self.take_commands(block),
            "text" => self.printed(block),
            "toml" if printed_before => self.printed(block),
            "toml" => self.take_toml(block),
            "formula" | "diagram" | "rust" => Ok(()),
            other => Err(format!("a block of `{other}`: what is a test to do with it?")),
        }
    }

    fn step(&mut self, block: &Block, command: &str) {
        let noisy = block.marks.iter().find_map(|mark| match mark {
            Mark::Numbers => Some(Noisy::Numbers),
            Mark::Columns(headings) => Some(Noisy::Columns(headings.clone())),
            _ => None,
        });
        self.steps.push(Step {
            line: block.line,
            command: command.to_owned(),
            shown: Vec::new(),
            noisy: noisy.unwrap_or(Noisy::Times),
            place: block.place(),
        });
    }

    /// Keeps a text for a command and returns its place.
    fn keep(&self, block: &Block, extension: &str, text: &str) -> Result<String, String> {
        let file = self.given.join(format!("{}.{extension}", block.line));
        std::fs::write(&file, text).map_err(|error| error.to_string())?;
        Ok(file.display().to_string())
    }

    fn take_commands(&mut self, block: &Block) -> Result<(), String> {
        if !block.text.starts_with("$ ") {
            return Err("it begins with no command `$ ...`".to_owned());
        }
        for text in block.text.lines() {
            if let Some(command) = text.strip_prefix("$ ") {
                self.step(block, command);
            } else if let Some(step) = self.steps.last_mut() {
                match text.strip_prefix("> ") {
                    // A shell removes the backslash and the line end.
                    Some(rest) if step.command.ends_with('\\') => {
                        step.command.pop();
                        step.command.push_str(rest);
                    }
                    _ => step.shown.push(text.to_owned()),
                }
            }
        }
        Ok(())
    }

    fn printed(&mut self, block: &Block) -> Result<(), String> {
        let step = self.steps.last_mut().ok_or("no command before it prints it")?;
        if !step.shown.is_empty() {
            return Err("what the command before it prints is already shown".to_owned());
        }
        step.line = block.line;
        step.shown = block.text.lines().map(str::to_owned).collect();
        Ok(())
    }

    fn take_toml(&mut self, block: &Block) -> Result<(), String> {
        let included = block.text.trim().strip_prefix("{{#include ").and_then(|rest| rest.strip_suffix("}}"));
        let scene = match included {
            // As in mdBook, from the folder of the chapter.
            Some(path) => workspace_root().join(&self.name).with_file_name(path).display().to_string(),
            None => self.keep(block, "toml", &whole_scene(&block.text)?)?,
        };
        self.step(block, &format!("flotor run '{scene}' --clock virtual --duration 5s"));
        Ok(())
    }

    fn take_python(&mut self, block: &Block, runs: bool) -> Result<(), String> {
        let file = self.keep(block, "py", &block.text)?;
        self.step(block, &format!("python3 -c \"compile(open('{file}').read(), '{file}', 'exec')\""));
        let Some(python) = std::env::var_os(PYTHON).filter(|_| runs) else { return Ok(()) };
        for command in block.commands_before() {
            self.step(block, command);
        }
        // It goes on where the chapter's block before it ended.
        self.python.push_str(&block.text);
        let file = self.keep(block, "all.py", &self.python)?;
        self.step(block, &format!("'{}' '{file}'", python.display()));
        Ok(())
    }

    /// The commands as a script that leaves what each prints, and its exit code, beside the given files.
    fn script(&self, folder: &Path) -> String {
        let mut script = format!(
            "trap 'kill $(jobs -p) 2>/dev/null' EXIT\nunset CARGO_TARGET_DIR\ncd '{}'\n",
            folder.display()
        );
        for (number, step) in self.steps.iter().enumerate() {
            let (said, code) = (self.said(number), self.code(number));
            if step.place == Place::Repository {
                script.push_str("cd \"$REPOSITORY\"; export CARGO_TARGET_DIR=$REPOSITORY/target\n");
            }
            let _ = write!(
                script,
                "{{ {}\n}} >'{}' 2>&1 </dev/null\necho $? >'{}'\n",
                step.in_profile(),
                said.display(),
                code.display()
            );
            if step.place == Place::Repository {
                let _ = writeln!(script, "cd '{}'; unset CARGO_TARGET_DIR", folder.display());
            }
            if step.command.split(" #").next().is_some_and(|command| command.trim_end().ends_with('&')) {
                // In the background: it is there when it says so.
                let said = said.display();
                let _ =
                    writeln!(script, "for i in $(seq 200); do [ -s '{said}' ] && break; sleep 0.05; done");
            }
        }
        script
    }

    fn said(&self, number: usize) -> PathBuf {
        self.given.join(format!("{number}.said"))
    }

    fn code(&self, number: usize) -> PathBuf {
        self.given.join(format!("{number}.code"))
    }

    /// Runs the commands and says what the chapter has wrong.
    fn run(&self) -> Vec<String> {
        let scratch = Scratch::default();
        for part in REPOSITORY {
            symlink(workspace_root().join(part), scratch.path().join(part))
                .expect("an empty folder takes links");
        }
        // Emulators listen at fixed ports: those of one chapter at a time.
        static EMULATORS: Mutex<()> = Mutex::new(());
        let emulates = self.steps.iter().any(|step| step.command.starts_with("flotor emulate"));
        let _turn = emulates.then(|| EMULATORS.lock().unwrap_or_else(PoisonError::into_inner));
        let script = self.given.join("script");
        std::fs::write(&script, self.script(scratch.path())).expect("a scratch folder can be written to");
        // A reader sets no size: with that of these tests, the README's `cargo test` would take hours.
        let ran = Flotor::with([&script])
            .through_shell("unset FLOTOR_TEST_SIZE; PATH=\"${1%/*}:$PATH\" exec bash \"$2\"")
            .env("XDG_RUNTIME_DIR", &self.given.display().to_string())
            .env("CARGO_NET_OFFLINE", "true")
            .env("CARGO_TERM_QUIET", "true")
            .env("REPOSITORY", &workspace_root().display().to_string())
            .run();
        assert_eq!((ran.stdout.as_str(), ran.stderr.as_str()), ("", ""), "{}: {ran:?}", self.name);
        let wrong = self.steps.iter().enumerate().filter_map(|(number, step)| {
            let said = std::fs::read(self.said(number)).unwrap_or_default();
            let code = std::fs::read_to_string(self.code(number)).unwrap_or_default();
            let wrong = step.wrong(&String::from_utf8_lossy(&said), code.trim())?;
            Some(format!("{}:{}: $ {}\n{wrong}", self.name, step.line, step.command))
        });
        wrong.collect()
    }
}

/// A scene with what these tables of one lack, taken from the demo.
fn whole_scene(text: &str) -> Result<String, String> {
    let shown: toml::Table = text.parse().map_err(|error| format!("{error}"))?;
    let mut scene: toml::Table = DEMO.parse().map_err(|error| format!("{error}"))?;
    scene.extend(shown);
    Ok(scene.to_string())
}

// ---------------------------------------------------------------- what a command prints

impl Step {
    /// The command; one that builds the repository does so in the profile of these tests.
    fn in_profile(&self) -> String {
        let is_debug = build_folder().ends_with("debug");
        match self.place {
            Place::Repository if is_debug => {
                let debug = self.command.replace(" --release", "").replace("target/release", "target/debug");
                debug.replace("cargo install", "cargo install --debug")
            }
            _ => self.command.clone(),
        }
    }

    /// What the chapter says that does not hold of this output and exit code.
    fn wrong(&self, said: &str, code: &str) -> Option<String> {
        let refused = self.shown.iter().any(|line| line.starts_with("error: "));
        if refused == (code == "0") {
            return Some(format!("exit code {code}:\n{said}"));
        }
        let shown = all_comparable(self.shown.iter().map(String::as_str), &self.noisy);
        let printed = all_comparable(said.trim_end().lines(), &self.noisy);
        let end = shown.iter().rposition(|line| !line.is_empty()).map_or(0, |last| last + 1);
        if end == 0 || fits(&shown[..end], &printed) {
            return None;
        }
        let missing = shown.iter().filter(|line| *line != "…" && !printed.contains(line));
        let missing: String = missing.map(|line| format!("  not printed: {line}\n")).collect();
        Some(format!("{missing}it prints:\n{said}"))
    }
}

// ---------------------------------------------------------------- tests

/// The README and the chapters that people write.
fn chapters() -> Vec<String> {
    let book = files_under("docs/src", "md").expect("the book has chapters");
    let written = book.iter().map(|file| file.display().to_string());
    let written = written.filter(|file| !file.contains("/adr/") && !file.contains("/reference/"));
    std::iter::once("README.md".to_owned()).chain(written).collect()
}

/// The chapters with something to do under these conditions, with their texts.
fn chapters_under(conditions: &Conditions) -> Vec<(String, String)> {
    let chapters = chapters().into_iter().map(|name| {
        let text = std::fs::read_to_string(workspace_root().join(&name)).expect("a chapter is text");
        (name, text)
    });
    let is_of_step =
        |text: &str| blocks(text).is_ok_and(|blocks| blocks.iter().any(|block| block.is_of_step(conditions)));
    chapters.filter(|(_, text)| conditions.step.is_none() || is_of_step(text)).collect()
}

#[test]
fn every_block_of_the_book_does_what_the_book_says() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    if !required(Tool::Python) {
        return;
    }
    let conditions = Conditions::of_this_run();
    let chapters = chapters_under(&conditions);
    assert!(!chapters.is_empty(), "no block is of the step {:?}", conditions.step);
    // The blocks of a step may need the machine for themselves; 0: as many threads as there are cores.
    let threads = usize::from(conditions.step.is_some());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("there are threads");
    let done: Vec<(usize, Vec<String>, Vec<String>)> = pool.install(|| {
        let ran = chapters.into_par_iter().map(|(name, text)| {
            let given = Scratch::default();
            match Chapter::read(&name, &text, given.path(), &conditions) {
                Ok(chapter) => (chapter.steps.len(), chapter.run(), chapter.left_out),
                Err(error) => (0, vec![error], Vec::new()),
            }
        });
        ran.collect()
    });
    let commands: usize = done.iter().map(|(commands, ..)| commands).sum();
    let left_out: Vec<&String> = done.iter().flat_map(|(.., left_out)| left_out).collect();
    for line in &left_out {
        println!("{line}");
    }
    let is_of_full = |line: &&&String| line.contains(": takes ") || line.contains(": runs in ");
    let (full, never): (Vec<&String>, Vec<&String>) = left_out.iter().partition(is_of_full);
    skipped(&format!(
        "{commands} commands of the book ran; {} blocks run in .ci/full only, and no test can run {}",
        full.len(),
        never.len()
    ));
    let wrong: Vec<&str> = done.iter().flat_map(|(_, wrong, _)| wrong).map(String::as_str).collect();
    assert!(wrong.is_empty(), "{} places of the book are wrong:\n{}", wrong.len(), wrong.join("\n"));
}

#[test]
fn commands_that_no_test_runs_have_one_of_four_reasons() {
    let mut others = Vec::new();
    for name in chapters() {
        let text = std::fs::read_to_string(workspace_root().join(&name)).expect("a chapter is text");
        let blocks = blocks(&text).unwrap_or_else(|error| panic!("{name}:{error}"));
        let reasons = blocks.iter().filter(|block| block.language == "console").flat_map(|block| {
            let skips = block.marks.iter().filter_map(|mark| match mark {
                Mark::Skip(why) => Some(why),
                _ => None,
            });
            skips.map(|why| (block.line, why))
        });
        let other = reasons.filter(|(_, why)| REASONS.iter().all(|reason| !why.starts_with(reason)));
        others.extend(other.map(|(line, why)| format!("{name}:{line}: {why}")));
    }
    assert_eq!(others, Vec::<String>::new());
}

/// The chapter on experiments goes from nothing to the analysis of a pilot: its commands, in its order, in one folder.
#[test]
fn the_chapter_on_experiments_leads_to_the_analysis_of_a_pilot() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let name = "docs/src/experiments.md";
    let text = std::fs::read_to_string(workspace_root().join(name)).expect("a chapter is text");
    let given = Scratch::default();
    let chapter = Chapter::read(name, &text, given.path(), &Conditions::of_size(TestSize::Daily))
        .expect("a chapter of blocks");
    let place = |command: &str| {
        let found = chapter.steps.iter().position(|step| step.command.contains(command));
        found.unwrap_or_else(|| panic!("`{command}` does not run: {:?}", chapter.steps))
    };
    let way = [
        "weber.study.toml'",
        "study run weber.study.toml",
        "study note pilot",
        "analyse pilot --each",
        "--trials",
    ];
    assert!(way.map(place).is_sorted(), "{:?}", chapter.steps);
    assert_eq!(chapter.run(), Vec::<String>::new());
    let said =
        |command: &str| std::fs::read_to_string(chapter.said(place(command))).expect("it printed something");
    assert!(said("analyse pilot --each").contains("threshold"), "{}", said("analyse pilot --each"));
    assert!(said("--trials").contains("vision + haptics"), "{}", said("--trials"));
}

/// What is wrong with a chapter.
fn wrong_with(markdown: &str) -> Vec<String> {
    let given = Scratch::default();
    match Chapter::read("chapter", markdown, given.path(), &Conditions::of_size(TestSize::Quick)) {
        Ok(chapter) => chapter.run(),
        Err(error) => vec![error],
    }
}

#[test]
fn a_wrong_line_of_a_chapter_is_found() {
    let right = "```console\n$ cd ..; cd $OLDPWD; x=3\n$ printf 'ran  %s s\\n4 N\\n' $x\nran 5 s\n4 N\n```\n";
    assert_eq!(wrong_with(right), Vec::<String>::new());
    for (from, to) in [
        ("\n4 N", "\n5 N"),
        ("\nran", "\nrun"),
        ("\n4 N", ""),
        ("4 N\n", "4 N\nmore\n"),
        ("x=3", "x=3; false"),
    ] {
        let wrong = wrong_with(&right.replacen(from, to, 2));
        assert_eq!(wrong.len(), 1, "`{from}` is `{to}`: {wrong:?}");
    }
    let refused = "```console\n$ flotor run --no-such-option\n```\n";
    assert!(wrong_with(refused)[0].contains("exit code 2"), "a failure must be shown");
    assert_eq!(
        wrong_with("<!-- test: run echo a; echo b; echo c -->\n```text\n…\nc\n```\n"),
        Vec::<String>::new()
    );
    assert!(!wrong_with("<!-- test: run echo a; echo b; echo c -->\n```text\n…\nb\n```\n").is_empty());
    assert!(!wrong_with("```toml\n[limits]\nforce = 3\n```\n").is_empty(), "no such key");
    assert!(!wrong_with("```python\nprint(\n```\n").is_empty(), "no Python");
}

#[test]
fn a_command_may_go_on_in_the_next_line() {
    let right = "```console\n$ echo 1 \\\n>   2\n1 2\n```\n";
    assert_eq!(wrong_with(right), Vec::<String>::new());
    assert_eq!(wrong_with(&right.replace(" \\", "")).len(), 1, "without the backslash it is an output");
}

#[test]
fn blocks_of_a_step_run_in_that_step_only() {
    let markdown = "<!-- test: step book -->\n<!-- test: build, takes a build -->\n```console\n$ true\n```\n";
    let step = |name: &str| Conditions { size: TestSize::Daily, step: Some(name.to_owned()) };
    for (conditions, runs) in
        [(Conditions::of_size(TestSize::Full), false), (step("full"), false), (step("book"), true)]
    {
        let given = Scratch::default();
        let chapter = Chapter::read("chapter", markdown, given.path(), &conditions).expect("a chapter");
        assert_eq!((chapter.steps.len(), chapter.left_out.len()), (usize::from(runs), usize::from(!runs)));
        assert!(chapter.steps.iter().all(|step| step.place == Place::Repository));
    }
}

#[test]
fn a_comment_that_means_nothing_is_refused() {
    let block = "```console\n$ false\n```\n";
    for mark in [
        "skip",
        "skip, later",
        "full, needs a GPU",
        "step painting",
        "build, needs a GPU",
        "skipped, needs a GPU",
        "numbers,",
        "columns",
        "columns a | b",
        "run",
        "file",
    ] {
        assert!(blocks(&format!("<!-- test: {mark} -->\n{block}")).is_err(), "{mark}");
    }
    assert!(
        blocks(&format!("<!-- test: skip, needs a GPU -->\n\n{block}")).is_err(),
        "it belongs to no block"
    );
    assert_eq!(wrong_with(&format!("<!-- test: skip, needs a GPU -->\n{block}")), Vec::<String>::new());
    assert!(!wrong_with("```fortran\n```\n").is_empty());
}
