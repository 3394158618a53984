//! Entry points of a drop-in library.

/// Exports entry points as C functions; on a panic the function returns the value in brackets. A pointer argument
/// ([`Out`](crate::pointer::Out), [`In`](crate::pointer::In)) is null or points to as many values as the entry point states.
#[macro_export]
macro_rules! export {
    ($($(#[$meta:meta])* fn $name:ident($($argument:ident: $type:ty),* $(,)?) -> $result:ty [$fallback:expr] $body:block)*) => {
        $(
            $(#[$meta])*
            #[unsafe(no_mangle)]
            #[allow(clippy::too_many_arguments, clippy::unused_unit)] // as the interface has it
            pub(crate) extern "C" fn $name($($argument: $type),*) -> $result {
                $crate::guarded($fallback, || $body)
            }
        )*
    };
}
