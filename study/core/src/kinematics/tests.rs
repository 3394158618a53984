use super::*;
use std::f64::consts::{PI, TAU};

/// A spring of 1 N/mm swung by 5 mm at 2 Hz for three seconds: everything has a closed form.
#[test]
fn a_swing_on_a_spring_has_its_closed_form() {
    const AMPLITUDE_M: f64 = 5.0e-3;
    const RATE: f64 = TAU * 2.0;
    let mut meter = KinematicsMeter::default();
    for tick in 0..3000_u32 {
        let time_s = f64::from(tick) * 1.0e-3;
        let z_m = AMPLITUDE_M * (RATE * time_s).sin();
        let force_z_n = -1000.0 * z_m;
        meter.take(&Sample {
            dt_s: 1.0e-3,
            z_m,
            velocity_m_per_s: AMPLITUDE_M * RATE * (RATE * time_s).cos(),
            force_z_n,
            force_n: force_z_n.abs() + 0.5,
            out_of_range: false,
        });
    }
    let found = meter.finish().unwrap();
    // Means of |sin| are 2 / pi; sampling at 500 points per cycle leaves less than a thousandth.
    let near =
        |found: f64, expected: f64| assert!((found / expected - 1.0).abs() < 1.0e-3, "{found} {expected}");
    near(found.duration_s, 3.0);
    near(found.mean_speed_m_per_s, AMPLITUDE_M * RATE * 2.0 / PI);
    near(found.mean_acceleration_m_per_s2, AMPLITUDE_M * RATE * RATE * 2.0 / PI);
    near(found.mean_force_n, 1000.0 * AMPLITUDE_M * 2.0 / PI);
    near(found.peak_force_n, 5.5);
    near(found.felt_stiffness_n_per_m.unwrap(), 1000.0);
    // Six cycles begin upwards and end upwards: twelve turns.
    assert_eq!(found.cycles, 6);
    assert!(!meter.out_of_range);
}

#[test]
fn a_handle_at_rest_has_no_stiffness_and_no_cycles() {
    let mut meter = KinematicsMeter::default();
    assert_eq!(meter.finish(), None);
    let still = Sample {
        dt_s: 1.0e-3,
        z_m: -1.0e-3,
        velocity_m_per_s: 0.0,
        force_z_n: 3.0,
        force_n: 3.0,
        out_of_range: false,
    };
    (0..100).for_each(|_| meter.take(&still));
    let found = meter.finish().unwrap();
    assert_eq!((found.felt_stiffness_n_per_m, found.cycles, found.mean_speed_m_per_s), (None, 0, 0.0));
    meter.take(&Sample { force_z_n: f64::NAN, out_of_range: true, ..still });
    assert!(meter.out_of_range);
    assert!((meter.finish().unwrap().mean_force_n - 3.0).abs() < 1.0e-12, "NaN is left out");
}

#[test]
fn tremor_is_no_cycle() {
    let mut meter = KinematicsMeter::default();
    for tick in 0..1000_u32 {
        let z_m = 0.2e-3 * (TAU * 10.0 * f64::from(tick) * 1.0e-3).sin();
        let still = Sample {
            dt_s: 1.0e-3,
            z_m,
            velocity_m_per_s: 0.0,
            force_z_n: 0.0,
            force_n: 0.0,
            out_of_range: false,
        };
        meter.take(&still);
    }
    assert_eq!(meter.finish().unwrap().cycles, 0);
}
