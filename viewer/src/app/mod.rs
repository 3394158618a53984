//! The window: a running host or a recording, seen and handled.
//!
//! A picture is made when something has changed, and not otherwise: ticks that came, a hand on the mouse, time that
//! goes on. All that is shown is state of this module; the parts in [`crate::ui`] only show it.

mod sitting;
mod source;

pub use source::{Source, Wanted, connect};

use crate::canvas::Canvas;
use crate::experiment::Prompt;
use crate::export::export;
use crate::feed::{FeedState, News};
use crate::history::{History, Keep, Sample};
use crate::palette::{Look, Palette};
use crate::panel::Panel;
use crate::player::{Motion, Player};
use crate::scene::{SceneBuilder, SceneFacts};
use crate::shape::Shape;
use crate::sound::Bell;
use crate::tally::Tally;
use crate::ui::plot_stack::{PlotStack, PlotWish, Window};
use crate::ui::top_bar::{TopBar, TopBarWish};
use crate::ui::view3d::{Subject, View3d};
use crate::ui::{legend, parameters, playback, readout, standing, style, warnings};
use eframe::egui_wgpu::RenderState;
use egui::{CentralPanel, Context, Frame, Key, Margin, Panel as Edge, Rect, RichText, ScrollArea, Ui, vec2};
use flotor_live::{Ask, ChangeMessage, Outcome, SetValue, Subject as ChangeSubject, WrenchLimits};
use flotor_record::trace::Events;
use flotor_record::{RunDescription, Severity};
use source::{FRAME, FRAME_ON_CPU, Parts};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// How often a run is looked for while there is none.
const LOOK_PERIOD: Duration = Duration::from_millis(500);
/// How long something that happened in one tick stays in sight, s.
const IN_SIGHT_S: f64 = 1.0;
/// How long a remark stays in sight.
const REMARK: Duration = Duration::from_secs(6);
/// How much of a running host is kept, s, and how many ticks at most.
const KEPT_S: f64 = 60.0;
const MOST_KEPT: usize = 120_000;

/// What the window begins with.
pub enum Start {
    /// A run, now or when it comes.
    Live(Wanted),
    /// A run, in front of a subject.
    Sitting(Wanted, Box<Prompt>),
    /// A recording, at a moment, with the files of its plugins.
    Recording(Box<History>, Option<f64>, Vec<PathBuf>),
}

/// The window's state.
pub struct Viewer {
    source: Source,
    history: History,
    shapes: Vec<Shape>,
    shape_version: u64,
    panels: Vec<Panel>,
    limits: WrenchLimits,
    missing: Vec<String>,
    player: Player,
    view: View3d,
    facts: SceneFacts,
    plots: PlotStack,
    tally: Tally,
    look: Look,
    shows_panel: bool,
    remark: Option<(String, Instant)>,
    bell: Bell,
    last_look: Option<Instant>,
    frame: Duration,
    sitting: Option<Prompt>,
    audience: Audience,
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
        let (start, sitting) = match start {
            Start::Sitting(wanted, mut prompt) => {
                prompt.open();
                (Start::Live(wanted), Some(*prompt))
            }
            other => (other, None),
        };
        let (source, history, parts, player, window) = match start {
            Start::Live(wanted) | Start::Sitting(wanted, _) => {
                let nothing = History::new(nothing_yet(), Keep::Newest(1));
                let parts = Parts { shapes: Vec::new(), panels: Vec::new(), missing: Vec::new() };
                (Source::Waiting(wanted), nothing, parts, Player::live(), Window::Newest(10.0))
            }
            Start::Recording(history, at_s, files) => {
                let parts = Parts::of_recording(history.run(), &files);
                let moment_s = at_s.or_else(|| history.strongest().map(Sample::time_s)).unwrap_or(0.0);
                (Source::Recording, *history, parts, Player::at(moment_s), Window::Whole)
            }
        };
        let height_mm = SceneBuilder::height_mm(&parts.shapes);
        Self {
            source,
            tally: Tally::of(history.samples()),
            history,
            shapes: parts.shapes,
            shape_version: 0,
            panels: parts.panels,
            limits: WrenchLimits::default(),
            missing: parts.missing,
            player,
            view: View3d::new(Canvas::new(device), height_mm),
            facts: SceneFacts::default(),
            plots: PlotStack::new(window),
            look,
            shows_panel: true,
            remark: None,
            bell: Bell::default(),
            last_look: None,
            frame: if on_cpu { FRAME_ON_CPU } else { FRAME },
            audience: if sitting.is_some() { Audience::Subject } else { Audience::Experimenter },
            sitting,
        }
    }

    /// The moment shown.
    #[must_use]
    pub fn player(&self) -> &Player {
        &self.player
    }

    /// What has been seen.
    #[must_use]
    pub fn history(&self) -> &History {
        &self.history
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

    /// Light or dark.
    #[must_use]
    pub fn look(&self) -> Look {
        self.look
    }

    /// Takes in what has come since the last picture.
    fn take_in(&mut self, context: &Context) {
        let due = self.last_look.is_none_or(|last| last.elapsed() >= LOOK_PERIOD);
        let wanted = match &self.source {
            Source::Waiting(wanted) => Some(wanted),
            Source::Live { feed, wanted } if feed.state() != FeedState::Running => Some(wanted),
            _ => None,
        };
        if let Some(wanted) = wanted {
            // Somebody may start the next run at any time.
            context.request_repaint_after(LOOK_PERIOD);
            if due {
                self.last_look = Some(Instant::now());
                let wanted = wanted.clone();
                self.look_for(&wanted, context);
            }
        }
        if let Source::Live { feed, .. } = &self.source {
            let news = feed.news();
            self.tally.dropped = feed.dropped();
            if feed.state() == FeedState::Running {
                context.request_repaint_after(crate::feed::STALE_AFTER); // to notice that nothing comes
            } else {
                self.panels.iter_mut().for_each(Panel::freeze);
            }
            self.digest(news);
        }
    }

    fn look_for(&mut self, wanted: &Wanted, context: &Context) {
        let Ok(feed) = connect(wanted, context, self.frame) else { return };
        let parts = Parts::of_host(&feed);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a minute of ticks
        let kept = ((feed.run().rate_hz * KEPT_S) as usize).clamp(1, MOST_KEPT);
        self.history = History::new(feed.run().clone(), Keep::Newest(kept));
        self.limits = feed.greeting().limits;
        self.tally = Tally::default();
        self.player = Player::live();
        self.view.camera = crate::camera::Camera::experimenter(SceneBuilder::height_mm(&parts.shapes));
        (self.shapes, self.panels, self.missing) = (parts.shapes, parts.panels, parts.missing);
        self.shape_version += 1;
        self.source = Source::Live { feed: Box::new(feed), wanted: wanted.clone() };
    }

    fn digest(&mut self, news: News) {
        for record in &news.records {
            self.history.push(record);
            self.tally.add(&Sample::from(record));
            if record.events.intersects(EXCESS) {
                self.bell.ring();
            }
        }
        for change in &news.changes {
            self.follow(change);
        }
        for answer in news.answers {
            if let Some(reason) = answer.refused {
                self.panels.iter_mut().for_each(Panel::take_back);
                self.say(reason);
            }
        }
    }

    /// A parameter changed in the loop: panels and the drawn instance follow.
    fn follow(&mut self, change: &ChangeMessage) {
        self.panels.iter_mut().for_each(|panel| panel.take_in(change));
        if change.outcome != Outcome::Applied || change.subject != ChangeSubject::Parameter {
            return;
        }
        if self.audience == Audience::Subject {
            return; // what a subject sees does not change with what is felt
        }
        if let Some(shape) = self.shapes.iter_mut().find(|shape| shape.name() == change.plugin) {
            shape.set_parameter(&change.parameter, change.number);
            self.shape_version += 1;
            for panel in self.panels.iter_mut().filter(|panel| panel.name == change.plugin) {
                panel.follow(shape);
            }
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

    /// Keys, unless somebody types into a field. The space bar is the largest key: with a run it is the emergency stop,
    /// whatever has the focus.
    fn keys(&mut self, ui: &Ui) {
        let span_s = self.history.span_s();
        let is_live = self.source.is_running();
        let pressed = |key: Key| ui.input(|input| input.key_pressed(key) && !input.modifiers.command);
        if is_live && ui.input(|input| input.key_pressed(Key::Space)) {
            self.ask(Ask::EmergencyStop);
        }
        if ui.ctx().egui_wants_keyboard_input() {
            return;
        }
        if !is_live && pressed(Key::Space) {
            self.player.toggle(false, span_s);
        }
        let (shift, tick) = ui.input(|input| (input.modifiers.shift, input.modifiers.command));
        let step_s = if shift { 10.0 } else { 1.0 };
        let arrows = ui.input(|input| {
            f64::from(u8::from(input.key_pressed(Key::ArrowRight)))
                - f64::from(u8::from(input.key_pressed(Key::ArrowLeft)))
        });
        if arrows != 0.0 {
            let step_s = if tick { 1.0 / self.history.run().rate_hz.max(1.0) } else { step_s };
            self.player.seek(self.player.now_s + arrows * step_s, span_s);
        }
        if pressed(Key::Home) {
            self.player.seek(span_s[0], span_s);
        }
        if pressed(Key::End) {
            self.player.seek(span_s[1], span_s);
            if is_live {
                self.player.motion = Motion::Follow;
            }
        }
        if pressed(Key::F) && is_live {
            self.player.toggle(true, span_s);
        }
        if pressed(Key::U) {
            self.plots.switch_units();
        }
        if pressed(Key::P) {
            self.shows_panel = !self.shows_panel;
        }
        if pressed(Key::L) {
            self.switch_look(ui.ctx());
        }
        self.view.keys(ui, SceneBuilder::height_mm(&self.shapes));
    }

    fn switch_look(&mut self, context: &Context) {
        self.look = self.look.other();
        style::apply(context, self.look);
    }

    /// How the run stands, and whether that is well.
    fn standing(&self) -> (String, bool) {
        let newest = self.history.at(f64::INFINITY);
        let events = newest.map_or(Events::NONE, |sample| sample.events);
        match &self.source {
            Source::Waiting(_) => ("no run".to_owned(), true),
            Source::Recording => ("recording".to_owned(), true),
            Source::Live { feed, .. } => match feed.state() {
                FeedState::Ended(words) => (words, !events.intersects(Events::EMERGENCY_STOP)),
                FeedState::Lost(_) => ("connection lost".to_owned(), false),
                FeedState::Running if feed.is_stale() => ("no ticks come".to_owned(), false),
                FeedState::Running if events.intersects(Events::HOLDING) => ("holding".to_owned(), false),
                FeedState::Running if events.intersects(Events::RELEASING) => ("fading out".to_owned(), true),
                FeedState::Running if events.intersects(Events::RAMPING) => ("fading in".to_owned(), true),
                FeedState::Running => ("running".to_owned(), true),
            },
        }
    }

    /// What a person should know at this moment.
    fn warnings(&self, sample: &Sample) -> Vec<String> {
        let mut said = Vec::new();
        if let Source::Live { feed, .. } = &self.source {
            if feed.is_stale() {
                said.push("Stale data: no ticks come; look at the terminal of `flotor run`".to_owned());
            }
            if let FeedState::Lost(reason) = feed.state() {
                said.push(reason);
            }
        }
        // What happens in a tick is over in a millisecond: it stays in sight a while.
        let mut shown = *sample;
        if self.player.motion == Motion::Follow {
            let now_s = sample.time_s();
            self.history.between(now_s - IN_SIGHT_S, now_s).for_each(|past| shown.events.insert(past.events));
        }
        said.extend(readout::warnings(&shown, &self.facts).into_iter().map(str::to_owned));
        said.extend(self.missing.iter().cloned());
        let notes = self.history.notes().iter().filter(|note| note.severity == Severity::Error);
        said.extend(notes.map(|note| format!("{}: {}", note.source, note.text)));
        let remark = self.remark.as_ref().filter(|(_, since)| since.elapsed() < REMARK);
        said.extend(remark.map(|(remark, _)| remark.clone()));
        said
    }

    fn top(&mut self, ui: &mut Ui, palette: &Palette) {
        let (standing, is_well) = self.standing();
        let (title, subtitle) = match &self.source {
            Source::Waiting(_) => ("Flotor".to_owned(), String::new()),
            // Names of parameters are nothing for a subject's eyes.
            _ if self.audience == Audience::Subject => (String::new(), String::new()),
            _ => (readout::title_of(self.history.run()), readout::subtitle_of(self.history.run())),
        };
        let bar = TopBar {
            title: &title,
            subtitle: &subtitle,
            standing: &standing,
            is_well,
            can_stop: self.source.is_running(),
            has_panel: self.audience == Audience::Experimenter,
            look: self.look,
        };
        match bar.show(ui, palette) {
            Some(TopBarWish::EmergencyStop) => self.ask(Ask::EmergencyStop),
            Some(TopBarWish::SwitchLook) => self.switch_look(ui.ctx()),
            Some(TopBarWish::SwitchPanel) => self.shows_panel = !self.shows_panel,
            None => {}
        }
    }

    fn side(&mut self, ui: &mut Ui, palette: &Palette) {
        let mut values: Vec<SetValue> = Vec::new();
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            ui.set_max_width(ui.available_width() - 12.0); // room for the bar that scrolls
            // Models first: they are what people came for.
            let has_device = self.panels.len().min(1);
            let (device, models) = self.panels.split_at_mut(has_device);
            for panel in models.iter_mut().chain(device) {
                let changed = parameters::panel(ui, panel, palette);
                values.extend(changed.into_iter().filter_map(|index| panel.change(index)));
                ui.add_space(8.0);
            }
            if let Some(sample) = self.history.at(self.player.now_s) {
                standing::standing(ui, sample, &self.limits, &self.tally, palette);
            }
        });
        if !values.is_empty() {
            self.ask(Ask::Set { values });
        }
    }

    fn middle(&mut self, ui: &mut Ui, palette: &Palette) {
        /// Part of the height that the 3D view gets.
        const VIEW_PART: f32 = 0.56;
        let area = ui.max_rect();
        let Some(sample) = self.history.at(self.player.now_s).copied() else {
            self.nothing(ui, area, palette);
            return;
        };
        let view = Rect::from_min_size(area.min, vec2(area.width(), (area.height() * VIEW_PART).round()));
        let subject = Subject {
            shapes: &mut self.shapes,
            version: self.shape_version,
            sample: &sample,
            scale: self.tally.scale(),
        };
        self.facts = self.view.show(ui, view, self.look, subject);
        readout::numbers(ui.painter(), view, &sample, self.plots.units, palette);
        legend::paint(ui.painter(), view, &self.facts, palette);
        warnings::warnings(ui, view, &self.warnings(&sample), palette);

        let below = Rect::from_min_max(view.left_bottom() + vec2(12.0, 6.0), area.max - vec2(16.0, 2.0));
        let mut ui = ui.new_child(egui::UiBuilder::new().max_rect(below).id_salt("plots"));
        let motion = self.player.motion;
        let wishes = self.plots.show(&mut ui, &self.history, self.player.now_s, motion, palette);
        for wish in wishes {
            match wish {
                PlotWish::Seek(now_s) => self.player.seek(now_s, self.history.span_s()),
                PlotWish::Export(format) => {
                    let remark = match export(&self.history, &self.plots, format, self.look) {
                        Ok(path) => format!("Written: {}", path.display()),
                        Err(error) => error.to_string(),
                    };
                    self.say(remark);
                }
            }
        }
    }

    /// There is nothing to show: what to do.
    fn nothing(&self, ui: &mut Ui, area: Rect, palette: &Palette) {
        let (first, second) = match &self.source {
            Source::Waiting(_) => ("Waiting for a run", "Start one in a terminal:  flotor run"),
            _ => ("No ticks yet", "They appear as soon as the loop runs"),
        };
        self.words(ui, area, first, second, palette);
    }

    /// A line and what to do about it, in the middle of an area.
    fn words(&self, ui: &mut Ui, area: Rect, first: &str, second: &str, palette: &Palette) {
        let layout = egui::Layout::top_down(egui::Align::Center);
        let mut inner = ui.new_child(egui::UiBuilder::new().max_rect(area).layout(layout));
        inner.add_space(0.42 * area.height());
        inner.label(RichText::new(first).size(style::TITLE_PT));
        inner.label(RichText::new(second).color(palette.faint));
    }
}

/// What a hand should be warned of with a sound.
const EXCESS: Events = Events::from_bits(
    Events::FORCE_LIMITED.bits() | Events::TORQUE_LIMITED.bits() | Events::EXCESS_FORCE.bits(),
);

impl Viewer {
    /// Shows everything.
    pub fn show(&mut self, ui: &mut Ui) {
        let palette = Palette::of(self.look);
        self.take_in(ui.ctx());
        if self.sitting.is_some() {
            self.player.advance(0.0, self.history.span_s());
            self.sit(ui, &palette);
            return;
        }
        self.keys(ui);
        let elapsed_s = f64::from(ui.input(|input| input.stable_dt)).min(0.1);
        self.player.advance(elapsed_s, self.history.span_s());
        if self.player.motion == Motion::Play {
            ui.ctx().request_repaint_after(self.frame);
        }
        let plain = |x: i8, y: i8| Frame::new().fill(palette.panel).inner_margin(Margin::symmetric(x, y));
        Edge::top("top").exact_size(48.0).frame(plain(16, 4)).show(ui, |ui| self.top(ui, &palette));
        if !self.history.is_empty() {
            let (span_s, is_live) = (self.history.span_s(), self.source.is_running());
            Edge::bottom("playback").exact_size(44.0).frame(plain(16, 4)).show(ui, |ui| {
                playback::playback(ui, &mut self.player, span_s, is_live, &palette);
            });
            if self.shows_panel {
                let side =
                    Edge::right("side").default_size(300.0).size_range(240.0..=480.0).frame(plain(14, 10));
                side.show(ui, |ui| self.side(ui, &palette));
            }
        }
        CentralPanel::default().frame(plain(0, 0)).show(ui, |ui| self.middle(ui, &palette));
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

/// Stands in for a run until there is one.
fn nothing_yet() -> RunDescription {
    RunDescription {
        flotor_version: String::new(),
        rate_hz: 1000.0,
        duration_s: 0.0,
        seed: 0,
        clock: flotor_record::Clock::Real,
        scene_toml: String::new(),
        plugins: Vec::new(),
        couplings: Vec::new(),
    }
}
