//! The layout table: name, offset and size of every field of every struct and function table of the contract, as the
//! compiler of a plugin saw them. Every plugin carries a table, in C too, and the host compares it with its own.
//!
//! With feature `layout-proof` a plugin carries a second, independent proof by abi_stable, which also covers function
//! signatures. The call path does not use the proof, and a plugin without a proof is only "not proven".

use crate::{device, extension, frame, model, parameter};

/// Size of a name in the table, bytes.
const NAME_BYTES: usize = 48;

/// Row of the layout table: a field, or a whole struct.
#[repr(C)]
#[derive(Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct FieldLayout {
    /// `Struct.field`, or `Struct` for the whole struct; padded with zeros.
    pub(crate) name: [u8; 48],
    /// Offset of the field in its struct, bytes; 0 for a struct.
    pub offset: u32,
    /// Size of the field or struct, bytes.
    pub size: u32,
}

impl FieldLayout {
    /// Builds a row at compile time.
    #[allow(clippy::cast_possible_truncation)] // a few hundred bytes
    pub(crate) const fn new(text: &str, offset: usize, size: usize) -> Self {
        let (text, mut name, mut i) = (text.as_bytes(), [0; NAME_BYTES], 0);
        assert!(text.len() < NAME_BYTES, "NAME_BYTES is too small for this name");
        while i < text.len() {
            name[i] = text[i];
            i += 1;
        }
        Self { name, offset: offset as u32, size: size as u32 }
    }

    /// Returns `Struct.field` or `Struct`; empty if a plugin wrote bytes that are not UTF-8.
    #[must_use]
    pub fn name(&self) -> &str {
        let text = self.name.split(|byte| *byte == 0).next().unwrap_or_default();
        std::str::from_utf8(text).unwrap_or_default()
    }

    /// Returns the name of the struct.
    #[cfg(feature = "loader")]
    pub(crate) fn struct_name(&self) -> &str {
        self.name().split('.').next().unwrap_or_default()
    }
}

/// Returns the size of the field that a function selects, bytes.
pub(crate) const fn size_of_field<S, F>(_: fn(&S) -> &F) -> usize {
    size_of::<F>()
}

/// Defines the layout rows of the structs of a module; a missing field is a compile error.
macro_rules! layout {
    ($($name:ident { $($field:ident),+ $(,)? })+) => {
        $(const _: fn(&$name) = |$name { $($field: _),+ }| ();)+

        /// Layouts of the structs of this module.
        pub(crate) const LAYOUT: &[$crate::abi::FieldLayout] = &[$(
            $crate::abi::FieldLayout::new(stringify!($name), 0, size_of::<$name>()),
            $($crate::abi::FieldLayout::new(
                concat!(stringify!($name), ".", stringify!($field)),
                std::mem::offset_of!($name, $field),
                $crate::abi::layout::size_of_field(|whole: &$name| &whole.$field),
            ),)+
        )+];

        /// Layouts of the structs by abi_stable.
        #[cfg(feature = "layout-proof")]
        pub(crate) const PROOF: &[(&str, &abi_stable::type_layout::TypeLayout)] =
            &[$((stringify!($name), <$name as abi_stable::StableAbi>::LAYOUT)),+];
    };
}
pub(crate) use layout;

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
#[cfg(feature = "loader")]
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

/// The layout table of this build.
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
