//! A real window that stands still in the middle of a drag, and one that somebody clicks at without looking: what the loop applies stays
//! where the hand went, and within the soft range.
//!
//! The window needs `Xvfb`, `xdotool` and a software adapter. Where they are missing, the tests say so and pass, unless
//! `FLOTOR_REQUIRE=display`.

mod support;

use egui::Rect;
use flotor_live::{
    Ask, ChangeMessage, Client, Directory, EndKind, Event, Greeting, LiveError, Outcome, Subject,
};
use rustix::process::{Pid, Signal, kill_process};
use std::io::Write;
use std::process::{Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use support::PATIENCE;
use support::display::{Display, SIZE, alone, patient_scene, patiently, place_of_slider};
use support::process::Owned;
use support::tools::{Tool, required};

/// Every point of the drag and ten thousand events take minutes where the pictures are drawn by software.
fn is_full() -> bool {
    std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full")
}

/// A window that a processor draws takes all of it: one at a time.
static ONE_WINDOW: Mutex<()> = Mutex::new(());

/// A run, a window on it, and somebody who listens to the loop.
struct Bench {
    _alone: MutexGuard<'static, ()>,
    _run: Owned,
    window: Owned,
    display: Display,
    greeting: Greeting,
    /// All that the loop says but its ticks, read at once by a thread: the host drops what a client leaves unread for long.
    events: Receiver<Result<Event, LiveError>>,
    /// Where the slider of gamma is, as seen with an interface without a display.
    slider: Rect,
    _folder: tempfile::TempDir,
}

impl Bench {
    fn begin() -> Option<Self> {
        if !required(Tool::Display) {
            return None;
        }
        let one = ONE_WINDOW.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = tempfile::tempdir().expect("a scratch folder");
        let mut run = alone("flotor", folder.path(), None);
        run.arg("run").arg(patient_scene(folder.path(), "demo")).args([
            "--duration",
            "30min",
            "--rate",
            "500",
        ]);
        let run = Owned::start(run.stderr(Stdio::null()).stdout(Stdio::null()));
        let directory = Directory::at(folder.path().join("flotor"));
        let mut client = patiently("the run is found", || Client::find(&directory).ok());
        client.request_client().ask(Ask::Watch { every: 100 }).expect("the host listens");
        let greeting = client.greeting().clone();
        let (sender, events) = channel();
        std::thread::spawn(move || {
            loop {
                let event = client.next(Duration::from_secs(1)).transpose();
                let Some(event) = event.filter(|event| !matches!(event, Ok(Event::Ticks { .. }))) else {
                    continue;
                };
                let is_over = event.is_err();
                if sender.send(event).is_err() || is_over {
                    return;
                }
            }
        });
        let slider = place_of_slider(&directory, "gamma");
        let display = Display::start(folder.path());
        let mut window = alone("flotor-viewer", folder.path(), Some(&display));
        // What is exported by chance goes into the scratch folder.
        window.current_dir(folder.path()).args(["--size", &format!("{}x{}", SIZE[0], SIZE[1])]);
        let window = Owned::start(window.stderr(Stdio::null()));
        let bench =
            Self { _alone: one, _run: run, window, display, greeting, events, slider, _folder: folder };
        patiently("the window opens", || {
            bench.mouse("search --onlyvisible --name Flotor windowfocus\n").then_some(())
        });
        Some(bench)
    }

    /// Runs lines of xdotool.
    fn mouse(&self, script: &str) -> bool {
        let mut command = Command::new("xdotool");
        command.arg("-").env("DISPLAY", &self.display.name).stdin(Stdio::piped());
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("xdotool runs");
        let written = child.stdin.take().expect("a pipe was requested").write_all(script.as_bytes());
        child.wait().expect("it ends").success() && written.is_ok()
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_child(&self.window), signal).expect("it is ours");
    }

    /// What the loop said of changes until nothing has changed for a while, or the end of the run.
    fn applied(&self, quiet: Duration) -> Vec<ChangeMessage> {
        let mut changes = Vec::new();
        while let Ok(event) = self.events.recv_timeout(quiet) {
            match event {
                Ok(Event::Change(change)) => changes.push(change),
                Ok(_) => {}
                Err(error) => panic!("the run went without a word: {error}"),
            }
        }
        changes
    }

    /// The same, once a value has come: a busy machine makes a picture late.
    fn applied_up_to(&self, value: f64, quiet: Duration) -> Vec<ChangeMessage> {
        let (mut changes, until) = (Vec::new(), Instant::now() + PATIENCE);
        let is_there = |change: &ChangeMessage| (change.number / value - 1.0).abs() < 0.001;
        while Instant::now() < until && !changes.last().is_some_and(is_there) {
            changes.extend(self.applied(Duration::from_millis(100)));
        }
        changes.extend(self.applied(quiet));
        changes
    }

    /// A point of the slider, as part of its width.
    fn at(&self, part: f32) -> String {
        let (x, y) = (self.slider.left() + part * self.slider.width(), self.slider.center().y);
        format!("mousemove {x:.0} {y:.0}\n")
    }
}

/// Frozen before, at and after every point of a drag, and woken when the pointer is far away: the applied value is never outside the
/// drag's own positions, and ends where the button was let go.
#[test]
fn a_window_frozen_at_any_point_of_a_drag_applies_nothing_outside_it() {
    const PARTS: [f32; 6] = [0.40, 0.44, 0.48, 0.52, 0.56, 0.60];
    let Some(bench) = Bench::begin() else { return };
    let quiet = Duration::from_millis(1500);
    let last = |changes: &[ChangeMessage]| changes.last().map(|change| change.number);
    let click = |bench: &Bench, part: f32| {
        bench.mouse(&(bench.at(part) + "sleep 0.3\nmousedown 1\nsleep 0.3\nmouseup 1\nsleep 0.3\n"))
    };
    // Where the ends of the drag are, as numbers: clicked without any freeze, until a click changes nothing any more. A busy machine
    // answers late.
    let mut ends = [0.0; 2];
    for (end, part) in ends.iter_mut().zip([PARTS[0], PARTS[5]]) {
        let mut seen = None;
        *end = patiently("a click on the slider is applied", || {
            click(&bench, part);
            let change = last(&bench.applied(quiet));
            seen = change.or(seen);
            if change.is_some() { None } else { seen }
        });
    }
    let [low, high] = ends;
    assert!(low < high, "{ends:?}");
    let points: Vec<usize> = if is_full() { (0..=6).collect() } else { vec![0, 3, 6] };
    for frozen in points {
        click(&bench, PARTS[0]);
        bench.applied_up_to(low, quiet);
        let step = |k: usize| {
            let at = bench.at(PARTS[k]);
            if k == 0 { at + "sleep 0.2\nmousedown 1\nsleep 0.1\n" } else { at + "sleep 0.1\n" }
        };
        for k in 0..frozen {
            assert!(bench.mouse(&step(k)));
        }
        bench.signal(Signal::STOP);
        let rest: String = (frozen..6).map(step).collect();
        // Far to the right of the slider, and to the left of it: both ends of the range.
        let away = if frozen % 2 == 0 { "mousemove 1270 500\n" } else { "mousemove 700 500\n" };
        assert!(bench.mouse(&(rest + "mouseup 1\nsleep 0.2\n" + away)));
        std::thread::sleep(Duration::from_millis(300));
        bench.signal(Signal::CONT);
        let changes = bench.applied_up_to(high, quiet);
        for change in &changes {
            assert_eq!(change.outcome, Outcome::Applied, "{change:?}");
            let is_inside = (low * 0.999..=high * 1.001).contains(&change.number);
            assert!(is_inside, "frozen after {frozen} points: {} outside {low} to {high}", change.number);
        }
        let end = last(&changes).expect("the drag is applied");
        assert!((end / high - 1.0).abs() < 0.001, "frozen after {frozen} points: {end}, not {high}");
    }
}

/// Clicks, drags, wheel and keys at random, all over the window but at the bar with the emergency stop: no parameter leaves its soft
/// range, the window lives, and the stop ends the run.
#[test]
fn whatever_is_clicked_no_parameter_leaves_its_soft_range_and_the_stop_works() {
    let Some(mut bench) = Bench::begin() else { return };
    let soft: Vec<(String, String, f64, f64)> = bench
        .greeting
        .plugins
        .iter()
        .flat_map(|plugin| {
            plugin.parameters.iter().filter_map(|parameter| {
                let soft = parameter.soft?;
                Some((plugin.name.clone(), parameter.id.clone(), soft.min, soft.max))
            })
        })
        .collect();
    assert!(soft.iter().any(|(_, id, ..)| id == "gamma_n"), "{soft:?}");
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = |below: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state % below
    };
    // No digit, sign or space: a number that is typed may leave the soft range, and the space bar is the stop.
    const KEYS: [&str; 16] = [
        "a", "d", "w", "s", "r", "f", "u", "p", "l", "m", "Left", "Right", "Home", "End", "Escape", "ctrl+z",
    ];
    let (batches, events) = if is_full() { (20, 500) } else { (2, 250) };
    let (mut seen, mut done) = (0, 0);
    // A busy machine may draw its first picture after all of them.
    while done < batches || (seen == 0 && done < 10 * batches) {
        done += 1;
        let mut script = String::new();
        for _ in 0..events {
            let x = random(u64::from(SIZE[0]));
            // Half of the time where the sliders are.
            let (x, y) =
                if random(2) == 0 { (980 + x % 300, 60 + random(700)) } else { (x, 60 + random(735)) };
            let button = 1 + random(3);
            script += &match random(10) {
                0..=3 => format!("mousemove {x} {y}\n"),
                4 | 5 => format!("mousemove {x} {y}\nclick {button}\n"),
                6 => format!("mousedown {button}\nmousemove {x} {y}\n"),
                7 => "mouseup 1\nmouseup 2\nmouseup 3\n".to_owned(),
                8 => format!("mousemove {x} {y}\nclick {}\n", 4 + random(2)),
                _ => format!("key {}\n", KEYS[usize::try_from(random(16)).expect("a few")]),
            };
        }
        script += "mouseup 1\nmouseup 2\nmouseup 3\n";
        assert!(bench.mouse(&script));
        for change in bench.applied(Duration::from_millis(500)) {
            // A number that follows from others is refused, which is in order.
            if change.subject != Subject::Parameter || change.outcome != Outcome::Applied {
                continue;
            }
            let of = |(plugin, id, ..): &&(String, String, f64, f64)| {
                *plugin == change.plugin && *id == change.parameter
            };
            if let Some((_, _, min, max)) = soft.iter().find(of) {
                seen += 1;
                let is_inside = (min * (1.0 - 1e-9)..=max * (1.0 + 1e-9)).contains(&change.number);
                assert!(is_inside, "{}: {} outside {min} to {max}", change.parameter, change.number);
            }
        }
        assert!(bench.window.try_wait().expect("it is ours").is_none(), "the window is gone");
    }
    eprintln!("{} events, {seen} changes of parameters", done * events);
    assert!(seen > 0, "nothing was changed");
    assert!(bench.mouse("key Escape\nkey space\n"));
    let until = Instant::now() + 3 * PATIENCE;
    let end = loop {
        assert!(Instant::now() < until, "the emergency stop does not work");
        match bench.events.recv_timeout(Duration::from_millis(100)) {
            Ok(Ok(Event::End(end))) => break end,
            Ok(Err(error)) => panic!("the run went without a word: {error}"),
            _ => {}
        }
    };
    assert_ne!(end.kind, EndKind::InOrder, "{end:?}");
    assert!(end.words.contains("emergency stop"), "{end:?}");
}
