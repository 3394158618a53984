//! How a released flotor oscillates on spring 1: frequency and rebound by the depth of the release (D23).
//!
//! Three cases: the flotor's weight compensated, the feed-forward of 7.7 N that the thesis states beside a mass of 580 g (D5), and the
//! same with the printed program's law. The frequency is that of the first whole swing, between two upward passages of the place where
//! the flotor rests in the end.
//!
//! ```text
//! cargo run --release -p flotor-tests --features measurements --example release_oscillation
//! ```

use flotor_core::trace::TickRecord;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunOptions, Session};
use std::error::Error;
use std::path::Path;

/// Depths of the release, mm, before the boundary and within its reach.
const DEPTHS_MM: [f64; 6] = [1.0, 3.0, 5.0, 7.0, 9.0, 10.0];
/// Length of a run, s: drag of 2 N·s/m on 580 g leaves less than 1e-5 of the motion.
const DURATION_S: f64 = 8.0;

/// Compensation of the weight and law of the spring.
struct Case {
    name: &'static str,
    device: &'static str,
    variant: &'static str,
}

const CASES: [Case; 3] = [
    Case { name: "weight compensated", device: "", variant: "energy" },
    Case { name: "feed-forward 7.7 N", device: "feedforward_n = 7.7", variant: "energy" },
    Case { name: "feed-forward 7.7 N, printed law", device: "feedforward_n = 7.7", variant: "thesis" },
];

/// Observer of the heights, m.
struct Heights(Vec<f64>);

impl Observer for Heights {
    fn observe(&mut self, record: &TickRecord) {
        self.0.push(record.pose.position_m[2]);
    }
}

/// First swing after a release.
struct Swing {
    frequency_hz: f64,
    /// Highest place above rest, m.
    rebound_m: f64,
}

fn main() -> Result<(), Box<dyn Error>> {
    println!("case,released_mm,frequency_hz,rebound_mm");
    lines()?.iter().for_each(|line| println!("{line}"));
    Ok(())
}

/// Returns the lines of the table.
pub(crate) fn lines() -> Result<Vec<String>, Box<dyn Error>> {
    let all = CASES.iter().flat_map(|case| DEPTHS_MM.map(|depth_mm| (case, depth_mm)));
    all.map(|(case, depth_mm)| {
        let Swing { frequency_hz, rebound_m } = swing(&heights(case, depth_mm)?).ok_or("no whole swing")?;
        Ok(format!("{:?},{depth_mm},{frequency_hz:.3},{:.2}", case.name, rebound_m * 1.0e3))
    })
    .collect()
}

/// Returns the heights of a flotor that is released at a depth, m, a tick each.
fn heights(case: &Case, depth_mm: f64) -> Result<Vec<f64>, Box<dyn Error>> {
    let Case { device, variant, .. } = case;
    let scene = format!(
        "duration_s = {DURATION_S}\n[limits]\nramp_s = 0.0\n[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"open\"\n\
         start_z_mm = -{depth_mm}\n{device}\n[[model]]\nplugin = \"spring\"\n[model.parameters]\nvariant = \"{variant}\"\n\
         [model.mapping]\nmotion_scale = 1.6666666666666667\nforce_scale = 1.0\n"
    );
    let scene = Scene::parse(Path::new("released flotor"), &scene)?;
    let registry = Registry::search(&[])
        .with_linked(&flotor_simulated::FLOTOR_ENTRY)?
        .with_linked(&flotor_spring::FLOTOR_ENTRY)?;
    let session = Session::prepare(&scene, &registry, &RunOptions { clock: Clock::Virtual, seed: 1 })?;
    let mut heights = Heights(Vec::new());
    session.run(&mut heights, &StopSwitch::default())?;
    Ok(heights.0)
}

/// Returns the first swing; `None` without two upward passages of the place of rest.
fn swing(heights_m: &[f64]) -> Option<Swing> {
    let rest_m = heights_m.last()?;
    let above = |index: usize| heights_m[index] - rest_m;
    let passages = (1..heights_m.len()).filter(|index| above(index - 1) < 0.0 && above(*index) >= 0.0);
    // Between two ticks, on a straight line.
    let mut times = passages.map(|index| index as f64 - above(index) / (above(index) - above(index - 1)));
    let (first, second) = (times.next()?, times.next()?);
    let highest_m = heights_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(Swing { frequency_hz: 1.0e3 / (second - first), rebound_m: highest_m - rest_m })
}
