//! Geometry and material of a spring, and the rigidities derived from both.
//!
//! A helical spring of many coils behaves like an elastic rod along its axis. Four *rigidities* describe the
//! rod, each per unit of reference length: bending `alpha`, shear `beta`, compression `gamma` and torsion
//! `tau`. They follow from wire and coil (thesis CMU-RI-TR-07-21, equations 7-9, after Haringx), or from one rigidity
//! and the coil diameter (appendix A, `switch (change)`): the thesis measured one constant and derived the other
//! constants. [`Spring`] has a checked set of parameters and rigidities, from which every law of this crate is prepared.

use std::fmt;

/// Dimensions of the unloaded spring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Distance between the end plates without load (m), `L0`.
    pub free_length_m: f64,
    /// Diameter of the wire (m), `d`.
    pub wire_diameter_m: f64,
    /// Diameter of the coil, from wire centre to wire centre (m), `D`.
    pub coil_diameter_m: f64,
    /// Number of coils that deform, `n`.
    pub active_coils: f64,
}

impl Geometry {
    /// Returns the length at which all coils touch (m), `n d`. Laws without contact continue below this length.
    #[must_use]
    pub fn solid_length_m(&self) -> f64 {
        self.active_coils * self.wire_diameter_m
    }
}

/// Elastic constants of the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus (Pa), `E`.
    pub youngs_modulus_pa: f64,
    /// Shear modulus (Pa), `G`.
    pub shear_modulus_pa: f64,
}

impl Material {
    /// Returns Poisson's ratio of an isotropic wire, `E / (2 G) - 1`.
    #[must_use]
    pub fn poisson_ratio(&self) -> f64 {
        self.youngs_modulus_pa / (2.0 * self.shear_modulus_pa) - 1.0
    }
}

/// Smallest valid Poisson's ratio. Positive moduli give a ratio above -1, at which a solid has no resistance to a
/// change of volume; within a hundredth of -1 this resistance is negligible.
pub(crate) const LEAST_POISSON_RATIO: f64 = -0.99;

/// Specification of the spring's stiffness: one rigidity, which determines the other rigidities, or the physical properties. The
/// variants are the modes 0 to 3 of `change` in the thesis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Stiffness {
    /// Mode 0: compression rigidity `gamma` (N).
    Gamma(f64),
    /// Mode 1: bending rigidity `alpha` (N·m²).
    Alpha(f64),
    /// Mode 2: shear rigidity `beta` (N).
    Beta(f64),
    /// Mode 3: all rigidities from wire, coil and material.
    Physical,
}

/// Rigidities of the equivalent rod, per unit of reference (unloaded) length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigidities {
    /// Bending: moment per curvature (N·m²).
    pub alpha_n_m2: f64,
    /// Shear: transverse force per shear angle (N).
    pub beta_n: f64,
    /// Compression: axial force per relative shortening (N). The axial stiffness is `gamma / L0`.
    pub gamma_n: f64,
    /// Torsion: torque per twist rate (N·m²).
    pub tau_n_m2: f64,
}

impl Rigidities {
    /// Derives the four rigidities from `stiffness`, without checks; [`Spring::new`] checks.
    ///
    /// Modes 0-2 use `beta = gamma E / G` and `alpha = gamma D² / (4 G / E + 2)`, mode 3 equations 7-9. Torsion
    /// is not in the thesis: a coil of wire turned about the spring axis bends, so `tau` has the form of `beta`,
    /// `L0 E d⁴ / (64 n D) = beta D² / 8`.
    fn derive(stiffness: Stiffness, geometry: &Geometry, material: &Material) -> Self {
        let coil = geometry.coil_diameter_m;
        let (e, g) = (material.youngs_modulus_pa, material.shear_modulus_pa);
        let (alpha_n_m2, beta_n, gamma_n) = match stiffness {
            Stiffness::Gamma(gamma) => (gamma * coil * coil / (4.0 * g / e + 2.0), gamma * e / g, gamma),
            Stiffness::Alpha(alpha) => {
                let per_coil = alpha / (coil * coil);
                (alpha, per_coil * (4.0 + 2.0 * e / g), per_coil * (4.0 * g / e + 2.0))
            }
            Stiffness::Beta(beta) => (beta * coil * coil / (4.0 + 2.0 * e / g), beta, beta * g / e),
            Stiffness::Physical => {
                let wire_squared = geometry.wire_diameter_m * geometry.wire_diameter_m;
                let common =
                    geometry.free_length_m * wire_squared * wire_squared / (geometry.active_coils * coil);
                (
                    common * e / (32.0 * (1.0 + e / (2.0 * g))),
                    common * e / (8.0 * coil * coil),
                    common * g / (8.0 * coil * coil),
                )
            }
        };
        Self { alpha_n_m2, beta_n, gamma_n, tau_n_m2: beta_n * coil * coil / 8.0 }
    }
}

/// Spring with checked parameters. Immutable: to change a parameter, create a new `Spring`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spring {
    geometry: Geometry,
    material: Material,
    rigidities: Rigidities,
}

impl Spring {
    /// Checks the parameters and derives the rigidities. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// The first invalid parameter, see [`ParameterError`].
    pub fn new(geometry: Geometry, material: Material, stiffness: Stiffness) -> Result<Self, ParameterError> {
        positive("free length", geometry.free_length_m)?;
        positive("wire diameter", geometry.wire_diameter_m)?;
        positive("coil diameter", geometry.coil_diameter_m)?;
        positive("number of active coils", geometry.active_coils)?;
        positive("Young's modulus", material.youngs_modulus_pa)?;
        positive("shear modulus", material.shear_modulus_pa)?;
        match stiffness {
            Stiffness::Gamma(value) => positive("compression rigidity gamma", value)?,
            Stiffness::Alpha(value) => positive("bending rigidity alpha", value)?,
            Stiffness::Beta(value) => positive("shear rigidity beta", value)?,
            Stiffness::Physical => {}
        }
        check_shape(&geometry)?;
        let poisson_ratio = material.poisson_ratio();
        if !(LEAST_POISSON_RATIO..0.5).contains(&poisson_ratio) {
            return Err(ParameterError::ImpossiblePoissonRatio { poisson_ratio, material });
        }
        let spring = Self::unchecked(geometry, material, stiffness);
        // Extreme but positive parameters can still overflow or underflow in the products of the rigidities.
        positive("bending rigidity alpha", spring.rigidities.alpha_n_m2)?;
        positive("shear rigidity beta", spring.rigidities.beta_n)?;
        positive("compression rigidity gamma", spring.rigidities.gamma_n)?;
        positive("torsion rigidity tau", spring.rigidities.tau_n_m2)?;
        Ok(spring)
    }

    /// Builds a spring from parameters known to be valid: the presets, which a test compares with [`Spring::new`].
    pub(crate) fn unchecked(geometry: Geometry, material: Material, stiffness: Stiffness) -> Self {
        Self { geometry, material, rigidities: Rigidities::derive(stiffness, &geometry, &material) }
    }

    /// Returns the dimensions of the unloaded spring.
    #[must_use]
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Returns the elastic constants of the wire.
    #[must_use]
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Returns the rigidities of the equivalent rod.
    #[must_use]
    pub fn rigidities(&self) -> &Rigidities {
        &self.rigidities
    }

    /// Returns the rigidities of a spring of equal proportions with `gamma` of one newton: functions of coil and material alone.
    pub(crate) fn rigidities_per_gamma(&self) -> Rigidities {
        Rigidities::derive(Stiffness::Gamma(1.0), &self.geometry, &self.material)
    }

    /// Returns true if free length, coil diameter and material of both springs are equal: their rigidities then differ by one
    /// common factor, because wire and number of coils scale all rigidities alike.
    #[must_use]
    pub fn is_proportional_to(&self, other: &Self) -> bool {
        self.material == other.material
            && self.geometry.free_length_m == other.geometry.free_length_m
            && self.geometry.coil_diameter_m == other.geometry.coil_diameter_m
    }

    /// Returns the axial stiffness at rest (N/m), `gamma / L0` (Hooke's `k`).
    #[must_use]
    pub fn axial_stiffness_n_per_m(&self) -> f64 {
        self.rigidities.gamma_n / self.geometry.free_length_m
    }

    /// Returns the lateral stiffness at rest (N/m) between level plates, of a Timoshenko beam.
    #[must_use]
    pub fn lateral_stiffness_n_per_m(&self) -> f64 {
        let length_m = self.geometry.free_length_m;
        let Rigidities { alpha_n_m2, beta_n, .. } = self.rigidities;
        12.0 * alpha_n_m2 / (length_m * (length_m * length_m + 12.0 * alpha_n_m2 / beta_n))
    }
}

/// Checks that a quantity is positive and finite.
fn positive(quantity: &'static str, value: f64) -> Result<(), ParameterError> {
    if !value.is_finite() {
        Err(ParameterError::NotFinite { quantity })
    } else if value <= 0.0 {
        Err(ParameterError::NotPositive { quantity, value })
    } else {
        Ok(())
    }
}

/// Checks that the coil is wider than the wire, and that the coils do not touch at rest.
fn check_shape(geometry: &Geometry) -> Result<(), ParameterError> {
    let Geometry { free_length_m, wire_diameter_m, coil_diameter_m, .. } = *geometry;
    if coil_diameter_m <= wire_diameter_m {
        return Err(ParameterError::CoilNotWiderThanWire { coil_diameter_m, wire_diameter_m });
    }
    let solid_length_m = geometry.solid_length_m();
    if solid_length_m >= free_length_m {
        return Err(ParameterError::SolidAtRest { solid_length_m, free_length_m });
    }
    Ok(())
}

/// Reason why a set of parameters is invalid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterError {
    /// Given or derived quantity that is NaN or infinite.
    NotFinite {
        /// Name of the quantity.
        quantity: &'static str,
    },
    /// Given or derived quantity that is zero or negative.
    NotPositive {
        /// Name of the quantity.
        quantity: &'static str,
        /// Value in SI units.
        value: f64,
    },
    /// The wire would fill the coil: `D <= d`.
    CoilNotWiderThanWire {
        /// `D` (m).
        coil_diameter_m: f64,
        /// `d` (m).
        wire_diameter_m: f64,
    },
    /// The coils touch without load: `n d >= L0`.
    SolidAtRest {
        /// `n d` (m).
        solid_length_m: f64,
        /// `L0` (m).
        free_length_m: f64,
    },
    /// Ratio of `E` to `G` of no stable isotropic material: `E / (2 G) - 1` must be at least -0.99 and below 0.5.
    ImpossiblePoissonRatio {
        /// `E / (2 G) - 1`.
        poisson_ratio: f64,
        /// Elastic constants of the wire.
        material: Material,
    },
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite { quantity } => {
                write!(
                    f,
                    "the {quantity} must be finite, but is NaN or infinite; choose values of a real spring"
                )
            }
            Self::NotPositive { quantity, value } => {
                write!(
                    f,
                    "the {quantity} must be positive, but is {value:e} in SI units; choose values of a real spring"
                )
            }
            Self::CoilNotWiderThanWire { coil_diameter_m, wire_diameter_m } => write!(
                f,
                "the coil diameter ({:.4} mm) must be larger than the wire diameter ({:.4} mm); increase \
                 `coil_diameter_mm`, or in mode `physical` reduce `wire_diameter_mm`",
                coil_diameter_m * 1e3,
                wire_diameter_m * 1e3
            ),
            Self::SolidAtRest { solid_length_m, free_length_m } => write!(
                f,
                "the coils would touch without load: active coils times wire diameter is {:.4} mm, but must be \
                 below the free length of {:.4} mm; increase `free_length_mm`, or in mode `physical` \
                 reduce `active_coils` or `wire_diameter_mm`",
                solid_length_m * 1e3,
                free_length_m * 1e3
            ),
            Self::ImpossiblePoissonRatio { poisson_ratio, material } => write!(
                f,
                "Young's modulus {} MPa and shear modulus {} MPa give a Poisson ratio of {poisson_ratio:.6}, which \
                 must be at least -0.99 and below 0.5; change one of the moduli",
                material.youngs_modulus_pa * 1e-6,
                material.shear_modulus_pa * 1e-6
            ),
        }
    }
}

impl std::error::Error for ParameterError {}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::preset::Preset;

    fn relative(a: f64, b: f64) -> f64 {
        ((a - b) / b).abs()
    }

    /// Rounding of a dozen products and quotients.
    const ROUNDING: f64 = 4e-15;

    #[test]
    fn one_constant_determines_the_others_in_every_mode() {
        for preset in Preset::ALL {
            let spring = preset.spring();
            let known = spring.rigidities();
            for stiffness in [
                Stiffness::Gamma(known.gamma_n),
                Stiffness::Alpha(known.alpha_n_m2),
                Stiffness::Beta(known.beta_n),
            ] {
                let again = Spring::new(*spring.geometry(), *spring.material(), stiffness).unwrap();
                let found = again.rigidities();
                assert!(relative(found.alpha_n_m2, known.alpha_n_m2) < ROUNDING, "{preset:?} {stiffness:?}");
                assert!(relative(found.beta_n, known.beta_n) < ROUNDING, "{preset:?} {stiffness:?}");
                assert!(relative(found.gamma_n, known.gamma_n) < ROUNDING, "{preset:?} {stiffness:?}");
                assert!(relative(found.tau_n_m2, known.tau_n_m2) < ROUNDING, "{preset:?} {stiffness:?}");
            }
        }
    }

    #[test]
    fn physical_stiffness_scales_as_the_textbook_says() {
        // k = G d^4 / (8 n D^3): doubling the wire gives 16 times, doubling the coil one eighth.
        let base = Preset::Slender.spring();
        let (geometry, material) = (*base.geometry(), *base.material());
        let with = |geometry| Spring::new(geometry, material, Stiffness::Physical).unwrap();
        let thick = with(Geometry { wire_diameter_m: 2.0 * geometry.wire_diameter_m, ..geometry });
        assert!(relative(thick.axial_stiffness_n_per_m(), 16.0 * base.axial_stiffness_n_per_m()) < ROUNDING);
        let wide = with(Geometry { coil_diameter_m: 2.0 * geometry.coil_diameter_m, ..geometry });
        assert!(relative(wide.axial_stiffness_n_per_m(), base.axial_stiffness_n_per_m() / 8.0) < ROUNDING);
        let short = with(Geometry { free_length_m: 0.5 * geometry.free_length_m, ..geometry });
        assert!(relative(short.axial_stiffness_n_per_m(), base.axial_stiffness_n_per_m()) < ROUNDING);
    }

    #[test]
    fn every_reason_is_reported() {
        let (geometry, material, stiffness) = Preset::Thesis1.parameters();
        let refuse = |geometry, material, stiffness| Spring::new(geometry, material, stiffness).unwrap_err();
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(
                refuse(Geometry { free_length_m: value, ..geometry }, material, stiffness),
                ParameterError::NotFinite { quantity: "free length" }
            );
        }
        for value in [0.0, -0.0, -1.0] {
            assert_eq!(
                refuse(Geometry { active_coils: value, ..geometry }, material, stiffness),
                ParameterError::NotPositive { quantity: "number of active coils", value }
            );
            assert_eq!(
                refuse(geometry, material, Stiffness::Beta(value)),
                ParameterError::NotPositive { quantity: "shear rigidity beta", value }
            );
        }
        let thin = Geometry { coil_diameter_m: geometry.wire_diameter_m, ..geometry };
        assert!(matches!(refuse(thin, material, stiffness), ParameterError::CoilNotWiderThanWire { .. }));
        let dense = Geometry { active_coils: 40.0, ..geometry };
        assert!(matches!(refuse(dense, material, stiffness), ParameterError::SolidAtRest { .. }));
        // A Young's modulus in another unit than the shear modulus: the refusal has both.
        let mixed_up = Material { youngs_modulus_pa: 1e6, ..material };
        let reason = refuse(geometry, mixed_up, stiffness).to_string();
        assert!(
            reason.contains("1 MPa") && reason.contains("75842 MPa") && reason.contains("-0.99999"),
            "{reason}"
        );
        let rubbery = Material { shear_modulus_pa: material.youngs_modulus_pa / 3.0, ..material };
        assert!(matches!(
            refuse(geometry, rubbery, stiffness),
            ParameterError::ImpossiblePoissonRatio { .. }
        ));
        // Positive and finite, yet the products of equations 7-9 leave the range of f64.
        let soft = Material { youngs_modulus_pa: 1e-320, shear_modulus_pa: 1e-320 };
        assert!(matches!(refuse(geometry, soft, Stiffness::Physical), ParameterError::NotPositive { .. }));
    }
}
