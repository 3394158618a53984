use super::*;

/// What no settings at all mean.
fn choice(preset: Preset, mode: Mode) -> Choice {
    let (geometry, material, _) = preset.parameters();
    let known = *preset.spring().rigidities();
    let stiffness = match mode {
        Mode::Gamma => Stiffness::Gamma(known.gamma_n),
        Mode::Alpha => Stiffness::Alpha(known.alpha_n_m2),
        Mode::Beta => Stiffness::Beta(known.beta_n),
        Mode::Physical => Stiffness::Physical,
    };
    let spring = Spring::new(geometry, material, stiffness).unwrap();
    Choice { spring, stiffness, preset, ..Choice::default_with(Variant::Energy) }
}

fn index(id: &str) -> usize {
    SCHEMA.iter().position(|parameter| parameter.id() == id).unwrap()
}

/// The live numbers that rule in a mode, besides lengths and material.
fn ruling(mode: Mode) -> &'static [&'static str] {
    match mode {
        Mode::Gamma => &["gamma_n"],
        Mode::Alpha => &["alpha_n_mm2"],
        Mode::Beta => &["beta_n"],
        Mode::Physical => &["wire_diameter_mm", "active_coils"],
    }
}

const ALWAYS: [&str; 4] = ["free_length_mm", "coil_diameter_mm", "youngs_modulus_mpa", "shear_modulus_mpa"];
const RIGIDITIES: [&str; 5] = ["gamma_n", "alpha_n_mm2", "beta_n", "wire_diameter_mm", "active_coils"];

#[test]
fn presets_have_their_names_in_the_schema() {
    for (preset, word) in Preset::ALL.into_iter().zip(PRESETS.as_slice()) {
        assert_eq!(preset.name(), word.as_str());
    }
    assert_eq!(PRESETS.as_slice().len(), Preset::ALL.len());
}

#[test]
fn numbers_are_live_and_choices_are_not() {
    for parameter in SCHEMA {
        let live = parameter.mutability() == flotor_hal::Mutability::Live;
        assert_eq!(live, parameter.choices().is_empty(), "{parameter:?}");
    }
}

#[test]
fn a_number_set_is_the_number_in_force() {
    for preset in Preset::ALL {
        for mode in Mode::ALL {
            let choice = choice(preset, mode);
            for id in ALWAYS.iter().chain(ruling(mode)) {
                let value = 1.01 * choice.in_force(index(id));
                let changed = choice.with(index(id), value).unwrap();
                // Millimetres to metres and back.
                assert!((changed.in_force(index(id)) - value).abs() <= 4e-16 * value, "{id}");
                assert!(changed.spring != choice.spring && changed.in_force(0) == choice.in_force(0));
            }
        }
    }
}

#[test]
fn derived_numbers_and_choices_are_refused() {
    for mode in Mode::ALL {
        let choice = choice(Preset::Thesis1, mode);
        let derived = RIGIDITIES.iter().filter(|id| !ruling(mode).contains(id));
        for id in derived.chain(&["preset", "variant", "precision", "mode"]) {
            let refused = choice.with(index(id), 1.0).err().unwrap();
            assert_eq!(refused, SetParameterError::Fixed, "{id}");
        }
    }
}

/// A number of a seat that is held would change nothing: it is refused, as one that follows from others is.
#[test]
fn friction_is_refused_under_a_seat_that_is_held() {
    let friction = index("seat_friction");
    let held = choice(Preset::Thesis1, Mode::Gamma);
    let refused = held.with(friction, held.in_force(friction)).err().unwrap();
    assert_eq!(refused, SetParameterError::Fixed);
    let free = Choice { seat: SeatChoice::Free, ..held };
    assert_eq!(free.with(friction, 0.1).unwrap().in_force(friction), 0.1);
}

#[test]
fn what_does_not_fit_is_refused_with_the_range_that_does() {
    let choice = choice(Preset::Thesis1, Mode::Physical);
    for (id, wrong) in [
        ("free_length_mm", 7.0),
        ("coil_diameter_mm", 0.6),
        ("wire_diameter_mm", 2.2),
        ("active_coils", 40.0),
        ("youngs_modulus_mpa", 3e5),
        ("shear_modulus_mpa", 6e4),
    ] {
        let refused = choice.with(index(id), wrong).err().unwrap();
        let SetParameterError::OutOfRange(OutOfRange { min, max, value }) = refused else {
            panic!("{refused:?}")
        };
        assert!(value == wrong && min < max && !(min < wrong && wrong < max), "{id}: {refused:?}");
        assert!(SCHEMA[index(id)].check(min).is_ok() && SCHEMA[index(id)].check(max).is_ok(), "{id}");
        // Just inside either end it is accepted.
        let margin = 1e-9 * (max - min);
        assert!(choice.with(index(id), min + margin).is_ok(), "{id}");
        assert!(choice.with(index(id), max - margin).is_ok(), "{id}");
    }
    assert!(choice.with(index("free_length_mm"), f64::NAN).is_err());
}
