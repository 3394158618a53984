//! Nearest point that satisfies up to four linear inequalities.

use crate::contacts::MOST_CONTACTS;
use flotor_hal::DVec3;

/// Condition `normal . y >= least_m` on a displacement `y`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Plane {
    pub(crate) normal: DVec3,
    pub(crate) least_m: f64,
}

/// Largest violation of a condition that counts as rounding error, m.
const ROUNDING_M: f64 = 1.0e-13;

/// Returns the multipliers of the conditions `subset`, held with equality, and the displacement nearest to `to_m`.
fn equal(planes: &[Plane], subset: &[usize], to_m: DVec3) -> Option<(DVec3, [f64; 3])> {
    let mut matrix = [[0.0; 4]; 3];
    let n = subset.len();
    for (row, &i) in subset.iter().enumerate() {
        for (column, &j) in subset.iter().enumerate() {
            matrix[row][column] = planes[i].normal.dot(planes[j].normal);
        }
        matrix[row][3] = planes[i].least_m - planes[i].normal.dot(to_m);
    }
    for column in 0..n {
        let pivot = matrix[column];
        // Nearly parallel planes determine no line.
        if pivot[column] < 1.0e-9 {
            return None;
        }
        for row in (0..n).filter(|&row| row != column) {
            let share = matrix[row][column] / pivot[column];
            matrix[row].iter_mut().zip(pivot).for_each(|(x, p)| *x -= share * p);
        }
    }
    let mut multipliers = [0.0; 3];
    let mut y_m = to_m;
    for (k, &i) in subset.iter().enumerate() {
        multipliers[k] = matrix[k][3] / matrix[k][k];
        y_m += planes[i].normal * multipliers[k];
    }
    Some((y_m, multipliers))
}

/// Returns the displacement nearest to `to_m` that satisfies all conditions, and the active conditions; `None` if none satisfies them.
/// Real-time: bounded, no allocation.
pub(crate) fn project(planes: &[Plane], to_m: DVec3) -> Option<(DVec3, [bool; MOST_CONTACTS])> {
    let count = planes.len();
    let mut best: Option<(f64, DVec3, usize)> = None;
    for mask in 0..1_usize << count {
        let mut subset = [0; 3];
        let mut size = 0;
        if mask.count_ones() > 3 {
            continue;
        }
        for i in (0..count).filter(|i| mask >> i & 1 == 1) {
            subset[size] = i;
            size += 1;
        }
        let Some((y_m, multipliers)) = equal(planes, &subset[..size], to_m) else { continue };
        let is_allowed = multipliers[..size].iter().all(|m| *m >= -ROUNDING_M)
            && planes.iter().all(|plane| plane.normal.dot(y_m) >= plane.least_m - ROUNDING_M);
        let far_m = (y_m - to_m).length();
        if is_allowed && best.is_none_or(|(least_m, ..)| far_m < least_m) {
            best = Some((far_m, y_m, mask));
        }
    }
    best.map(|(_, y_m, mask)| (y_m, std::array::from_fn(|i| mask >> i & 1 == 1)))
}
