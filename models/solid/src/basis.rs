//! One-dimensional numerics: nodes of finite elements, quadrature rules, Lagrange polynomials.

/// Quadrature rule on -1..1.
#[derive(Clone, Debug)]
pub struct Rule {
    /// Points, ascending.
    pub points: Vec<f64>,
    /// Weights; their sum is 2.
    pub weights: Vec<f64>,
}

/// Returns the Legendre polynomial of a degree and its derivative, at a point inside -1..1.
fn legendre(degree: usize, x: f64) -> (f64, f64) {
    let (mut before, mut value) = (1.0, x);
    for k in 2..=degree {
        let k = k as f64;
        (before, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * before) / k);
    }
    (value, degree as f64 * (x * value - before) / (x * x - 1.0))
}

/// Finds the root of a function in a bracket, by bisection to the last bit.
fn bisect(mut low: f64, mut high: f64, function: impl Fn(f64) -> f64) -> f64 {
    let rising = function(high) > 0.0;
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if (function(middle) > 0.0) == rising { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

/// Finds all roots inside -1..1 of a function that has exactly `count`, by a fine search for sign changes.
fn roots(count: usize, function: impl Fn(f64) -> f64) -> Vec<f64> {
    let cells = 1000 * count.max(1) + 1; // odd, so that zero is not a cell border
    let at = |i: usize| -1.0 + 2.0 * (i as f64 + 0.5) / (cells as f64 + 1.0);
    let mut found = Vec::with_capacity(count);
    for i in 0..cells {
        if (function(at(i)) > 0.0) != (function(at(i + 1)) > 0.0) {
            found.push(bisect(at(i), at(i + 1), &function));
        }
    }
    found
}

/// Returns the Gauss-Legendre rule, exact for polynomials of degree `2 count - 1`; `count` at least 2. Not real-time.
#[must_use]
pub fn gauss(count: usize) -> Rule {
    let points = roots(count, |x| legendre(count, x).0);
    let weights = points
        .iter()
        .map(|&x| {
            let slope = legendre(count, x).1;
            2.0 / ((1.0 - x * x) * slope * slope)
        })
        .collect();
    Rule { points, weights }
}

/// Returns the nodes on -1..1 of an element of this order (Gauss-Lobatto): both ends, and the extrema of the Legendre polynomial
/// between them. Order 2 is the ordinary quadratic element. Not real-time.
#[must_use]
pub fn element_points(order: usize) -> Vec<f64> {
    let mut points = vec![-1.0];
    if order > 1 {
        points.extend(roots(order - 1, |x| legendre(order, x).1));
    }
    points.push(1.0);
    points
}

/// Evaluates the Lagrange polynomials of `points` at `x`, into `values`: polynomial `i` is one at point `i` and zero at the
/// other points.
pub fn lagrange(points: &[f64], x: f64, values: &mut [f64]) {
    for (i, value) in values.iter_mut().enumerate() {
        *value = 1.0;
        for (j, &point) in points.iter().enumerate() {
            if j != i {
                *value *= (x - point) / (points[i] - point);
            }
        }
    }
}

/// Evaluates the derivatives of the Lagrange polynomials of `points` at `x`, into `slopes`.
pub fn lagrange_slopes(points: &[f64], x: f64, slopes: &mut [f64]) {
    for (i, slope) in slopes.iter_mut().enumerate() {
        *slope = 0.0;
        for (k, &left_out) in points.iter().enumerate() {
            if k == i {
                continue;
            }
            let mut product = 1.0 / (points[i] - left_out);
            for (j, &point) in points.iter().enumerate() {
                if j != i && j != k {
                    product *= (x - point) / (points[i] - point);
                }
            }
            *slope += product;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_integrate_powers() {
        for count in 2..=12 {
            let rule = gauss(count);
            assert_eq!(rule.points.len(), count);
            for power in 0..2 * count {
                let sum: f64 = rule
                    .points
                    .iter()
                    .zip(&rule.weights)
                    .map(|(x, w)| w * (0..power).fold(1.0, |product, _| product * x))
                    .sum();
                let exact = if power % 2 == 0 { 2.0 / (power as f64 + 1.0) } else { 0.0 };
                assert!((sum - exact).abs() < 1.0e-13, "{count} {power} {sum}");
            }
        }
    }

    #[test]
    fn a_polynomial_goes_through_its_points() {
        for order in 1..=6 {
            let points = element_points(order);
            assert_eq!(points.len(), order + 1);
            let (mut values, mut slopes) = (vec![0.0; order + 1], vec![0.0; order + 1]);
            let x: f64 = 0.3;
            lagrange(&points, x, &mut values);
            lagrange_slopes(&points, x, &mut slopes);
            let power = |x: f64| (0..order).fold(1.0, |product, _| product * x);
            let value: f64 = points.iter().zip(&values).map(|(&p, v)| power(p) * v).sum();
            let slope: f64 = points.iter().zip(&slopes).map(|(&p, s)| power(p) * s).sum();
            assert!((value - power(x)).abs() < 1.0e-14);
            assert!((slope - order as f64 * power(x) / x).abs() < 1.0e-13);
        }
    }
}
