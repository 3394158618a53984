//! A run as a picture: pose, force and torque, stored energy and, in real time, the timing.

use crate::timing_picture::panels;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{DVec3, Demand, rotation_vector};
use flotor_plot::{Axis, Figure, Mark, Panel, Series, Trace};
use flotor_servo::Timing;
use flotor_session::Observer;

/// The traces of a run, reduced while the run lasts; drawn at its end.
pub struct RunPicture {
    title: String,
    devices: Vec<DeviceTraces>,
    lateness_us: Trace,
    is_real_time: bool,
}

/// The traces of one device.
struct DeviceTraces {
    name: String,
    position_mm: [Trace; 3],
    rotation_deg: [Trace; 3],
    force_n: [Trace; 3],
    torque_mnm: [Trace; 3],
    energy_mj: Trace,
    /// Time of the first tick with each of [`MARKED`], s.
    first_s: [Option<f64>; MARKED.len()],
}

/// Events whose first tick is marked, and their names.
const MARKED: [(Events, &str); 6] = [
    (Events::BOUNDARY, "boundary"),
    (Events::MODEL_FAULT, "model fault"),
    (Events::NOT_FINITE, "not finite"),
    (Events::DEVICE_FAULT, "device fault"),
    (Events::FORCE_LIMITED, "force limited"),
    (Events::TORQUE_LIMITED, "torque limited"),
];

impl RunPicture {
    /// An empty picture of a run with these devices.
    #[must_use]
    pub fn new(title: &str, devices: Vec<String>) -> Self {
        let devices = devices.into_iter().map(DeviceTraces::new).collect();
        Self { title: title.to_owned(), devices, lateness_us: Trace::default(), is_real_time: false }
    }

    /// Draws the traces. Not real-time.
    #[must_use]
    pub fn into_svg(self, subtitle: &str, timing: &Timing) -> String {
        let figure = Figure::new(self.title, Axis::linear("Time", "s")).subtitle(subtitle);
        let is_only_one = self.devices.len() == 1;
        let panels_of_devices = self.devices.into_iter().flat_map(|device| match is_only_one {
            true => device.all_panels(),
            false => device.main_panels(),
        });
        let mut figure = panels_of_devices.fold(figure, Figure::panel);
        if self.is_real_time {
            let lateness = Panel::new(Axis::linear("Lateness", "µs"));
            figure = figure.panel(lateness.series(Series::trace("", self.lateness_us)));
            figure = panels(timing).into_iter().fold(figure, Figure::panel);
        }
        figure.to_svg()
    }
}

impl Observer for RunPicture {
    /// The energy that is drawn.
    fn demand(&self) -> Demand {
        Demand::ENERGY.with(Demand::FORCE)
    }

    fn observe(&mut self, record: &TickRecord) {
        if record.device == 0 {
            self.lateness_us.add(seconds(record), record.lateness_ns as f64 * 1.0e-3);
        }
        self.is_real_time |= record.lateness_ns > 0;
        if let Some(device) = self.devices.get_mut(usize::from(record.device)) {
            device.add(record);
        }
    }
}

impl DeviceTraces {
    fn new(name: String) -> Self {
        Self {
            name,
            position_mm: Default::default(),
            rotation_deg: Default::default(),
            force_n: Default::default(),
            torque_mnm: Default::default(),
            energy_mj: Trace::default(),
            first_s: [None; MARKED.len()],
        }
    }

    fn add(&mut self, record: &TickRecord) {
        let time_s = seconds(record);
        let rotation_deg = rotation_vector(record.pose.orientation()) * 1.0_f64.to_degrees();
        add_components(&mut self.position_mm, time_s, record.pose.position() * 1.0e3);
        add_components(&mut self.rotation_deg, time_s, rotation_deg);
        add_components(&mut self.force_n, time_s, record.commanded.force());
        add_components(&mut self.torque_mnm, time_s, record.commanded.torque() * 1.0e3);
        self.energy_mj.add(time_s, record.model.energy_j().map_or(f64::NAN, |joule| joule * 1.0e3));
        for (first_s, (event, _)) in self.first_s.iter_mut().zip(MARKED) {
            if first_s.is_none() && record.events.intersects(event) {
                *first_s = Some(time_s);
            }
        }
    }

    /// The panels of the only device of a run.
    fn all_panels(self) -> Vec<Panel> {
        let first_s = self.first_s;
        let vector = |label: &str, unit: &str, traces: [Trace; 3]| vector_panel(label, unit, traces, first_s);
        let vectors = [
            vector("Position", "mm", self.position_mm),
            vector("Rotation", "°", self.rotation_deg),
            vector("Force", "N", self.force_n),
            vector("Torque", "mN·m", self.torque_mnm),
        ];
        vectors.into_iter().chain(energy_panel("Stored energy", self.energy_mj)).collect()
    }

    /// The panels of one device of several: motion, force and energy. The recording has the rest.
    fn main_panels(self) -> Vec<Panel> {
        let label = |quantity: &str| format!("{quantity}, {}", self.name);
        let vectors = [
            vector_panel(&label("Position"), "mm", self.position_mm, self.first_s),
            vector_panel(&label("Force"), "N", self.force_n, self.first_s),
        ];
        vectors.into_iter().chain(energy_panel(&label("Stored energy"), self.energy_mj)).collect()
    }
}

fn add_components(traces: &mut [Trace; 3], time_s: f64, vector: DVec3) {
    for (trace, component) in traces.iter_mut().zip(vector.to_array()) {
        trace.add(time_s, component);
    }
}

/// Three components over time; the first tick with each marked event is named.
fn vector_panel(label: &str, unit: &str, traces: [Trace; 3], first_s: [Option<f64>; MARKED.len()]) -> Panel {
    let named = ["x", "y", "z"].into_iter().zip(traces).enumerate();
    let panel = named.fold(Panel::new(Axis::linear(label, unit)), |panel, (axis, (name, trace))| {
        panel.series(Series::trace(name, trace).axis(axis))
    });
    let marks =
        first_s.into_iter().zip(MARKED).filter_map(|(time_s, (_, name))| Some(Mark::at_x(time_s?, name)));
    marks.fold(panel, Panel::mark)
}

/// The stored energy over time; none if no model gives it.
fn energy_panel(label: &str, trace: Trace) -> Option<Panel> {
    trace.has_data().then(|| Panel::new(Axis::linear(label, "mJ")).series(Series::trace("", trace)))
}

fn seconds(record: &TickRecord) -> f64 {
    record.time_ns as f64 * 1.0e-9
}
