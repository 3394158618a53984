//! Lanes against scalars: every operation gives the same bits.

use flotor_hal::math;
use pulp::{Arch, Simd, WithSimd};

use super::{Real, Vector, Wide, polynomial};

/// Every kind of number: signs, zeros, subnormal, huge, not finite.
const NUMBERS: [f64; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.1,
    -3.7,
    1e-310,
    -1e-300,
    1e300,
    -1e308,
    f64::INFINITY,
    f64::NEG_INFINITY,
    f64::NAN,
    2.5,
    1e-9,
    -60.0,
];

/// One of everything, over any number.
fn everything<R: Real>(a: R, b: R) -> [R; 15] {
    let v = Vector::new(a, b, a + 1.5);
    let (big, small) = (a.above(0.5), b.below(0.5));
    let [value, slope] = polynomial(a, &[1.0, 0.1, -2.0, 0.5, 0.25, -0.1]);
    [
        a + b,
        a - b,
        a * b,
        a / b,
        -a,
        a.sqrt(),
        a.abs().inverse(),
        a.at_least(-1.0).at_most(3.0),
        R::select(big & small, a, b * 2.0 - 1.0),
        R::select(big | b.finite(), a.map(math::tanh), b),
        v.dot(v + v),
        v.cross(Vector::new(b, a, b) * a - v).x,
        a * b + a,
        value,
        slope,
    ]
}

/// Not a number is one like any other.
fn is_same(found: f64, expected: f64) -> bool {
    found.to_bits() == expected.to_bits() || (found.is_nan() && expected.is_nan())
}

struct InLanes;

impl WithSimd for InLanes {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for shift in 0..NUMBERS.len() {
            let mut other = NUMBERS;
            other.rotate_left(shift);
            let (a, _) = S::as_simd_f64s(&NUMBERS);
            let (b, _) = S::as_simd_f64s(&other);
            for (group, (a, b)) in a.iter().zip(b).enumerate() {
                let wide = everything(Wide::new(simd, *a), Wide::new(simd, *b));
                for (operation, result) in wide.iter().enumerate() {
                    for lane in 0..S::F64_LANES {
                        let index = group * S::F64_LANES + lane;
                        let scalar = everything(NUMBERS[index], other[index])[operation];
                        let found = pulp::bytemuck::cast_slice::<S::f64s, f64>(&[result.lanes()])[lane];
                        let same = is_same(found, scalar);
                        assert!(same, "operation {operation} of {} and {}", NUMBERS[index], other[index]);
                    }
                }
            }
        }
    }
}

#[test]
fn lanes_hold_the_bits_of_the_scalar() {
    Arch::new().dispatch(InLanes);
    Arch::Scalar.dispatch(InLanes);
    #[cfg(target_arch = "x86_64")]
    if let Some(avx2) = pulp::x86::V3::try_new() {
        Arch::V3(avx2).dispatch(InLanes);
    }
}

#[test]
fn a_mask_is_any_if_one_lane_is() {
    assert!(f64::any(1.0.above(0.5)) && !f64::any(f64::NAN.above(0.5)) && !f64::any(f64::NAN.below(0.5)));
}
