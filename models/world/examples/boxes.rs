//! Time of a call of a world with 50 boxes and two tools: `cargo run --release -p flotor-world --example boxes`.

use flotor_hal::{ContactSet, DQuat, DVec3, Input, Pose};
use flotor_loader::{Plugin, Setting};
use flotor_world::FLOTOR_ENTRY;
use flotor_world::file::parse;
use std::fmt::Write;
use std::time::Instant;

/// Period of the world, s.
const PERIOD_S: f64 = 0.004;
/// Number of calls: a minute.
const CALLS: u32 = 15_000;

/// Fifty boxes of 20 mm and 50 g on a floor, in a pile of five layers.
fn world() -> String {
    let mut text = "[tool]\nshape = \"ball\"\nradius_mm = 8\nfriction = 0.5\n[[body]]\nname = \"floor\"\n\
                    shape = \"plane\"\nfixed = true\n"
        .to_owned();
    for number in 0..50 {
        let (layer, place) = (number / 10, number % 10);
        let [x, y, z] = [22 * (place % 5) - 44, 22 * (place / 5) - 11, 10 + 20 * layer];
        let _ = write!(
            text,
            "[[body]]\nname = \"{number}\"\nshape = \"box\"\nsize_mm = [20, 20, 20]\nmass_g = 50\n\
             position_mm = [{x}, {y}, {z}.1]\n"
        );
    }
    text
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let text = world();
    parse(&text).map_err(|problem| problem.in_file("boxes"))?;
    let file = std::env::temp_dir().join(format!("flotor-boxes-{}.toml", std::process::id()));
    std::fs::write(&file, text)?;
    let plugin = Plugin::in_process(&FLOTOR_ENTRY).map_err(|error| error.to_string())?;
    let name = file.display().to_string();
    let setting = Setting::parse(plugin.parameters(), "file", &name).map_err(|error| error.to_string())?;
    let model = plugin.create_model(&[setting]);
    std::fs::remove_file(&file)?;
    let mut model = model.map_err(|refusal| refusal.to_string())?;
    let (mut times_us, mut most) = (Vec::new(), 0);
    for call in 0..CALLS {
        let time_s = f64::from(call) * PERIOD_S;
        let sway_m = 0.06 * (0.8 * time_s).sin();
        let places = [DVec3::new(sway_m, -0.03, 0.03), DVec3::new(-sway_m, 0.03, 0.05)];
        let dt_ns = if call == 0 { 0 } else { 4_000_000 };
        let input = |place| Input {
            time_ns: u64::from(call) * 4_000_000,
            dt_ns,
            ..Input::at_rest(Pose::new(place, DQuat::IDENTITY))
        };
        let mut sets = [ContactSet::NONE; 2];
        let begun = Instant::now();
        let _ = model.contact_sets(&places.map(input), &mut sets);
        times_us.push(begun.elapsed().as_secs_f64() * 1.0e6);
        most = sets.iter().map(|set| set.count).fold(most, u32::max);
    }
    times_us.sort_by(f64::total_cmp);
    let at = |share: usize| times_us[(times_us.len() - 1) * share / 1000];
    println!("{CALLS} calls at 250 Hz, 50 boxes, two balls, up to {most} contacts for each");
    println!(
        "p50 {:.0} µs   p99 {:.0} µs   p99.9 {:.0} µs   largest {:.0} µs",
        at(500),
        at(990),
        at(999),
        at(1000)
    );
    Ok(())
}
