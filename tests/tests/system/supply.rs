//! What Flotor is built of, compared with `deny.toml`: licences, sources, and crates that nobody maintains any more.
//! `cargo deny` checks the same and the advisories; this needs no network and no further tool.

use cargo_metadata::{Metadata, MetadataCommand, Package};
use flotor_tests::TestSize;
use flotor_tests::tools::VARIABLE;
use flotor_tests::workspace_root;
use std::collections::BTreeSet;
use toml::{Table, Value};

/// The workspaces: the core, and those of their own beside it.
pub(super) const WORKSPACES: [&str; 4] = [".", "interop/python", "interop/bridge", "interop/sweep"];

/// Abandoned crates that `deny.toml` names, and a lock file that has each. One that is gone is to be struck out there.
const ABANDONED: [(&str, &str); 7] = [
    ("generational-arena", "."),
    ("paste", "."),
    ("abi_stable", "."),
    ("rustls-pemfile", "interop/bridge"),
    ("serde_yaml", "interop/bridge"),
    ("unsafe-libyaml", "interop/bridge"),
    ("lz4_flex", "interop/bridge"),
];

fn rules() -> (Table, String) {
    let text = std::fs::read_to_string(workspace_root().join("deny.toml")).expect("deny.toml is text");
    (text.parse().expect("deny.toml is TOML"), text)
}

fn words(value: Option<&Value>) -> Vec<String> {
    let list = value.and_then(Value::as_array).map_or(&[][..], Vec::as_slice);
    list.iter().filter_map(|word| Some(word.as_str()?.to_owned())).collect()
}

/// The licences a crate may have.
fn allowed(rules: &Table, name: &str) -> Vec<String> {
    let licenses = rules["licenses"].as_table().expect("[licenses]");
    let exceptions = licenses["exceptions"].as_array().expect("exceptions");
    let own =
        exceptions.iter().filter(|exception| exception.get("crate").and_then(Value::as_str) == Some(name));
    words(licenses.get("allow")).into_iter().chain(own.flat_map(|own| words(own.get("allow")))).collect()
}

/// Whether an SPDX expression can be met by these licences; `/` is the older way to write OR.
fn is_met(expression: &str, allowed: &[String]) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let tokens: Vec<&str> = spaced.split_whitespace().collect();
    let mut at = 0;
    any_of(&tokens, &mut at, allowed) && at == tokens.len()
}

fn any_of(tokens: &[&str], at: &mut usize, allowed: &[String]) -> bool {
    let mut met = all_of(tokens, at, allowed);
    while tokens.get(*at) == Some(&"OR") {
        *at += 1;
        met |= all_of(tokens, at, allowed);
    }
    met
}

fn all_of(tokens: &[&str], at: &mut usize, allowed: &[String]) -> bool {
    let mut met = one(tokens, at, allowed);
    while tokens.get(*at) == Some(&"AND") {
        *at += 1;
        met &= one(tokens, at, allowed);
    }
    met
}

fn one(tokens: &[&str], at: &mut usize, allowed: &[String]) -> bool {
    let Some(token) = tokens.get(*at) else { return false };
    *at += 1;
    if *token == "(" {
        let met = any_of(tokens, at, allowed);
        *at += usize::from(tokens.get(*at) == Some(&")"));
        return met;
    }
    let mut name = (*token).to_owned();
    if let (Some(&"WITH"), Some(exception)) = (tokens.get(*at), tokens.get(*at + 1)) {
        name = format!("{name} WITH {exception}");
        *at += 2;
    }
    allowed.contains(&name)
}

/// What a workspace locks for this machine; `None` if some of it was never fetched here.
fn locked(workspace: &str) -> Option<Metadata> {
    let mut command = MetadataCommand::new();
    command.manifest_path(workspace_root().join(workspace).join("Cargo.toml"));
    let target = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    command
        .other_options(["--offline", "--locked", "--filter-platform", &target].map(str::to_owned).to_vec());
    command.exec().ok()
}

fn complaint(rules: &Table, package: &Package) -> Option<String> {
    let expression = package.license.as_deref().unwrap_or("no licence");
    let source = package.source.as_ref().map_or("", |source| source.repr.as_str());
    if !is_met(expression, &allowed(rules, package.name.as_ref())) {
        return Some(format!("{} {}: {expression} is not in deny.toml", package.name, package.version));
    }
    let is_known = source.is_empty() || source.contains("github.com/rust-lang/crates.io-index");
    (!is_known).then(|| format!("{}: comes from {source}", package.name))
}

#[test]
fn every_crate_has_a_licence_that_the_list_allows() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let (rules, _) = rules();
    for workspace in WORKSPACES {
        let Some(metadata) = locked(workspace) else {
            // A plain `cargo test` fetches what the default members need; the viewer's crates may be missing. The daily checks have all.
            assert!(
                workspace != "." || std::env::var_os(VARIABLE).is_none(),
                "the checks have fetched the core"
            );
            println!("skipped: the crates of {workspace} were never fetched on this machine");
            continue;
        };
        let complaints: Vec<String> =
            metadata.packages.iter().filter_map(|package| complaint(&rules, package)).collect();
        assert!(metadata.packages.len() > 20 && complaints.is_empty(), "{workspace}: {complaints:#?}");
    }
}

#[test]
fn an_expression_is_met_as_spdx_says() {
    let allowed = ["MIT", "ISC", "Apache-2.0 WITH LLVM-exception"].map(str::to_owned);
    for met in ["MIT", "GPL-3.0-only OR MIT", "GPL-2.0/MIT", "MIT AND ISC", "(GPL-2.0 OR MIT) AND ISC"] {
        assert!(is_met(met, &allowed), "{met}");
    }
    assert!(is_met("Apache-2.0 WITH LLVM-exception OR GPL-2.0", &allowed));
    for unmet in
        ["GPL-3.0-only", "MIT AND GPL-2.0", "(GPL-2.0 OR MIT) AND GPL-3.0", "Apache-2.0", "no licence", ""]
    {
        assert!(!is_met(unmet, &allowed), "{unmet}");
    }
}

/// Names in a lock file.
fn names(workspace: &str) -> BTreeSet<String> {
    let text =
        std::fs::read_to_string(workspace_root().join(workspace).join("Cargo.lock")).unwrap_or_default();
    let names = text.lines().filter_map(|line| line.strip_prefix("name = \"")?.strip_suffix('"'));
    names.map(str::to_owned).collect()
}

#[test]
fn what_nobody_maintains_is_named_with_the_way_out_and_still_there() {
    let (rules, text) = rules();
    for (name, workspace) in ABANDONED {
        assert!(text.contains(name), "deny.toml does not name {name}");
        assert!(
            names(workspace).contains(name),
            "{name} is gone from {workspace}: strike it out in deny.toml"
        );
    }
    let ignored = rules["advisories"]["ignore"].as_array().expect("a list");
    for advisory in ignored {
        let reason = advisory.get("reason").and_then(Value::as_str).unwrap_or_default();
        assert!(reason.contains("Out: "), "{advisory} names no way out");
    }
    let exceptions = rules["licenses"]["exceptions"].as_array().expect("a list");
    let all: BTreeSet<String> = WORKSPACES.iter().flat_map(|workspace| names(workspace)).collect();
    for exception in exceptions {
        let name = exception.get("crate").and_then(Value::as_str).unwrap_or_default();
        assert!(all.contains(name), "{name} is in no lock file: strike it out in deny.toml");
    }
}
