//! Interfaces of a plugin: function tables by id. Only this crate builds tables, and the type of a table includes the
//! type of its instances, so that safe code cannot pass a host a table for instances of another type.

use super::Str;
use std::ffi::c_void;
use std::marker::PhantomData;

/// A function table of the contract; implemented by this crate for each of its tables.
///
/// # Safety
/// The type is `repr(C)`, starts with a `u32`, which is its size in bytes, and is valid for any bits: the other fields
/// are numbers, pointers, texts and functions that may be null. Plugins of this contract return a table of this type
/// for `ID`.
pub unsafe trait Table: Sized + 'static {
    /// Id of the interface or extension.
    const ID: &'static str;
}

/// Implements [`Table`] for a struct and defines `offer`, which builds the table of a plugin type, for the export
/// macros. `P of Kind` has a second type, which the compiler infers from the traits of the plugin type `P`.
macro_rules! table {
    ($table:ident: $id:literal, $plugin:ident $(of $kind:ident)?: [$($bound:tt)+] { $($fields:tt)+ }) => {
        #[doc(hidden)]
        #[must_use]
        #[allow(unreachable_pub, clippy::cast_possible_truncation)] // main interfaces stay here; sizes are small
        pub const fn offer<$plugin: $($bound)+ $(, $kind)?>() -> $crate::abi::Interface<$plugin> {
            let table = const { &$table { size: size_of::<$table>() as u32, $($fields)+ } };
            $crate::abi::Interface::of(table)
        }

        const _: () = assert!(std::mem::offset_of!($table, size) == 0);

        // SAFETY: a `repr(C)` struct that starts with its size (see above), and for the rest numbers, pointers, texts
        // and functions that may be null.
        unsafe impl $crate::abi::interface::Table for $table {
            const ID: &'static str = $id;
        }
        // SAFETY: an immutable static table; its pointers lead to immutable statics and code.
        unsafe impl Sync for $table {}
        // SAFETY: as for `Sync`.
        unsafe impl Send for $table {}
    };
}
pub(crate) use table;

/// Function table for instances of `P`, with its interface id. Only the `offer` functions, one for each function table of the
/// contract, construct an `Interface`:
///
/// ```compile_fail,E0624
/// use flotor_hal::abi::{Interface, MAGIC};
/// let forged: Interface<()> = Interface::of(&MAGIC);
/// ```
pub struct Interface<P> {
    id: &'static str,
    table: *const c_void,
    plugin: PhantomData<fn(P)>,
}

impl<P> Interface<P> {
    /// Wraps a table whose functions take instances of `P`.
    pub(crate) const fn of<T: Table>(table: &'static T) -> Self {
        Self { id: T::ID, table: std::ptr::from_ref(table).cast(), plugin: PhantomData }
    }
}

/// List of the extensions of a plugin type `P`, implemented by the export macros.
pub trait Extensions<P: 'static>: 'static {
    /// Function tables, one per extension.
    const LIST: &'static [Interface<P>];
}

impl<P: 'static> Extensions<P> for () {
    const LIST: &'static [Interface<P>] = &[];
}

/// Returns the table of an id; null if not offered.
pub(super) fn find<P: 'static, E: Extensions<P>>(main: &Interface<P>, id: Str) -> *const c_void {
    let mut offered = std::iter::once(main).chain(E::LIST);
    offered.find(|interface| interface.id == id.as_str()).map_or(std::ptr::null(), |found| found.table)
}
