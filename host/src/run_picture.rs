//! Plot of a run: pose, force, torque, stored energy and, on the real clock, the timing.

use crate::peak_bounds::{BoundedPeaks, PeakBound};
use crate::timing_picture::panels;
use flotor_core::grip::GripRecord;
use flotor_core::guidance::is_guidance;
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome};
use flotor_hal::{Demand, GripKind, rotation_vector};
use flotor_plot::{Axis, Figure, Mark, Panel, Quantity, Series, Spans, Trace, VectorTrace};
use flotor_servo::Timing;
use flotor_session::Observer;

/// Plot of a run: an observer that collects reduced traces during the run, and draws them at its end.
pub struct RunPicture {
    title: String,
    devices: Vec<DeviceTraces>,
    changes: Changes,
    peaks: BoundedPeaks,
    lateness_us: Trace,
    is_real_time: bool,
}

/// Traces and events of one device.
struct DeviceTraces {
    name: String,
    position: VectorTrace,
    rotation: VectorTrace,
    force: VectorTrace,
    torque: VectorTrace,
    energy: Trace,
    /// Opening and effort at the grip, with their quantities; empty without a grip.
    grip: Vec<(Quantity, &'static str, Trace)>,
    events: EventTimes,
}

/// Times of the events of a device.
#[derive(Default)]
struct EventTimes {
    /// Time of the first tick with each fault and each limit, s.
    first: Vec<(Events, f64)>,
    /// Events in `first`.
    seen: Events,
    /// Intervals in which any limit acted, s.
    limited: Spans,
}

/// Changes of parameters during the run, for marks in the plot.
#[derive(Default)]
struct Changes {
    /// Marked changes, the first of the run: time, s, and text.
    marked: Vec<(f64, String)>,
    /// Number of changes without a mark.
    further: usize,
}

/// Largest number of marked changes: more would cover the traces.
const MAX_CHANGES: usize = 12;

impl RunPicture {
    /// Creates an empty plot of a run with these devices, in the scene's order, and with the bounds to draw. Not real-time.
    #[must_use]
    pub fn new(title: &str, devices: Vec<String>, bounds: &[PeakBound]) -> Self {
        Self {
            title: title.to_owned(),
            devices: devices.into_iter().map(DeviceTraces::new).collect(),
            changes: Changes::default(),
            peaks: BoundedPeaks::new(bounds),
            lateness_us: Trace::default(),
            is_real_time: false,
        }
    }

    /// Draws the traces as SVG, on the real clock with the timing. Not real-time.
    #[must_use]
    pub fn into_svg(self, subtitle: &str, timing: &Timing) -> String {
        let is_only_one = self.devices.len() == 1;
        let subtitle = match self.changes.further {
            0 => subtitle.to_owned(),
            further => format!("{subtitle}; {further} further changes are not marked"),
        };
        let figure = Figure::new(self.title, Axis::linear("Time", "s")).subtitle(subtitle);
        let panels_of_devices = self.devices.into_iter().flat_map(|device| match is_only_one {
            true => device.all_panels(&self.changes),
            false => device.main_panels(&self.changes),
        });
        let figure = panels_of_devices.fold(figure, Figure::panel_or_note);
        let mut figure = self.peaks.into_panels().fold(figure, Figure::panel);
        if self.is_real_time {
            let lateness = Panel::new(Axis::of("Lateness", Quantity::Lateness));
            figure = figure.panel(lateness.series(Series::trace("", self.lateness_us)));
            figure = panels(timing).into_iter().fold(figure, Figure::panel);
        }
        figure.to_svg()
    }
}

impl Observer for RunPicture {
    fn change(&mut self, change: &Change) {
        if change.outcome == ChangeOutcome::Applied && !is_guidance(&change.parameter) {
            self.changes.add(change);
        }
    }

    /// Returns the model outputs that the plot shows: energy and force.
    fn demand(&self) -> Demand {
        Demand::ENERGY.with(Demand::FORCE)
    }

    fn observe(&mut self, record: &TickRecord) {
        if record.device == 0 {
            self.lateness_us.add(seconds(record.time_ns), record.lateness_ns as f64 * 1.0e-3);
        }
        self.is_real_time |= record.lateness_ns > 0;
        self.peaks.add(record);
        if let Some(device) = self.devices.get_mut(usize::from(record.device)) {
            device.add(record);
        }
    }
}

impl Changes {
    fn add(&mut self, change: &Change) {
        if self.marked.len() < MAX_CHANGES {
            let text = format!("{}.{} = {}", change.plugin, change.parameter, change.value);
            self.marked.push((seconds(change.time_ns), text));
        } else {
            self.further += 1;
        }
    }

    /// Adds a mark for each change to a panel.
    fn mark(&self, panel: Panel, names: Names) -> Panel {
        self.marked.iter().fold(panel, |panel, (time_s, text)| {
            panel.mark(Mark::at_x(*time_s, if names == Names::Written { text.as_str() } else { "" }))
        })
    }
}

impl EventTimes {
    fn add(&mut self, time_s: f64, events: Events) {
        let marked = Events::FAULTS.with(Events::LIMITS);
        let new = Events::from_bits(events.bits() & marked.bits() & !self.seen.bits());
        if new != Events::NONE {
            self.first.extend(new.named().map(|(event, _)| (event, time_s)));
            self.seen.insert(new);
        }
        if events.intersects(Events::LIMITS) {
            self.limited.extend(time_s);
        } else {
            self.limited.interrupt();
        }
    }

    /// Adds the events to a panel: the first tick of each fault and limit, and the intervals of limits.
    fn mark(&self, panel: Panel, names: Names) -> Panel {
        let marked = self.first.iter().fold(panel, |panel, (event, time_s)| {
            let name = match names {
                Names::Written => event.named().map(|(_, name)| name).collect(),
                Names::LeftOut => String::new(),
            };
            panel.mark(match Events::FAULTS.intersects(*event) {
                true => Mark::fault_at_x(*time_s, name),
                false => Mark::at_x(*time_s, name),
            })
        });
        marked.limited(self.limited.clone())
    }
}

/// Visibility of the names of marks: only the first panel of a device, above its other panels, shows them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Names {
    Written,
    LeftOut,
}

impl DeviceTraces {
    fn new(name: String) -> Self {
        Self {
            name,
            position: VectorTrace::new(Quantity::Length),
            rotation: VectorTrace::new(Quantity::Angle),
            force: VectorTrace::new(Quantity::Force),
            torque: VectorTrace::new(Quantity::Torque),
            energy: Trace::default(),
            grip: Vec::new(),
            events: EventTimes::default(),
        }
    }

    fn add(&mut self, record: &TickRecord) {
        let time_s = seconds(record.time_ns);
        self.position.add(time_s, record.pose.position().to_array());
        self.rotation.add(time_s, rotation_vector(record.pose.orientation()).to_array());
        self.force.add(time_s, record.commanded.force().to_array());
        self.torque.add(time_s, record.commanded.torque().to_array());
        let (_, per_si) = Quantity::Energy.unit();
        self.energy.add(time_s, record.model.energy_j().map_or(f64::NAN, |joule| joule * per_si));
        if let Some(grip) = &record.grip {
            self.add_grip(time_s, grip);
        }
        self.events.add(time_s, record.events);
    }

    fn add_grip(&mut self, time_s: f64, GripRecord { state, commanded, .. }: &GripRecord) {
        if self.grip.is_empty() {
            let (opening, effort) = match state.kind() {
                GripKind::Linear => (Quantity::Length, Quantity::Force),
                GripKind::Angular => (Quantity::Angle, Quantity::Torque),
            };
            let quantities = [(opening, "Opening of the grip"), (effort, "Effort at the grip")];
            self.grip.extend(quantities.map(|(quantity, name)| (quantity, name, Trace::default())));
        }
        for ((quantity, _, trace), value) in self.grip.iter_mut().zip([state.opening, *commanded]) {
            trace.add(time_s, value * quantity.unit().1);
        }
    }

    /// Returns the panels of the only device of a run.
    fn all_panels(self, changes: &Changes) -> Vec<Result<Panel, String>> {
        let Self { position, rotation, force, torque, energy, grip, events, .. } = self;
        let vectors = [(position, "position"), (rotation, "rotation"), (force, "force"), (torque, "torque")];
        let panels = vectors.map(|(trace, name)| trace.panel(name)).into_iter();
        let grip = grip.into_iter().map(|(quantity, name, trace)| {
            Ok(Panel::new(Axis::of(name, quantity)).series(Series::trace("", trace)))
        });
        let energy = energy_panel("stored energy", energy);
        with_events(panels.chain(grip).chain([energy]), &events, changes)
    }

    /// Returns the panels of one device of several: position, force and energy. Rotation and torque are in the recording only.
    fn main_panels(self, changes: &Changes) -> Vec<Result<Panel, String>> {
        let name = |quantity: &str| format!("{quantity}, {}", self.name);
        let (position, force) = (self.position.panel(&name("position")), self.force.panel(&name("force")));
        let energy = energy_panel(&name("stored energy"), self.energy);
        with_events([position, force, energy].into_iter(), &self.events, changes)
    }
}

/// Marks events and changes in each panel, with their names in the first panel.
fn with_events(
    panels: impl Iterator<Item = Result<Panel, String>>,
    events: &EventTimes,
    changes: &Changes,
) -> Vec<Result<Panel, String>> {
    let mut names = Names::Written;
    let marked = |panel: Result<Panel, String>| {
        let panel = changes.mark(events.mark(panel?, names), names);
        names = Names::LeftOut;
        Ok(panel)
    };
    panels.map(marked).collect()
}

/// Returns the panel of the stored energy over time; a note as error if the models give no energy.
fn energy_panel(name: &str, trace: Trace) -> Result<Panel, String> {
    if !trace.has_data() {
        return Err(format!("{name} (not given by the models)"));
    }
    let heading = name.replacen("stored", "Stored", 1);
    Ok(Panel::new(Axis::of(heading, Quantity::Energy)).series(Series::trace("", trace)))
}

fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1.0e-9
}
