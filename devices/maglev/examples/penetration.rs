//! Penetration of the handle into the wall of the device under a constant push: at rest, and upper bound on the way
//! there.
//!
//! `cargo run --release -p flotor-maglev --example penetration [PUSH_N]`

use flotor_hal::SampledLoop;
use flotor_maglev::boundary::Walls;
use flotor_maglev::facts;

/// Radius at which the wall begins, m: the default.
const RADIUS_M: f64 = 11.0e-3;
const PERIOD_S: f64 = 1.0e-3;

fn main() {
    let push_n = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(40.0_f64);
    table(push_n).iter().for_each(|line| println!("{line}"));
}

/// Returns a table of the penetration under a push, N: one line per delay of the loop.
pub(crate) fn table(push_n: f64) -> Vec<String> {
    let margin_mm = (facts::RANGE_M - RADIUS_M) * 1.0e3;
    let head = [
        format!("push {push_n} N from rest at the wall, {margin_mm:.1} mm to the edge, 1 kHz, 15 N s/m"),
        format!("{:>9} {:>12} {:>10} {:>10}   result", "delay", "stiffness", "at rest", "at most"),
    ];
    let row = |delay_ms: f64| {
        let delay_s = delay_ms * 1.0e-3;
        let wall =
            Walls::maker(RADIUS_M).stabilised(&SampledLoop { period_s: PERIOD_S, latency_s: delay_s }).sphere;
        let depth = wall.penetration(push_n, 0.0, facts::FLOTOR_MASS_KG[0], PERIOD_S, delay_s);
        let [rest_mm, most_mm] = [depth.at_rest, depth.at_most].map(|metres| metres * 1.0e3);
        let result = if most_mm <= margin_mm { "held" } else { "may end in a landing" };
        format!("{delay_ms:>6} ms {:>8.0} N/m {rest_mm:>7.3} mm {most_mm:>7.3} mm   {result}", wall.stiffness)
    };
    head.into_iter().chain([0.0, 0.5, 1.0, 2.0].map(row)).collect()
}
