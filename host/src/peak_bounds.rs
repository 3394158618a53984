//! Bounds on the largest force and torque of a run, from the expectations of a test: plot panel of the magnitude, with a line at each
//! bound and a mark at the time of the largest value.

use flotor_core::trace::TickRecord;
use flotor_plot::{Axis, Mark, Panel, Quantity, Series, Trace};
use std::str::FromStr;

/// Value of the summary that is reached at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Peak {
    Force,
    Torque,
}

impl Peak {
    /// Returns title and quantity of the axis.
    fn axis(self) -> (&'static str, Quantity) {
        match self {
            Self::Force => ("Force, magnitude", Quantity::Force),
            Self::Torque => ("Torque, magnitude", Quantity::Torque),
        }
    }
}

/// Bound on the largest force, N, or torque, N·m, parsed from text such as `peak_force_n=3.2`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeakBound {
    peak: Peak,
    value_si: f64,
}

impl FromStr for PeakBound {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |value: &str| value.parse().ok().filter(|number: &f64| number.is_finite());
        let parts = text.split_once('=').and_then(|(key, value)| Some((key, number(value)?)));
        let (peak, value_si) = match parts {
            Some(("peak_force_n", value)) => (Peak::Force, value),
            Some(("peak_torque_nm", value)) => (Peak::Torque, value),
            _ => return Err(format!("`{text}` is neither peak_force_n=NUMBER nor peak_torque_nm=NUMBER")),
        };
        Ok(Self { peak, value_si })
    }
}

/// Magnitude of the commanded force or torque over time, the largest of all devices, with its bounds.
struct Magnitude {
    peak: Peak,
    bounds_si: Vec<f64>,
    trace: Trace,
    /// Time, s, and largest magnitude, SI, of the current tick, which may lack records of further devices.
    tick: Option<(f64, f64)>,
    /// Time, s, and value, SI, of the largest magnitude.
    largest: (f64, f64),
}

/// Magnitudes of force and torque for which there are bounds.
pub(crate) struct BoundedPeaks(Vec<Magnitude>);

impl BoundedPeaks {
    /// Creates an empty trace of the magnitude of each quantity (force, torque) that has a bound.
    pub(crate) fn new(bounds: &[PeakBound]) -> Self {
        let magnitude = |peak: Peak| {
            let bounds_si: Vec<f64> =
                bounds.iter().filter(|bound| bound.peak == peak).map(|bound| bound.value_si).collect();
            let (trace, tick, largest) = (Trace::default(), None, (0.0, 0.0));
            (!bounds_si.is_empty()).then_some(Magnitude { peak, bounds_si, trace, tick, largest })
        };
        Self([Peak::Force, Peak::Torque].into_iter().filter_map(magnitude).collect())
    }

    /// Adds the record of a tick at a device.
    pub(crate) fn add(&mut self, record: &TickRecord) {
        let time_s = record.time_ns as f64 * 1.0e-9;
        self.0.iter_mut().for_each(|magnitude| magnitude.add(time_s, record));
    }

    /// Returns a panel for each magnitude.
    pub(crate) fn into_panels(self) -> impl Iterator<Item = Panel> {
        self.0.into_iter().map(Magnitude::into_panel)
    }
}

impl Magnitude {
    fn add(&mut self, time_s: f64, record: &TickRecord) {
        let size = match self.peak {
            Peak::Force => record.commanded.force().length(),
            Peak::Torque => record.commanded.torque().length(),
        };
        if size > self.largest.1 {
            self.largest = (time_s, size);
        }
        match &mut self.tick {
            Some((of_tick_s, largest)) if *of_tick_s == time_s => *largest = largest.max(size),
            _ => {
                self.end_tick();
                self.tick = Some((time_s, size));
            }
        }
    }

    fn end_tick(&mut self) {
        if let Some((time_s, size)) = self.tick.take() {
            self.trace.add(time_s, size * self.quantity().unit().1);
        }
    }

    fn quantity(&self) -> Quantity {
        self.peak.axis().1
    }

    fn into_panel(mut self) -> Panel {
        self.end_tick();
        let (name, quantity) = self.peak.axis();
        let (unit, per_si) = quantity.unit();
        let panel = Panel::new(Axis::of(name, quantity)).series(Series::trace("", self.trace));
        let (time_s, size) = self.largest;
        let panel = panel.mark(Mark::at_x(time_s, format!("largest: {:.4} {unit}", size * per_si)));
        self.bounds_si.into_iter().fold(panel, |panel, bound| {
            panel.mark(Mark::at_y(bound * per_si, format!("expected {} {unit}", bound * per_si)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::trace::RECORD_WORDS;
    use flotor_plot::Figure;
    use flotor_sync::Words;

    #[test]
    fn a_panel_has_the_bound_and_the_instant_of_the_peak_of_all_devices() {
        let bounds = ["peak_force_n=3.2", "peak_force_n=1.5"].map(|text| text.parse().expect("a bound"));
        let mut peaks = BoundedPeaks::new(&bounds);
        for (tick, device, force_n) in [(0, 0, 1.0), (0, 1, 2.0), (1, 0, 4.0), (1, 1, 0.5), (2, 0, 1.0)] {
            let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
            (record.time_ns, record.device) = (tick * 1_000_000_000, device);
            record.commanded.force_n = [0.0, force_n, 0.0];
            peaks.add(&record);
        }
        let figure = Figure::new("", Axis::linear("Time", "s"));
        let svg = peaks.into_panels().fold(figure, Figure::panel).to_svg();
        for text in [
            ">Force, magnitude ",
            ">largest: 4.0000 N<",
            ">expected 3.2 N<",
            ">expected 1.5 N<",
            " 3 samples, 1 to 4",
        ] {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        assert_eq!(svg.matches("magnitude").count(), 2, "no torque: the heading and the description");
        for wrong in ["end=finished", "peak_force_n=x", "peak_force_n=nan", "peak_torque_nm=inf"] {
            assert!(wrong.parse::<PeakBound>().is_err(), "{wrong}");
        }
    }
}
