//! A run as a picture: where the handle was, what it felt, what was stored and, in real time, how time was kept.

use crate::plot::{Axis, Figure, Mark, Panel, Series};
use crate::servo::Timing;
use crate::session::Observer;
use crate::timing_picture::panels;
use crate::trace::{Events, TickRecord};
use flotor_hal::{DVec3, rotation_vector};

/// Collects the samples of a run; drawing happens at the end.
pub struct RunPicture {
    title: String,
    records: Vec<TickRecord>,
}

impl RunPicture {
    /// An empty picture.
    #[must_use]
    pub fn new(title: &str) -> Self {
        Self { title: title.to_owned(), records: Vec::new() }
    }

    /// Draws what was collected. Not real-time.
    #[must_use]
    pub fn to_svg(&self, subtitle: &str, timing: &Timing) -> String {
        let mut figure = Figure::new(self.title.clone(), Axis::linear("Time", "s")).subtitle(subtitle);
        figure = figure
            .panel(self.axes("Position", "mm", 1.0e3, |record| record.pose.position()))
            .panel(
                self.axes("Rotation", "°", 1.0_f64.to_degrees(), |r| rotation_vector(r.pose.orientation())),
            )
            .panel(self.axes("Force", "N", 1.0, |record| record.commanded.force()))
            .panel(self.axes("Torque", "mN·m", 1.0e3, |record| record.commanded.torque()))
            .panel(self.single("Stored energy", "mJ", |record| record.energy_j * 1.0e3));
        if self.records.iter().any(|record| record.lateness_ns > 0) {
            #[allow(clippy::cast_precision_loss)] // for people
            let lateness = self.single("Lateness", "µs", |record| record.lateness_ns as f64 * 1.0e-3);
            figure = panels(timing).into_iter().fold(figure.panel(lateness), Figure::panel);
        }
        figure.to_svg()
    }

    /// Three components over time; a boundary contact is marked where it begins.
    fn axes(&self, label: &str, unit: &str, scale: f64, vector: impl Fn(&TickRecord) -> DVec3) -> Panel {
        let component = |name: &str, pick: fn(DVec3) -> f64| {
            let samples: Vec<(f64, f64)> =
                self.records.iter().map(|record| (seconds(record), pick(vector(record)) * scale)).collect();
            Series::line(name, samples)
        };
        let panel = Panel::new(Axis::linear(label, unit))
            .series(component("x", |v| v.x).slot(0))
            .series(component("y", |v| v.y).slot(1))
            .series(component("z", |v| v.z).slot(2));
        match self.records.iter().find(|record| record.events.intersects(Events::BOUNDARY)) {
            Some(record) => panel.mark(Mark::at_x(seconds(record), "boundary")),
            None => panel,
        }
    }

    fn single(&self, label: &str, unit: &str, value: impl Fn(&TickRecord) -> f64) -> Panel {
        let samples: Vec<(f64, f64)> =
            self.records.iter().map(|record| (seconds(record), value(record))).collect();
        Panel::new(Axis::linear(label, unit)).series(Series::line("", samples))
    }
}

impl Observer for RunPicture {
    fn observe(&mut self, record: &TickRecord) {
        self.records.push(*record);
    }
}

#[allow(clippy::cast_precision_loss)] // 2^53 ns are 104 days
fn seconds(record: &TickRecord) -> f64 {
    record.time_ns as f64 * 1.0e-9
}
