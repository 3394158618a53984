//! Extensions on the host's side: the tables that a plugin offers, and in a file for each extension its methods of
//! [`crate::Plugin`], [`crate::Model`], [`crate::OpenedDevice`] and [`crate::ActiveDevice`]. One line in this module
//! makes a host query an extension.

mod active_region;
mod calibration;
pub(crate) mod centerline;
mod connection;
mod contact_set;
mod details;
mod energy_ledger;
mod grip;
pub(crate) mod independent_stop;
mod linear_field;
mod pacing;
mod shape;
pub(crate) mod snapshot;
mod soft_range;
mod workspace_bounds;
mod world;
mod world_contacts;

use crate::LoadError;
use crate::offers::Offers;
use flotor_hal::extension::{
    active_region::ActiveRegionTable, calibration::CalibrationTable, centerline::CenterlineTable,
    connection::ConnectionTable, contact_set::ContactSetTable, details::DetailsTable,
    energy_ledger::EnergyLedgerTable, grip::GripTable, independent_stop::IndependentStopTable,
    linear_field::LinearFieldTable, pacing::PacingTable, shape::ShapeTable, snapshot::SnapshotTable,
    soft_range::SoftRangeTable, variant::VariantTable, workspace_bounds::WorkspaceBoundsTable,
    world::WorldTable, world_contacts::WorldContactsTable,
};

macro_rules! extensions {
    ($($tables:ident { $($name:ident: $table:ident),+ $(,)? })+) => {
        $(
            /// Extension tables that a plugin offers.
            #[derive(Clone, Copy)]
            pub(crate) struct $tables {
                $(pub(crate) $name: Option<&'static $table>),+
            }

            impl $tables {
                pub(crate) fn of(offers: &Offers<'_>) -> Result<Self, LoadError> {
                    Ok(Self { $($name: offers.table()?),+ })
                }
            }
        )+

        /// Names of the tables that a host queries.
        #[cfg(test)]
        const TABLES: &[&str] = &[$($(stringify!($table)),+),+];
    };
}

extensions! {
    ModelExtensions {
        active_region: ActiveRegionTable,
        centerline: CenterlineTable,
        contact_set: ContactSetTable,
        details: DetailsTable,
        grip: GripTable,
        linear_field: LinearFieldTable,
        shape: ShapeTable,
        snapshot: SnapshotTable,
        soft_range: SoftRangeTable,
        variant: VariantTable,
        workspace_bounds: WorkspaceBoundsTable,
        world: WorldTable,
        world_contacts: WorldContactsTable,
    }
    DeviceExtensions {
        calibration: CalibrationTable,
        connection: ConnectionTable,
        energy_ledger: EnergyLedgerTable,
        grip: GripTable,
        independent_stop: IndependentStopTable,
        pacing: PacingTable,
        snapshot: SnapshotTable,
    }
}

#[cfg(test)]
mod tests {
    use super::TABLES;
    use flotor_hal::abi::LAYOUTS;
    use std::collections::BTreeSet;

    #[test]
    fn a_host_queries_every_extension_of_the_contract() {
        let tables = LAYOUTS.iter().map(|row| row.name()).filter(|name| name.ends_with("Table"));
        let extensions: BTreeSet<&str> =
            tables.filter(|name| !["ForceTable", "DeviceTable"].contains(name)).collect();
        assert_eq!(TABLES.iter().copied().collect::<BTreeSet<_>>(), extensions);
    }
}
