//! Against the certified values of NIST's Statistical Reference Datasets (www.itl.nist.gov/div898/strd), which were
//! computed with five hundred digits.

#![allow(clippy::unwrap_used, clippy::cast_possible_truncation, clippy::cast_sign_loss)] // tests may panic

use flotor_statistics::anova::{BetweenFactor, Design, SumOfSquares, analyse};
use flotor_statistics::regression::line;

const RELATIVE_BOUND: f64 = 1.0e-9;

#[track_caller]
fn near(found: f64, certified: f64) {
    let error = (found / certified - 1.0).abs();
    assert!(error < RELATIVE_BOUND, "{found} for {certified}, relative error {error:e}");
}

/// Norris: 36 readings of an ozone monitor, linear regression, lower difficulty.
#[test]
fn norris() {
    #[rustfmt::skip]
    const POINTS: [(f64, f64); 36] = [
        (0.1, 0.2), (338.8, 337.4), (118.1, 118.2), (888.0, 884.6), (9.2, 10.1), (228.1, 226.5), (668.5, 666.3),
        (998.5, 996.3), (449.1, 448.6), (778.9, 777.0), (559.2, 558.2), (0.3, 0.4), (0.1, 0.6), (778.1, 775.5),
        (668.8, 666.9), (339.3, 338.0), (448.9, 447.5), (10.8, 11.6), (557.7, 556.0), (228.3, 228.1),
        (998.0, 995.8), (888.8, 887.6), (119.6, 120.2), (0.3, 0.3), (0.6, 0.3), (557.6, 556.8), (339.3, 339.1),
        (888.0, 887.2), (998.5, 999.0), (778.9, 779.0), (10.2, 11.1), (117.6, 118.3), (228.9, 229.2),
        (668.4, 669.1), (449.2, 448.9), (0.2, 0.5),
    ];
    let (y, x): (Vec<f64>, Vec<f64>) = POINTS.into_iter().unzip();
    let fit = line(&x, &y).unwrap();
    near(fit.intercept, -0.262_323_073_774_029);
    near(fit.slope, 1.002_116_818_020_45);
    near(fit.intercept_se, 0.232_818_234_301_152);
    near(fit.slope_se, 0.429_796_848_199_937e-3);
    near(fit.r_squared, 0.999_993_745_883_712);
    near(fit.residual_sd * fit.residual_sd, 0.782_864_662_630_069);
    near(fit.f, 5_436_385.540_797_85);
}

/// AtmWtAg: the atomic weight of silver by two instruments, analysis of variance, average difficulty: seven digits are
/// the same in all 48 values.
#[test]
fn atomic_weight_of_silver() {
    /// Digits behind 107.868, in 1e-7.
    #[rustfmt::skip]
    const DIGITS: [u32; 48] = [
        1568, 1465, 1572, 1785, 1446, 1903, 1526, 1494, 1616, 1587, 1519, 1486,
        1419, 1569, 1508, 1672, 1385, 1518, 1662, 1424, 1360, 1333, 1610, 1477,
        1079, 1344, 1513, 1197, 1604, 1385, 1642, 1365, 1151, 1082, 1517, 1448,
        1198, 1482, 1334, 1609, 1101, 1512, 1469, 1360, 1254, 1261, 1450, 1368,
    ];
    let value = |digits: u32| format!("107.868{digits:04}").parse::<f64>().unwrap();
    let responses: Vec<Vec<f64>> = DIGITS.iter().map(|digits| vec![value(*digits)]).collect();
    let groups = (0..48).map(|row| row / 24).collect();
    let instrument = BetweenFactor { name: "instrument".to_owned(), groups };
    let design = Design::new(vec![instrument], vec![], &responses).unwrap();
    for kind in [SumOfSquares::Two, SumOfSquares::Three] {
        let table = analyse(&design, kind);
        assert_eq!(table.len(), 1);
        near(table[0].sum_of_squares, 3.638_341_875_000_00e-9);
        near(table[0].error_sum_of_squares, 1.049_517_291_666_67e-8);
        near(table[0].f, 15.946_733_567_793_0);
        near(table[0].partial_eta_squared, 2.574_265_445_383_21e-1);
        assert_eq!((table[0].df, table[0].error_df), (1.0, 46.0));
    }
}
