//! Materials of the groups of a surface.

use flotor_hal::TextProblem;
use toml::Table;

/// Spring, damper and friction of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Stiffness, N/m.
    pub stiffness_n_per_m: f64,
    /// Damping along the normal in contact, N s/m.
    pub damping_ns_per_m: f64,
    /// Coefficient of friction at which a resting ball begins to slide.
    pub static_friction: f64,
    /// Coefficient of friction of a sliding ball; limited to the static coefficient.
    pub kinetic_friction: f64,
    /// Viscous friction along the surface, N s/m.
    pub viscous_ns_per_m: f64,
}

/// Values that a group overrides; `None` for the values of the common material.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Own([Option<f64>; 5]);

/// Keys of a material, with their largest values; those of the parameters of the model.
pub(crate) const KEYS: [(&str, f64); 5] = [
    ("stiffness_n_per_m", 1.0e6),
    ("damping_ns_per_m", 1000.0),
    ("static_friction", 10.0),
    ("kinetic_friction", 10.0),
    ("viscous_ns_per_m", 1000.0),
];

impl Material {
    /// Builds a material from values in the order of the parameters.
    pub(crate) fn from_values(values: [f64; 5]) -> Self {
        let [stiffness_n_per_m, damping_ns_per_m, static_friction, kinetic_friction, viscous_ns_per_m] =
            values;
        Self { stiffness_n_per_m, damping_ns_per_m, static_friction, kinetic_friction, viscous_ns_per_m }
    }

    /// Returns this material with the values that a group overrides. Real-time: bounded, no allocation.
    pub(crate) fn with(self, own: &Own) -> Self {
        let all = [
            self.stiffness_n_per_m,
            self.damping_ns_per_m,
            self.static_friction,
            self.kinetic_friction,
            self.viscous_ns_per_m,
        ];
        Self::from_values(std::array::from_fn(|i| own.0[i].unwrap_or(all[i])))
    }

    /// Returns the coefficient of friction of a sliding ball. Real-time: bounded, no allocation.
    pub(crate) fn sliding(&self) -> f64 {
        self.kinetic_friction.min(self.static_friction)
    }
}

/// Parses a file of materials, one table for each group, and returns the values of the groups `names`. Not real-time.
///
/// # Errors
/// A [`TextProblem`]: malformed TOML, an unknown group or key, a value out of range.
pub fn parse(text: &str, names: &[String]) -> Result<Vec<Own>, TextProblem> {
    let table: Table = text.parse().map_err(|error: toml::de::Error| {
        let start = error.span().map_or(0, |span| span.start);
        TextProblem::at(1 + text.get(..start).unwrap_or_default().matches('\n').count(), error.message())
    })?;
    let mut all = vec![Own::default(); names.len().max(1)];
    for (group, values) in &table {
        let line =
            text.lines().position(|line| line.trim_start().starts_with('[') && line.contains(group.as_str()));
        let wrong = |problem: String| TextProblem::at(line.map_or(0, |line| line + 1), problem);
        let number = names.iter().position(|name| name == group).ok_or_else(|| {
            let known: Vec<String> = names.iter().take(12).map(|name| format!("`{name}`")).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            wrong(format!("the mesh has no group `{group}`; its groups are {known}"))
        })?;
        let values =
            values.as_table().ok_or_else(|| wrong(format!("`{group}` must be a table: [{group}]")))?;
        for (key, value) in values {
            let place = KEYS.iter().position(|(name, _)| name == key).ok_or_else(|| {
                wrong(format!(
                    "a material has no `{key}`; its keys are {}",
                    KEYS.map(|(name, _)| name).join(", ")
                ))
            })?;
            #[allow(clippy::cast_precision_loss)] // small whole numbers
            let number_of =
                |value: &toml::Value| value.as_float().or_else(|| value.as_integer().map(|x| x as f64));
            let most = KEYS[place].1;
            let x = number_of(value).filter(|x| (0.0..=most).contains(x));
            all[number].0[place] =
                Some(x.ok_or_else(|| wrong(format!("`{key}` must be a number from 0 to {most}")))?);
        }
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_group_has_its_own_values_and_an_error_its_line() {
        let names = ["wood".to_owned(), "steel".to_owned()];
        let own = parse("[steel]\nstiffness_n_per_m = 3000\n", &names).unwrap();
        let material = Material::from_values([1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(material.with(&own[0]), material);
        assert_eq!(material.with(&own[1]).stiffness_n_per_m, 3000.0);
        for (text, line) in [
            ("[wood]\n[iron]\n", 2),
            ("[wood]\nhard = 1\n", 1),
            ("[wood]\nstatic_friction = -1\n", 1),
            ("[wood\n", 1),
        ] {
            assert_eq!(parse(text, &names).unwrap_err().line, line, "{text}");
        }
    }
}
