//! Compares the contract as host and plugin were compiled, and says in one line what differs.

use crate::abi::proof::{CONTRACT, EXTENSIONS, Layout};
use crate::abi::{ContractSizes, Entry, LayoutProof, Str};
use abi_stable::abi_stability::abi_checking::check_layout_compatibility;
use abi_stable::library::AbiHeader;
use abi_stable::type_layout::TLData;

/// Whether a plugin carried a layout proof.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Proof {
    /// Every layout was compared.
    Checked,
    /// None to compare (a C plugin): sizes only.
    Absent,
}

/// Compares sizes and, where the plugin carries them, layouts.
///
/// # Safety
/// `entry` is a live entry whose magic, size and contract version were checked: its pointers may be followed.
pub(super) unsafe fn contract(entry: &'static Entry) -> Result<Proof, String> {
    sizes(&entry.sizes)?;
    if entry.layout_proof.is_null() {
        return Ok(Proof::Absent);
    }
    // SAFETY: not null, so by the contract of this function a static proof of the plugin.
    let Some(proof) = (unsafe { whole_proof(entry.layout_proof) }) else {
        return Err("the plugin's layout proof is not whole".to_owned());
    };
    // SAFETY: an `AbiHeader` is frozen by abi_stable for ever and says whether the rest can be read.
    let header = unsafe { proof.abi_stable_header.cast::<AbiHeader>().as_ref() };
    if !header.is_some_and(AbiHeader::is_valid) {
        return Err("the plugin's layout proof was made by another abi_stable".to_owned());
    }
    let Some(layout_of) = proof.layout_of else { return Err("the layout proof has no layouts".to_owned()) };
    // SAFETY: a plugin's `layout_of` takes a name and gives null or a static of the abi_stable just checked.
    let theirs = |name| unsafe { layout_of(Str::new(name)).cast::<Layout>().as_ref() };
    for (name, ours) in CONTRACT {
        let theirs = theirs(name).ok_or_else(|| format!("the plugin knows no `{name}`"))?;
        same(name, ours, theirs)?;
    }
    for (name, ours) in EXTENSIONS {
        theirs(name).map_or(Ok(()), |theirs| same(name, ours, theirs))?;
    }
    Ok(Proof::Checked)
}

/// The proof at an address, if none of it is missing.
///
/// # Safety
/// The address of a static proof, or of as much of one as the size it starts with says.
unsafe fn whole_proof(address: *const LayoutProof) -> Option<&'static LayoutProof> {
    if !address.is_aligned() {
        return None;
    }
    // SAFETY: aligned, and every proof starts with its size, as this function demands.
    let size = unsafe { (&raw const (*address).size).read() };
    if (size as usize) < size_of::<LayoutProof>() {
        return None;
    }
    // SAFETY: aligned and, by its own word, whole; a static of a plugin, which is never unloaded.
    Some(unsafe { &*address })
}

fn same(name: &str, ours: &'static Layout, theirs: &'static Layout) -> Result<(), String> {
    if let Some(difference) = field_difference(name, ours, theirs) {
        return Err(difference);
    }
    check_layout_compatibility(ours, theirs)
        .map_err(|_| format!("`{name}` has another layout or other function signatures in the plugin"))
}

fn sizes(theirs: &ContractSizes) -> Result<(), String> {
    let ours = ContractSizes::of_this_build();
    let pairs = [
        ("Input", ours.input, theirs.input),
        ("Output", ours.output, theirs.output),
        ("DeviceState", ours.device_state, theirs.device_state),
        ("Capabilities", ours.capabilities, theirs.capabilities),
        ("Parameter", ours.parameter, theirs.parameter),
        ("ParameterValue", ours.parameter_value, theirs.parameter_value),
    ];
    match pairs.iter().find(|(_, ours, theirs)| ours != theirs) {
        None => Ok(()),
        Some((name, ours, theirs)) => {
            Err(format!("`{name}` has {ours} bytes in the host and {theirs} in the plugin"))
        }
    }
}

/// First field that differs. abi_stable's own report of a mismatch is hundreds of lines long.
fn field_difference(name: &str, ours: &'static Layout, theirs: &'static Layout) -> Option<String> {
    let (TLData::Struct { fields: our_fields }, TLData::Struct { fields: their_fields }) =
        (ours.data(), theirs.data())
    else {
        return None;
    };
    for (ours, theirs) in our_fields.iter().zip(their_fields.iter()) {
        let (our_type, their_type) = (ours.full_type().to_string(), theirs.full_type().to_string());
        if ours.name() != theirs.name() || our_type != their_type {
            return Some(format!(
                "`{name}` has `{}: {our_type}` in the host where the plugin has `{}: {their_type}`",
                ours.name(),
                theirs.name()
            ));
        }
    }
    let (our_count, their_count) = (our_fields.len(), their_fields.len());
    (our_count != their_count)
        .then(|| format!("`{name}` has {our_count} fields in the host and {their_count} in the plugin"))
}
