//! Measures the duration of one exchange of the plugin's thread (message, reply, sample) over the loopback interface.
//!
//! ```text
//! $ cargo run --release -p flotor-inverse3 --example round_trip
//! ```

use flotor_hal::DVec3;
use flotor_inverse3::session::{GripRequest, Request, Session};
use stand_in::{ARM, Said, StandIn, configured, state};
use std::time::{Duration, Instant};

#[path = "../tests/stand_in/mod.rs"]
#[allow(dead_code, unused_imports)] // tests use the rest
mod stand_in;

const EXCHANGES: usize = 20_000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Prepared beforehand, so that the measurement contains the plugin and an idle service only.
    let answer = state(DVec3::new(0.0123, -0.0456, 0.0789), DVec3::ZERO);
    let bytes = answer.len();
    let service = StandIn::start(move |number, _| {
        Said::Text(if number == 1 { configured(0.0) } else { answer.clone() })
    })?;
    let request = Request {
        address: service.address.clone(),
        arm: Some(ARM.to_owned()),
        grip: GripRequest::OnlyOne,
        force_gate: 0.0,
        timeout: Duration::from_secs(1),
        foreign_force_n: 1.0,
    };
    let mut session = Session::open(&request)?;
    let mut times = Vec::with_capacity(EXCHANGES);
    for number in 0..EXCHANGES {
        let started = Instant::now();
        let force_n = DVec3::splat((number % 100) as f64 * 0.01);
        session.exchange(force_n).map_err(|error| error.to_string())?;
        times.push(started.elapsed());
    }
    times.sort_unstable();
    let [p50, p99, most] = [EXCHANGES / 2, EXCHANGES * 99 / 100, EXCHANGES - 1].map(|place| times[place]);
    println!("{EXCHANGES} exchanges, {bytes} bytes a state: p50 {p50:?}, p99 {p99:?}, max {most:?}");
    Ok(())
}
