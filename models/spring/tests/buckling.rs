//! Where the straight spring buckles between clamped plates, by the printed law and by the rod, and what the book prints of it.

use crate::printed::assert_chapter_prints;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::pose::Pose;
use flotor_spring::precision::Precision;
use flotor_spring::preset::Preset;
use flotor_spring::response::Demand;
use flotor_spring::rigidity::{Rigidities, Spring};
use flotor_spring::rod::{Accuracy, Rod};
use flotor_spring::thesis::Thesis;
use std::f64::consts::PI;

/// Haringx's compression at which a column between clamped plates buckles, a share of its length: the lesser root of
/// `(gamma L0²/alpha) p (1 - (1 - gamma/beta) p) = 4 pi²`.
fn haringx(spring: &Spring) -> Option<f64> {
    let Rigidities { alpha_n_m2, beta_n, gamma_n, .. } = *spring.rigidities();
    let slenderness = gamma_n * spring.geometry().free_length_m.powi(2) / alpha_n_m2;
    let shear = 1.0 - gamma_n / beta_n;
    let discriminant = 1.0 - 16.0 * PI * PI * shear / slenderness;
    (discriminant >= 0.0).then(|| (1.0 - discriminant.sqrt()) / (2.0 * shear))
}

/// Whether the rod, led down the axis from rest, pushes less than a straight one: it bulges.
fn bulges(spring: &Spring, compression: f64) -> bool {
    let mut rod = Rod::new(spring, Accuracy::Servo);
    let mut force_n = 0.0;
    for step in 0..2000 {
        let part = compression * (f64::from(step) / 200.0).min(1.0);
        let position_m = DVec3::NEG_Z * part * spring.geometry().free_length_m;
        force_n = rod.step(&Pose { position_m, orientation: DQuat::IDENTITY }, Demand::Force).force_n.z;
    }
    // Just past buckling the force lags behind by a few per cent of the way past; the rod's own error is below 1e-9.
    force_n < spring.rigidities().gamma_n * compression * (1.0 - 1.0e-6)
}

#[test]
fn the_book_prints_where_each_spring_buckles() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        let (_, _, stiffness) = preset.parameters();
        let length_m = Thesis::new(&spring, stiffness, Precision::Double).buckling_length_m();
        let printed = 1.0 - length_m / spring.geometry().free_length_m;
        let rod = haringx(&spring);
        match rod {
            Some(compression) => {
                assert!(!bulges(&spring, compression - 1.0e-3), "{preset:?} bulges before {compression}");
                assert!(bulges(&spring, compression + 1.0e-3), "{preset:?} is straight after {compression}");
            }
            None => assert!(!bulges(&spring, 0.9), "{preset:?} bulges"),
        }
        let name = preset.name().replace("thesis-", "spring ");
        let first = if preset == Preset::Thesis1 { " buckles at" } else { "" };
        let name = if preset == Preset::Slender { format!("`{name}`") } else { name };
        let share = |compression: f64| {
            let percent = format!("{:.1}", 100.0 * compression);
            format!("{} %", percent.trim_end_matches(".0"))
        };
        let rod = rod.map_or("never".to_owned(), share);
        let row = format!("| {name}{first} | {} | {rod} |", share(printed));
        assert_chapter_prints("models/spring/rod.md", &row);
    }
}

#[test]
fn the_book_prints_the_wires_and_coils_of_the_presets() {
    for preset in Preset::ALL {
        let spring = preset.spring();
        let geometry = spring.geometry();
        let [free, wire, coil] =
            [geometry.free_length_m, geometry.wire_diameter_m, geometry.coil_diameter_m].map(|m| m * 1e3);
        let gamma = match preset {
            Preset::Slender => "from the wire".to_owned(),
            _ => spring.rigidities().gamma_n.to_string(),
        };
        let row = format!(
            "| `{}` | {free} | {wire} | {coil} | {} | {gamma} |",
            preset.name(),
            geometry.active_coils
        );
        assert_chapter_prints("spring.md", &row);
    }
}
