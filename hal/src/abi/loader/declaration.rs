//! Checks of the ids and lists in a plugin's tables, for mistakes that the layout comparison cannot find.

use super::interfaces::Interface;
use super::model::ModelTables;

/// Maximum number of entries of a list.
const MOST_ENTRIES: u32 = 4096;

/// Compares the id in the tables with the id in the metadata; rejects a list at a null pointer or above the limit.
pub(super) fn check(interface: &Interface, id: &str) -> Result<(), String> {
    let (own, has_list, count) = match interface {
        Interface::Model(ModelTables { force, .. }) => {
            (force.info.id(), !force.parameters.is_null(), force.parameter_count)
        }
        Interface::Device { device, .. } => {
            (device.info.id(), !device.parameters.is_null(), device.parameter_count)
        }
    };
    if own != id {
        return Err(format!("the id `{own}`, but its metadata have `{id}`"));
    }
    list("parameters", has_list, count)?;
    match interface {
        Interface::Model(ModelTables { extensions, .. }) => extensions
            .details
            .map_or(Ok(()), |table| list("details", !table.details.is_null(), table.detail_count)),
        Interface::Device { .. } => Ok(()),
    }
}

fn list(what: &str, is_there: bool, count: u32) -> Result<(), String> {
    match count {
        0 => Ok(()),
        _ if count > MOST_ENTRIES => Err(format!("{count} {what}, above the limit of {MOST_ENTRIES}")),
        _ if !is_there => Err(format!("{count} {what} at a null pointer")),
        _ => Ok(()),
    }
}
