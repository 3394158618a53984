//! File of materials: Young's modulus and Poisson's ratio of the physical volumes of a mesh. Not real-time.

use flotor_hal::TextProblem;
use std::collections::BTreeMap;

/// Elastic material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus, Pa.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

/// Table of the file.
#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Own {
    youngs_modulus_pa: Option<f64>,
    poisson_ratio: Option<f64>,
}

/// Parses a file with one table for each physical volume, and returns the materials of the volumes `names`; what is not given is
/// that of `common`.
///
/// # Errors
/// A [`TextProblem`]: malformed TOML, an unknown volume or key, a value out of range.
pub fn parse(text: &str, names: &[String], common: Material) -> Result<Vec<Material>, TextProblem> {
    let tables: BTreeMap<toml::Spanned<String>, Own> = toml::from_str(text).map_err(|error| {
        TextProblem::at(line(text, error.span().map_or(0, |span| span.start)), error.message())
    })?;
    let mut all = vec![common; names.len()];
    for (volume, own) in tables {
        let wrong = |problem: String| TextProblem::at(line(text, volume.span().start), problem);
        let number = names.iter().position(|name| name == volume.get_ref()).ok_or_else(|| {
            let known = names.join(", ");
            wrong(format!(
                "the mesh has no physical volume `{}` (it has: {known}): rename the table",
                volume.get_ref()
            ))
        })?;
        let Material { youngs_modulus_pa: e, poisson_ratio: nu } = common;
        let (e, nu) = (own.youngs_modulus_pa.unwrap_or(e), own.poisson_ratio.unwrap_or(nu));
        if !((1.0..=1.0e12).contains(&e) && (0.0..=0.49).contains(&nu)) {
            return Err(wrong("`youngs_modulus_pa` must be 1 to 1e12, `poisson_ratio` 0 to 0.49".to_owned()));
        }
        all[number] = Material { youngs_modulus_pa: e, poisson_ratio: nu };
    }
    Ok(all)
}

fn line(text: &str, at: usize) -> usize {
    1 + text.get(..at).unwrap_or_default().matches('\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_volume_has_its_own_values_and_an_error_its_line() {
        let common = Material { youngs_modulus_pa: 1.0e4, poisson_ratio: 0.3 };
        let names = ["tissue".to_owned(), "lump".to_owned()];
        let all = parse("[lump]\nyoungs_modulus_pa = 100000\n", &names, common).unwrap();
        assert_eq!(all, [common, Material { youngs_modulus_pa: 1.0e5, ..common }]);
        for (text, line) in [
            ("[tissue]\n[bone]\n", 2),
            ("[lump]\nhard = 1\n", 2),
            ("[lump]\npoisson_ratio = 0.5\n", 1),
            ("[lump\n", 1),
        ] {
            assert_eq!(parse(text, &names, common).unwrap_err().line, line, "{text}");
        }
    }
}
