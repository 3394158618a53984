//! All texts of the window and of a picture: no two overlap, none is cut off, and emergency stop and state are always whole.

use super::window::until;
use crate::support::{FakeHost, run_of_devices, tick};
use egui::epaint::{ClippedShape, Shape};
use egui::{FullOutput, Rect, Vec2, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable;
use flotor_core::trace::Events;
use flotor_history::quantity::Quantity;
use flotor_history::{History, Retention};
use flotor_live::{Ask, EndKind};
use flotor_viewer::app::{RunSelection, Start, Viewer};
use flotor_viewer::display_options::DisplayOptions;
use flotor_viewer::palette::Look;
use flotor_viewer::picture::{PictureOptions, interface, least_height_px};
use flotor_viewer::saved_settings::SavedSettings;

/// Widths and heights of windows, pixels.
const SIZES: [[f32; 2]; 6] =
    [[640.0, 400.0], [800.0, 600.0], [1280.0, 720.0], [1280.0, 800.0], [1920.0, 1080.0], [3840.0, 2160.0]];
/// Pixels per point.
const SCALES: [f32; 3] = [1.0, 1.5, 2.0];
/// States of a run, of which one is always in sight.
const STATES: [&str; 8] =
    ["running", "holding", "fading out", "fading in", "no ticks come", "ended", "failed", "stopped"];
const SHORT: [&str; 4] = ["left", "right", "foot", "head"];
const LONG: [&str; 4] = [
    "left-hand-of-the-participant-with-the-long-handle",
    "right-hand-of-the-experimenter-with-the-short-handle",
    "c",
    "the-third-hand-that-nobody-has-but-this-scene-has",
];
const TITLES: [&str; 2] = [
    "Two walls",
    "Stiffness discrimination of a rough wall under delay with a participant of the second cohort, session 3 of 4 (pilot, do not use)",
];
/// Events of several warnings.
const WARNINGS: Events = Events::from_bits(
    Events::MISSED.bits()
        | Events::FORCE_LIMITED.bits()
        | Events::TORQUE_LIMITED.bits()
        | Events::BOUNDARY.bits()
        | Events::HOLDING.bits(),
);

/// A text of a picture, points.
pub(super) struct Text {
    pub(super) words: String,
    /// Bounds of its letters.
    letters: Rect,
    /// What can be seen of them.
    visible: Rect,
    is_shortened: bool,
}

/// The texts of which something can be seen.
pub(super) fn texts(output: &FullOutput) -> Vec<Text> {
    let mut texts = Vec::new();
    for ClippedShape { clip_rect, shape, .. } in &output.shapes {
        add_texts(shape, *clip_rect, &mut texts);
    }
    texts
}

fn add_texts(shape: &Shape, clip: Rect, texts: &mut Vec<Text>) {
    match shape {
        Shape::Vec(shapes) => shapes.iter().for_each(|shape| add_texts(shape, clip, texts)),
        Shape::Text(text) => {
            let (words, letters) = (text.galley.text().to_owned(), text.visual_bounding_rect());
            let visible = letters.intersect(clip);
            if !words.trim().is_empty() && visible.is_positive() {
                texts.push(Text { words, letters, visible, is_shortened: text.galley.elided });
            }
        }
        _ => {}
    }
}

/// No two texts overlap, and none is cut off, except at the edges of the panel, which scrolls.
fn assert_apart(texts: &[Text], size: Vec2, panel: Option<Rect>, case: &str) {
    /// A texel at the edge of a letter is no letter, points.
    const TEXEL_PT: f32 = 0.6;
    assert!(texts.len() >= 5, "{case}: only {} texts", texts.len());
    let window = Rect::from_min_size(egui::Pos2::ZERO, size);
    for (index, text) in texts.iter().enumerate() {
        for before in &texts[..index] {
            let both = text.visible.intersect(before.visible);
            let is_apart = both.width() < TEXEL_PT || both.height() < TEXEL_PT;
            assert!(
                is_apart,
                "{case}: \u{201c}{}\u{201d} over \u{201c}{}\u{201d} at {both:?}",
                text.words, before.words
            );
        }
        let scrolls = panel.is_some_and(|panel| panel.intersects(text.letters));
        let is_whole = text.visible.intersect(window).expand(TEXEL_PT).contains_rect(text.letters);
        assert!(
            scrolls || is_whole,
            "{case}: \u{201c}{}\u{201d} is cut off: {:?} of {:?}",
            text.words,
            text.visible,
            text.letters
        );
    }
}

type Window<'a> = Harness<'a, Viewer>;

/// Where the panel is, if it is in sight.
fn panel(window: &Window<'_>, size: Vec2) -> Option<Rect> {
    let left = window.query_by_label("Limits")?.rect().left() - 30.0;
    Some(Rect::from_min_max(egui::pos2(left, 70.0), egui::pos2(left, 0.0) + size))
}

/// Gives a window a size, pixels, at a scale, and returns its size, points. The picture of a new scale keeps the size of the one before, so the
/// size comes after it.
fn resize(window: &mut Window<'_>, size: [f32; 2], scale: f32) -> Vec2 {
    let points = Vec2::from(size) / scale;
    window.set_pixels_per_point(scale);
    window.run_steps(1);
    window.set_size(points);
    window.run_steps(1);
    let shown = window.ctx.content_rect().size();
    assert!((shown - points).length() < 0.1, "{shown:?} in place of {size:?} px at {scale}");
    points
}

/// States of a window on a run.
#[derive(Clone, Copy, Debug)]
enum Shown {
    Quiet,
    Warned,
    FourTraces,
    Failed,
}

impl Shown {
    /// The sizes and scales of this state: all at full size, else every fourth, so that the four states together have all.
    fn sizes(self) -> impl Iterator<Item = ([f32; 2], f32)> {
        let every = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") { 1 } else { 4 };
        let all = SIZES.into_iter().flat_map(|size| SCALES.map(|scale| (size, scale)));
        all.skip(self as usize % every).step_by(every)
    }
}

/// Goes through the sizes and scales of a state; before each size, `prepare` is called.
fn in_all_sizes(
    window: &mut Window<'_>,
    (shown, case): (Shown, &str),
    mut prepare: impl FnMut(&mut Window<'_>),
) {
    for (size, scale) in shown.sizes() {
        prepare(window);
        let points = resize(window, size, scale);
        // Bounds of plots and widths of panels are those of the picture before.
        window.run_steps(2);
        let case = format!("{case}, {shown:?}, {size:?} px at {scale}");
        let texts = texts(window.output());
        assert_apart(&texts, points, panel(window, points), &case);
        let is_whole =
            |text: &&Text| !text.is_shortened && text.visible.expand(0.6).contains_rect(text.letters);
        let state = texts.iter().filter(is_whole).find(|text| STATES.contains(&text.words.as_str()));
        let state = state.unwrap_or_else(|| panic!("{case}: no state"));
        if !["ended", "failed", "stopped"].contains(&state.words.as_str()) {
            let stop = texts.iter().filter(is_whole).find(|text| text.words.starts_with("EMERGENCY STOP"));
            assert!(stop.is_some(), "{case}: no emergency stop");
        }
    }
}

/// A window on a run of devices without a model.
fn devices(names: &[&str], title: &str, look: Look) {
    let count = u16::try_from(names.len()).expect("a handful");
    let folder = tempfile::tempdir().expect("a scratch folder");
    let host = FakeHost::of_devices(&folder, title, names);
    live(host, count, look, &format!("{} devices called {}.., {look:?}", names.len(), names[0]));
}

/// A window on a run of so many devices: quiet, with warnings, and after a fault.
fn live(mut host: FakeHost, count: u16, look: Look, case: &str) {
    let mut window = host.welcome(|directory| {
        let start = Start::Live(RunSelection::newest(directory.clone()));
        let harness = Harness::builder().with_size(vec2(640.0, 400.0));
        harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, look))
    });
    assert_eq!(host.request(None), Ask::Watch { every: 1 });
    host.run_ticks_of(count, 1200, Events::NONE);
    until(&mut window, |window| window.state().history().len() >= 1200);
    in_all_sizes(&mut window, (Shown::Quiet, case), |_| host.run_ticks_of(count, 1, Events::NONE));
    in_all_sizes(&mut window, (Shown::Warned, case), |_| host.run_ticks_of(count, 1, WARNINGS));
    let four = vec![Quantity::Force, Quantity::Torque, Quantity::Velocity, Quantity::Lateness];
    window.state_mut().choose(&DisplayOptions::new(0, four, Some(2)));
    in_all_sizes(&mut window, (Shown::FourTraces, case), |_| host.run_ticks_of(count, 1, WARNINGS));
    let reason = "tick 1234 exceeded the time limit, and the watchdog stopped the device; check the machine with `flotor doctor`, which \
                  says what keeps a loop from its time, and how to mend that on this kind of machine";
    host.end_as(reason, EndKind::Failed);
    until(&mut window, |window| window.query_by_label_contains(reason).is_some());
    in_all_sizes(&mut window, (Shown::Failed, case), |_| ());
}

#[test]
fn no_texts_overlap_with_one_device() {
    devices(&SHORT[..1], TITLES[1], Look::Dark);
    devices(&LONG[..1], TITLES[0], Look::Light);
}

#[test]
fn no_texts_overlap_with_two_devices() {
    devices(&SHORT[..2], TITLES[0], Look::Light);
    devices(&LONG[..2], TITLES[1], Look::Dark);
}

#[test]
fn no_texts_overlap_with_three_devices() {
    devices(&SHORT[..3], TITLES[0], Look::Dark);
    devices(&LONG[..3], TITLES[1], Look::Light);
}

#[test]
fn no_texts_overlap_with_four_devices() {
    devices(&SHORT, TITLES[1], Look::Light);
    devices(&LONG, TITLES[0], Look::Dark);
}

/// A handle in a wall has its contact, and a hint how it is dragged.
#[test]
fn no_texts_overlap_with_a_contact_and_a_hand() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    live(FakeHost::of_model(&folder, "wall", &[]), 1, Look::Dark, "a hand at a wall");
}

/// The window without a run, which offers recordings.
#[test]
fn no_texts_of_an_empty_window_overlap() {
    let folder = tempfile::tempdir().expect("a scratch folder");
    let start = Start::Live(RunSelection::newest(flotor_live::Directory::at(folder.path())));
    let harness = Harness::builder().with_size(vec2(640.0, 400.0));
    let mut window: Window<'_> =
        harness.build_eframe(|creation| Viewer::new(&creation.egui_ctx, None, start, Look::Dark));
    let context = window.ctx.clone();
    let latest = LONG.iter().chain(&SHORT[..1]).map(|name| format!("/recordings/{name}.mcap").into());
    let saved_settings = SavedSettings { latest: latest.collect(), ..SavedSettings::default() };
    window.state_mut().restore(&context, &saved_settings);
    for size in SIZES {
        for scale in SCALES {
            let points = resize(&mut window, size, scale);
            window.run_steps(3);
            assert_apart(&texts(window.output()), points, None, &format!("empty, {size:?} px at {scale}"));
        }
    }
    window.get_by_label(&format!("{}.mcap", LONG[0]));
}

/// The picture of `--screenshot`.
#[test]
fn no_texts_of_a_picture_overlap() {
    for (names, title) in [(SHORT, TITLES[1]), (LONG, TITLES[0])] {
        for count in 1..=4 {
            let run = run_of_devices(title, &names[..count]);
            let mut histories = History::of_each_device(&run, Retention::All);
            for (number, device) in
                (0..500).flat_map(|number| (0..).zip(0..count).map(move |(device, _)| (number, device)))
            {
                let mut record = tick(number, WARNINGS);
                record.device = device;
                histories.iter_mut().for_each(|history| history.push(&record));
            }
            let sizes = SIZES.into_iter().flat_map(|size| SCALES.map(|scale| (size, scale)));
            // The processor draws the largest for the most devices only.
            for (size, scale) in sizes.filter(|(size, _)| size[0] < 3000.0 || count == 4) {
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
                let size_px = size.map(|length| length as usize);
                let (view, chosen, at_s) = (None, Default::default(), Some(0.3));
                let options = PictureOptions { size_px, scale, look: Look::Light, view, chosen, at_s };
                let Ok(interface) = interface(histories.clone(), &mut [], &options) else {
                    assert!(
                        least_height_px(&options.chosen, scale) > size_px[1],
                        "{size:?} at {scale} has room"
                    );
                    continue;
                };
                // The frame of the harness is around the picture.
                let points = Vec2::from(size) / scale + Vec2::splat(16.0);
                let mut harness = Harness::builder().with_pixels_per_point(scale).build_ui(interface);
                harness.input_mut().max_texture_side = Some(8192);
                harness.set_size(points);
                harness.run_steps(2);
                let case =
                    format!("picture of {count} devices called {}.., {size:?} px at {scale}", names[0]);
                let texts = texts(harness.output());
                assert_apart(&texts, points, None, &case);
                assert!(texts.iter().any(|text| text.words.starts_with(&title[..9])), "{case}: no title");
            }
        }
    }
}
