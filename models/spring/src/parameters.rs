//! What the spring can be told, and how a set of values becomes a checked [`Spring`].
//!
//! A preset gives every value; what is set explicitly replaces it. One constant rules the stiffness (`mode`, the
//! thesis's modes 0 to 3): the others are derived from it, and setting a derived one is refused, because the
//! answer to "which of the two did you mean" is not ours to give.

use crate::preset::Preset;
use crate::rigidity::{Geometry, Material, Spring, Stiffness};
use flotor_hal::abi::Str;
use flotor_hal::{Parameter, Refusal, Settings};

/// Which law answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Variant {
    /// The thesis's printed law, regularised.
    ClosedForm,
    /// The same with rigidities per current length, and the upper moment only.
    CurrentLength,
    /// The conservative law in three dimensions.
    Energy,
}

/// Which constant rules the stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Gamma,
    Alpha,
    Beta,
    Physical,
}

const VARIANTS: [Str; 3] = [Str::new("energy"), Str::new("closed-form"), Str::new("current-length")];
const PRESETS: [Str; 4] =
    [Str::new("thesis-1"), Str::new("thesis-2"), Str::new("thesis-3"), Str::new("slender")];
const MODES: [Str; 4] = [Str::new("gamma"), Str::new("alpha"), Str::new("beta"), Str::new("physical")];

const MM: f64 = 1.0e-3;
const MPA: f64 = 1.0e6;
const N_MM2: f64 = 1.0e-6;

/// The schema. Defaults are those of preset `thesis-1`; another preset brings its own.
pub(crate) const SCHEMA: &[Parameter] = &[
    Parameter::choice("preset", &PRESETS, 0, "Spring of the thesis, or a slender one that buckles"),
    Parameter::choice(
        "variant",
        &VARIANTS,
        0,
        "Law: conservative in 3D, the thesis's printed law, or that corrected",
    ),
    Parameter::choice("mode", &MODES, 0, "Which constant rules the stiffness; the others follow from it"),
    Parameter::real("free_length_mm", "mm", 1.0, 1000.0, 25.0, "Distance of the end plates without load"),
    Parameter::real("coil_diameter_mm", "mm", 0.5, 200.0, 6.07, "Diameter of the coil between wire centres"),
    Parameter::real("youngs_modulus_mpa", "MPa", 1.0, 1.0e6, 203_395.0, "Young's modulus of the wire"),
    Parameter::real("shear_modulus_mpa", "MPa", 1.0, 1.0e6, 75_842.0, "Shear modulus of the wire"),
    Parameter::real("wire_diameter_mm", "mm", 0.05, 50.0, 0.63, "Diameter of the wire (mode physical)"),
    Parameter::real("active_coils", "1", 1.0, 500.0, 11.8, "Number of coils that deform (mode physical)"),
    Parameter::real(
        "gamma_n",
        "N",
        0.01,
        10_000.0,
        16.97,
        "Compression rigidity (mode gamma); stiffness is gamma / L0",
    ),
    Parameter::real(
        "alpha_n_mm2",
        "N mm²",
        0.01,
        1.0e7,
        179.078_939_264_832_6,
        "Bending rigidity (mode alpha)",
    ),
    Parameter::real("beta_n", "N", 0.01, 100_000.0, 45.510_576_593_444_26, "Shear rigidity (mode beta)"),
];

/// What a set of values means.
pub(crate) struct Choice {
    pub(crate) spring: Spring,
    pub(crate) variant: Variant,
    preset: Preset,
    mode: Mode,
}

impl Choice {
    /// Resolves preset, mode and explicit values.
    pub(crate) fn resolve(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let preset =
            Preset::ALL.get(settings.choice_or_default("preset")).copied().unwrap_or(Preset::Thesis1);
        let variant = match settings.choice_or_default("variant") {
            1 => Variant::ClosedForm,
            2 => Variant::CurrentLength,
            _ => Variant::Energy,
        };
        let (geometry, material, stiffness) = preset.parameters();
        let mode = mode(settings, stiffness);
        refuse_derived(settings, mode)?;

        let value = |id, preset: f64, unit: f64| settings.number(id).map_or(preset, |number| number * unit);
        let geometry = Geometry {
            free_length_m: value("free_length_mm", geometry.free_length_m, MM),
            wire_diameter_m: value("wire_diameter_mm", geometry.wire_diameter_m, MM),
            coil_diameter_m: value("coil_diameter_mm", geometry.coil_diameter_m, MM),
            active_coils: value("active_coils", geometry.active_coils, 1.0),
        };
        let material = Material {
            youngs_modulus_pa: value("youngs_modulus_mpa", material.youngs_modulus_pa, MPA),
            shear_modulus_pa: value("shear_modulus_mpa", material.shear_modulus_pa, MPA),
        };
        // A constant that rules without being set is the preset's: switching the mode alone changes no stiffness,
        // except to `physical`, whose wire is stiffer or softer than the stated gamma (PHYSICS D1).
        let preset_rigidities = *preset.spring().rigidities();
        let stiffness = match mode {
            Mode::Gamma => Stiffness::Gamma(value("gamma_n", preset_rigidities.gamma_n, 1.0)),
            Mode::Alpha => Stiffness::Alpha(value("alpha_n_mm2", preset_rigidities.alpha_n_m2, N_MM2)),
            Mode::Beta => Stiffness::Beta(value("beta_n", preset_rigidities.beta_n, 1.0)),
            Mode::Physical => Stiffness::Physical,
        };
        let spring = Spring::new(geometry, material, stiffness).map_err(Refusal::parameter)?;
        Ok(Self { spring, variant, preset, mode })
    }

    /// The value in force of the parameter at `index` of the schema, as a person would set it.
    pub(crate) fn in_force(&self, index: usize) -> f64 {
        let (geometry, material, rigidities) =
            (self.spring.geometry(), self.spring.material(), self.spring.rigidities());
        match SCHEMA.get(index).map_or("", Parameter::id) {
            "preset" => position(&Preset::ALL, &self.preset),
            "variant" => {
                position(&[Variant::Energy, Variant::ClosedForm, Variant::CurrentLength], &self.variant)
            }
            "mode" => position(&[Mode::Gamma, Mode::Alpha, Mode::Beta, Mode::Physical], &self.mode),
            "free_length_mm" => geometry.free_length_m / MM,
            "coil_diameter_mm" => geometry.coil_diameter_m / MM,
            "youngs_modulus_mpa" => material.youngs_modulus_pa / MPA,
            "shear_modulus_mpa" => material.shear_modulus_pa / MPA,
            "wire_diameter_mm" => geometry.wire_diameter_m / MM,
            "active_coils" => geometry.active_coils,
            "gamma_n" => rigidities.gamma_n,
            "alpha_n_mm2" => rigidities.alpha_n_m2 / N_MM2,
            "beta_n" => rigidities.beta_n,
            _ => f64::NAN,
        }
    }
}

/// The mode set, else that of the preset.
fn mode(settings: &Settings<'_>, preset: Stiffness) -> Mode {
    match (settings.number("mode").map(|_| settings.choice_or_default("mode")), preset) {
        (Some(1), _) | (None, Stiffness::Alpha(_)) => Mode::Alpha,
        (Some(2), _) | (None, Stiffness::Beta(_)) => Mode::Beta,
        (Some(3), _) | (None, Stiffness::Physical) => Mode::Physical,
        (Some(_), _) | (None, Stiffness::Gamma(_)) => Mode::Gamma,
    }
}

/// Refuses a value that the mode derives from others.
fn refuse_derived(settings: &Settings<'_>, mode: Mode) -> Result<(), Refusal> {
    const RULED: [(&str, Mode, &str); 5] = [
        ("gamma_n", Mode::Gamma, "gamma"),
        ("alpha_n_mm2", Mode::Alpha, "alpha"),
        ("beta_n", Mode::Beta, "beta"),
        ("wire_diameter_mm", Mode::Physical, "physical"),
        ("active_coils", Mode::Physical, "physical"),
    ];
    let derived = RULED.iter().find(|(id, own, _)| *own != mode && settings.number(id).is_some());
    let Some((id, _, own)) = derived else { return Ok(()) };
    let now = match mode {
        Mode::Gamma => "gamma",
        Mode::Alpha => "alpha",
        Mode::Beta => "beta",
        Mode::Physical => "physical",
    };
    Err(Refusal::parameter(format!(
        "`{id}` has no say in mode `{now}`, where it follows from the others; set `mode` to `{own}` as well"
    )))
}

#[allow(clippy::cast_precision_loss)] // an index of a few choices
fn position<T: PartialEq>(choices: &[T], value: &T) -> f64 {
    choices.iter().position(|choice| choice == value).map_or(f64::NAN, |index| index as f64)
}
