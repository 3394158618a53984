//! Rows of the layout table: name, offset and size of every field of a struct or function table of the contract, as the
//! compiler of a plugin saw them.

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
