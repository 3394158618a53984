//! Checks of the ids and lists in a plugin's tables, for mistakes that the layout comparison cannot find.

use super::interfaces::Interface;
use super::model::ModelTables;
use flotor_hal::Parameter;
use flotor_hal::abi::check_schema;

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

/// Returns the schema of a table, or the problem if a count or a text is invalid.
///
/// # Safety
/// `parameters` is null or the address of `count` parameters that stay for ever, as far as `count` is legal.
pub(super) unsafe fn checked_schema(
    parameters: *const Parameter,
    count: u32,
) -> Result<&'static [Parameter], String> {
    if !parameters.is_null() && count > MOST_ENTRIES {
        return Err(format!("the plugin has {count} parameters, above the limit of {MOST_ENTRIES}"));
    }
    // SAFETY: as this function demands.
    let schema = unsafe { static_list(parameters, count) };
    check_schema(schema).map(|()| schema)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_that_cannot_be_is_refused_before_anything_is_read() {
        let one = Parameter::real("stiffness_n_per_m", "N/m", 0.0, 1.0, 0.5, "Stiffness");
        // SAFETY: it is refused before it is read.
        let refused = unsafe { checked_schema(&raw const one, 1_000_000) };
        assert_eq!(
            refused.err(),
            Some("the plugin has 1000000 parameters, above the limit of 4096".to_owned())
        );
    }
}
