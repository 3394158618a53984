//! How many poses of a moving hand the law `energy` hands over to the exact rod, and what both kinds cost:
//!
//! ```console
//! $ cargo run --release -p flotor-spring --example handed_over
//! ```
//!
//! The hand is that of `flotor bench`: 1 to 3 Hz in all coordinates, ±4 mm about a compression of 4 mm, at 1 kHz; and the
//! same about half the free length, where springs that can buckle have. Times are the fastest of some walks.

use std::f64::consts::TAU;
use std::hint::black_box;
use std::time::Instant;

use flotor_hal::glam::DVec3;
use flotor_spring::hand_over::HandOver;
use flotor_spring::held::HeldSpring;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::Demand;
use flotor_spring::rod::Coils;

const TICKS: u32 = 20_000;
const WALKS: u32 = 5;

fn hand(tick: u32, compression_m: f64) -> Pose {
    let wave = |amplitude: f64, hz: f64| amplitude * (TAU * hz * 1e-3 * f64::from(tick)).sin();
    let position_m = DVec3::new(wave(1.5e-3, 1.37), wave(1.2e-3, 2.11), wave(3e-3, 1.03) - compression_m);
    let rotation_rad = DVec3::new(wave(0.03, 1.71), wave(0.025, 2.53), wave(0.035, 2.97));
    Pose::from_rotation_vector(position_m, rotation_rad)
}

fn main() {
    println!(
        "{:<10}{:>12}{:>14}{:>16}{:>16}",
        "preset", "compression", "handed over", "handed over", "others"
    );
    println!("{:<10}{:>12}{:>14}{:>16}{:>16}", "", "mm", "%", "ns a pose", "ns a pose");
    for preset in Preset::ALL {
        let spring = preset.spring();
        for compression_m in [4e-3, 0.5 * spring.geometry().free_length_m] {
            let mut law = HandOver::new(&spring, Coils::Pass);
            let mut fastest_ns = vec![u128::MAX; TICKS as usize];
            let mut is_handed_over = vec![false; TICKS as usize];
            for _ in 0..WALKS {
                law.reset();
                for (tick, (fastest, handed_over)) in
                    (0..).zip(fastest_ns.iter_mut().zip(&mut is_handed_over))
                {
                    let pose = hand(tick, compression_m);
                    let begin = Instant::now();
                    black_box(law.respond(black_box(&pose), Demand::Wrench));
                    *fastest = begin.elapsed().as_nanos().min(*fastest);
                    *handed_over = law.share() > 0.0;
                }
            }
            let mean = |wanted: bool| {
                let of =
                    fastest_ns.iter().zip(&is_handed_over).filter(|(_, handed_over)| **handed_over == wanted);
                let (sum, count) = of.fold((0, 0), |(sum, count), (ns, _)| (sum + *ns, count + 1));
                (count > 0).then(|| sum / count).map_or_else(|| "-".to_owned(), |ns| ns.to_string())
            };
            let share = is_handed_over.iter().filter(|handed_over| **handed_over).count() as f64;
            println!(
                "{:<10}{:>12.1}{:>14.1}{:>16}{:>16}",
                format!("{preset:?}"),
                compression_m * 1e3,
                100.0 * share / f64::from(TICKS),
                mean(true),
                mean(false)
            );
        }
    }
}
