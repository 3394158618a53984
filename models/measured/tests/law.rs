//! The measured spring against its table: through the knots, monotone between them, the gradient of its energy, and nothing
//! but a readable refusal for a table that is none.

use flotor_measured::curve::{Curve, CurveError};
use flotor_measured::table::parse;

/// Play, a straight part, and coils that touch.
const KNOTS: [(f64, f64); 7] =
    [(0.0, 0.0), (0.0005, 0.0), (0.002, 1.1), (0.005, 3.2), (0.008, 5.3), (0.009, 7.5), (0.0095, 12.0)];

#[test]
fn the_curve_goes_through_its_knots_and_is_monotone_between_them() {
    let curve = Curve::new(&KNOTS).unwrap();
    for (compression_m, force_n) in KNOTS {
        assert!((curve.at(compression_m).0 - force_n).abs() < 1.0e-12, "{compression_m}");
    }
    let mut before_n = 0.0;
    for step in 0..=20_000_u32 {
        let force_n = curve.at(f64::from(step) * 0.5e-6).0;
        assert!(force_n >= before_n - 1.0e-12, "it falls at {step}");
        before_n = force_n;
    }
}

/// A straight table is a straight spring, to rounding: nothing is added.
#[test]
fn a_straight_table_is_a_linear_spring() {
    let knots: Vec<(f64, f64)> = (0..=12).map(|i| (f64::from(i) * 1.0e-3, f64::from(i) * 0.68)).collect();
    let curve = Curve::new(&knots).unwrap();
    for step in 0..=1300_u32 {
        let x_m = f64::from(step) * 1.0e-5;
        let (force_n, energy_j) = curve.at(x_m);
        assert!((force_n - 680.0 * x_m).abs() < 1.0e-11, "{x_m}: {force_n}");
        assert!((energy_j - 340.0 * x_m * x_m).abs() < 1.0e-13, "{x_m}: {energy_j}");
    }
}

/// Force is the slope of the energy: central differences of 1e-7 m leave the third derivative times 1e-14 / 6.
#[test]
fn force_is_the_gradient_of_the_energy() {
    const STEP_M: f64 = 1.0e-7;
    let curve = Curve::new(&KNOTS).unwrap();
    for tenth in 0..110_u32 {
        let x_m = (f64::from(tenth) + 0.37) * 1.0e-4;
        let slope_n = (curve.at(x_m + STEP_M).1 - curve.at(x_m - STEP_M).1) / (2.0 * STEP_M);
        assert!((curve.at(x_m).0 - slope_n).abs() < 1.0e-6, "{x_m}: {slope_n}");
    }
}

#[test]
fn above_its_free_length_the_spring_lies_loose_and_below_the_table_it_goes_on_straight() {
    let curve = Curve::new(&KNOTS).unwrap();
    assert_eq!(curve.at(-0.003), (0.0, 0.0));
    let [a, b, c] = [0.0096, 0.0106, 0.0116].map(|x_m| curve.at(x_m).0);
    assert!(a > 12.0 && ((c - b) - (b - a)).abs() < 1.0e-9);
}

#[test]
fn what_is_no_curve_is_refused() {
    assert_eq!(Curve::new(&KNOTS[..2]), Err(CurveError::Count(2)));
    assert_eq!(Curve::new(&KNOTS[1..]), Err(CurveError::Start));
    let falling = [(0.0, 0.0), (0.001, 2.0), (0.002, 1.9)];
    assert_eq!(Curve::new(&falling), Err(CurveError::Order(2)));
    let twice = [(0.0, 0.0), (0.001, 1.0), (0.001, 2.0)];
    assert_eq!(Curve::new(&twice), Err(CurveError::Order(2)));

    let refused = |text: &str| parse(text).unwrap_err().in_file("c");
    assert!(refused("").starts_with("c:1: the table is empty"));
    assert!(
        refused("compression_mm,force_n\n0,0\n1,2\n")
            .starts_with("c:3: the number of rows up to this line is 2")
    );
    assert!(refused("compression_mm,force_n\n1,0\n2,3\n3,4\n").starts_with("c:2: the first row"));
    assert!(refused("length_mm,force_n\n25,0\n").starts_with("c:1: the header"));
    assert!(
        refused("compression_mm,force_n\n0,0\n1;2\n").starts_with("c:3: the line has 1 cell for 2 columns")
    );
    assert!(refused("compression_mm,force_n\n0,0\n1,nan\n").starts_with("c:3: `force_n` must be finite"));
    assert!(
        refused("# bench\ncompression_mm,force_n\n0,0\n2,3\n1,4\n")
            .starts_with("c:5: the compression does not increase: 2.000000 mm")
    );
    assert!(parse("# bench\n\ncompression_mm, force_n\n0, 0\n1, 2\n2, 4\n").is_ok());
}
