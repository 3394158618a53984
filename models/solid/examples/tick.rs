//! What a sphere on a block costs: preparation, and a tick along a smooth press, by place and resolution.

use flotor_hal::DVec3;
use flotor_solid::law::{Body, Description, Law, Tool};
use flotor_solid::remainder::Size;
use std::time::Instant;

/// Ticks of one press.
const TICKS: usize = 20_000;

/// The value below which a share of ascending numbers lies.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
fn quantile(ascending: &[f64], share: f64) -> f64 {
    ascending[((ascending.len() - 1) as f64 * share).round() as usize]
}

fn main() {
    let size = Size { half_x_m: 0.04, half_y_m: 0.04, height_m: 0.08 };
    for (resolution, name) in ["quick", "standard", "fine"].into_iter().enumerate() {
        let tool = Tool::Sphere { radius_m: 0.0127 };
        let description = Description { body: Body::Block(size), tool, poisson_ratio: 0.3, resolution };
        let start = Instant::now();
        let solved = description.solve();
        let prepared_s = start.elapsed().as_secs_f64();
        let Ok((Law::Sphere(atlas), mesh_error)) = solved else {
            println!("{name}: no solid");
            continue;
        };
        println!("{name}: prepared in {prepared_s:.1} s, mesh error {mesh_error:.4}");
        for (place, from, inwards) in [
            ("centre", DVec3::new(0.0, 0.0, 0.0137), DVec3::NEG_Z),
            ("edge", DVec3::new(0.033, 0.01, 0.0137), DVec3::NEG_Z),
            ("side", DVec3::new(0.0537, 0.007, -0.025), DVec3::NEG_X),
            ("no contact", DVec3::new(0.0, 0.0, 0.05), DVec3::Z),
        ] {
            let mut times_ns: Vec<f64> = Vec::with_capacity(TICKS);
            let mut sum = 0.0;
            for tick in 0..TICKS {
                let centre_m = from + inwards * (0.01 * tick as f64 / TICKS as f64);
                let start = Instant::now();
                sum += atlas.answer(centre_m.to_array()).energy.value;
                times_ns.push(start.elapsed().as_secs_f64() * 1.0e9);
            }
            times_ns.sort_by(f64::total_cmp);
            println!(
                "  {place}: median {:.0} ns, p99.9 {:.0} ns (sum {sum:.3e})",
                quantile(&times_ns, 0.5),
                quantile(&times_ns, 0.999)
            );
        }
    }
}
