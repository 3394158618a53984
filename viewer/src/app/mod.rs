//! Window of the viewer: state, and handling of a running host or a recording.
//!
//! A frame is drawn only after a change: new ticks, user input, or playback. This module owns all displayed state; the parts in
//! [`crate::ui`] only show the state.

mod hand;
mod intake;
mod keys;
mod layout;
mod opening;
mod recording;
mod sitting;
mod source;
mod words;

pub use source::{Pace, RunSelection, Source, connect};

use crate::canvas::Canvas;
use crate::devices::Devices;
use crate::display_options::DisplayOptions;
use crate::experiment::Prompt;
use crate::frame_rate::FrameRate;
use crate::guide::Guide;
use crate::palette::{Look, Palette};
use crate::panel::Panel;
use crate::saved_settings::SavedSettings;
use crate::scene::{SceneBuilder, SceneFacts};
use crate::shape::Shape;
use crate::sound::Bell;
use crate::ui::handle::Drag;
use crate::ui::plot_stack::{PlotStack, Window};
use crate::ui::view3d::View3d;
use crate::ui::{help, playback, readout, style};
use eframe::egui_wgpu::RenderState;
use egui::{CentralPanel, Context, Frame, Margin, Panel as Edge, Ui};
use flotor_history::History;
use flotor_history::compared::Compared;
use flotor_history::player::{Motion, Player};
use flotor_live::{Ask, WrenchLimits};
use flotor_record::RunDescription;
use opening::Opening;
use source::{FRAME, FRAME_OF_WORDS, FRAME_ON_CPU};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Default width of the side panel, points, and its range.
const SIDE_PT: f32 = 300.0;
const SIDE_RANGE_PT: std::ops::RangeInclusive<f32> = 240.0..=480.0;
/// Range for the fraction of the height that belongs to the 3D view.
pub(super) const VIEW_PARTS: std::ops::RangeInclusive<f32> = 0.15..=0.85;
/// Smallest width of a window that shows the panel by default, points; in a narrower window too little width is left for the run.
const ROOM_FOR_PANEL_PT: f32 = 900.0;
/// Width of a window below which the panel replaces view and traces, points.
const ROOM_BESIDE_PANEL_PT: f32 = 560.0;
/// Initial time span of the traces of a running host, s.
const LIVE_WINDOW_S: f64 = 10.0;
/// Height of a window below which its bars are lower, points.
const LOW_PT: f32 = 480.0;

/// Initial content of the window.
pub enum Start {
    /// A running host, or the next run.
    Live(RunSelection),
    /// A run with the screens of a sitting, for a subject.
    Sitting(RunSelection, Box<Prompt>),
    /// A recording.
    Recording(Recorded),
}

/// Recording to show.
pub struct Recorded {
    /// File of the recording, if any.
    pub file: Option<PathBuf>,
    /// Samples of each device.
    pub histories: Vec<History>,
    /// Initial time, s; `None`: the time of the largest force.
    pub at_s: Option<f64>,
    /// Plugin files for drawing the bodies.
    pub plugins: Vec<PathBuf>,
    /// Second recording for comparison.
    pub compared: Option<Compared>,
}

impl Recorded {
    /// Creates a recording without file and comparison, to show at the time of the largest force.
    #[must_use]
    pub fn new(histories: Vec<History>, plugins: Vec<PathBuf>) -> Self {
        Self { file: None, histories, at_s: None, plugins, compared: None }
    }
}

/// Viewer in a window: source of the data, displayed state and settings of the user.
pub struct Viewer {
    source: Source,
    devices: Devices,
    heading: Heading,
    shapes: Vec<Shape>,
    shape_version: u64,
    panels: Vec<Panel>,
    limits: WrenchLimits,
    missing: Vec<String>,
    player: Player,
    view: View3d,
    /// Force of an arrow of full length, N, if chosen.
    arrow_force_n: Option<f64>,
    facts: SceneFacts,
    /// Hands that can be guided, and the current drag of a handle.
    guide: Guide,
    drag: Option<Drag>,
    plots: PlotStack,
    opening: Opening,
    /// Second recording over the run.
    compared: Option<Compared>,
    look: Look,
    /// Choice of the user; `None`: by the width of the window.
    shows_panel: Option<bool>,
    side_pt: f32,
    /// Fraction of the height for the 3D view, if the border was dragged.
    view_part: Option<f32>,
    remark: Option<(String, Instant)>,
    done: Option<(String, Instant)>,
    /// True while the list of shortcuts is shown.
    shows_keys: bool,
    bell: Bell,
    frame_rate: FrameRate,
    last_look: Option<Instant>,
    frame: Duration,
    pace: Pace,
    sitting: Option<Prompt>,
}

/// Title and subtitle of a run; empty without a run.
#[derive(Default)]
struct Heading {
    title: String,
    subtitle: String,
}

impl Heading {
    fn of(run: &RunDescription) -> Self {
        Self { title: readout::title_of(run), subtitle: readout::subtitle_of(run) }
    }
}

impl Viewer {
    /// Creates the viewer of a window with its initial content; without a render device, the 3D view is drawn by the processor.
    #[must_use]
    pub fn new(context: &Context, device: Option<&RenderState>, start: Start, look: Look) -> Self {
        style::apply(context, look);
        let on_cpu =
            device.is_some_and(|state| state.adapter.get_info().device_type == wgpu::DeviceType::Cpu);
        let frame = if on_cpu { FRAME_ON_CPU } else { FRAME };
        let (source, plugins, recorded, sitting) = match start {
            Start::Live(wanted) => (Source::Waiting(wanted.clone()), wanted.plugins, None, None),
            Start::Sitting(wanted, mut prompt) => {
                prompt.open(context);
                (Source::Waiting(wanted), Vec::new(), None, Some(*prompt))
            }
            Start::Recording(recorded) => (Source::Recording, Vec::new(), Some(recorded), None),
        };
        let mut viewer = Self {
            source,
            heading: Heading::default(),
            devices: Devices::new(Vec::new()),
            shapes: Vec::new(),
            shape_version: 0,
            panels: Vec::new(),
            limits: WrenchLimits::default(),
            missing: Vec::new(),
            player: Player::live(),
            view: View3d::new(Canvas::new(device), SceneBuilder::extent(&[], 1)),
            arrow_force_n: None,
            facts: SceneFacts::default(),
            guide: Guide::new(&[]),
            drag: None,
            plots: PlotStack::new(Window::Newest(LIVE_WINDOW_S)),
            opening: Opening::with_plugins(plugins),
            compared: None,
            look,
            shows_panel: None,
            side_pt: SIDE_PT,
            view_part: None,
            remark: None,
            done: None,
            shows_keys: false,
            bell: Bell::default(),
            frame_rate: FrameRate::default(),
            last_look: None,
            frame,
            pace: Pace::of(frame),
            sitting,
        };
        recorded.into_iter().for_each(|recorded| viewer.show_recording(recorded));
        viewer
    }

    /// Returns the player: displayed time and playback mode.
    pub fn player(&self) -> &Player {
        &self.player
    }

    /// Returns the history of the chosen device.
    #[must_use]
    pub fn history(&self) -> &History {
        self.devices.history()
    }

    /// Applies the display options of the command line.
    pub fn choose(&mut self, chosen: &DisplayOptions) {
        self.look_at(chosen.device);
        self.arrow_force_n = chosen.arrow_force_n;
        self.plots.choose(chosen);
    }

    /// Returns the second recording shown over the run; `None` without one.
    #[must_use]
    pub fn compared(&self) -> Option<&Compared> {
        self.compared.as_ref()
    }

    /// Returns the devices of the run.
    #[must_use]
    pub fn devices(&self) -> &Devices {
        &self.devices
    }

    /// Returns the panels, devices before models.
    #[must_use]
    pub fn panels(&self) -> &[Panel] {
        &self.panels
    }

    /// Returns the 3D view.
    #[must_use]
    pub fn view(&self) -> &View3d {
        &self.view
    }

    /// Returns the plots of the traces.
    #[must_use]
    pub fn plots(&self) -> &PlotStack {
        &self.plots
    }

    /// Shows the screens of a sitting over a recording, as in a real sitting.
    pub fn rehearse(&mut self, prompt: Prompt) {
        self.sitting = Some(prompt);
    }

    /// Returns whether screens of a sitting are shown over a recording.
    fn is_rehearsal(&self) -> bool {
        matches!(self.source, Source::Recording) && self.is_for_subject()
    }

    /// Returns whether the window is for the subject of a sitting, not for an experimenter.
    fn is_for_subject(&self) -> bool {
        self.sitting.is_some()
    }

    /// Returns the colour scheme, light or dark.
    #[must_use]
    pub fn look(&self) -> Look {
        self.look
    }

    /// Returns the user's settings for saving; the size and the zoom of the window have their defaults here.
    #[must_use]
    pub fn settings(&self) -> SavedSettings {
        SavedSettings {
            look: self.look,
            units: self.plots.units,
            traces: self.plots.shown.clone(),
            shows_panel: self.shows_panel,
            side_pt: self.side_pt.round(),
            view_part: self.view_part,
            latest: self.opening.latest().to_vec(),
            ..SavedSettings::default()
        }
    }

    /// Restores the saved settings, except size and zoom of the window.
    pub fn restore(&mut self, context: &Context, saved: &SavedSettings) {
        let SavedSettings { look, units, traces, shows_panel, side_pt, view_part, latest, .. } = saved;
        self.opening.restore(latest);
        self.look = *look;
        style::apply(context, *look);
        self.plots.units = *units;
        if !traces.is_empty() {
            self.plots.shown.clone_from(traces);
        }
        self.shows_panel = *shows_panel;
        self.view_part = view_part.map(|part| part.clamp(*VIEW_PARTS.start(), *VIEW_PARTS.end()));
        self.side_pt = side_pt.clamp(*SIDE_RANGE_PT.start(), *SIDE_RANGE_PT.end());
    }

    /// Draws the whole window, and processes input and new data.
    pub fn show(&mut self, ui: &mut Ui) {
        let palette = Palette::of(self.look);
        // Count each picture once: further passes repeat its layout.
        if ui.ctx().current_pass_index() == 0 {
            self.frame_rate.count(Instant::now());
        }
        self.poll(ui.ctx());
        self.pace.set(if self.is_moving() { self.frame } else { FRAME_OF_WORDS });
        if self.sitting.is_some() {
            self.player.advance(0.0, self.devices.history().span_s());
            self.sit(ui, &palette);
            return;
        }
        self.open_dropped(ui);
        self.keys(ui);
        let elapsed_s = f64::from(ui.input(|input| input.stable_dt)).min(0.1);
        self.player.advance(elapsed_s, self.devices.history().span_s());
        if self.player.motion == Motion::Play {
            ui.ctx().request_repaint_after(self.frame);
        }
        let plain = |x: i8, y: i8| Frame::new().fill(palette.panel).inner_margin(Margin::symmetric(x, y));
        let is_low = ui.available_height() < LOW_PT;
        let [top_pt, playback_pt] = if is_low { [40.0, 34.0] } else { [48.0, 44.0] };
        Edge::top("top").exact_size(top_pt).frame(plain(16, 3)).show(ui, |ui| self.top(ui, &palette));
        self.messages(ui, &palette);
        if !self.devices.history().is_empty() {
            let is_live = self.source.is_running();
            Edge::bottom("playback").exact_size(playback_pt).frame(plain(16, 3)).show(ui, |ui| {
                playback::playback(ui, &mut self.player, self.devices.history(), is_live, &palette);
            });
            if self.is_panel_shown(ui.ctx()) {
                if ui.available_width() < ROOM_BESIDE_PANEL_PT {
                    CentralPanel::default().frame(plain(14, 10)).show(ui, |ui| self.side(ui, &palette));
                    return;
                }
                let side = Edge::right("side")
                    .default_size(self.side_pt)
                    .size_range(SIDE_RANGE_PT)
                    .frame(plain(14, 10));
                self.side_pt = side.show(ui, |ui| self.side(ui, &palette)).response.rect.width();
            }
        }
        CentralPanel::default().frame(plain(0, 0)).show(ui, |ui| self.middle(ui, &palette));
        if self.shows_keys {
            help::keys(ui.ctx(), &mut self.shows_keys);
        }
    }

    /// Returns whether the panel is shown: by the user's choice, else by the width of the window.
    fn is_panel_shown(&self, context: &Context) -> bool {
        self.shows_panel.unwrap_or_else(|| context.content_rect().width() >= ROOM_FOR_PANEL_PT)
    }

    fn switch_panel(&mut self, context: &Context) {
        self.shows_panel = Some(!self.is_panel_shown(context));
    }

    /// Returns whether any visible part moves with new ticks.
    fn is_moving(&self) -> bool {
        match &self.sitting {
            Some(prompt) => prompt.shows_scene(),
            None => self.player.motion == Motion::Follow,
        }
    }

    fn say(&mut self, remark: impl Into<String>) {
        self.remark = Some((remark.into(), Instant::now()));
    }

    fn ask(&mut self, ask: Ask) {
        let Source::Live { feed, .. } = &self.source else { return };
        if let Err(error) = feed.ask(ask) {
            self.say(error.to_string());
        }
    }
}

impl eframe::App for Viewer {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.show(ui);
    }

    fn clear_color(&self, _visuals: &egui::Visuals) -> [f32; 4] {
        Palette::of(self.look).panel.to_normalized_gamma_f32()
    }
}
