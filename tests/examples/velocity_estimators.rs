//! What each velocity estimate of the simulated flotor trades: noise at rest against lag in motion, table and
//! picture.
//!
//! Noise is the root mean square of the estimate along z for a flotor at rest, seen by the sensors of preset `full` (1 µm of
//! noise, steps of 2 µm): their samples are independent, so it follows from the answer to a single wrong sample, without a
//! sampling error. Lag is the delay of the estimate behind the velocity of a steady acceleration. No number depends on the
//! machine.
//!
//! ```text
//! cargo run --release -p flotor-tests --features measurements --example velocity_estimators -- velocity.svg > velocity.csv
//! ```

use flotor_hal::glam::DVec3;
use flotor_plot::{Axis, Figure, Panel, Series};
use flotor_simulated::hand::Pose;
use flotor_simulated::plant::State;
use flotor_simulated::sensing::velocity::EstimatorKind;
use flotor_simulated::sensing::{Sensing, SensingParameters};
use flotor_simulated::validation::InvalidParameter;
use std::error::Error;

const TICK_S: f64 = 1.0e-3;
const TICK_NS: u64 = 1_000_000;

/// Length of a run, ticks: the slowest estimate has forgotten its start to e^-12.
const TICKS: u64 = 400;

/// Steady acceleration, m/s²: 8 mm in the ticks of a run.
const ACCELERATION_M_PER_S2: f64 = 0.1;

/// Estimator with its setting, and what it trades.
pub(crate) struct Trade {
    pub(crate) family: &'static str,
    /// Hz or m/s², where there is one.
    pub(crate) setting: Option<f64>,
    pub(crate) noise_mm_per_s: f64,
    pub(crate) lag_ms: f64,
}

impl Trade {
    fn measured(
        family: &'static str,
        setting: Option<f64>,
        kind: EstimatorKind,
    ) -> Result<Self, InvalidParameter> {
        let (noise_mm_per_s, lag_ms) = (noise_m_per_s(kind)? * 1.0e3, lag_s(kind)? * 1.0e3);
        Ok(Self { family, setting, noise_mm_per_s, lag_ms })
    }

    /// Returns the line of the table.
    pub(crate) fn line(&self) -> String {
        let setting = self.setting.map_or_else(String::new, |number| number.to_string());
        format!("{},{setting},{:.3},{:.2}", self.family, self.noise_mm_per_s, self.lag_ms)
    }
}

/// Measures all estimators, family by family.
pub(crate) fn trades() -> Result<Vec<Trade>, InvalidParameter> {
    let noise_m = cell_noise_m();
    let low_pass = [500.0, 200.0, 100.0, 50.0, 20.0, 10.0, 5.0].map(|bandwidth_hz| {
        Trade::measured("low-pass", Some(bandwidth_hz), EstimatorKind::LowPass { bandwidth_hz })
    });
    let kalman = [200.0, 50.0, 20.0, 5.0, 2.0, 0.5, 0.2].map(|acceleration_m_per_s2| {
        let kind = EstimatorKind::Kalman { noise_m, acceleration_m_per_s2 };
        Trade::measured("kalman", Some(acceleration_m_per_s2), kind)
    });
    let difference = Trade::measured("difference", None, EstimatorKind::Difference);
    std::iter::once(difference).chain(low_pass).chain(kalman).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let trades = trades()?;
    println!("estimate,setting,noise_mm_per_s,lag_ms");
    trades.iter().for_each(|trade| println!("{}", trade.line()));
    let mut panel = Panel::new(Axis::log("Noise at rest, rms", "mm/s"));
    for family in trades.chunk_by(|one, next| one.family == next.family) {
        let points: Vec<_> = family.iter().map(|trade| (trade.lag_ms, trade.noise_mm_per_s)).collect();
        let name = family[0].family;
        panel = panel.series(if points.len() > 1 {
            Series::line(name, points)
        } else {
            Series::points(name, points)
        });
    }
    let figure = Figure::new("Estimates of velocity", Axis::log("Lag behind a steady acceleration", "ms"))
        .subtitle("low-pass of 500 to 5 Hz, Kalman filter for 200 to 0.2 m/s², at 1 kHz")
        .panel_height_px(280.0)
        .panel(panel);
    match std::env::args().nth(1) {
        Some(file) => Ok(std::fs::write(file, figure.to_svg())?),
        None => Ok(()),
    }
}

/// Returns the deviation of a cell of preset `full`, m: its noise, and its steps evenly distributed.
fn cell_noise_m() -> f64 {
    SensingParameters::MAGLEV.noise_m.hypot(SensingParameters::MAGLEV.step_m / 12.0_f64.sqrt())
}

/// Returns the velocity estimates (m/s) for a height (m) as a function of the tick, with sensors without error.
fn estimates(estimator: EstimatorKind, height_m: impl Fn(u64) -> f64) -> Result<Vec<f64>, InvalidParameter> {
    let parameters = SensingParameters {
        estimator,
        latency_ns: 0,
        noise_m: 0.0,
        step_m: 0.0,
        edge_nonlinearity: 0.0,
        ..SensingParameters::MAGLEV
    };
    let mut sensing = Sensing::new(&parameters, 0, &Pose::HOME)?;
    let rows = (0..TICKS).map(|tick| {
        let state = State { position_m: DVec3::new(0.0, 0.0, height_m(tick)), ..State::HOME };
        sensing.sample(&state, tick * TICK_NS, TICK_S);
        sensing.arrived(0).velocity.linear_m_per_s.z
    });
    Ok(rows.collect())
}

fn noise_m_per_s(estimator: EstimatorKind) -> Result<f64, InvalidParameter> {
    const WRONG_M: f64 = 1.0e-3;
    let answer = estimates(estimator, |tick| if tick == 1 { WRONG_M } else { 0.0 })?;
    let gain_per_s = answer.iter().map(|estimate| estimate * estimate).sum::<f64>().sqrt() / WRONG_M;
    // The height is the mean of the three cells.
    Ok(gain_per_s * cell_noise_m() / 3.0_f64.sqrt())
}

fn lag_s(estimator: EstimatorKind) -> Result<f64, InvalidParameter> {
    let time_s = |tick: u64| tick as f64 * TICK_S;
    let row = estimates(estimator, |tick| 0.5 * ACCELERATION_M_PER_S2 * time_s(tick).powi(2))?;
    let last = row.last().copied().unwrap_or(f64::NAN);
    Ok(time_s(TICKS - 1) - last / ACCELERATION_M_PER_S2)
}
