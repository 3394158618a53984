//! Layout proof: a Rust plugin carries the layout of every contract type as its compiler saw it, and the host
//! compares each with its own, field by field and through function signatures.
//!
//! abi_stable makes and compares the layouts; it is not the call path, so C plugins, which carry none, load
//! too (they are held to [`super::ContractSizes`] and to the assertions in the header).

use super::{
    ActivityTable, CalibrationTable, CenterlineTable, ContractSizes, DetailsTable, DevicePacingTable,
    DeviceTable, EnergyLedgerTable, ForceTable, Host, LayoutProof, LinearFieldTable, Message, ReachTable,
    Str, VariantTable,
};
use crate::{
    ActivityRegion, Capabilities, CenterlineInfo, Detail, DeviceState, EnergyLedger, Input, LinearField,
    LoopConfig, Output, Parameter, ParameterValue, Pose, Reach, Tick, Twist, VariantInfo,
    VerticalCalibration, Wrench,
};
use abi_stable::StableAbi;
use abi_stable::library::AbiHeader;
use abi_stable::type_layout::TypeLayout;
use std::ffi::c_void;

/// The layout type behind the pointers of [`LayoutProof::layout_of`].
pub type Layout = TypeLayout;

/// The header behind [`LayoutProof::abi_stable_header`].
pub static HEADER: AbiHeader = AbiHeader::VALUE;

/// Every type a plugin of this contract knows, by name; data first, so that a report names the struct and not a table using it.
pub const CONTRACT: [(&str, &TypeLayout); 16] = [
    ("Pose", Pose::LAYOUT),
    ("Twist", Twist::LAYOUT),
    ("Wrench", Wrench::LAYOUT),
    ("Input", Input::LAYOUT),
    ("Output", Output::LAYOUT),
    ("LoopConfig", LoopConfig::LAYOUT),
    ("Tick", Tick::LAYOUT),
    ("DeviceState", DeviceState::LAYOUT),
    ("Capabilities", Capabilities::LAYOUT),
    ("Parameter", Parameter::LAYOUT),
    ("ParameterValue", ParameterValue::LAYOUT),
    ("Message", Message::LAYOUT),
    ("Host", Host::LAYOUT),
    ("ContractSizes", ContractSizes::LAYOUT),
    ("ForceTable", ForceTable::LAYOUT),
    ("DeviceTable", DeviceTable::LAYOUT),
];

/// The types of the extensions. A plugin that knows one means what the host means; an older plugin knows fewer and
/// offers fewer.
pub const EXTENSIONS: [(&str, &TypeLayout); 17] = [
    ("ActivityRegion", ActivityRegion::LAYOUT),
    ("ActivityTable", ActivityTable::LAYOUT),
    ("CenterlineInfo", CenterlineInfo::LAYOUT),
    ("CenterlineTable", CenterlineTable::LAYOUT),
    ("LinearField", LinearField::LAYOUT),
    ("LinearFieldTable", LinearFieldTable::LAYOUT),
    ("Reach", Reach::LAYOUT),
    ("ReachTable", ReachTable::LAYOUT),
    ("VariantInfo", VariantInfo::LAYOUT),
    ("VariantTable", VariantTable::LAYOUT),
    ("Detail", Detail::LAYOUT),
    ("DetailsTable", DetailsTable::LAYOUT),
    ("EnergyLedger", EnergyLedger::LAYOUT),
    ("EnergyLedgerTable", EnergyLedgerTable::LAYOUT),
    ("VerticalCalibration", VerticalCalibration::LAYOUT),
    ("CalibrationTable", CalibrationTable::LAYOUT),
    ("DevicePacingTable", DevicePacingTable::LAYOUT),
];

unsafe extern "C" fn layout_of(name: Str) -> *const c_void {
    let found = CONTRACT.iter().chain(&EXTENSIONS).find(|(known, _)| *known == name.as_str());
    found.map_or(std::ptr::null(), |(_, layout)| std::ptr::from_ref::<TypeLayout>(layout).cast())
}

/// The proof every Rust plugin of this build carries.
#[allow(clippy::cast_possible_truncation)] // 24 bytes
pub static PROOF: LayoutProof = LayoutProof {
    size: size_of::<LayoutProof>() as u32,
    reserved: 0,
    abi_stable_header: (&raw const HEADER).cast(),
    layout_of: Some(layout_of),
};
