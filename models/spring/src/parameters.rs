//! Parameter schema of the spring, and resolution of a set of values to a checked [`Spring`].
//!
//! A preset gives every value; explicit values replace those of the preset. The parameter `mode` (the thesis's modes 0 to 3)
//! selects the constants that determine the stiffness. The other constants are derived, and an explicit value of a derived
//! constant is rejected as ambiguous.
//!
//! The numbers are live: a running loop may change them between two ticks, one at a time, and each change must be
//! consistent with the other values. Such a change is a step of the force at the current pose of the hand. The model
//! does not smooth the step, because only the host knows the limits of the device: its envelope limits the rate of the
//! wrench, so that no step larger than the slew limit reaches the hand.

use crate::precision::Precision;
use crate::preset::Preset;
use crate::rigidity::{Geometry, LEAST_POISSON_RATIO, Material, Spring, Stiffness};
use crate::rod::Accuracy;
use crate::rod_blend::TOLERANCE_N;
use crate::seat::Friction;
use flotor_hal::{Choices, OutOfRange, Parameter, Refusal, SetParameterError, Settings, choices};

/// Law of the spring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Variant {
    /// Printed code of the thesis, with its branches and jumps.
    Thesis,
    /// Printed law of the thesis, regularised.
    ClosedForm,
    /// Regularised law with rigidities per current length, and the upper moment only.
    CurrentLength,
    /// Conservative law in three dimensions.
    Energy,
    /// Exact rod, past buckling too.
    Rod,
}

impl Variant {
    pub(crate) const ALL: [Self; 5] =
        [Self::Thesis, Self::ClosedForm, Self::CurrentLength, Self::Energy, Self::Rod];
}

/// Support of the lower plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SeatChoice {
    /// Clamped.
    Fixed,
    /// Free to roll up and to lift off.
    Free,
}

/// Switch of an optional part of the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Switch {
    /// Excluded from the law.
    Off,
    /// Included in the law.
    On,
}

/// Constant that determines the stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Gamma,
    Alpha,
    Beta,
    Physical,
}

impl Mode {
    const ALL: [Self; 4] = [Self::Gamma, Self::Alpha, Self::Beta, Self::Physical];

    fn of(stiffness: Stiffness) -> Self {
        match stiffness {
            Stiffness::Gamma(_) => Self::Gamma,
            Stiffness::Alpha(_) => Self::Alpha,
            Stiffness::Beta(_) => Self::Beta,
            Stiffness::Physical => Self::Physical,
        }
    }
}

const PRESETS: Choices = choices!["thesis-1", "thesis-2", "thesis-3", "slender"];
/// Names of [`Variant::ALL`].
const VARIANTS: Choices = choices!["thesis", "closed-form", "current-length", "energy", "rod"];
const PRECISIONS: Choices = choices!["f64", "f32"];
const ACCURACIES: Choices = choices!["servo", "tight"];
const SEATS: Choices = choices!["fixed", "free"];
const OFF_ON: Choices = choices!["off", "on"];
const MODES: Choices = choices!["gamma", "alpha", "beta", "physical"];

const MM: f64 = 1.0e-3;
const MPA: f64 = 1.0e6;
const N_MM2: f64 = 1.0e-6;

/// Declares a live number whose default is that of the preset; the schema has the number of `thesis-1`.
macro_rules! own {
    ($id:literal, $unit:literal, $least:literal, $most:literal, $default:literal, $doc:literal) => {
        Parameter::real($id, $unit, $least, $most, $default, concat!($doc, "; default: that of the preset"))
            .live()
    };
}

/// Parameter schema. Defaults are those of preset `thesis-1`; other presets have their own. Choices are fixed, numbers are
/// live.
pub(crate) const SCHEMA: &[Parameter] = &[
    Parameter::choice(
        "preset",
        PRESETS,
        0,
        "Spring whose dimensions and constants are the defaults: 1, 2 or 3 of the thesis, or a slender one that buckles",
    ),
    Parameter::choice(
        "variant",
        VARIANTS,
        3,
        "Force law: thesis (the code of the thesis, with its jumps), closed-form (the law of the thesis without jumps), current-length (that law with rigidities of the current length), energy (a conservative law in 3D), or rod (the exact rod)",
    ),
    Parameter::choice(
        "precision",
        PRECISIONS,
        0,
        "Precision of the stored numbers: 64 or 32 bits (variants thesis and closed-form)",
    ),
    Parameter::choice(
        "accuracy",
        ACCURACIES,
        0,
        "Accuracy of the solution: for the servo, or tight as a reference (variant rod)",
    ),
    Parameter::choice(
        "seat",
        SEATS,
        0,
        "Lower plate fixed, or free to roll up and lift off (variants energy and rod)",
    ),
    Parameter::real(
        "seat_friction",
        "1",
        0.01,
        10.0,
        10.0,
        "Coefficient of friction under a free seat; at 10 the base hardly slides",
    )
    .live(),
    Parameter::choice(
        "hand_over",
        OFF_ON,
        1,
        "Blend the energy with the rod where the error of the law exceeds the tolerance (variant energy)",
    ),
    Parameter::real(
        "tolerance_n",
        "N",
        0.0005,
        0.1,
        TOLERANCE_N,
        "Largest error of the force relative to the rod, below the buckling load (variant energy with \
         hand_over)",
    )
    .live(),
    Parameter::choice("coil_contact", OFF_ON, 0, "Contact forces between coils (variants energy and rod)"),
    Parameter::choice(
        "wire",
        OFF_ON,
        0,
        "Effects of twist under compression and of the off-axis ends of the wire (variants energy and rod)",
    ),
    Parameter::choice(
        "mode",
        MODES,
        0,
        "Given quantity, from which the others follow: `gamma_n`, `alpha_n_mm2`, `beta_n`, or the wire \
         (`wire_diameter_mm` and `active_coils`); default: the mode of the preset",
    ),
    own!(
        "free_length_mm",
        "mm",
        1.0,
        1000.0,
        25.0,
        "Free length: distance between the end plates without load"
    ),
    own!("coil_diameter_mm", "mm", 0.5, 200.0, 6.07, "Diameter of the coil between wire centres"),
    own!("youngs_modulus_mpa", "MPa", 1.0, 1.0e6, 203_395.0, "Young's modulus of the wire"),
    own!("shear_modulus_mpa", "MPa", 1.0, 1.0e6, 75_842.0, "Shear modulus of the wire"),
    own!("wire_diameter_mm", "mm", 0.05, 50.0, 0.63, "Diameter of the wire (mode physical)"),
    own!("active_coils", "1", 1.0, 500.0, 11.8, "Number of active coils (mode physical)"),
    own!(
        "gamma_n",
        "N",
        0.01,
        10_000.0,
        16.97,
        "Compression rigidity (mode gamma); the axial stiffness is gamma over the free length"
    ),
    own!("alpha_n_mm2", "N mm²", 0.01, 1.0e7, 179.078_939_264_832_6, "Bending rigidity (mode alpha)"),
    own!("beta_n", "N", 0.01, 100_000.0, 45.510_576_593_444_26, "Shear rigidity (mode beta)"),
];

/// Resolved parameter values of a spring.
#[derive(Clone, Copy)]
pub(crate) struct Choice {
    pub(crate) spring: Spring,
    pub(crate) stiffness: Stiffness,
    pub(crate) variant: Variant,
    pub(crate) precision: Precision,
    pub(crate) accuracy: Accuracy,
    pub(crate) seat: SeatChoice,
    pub(crate) friction: Friction,
    pub(crate) rod_blend: Switch,
    pub(crate) tolerance_n: f64,
    pub(crate) coil_contact: Switch,
    pub(crate) wire: Switch,
    pub(crate) preset: Preset,
}

impl Choice {
    /// Resolves preset, mode and explicit values, and checks their combination.
    pub(crate) fn resolve(settings: &Settings<'_>) -> Result<Self, Refusal> {
        let preset = settings.one_of("preset", Preset::ALL);
        let variant = settings.one_of("variant", Variant::ALL);
        let set = (settings, variant);
        let precision = second_only_for(
            &[Variant::Thesis, Variant::ClosedForm],
            set,
            "precision",
            [Precision::Double, Precision::Single],
            "f32 is only for the variants `thesis` and `closed-form`; set `precision` to `f64`, or choose one of these variants",
        )?;
        let accuracy = second_only_for(
            &[Variant::Rod],
            set,
            "accuracy",
            [Accuracy::Servo, Accuracy::Tight],
            "tight is only for variant `rod`; set `variant` to `rod`, or omit `accuracy`",
        )?;
        // A free plate minimises an energy, and a property of real coils adds one.
        let with_energy = [Variant::Energy, Variant::Rod];
        let seat = second_only_for(
            &with_energy,
            set,
            "seat",
            [SeatChoice::Fixed, SeatChoice::Free],
            "free needs a law with a stored energy; set `variant` to `energy` or `rod`",
        )?;
        let rod_blend = rod_blend(settings, variant)?;
        if rod_blend == Switch::Off && settings.number("tolerance_n").is_some() {
            return Err(Refusal::parameter(
                "`tolerance_n` needs a law that blends into the rod; set `variant` to `energy` and `hand_over` to `on` as well",
            ));
        }
        let coil = |id| {
            let refusal = "on needs a law with a stored energy; set `variant` to `energy` or `rod`";
            second_only_for(&with_energy, set, id, [Switch::Off, Switch::On], refusal)
        };
        let (coil_contact, wire) = (coil("coil_contact")?, coil("wire")?);
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
        // A determining constant without an explicit value is the preset's: switching the mode alone changes no
        // stiffness, except to `physical`, whose wire is stiffer or softer than the stated gamma (PHYSICS D1).
        let preset_rigidities = *preset.spring().rigidities();
        let stiffness = match mode {
            Mode::Gamma => Stiffness::Gamma(value("gamma_n", preset_rigidities.gamma_n, 1.0)),
            Mode::Alpha => Stiffness::Alpha(value("alpha_n_mm2", preset_rigidities.alpha_n_m2, N_MM2)),
            Mode::Beta => Stiffness::Beta(value("beta_n", preset_rigidities.beta_n, 1.0)),
            Mode::Physical => Stiffness::Physical,
        };
        let spring = Spring::new(geometry, material, stiffness).map_err(Refusal::parameter)?;
        if seat == SeatChoice::Fixed && settings.number("seat_friction").is_some() {
            return Err(Refusal::parameter(
                "`seat_friction` has no effect on a fixed seat; set `seat` to `free` as well",
            ));
        }
        let friction = Friction { coefficient: settings.number_or_default("seat_friction") };
        Ok(Self {
            spring,
            stiffness,
            variant,
            precision,
            accuracy,
            seat,
            friction,
            rod_blend,
            tolerance_n: settings.number_or_default("tolerance_n"),
            coil_contact,
            wire,
            preset,
        })
    }

    /// Returns preset `thesis-1` with another law and defaults for all other parameters.
    #[cfg(test)]
    pub(crate) fn default_with(variant: Variant) -> Self {
        let preset = Preset::Thesis1;
        let (_, _, stiffness) = preset.parameters();
        Self {
            spring: preset.spring(),
            stiffness,
            variant,
            precision: Precision::Double,
            accuracy: Accuracy::Servo,
            seat: SeatChoice::Fixed,
            friction: Friction::STICKING,
            rod_blend: if variant == Variant::Energy { Switch::On } else { Switch::Off },
            tolerance_n: TOLERANCE_N,
            coil_contact: Switch::Off,
            wire: Switch::Off,
            preset,
        }
    }

    /// Returns a copy with one live number changed, in the unit of its parameter. Real-time: bounded, no allocation.
    ///
    /// # Errors
    /// The range consistent with the other values; `Fixed` for a number that follows from others in this mode, or has no effect.
    pub(crate) fn with(&self, index: usize, value: f64) -> Result<Self, SetParameterError> {
        let id = SCHEMA.get(index).map_or("", Parameter::id);
        // Without blending the tolerance has no effect, and with a clamped plate the friction: both are rejected below.
        match (id, self.rod_blend, self.seat) {
            ("tolerance_n", Switch::On, _) => return Ok(Self { tolerance_n: value, ..*self }),
            ("seat_friction", _, SeatChoice::Free) => {
                return Ok(Self { friction: Friction { coefficient: value }, ..*self });
            }
            _ => {}
        }
        let (mut geometry, mut material, mut stiffness) =
            (*self.spring.geometry(), *self.spring.material(), self.stiffness);
        let (own, unit) = match (id, &mut stiffness) {
            ("free_length_mm", _) => (&mut geometry.free_length_m, MM),
            ("coil_diameter_mm", _) => (&mut geometry.coil_diameter_m, MM),
            ("youngs_modulus_mpa", _) => (&mut material.youngs_modulus_pa, MPA),
            ("shear_modulus_mpa", _) => (&mut material.shear_modulus_pa, MPA),
            ("wire_diameter_mm", Stiffness::Physical) => (&mut geometry.wire_diameter_m, MM),
            ("active_coils", Stiffness::Physical) => (&mut geometry.active_coils, 1.0),
            ("gamma_n", Stiffness::Gamma(gamma_n)) => (gamma_n, 1.0),
            ("alpha_n_mm2", Stiffness::Alpha(alpha_n_m2)) => (alpha_n_m2, N_MM2),
            ("beta_n", Stiffness::Beta(beta_n)) => (beta_n, 1.0),
            _ => return Err(SetParameterError::Fixed),
        };
        *own = value * unit;
        let spring =
            Spring::new(geometry, material, stiffness).map_err(|_| self.fitting_range(index, value))?;
        Ok(Self { spring, stiffness, ..*self })
    }

    /// Returns the range of a number that is consistent with the other current values, for an error.
    fn fitting_range(&self, index: usize, value: f64) -> SetParameterError {
        let (geometry, material) = (self.spring.geometry(), self.spring.material());
        let Some(parameter) = SCHEMA.get(index) else {
            return SetParameterError::Fixed;
        };
        // Limits: coils that do not touch at rest, a coil wider than the wire, and a possible Poisson's ratio E/(2 G) - 1.
        let (min, max) = match parameter.id() {
            "free_length_mm" => (geometry.solid_length_m() / MM, f64::INFINITY),
            "coil_diameter_mm" => (geometry.wire_diameter_m / MM, f64::INFINITY),
            "wire_diameter_mm" => {
                let touching_m = geometry.free_length_m / geometry.active_coils;
                (0.0, touching_m.min(geometry.coil_diameter_m) / MM)
            }
            "active_coils" => (0.0, geometry.free_length_m / geometry.wire_diameter_m),
            "youngs_modulus_mpa" => {
                let shear_mpa = material.shear_modulus_pa / MPA;
                (2.0 * (1.0 + LEAST_POISSON_RATIO) * shear_mpa, 3.0 * shear_mpa)
            }
            "shear_modulus_mpa" => {
                let youngs_mpa = material.youngs_modulus_pa / MPA;
                (youngs_mpa / 3.0, youngs_mpa / (2.0 * (1.0 + LEAST_POISSON_RATIO)))
            }
            _ => (0.0, f64::INFINITY),
        };
        OutOfRange { min: min.max(parameter.min()), max: max.min(parameter.max()), value }.into()
    }

    /// Returns the current value of the parameter at `index` of the schema, in its unit.
    pub(crate) fn in_force(&self, index: usize) -> f64 {
        let (geometry, material, rigidities) =
            (self.spring.geometry(), self.spring.material(), self.spring.rigidities());
        match SCHEMA.get(index).map_or("", Parameter::id) {
            "preset" => f64::from(self.preset as u8),
            "variant" => f64::from(self.variant as u8),
            "precision" => f64::from(self.precision as u8),
            "accuracy" => f64::from(self.accuracy as u8),
            "seat" => f64::from(self.seat as u8),
            "seat_friction" => self.friction.coefficient,
            "hand_over" => f64::from(self.rod_blend as u8),
            "tolerance_n" => self.tolerance_n,
            "coil_contact" => f64::from(self.coil_contact as u8),
            "wire" => f64::from(self.wire as u8),
            "mode" => f64::from(Mode::of(self.stiffness) as u8),
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

/// Returns the selected value of a choice of two; refuses the second value for a law that is not one of `laws`.
fn second_only_for<T>(
    laws: &[Variant],
    (settings, variant): (&Settings<'_>, Variant),
    id: &'static str,
    [first, second]: [T; 2],
    refusal: &str,
) -> Result<T, Refusal> {
    match settings.choice_or_default(id) {
        1 if laws.contains(&variant) => Ok(second),
        1 => Err(Refusal::parameter(format!("`{id}` {refusal}"))),
        _ => Ok(first),
    }
}

/// Returns the switch for blending into the rod: on by default for the law `energy`, rejected for other laws.
fn rod_blend(settings: &Settings<'_>, variant: Variant) -> Result<Switch, Refusal> {
    let wanted = settings.choice_or_default("hand_over") == 1;
    match variant {
        Variant::Energy if wanted => Ok(Switch::On),
        Variant::Thesis | Variant::ClosedForm | Variant::CurrentLength | Variant::Rod
            if wanted && settings.number("hand_over").is_some() =>
        {
            Err(Refusal::parameter(
                "`hand_over` on needs variant `energy`, which blends into the rod; set `variant` to `energy`",
            ))
        }
        _ => Ok(Switch::Off),
    }
}

/// Returns the explicit mode, without one the mode of the preset.
fn mode(settings: &Settings<'_>, preset: Stiffness) -> Mode {
    settings.number("mode").map_or(Mode::of(preset), |_| settings.one_of("mode", Mode::ALL))
}

/// Refuses an explicit value of a parameter that the mode derives from other parameters.
fn refuse_derived(settings: &Settings<'_>, mode: Mode) -> Result<(), Refusal> {
    const RULED: [(&str, Mode); 5] = [
        ("gamma_n", Mode::Gamma),
        ("alpha_n_mm2", Mode::Alpha),
        ("beta_n", Mode::Beta),
        ("wire_diameter_mm", Mode::Physical),
        ("active_coils", Mode::Physical),
    ];
    let derived = RULED.iter().find(|(id, own)| *own != mode && settings.number(id).is_some());
    let Some((id, own)) = derived else { return Ok(()) };
    let [now, own] = [mode, *own].map(|mode| MODES.as_slice()[mode as usize].as_str());
    Err(Refusal::parameter(format!(
        "`{id}` has no effect in mode `{now}`, which computes it from other parameters; set `mode` to `{own}` as well"
    )))
}

#[cfg(test)]
mod tests;
