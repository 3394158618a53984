//! Picture of a replay: recorded and replayed force along each axis, and the differences of force and torque.

use flotor_core::ModelOutputs;
use flotor_core::trace::TickRecord;
use flotor_hal::DVec3;
use flotor_plot::{Axis, Figure, Panel, Quantity, Series, Trace, VectorTrace};

/// Names of the components of a vector.
const COMPONENTS: [&str; 3] = ["x", "y", "z"];

/// Traces of a replay, reduced on arrival.
pub(super) struct ReplayPicture {
    recorded_n: [Trace; 3],
    replayed_n: [Trace; 3],
    force_difference: VectorTrace,
    torque_difference: VectorTrace,
}

impl ReplayPicture {
    pub(super) fn new() -> Self {
        Self {
            recorded_n: Default::default(),
            replayed_n: Default::default(),
            force_difference: VectorTrace::new(Quantity::Force),
            torque_difference: VectorTrace::new(Quantity::Torque),
        }
    }

    pub(super) fn add(&mut self, record: &TickRecord, replayed: &ModelOutputs) {
        let (recorded, time_s) = (&record.model, record.time_ns as f64 * 1.0e-9);
        for (traces, force_n) in
            [(&mut self.recorded_n, recorded.force()), (&mut self.replayed_n, replayed.force())]
        {
            traces.iter_mut().zip(force_n.to_array()).for_each(|(trace, force_n)| trace.add(time_s, force_n));
        }
        let force_n = replayed.force() - recorded.force();
        self.force_difference.add(time_s, force_n.to_array());
        // NaN, which leaves a gap, where the recording contains no torque.
        let torques = replayed.torque().zip(recorded.torque());
        let torque_nm = torques.map_or(DVec3::NAN, |(replayed, recorded)| replayed - recorded);
        self.torque_difference.add(time_s, torque_nm.to_array());
    }

    /// Draws the traces as SVG. `subtitle` names the recording and the changes.
    pub(super) fn into_svg(self, subtitle: &str) -> String {
        let figure = Figure::new("Recorded and replayed", Axis::linear("Time", "s"))
            .subtitle(format!("{subtitle}; difference: replayed − recorded"))
            .panel_height_px(150.0);
        let forces = self.recorded_n.into_iter().zip(self.replayed_n).enumerate();
        forces
            .map(|(axis, (recorded, replayed))| force_panel(axis, recorded, replayed))
            .chain([
                self.force_difference.panel("difference of force"),
                self.torque_difference.panel("difference of torque"),
            ])
            .fold(figure, Figure::panel_or_note)
            .to_svg()
    }
}

/// Draws the recorded force along an axis, grey, under the replayed one in the colour of the axis.
fn force_panel(axis: usize, recorded: Trace, replayed: Trace) -> Result<Panel, String> {
    const GREY: usize = 7;
    let component = COMPONENTS[axis];
    let largest = [&recorded, &replayed].into_iter().filter_map(Trace::largest).fold(0.0, f64::max);
    if largest < 0.5 * Quantity::Force.least_range_si() {
        return Err(format!("force {component} (0 throughout)"));
    }
    Ok(Panel::new(Axis::of(format!("Force {component}"), Quantity::Force))
        .series(Series::trace("recorded", recorded).slot(GREY))
        .series(Series::trace("replayed", replayed).axis(axis)))
}
