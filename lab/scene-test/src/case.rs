//! Cases of a file: every seed with every combination of settings, and every check of its plugins.

use crate::file::TestFile;

/// Single test that passes or fails.
#[derive(Debug)]
pub(crate) struct Case<'f> {
    pub(crate) file: &'f TestFile,
    /// Distinguishing part of the name within the file.
    pub(crate) label: String,
    pub(crate) check: Check,
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Check {
    Run { seed: u64, set: Vec<(String, String)> },
    Curve,
    Golden,
    Validate,
    Stress,
}

impl<'f> Case<'f> {
    /// Returns the cases of a file, in a fixed order.
    pub(crate) fn of(file: &'f TestFile) -> Vec<Self> {
        let runs = !(file.expect.is_empty() && file.reference.is_none() && file.digests.is_empty());
        let mut cases = Vec::new();
        for set in combinations(&file.set) {
            let settings: Vec<String> = set.iter().map(|(key, value)| format!("{key}={value} ")).collect();
            cases.extend(file.seeds.iter().filter(|_| runs).map(|seed| Self {
                file,
                label: format!("{}seed {seed}", settings.concat()),
                check: Check::Run { seed: *seed, set: set.clone() },
            }));
        }
        let checks = [
            ("curve", Check::Curve, file.curve.is_some()),
            ("golden", Check::Golden, file.golden.is_some()),
            ("validate", Check::Validate, file.validate.is_some()),
            ("stress", Check::Stress, file.stress.is_some()),
        ];
        let written = checks.into_iter().filter(|(.., is_written)| *is_written);
        cases.extend(written.map(|(label, check, _)| Self { file, label: label.to_owned(), check }));
        cases
    }

    pub(crate) fn name(&self) -> String {
        format!("{}: {}", self.file.name, self.label)
    }
}

/// Returns every choice of one value for each key.
pub(crate) fn combinations(set: &[(String, Vec<String>)]) -> Vec<Vec<(String, String)>> {
    set.iter().fold(vec![Vec::new()], |chosen, (key, values)| {
        let with = |before: &Vec<(String, String)>, value: &String| {
            before.iter().cloned().chain([(key.clone(), value.clone())]).collect()
        };
        chosen.iter().flat_map(|before| values.iter().map(move |value| with(before, value))).collect()
    })
}

/// Part of all cases, selected by name. The parts are disjoint and complete.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shard {
    number: u64,
    of: u64,
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(k, n)| Some((k.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("write K/N with K from 1 to N, such as 2/3 for the second of three parts".to_owned()),
        }
    }
}

impl Shard {
    pub(crate) fn has(self, name: &str) -> bool {
        // FNV-1a: equal on every machine and in every version.
        let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        hash % self.of == self.number - 1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cases_are_the_product_of_all_values() {
        let key =
            |key: &str, values: &[&str]| (key.to_owned(), values.iter().map(ToString::to_string).collect());
        assert_eq!(combinations(&[]), [Vec::new()]);
        let all = combinations(&[key("a.x", &["1", "2"]), key("b.y", &["p", "q", "r"])]);
        assert_eq!(all.len(), 6);
        assert_eq!(all[1], [("a.x".to_owned(), "1".to_owned()), ("b.y".to_owned(), "q".to_owned())]);
    }

    #[test]
    fn every_name_falls_to_one_part() {
        let parts: Vec<Shard> = (1..=3).map(|k| format!("{k}/3").parse().unwrap()).collect();
        let mut sizes = [0; 3];
        for seed in 0..300 {
            let name = format!("jelly: seed {seed}");
            let of: Vec<usize> = (0..3).filter(|part| parts[*part].has(&name)).collect();
            assert_eq!(of.len(), 1, "{name}");
            sizes[of[0]] += 1;
        }
        assert!(sizes.iter().all(|size| *size > 50), "{sizes:?}");
        for wrong in ["0/3", "4/3", "1", "a/b", "1/0"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
