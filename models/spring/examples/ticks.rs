//! What a tick of the exact rod costs, to be counted in instructions:
//!
//! ```console
//! $ cargo build --release -p flotor-spring --example ticks
//! $ valgrind --tool=callgrind --dump-before='*one_tick*' --callgrind-out-file=tick target/release/examples/ticks
//! $ grep -h ^totals tick.*
//! ```
//!
//! Each file holds one tick of a hand that moves at one to three times per second. The argument is the preset's place
//! in the list: 0, 1, 2 for the springs of the thesis, 3 for the slender one, which buckles on the way.

use flotor_hal::glam::DVec3;
use flotor_spring::pose::Pose;
use flotor_spring::preset::Preset;
use flotor_spring::response::Demand;
use flotor_spring::rod::{Accuracy, Rod};
use flotor_spring::validity::Validity;

const TICKS: u32 = 1000;
/// Ticks at the first pose, for the rod to come to rest there.
const HOLDS: u32 = 500;

#[inline(never)]
fn one_tick(rod: &mut Rod, pose: &Pose) -> Validity {
    rod.step(pose, Demand::Wrench).validity
}

fn main() {
    let place = std::env::args().nth(1).and_then(|argument| argument.parse().ok()).unwrap_or(0);
    let preset = Preset::ALL.get(place).copied().unwrap_or(Preset::Thesis1);
    let spring = preset.spring();
    let at = |tick: u32| {
        let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
        let shear_and_height =
            DVec3::new(0.1 * (2.0 * phase).sin(), 0.1 * (3.0 * phase + 1.0).sin(), -0.2 + 0.15 * phase.cos());
        let rotation_rad =
            DVec3::new(0.1 * (1.5 * phase).sin(), 0.1 * (2.5 * phase + 0.4).cos(), 0.1 * phase.sin());
        Pose::from_rotation_vector(shear_and_height * spring.geometry().free_length_m, rotation_rad)
    };
    let mut rod = Rod::new(&spring, Accuracy::Servo);
    for _ in 0..HOLDS {
        let _ = rod.step(&at(0), Demand::Wrench);
    }
    let waited = (1..TICKS).filter(|tick| one_tick(&mut rod, &at(*tick)) == Validity::NotConverged).count();
    println!("{preset:?}: {waited} of {} ticks on their way to an equilibrium", TICKS - 1);
}
