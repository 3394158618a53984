//! Findings of `flotor validate`.

use serde_json::Value;

/// Finding of one rule.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum RuleFinding<'a> {
    /// The rule holds.
    Holds,
    /// The rule cannot be checked on this system, or does not apply to this plugin; with the reason.
    NotJudged { rule: &'a str, why: &'a str },
    /// The rule is violated, or was not checked though it could be.
    Fails { rule: &'a str, text: &'a str, seen: String },
}

impl<'a> RuleFinding<'a> {
    /// Parses a finding from its JSON.
    pub(crate) fn of(finding: &'a Value) -> Self {
        let word = |key: &str| finding.get(key).and_then(Value::as_str);
        let (rule, text) = (word("rule").unwrap_or_default(), word("text").unwrap_or_default());
        match (word("violation"), word("unchecked")) {
            (Some(seen), _) => Self::Fails { rule, text, seen: seen.to_owned() },
            (None, Some(why)) if matches!(word("obstacle"), Some("system" | "subject")) => {
                Self::NotJudged { rule, why }
            }
            (None, Some(why)) => {
                Self::Fails { rule, text, seen: format!("the rule could not be checked: {why}") }
            }
            (None, None) => Self::Holds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn only_what_no_plugin_could_pass_here_passes_unchecked() {
        let finding = |obstacle: Option<&str>| json!({ "rule": "no-threads", "text": "it starts none", "violation": null, "unchecked": "why", "obstacle": obstacle });
        for obstacle in ["system", "subject"] {
            let found = finding(Some(obstacle));
            assert_eq!(RuleFinding::of(&found), RuleFinding::NotJudged { rule: "no-threads", why: "why" });
        }
        for obstacle in [Some("requirement"), None] {
            let failed = finding(obstacle);
            let RuleFinding::Fails { rule, seen, .. } = RuleFinding::of(&failed) else {
                panic!("{obstacle:?} passed")
            };
            assert_eq!((rule, seen.as_str()), ("no-threads", "the rule could not be checked: why"));
        }
        assert_eq!(
            RuleFinding::of(&json!({ "rule": "loads", "violation": null, "unchecked": null })),
            RuleFinding::Holds
        );
        assert!(matches!(
            RuleFinding::of(&json!({ "rule": "loads", "violation": "no" })),
            RuleFinding::Fails { .. }
        ));
    }
}
