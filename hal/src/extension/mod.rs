//! Extensions: optional interfaces of a plugin, in addition to its main interface. Each extension is one file, named
//! like its trait, its table, its id and its name in [`crate::export_model!`] or [`crate::export_device!`]; one line in
//! this module makes a host query the extension.
#![allow(unsafe_code)]

pub mod active_region;
pub mod calibration;
pub mod centerline;
pub mod connection;
pub mod details;
pub mod energy_ledger;
pub mod independent_stop;
pub mod linear_field;
pub mod pacing;
pub mod shape;
pub mod soft_range;
pub mod variant;
pub mod workspace_bounds;

macro_rules! extensions {
    ($($tables:ident { $($name:ident: $table:ident),+ $(,)? })+) => {
        /// Layouts of the structs of all extensions.
        pub(crate) const LAYOUTS: &[&[crate::abi::FieldLayout]] = &[$($($name::LAYOUT),+),+];

        /// Layouts of the structs of all extensions by abi_stable.
        #[cfg(feature = "layout-proof")]
        pub(crate) const PROOFS: &[&[(&str, &abi_stable::type_layout::TypeLayout)]] = &[$($($name::PROOF),+),+];

        $(
            /// Extension tables that a plugin offers.
            #[cfg(feature = "loader")]
            #[derive(Clone, Copy)]
            pub(crate) struct $tables {
                $(pub(crate) $name: Option<&'static $name::$table>),+
            }

            #[cfg(feature = "loader")]
            impl $tables {
                pub(crate) fn of(
                    offers: &crate::abi::loader::Offers<'_>,
                ) -> Result<Self, crate::abi::loader::LoadError> {
                    Ok(Self { $($name: offers.table()?),+ })
                }
            }
        )+
    };
}

extensions! {
    ModelExtensions {
        active_region: ActiveRegionTable,
        centerline: CenterlineTable,
        details: DetailsTable,
        linear_field: LinearFieldTable,
        shape: ShapeTable,
        soft_range: SoftRangeTable,
        variant: VariantTable,
        workspace_bounds: WorkspaceBoundsTable,
    }
    DeviceExtensions {
        calibration: CalibrationTable,
        connection: ConnectionTable,
        energy_ledger: EnergyLedgerTable,
        independent_stop: IndependentStopTable,
        pacing: PacingTable,
    }
}
