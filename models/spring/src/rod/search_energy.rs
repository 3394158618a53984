//! Energy of the rod and its slope, for a search without second derivatives.
//!
//! The energy is that of [`super::functional`] with ten bubbles and sixteen stations, summed in another way. Stations
//! come in pairs, mirrored about the middle of the rod, and a bubble is even or odd over a pair. So with the half sums
//! and half differences over a pair, half of the products are enough. Numbers are arranged in fours, with one
//! instruction per four: four stations, or the coefficients of two bubbles in both components.

use flotor_hal::glam::{DMat3, DVec2, DVec3};
use pulp::{Simd, cast};

use super::functional::{Ratios, Reading, Shape, solve_symmetric};
use super::plate::Plate;
use super::section::Load;
use flotor_lanes::basis::Basis;
use flotor_lanes::{Real, Wide};

/// Bubbles in each component, coefficients, and stations.
pub(crate) const BUBBLES: usize = 10;
pub(crate) const COEFFICIENTS: usize = 2 * BUBBLES;
pub(crate) const STATIONS: usize = 16;
/// Number of vectors of four numbers that hold all coefficients.
pub(super) const FOURS: usize = COEFFICIENTS / 4;
/// Number of vectors of four numbers that hold one station of each mirrored pair.
const GROUPS: usize = STATIONS / 8;

/// Four numbers in memory.
pub(super) type Four = [f64; 4];
/// Coefficients in fours: `[x, y]` of an even bubble and `[x, y]` of the odd bubble after it.
pub(super) type Fours<S> = [Wide<S>; FOURS];

/// Loads four numbers into a register.
#[inline(always)]
pub(super) fn four<S: Simd>(simd: S, numbers: Four) -> Wide<S> {
    const { assert!(S::F64_LANES == 4) };
    Wide::new(simd, cast(numbers))
}

/// Returns the four numbers of a register.
#[inline(always)]
pub(super) fn numbers<S: Simd>(four: Wide<S>) -> Four {
    cast(four.lanes())
}

/// Transposes four rows of four numbers.
#[inline(always)]
fn turned<S: Simd>(simd: S, rows: [Wide<S>; 4]) -> [Wide<S>; 4] {
    let [a, b, c, d] = [numbers(rows[0]), numbers(rows[1]), numbers(rows[2]), numbers(rows[3])];
    [
        four(simd, [a[0], b[0], c[0], d[0]]),
        four(simd, [a[1], b[1], c[1], d[1]]),
        four(simd, [a[2], b[2], c[2], d[2]]),
        four(simd, [a[3], b[3], c[3], d[3]]),
    ]
}

/// Returns the sums of the numbers of each four.
#[inline(always)]
fn sums<S: Simd>(simd: S, fours: [Wide<S>; 4]) -> Four {
    let [a, b, c, d] = turned(simd, fours);
    numbers((a + c) + (b + d))
}

/// Returns the sum of four numbers.
#[inline(always)]
fn sum<S: Simd>(four: Wide<S>) -> f64 {
    let [a, b, c, d] = numbers(four);
    (a + c) + (b + d)
}

/// Returns the sum of the products of coefficients.
#[inline(always)]
pub(super) fn dot<S: Simd>(a: &Fours<S>, b: &Fours<S>) -> f64 {
    sum(((a[0] * b[0] + a[1] * b[1]) + (a[2] * b[2] + a[3] * b[3])) + a[4] * b[4])
}

/// Tables of [`Basis`], arranged for sums over pairs of mirrored stations.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SearchEnergy {
    /// Weights of the stations in the lower half, and their scaled arc lengths from the middle.
    weight: [Four; GROUPS],
    from_middle: [Four; GROUPS],
    /// Bubbles and their slopes at these stations.
    bubble: [[Four; GROUPS]; BUBBLES],
    slope: [[Four; GROUPS]; BUBBLES],
    /// Bubbles and slopes of each station, each number twice.
    bubble_at: [[Four; FOURS]; STATIONS / 2],
    slope_at: [[Four; FOURS]; STATIONS / 2],
}

/// Four sections.
#[derive(Clone, Copy)]
pub(super) struct Sections<S: Simd> {
    /// `p` and `p'`.
    lean: [Wide<S>; 2],
    rate: [Wide<S>; 2],
    /// `p²`, `w = 2/(1+p²)`, `p x p'` and `p'²`.
    square: Wide<S>,
    scale: Wide<S>,
    area_rate: Wide<S>,
    rate_squared: Wide<S>,
}

/// Sums and differences, over mirrored sections, of the first derivatives with respect to `p` and `p'`.
struct Halves<S: Simd> {
    lean_sum: [Wide<S>; 2],
    lean_difference: [Wide<S>; 2],
    rate_sum: [Wide<S>; 2],
    rate_difference: [Wide<S>; 2],
}

/// Sections of a shape, below the middle and above.
pub(super) type AllSections<S> = [[Sections<S>; 2]; GROUPS];

/// Quantities common to all sections.
pub(super) struct Shared {
    load: Load,
    /// Energy of stretch, shear and twist.
    stretching: f64,
}

impl<S: Simd> Sections<S> {
    #[inline(always)]
    fn new(lean: [Wide<S>; 2], rate: [Wide<S>; 2]) -> Self {
        let ([x, y], [dx, dy]) = (lean, rate);
        let square = x * x + y * y;
        let scale = square.like(2.0) / (square + 1.0);
        Self { lean, rate, square, scale, area_rate: x * dy - y * dx, rate_squared: dx * dx + dy * dy }
    }

    /// Returns the first derivatives of `l` with respect to `p` and `p'` ([`super::section`]), each times the weight.
    #[inline(always)]
    fn slopes(&self, load: &Load, weight: Wide<S>) -> [[Wide<S>; 2]; 2] {
        let ([x, y], [dx, dy], w) = (self.lean, self.rate, self.scale);
        let Load { force, torsion, softening } = *load;
        let level = w * (x * force.x + y * force.y + force.z);
        let stress = (level - force.z) * softening + 1.0;
        // Component along p: of the bending energy and the winding, and of the potential.
        let along = w * (self.area_rate * torsion - w * self.rate_squared) + stress * level;
        let part = weight * w;
        [
            [
                part * (along * x - dy * torsion - stress * force.x),
                part * (along * y + dx * torsion - stress * force.y),
            ],
            [part * (w * dx + y * torsion), part * (w * dy - x * torsion)],
        ]
    }
}

impl SearchEnergy {
    pub(super) fn new() -> Self {
        let basis = Basis::<BUBBLES, STATIONS>::default();
        let lower = |along: &[f64; STATIONS], group: usize| -> Four {
            std::array::from_fn(|lane| along[4 * group + lane])
        };
        let from_middle = basis.station.map(|station| station - 0.5);
        let twice = |at: &[f64; BUBBLES]| -> [Four; FOURS] {
            std::array::from_fn(|j| [at[2 * j], at[2 * j], at[2 * j + 1], at[2 * j + 1]])
        };
        Self {
            weight: std::array::from_fn(|group| lower(&basis.weight, group)),
            from_middle: std::array::from_fn(|group| lower(&from_middle, group)),
            bubble: std::array::from_fn(|k| std::array::from_fn(|group| lower(&basis.bubble[k], group))),
            slope: std::array::from_fn(|k| std::array::from_fn(|group| lower(&basis.slope[k], group))),
            bubble_at: std::array::from_fn(|i| twice(&basis.bubble_at[i])),
            slope_at: std::array::from_fn(|i| twice(&basis.slope_at[i])),
        }
    }

    /// Returns the sections `4 group` to `4 group + 3`, and their mirrored ones.
    #[inline(always)]
    fn group<S: Simd>(&self, simd: S, shape: &[Four; FOURS], end: DVec2, group: usize) -> [Sections<S>; 2] {
        let number = |value: f64| four(simd, [value; 4]);
        let middle = four(simd, self.from_middle[group]);
        let end = [number(end.x), number(end.y)];
        // Even and odd parts about the middle: first of the straight line.
        let (mut lean_even, mut lean_odd) = (end, end);
        let (mut rate_even, mut rate_odd) = (end, end);
        for c in 0..2 {
            lean_even[c] = end[c] * 0.5;
            lean_odd[c] = middle * end[c];
            rate_odd[c] = number(0.0);
        }
        for (j, coefficients) in shape.iter().enumerate() {
            let [bubble_even, bubble_odd] =
                [four(simd, self.bubble[2 * j][group]), four(simd, self.bubble[2 * j + 1][group])];
            // The slope of an even bubble is odd.
            let [slope_odd, slope_even] =
                [four(simd, self.slope[2 * j][group]), four(simd, self.slope[2 * j + 1][group])];
            for c in 0..2 {
                let (even, odd) = (number(coefficients[c]), number(coefficients[2 + c]));
                lean_even[c] = lean_even[c] + bubble_even * even;
                rate_odd[c] = rate_odd[c] + slope_odd * even;
                lean_odd[c] = lean_odd[c] + bubble_odd * odd;
                rate_even[c] = rate_even[c] + slope_even * odd;
            }
        }
        [
            Sections::new(
                [lean_even[0] + lean_odd[0], lean_even[1] + lean_odd[1]],
                [rate_even[0] + rate_odd[0], rate_even[1] + rate_odd[1]],
            ),
            Sections::new(
                [lean_even[0] - lean_odd[0], lean_even[1] - lean_odd[1]],
                [rate_even[0] - rate_odd[0], rate_even[1] - rate_odd[1]],
            ),
        ]
    }

    /// Returns the sections of a shape between plates. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(super) fn sections<S: Simd>(&self, simd: S, shape: &Fours<S>, plate: &Plate) -> AllSections<S> {
        let mut in_memory = [[0.0; 4]; FOURS];
        for (memory, coefficients) in in_memory.iter_mut().zip(shape) {
            *memory = numbers(*coefficients);
        }
        [self.group(simd, &in_memory, plate.lean, 0), self.group(simd, &in_memory, plate.lean, 1)]
    }

    /// Computes stretch, shear and twist of least energy for these sections. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(super) fn shared<S: Simd>(
        &self,
        simd: S,
        ratios: &Ratios,
        sections: &AllSections<S>,
        plate: &Plate,
    ) -> Shared {
        let zero = four(simd, [0.0; 4]);
        let [mut x, mut y, mut drop, mut winding] = [zero; 4];
        let [mut xx, mut xy, mut yy, mut xz] = [zero; 4];
        let mut yz = zero;
        for (mirrored, weight) in sections.iter().zip(&self.weight) {
            for at in mirrored {
                let part = four(simd, *weight) * at.scale;
                let [nx, ny] = [at.scale * at.lean[0], at.scale * at.lean[1]];
                let nz = zero.like(1.0) - at.scale * at.square;
                let [part_x, part_y] = [part * at.lean[0], part * at.lean[1]];
                x = x + part_x;
                y = y + part_y;
                drop = drop + part * at.square;
                winding = winding + part * at.area_rate;
                xx = xx + part_x * nx;
                xy = xy + part_x * ny;
                yy = yy + part_y * ny;
                xz = xz + part_x * nz;
                yz = yz + part_y * nz;
            }
        }
        let [x, y, drop, winding_rad] = sums(simd, [x, y, drop, winding]);
        let [xx, xy, yy, xz] = sums(simd, [xx, xy, yy, xz]);
        let yz = sum(yz);
        // d has the length 1.
        let zz = 1.0 - xx - yy;
        let second = DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]);
        let Ratios { shear_compliance, softening, torsion, .. } = *ratios;
        let compliance = DMat3::from_diagonal(DVec3::splat(shear_compliance)) + softening * second;
        let missing = plate.displacement - DVec3::new(x, y, -drop);
        let twist_rad = plate.turn_rad - winding_rad;
        let force = solve_symmetric(&compliance, missing);
        let load = Load { force, torsion: torsion * twist_rad, softening };
        Shared { load, stretching: 0.5 * (missing.dot(force) + load.torsion * twist_rad) }
    }

    #[inline(always)]
    fn halves<S: Simd>(&self, simd: S, sections: &AllSections<S>, load: &Load, group: usize) -> Halves<S> {
        let weight = four(simd, self.weight[group]);
        let [lower, upper] = &sections[group];
        let [lean, rate] = lower.slopes(load, weight);
        let [mirrored_lean, mirrored_rate] = upper.slopes(load, weight);
        Halves {
            lean_sum: [lean[0] + mirrored_lean[0], lean[1] + mirrored_lean[1]],
            lean_difference: [lean[0] - mirrored_lean[0], lean[1] - mirrored_lean[1]],
            rate_sum: [rate[0] + mirrored_rate[0], rate[1] + mirrored_rate[1]],
            rate_difference: [rate[0] - mirrored_rate[0], rate[1] - mirrored_rate[1]],
        }
    }

    /// Returns the derivatives of the energy with respect to the coefficients. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(super) fn slope<S: Simd>(&self, simd: S, sections: &AllSections<S>, shared: &Shared) -> Fours<S> {
        let (mut by_lean, mut by_rate) = ([four(simd, [0.0; 4]); FOURS], [four(simd, [0.0; 4]); FOURS]);
        for group in 0..GROUPS {
            let Halves { lean_sum, lean_difference, rate_sum, rate_difference } =
                self.halves(simd, sections, &shared.load, group);
            let lean = turned(simd, [lean_sum[0], lean_sum[1], lean_difference[0], lean_difference[1]]);
            let rate = turned(simd, [rate_difference[0], rate_difference[1], rate_sum[0], rate_sum[1]]);
            for i in 0..4 {
                let (bubble, slope) = (&self.bubble_at[4 * group + i], &self.slope_at[4 * group + i]);
                for j in 0..FOURS {
                    by_lean[j] = by_lean[j] + lean[i] * four(simd, bubble[j]);
                    by_rate[j] = by_rate[j] + rate[i] * four(simd, slope[j]);
                }
            }
        }
        for (sum, by_rate) in by_lean.iter_mut().zip(&by_rate) {
            *sum = *sum + *by_rate;
        }
        by_lean
    }

    /// Returns the energy and its derivatives with respect to the plate. Real-time: bounded, no allocation.
    #[inline(always)]
    pub(super) fn reading<S: Simd>(&self, simd: S, sections: &AllSections<S>, shared: &Shared) -> Reading {
        let zero = four(simd, [0.0; 4]);
        let (mut bending, mut by_end) = (zero, [zero; 2]);
        for group in 0..GROUPS {
            let weight = four(simd, self.weight[group]);
            for at in &sections[group] {
                bending = bending + weight * (at.scale * at.scale * at.rate_squared);
            }
            let middle = four(simd, self.from_middle[group]);
            let Halves { lean_sum, lean_difference, rate_sum, .. } =
                self.halves(simd, sections, &shared.load, group);
            for c in 0..2 {
                by_end[c] = by_end[c] + (lean_sum[c] * 0.5 + middle * lean_difference[c] + rate_sum[c]);
            }
        }
        Reading {
            energy: 0.5 * sum(bending) + shared.stretching,
            force: shared.load.force,
            by_lean: DVec2::new(sum(by_end[0]), sum(by_end[1])),
            torsion: shared.load.torsion,
        }
    }
}

/// Returns the coefficients in the sequence of [`super::functional`].
#[inline(always)]
pub(super) fn in_order<S: Simd>(shape: &Fours<S>) -> Shape<COEFFICIENTS> {
    let mut ordered = [0.0; COEFFICIENTS];
    for (j, coefficients) in shape.iter().enumerate() {
        let [even_x, even_y, odd_x, odd_y] = numbers(*coefficients);
        (ordered[2 * j], ordered[2 * j + 1]) = (even_x, odd_x);
        (ordered[BUBBLES + 2 * j], ordered[BUBBLES + 2 * j + 1]) = (even_y, odd_y);
    }
    ordered
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;
    use crate::rod::contact::Coils;
    use crate::rod::functional::Functional;
    use pulp::Scalar256b;

    #[test]
    fn the_sums_are_those_of_the_functional() {
        let ratios = Ratios::new(&Preset::Thesis1.spring(), Coils::Pass);
        let functional = Functional::<BUBBLES, COEFFICIENTS, STATIONS>::new(ratios);
        let plate =
            Plate { displacement: DVec3::new(0.2, -0.1, -0.4), lean: DVec2::new(0.15, -0.2), turn_rad: 0.4 };
        let simd = Scalar256b;
        let shape: Fours<_> = std::array::from_fn(|j| {
            let size = 0.1 / (1.0 + j as f64);
            four(simd, [size, -0.7 * size, 0.4 * size, 0.9 * size])
        });
        let expected = functional.value(&in_order(&shape), &plate);
        let energy = SearchEnergy::new();
        let sections = energy.sections(simd, &shape, &plate);
        let shared = energy.shared(simd, &ratios, &sections, &plate);
        let reading = energy.reading(simd, &sections, &shared);
        // Rounding of sums of sixteen products, and of the force, which a compliance of a hundredth divides.
        let tolerance = 1e-13 * (1.0 + expected.load.force.length());
        assert!((reading.energy - expected.energy).abs() < tolerance);
        assert!((reading.force - expected.load.force).length() < tolerance);
        assert!((reading.by_lean - expected.by_lean).length() < tolerance);
        assert!((reading.torsion - expected.load.torsion).abs() < tolerance);
        let slope = in_order(&energy.slope(simd, &sections, &shared));
        for (slope, expected) in slope.iter().zip(&expected.slope) {
            assert!((slope - expected).abs() < tolerance, "{slope} {expected}");
        }
    }
}
