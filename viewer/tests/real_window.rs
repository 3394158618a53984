//! The program itself: in a real window on a virtual display, a slider is pulled with the mouse and the servo's parameter
//! follows; without a display, one line and the right exit code.
//!
//! The window needs `Xvfb`, `xdotool` and a software adapter (`libgl1-mesa-dri` with `libegl1`, or `mesa-vulkan-drivers`).
//! Where they are missing, the test says so and passes, unless `FLOTOR_REQUIRE=display`.

mod support;

use flotor_live::{Ask, Client, Directory, Event};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use support::PATIENCE;
use support::display::{Display, SIZE, alone, patient_scene, patiently, place_of_slider};
use support::process::Owned;
use support::tools::{Tool, required};

/// A recording of two seconds of the demo.
fn recording(folder: &Path) -> PathBuf {
    let file = folder.join("run.mcap");
    let mut run = alone("flotor", folder, None);
    run.args(["run", "--clock", "virtual", "--duration", "2s", "--record"]).arg(&file);
    let output = run.output().expect("it starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    file
}

fn view(folder: &Path, display: Option<&Display>) -> Command {
    let mut view = alone("flotor", folder, display);
    view.arg("view");
    view
}

/// As on a machine without a driver: neither Vulkan nor OpenGL finds any.
fn without_drivers(view: &mut Command, empty: &Path) {
    let nothing = empty.join("nothing.json");
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES", "__EGL_VENDOR_LIBRARY_FILENAMES"] {
        view.env(variable, &nothing);
    }
}

#[test]
fn a_slider_pulled_in_a_real_window_changes_the_servos_parameter() {
    if !required(Tool::Display) {
        return;
    }
    let folder = tempfile::tempdir().expect("a scratch folder");
    let mut run = alone("flotor", folder.path(), None);
    run.arg("run")
        .arg(patient_scene(folder.path(), "demo"))
        .args(["--duration", "10min", "--rate", "500"])
        .stderr(Stdio::null())
        .stdout(Stdio::null());
    let _run = Owned::start(&mut run);
    let directory = Directory::at(folder.path().join("flotor"));
    let mut client = patiently("the run is found", || Client::find(&directory).ok());
    let slider = place_of_slider(&directory, "gamma");

    let display = Display::start(folder.path());
    let mut window = alone("flotor-viewer", folder.path(), Some(&display));
    window.args(["--size", &format!("{}x{}", SIZE[0], SIZE[1])]);
    let said = folder.path().join("said");
    let into = File::create(&said).expect("a scratch folder can be written to");
    let mut window = Owned::start(window.stderr(into));
    let xdotool = |arguments: &[&str]| {
        let output = Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &display.name)
            .output()
            .expect("xdotool runs");
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    patiently("the window opens", || {
        let ended = window.try_wait().expect("it is ours");
        assert!(ended.is_none(), "{ended:?}: {}", std::fs::read_to_string(&said).unwrap_or_default());
        xdotool(&["search", "--onlyvisible", "--name", "Flotor"])
    });

    client.request_client().ask(Ask::Watch { every: 100 }).expect("the host listens");
    let (y, from, to) =
        (slider.center().y, slider.left() + 0.3 * slider.width(), slider.left() + 0.7 * slider.width());
    let changes = patiently("further right is stiffer", || {
        // Pulled again until the window, which may still be starting, has seen it.
        let [y, from, to] = [y, from, to].map(|at| format!("{at:.0}"));
        xdotool(&["mousemove", &from, &y, "sleep", "0.2", "mousedown", "1", "sleep", "0.2"]);
        xdotool(&["mousemove", &to, &y, "sleep", "0.2", "mouseup", "1"]);
        let (mut changes, until) = (Vec::new(), Instant::now() + Duration::from_secs(2));
        while Instant::now() < until {
            if let Ok(Some(Event::Change(change))) = client.next(Duration::from_millis(100)) {
                changes.push(change);
            }
        }
        // The number moves at its rate to where the button went down, and from there to where the mouse was moved to.
        let least = changes.iter().map(|change| change.number).fold(f64::INFINITY, f64::min);
        let is_stiffer = changes.last().is_some_and(|last| last.number > 1.2 * least);
        is_stiffer.then_some(changes)
    });
    for change in &changes {
        assert_eq!((change.plugin.as_str(), change.parameter.as_str()), ("spring", "gamma_n"));
        assert_eq!(change.outcome, flotor_live::Outcome::Applied);
    }
    if let Some(kept) = std::env::var_os("FLOTOR_KEEP_SCREEN") {
        std::thread::sleep(Duration::from_secs(3));
        std::fs::copy(&display.screen, kept).expect("the picture is there");
    }
}

/// A whole sitting as a person goes through it: `flotor study` opens the window with the consent, everything is read and answered
/// with keys, the log, the tables and the movements are there in the end, and `flotor analyse` reads them.
#[test]
fn a_sitting_in_a_real_window_is_gone_through_by_keyboard() {
    if !required(Tool::Display) {
        return;
    }
    let folder = tempfile::tempdir().expect("a scratch folder");
    let out = folder.path().join("data");
    let display = Display::start(folder.path());
    let mut study = alone("flotor", folder.path(), Some(&display));
    study.args(["study", "magnitude", "--observer", "human", "--stimuli", "3", "--replications", "1"]);
    study.arg("--scene").arg(patient_scene(folder.path(), "study"));
    for (option, text) in
        [("--consent", "Consent\nI take part freely."), ("--instructions", "How it goes\nRate springs.")]
    {
        let file = folder.path().join(format!("{}.txt", option.trim_start_matches('-')));
        std::fs::write(&file, text).expect("a scratch folder can be written to");
        study.arg(option).arg(file);
    }
    study.args(["--demo", "2", "--noise", "off", "--out"]).arg(&out);
    study.stdout(Stdio::null()).stderr(Stdio::null());
    let mut study = Owned::start(&mut study);
    // Without a window manager nobody gives the window the keyboard. While it opens or closes there is none to be found: the
    // next attempt, or the end of the loop, tells.
    let press = |keys: &[&str]| {
        let window = ["search", "--onlyvisible", "--name", "Flotor", "windowfocus", "key"];
        let _ = Command::new("xdotool").args(window).args(keys).env("DISPLAY", &display.name).output();
    };
    // A digit means something on a rating's screen only, Return on every screen: together they go through all of them.
    let until = Instant::now() + 15 * PATIENCE;
    let status = loop {
        if let Some(status) = study.try_wait().expect("it is ours") {
            break status;
        }
        assert!(Instant::now() < until, "the sitting does not come to its end");
        if out.exists() {
            press(&["7", "Return"]);
        }
        std::thread::sleep(Duration::from_millis(150));
    };
    assert!(status.success(), "{status}");
    let log = out.join("sourcedata/sub-01/sub-01_task-magnitude_log.jsonl");
    let log = flotor_study::log::SittingLog::read(&log).expect("a log whose chain holds");
    assert!(log.complete);
    let main = |trial: &&flotor_study::trial::Trial| trial.phase == flotor_study::trial::Phase::Main;
    let trials: Vec<_> = log.trials.iter().map(|record| record.event.trial).collect();
    assert_eq!((trials.iter().filter(main).count(), trials.len()), (6, 10));
    for record in &log.trials {
        assert_eq!(record.event.exploration.kinematics.len(), 1, "every stimulus was felt and measured");
        let file = format!("sub-01_task-magnitude_trial-{:04}_motion.mcap", record.event.trial.number);
        assert!(out.join("sourcedata/sub-01/motion").join(file).is_file(), "every tick is kept");
    }
    assert!(out.join("sub-01/beh/sub-01_task-magnitude_beh.tsv").is_file());
    let read: Vec<&str> =
        log.notes.iter().filter(|(trials, _)| *trials == 0).map(|(_, text)| text.as_str()).collect();
    let place = |title: &str| {
        read.iter().position(|text| text.starts_with(&format!("read and went on: {title} (SHA")))
    };
    assert!(place("Consent").is_some() && place("Consent") < place("How it goes"), "{read:?}");
    let analysed = alone("flotor", folder.path(), None).arg("analyse").arg(&out).output().expect("it starts");
    let said = String::from_utf8_lossy(&analysed.stdout);
    assert!(analysed.status.success(), "{}", String::from_utf8_lossy(&analysed.stderr));
    assert!(said.contains("sub-01: 6 answers that count") && said.contains("answers after"), "{said}");
}

/// No display: one line of the viewer, one of the study, exit code 2, and no data folder is begun.
#[test]
fn a_sitting_without_a_display_is_refused_before_it_begins() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let out = folder.path().join("data");
    let mut study = alone("flotor", folder.path(), None);
    study.args(["study", "jnd", "--observer", "human", "--noise", "off", "--out"]).arg(&out);
    let output = study.output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("cannot open a window") && said.contains("--screen terminal"), "{said}");
    assert!(!out.exists(), "nothing was begun");
}

#[test]
fn without_a_display_there_is_one_line_and_exit_code_2() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let output = alone("flotor-viewer", folder.path(), None).output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("error: cannot open a window: ") && said.contains("--screenshot"), "{said}");
}

/// A window on a recording that stands still costs nothing: no picture is made, so nothing but the system's own events can wake
/// it. Ten seconds at full size; the processor time, which other programs disturb, is printed and not asserted.
#[test]
fn a_window_that_nobody_touches_makes_no_picture() {
    if !required(Tool::Display) {
        return;
    }
    let seconds = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { "10" } else { "2" };
    let folder = tempfile::tempdir().expect("a scratch folder");
    let file = recording(folder.path());
    let display = Display::start(folder.path());
    // On a busy machine a window that has just opened may come to rest late; one that asks for pictures never does.
    let rests = (0..5).any(|_| {
        let output = view(folder.path(), Some(&display)).args(["--measure", seconds]).arg(&file).output();
        let output = output.expect("it starts");
        let cost = String::from_utf8_lossy(&output.stdout);
        eprintln!("a recording that stands still: {}", cost.trim());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        cost.starts_with("0 pictures in ")
    });
    assert!(rests, "it makes pictures of what stands still");
}

/// A display and no driver: one line that says what to install, exit code 2; pictures are made all the same, to the last bit.
#[test]
fn without_a_driver_there_is_one_line_and_pictures_all_the_same() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let file = recording(folder.path());
    let picture = |name: &str, drivers: bool| {
        let out = folder.path().join(name);
        let mut view = view(folder.path(), None);
        view.arg("--screenshot").arg(&out).arg(&file);
        if !drivers {
            without_drivers(&mut view, folder.path());
        }
        let output = view.output().expect("it starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read(&out).expect("it is there")
    };
    let made = picture("without.png", false);
    assert!(made.starts_with(b"\x89PNG") && made == picture("with.png", true));
    if !required(Tool::Display) {
        return;
    }
    let display = Display::start(folder.path());
    let mut view = view(folder.path(), Some(&display));
    without_drivers(&mut view, folder.path());
    let output = view.arg(&file).output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with("error: cannot open a window: ") && said.contains("libgl1-mesa-dri"), "{said}");
    assert!(said.contains("--screenshot"), "{said}");
}

/// Position and force of the run as the window shows them: the same interface without a display, on the same run.
struct Twin<'a>(egui_kittest::Harness<'a, flotor_viewer::app::Viewer>);

impl Twin<'_> {
    fn on(directory: &Directory) -> Self {
        let size = egui::vec2(f32::from(SIZE[0]), f32::from(SIZE[1]));
        let start =
            flotor_viewer::app::Start::Live(flotor_viewer::app::RunSelection::newest(directory.clone()));
        let look = flotor_viewer::palette::Look::Dark;
        Self(
            egui_kittest::Harness::builder().with_size(size).build_eframe(|creation| {
                flotor_viewer::app::Viewer::new(&creation.egui_ctx, None, start, look)
            }),
        )
    }

    /// The numbers of a row of the readout, x, y and z, or one; none before there are any.
    fn row(&mut self, name: &str) -> Option<Vec<f64>> {
        self.0.run_steps(2);
        let mut texts: Vec<(egui::Pos2, String)> = Vec::new();
        for clipped in &self.0.output().shapes {
            if let egui::Shape::Text(text) = &clipped.shape {
                texts.push((text.pos, text.galley.text().to_owned()));
            }
        }
        let labels = texts.iter().filter(|(_, text)| text == name);
        // The readout is above the traces, which have names, too.
        let (label, _) = labels.min_by(|(a, _), (b, _)| a.y.total_cmp(&b.y))?;
        let mut row: Vec<_> =
            texts.iter().filter(|(at, _)| (at.y - label.y).abs() < 4.0 && at.x > label.x).collect();
        row.sort_by(|(a, _), (b, _)| a.x.total_cmp(&b.x));
        let numbers = row.iter().filter_map(|(_, text)| text.replace('−', "-").trim().parse().ok());
        Some(numbers.collect::<Vec<f64>>()).filter(|numbers| !numbers.is_empty())
    }

    fn handle(&mut self) -> Option<egui::Pos2> {
        use egui_kittest::kittest::Queryable;
        self.0.run_steps(2);
        self.0.query_by_label(flotor_viewer::ui::handle::DRAG).map(|handle| handle.rect().center())
    }
}

/// A wall of 2 kN/m under a hand that rests above it: the handle is dragged down until it is shown a millimetre deep, and is
/// released. The readout then shows 2 N, the force goes without a jump, and the recording replays bit for bit.
#[test]
fn a_handle_dragged_a_millimetre_into_a_wall_reads_two_newtons_and_is_released_softly() {
    if !required(Tool::Display) {
        return;
    }
    let folder = tempfile::tempdir().expect("a scratch folder");
    let scene = folder.path().join("wall.toml");
    let text = "title = \"A wall to press\"\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"hold\"\nhand_depth_mm = -2\n\
                [[model]]\nplugin = \"wall\"\n[model.parameters]\nstiffness_n_per_m = 2000\n[limits]\nwatchdog_ms = 60000\n";
    std::fs::write(&scene, text).expect("a scratch folder can be written to");
    let file = folder.path().join("run.mcap");
    let mut run = alone("flotor", folder.path(), None);
    run.arg("run").arg(&scene).args(["--duration", "10min", "--rate", "500", "--record"]).arg(&file);
    let mut run = Owned::start(run.stderr(Stdio::null()).stdout(Stdio::null()));
    let directory = Directory::at(folder.path().join("flotor"));
    let client = patiently("the run is found", || Client::find(&directory).ok());

    let display = Display::start(folder.path());
    let mut window = alone("flotor-viewer", folder.path(), Some(&display));
    window.args(["--size", &format!("{}x{}", SIZE[0], SIZE[1])]).stderr(Stdio::null());
    let _window = Owned::start(&mut window);
    let xdotool = |arguments: &[&str]| {
        let mut command = Command::new("xdotool");
        command.args(arguments).env("DISPLAY", &display.name).output().is_ok_and(|done| done.status.success())
    };
    patiently("the window opens", || xdotool(&["search", "--onlyvisible", "--name", "Flotor"]).then_some(()));
    let mut twin = Twin::on(&directory);
    let place = patiently("the handle is in sight", || twin.handle());
    let [x, first] = [place.x, place.y].map(f64::from);
    let mut y = first;
    let moved = |x: f64, y: f64| xdotool(&["mousemove", &format!("{x:.0}"), &format!("{y:.0}")]);
    // Taken again until the window, which may still be starting, has seen it.
    patiently("the handle is taken", || {
        moved(x, first);
        xdotool(&["sleep", "0.2", "mouseup", "1", "mousedown", "1", "sleep", "0.2"]);
        y = first + 40.0;
        moved(x, y);
        std::thread::sleep(Duration::from_secs(1));
        (twin.row("Position")?.get(2)? < &1.0).then_some(())
    });
    // A pixel moves the handle by 0.09 mm.
    let is_deep = |depth_mm: f64| (depth_mm - 1.0).abs() < 0.05;
    patiently("the handle is a millimetre deep", || {
        std::thread::sleep(Duration::from_millis(800));
        let depth_mm = -*twin.row("Position")?.get(2)?;
        // A pixel at least.
        let step = (1.0 - depth_mm) * 8.0;
        y += if is_deep(depth_mm) { 0.0 } else { step.signum() * step.abs().max(1.0) };
        is_deep(depth_mm).then_some(()).or_else(|| moved(x, y).then_some(()).filter(|()| false))
    });
    let (depth_mm, force_n) =
        (-twin.row("Position").expect("it is shown")[2], twin.row("Force").expect("it is shown")[2]);
    eprintln!("shown: {depth_mm} mm deep, {force_n} N");
    assert!(is_deep(depth_mm), "{depth_mm} mm");
    assert!((force_n - 2.0 * depth_mm).abs() <= 0.02, "{force_n} N at {depth_mm} mm");
    xdotool(&["mouseup", "1"]);
    patiently("the hand is back where it rests", || (twin.row("Position")?[2] > 1.9).then_some(()));
    client.request_client().ask(Ask::Stop).expect("the host listens");
    patiently("the run ends", || run.try_wait().expect("it is ours"));

    let replay = alone("flotor", folder.path(), None).args(["replay", "--json", "-"]).arg(&file).output();
    let replay = replay.expect("it starts");
    let said = String::from_utf8_lossy(&replay.stdout);
    assert!(replay.status.success() && said.contains("\"bit_exact\": true"), "{said}");
    let mut recording = flotor_record::Recording::open(&file).expect("a recording");
    let records = std::iter::from_fn(|| recording.next()).map(|record| record.expect("a whole tick"));
    let forces: Vec<f64> = records.map(|record| record.model.force().z).collect();
    let largest_n = forces.iter().copied().fold(0.0, f64::max);
    let steepest_n = forces.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    // At most 0.25 m/s of the intended position: 0.5 mm in a tick of 2 ms, of which the handle makes half at most.
    assert!(largest_n > 1.9 && steepest_n < 1.0, "{largest_n} N, {steepest_n} N in a tick");
}
