//! The layout table of this build: the rows of every struct and function table of the contract. Every plugin, also in C,
//! contains such a table, and the host compares the table of the plugin with its own.
//!
//! With feature `layout-proof` a plugin contains a second, independent proof by abi_stable, which also covers function
//! signatures. The call path does not use the proof; a plugin without a proof is loaded and reported as not proven.

use super::FieldLayout;
use crate::{device, extension, frame, model, parameter};

macro_rules! core {
    ($($($part:ident)::+),+ $(,)?) => {
        /// Rows that every plugin must have; data first, so that an error names the struct and not a table that contains the struct.
        const CORE: &[&[FieldLayout]] = &[$($($part)::+::LAYOUT),+];

        /// Layouts of the core structs by abi_stable.
        #[cfg(feature = "layout-proof")]
        const CORE_PROOF: &[&[(&str, &abi_stable::type_layout::TypeLayout)]] = &[$($($part)::+::PROOF),+];
    };
}
core!(super::text, frame, parameter, model, device, super::entry, super::model, super::device);

/// Number of rows every plugin must have.
pub(crate) const CORE_COUNT: usize = count(CORE);

const COUNT: usize = count(CORE) + count(extension::LAYOUTS);

const fn count(groups: &[&[FieldLayout]]) -> usize {
    let (mut total, mut i) = (0, 0);
    while i < groups.len() {
        total += groups[i].len();
        i += 1;
    }
    total
}

/// Layout table of this build: the rows that every plugin must have, then the rows of the extensions.
pub static LAYOUTS: [FieldLayout; COUNT] = {
    let mut table = [FieldLayout::new("", 0, 0); COUNT];
    let (lists, mut at, mut list) = ([CORE, extension::LAYOUTS], 0, 0);
    while list < lists.len() {
        let mut group = 0;
        while group < lists[list].len() {
            let mut row = 0;
            while row < lists[list][group].len() {
                table[at] = lists[list][group][row];
                (at, row) = (at + 1, row + 1);
            }
            group += 1;
        }
        list += 1;
    }
    table
};

/// Layout proof by abi_stable.
#[cfg(feature = "layout-proof")]
pub(crate) mod proof {
    use crate::abi::{LayoutProof, Str};
    use crate::extension;
    use abi_stable::library::AbiHeader;
    use abi_stable::type_layout::TypeLayout;
    use std::ffi::c_void;

    /// Returns every type of the contract with its name.
    pub(crate) fn types() -> impl Iterator<Item = &'static (&'static str, &'static TypeLayout)> {
        super::CORE_PROOF.iter().chain(extension::PROOFS).copied().flatten()
    }

    unsafe extern "C" fn layout_of(name: Str) -> *const c_void {
        let found = types().find(|(known, _)| *known == name.as_str());
        found.map_or(std::ptr::null(), |(_, layout)| std::ptr::from_ref::<TypeLayout>(layout).cast())
    }

    static HEADER: AbiHeader = AbiHeader::VALUE;

    /// Layout proof carried by every Rust plugin of this build.
    #[allow(clippy::cast_possible_truncation)] // 24 bytes
    pub(crate) static PROOF: LayoutProof = LayoutProof {
        size: size_of::<LayoutProof>() as u32,
        reserved: 0,
        abi_stable_header: (&raw const HEADER).cast(),
        layout_of: Some(layout_of),
    };
}
