//! Plugin metadata as TOML text in a section of the file, readable without running the plugin.
//!
//! The text is assembled at compile time by `export_model!` and `export_device!`; a C plugin writes it with
//! one macro of the header. The section survives `strip` and the linker's garbage collection.

use super::{CONTRACT, PluginKind};

/// Name of the metadata section in ELF and PE files.
pub const SECTION: &str = ".flotor";

/// Contents of the metadata text.
#[derive(Clone, Copy)]
pub struct Facts {
    /// Model or device.
    pub kind: PluginKind,
    /// Id in scenes and commands.
    pub id: &'static str,
    /// Display name.
    pub name: &'static str,
    /// Description in one sentence.
    pub doc: &'static str,
    /// Version of the plugin.
    pub version: &'static str,
    /// Name of the exported entry.
    pub entry: &'static str,
}

/// Compile-time writer to a fixed buffer; with `N` = 0, a byte counter.
struct Writer<const N: usize> {
    bytes: [u8; N],
    len: usize,
}

impl<const N: usize> Writer<N> {
    const fn text(mut self, text: &str) -> Self {
        let text = text.as_bytes();
        let mut i = 0;
        while i < text.len() {
            if self.len < N {
                self.bytes[self.len] = text[i];
            }
            self.len += 1;
            i += 1;
        }
        self
    }

    const fn line(self, key: &str, value: &str) -> Self {
        let bytes = value.as_bytes();
        let mut i = 0;
        while i < bytes.len() {
            let plain = bytes[i] >= b' ' && bytes[i] != b'"' && bytes[i] != b'\\';
            assert!(plain, "id, name and doc of a plugin are single lines without quotes or backslashes");
            i += 1;
        }
        self.text(key).text(" = \"").text(value).text("\"\n")
    }
}

const fn write<const N: usize>(facts: &Facts) -> Writer<N> {
    Writer { bytes: [0; N], len: 0 }
        .line("kind", facts.kind.name())
        .line("id", facts.id)
        .line("name", facts.name)
        .line("doc", facts.doc)
        .line("version", facts.version)
        .line("abi", CONTRACT)
        .line("entry", facts.entry)
}

/// Returns the length of the metadata text, bytes.
#[must_use]
pub const fn length(facts: &Facts) -> usize {
    write::<0>(facts).len
}

/// Renders the metadata text into an array of [`length`] bytes.
#[must_use]
pub const fn render<const N: usize>(facts: &Facts) -> [u8; N] {
    write::<N>(facts).bytes
}

/// Common part of both export macros: the entry static and the metadata section.
#[doc(hidden)]
#[macro_export]
macro_rules! export_plugin {
    ($plugin:ty, $trait:ident, $kind:ident, $entry:ident $(, $extension:ident)*) => {
        /// The plugin's entry: found by name in the shared library, or linked directly into a test.
        // One symbol per crate, so that several plugins can be linked into one binary.
        #[unsafe(export_name = concat!("flotor_entry_", env!("CARGO_CRATE_NAME")))]
        pub static FLOTOR_ENTRY: $crate::abi::Entry = {
            struct Offered;
            impl $crate::abi::Extensions<$plugin> for Offered {
                const LIST: &'static [$crate::abi::Interface<$plugin>] =
                    &[$($crate::extension::$extension::offer()),*];
            }
            $crate::abi::$entry::<$plugin, Offered>()
        };

        const _: () = {
            const FACTS: $crate::abi::metadata::Facts = $crate::abi::metadata::Facts {
                kind: $crate::abi::PluginKind::$kind,
                id: <$plugin as $crate::$trait>::INFO.id(),
                name: <$plugin as $crate::$trait>::INFO.name(),
                doc: <$plugin as $crate::$trait>::INFO.doc(),
                version: env!("CARGO_PKG_VERSION"),
                entry: concat!("flotor_entry_", env!("CARGO_CRATE_NAME")),
            };
            #[used]
            #[cfg_attr(not(target_vendor = "apple"), unsafe(link_section = ".flotor"))]
            #[cfg_attr(target_vendor = "apple", unsafe(link_section = "__DATA,__flotor"))]
            // The linker of a DLL drops statics that are used but not exported.
            #[cfg_attr(windows, unsafe(export_name = concat!("flotor_metadata_", env!("CARGO_CRATE_NAME"))))]
            static METADATA: [u8; $crate::abi::metadata::length(&FACTS)] =
                $crate::abi::metadata::render(&FACTS);
        };
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_complete_and_exact() {
        const FACTS: Facts = Facts {
            kind: PluginKind::Model,
            id: "floor",
            name: "Floor",
            doc: "A flat floor",
            version: "1.2.3",
            entry: "flotor_entry_floor",
        };
        const TEXT: [u8; length(&FACTS)] = render(&FACTS);
        let expected = "kind = \"model\"\nid = \"floor\"\nname = \"Floor\"\ndoc = \"A flat floor\"\n\
                        version = \"1.2.3\"\nabi = \"1.0-rc\"\nentry = \"flotor_entry_floor\"\n";
        assert_eq!(std::str::from_utf8(&TEXT), Ok(expected));
    }
}
