//! Time and memory of a mesh of a million triangles: `cargo run --release -p flotor-surface --example million`.
#![allow(missing_docs, clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]

use flotor_hal::{DVec3, math};
use flotor_surface::material::Material;
use flotor_surface::object::{Reading, Unit, read};
use flotor_surface::touch::{Materials, Touch};
use std::f64::consts::{PI, TAU};
use std::time::Instant;

/// Bumpy sphere of 40 mm as a binary STL file in millimetres, a globe of rings and meridians.
fn bumpy(rings: u32, meridians: u32) -> Vec<u8> {
    let point = |i: u32, j: u32| {
        let (s, c) = math::sin_cos(f64::from(i) / f64::from(rings) * PI);
        let (sp, cp) = math::sin_cos(f64::from(j % meridians) / f64::from(meridians) * TAU);
        let d = DVec3::new(
            if i.is_multiple_of(rings) { 0.0 } else { s * cp },
            if i.is_multiple_of(rings) { 0.0 } else { s * sp },
            c,
        );
        let bump = 0.6 * math::sin(12.0 * d.x) * math::sin(12.0 * d.y) * math::sin(12.0 * d.z);
        (d * (20.0 + bump)).to_array()
    };
    let mut facets: Vec<[[f64; 3]; 3]> = Vec::new();
    for i in 0..rings {
        for j in 0..meridians {
            let (a, b, c, d) = (point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
            if i + 1 < rings {
                facets.push([a, b, c]);
            }
            if i > 0 {
                facets.push([a, c, d]);
            }
        }
    }
    let mut bytes = vec![0; 80];
    bytes.extend((facets.len() as u32).to_le_bytes());
    for facet in facets {
        bytes.extend([0; 12]);
        facet.as_flattened().iter().for_each(|x| bytes.extend((*x as f32).to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

/// Runs over one path.
const RUNS: usize = 3;

/// Place of the tool in a tick: round the sphere on a rosette beside its poles, 1 mm deep and less.
fn tool_m(tick: f64, speed: f64) -> DVec3 {
    let t = tick * speed / 0.02;
    let (x, y, z) =
        (math::cos(t) * math::cos(0.31 * t), math::sin(t) * math::cos(0.31 * t), math::sin(0.31 * t));
    // Turned by 37 degrees: the triangles about a pole are slivers.
    let d = DVec3::new(0.8 * x - 0.6 * z, y, 0.6 * x + 0.8 * z);
    let bump = 0.6e-3 * math::sin(12.0 * d.x) * math::sin(12.0 * d.y) * math::sin(12.0 * d.z);
    let depth_m = 1.0e-3 * (0.55 + 0.45 * math::sin(0.01 * tick));
    d * (0.02 + bump + 5.0e-4 - depth_m)
}

fn main() {
    let only = std::env::args().nth(1).and_then(|word| word.parse::<u32>().ok());
    let sizes = [(64, 128), (182, 358), (512, 1024)];
    for (rings, meridians) in sizes.into_iter().filter(|(rings, _)| only.is_none_or(|only| only == *rings)) {
        let bytes = bumpy(rings, meridians);
        let started = Instant::now();
        let reading = Reading { unit: Unit::Auto, scale: 1.0, edge_angle_rad: 30.0_f64.to_radians() };
        let object = read("bumpy.stl", bytes, &reading).expect("a mesh");
        let loaded_s = started.elapsed().as_secs_f64();
        let surface = &object.surface;
        println!(
            "{} triangles: loaded in {loaded_s:.2} s, {:.0} bytes each",
            surface.count(),
            surface.bytes() as f64 / surface.count() as f64
        );
        let materials = Materials {
            common: Material {
                stiffness_n_per_m: 1000.0,
                damping_ns_per_m: 0.0,
                static_friction: 0.0,
                kinetic_friction: 0.0,
                viscous_ns_per_m: 0.0,
            },
            own: Vec::new(),
        };
        for (what, speed, friction) in
            [("60 mm/s", 6.0e-5, 0.0), ("200 mm/s", 2.0e-4, 0.0), ("60 mm/s, friction", 6.0e-5, 0.3)]
        {
            let mut materials = materials.clone();
            (materials.common.static_friction, materials.common.kinetic_friction) = (friction, friction);
            let count = 100_000;
            let mut times = vec![f64::INFINITY; count];
            let (mut steps, mut unsettled) = (0.0_f64, 0);
            // Of several runs the shortest time of each tick: another program has the processor in some.
            for _ in 0..RUNS {
                let mut touch = Touch::new(5.0e-4);
                touch.step(surface, &materials, DVec3::new(0.0, 0.0, 0.03), DVec3::ZERO);
                let mut last = DVec3::ZERO;
                unsettled = 0;
                for (i, time) in times.iter_mut().enumerate() {
                    let tool_m = tool_m(i as f64, speed);
                    let started = Instant::now();
                    let answer = touch.step(surface, &materials, tool_m, DVec3::ZERO);
                    *time = time.min(started.elapsed().as_nanos() as f64 * 1.0e-3);
                    unsettled += u32::from(!answer.is_settled);
                    if i > 0 {
                        steps = steps.max((answer.force_n - last).length());
                    }
                    last = answer.force_n;
                }
            }
            times.sort_by(f64::total_cmp);
            let at = |share: f64| times[(share * (count - 1) as f64) as usize];
            println!(
                "  {what}: p50 {:.2} p99 {:.2} p99.9 {:.2} max {:.1} us; largest step {:.3} N; {unsettled} not at rest",
                at(0.5),
                at(0.99),
                at(0.999),
                at(1.0),
                steps
            );
        }
    }
}
