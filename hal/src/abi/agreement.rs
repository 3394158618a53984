//! Comparison of the contract layouts of host and plugin; the first difference is reported in one line.

use super::layout_table::CORE_COUNT;
use super::{Entry, FieldLayout, LAYOUTS};

/// Result of the second layout proof, after the layout tables compared equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Proof {
    /// abi_stable confirms the layouts, including all function signatures.
    #[cfg_attr(not(feature = "layout-proof"), allow(dead_code))]
    Proven,
    /// Host or plugin carries no abi_stable proof, or the plugin used an incompatible abi_stable.
    NotProven,
}

impl Entry {
    /// Compares the layout table of the plugin with the table of this build and, if both carry an abi_stable proof, the
    /// proofs. Not real-time; runs the plugin's code if it carries a proof.
    ///
    /// # Errors
    /// A description of the first difference.
    ///
    /// # Safety
    /// The entry came from [`Entry::at`] or from this build, and its contract version is the version of this build: its
    /// pointers may be followed.
    pub unsafe fn compare_layouts(&'static self) -> Result<Proof, String> {
        if self.layouts.is_null() || !self.layouts.is_aligned() || self.layout_count == 0 {
            return Err("the plugin has no valid layout table".to_owned());
        }
        // SAFETY: the contract of an entry: a static array of so many rows.
        let theirs = unsafe { std::slice::from_raw_parts(self.layouts, self.layout_count as usize) };
        match difference(&LAYOUTS, theirs) {
            Some(difference) => Err(difference),
            // SAFETY: as for this function.
            None => unsafe { second_proof(self) },
        }
    }
}

/// Describes the first row that differs; `None` if all rows match. An extension struct known to one side only is no
/// difference: that extension is not offered or not requested.
fn difference(ours: &[FieldLayout], theirs: &[FieldLayout]) -> Option<String> {
    let named = |rows: &'_ [FieldLayout], name: &str| rows.iter().copied().find(|row| row.name() == name);
    let at = |row: FieldLayout| match row.name().contains('.') {
        true => format!("at byte {} ({} bytes)", row.offset, row.size),
        false => format!("{} bytes", row.size),
    };
    for (number, our) in ours.iter().enumerate() {
        match named(theirs, our.name()) {
            Some(their) if their == *our => {}
            Some(their) => {
                let (ours, theirs) = (at(*our), at(their));
                return Some(format!("`{}` is {ours} in the host and {theirs} in the plugin", our.name()));
            }
            None if number < CORE_COUNT || named(theirs, our.struct_name()).is_some() => {
                return Some(format!("the plugin lacks `{}`", our.name()));
            }
            None => {}
        }
    }
    let known = |row: &&FieldLayout| named(ours, row.struct_name()).is_some();
    let unknown = theirs.iter().filter(known).find(|row| named(ours, row.name()).is_none());
    unknown.map(|row| format!("the host lacks `{}`", row.name()))
}

#[cfg(not(feature = "layout-proof"))]
unsafe fn second_proof(_: &'static Entry) -> Result<Proof, String> {
    Ok(Proof::NotProven)
}

/// # Safety
/// As for [`Entry::compare_layouts`].
#[cfg(feature = "layout-proof")]
unsafe fn second_proof(entry: &'static Entry) -> Result<Proof, String> {
    use super::Str;
    use super::layout_table::proof::types;
    use abi_stable::library::AbiHeader;
    use abi_stable::type_layout::TypeLayout;

    // SAFETY: a plugin's proof is null or a static of it.
    let Some(proof) = (unsafe { whole_proof(entry.layout_proof) }) else { return Ok(Proof::NotProven) };
    // SAFETY: an `AbiHeader` is frozen by abi_stable for ever and says whether the rest can be read.
    let header = unsafe { proof.abi_stable_header.cast::<AbiHeader>().as_ref() };
    let (true, Some(layout_of)) = (header.is_some_and(AbiHeader::is_valid), proof.layout_of) else {
        return Ok(Proof::NotProven);
    };
    for (name, ours) in types() {
        // SAFETY: a plugin's `layout_of` takes a name and gives null or a static of the abi_stable just checked.
        match unsafe { layout_of(Str::new(name)).cast::<TypeLayout>().as_ref() } {
            Some(theirs) => same(name, ours, theirs)?,
            None => return Ok(Proof::NotProven),
        }
    }
    Ok(Proof::Proven)
}

/// Returns the proof at an address; `None` if null, misaligned or too short.
///
/// # Safety
/// Null, or the address of a static proof, or of as much of one as the size it starts with says.
#[cfg(feature = "layout-proof")]
unsafe fn whole_proof(address: *const super::LayoutProof) -> Option<&'static super::LayoutProof> {
    if address.is_null() || !address.is_aligned() {
        return None;
    }
    // SAFETY: aligned, and every proof starts with its size, as this function demands.
    let size = unsafe { (&raw const (*address).size).read() };
    if (size as usize) < size_of::<super::LayoutProof>() {
        return None;
    }
    // SAFETY: aligned and, by its own word, whole; a static of a plugin, which is never unloaded.
    Some(unsafe { &*address })
}

#[cfg(feature = "layout-proof")]
fn same(
    name: &str,
    ours: &'static abi_stable::type_layout::TypeLayout,
    theirs: &'static abi_stable::type_layout::TypeLayout,
) -> Result<(), String> {
    abi_stable::abi_stability::abi_checking::check_layout_compatibility(ours, theirs)
        .map_err(|_| format!("`{name}` has another layout or other function signatures in the plugin"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, offset: usize, size: usize) -> FieldLayout {
        FieldLayout::new(name, offset, size)
    }

    #[test]
    fn a_table_is_equal_to_itself_and_names_what_differs() {
        assert_eq!(difference(&LAYOUTS, &LAYOUTS), None);
        let mut theirs = LAYOUTS;
        for their in &mut theirs {
            match their.name() {
                "Input.time_ns" => *their = row("Input.time_ns", 120, 8),
                "Input.tick" => *their = row("Input.tick", 104, 8),
                _ => {}
            }
        }
        let told =
            "`Input.time_ns` is at byte 104 (8 bytes) in the host and at byte 120 (8 bytes) in the plugin";
        assert_eq!(difference(&LAYOUTS, &theirs).as_deref(), Some(told));
    }

    #[test]
    fn a_field_is_missed_on_both_sides() {
        let without =
            |name: &str| -> Vec<_> { LAYOUTS.into_iter().filter(|row| row.name() != name).collect() };
        let told = difference(&LAYOUTS, &without("Wrench.torque_nm"));
        assert_eq!(told.as_deref(), Some("the plugin lacks `Wrench.torque_nm`"));
        let told = difference(&without("PacingTable.wait_for_sample"), &LAYOUTS);
        assert_eq!(told.as_deref(), Some("the host lacks `PacingTable.wait_for_sample`"));
        let core: Vec<_> = LAYOUTS.into_iter().take(CORE_COUNT).collect();
        assert_eq!(difference(&LAYOUTS, &core), None, "a plugin that knows no extension");
        assert!(difference(&LAYOUTS, &core[1..]).is_some(), "a plugin that does not know `Str`");
    }

    /// Rows of the C header before contact sets and shared objects were part of the contract, as a compiler fills them in:
    /// `Struct.field`, offset and size.
    const EARLIER: &str = include_str!("layouts_before_contact_sets.txt");

    #[test]
    fn a_plugin_built_before_contact_sets_agrees_and_one_before_codes_of_a_cycle_is_refused() {
        let number = |text: Option<&str>| text.and_then(|text| text.parse().ok()).expect("a number");
        let row_of = |line: &'static str| {
            let mut parts = line.split(' ');
            let name = parts.next().expect("a name");
            row(name, number(parts.next()), number(parts.next()))
        };
        let mut theirs: Vec<FieldLayout> = EARLIER.lines().map(row_of).collect();
        assert!(theirs.len() > CORE_COUNT && theirs.iter().all(|row| row.struct_name() != "ContactSet"));
        assert_eq!(difference(&LAYOUTS, &theirs), None);
        // Still earlier, `read` and `write` of a device returned a plain number.
        theirs.retain(|row| row.struct_name() != "CycleCode");
        assert_eq!(difference(&LAYOUTS, &theirs).as_deref(), Some("the plugin lacks `CycleCode`"));
    }

    /// abi_stable sees what the table does not: the same bytes, and a function that takes something else.
    #[cfg(feature = "layout-proof")]
    #[test]
    fn the_second_proof_sees_signatures() {
        use abi_stable::StableAbi;

        mod theirs {
            #[repr(C)]
            #[derive(abi_stable::StableAbi)]
            pub(super) struct PacingTable {
                size: u32,
                reserved: u32,
                wait_for_sample: Option<unsafe extern "C" fn(crate::abi::Instance, u32, *mut u64) -> u32>,
            }
        }
        let ours = crate::extension::pacing::PacingTable::LAYOUT;
        assert_eq!(same("PacingTable", ours, ours), Ok(()));
        let told = "`PacingTable` has another layout or other function signatures in the plugin";
        assert_eq!(same("PacingTable", ours, theirs::PacingTable::LAYOUT), Err(told.to_owned()));
    }
}
