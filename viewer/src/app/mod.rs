//! The window: a running host or a recording, seen and handled.
//!
//! A picture is made when something has changed, and not otherwise: ticks that came, a hand on the mouse, time that
//! goes on. All that is shown is state of this module; the parts in [`crate::ui`] only show it.

mod hand;
mod intake;
mod keys;
mod layout;
mod opening;
mod sitting;
mod source;
mod words;

pub use source::{Pace, Source, Wanted, connect};

use crate::canvas::Canvas;
use crate::chosen::Chosen;
use crate::devices::Devices;
use crate::experiment::Prompt;
use crate::frame_rate::FrameRate;
use crate::guide::Guide;
use crate::palette::{Look, Palette};
use crate::panel::Panel;
use crate::remembered::Remembered;
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

/// Width of the side, points: where nobody has pulled it, and how far it can be pulled.
const SIDE_PT: f32 = 300.0;
const SIDE_RANGE_PT: std::ops::RangeInclusive<f32> = 240.0..=480.0;
/// How much of the height the 3D view can be given.
pub(super) const VIEW_PARTS: std::ops::RangeInclusive<f32> = 0.15..=0.85;
/// Width of a window from which on the panel stands beside the run unasked, points: narrower, the run would be squeezed.
const ROOM_FOR_PANEL_PT: f32 = 900.0;
/// Width of a window below which the panel takes the room of view and traces, points.
const ROOM_BESIDE_PANEL_PT: f32 = 560.0;
/// Time that the traces of a running host show first, s.
const LIVE_WINDOW_S: f64 = 10.0;
/// Height of a window below which its bars are lower, points.
const LOW_PT: f32 = 480.0;

/// What the window begins with.
pub enum Start {
    /// A run, now or when it comes.
    Live(Wanted),
    /// A run, in front of a subject.
    Sitting(Wanted, Box<Prompt>),
    /// A recording.
    Recording(Recorded),
}

/// A recording to be shown.
pub struct Recorded {
    /// The file, if the recording comes from one.
    pub file: Option<PathBuf>,
    /// The samples of each device.
    pub histories: Vec<History>,
    /// The first moment shown, s; without one, that of the largest force.
    pub at_s: Option<f64>,
    /// Files of the plugins whose bodies can be drawn.
    pub plugins: Vec<PathBuf>,
    /// A second recording over this one.
    pub compared: Option<Compared>,
}

impl Recorded {
    /// Shows the samples of each device at the moment of the largest force.
    #[must_use]
    pub fn new(histories: Vec<History>, plugins: Vec<PathBuf>) -> Self {
        Self { file: None, histories, at_s: None, plugins, compared: None }
    }
}

/// The window's state.
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
    /// Force that arrows are scaled for, N, if somebody chose it.
    arrow_force_n: Option<f64>,
    facts: SceneFacts,
    /// The hands that can be guided, and the drag of a handle that is under way.
    guide: Guide,
    drag: Option<Drag>,
    plots: PlotStack,
    opening: Opening,
    /// The recording over the run that is shown.
    compared: Option<Compared>,
    look: Look,
    /// What was chosen, if anything was.
    shows_panel: Option<bool>,
    side_pt: f32,
    /// Part of the height that the 3D view gets, where somebody has pulled the border.
    view_part: Option<f32>,
    remark: Option<(String, Instant)>,
    done: Option<(String, Instant)>,
    /// Whether the list of keys is in sight.
    shows_keys: bool,
    bell: Bell,
    frame_rate: FrameRate,
    last_look: Option<Instant>,
    frame: Duration,
    pace: Pace,
    sitting: Option<Prompt>,
    audience: Audience,
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

/// Who sits in front of the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Audience {
    Experimenter,
    Subject,
}

impl Viewer {
    /// A window on a device; without one, the 3D view is drawn on the processor.
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
            audience: if sitting.is_some() { Audience::Subject } else { Audience::Experimenter },
            sitting,
        };
        recorded.into_iter().for_each(|recorded| viewer.show_recording(recorded));
        viewer
    }

    /// The moment shown.
    #[must_use]
    pub fn player(&self) -> &Player {
        &self.player
    }

    /// What has been seen of the device looked at.
    #[must_use]
    pub fn history(&self) -> &History {
        self.devices.history()
    }

    /// Shows what a command line says.
    pub fn choose(&mut self, chosen: &Chosen) {
        self.look_at(chosen.device);
        self.arrow_force_n = chosen.arrow_force_n;
        self.plots.choose(chosen);
    }

    /// The recording over the run that is shown.
    #[must_use]
    pub fn compared(&self) -> Option<&Compared> {
        self.compared.as_ref()
    }

    /// The devices.
    #[must_use]
    pub fn devices(&self) -> &Devices {
        &self.devices
    }

    /// The panels, the device's first.
    #[must_use]
    pub fn panels(&self) -> &[Panel] {
        &self.panels
    }

    /// The 3D view.
    #[must_use]
    pub fn view(&self) -> &View3d {
        &self.view
    }

    /// The traces.
    #[must_use]
    pub fn plots(&self) -> &PlotStack {
        &self.plots
    }

    /// Shows the screens of a sitting over what it shows, as the person would see them.
    pub fn rehearse(&mut self, prompt: Prompt) {
        (self.sitting, self.audience) = (Some(prompt), Audience::Subject);
    }

    /// Whether screens of a sitting are shown without one.
    fn is_rehearsal(&self) -> bool {
        matches!(self.source, Source::Recording) && self.audience == Audience::Subject
    }

    /// Light or dark.
    #[must_use]
    pub fn look(&self) -> Look {
        self.look
    }

    /// What a person has chosen about the window, for the next time.
    #[must_use]
    pub fn remembered(&self) -> Remembered {
        Remembered {
            look: self.look,
            units: self.plots.units,
            traces: self.plots.shown.clone(),
            shows_panel: self.shows_panel,
            side_pt: self.side_pt.round(),
            view_part: self.view_part,
            latest: self.opening.latest().to_vec(),
            ..Remembered::default()
        }
    }

    /// Makes the window what it was the last time.
    pub fn recall(&mut self, context: &Context, remembered: &Remembered) {
        let Remembered { look, units, traces, shows_panel, side_pt, view_part, latest, .. } = remembered;
        self.opening.recall(latest);
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

    /// Shows everything.
    pub fn show(&mut self, ui: &mut Ui) {
        let palette = Palette::of(self.look);
        // Further passes lay the same picture out again.
        if ui.ctx().current_pass_index() == 0 {
            self.frame_rate.count(Instant::now());
        }
        self.take_in(ui.ctx());
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

    /// Whether the panel is in sight: as was chosen, else where there is room for it beside the run.
    fn is_panel_shown(&self, context: &Context) -> bool {
        self.shows_panel.unwrap_or_else(|| context.content_rect().width() >= ROOM_FOR_PANEL_PT)
    }

    fn switch_panel(&mut self, context: &Context) {
        self.shows_panel = Some(!self.is_panel_shown(context));
    }

    /// Whether anything in sight moves with the ticks that come.
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
