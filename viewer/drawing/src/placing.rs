//! Places of the devices of a run in the scene: side by side, each in its own frame, because the positions of their bases are
//! unknown.

use flotor_hal::DVec3;

/// Places of devices along x.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Placing {
    /// Number of devices.
    pub count: usize,
    /// Distance between neighbouring devices, m.
    pub spacing_m: f64,
}

impl Placing {
    /// Places `count` devices side by side, with a spacing for bodies of this height and radius, m.
    #[must_use]
    pub fn of(count: usize, height_m: f64, radius_m: f64) -> Self {
        Self { count, spacing_m: (1.1 * height_m).max(2.6 * radius_m) }
    }

    /// Returns the home position of a device in the scene, m.
    #[must_use]
    pub fn place_m(&self, device: usize) -> DVec3 {
        let middle = 0.5 * (self.count.max(1) - 1) as f64;
        DVec3::X * (self.spacing_m * (device as f64 - middle))
    }

    /// Returns the distance of the first device from the last, m.
    #[must_use]
    pub fn width_m(&self) -> f64 {
        self.spacing_m * (self.count.max(1) - 1) as f64
    }
}

/// Returns the largest of 1, 2 and 5 times a power of ten that is not above a number; 0 unless the number is positive and finite.
#[must_use]
pub fn round_below(number: f64) -> f64 {
    if !(number > 0.0 && number.is_finite()) {
        return 0.0;
    }
    let power = 10.0_f64.powf(number.log10().floor());
    // Slightly above the number, to allow for the rounding of the power.
    let mut all = [5.0, 2.0, 1.0].into_iter().map(|k| k * power);
    all.find(|round| *round <= number * (1.0 + 1.0e-9)).unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_stand_beside_each_other_about_the_middle() {
        let placing = Placing::of(2, 0.025, 0.006);
        assert_eq!(placing.place_m(0), -placing.place_m(1));
        assert!(placing.place_m(1).x > 0.012);
        assert_eq!(Placing::of(1, 0.025, 0.006).place_m(0), DVec3::ZERO);
        assert_eq!(Placing::of(1, 0.025, 0.006).width_m(), 0.0);
    }

    #[test]
    fn round_numbers_are_not_above() {
        let round = [0.99, 1.0, 4.9, 5.0, 0.3, 7e-3].map(round_below);
        let expected = [0.5, 1.0, 2.0, 5.0, 0.2, 5e-3];
        assert!(round.iter().zip(expected).all(|(a, b)| (a / b - 1.0_f64).abs() < 1e-9), "{round:?}");
        assert_eq!([0.0, -1.0, f64::NAN].map(round_below), [0.0; 3]);
    }
}
