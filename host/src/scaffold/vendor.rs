//! Copy of the contract's sources that builds outside their workspace.

use super::error::ScaffoldError;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use toml::{Table, Value};

/// Files and folders of the contract that a build needs, with the licences.
const COPIED: [&str; 5] = ["src", "include", "README.md", "LICENSE-MIT", "LICENSE-APACHE"];

/// Copies the contract's sources in `from` to the new folder `to`, with a manifest that needs no workspace.
///
/// # Errors
/// If a file cannot be read or written, or the manifest cannot be converted.
pub(super) fn write_copy(from: &Path, to: &Path) -> Result<(), ScaffoldError> {
    let manifest = read(&from.join("Cargo.toml"))?;
    let workspace = from.parent().and_then(|above| read(&above.join("Cargo.toml")).ok()).unwrap_or_default();
    let manifest = standalone(&manifest, &workspace)
        .map_err(|reason| ScaffoldError::Manifest { path: from.join("Cargo.toml"), reason })?;
    write_file(&to.join("Cargo.toml"), &manifest)?;
    let mut present = COPIED.iter().filter(|name| from.join(name).exists());
    present.try_for_each(|name| copy(&from.join(name), &to.join(name)))
}

/// Writes a new file and creates its parent folders; an existing file is an error.
pub(super) fn write_file(path: &Path, text: &str) -> Result<(), ScaffoldError> {
    let above = path.parent().map_or(Ok(()), std::fs::create_dir_all);
    let written =
        above.and_then(|()| File::create_new(path)).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|cause| ScaffoldError::Write { path: path.into(), cause })
}

fn read(path: &Path) -> Result<String, ScaffoldError> {
    std::fs::read_to_string(path).map_err(|cause| ScaffoldError::Read { path: path.into(), cause })
}

fn copy(from: &Path, to: &Path) -> Result<(), ScaffoldError> {
    if !from.is_dir() {
        return write_file(to, &read(from)?);
    }
    let unreadable = |cause| ScaffoldError::Read { path: from.into(), cause };
    for entry in std::fs::read_dir(from).map_err(unreadable)? {
        let name = entry.map_err(unreadable)?.file_name();
        copy(&from.join(&name), &to.join(&name))?;
    }
    Ok(())
}

/// Replaces the `workspace = true` references of a manifest by the values in the workspace's manifest.
fn standalone(manifest: &str, workspace: &str) -> Result<String, String> {
    let parsed = |text: &str| text.parse::<Table>().map_err(|error| error.to_string());
    let (mut manifest, workspace) = (parsed(manifest)?, parsed(workspace)?);
    // The lints serve the development of the contract only.
    manifest.remove("lints");
    let shared = |section: &str| workspace.get("workspace")?.get(section)?.as_table();
    for section in ["package", "dependencies"] {
        let Some(entries) = manifest.get_mut(section).and_then(Value::as_table_mut) else { continue };
        write_out(entries, shared(section))?;
    }
    Ok(manifest.to_string())
}

/// Replaces the entries that refer to the workspace by the entries of the workspace.
fn write_out(entries: &mut Table, shared: Option<&Table>) -> Result<(), String> {
    for (name, value) in entries {
        let Some(own) = value.as_table_mut().filter(|own| own.contains_key("workspace")) else {
            continue;
        };
        let theirs = shared.and_then(|shared| shared.get(name));
        let theirs = theirs.ok_or_else(|| format!("the workspace of the contract has no `{name}`"))?;
        own.remove("workspace");
        *value = with(theirs, std::mem::take(own));
    }
    Ok(())
}

/// Merges an entry of the workspace with the additions of a member; feature lists are concatenated.
fn with(theirs: &Value, mut own: Table) -> Value {
    if own.is_empty() {
        return theirs.clone();
    }
    let mut all = match theirs {
        Value::Table(table) => table.clone(),
        version => Table::from_iter([("version".to_owned(), version.clone())]),
    };
    if let (Some(Value::Array(theirs)), Some(Value::Array(more))) =
        (all.get_mut("features"), own.get("features"))
    {
        theirs.extend(more.iter().cloned());
        own.remove("features");
    }
    all.extend(own);
    Value::Table(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_member_takes_from_its_workspace_is_written_out() {
        let workspace = "[workspace.package]\nedition = \"2024\"\n[workspace.dependencies]\na = \"1.2\"\n\
                         b = { version = \"3\", features = [\"x\"] }\n";
        let manifest = "[package]\nname = \"m\"\nedition.workspace = true\n[dependencies]\na = { workspace = true, \
                        optional = true }\nb = { workspace = true, features = [\"y\"] }\nc = \"4\"\n\
                        [lints]\nworkspace = true\n";
        let written: Table = standalone(manifest, workspace).unwrap().parse().unwrap();
        let expected: Table =
            "[package]\nname = \"m\"\nedition = \"2024\"\n[dependencies]\na = { version = \"1.2\", \
                               optional = true }\nb = { version = \"3\", features = [\"x\", \"y\"] }\nc = \"4\"\n"
                .parse()
                .unwrap();
        assert_eq!(written, expected);
        // Of a package, nothing is to be written out.
        assert_eq!(standalone(&expected.to_string(), "").unwrap().parse::<Table>().unwrap(), expected);
        assert!(standalone(manifest, "").unwrap_err().contains("`edition`"));
    }
}
