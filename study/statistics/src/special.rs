//! Incomplete beta function, from which the tail probabilities of t and F are computed.

/// Maximum number of terms of the continued fraction. The number needed is about the square root of the larger argument, so
/// this limit suffices for ten million degrees of freedom.
const FRACTION_TERMS_MOST: u32 = 10_000;
/// Lower limit of the denominators of the continued fraction (Lentz's method).
const TINY: f64 = 1.0e-300;

/// Returns the regularised incomplete beta function I_x(a, b). The caller passes `y = 1 - x` as well, computed without
/// cancellation.
///
/// Uses the continued fraction of Abramowitz and Stegun 26.5.8, evaluated forward (Lentz 1976), on the side of the mean where
/// it converges fast. On the other side the result is 1 minus the opposite tail, which is the smaller one: a small result is
/// never computed as a difference.
pub(crate) fn regularised_beta(a: f64, b: f64, x: f64, y: f64) -> f64 {
    if a.is_nan() || b.is_nan() || x.is_nan() {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 0.0;
    }
    if y <= 0.0 {
        return 1.0;
    }
    if x < (a + 1.0) / (a + b + 2.0) { lower_tail(a, b, x, y) } else { 1.0 - lower_tail(b, a, y, x) }
}

/// Returns I_x(a, b) - I_x(a + 1, b), the difference over a unit step of the first argument (Abramowitz and Stegun 26.5.16).
pub(crate) fn beta_step(a: f64, b: f64, x: f64, y: f64) -> f64 {
    front(a, b, x, y) / a
}

fn lower_tail(a: f64, b: f64, x: f64, y: f64) -> f64 {
    front(a, b, x, y) * fraction(a, b, x) / a
}

/// Returns x^a y^b / B(a, b).
fn front(a: f64, b: f64, x: f64, y: f64) -> f64 {
    // Near x = 1, ln(1 - y) is more accurate than ln x.
    let ln_x = if y < 0.5 { libm::log1p(-y) } else { libm::log(x) };
    let ln_y = if x < 0.5 { libm::log1p(-x) } else { libm::log(y) };
    let ln_beta = libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b);
    libm::exp(a * ln_x + b * ln_y - ln_beta)
}

fn fraction(a: f64, b: f64, x: f64) -> f64 {
    let away_from_zero = |value: f64| if value.abs() < TINY { TINY } else { value };
    let mut c = 1.0;
    let mut d = 1.0 / away_from_zero(1.0 - (a + b) * x / (a + 1.0));
    let mut value = d;
    for term in 1..FRACTION_TERMS_MOST {
        let m = f64::from(term);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for numerator in [even, odd] {
            d = 1.0 / away_from_zero(1.0 + numerator * d);
            c = away_from_zero(1.0 + numerator / c);
            change = c * d;
            value *= change;
        }
        if (change - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    value
}

/// Returns the regularised upper incomplete gamma function Q(a, x) for a > 0.
///
/// Uses the series of Abramowitz and Stegun 6.5.29 below the mean, and above it the continued fraction 6.5.31 (Lentz 1976): a small
/// result is never computed as a difference.
pub(crate) fn upper_gamma(a: f64, x: f64) -> f64 {
    if a.is_nan() || x.is_nan() {
        return f64::NAN;
    }
    if x <= 0.0 {
        return 1.0;
    }
    let front = libm::exp(a * libm::log(x) - x - libm::lgamma(a));
    if x < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for index in 1..FRACTION_TERMS_MOST {
            term *= x / (a + f64::from(index));
            sum += term;
            if term <= sum * f64::EPSILON {
                break;
            }
        }
        return 1.0 - front * sum;
    }
    let mut b = x + 1.0 - a;
    let mut c = 1.0 / TINY;
    let mut d = 1.0 / b;
    let mut value = d;
    for index in 1..FRACTION_TERMS_MOST {
        let m = f64::from(index);
        let numerator = -m * (m - a);
        b += 2.0;
        let away_from_zero = |value: f64| if value.abs() < TINY { TINY } else { value };
        d = 1.0 / away_from_zero(numerator * d + b);
        c = away_from_zero(b + numerator / c);
        value *= c * d;
        if (c * d - 1.0).abs() <= f64::EPSILON {
            break;
        }
    }
    front * value
}

#[cfg(test)]
mod tests {
    use super::*;

    /// I_x(a, b) in closed form where one exists: b = 1 gives x^a, a = 1 gives 1 - (1 - x)^b, a = b = 1/2 the
    /// arcsine law.
    #[test]
    fn closed_forms() {
        for x in [1.0e-7, 0.01, 0.3, 0.5, 0.77, 0.999] {
            for a in [0.5, 1.0, 3.5, 40.0] {
                let y = 1.0 - x;
                let near = |found: f64, exact: f64| {
                    assert!((found / exact - 1.0).abs() < 1.0e-12, "x {x}, a {a}: {found} for {exact}");
                };
                near(regularised_beta(a, 1.0, x, y), x.powf(a));
                near(regularised_beta(1.0, a, x, y), -(a * (-x).ln_1p()).exp_m1());
                near(regularised_beta(0.5, 0.5, x, y), x.sqrt().asin() * 2.0 / std::f64::consts::PI);
            }
        }
    }

    /// I_x(a, b) + I_(1-x)(b, a) = 1 across the place where the two branches meet.
    #[test]
    fn both_tails_add_up() {
        for (a, b) in [(0.5, 7.0), (7.0, 0.5), (12.0, 11.0), (300.0, 5.0), (2.0e5, 1.0e5)] {
            for x in [0.1, 0.45, 0.5, 0.66, 0.67, 0.9] {
                let sum = regularised_beta(a, b, x, 1.0 - x) + regularised_beta(b, a, 1.0 - x, x);
                assert!((sum - 1.0).abs() < 1.0e-12, "a {a}, b {b}, x {x}: {sum}");
            }
        }
    }

    /// Q(1, x) is the exponential law, Q(1/2, x) that of the square of a normal number, and Q(a + 1, x) follows from Q(a, x).
    #[test]
    fn upper_gamma_has_its_closed_forms() {
        let near =
            |found: f64, exact: f64| assert!((found / exact - 1.0).abs() < 1.0e-12, "{found} for {exact}");
        for x in [1.0e-3_f64, 0.3, 1.0, 1.7, 6.0, 40.0] {
            near(upper_gamma(1.0, x), (-x).exp());
            near(upper_gamma(0.5, x), libm::erfc(x.sqrt()));
            for a in [0.5, 1.0, 2.5, 9.0] {
                let step = libm::exp(a * libm::log(x) - x - libm::lgamma(a + 1.0));
                near(upper_gamma(a + 1.0, x), upper_gamma(a, x) + step);
            }
        }
        assert_eq!((upper_gamma(2.0, 0.0), upper_gamma(2.0, -1.0)), (1.0, 1.0));
    }
}
