//! Lookup of the function tables behind an entry; tables shorter than the contract's are rejected.

use super::LoadError;
use super::model::ModelTables;
use crate::Parameter;
use crate::abi::interface::Table;
use crate::abi::{DeviceTable, Entry, ForceTable, PluginKind, Str};
use crate::extension::{DeviceExtensions, ModelExtensions};
use std::ffi::c_void;
use std::path::Path;

/// Function tables of a plugin, by its kind.
#[derive(Clone, Copy)]
pub(super) enum Interface {
    Model(ModelTables),
    Device { device: &'static DeviceTable, extensions: DeviceExtensions },
}

impl Interface {
    /// Gets the tables of a plugin by its kind. Not real-time; runs the plugin's code.
    ///
    /// # Errors
    /// [`LoadError::MissingFunction`] if the interface or a required function is missing, or if a table, also of an
    /// extension, is shorter than the contract's.
    ///
    /// # Safety
    /// `entry` is the entry of a plugin that keeps the contract: for any id, `get_interface` returns null or the address of a
    /// static table that starts with its size in bytes and, up to this size, has the layout of the table of that id.
    pub(super) unsafe fn find(
        path: &Path,
        entry: &'static Entry,
        kind: PluginKind,
    ) -> Result<Self, LoadError> {
        let Some(get_interface) = entry.get_interface else {
            return Err(lack(path, "the entry", "has no `get_interface`"));
        };
        let offers = Offers { path, get_interface };
        match kind {
            PluginKind::Device => offers.device(),
            PluginKind::Model => offers.model(),
        }
    }

    /// Returns id, name and description in the main table.
    pub(super) fn texts(&self) -> [&'static str; 3] {
        match self {
            Self::Model(ModelTables { force, .. }) => [force.info.id(), force.info.name(), force.info.doc()],
            Self::Device { device, .. } => [device.info.id(), device.info.name(), device.info.doc()],
        }
    }

    /// Returns the unchecked list of parameters in the main table, with its length.
    pub(super) fn parameters(&self) -> (*const Parameter, u32) {
        match self {
            Self::Model(ModelTables { force, .. }) => (force.parameters, force.parameter_count),
            Self::Device { device, .. } => (device.parameters, device.parameter_count),
        }
    }
}

type GetInterface = unsafe extern "C" fn(id: Str) -> *const c_void;

/// Table lookup of a plugin. `get_interface` meets the conditions of [`Interface::find`].
pub(crate) struct Offers<'a> {
    path: &'a Path,
    get_interface: GetInterface,
}

impl Offers<'_> {
    fn device(&self) -> Result<Interface, LoadError> {
        let device: &'static DeviceTable = self.required()?;
        let functions = [
            ("has no `open`", device.open.is_some()),
            ("has no `close`", device.close.is_some()),
            ("has no `capabilities`", device.capabilities.is_some()),
            ("has no `activate`", device.activate.is_some()),
            ("has no `deactivate`", device.deactivate.is_some()),
            ("has no `read`", device.read.is_some()),
            ("has no `write`", device.write.is_some()),
            ("has no `safe_stop`", device.safe_stop.is_some()),
        ];
        self.check_functions(DeviceTable::ID, &functions)?;
        let extensions = DeviceExtensions::of(self)?;
        Ok(Interface::Device { device, extensions })
    }

    fn model(&self) -> Result<Interface, LoadError> {
        let force: &'static ForceTable = self.required()?;
        let functions = [
            ("has no `create`", force.create.is_some()),
            ("has no `destroy`", force.destroy.is_some()),
            ("has no `step`", force.step.is_some()),
        ];
        self.check_functions(ForceTable::ID, &functions)?;
        Ok(Interface::Model(ModelTables { force, extensions: ModelExtensions::of(self)? }))
    }

    fn required<T: Table>(&self) -> Result<&'static T, LoadError> {
        self.table()?.ok_or_else(|| self.lacks(T::ID, "is missing"))
    }

    /// Returns the table of an id; `None` if the plugin does not offer the table. A table that is too short is a
    /// mistake, not an older contract: the contract fixes the sizes of all tables.
    pub(crate) fn table<T: Table>(&self) -> Result<Option<&'static T>, LoadError> {
        // SAFETY: the plugin keeps the contract ([`Interface::find`]), by which any id may be asked for; this
        // one lives for ever.
        let table = unsafe { (self.get_interface)(Str::new(T::ID)) }.cast::<T>();
        if table.is_null() {
            return Ok(None);
        }
        if !table.is_aligned() {
            return Err(self.lacks(T::ID, "is not aligned"));
        }
        // SAFETY: not null, and aligned for a `T`, hence for the number it starts with ([`Table`]); so much
        // of it is there, however short it is ([`Interface::find`]).
        let size = unsafe { table.cast::<u32>().read() };
        if (size as usize) < size_of::<T>() {
            return Err(self.lacks(T::ID, "is shorter than in the contract"));
        }
        // SAFETY: not null and aligned, as was seen above; a `T` by its id, whole by its own word, and a
        // static of a library that is never unloaded ([`Interface::find`]); it takes any bits ([`Table`]).
        Ok(Some(unsafe { &*table }))
    }

    fn check_functions(
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
    use crate::extension::{
        active_region::ActiveRegionTable, calibration::CalibrationTable, centerline::CenterlineTable,
        connection::ConnectionTable, details::DetailsTable, energy_ledger::EnergyLedgerTable,
        independent_stop::IndependentStopTable, linear_field::LinearFieldTable, pacing::PacingTable,
        shape::ShapeTable, soft_range::SoftRangeTable, variant::VariantTable,
        workspace_bounds::WorkspaceBoundsTable,
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
        is_held_to_its_length::<SoftRangeTable>();
        is_held_to_its_length::<VariantTable>();
        is_held_to_its_length::<DetailsTable>();
        is_held_to_its_length::<ActiveRegionTable>();
        is_held_to_its_length::<LinearFieldTable>();
        is_held_to_its_length::<WorkspaceBoundsTable>();
        is_held_to_its_length::<DeviceTable>();
        is_held_to_its_length::<EnergyLedgerTable>();
        is_held_to_its_length::<CalibrationTable>();
        is_held_to_its_length::<IndependentStopTable>();
        is_held_to_its_length::<PacingTable>();
        is_held_to_its_length::<ConnectionTable>();
    }
}
