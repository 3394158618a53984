//! Table lookup of a plugin by interface id; tables shorter than the contract's are rejected.

use super::LoadError;
use flotor_hal::abi::{Entry, Str, Table};
use std::ffi::c_void;
use std::path::Path;

type GetInterface = unsafe extern "C" fn(id: Str) -> *const c_void;

/// Table lookup of a plugin. For any id, `get_interface` returns null or the address of a static table that starts with
/// its size in bytes and, up to this size, has the layout of the table of that id.
pub(crate) struct Offers<'a> {
    path: &'a Path,
    get_interface: GetInterface,
}

impl<'a> Offers<'a> {
    /// Returns the lookup of an entry.
    ///
    /// # Errors
    /// [`LoadError::MissingFunction`] without `get_interface`.
    ///
    /// # Safety
    /// `entry` is the entry of a plugin that keeps the contract, as [`Offers`] states it.
    pub(super) unsafe fn of(path: &'a Path, entry: &'static Entry) -> Result<Self, LoadError> {
        match entry.get_interface() {
            Some(get_interface) => Ok(Self { path, get_interface }),
            None => Err(lack(path, "the entry", "has no `get_interface`")),
        }
    }

    /// Returns the table of an id that every plugin of its kind offers. Not real-time; runs the plugin's code.
    pub(super) fn required<T: Table>(&self) -> Result<&'static T, LoadError> {
        self.table()?.ok_or_else(|| self.lacks(T::ID, "is missing"))
    }

    /// Returns the table of an id; `None` if the plugin does not offer the table. A table that is too short is a
    /// mistake, not an older contract: the contract fixes the sizes of all tables.
    pub(crate) fn table<T: Table>(&self) -> Result<Option<&'static T>, LoadError> {
        // SAFETY: the plugin keeps the contract ([`Offers`]), by which any id may be asked for; this
        // one lives for ever.
        let table = unsafe { (self.get_interface)(Str::new(T::ID)) }.cast::<T>();
        if table.is_null() {
            return Ok(None);
        }
        if !table.is_aligned() {
            return Err(self.lacks(T::ID, "is not aligned"));
        }
        // SAFETY: not null, and aligned for a `T`, hence for the number it starts with ([`Table`]); so much
        // of it is there, however short it is ([`Offers`]).
        let size = unsafe { table.cast::<u32>().read() };
        if (size as usize) < size_of::<T>() {
            return Err(self.lacks(T::ID, "is shorter than in the contract"));
        }
        // SAFETY: not null and aligned, as was seen above; a `T` by its id, whole by its own word, and a
        // static of a library that is never unloaded ([`Offers`]); it takes any bits ([`Table`]).
        Ok(Some(unsafe { &*table }))
    }

    /// Rejects a table without one of its required functions, each given with its presence.
    pub(super) fn check_functions(
        &self,
        interface: &'static str,
        functions: &[(&'static str, bool)],
    ) -> Result<(), LoadError> {
        match functions.iter().find(|(_, present)| !present) {
            Some(&(name, _)) => Err(self.lacks(interface, name)),
            None => Ok(()),
        }
    }

    fn lacks(&self, interface: &'static str, missing: &'static str) -> LoadError {
        lack(self.path, interface, missing)
    }
}

fn lack(path: &Path, interface: &'static str, missing: &'static str) -> LoadError {
    LoadError::MissingFunction { path: path.into(), interface, missing }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::abi::{DeviceTable, ForceTable};
    use flotor_hal::extension::{
        active_region::ActiveRegionTable, calibration::CalibrationTable, centerline::CenterlineTable,
        connection::ConnectionTable, contact_set::ContactSetTable, details::DetailsTable,
        energy_ledger::EnergyLedgerTable, grip::GripTable, independent_stop::IndependentStopTable,
        linear_field::LinearFieldTable, pacing::PacingTable, shape::ShapeTable, snapshot::SnapshotTable,
        soft_range::SoftRangeTable, variant::VariantTable, workspace_bounds::WorkspaceBoundsTable,
        world::WorldTable, world_contacts::WorldContactsTable,
    };

    /// One byte short of the shortest tables there are.
    static SHORT: EnergyLedgerTable = EnergyLedgerTable { size: 15, reserved: 0, ledger: None };

    extern "C" fn short(_: Str) -> *const c_void {
        (&raw const SHORT).cast()
    }

    extern "C" fn askew(_: Str) -> *const c_void {
        (&raw const SHORT).cast::<u8>().wrapping_add(4).cast()
    }

    extern "C" fn nothing(_: Str) -> *const c_void {
        std::ptr::null()
    }

    fn refusal<T: Table>(get_interface: GetInterface) -> String {
        match (Offers { path: Path::new("some.so"), get_interface }).table::<T>() {
            Err(error) => error.to_string(),
            Ok(_) => panic!("`{}` was taken for a table", T::ID),
        }
    }

    fn is_held_to_its_length<T: Table>() {
        const REMEDY: &str = "use the export macros or the current header, and build the plugin again";
        let told = |what: &str| format!("some.so: the table `{}` {what}; {REMEDY}", T::ID);
        assert_eq!(refusal::<T>(short), told("is shorter than in the contract"));
        assert_eq!(refusal::<T>(askew), told("is not aligned"));
        let offers = Offers { path: Path::new("some.so"), get_interface: nothing };
        assert!(offers.table::<T>().is_ok_and(|table| table.is_none()), "`{}` out of nothing", T::ID);
    }

    #[test]
    fn no_table_is_read_that_is_shorter_than_the_contracts() {
        is_held_to_its_length::<ForceTable>();
        is_held_to_its_length::<CenterlineTable>();
        is_held_to_its_length::<ShapeTable>();
        is_held_to_its_length::<SnapshotTable>();
        is_held_to_its_length::<SoftRangeTable>();
        is_held_to_its_length::<VariantTable>();
        is_held_to_its_length::<DetailsTable>();
        is_held_to_its_length::<ActiveRegionTable>();
        is_held_to_its_length::<ContactSetTable>();
        is_held_to_its_length::<LinearFieldTable>();
        is_held_to_its_length::<WorkspaceBoundsTable>();
        is_held_to_its_length::<WorldTable>();
        is_held_to_its_length::<WorldContactsTable>();
        is_held_to_its_length::<DeviceTable>();
        is_held_to_its_length::<EnergyLedgerTable>();
        is_held_to_its_length::<CalibrationTable>();
        is_held_to_its_length::<GripTable>();
        is_held_to_its_length::<IndependentStopTable>();
        is_held_to_its_length::<PacingTable>();
        is_held_to_its_length::<ConnectionTable>();
    }
}
