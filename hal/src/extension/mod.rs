//! Extensions: optional interfaces of a plugin, in addition to its main interface. Each extension is one file, named
//! like its trait, its table, its id and its name in [`crate::export_model!`] or [`crate::export_device!`]. The
//! crate `flotor-loader` has the host's side of each.
#![allow(unsafe_code)]

pub mod active_region;
pub mod calibration;
pub mod centerline;
pub mod connection;
pub mod contact_set;
pub mod details;
pub mod energy_ledger;
pub mod grip;
pub mod independent_stop;
pub mod linear_field;
pub mod pacing;
pub mod shape;
pub mod snapshot;
pub mod soft_range;
pub mod variant;
pub mod workspace_bounds;
pub mod world;
pub mod world_contacts;

macro_rules! extensions {
    ($($name:ident),+ $(,)?) => {
        /// Layouts of the structs of all extensions.
        pub(crate) const LAYOUTS: &[&[crate::abi::FieldLayout]] = &[$($name::LAYOUT),+];

        /// Layouts of the structs of all extensions by abi_stable.
        #[cfg(feature = "layout-proof")]
        pub(crate) const PROOFS: &[&[(&str, &abi_stable::type_layout::TypeLayout)]] = &[$($name::PROOF),+];
    };
}

extensions! {
    active_region,
    centerline,
    contact_set,
    details,
    grip,
    linear_field,
    shape,
    snapshot,
    soft_range,
    variant,
    workspace_bounds,
    world,
    world_contacts,
    calibration,
    connection,
    energy_ledger,
    independent_stop,
    pacing,
}
