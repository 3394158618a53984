//! Words of enumerations: the labels used in tables and on command lines.

/// Implements `word` for an enumeration without fields.
#[macro_export]
macro_rules! words {
    ($name:ident { $($value:ident = $word:literal),+ $(,)? }) => {
        impl $name {
            /// Returns the label used in tables and on command lines.
            #[must_use]
            pub fn word(self) -> &'static str {
                match self {
                    $(Self::$value => $word,)+
                }
            }
        }
    };
}
