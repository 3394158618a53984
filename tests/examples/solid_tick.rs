//! What a tick of the solid costs, through the plugin's boundary: along the press of every open row of the sphere table, without
//! contact, under a punch and a plate, and on three meshes; and what the shape for a picture costs.
//!
//! `cargo run --release -p flotor-tests --features measurements --example solid_tick`: compare the numbers of one run; a busy
//! machine can only make them larger.

use flotor_hal::{DQuat, DVec3, Input, Output, Pose, Wrench};
use flotor_loader::{Model, Plugin, Setting};
use std::collections::BTreeMap;
use std::time::Instant;

/// Ticks of one way.
const TICKS: usize = 10_000;

/// A solid with these settings; prepared, or read from the cache.
fn solid(settings: &[(&str, &str)]) -> Model {
    let plugin = Plugin::in_process(&flotor_solid::FLOTOR_ENTRY).expect("the solid is a plugin");
    let setting =
        |(id, value): &(&str, &str)| Setting::parse(plugin.parameters(), id, value).expect("a setting");
    plugin.create_model(&settings.iter().map(setting).collect::<Vec<_>>()).expect("a solid")
}

/// Median and p99.9 of a tick on a straight way, ns.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // places in a list
fn times_ns(model: &mut Model, from_m: DVec3, to_m: DVec3) -> [f64; 2] {
    let mut times_ns: Vec<f64> = (0..TICKS)
        .map(|tick| {
            let at_m = from_m.lerp(to_m, tick as f64 / TICKS as f64);
            let input = Input::at_rest(Pose::new(at_m, DQuat::from_rotation_z(1.0e-3 * at_m.z)));
            let mut output = Output::from(Wrench::ZERO);
            let start = Instant::now();
            let _ = model.step(&input, &mut output);
            start.elapsed().as_secs_f64() * 1.0e9
        })
        .collect();
    times_ns.sort_by(f64::total_cmp);
    [0.5, 0.999].map(|share| times_ns[((TICKS - 1) as f64 * share) as usize])
}

/// Median and largest time of the shape for a picture, of as many as two seconds have, ns.
fn picture_ns(model: &mut Model) -> [f64; 2] {
    const PICTURES: u32 = 120;
    let mut times_ns: Vec<f64> = (0..=PICTURES)
        .map(|picture| {
            let at_m = DVec3::Z * (-0.005 * f64::from(picture) / f64::from(PICTURES));
            let start = Instant::now();
            let _ = model.shape(&Input::at_rest(Pose::new(at_m, DQuat::IDENTITY)));
            start.elapsed().as_secs_f64() * 1.0e9
        })
        .skip(1) // the first one solves what a punch or a plate needs
        .collect();
    times_ns.sort_by(f64::total_cmp);
    [times_ns[times_ns.len() / 2], times_ns[times_ns.len() - 1]]
}

fn print(name: &str, [median, most]: [f64; 2]) {
    println!("{name:<44} median {median:6.0} ns   p99.9 {most:7.0} ns");
}

fn main() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/data/cases/solid/b_block_sphere.csv");
    let text = std::fs::read_to_string(file).expect("the table");
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let cell = |row: &str, column: &str| {
        let place = header.iter().position(|name| *name == column).expect("a column of the table");
        row.split(',').nth(place).unwrap_or_default().to_owned()
    };
    let place = |row: &str, columns: [&str; 3]| {
        DVec3::from_array(columns.map(|column| cell(row, column).parse().expect("a number")))
    };
    let mut models: BTreeMap<[String; 2], Model> = BTreeMap::new();
    let mut largest = [0.0_f64; 2];
    for row in lines {
        let radius_mm = cell(row, "radius_m").parse::<f64>().expect("a radius") * 1.0e3;
        let key = [cell(row, "nu"), radius_mm.to_string()];
        let model = models
            .entry(key.clone())
            .or_insert_with(|| solid(&[("poisson_ratio", &key[0]), ("tool_radius_mm", &key[1])]));
        let to_m = place(row, ["x_m", "y_m", "z_m"]);
        let inwards = (to_m - place(row, ["via_x_m", "via_y_m", "via_z_m"])).normalize();
        let depth_m: f64 = cell(row, "depth_m").parse().expect("a depth");
        let times = times_ns(model, to_m - inwards * depth_m, to_m);
        print(&cell(row, "id"), times);
        (0..2).for_each(|k| largest[k] = largest[k].max(times[k]));
    }
    print("largest of all rows", largest);
    let up = |height_m: f64| DVec3::Z * height_m;
    if let Some(model) = models.values_mut().next() {
        print("without contact", times_ns(model, up(0.02), up(0.01)));
    }
    for (name, settings) in [
        ("resolution quick", &[("resolution", "quick")][..]),
        ("resolution standard", &[("resolution", "standard")]),
        ("resolution fine", &[("resolution", "fine")]),
        ("square punch", &[("tool", "punch-square")]),
        ("round punch", &[("tool", "punch-round"), ("tool_radius_mm", "5")]),
        ("plate on a beam", &[("body", "beam"), ("tool", "plate")]),
    ] {
        let model = &mut solid(settings);
        print(name, times_ns(model, up(0.0), up(-0.005)));
        print(&format!("{name}, a picture"), picture_ns(model));
    }
}
