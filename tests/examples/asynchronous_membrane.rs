//! What computing the membrane asynchronously costs: error and delay of its contact by its rate, table and picture.
//!
//! The hand swings into the sheet and out again; the membrane itself is led along the same poses at each tick. All of it
//! runs on the virtual clock, so that nothing here depends on the machine.
//!
//! ```text
//! cargo run --release -p flotor-tests --features measurements --example asynchronous_membrane -- membrane.svg > membrane.csv
//! ```

use flotor_plot::{Axis, Figure, Panel, Series};
use flotor_tests::asynchronous_error::{AsynchronousError, Swing, asynchronous_error};
use std::error::Error;

const SWING: Swing = Swing { frequency_hz: 3.0, amplitude_mm: 1.5 };
/// A limit that never acts.
const NO_LIMIT_N_PER_S: f64 = 1.0e6;
const DURATION_S: f64 = 3.0;
const RATES_HZ: [f64; 5] = [50.0, 100.0, 200.0, 500.0, 1000.0];
/// What the picture shows, s.
const SHOWN_S: std::ops::Range<f64> = 1.0..1.4;

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "rate_hz,largest_step_mn,direct_step_mn,held_step_mn,rms_percent,worst_percent,delay_ms,rms_without_delay_percent"
    );
    let mut forces = Panel::new(Axis::linear("Force up", "N"));
    let mut errors = Panel::new(Axis::linear("Error", "N"));
    for rate_hz in RATES_HZ {
        let seen = asynchronous_error(rate_hz, SWING, NO_LIMIT_N_PER_S, DURATION_S);
        let percent = |force_n: f64| 100.0 * force_n / seen.peak_n;
        println!(
            "{rate_hz},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2},{:.2}",
            seen.largest_step_n * 1.0e3,
            seen.direct_step_n * 1.0e3,
            seen.held_step_n * 1.0e3,
            percent(seen.rms_n),
            percent(seen.worst_n),
            seen.delay_s * 1.0e3,
            percent(seen.rms_delayed_n)
        );
        if rate_hz == 50.0 || rate_hz == 200.0 {
            let name = format!("contact at {rate_hz} Hz");
            forces = forces.series(Series::line(&name, shown(&seen, |_, contact| contact)));
            errors = errors.series(Series::line(&name, shown(&seen, |direct, contact| contact - direct)));
            if rate_hz == 200.0 {
                forces = forces.series(Series::line("membrane at 1 kHz", shown(&seen, |direct, _| direct)));
            }
        }
    }
    let figure = Figure::new("A membrane computed asynchronously", Axis::linear("Time", "s"))
        .subtitle("the hand at 3 Hz and ±1.5 mm in and out of the sheet; loop at 1 kHz")
        .panel(forces)
        .panel(errors);
    match std::env::args().nth(1) {
        Some(file) => Ok(std::fs::write(file, figure.to_svg())?),
        None => Ok(()),
    }
}

/// A number of each tick that is shown, from the vertical forces of membrane and field.
fn shown(seen: &AsynchronousError, number: impl Fn(f64, f64) -> f64) -> Vec<(f64, f64)> {
    let ticks = seen.records.iter().zip(&seen.direct_n);
    let points = ticks.map(|(record, direct_n)| {
        (record.time_ns as f64 * 1.0e-9, number(direct_n.z, record.model.force().z))
    });
    points.filter(|(time_s, _)| SHOWN_S.contains(time_s)).collect()
}
