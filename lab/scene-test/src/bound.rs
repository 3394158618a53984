//! Bounds of the numbers of a run.

use serde_json::Value;

/// Bound of one value.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Bound {
    /// Minimum and maximum; at least one of the two.
    Range { min: Option<f64>, max: Option<f64> },
    /// Value with a tolerance.
    Near { value: f64, within: f64 },
    /// Exact number.
    Number(f64),
    /// Exact text.
    Word(String),
    /// Exact truth value.
    Flag(bool),
}

impl Bound {
    /// Parses a bound; `None` for a table without a key of a bound, which is a level of the path. The error is a
    /// message.
    pub(crate) fn read(value: &toml::Value) -> Result<Option<Self>, String> {
        const KEYS: [&str; 4] = ["min", "max", "value", "within"];
        let table = match value {
            toml::Value::Table(table) => table,
            toml::Value::String(word) => return Ok(Some(Self::Word(word.clone()))),
            toml::Value::Boolean(flag) => return Ok(Some(Self::Flag(*flag))),
            other => return number(other).map(|number| Some(Self::Number(number))),
        };
        if !table.keys().any(|key| KEYS.contains(&key.as_str())) {
            return Ok(None);
        }
        if let Some(unknown) = table.keys().find(|key| !KEYS.contains(&key.as_str())) {
            return Err(format!("unknown key `{unknown}` of a bound; write min, max, or value and within"));
        }
        let get = |key: &str| table.get(key).map(number).transpose();
        match (get("min")?, get("max")?, get("value")?, get("within")?) {
            (Some(min), Some(max), None, None) if min > max => {
                Err(format!("min = {min} is above max = {max}, so no value passes; exchange the numbers"))
            }
            (min, max, None, None) => Ok(Some(Self::Range { min, max })),
            (None, None, Some(value), Some(within)) if within >= 0.0 => {
                Ok(Some(Self::Near { value, within }))
            }
            (None, None, Some(_), Some(within)) => Err(format!("within = {within}: write 0 or more")),
            _ => Err("write { min, max }, { min }, { max } or { value, within }".to_owned()),
        }
    }

    /// Returns true if a value is within the bound. NaN and a missing value never are.
    pub(crate) fn is_met_by(&self, value: Option<&Value>) -> bool {
        let number = value.and_then(Value::as_f64).unwrap_or(f64::NAN);
        match self {
            Self::Word(word) => value.and_then(Value::as_str) == Some(word),
            Self::Flag(flag) => value.and_then(Value::as_bool) == Some(*flag),
            Self::Number(exact) => number == *exact,
            Self::Near { value, within } => (value - within..=value + within).contains(&number),
            Self::Range { min, max } => {
                (min.unwrap_or(f64::NEG_INFINITY)..=max.unwrap_or(f64::INFINITY)).contains(&number)
            }
        }
    }

    /// Returns the finite ends of the bound, in ascending order.
    pub(crate) fn ends(&self) -> Vec<f64> {
        match self {
            Self::Range { min, max } => [min, max].into_iter().filter_map(|end| *end).collect(),
            Self::Near { value, within } => vec![value - within, value + within],
            Self::Number(exact) => vec![*exact],
            Self::Word(_) | Self::Flag(_) => Vec::new(),
        }
    }

    /// Returns true if a value of this type could be within the bound.
    pub(crate) fn fits(&self, value: &Value) -> bool {
        match (self, value) {
            (_, Value::Null) => true,
            (Self::Word(_), value) => value.is_string(),
            (Self::Flag(_), value) => value.is_boolean(),
            (_, value) => value.is_number(),
        }
    }

    /// Describes the bound in words.
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Range { min: Some(min), max: Some(max) } => format!("{min} to {max}"),
            Self::Range { min: Some(min), .. } => format!("at least {min}"),
            Self::Range { max, .. } => format!("at most {}", max.unwrap_or(f64::INFINITY)),
            Self::Near { value, within } => format!("{value} within {within}"),
            Self::Number(number) => number.to_string(),
            Self::Word(word) => word.clone(),
            Self::Flag(flag) => flag.to_string(),
        }
    }
}

/// Parses a finite number of a test file.
pub(crate) fn number(value: &toml::Value) -> Result<f64, String> {
    let number = match value {
        toml::Value::Integer(number) => *number as f64,
        toml::Value::Float(number) => *number,
        other => return Err(format!("write a number instead of this {}", other.type_str())),
    };
    if number.is_finite() { Ok(number) } else { Err(format!("write a finite number instead of {number}")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn bound(text: &str) -> Result<Option<Bound>, String> {
        let table: toml::Table = format!("b = {text}").parse().unwrap();
        Bound::read(&table["b"])
    }

    #[test]
    fn a_bound_ends_at_its_numbers() {
        let ends = |text: &str| bound(text).unwrap().unwrap().ends();
        assert_eq!(ends("{ min = -1, max = 2 }"), [-1.0, 2.0]);
        assert_eq!((ends("{ max = 2 }"), ends("{ value = 2, within = 0.5 }")), (vec![2.0], vec![1.5, 2.5]));
        assert_eq!((ends("3"), ends("true")), (vec![3.0], Vec::new()));
    }

    #[test]
    fn a_bound_is_met_from_edge_to_edge_and_never_by_nan() {
        let range = bound("{ min = -1e-3, max = 2 }").unwrap().unwrap();
        for (value, is_met) in [(-1e-3, true), (2.0, true), (2.1, false), (-1.0, false)] {
            assert_eq!(range.is_met_by(Some(&json!(value))), is_met, "{value}");
        }
        for bad in [json!(null), json!("NaN"), json!([])] {
            assert!(!range.is_met_by(Some(&bad)));
        }
        assert!(!range.is_met_by(None));
        let near = bound("{ value = 2.4, within = 0.1 }").unwrap().unwrap();
        assert!(near.is_met_by(Some(&json!(2.45))) && !near.is_met_by(Some(&json!(2.2))));
        assert!(!bound("\"ok\"").unwrap().unwrap().is_met_by(Some(&json!("failed"))));
        assert!(bound("0").unwrap().unwrap().is_met_by(Some(&json!(0))));
    }

    #[test]
    fn a_bound_that_nothing_or_everything_meets_is_an_error() {
        for text in
            ["{ min = 2, max = 1 }", "{ value = 1 }", "{ min = nan }", "{ min = 1, mx = 2 }", "[1]", "inf"]
        {
            assert!(bound(text).is_err(), "{text}");
        }
        assert_eq!(bound("{ port_end_j = 1 }"), Ok(None), "a level of the path");
    }
}
