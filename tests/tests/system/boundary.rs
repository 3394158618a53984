//! A weight laid on the boundary wall of the simulated flotor comes to rest, whatever its sensors' latency and the rate, and with the
//! numbers of other devices.

mod handle;

use flotor_core::limits::{Bound, Boundary};
use flotor_core::rendered_boundary::RenderedBoundary;
use flotor_hal::{Capabilities, Damper, SampledLoop};
use flotor_servo::{Clock, RunEnd};
use flotor_session::registry::Registry;
use flotor_tests::library::build_folder;
use flotor_tests::printed::assert_chapter_prints;
use flotor_tests::watched::{prepared, watch, watch_with};
use handle::KINDS;

/// Run of an open hand that starts at the wall, under a load.
fn scene(preset: &str, latency_ticks: u32, rate_hz: u32, start_mm: f64, load_n: f64) -> String {
    let latency = match preset {
        "full" => format!("sensor_latency_ticks = {latency_ticks}"),
        _ => String::new(),
    };
    format!(
        r#"
duration_s = 4
rate_hz = {rate_hz}
[device]
plugin = "simulated"
[device.parameters]
preset = "{preset}"
hand = "open"
start_z_mm = {start_mm}
{latency}
[[model]]
plugin = "load"
[model.parameters]
kind = "felt"
force_n = {load_n}
"#
    )
}

/// The wall of the flotor: 12 mm of range, and a limit of force far above 5 N.
fn wall(latency_ticks: u32, rate_hz: u32) -> RenderedBoundary {
    let flotor = Capabilities {
        range_m: [0.012; 3],
        max_force_n: [50.0; 3],
        latency_s: f64::from(latency_ticks) * 1.0e-3,
        ..Capabilities::UNDRIVEN
    };
    RenderedBoundary::new(&Boundary::default(), &flotor, &Bound::NONE, 1_000_000_000 / u64::from(rate_hz))
}

#[test]
fn a_weight_laid_on_the_boundary_comes_to_rest() {
    for rate_hz in [250, 500, 1000, 2000, 4000] {
        for (preset, latency_ticks) in [("plain", 0), ("full", 0), ("full", 1), ("full", 2), ("full", 3)] {
            let wall = wall(latency_ticks, rate_hz);
            let load_n = wall.holds_n;
            let what = format!("{preset}, {latency_ticks} ticks, {rate_hz} Hz, {load_n:.2} N");
            let text = scene(preset, latency_ticks, rate_hz, -wall.begins_m[2] * 1.0e3, load_n);
            let notices = prepared(Clock::Virtual, &text).notices();
            let says_the_force =
                notices.iter().any(|notice| notice.contains(&format!("withstands {load_n:.1} N instead")));
            assert_eq!(says_the_force, load_n < 4.999, "{what}: {notices:?}");
            let run = watch(&text);
            assert_eq!(run.outcome.end, RunEnd::Finished, "{what}");
            let last = run.records.get(run.records.len() * 3 / 4..).unwrap_or_default();
            let heights = || last.iter().map(|record| record.pose.position().z);
            let (lowest, highest) =
                (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
            let depth_m = load_n / wall.stiffness_n_per_m;
            // At rest but for the noise of the sensors: a limit cycle has tenths of the depth.
            assert!(highest - lowest < 0.03 * depth_m, "{what}: {lowest} to {highest}, depth {depth_m}");
            let middle = 0.5 * (lowest + highest);
            let rest_m = -(wall.begins_m[2] + depth_m);
            // The field of preset full is uneven.
            let is_there = (middle - rest_m).abs() < 0.03 * depth_m;
            assert!(preset == "full" || is_there, "{what}: {middle}, not {rest_m}");
        }
    }
}

/// A handle under its weight, which no hand holds, on the wall at the end of its range: 5 N, where the device has more force. At a limit of
/// the force itself nothing more pushes back: nine tenths of it there (Inverse3, Touch).
#[test]
fn a_weight_on_the_wall_of_every_kind_of_device_comes_to_rest() {
    let folder = build_folder().join("deps");
    let registry = Registry::search(&[folder]).with_linked(&handle::ENTRY).expect("it is a plugin");
    for kind in KINDS {
        let rates = [250_u32, 500, 1000, 2000, 4000];
        for rate_hz in rates.into_iter().filter(|rate_hz| f64::from(*rate_hz) <= kind.fastest_hz) {
            let period_ns = 1_000_000_000 / u64::from(rate_hz);
            let wall =
                RenderedBoundary::new(&Boundary::default(), &kind.capabilities(), &Bound::NONE, period_ns);
            let least_n = kind.max_force_n.min(5.0);
            assert!(wall.holds_n > 0.999 * least_n, "{} at {rate_hz} Hz: {wall:?}", kind.name);
            let weight_n = if kind.max_force_n > 5.0 { 5.0 } else { 0.9 * kind.max_force_n };
            let run = watch_with(
                &registry,
                &format!(
                    "duration_s = 8\nrate_hz = {rate_hz}\n[device]\nplugin = \"handle\"\n[device.parameters]\n\
                     kind = \"{}\"\nweight_n = {weight_n}\nstart_z_mm = {}\n[[model]]\nplugin = \"load\"\n\
                     [model.parameters]\nforce_n = 0\n",
                    kind.name,
                    -wall.begins_m[2] * 1.0e3
                ),
            );
            let what = format!("{}, {weight_n:.2} N at {rate_hz} Hz", kind.name);
            assert_eq!(run.outcome.end, RunEnd::Finished, "{what}");
            let depth_m = weight_n / wall.stiffness_n_per_m;
            let rest_m = -(wall.begins_m[2] + depth_m);
            let last = run.records.get(run.records.len() * 3 / 4..).unwrap_or_default();
            let off_m =
                last.iter().map(|record| (record.pose.position().z - rest_m).abs()).fold(0.0, f64::max);
            println!("{what}: {:.3} mm deep, {:.1e} of that off", depth_m * 1.0e3, off_m / depth_m);
            // The oscillation has decayed.
            assert!(!last.is_empty() && off_m < 0.01 * depth_m, "{what}: {off_m} m off");
        }
    }
}

/// A cap that acts is reported before the run; a wall as the scene says is not.
#[test]
fn a_softer_wall_than_the_scene_says_is_reported_at_the_start() {
    let notices = |preset| prepared(Clock::Virtual, &scene(preset, 1, 1000, 0.0, 1.0)).notices();
    assert_eq!(notices("plain"), Vec::<String>::new());
    let told = notices("full");
    assert!(told.iter().any(|told| told.contains("2500 N/m instead of 7500")), "{told:?}");
}

/// The chapter prints the limit, the wall of the flotor, and the force where that is less than 5 N, by rate and latency.
#[test]
fn the_book_prints_the_walls_of_the_flotor() {
    let boundary = Boundary::default();
    for (rate_hz, latency_ticks, loop_text) in [
        (1000, 0, "1 kHz, no latency"),
        (1000, 1, "1 kHz, 1 ms"),
        (1000, 2, "1 kHz, 2 ms"),
        (1000, 3, "1 kHz, 3 ms"),
        (250, 0, "250 Hz, no latency"),
        (100, 0, "100 Hz, no latency"),
    ] {
        let wall = wall(latency_ticks, rate_hz);
        let sampled =
            SampledLoop { period_s: 1.0 / f64::from(rate_hz), latency_s: f64::from(latency_ticks) * 1.0e-3 };
        let limit = sampled.stability_limit(0.0, Damper::OneWay(boundary.damping_ns_per_m));
        let [limit, stiffness] = [limit, wall.stiffness_n_per_m]
            .map(|stiffness| format!("{:.1}", stiffness * 1.0e-3).trim_end_matches(".0").to_owned());
        let takes =
            if wall.holds_n < 4.999 { format!(", takes {:.1} N", wall.holds_n) } else { String::new() };
        let begins_mm = wall.begins_m[2] * 1.0e3;
        assert_chapter_prints(
            "safety-envelope.md",
            &format!("| {loop_text} | {limit} kN/m | {stiffness} kN/m | {begins_mm:.1} mm{takes} |"),
        );
    }
}
