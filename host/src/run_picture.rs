//! A run as a picture: pose, force and torque, stored energy and, in real time, the timing.

use crate::timing_picture::panels;
use flotor_core::trace::{Events, TickRecord};
use flotor_hal::{DVec3, Demand, rotation_vector};
use flotor_plot::{Axis, Figure, Mark, Panel, Series};
use flotor_servo::Timing;
use flotor_session::Observer;

/// Collects the samples of a run; drawing happens at the end.
pub struct RunPicture {
    title: String,
    devices: Vec<String>,
    records: Vec<TickRecord>,
}

impl RunPicture {
    /// An empty picture of a run with these devices.
    #[must_use]
    pub fn new(title: &str, devices: Vec<String>) -> Self {
        Self { title: title.to_owned(), devices, records: Vec::new() }
    }

    /// Draws what was collected. Not real-time.
    #[must_use]
    pub fn to_svg(&self, subtitle: &str, timing: &Timing) -> String {
        let mut figure = Figure::new(self.title.clone(), Axis::linear("Time", "s")).subtitle(subtitle);
        for (device, name) in (0..).zip(&self.devices) {
            // With several devices where they were and what was felt there; the rest is in the recording.
            let is_one_of_several = self.devices.len() > 1;
            let label =
                |what: &str| if is_one_of_several { format!("{what}, {name}") } else { what.to_owned() };
            let axes = |what: &str, unit: &str, scale: f64, vector: fn(&TickRecord) -> DVec3| {
                self.axes(device, &label(what), unit, scale, vector)
            };
            figure = figure.panel(axes("Position", "mm", 1.0e3, |record| record.pose.position()));
            if !is_one_of_several {
                let rotation = |record: &TickRecord| rotation_vector(record.pose.orientation());
                figure = figure.panel(axes("Rotation", "°", 1.0_f64.to_degrees(), rotation));
            }
            figure = figure.panel(axes("Force", "N", 1.0, |record| record.commanded.force()));
            if !is_one_of_several {
                figure = figure.panel(axes("Torque", "mN·m", 1.0e3, |record| record.commanded.torque()));
            }
            let energy_mj =
                |record: &TickRecord| record.model.energy_j().map_or(f64::NAN, |joule| joule * 1.0e3);
            let energy = self.single(device, &label("Stored energy"), "mJ", energy_mj);
            figure = figure.panel(energy);
        }
        if self.records.iter().any(|record| record.lateness_ns > 0) {
            let lateness = self.single(0, "Lateness", "µs", |record| record.lateness_ns as f64 * 1.0e-3);
            figure = panels(timing).into_iter().fold(figure.panel(lateness), Figure::panel);
        }
        figure.to_svg()
    }

    fn of(&self, device: u16) -> impl Iterator<Item = &TickRecord> {
        self.records.iter().filter(move |record| record.device == device)
    }

    /// Three components over time; a boundary contact is marked where it begins.
    fn axes(
        &self,
        device: u16,
        label: &str,
        unit: &str,
        scale: f64,
        vector: impl Fn(&TickRecord) -> DVec3,
    ) -> Panel {
        let component = |name: &str, pick: fn(DVec3) -> f64| {
            let samples: Vec<(f64, f64)> =
                self.of(device).map(|record| (seconds(record), pick(vector(record)) * scale)).collect();
            Series::line(name, samples)
        };
        let panel = Panel::new(Axis::linear(label, unit))
            .series(component("x", |v| v.x).axis(0))
            .series(component("y", |v| v.y).axis(1))
            .series(component("z", |v| v.z).axis(2));
        match self.of(device).find(|record| record.events.intersects(Events::BOUNDARY)) {
            Some(record) => panel.mark(Mark::at_x(seconds(record), "boundary")),
            None => panel,
        }
    }

    fn single(&self, device: u16, label: &str, unit: &str, value: impl Fn(&TickRecord) -> f64) -> Panel {
        let samples: Vec<(f64, f64)> =
            self.of(device).map(|record| (seconds(record), value(record))).collect();
        Panel::new(Axis::linear(label, unit)).series(Series::line("", samples))
    }
}

impl Observer for RunPicture {
    /// The energy that is drawn.
    fn demand(&self) -> Demand {
        Demand::ENERGY.with(Demand::FORCE)
    }

    fn observe(&mut self, record: &TickRecord) {
        self.records.push(*record);
    }
}

fn seconds(record: &TickRecord) -> f64 {
    record.time_ns as f64 * 1.0e-9
}
