//! Named springs: springs 1 to 3 of the thesis, and a slender spring that buckles at a small compression.
//!
//! The thesis (table 2) gives each spring its wire, coil and free length *and* a compression rigidity `gamma`.
//! The dimensions give another `gamma`: that of spring 1 belongs to a free length of 30 mm, those of springs 2 and 3 differ by
//! 0.5 %. The experiments were run with the stated `gamma`, so the presets have mode `gamma`.

use crate::rigidity::{Geometry, Material, Spring, Stiffness};

/// Steel of the thesis, table 2.
const SPRING_STEEL: Material = Material { youngs_modulus_pa: 203_395e6, shear_modulus_pa: 75_842e6 };

/// Named spring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Preset {
    /// Spring 1 of the thesis, the default: short; does not buckle.
    Thesis1,
    /// Spring 2 of the thesis: wide; does not buckle.
    Thesis2,
    /// Spring 3 of the thesis: narrow, soft; buckles at 54.5 % compression.
    Thesis3,
    /// Twelve diameters long, not in the thesis; buckles at 8.3 % compression. Constants from the wire.
    Slender,
}

impl Preset {
    /// All presets, in the order of the tables.
    pub const ALL: [Self; 4] = [Self::Thesis1, Self::Thesis2, Self::Thesis3, Self::Slender];

    /// Returns the name of the preset in scenes and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Thesis1 => "thesis-1",
            Self::Thesis2 => "thesis-2",
            Self::Thesis3 => "thesis-3",
            Self::Slender => "slender",
        }
    }

    /// Returns the parameters of the spring, for [`Spring::new`].
    #[must_use]
    pub fn parameters(self) -> (Geometry, Material, Stiffness) {
        let millimetres = |free_length, wire_diameter, coil_diameter, active_coils| Geometry {
            free_length_m: free_length / 1e3,
            wire_diameter_m: wire_diameter / 1e3,
            coil_diameter_m: coil_diameter / 1e3,
            active_coils,
        };
        let (geometry, stiffness) = match self {
            Self::Thesis1 => (millimetres(25.0, 0.63, 6.07, 11.8), Stiffness::Gamma(16.97)),
            Self::Thesis2 => (millimetres(37.49, 0.84, 11.6, 9.0), Stiffness::Gamma(12.53)),
            Self::Thesis3 => (millimetres(27.0, 0.51, 4.81, 15.0), Stiffness::Gamma(10.32)),
            Self::Slender => (millimetres(60.0, 0.6, 5.0, 24.0), Stiffness::Physical),
        };
        (geometry, SPRING_STEEL, stiffness)
    }

    /// Returns the spring of the preset.
    #[must_use]
    pub fn spring(self) -> Spring {
        let (geometry, material, stiffness) = self.parameters();
        Spring::unchecked(geometry, material, stiffness)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_pass_the_checks() {
        for preset in Preset::ALL {
            let (geometry, material, stiffness) = preset.parameters();
            assert_eq!(Spring::new(geometry, material, stiffness), Ok(preset.spring()));
        }
    }

    #[test]
    fn solid_lengths_are_those_of_the_tables() {
        // 11.8 x 0.63, 9 x 0.84, 15 x 0.51, 24 x 0.6 mm; one rounding each for the product and the unit.
        for (preset, millimetres) in Preset::ALL.into_iter().zip([7.434, 7.56, 7.65, 14.4]) {
            let solid_mm = preset.spring().geometry().solid_length_m() * 1e3;
            assert!((solid_mm - millimetres).abs() < 1e-14, "{preset:?}: {solid_mm}");
        }
    }
}
