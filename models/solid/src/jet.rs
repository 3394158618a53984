//! Number with its derivatives along x, y and z: forces are exact derivatives of an energy, never differences.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Value with its gradient. Real-time: bounded, no allocation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[must_use]
pub struct Jet {
    /// Value of the number.
    pub value: f64,
    /// Derivatives along x, y, z.
    pub slope: [f64; 3],
}

impl Jet {
    /// Creates a number with zero slope.
    pub const fn constant(value: f64) -> Self {
        Self { value, slope: [0.0; 3] }
    }

    /// Creates a coordinate: slope one along `axis`.
    pub fn variable(value: f64, axis: usize) -> Self {
        let mut slope = [0.0; 3];
        slope[axis] = 1.0;
        Self { value, slope }
    }

    /// Applies a function, given its value and derivative at this number.
    pub fn chain(self, value: f64, derivative: f64) -> Self {
        Self { value, slope: self.slope.map(|s| s * derivative) }
    }

    /// Returns the square root; slope zero at zero, as for a length at the origin.
    pub fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        self.chain(root, if root > 0.0 { 0.5 / root } else { 0.0 })
    }

    /// Returns the reciprocal.
    pub fn recip(self) -> Self {
        let inverse = 1.0 / self.value;
        self.chain(inverse, -inverse * inverse)
    }

    /// Returns the absolute value.
    pub fn abs(self) -> Self {
        if self.value < 0.0 { -self } else { self }
    }
}

impl Add for Jet {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: [0, 1, 2].map(|i| self.slope[i] + other.slope[i]) }
    }
}

impl Sub for Jet {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: [0, 1, 2].map(|i| self.slope[i] - other.slope[i]) }
    }
}

impl Mul for Jet {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl)] // the product rule
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            slope: [0, 1, 2].map(|i| self.slope[i] * other.value + self.value * other.slope[i]),
        }
    }
}

impl Div for Jet {
    type Output = Self;
    #[allow(clippy::suspicious_arithmetic_impl)] // its derivative is in the reciprocal
    fn div(self, other: Self) -> Self {
        self * other.recip()
    }
}

impl Neg for Jet {
    type Output = Self;
    fn neg(self) -> Self {
        Self { value: -self.value, slope: self.slope.map(|s| -s) }
    }
}

impl Add<f64> for Jet {
    type Output = Self;
    fn add(self, other: f64) -> Self {
        Self { value: self.value + other, ..self }
    }
}

impl Sub<f64> for Jet {
    type Output = Self;
    fn sub(self, other: f64) -> Self {
        Self { value: self.value - other, ..self }
    }
}

impl Mul<f64> for Jet {
    type Output = Self;
    fn mul(self, other: f64) -> Self {
        Self { value: self.value * other, slope: self.slope.map(|s| s * other) }
    }
}
