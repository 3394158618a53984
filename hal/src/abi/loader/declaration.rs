//! Checks of the ids and lists in a plugin's tables, for mistakes that the layout comparison cannot find.

use super::interfaces::Interface;
use super::model::ModelTables;

/// Maximum number of entries of a list.
const MOST_ENTRIES: u32 = 4096;

/// Compares the id in the tables with the id in the metadata; rejects a list at a null pointer or above the limit.
pub(super) fn check(interface: &Interface, id: &str) -> Result<(), String> {
    let ([own, ..], (parameters, count)) = (interface.texts(), interface.parameters());
    if own != id {
        return Err(format!("the id `{own}`, but its metadata have the id `{id}`; make both equal"));
    }
    list("parameters", !parameters.is_null(), count)?;
    match interface {
        Interface::Model(ModelTables { extensions, .. }) => extensions
            .details
            .map_or(Ok(()), |table| list("details", !table.details.is_null(), table.detail_count)),
        Interface::Device { .. } => Ok(()),
    }
}

/// Returns the static list of a table; empty at a null pointer.
///
/// # Safety
/// `first` is null or the address of `count` initialised values that stay for ever.
pub(crate) unsafe fn static_list<T>(first: *const T, count: u32) -> &'static [T] {
    if first.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: by the contract of this function.
    unsafe { std::slice::from_raw_parts(first, count as usize) }
}

fn list(what: &str, is_there: bool, count: u32) -> Result<(), String> {
    match count {
        0 => Ok(()),
        _ if count > MOST_ENTRIES => {
            Err(format!("{count} {what}, above the limit of {MOST_ENTRIES}; declare fewer"))
        }
        _ if !is_there => Err(format!("{count} {what} at a null pointer; set the pointer to their list")),
        _ => Ok(()),
    }
}
