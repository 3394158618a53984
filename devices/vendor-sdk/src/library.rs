//! Library of the SDK, opened at run time and never closed, because SDKs leave threads and handlers behind.
#![allow(unsafe_code)] // libloading; listed in tests/tests/system/architecture.rs

use crate::platform::{self, Loaded};
use crate::problem::LibraryProblem;
use crate::search::{Sdk, looked_at};
use std::ffi::{CStr, c_char};
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};

/// Symbol exported by Flotor's own drop-in libraries.
const MARKER: &[u8] = b"flotor_dropin\0";

/// Policy for Flotor's own drop-in libraries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DropInPolicy {
    /// Reject drop-in libraries: no simulated device without consent.
    Refuse,
    /// Accept drop-in libraries as simulated devices.
    Accept,
}

/// Open library of an SDK.
#[derive(Debug)]
pub struct Library {
    loaded: ManuallyDrop<Loaded>,
    path: PathBuf,
}

impl Library {
    /// Opens the library: the file `chosen`, else the first library for this processor in the folders of SDK and
    /// system. Not real-time; runs the constructors of the library.
    ///
    /// # Errors
    /// [`LibraryProblem`] with the cause and the remedy.
    pub fn open(sdk: &Sdk, chosen: Option<&str>, policy: DropInPolicy) -> Result<Self, LibraryProblem> {
        let places = match chosen {
            Some(path) => vec![PathBuf::from(path)],
            None => sdk.places(|variable| std::env::var(variable).ok().filter(|value| !value.is_empty())),
        };
        let mut problem = None;
        for place in &places {
            match looked_at(place) {
                Some(Ok(())) => return Self::load(place, policy),
                // Possibly for another processor: a later folder may have the right file.
                Some(Err(why)) => problem = problem.or(Some(why)),
                None => {}
            }
        }
        Err(problem.unwrap_or(LibraryProblem::NotFound { sdk: sdk.name, searched: places }))
    }

    fn load(path: &Path, policy: DropInPolicy) -> Result<Self, LibraryProblem> {
        // SAFETY: the user guarantees that the file is the library of the SDK that is named: loading it runs its code. It is
        // bound at once and shares no names with other libraries.
        let loaded = unsafe { platform::open(path) };
        let loaded = loaded.map_err(|error| {
            let mut cause: &dyn std::error::Error = &error;
            while let Some(deeper) = cause.source() {
                cause = deeper;
            }
            LibraryProblem::Refused { path: path.to_path_buf(), reason: cause.to_string() }
        })?;
        let library = Self { loaded: ManuallyDrop::new(loaded), path: path.to_path_buf() };
        // SAFETY: only its address is looked at; it is not called.
        let is_stand_in = unsafe { library.optional::<*const ()>(MARKER) }.is_some();
        match policy {
            DropInPolicy::Refuse if is_stand_in => Err(LibraryProblem::StandIn { path: library.path }),
            DropInPolicy::Refuse | DropInPolicy::Accept => Ok(library),
        }
    }

    /// Returns the path of the opened file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Looks up a function of the library, `None` if missing; the name must end in `\0`. Not real-time.
    ///
    /// # Safety
    /// `F` is a function pointer of the type that the SDK documents for this name.
    #[must_use]
    pub unsafe fn optional<F: Copy>(&self, name: &[u8]) -> Option<F> {
        // SAFETY: by the contract of this function; the library is never closed, so that the copy stays valid.
        unsafe { self.loaded.get::<F>(name) }.ok().map(|symbol| *symbol)
    }
}

/// Copies a static text of an SDK; empty for a null pointer.
///
/// # Safety
/// `text` is null, or a text that ends in a null byte and is never freed or changed.
#[must_use]
pub unsafe fn static_text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: not null; the rest by the contract of this function.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

/// Declares functions of an SDK: a struct with a pointer for each, and `load`, which looks up all functions. A function
/// marked `safe` has no precondition and takes any numbers: it gets a safe method, by the name before the equals sign.
/// Functions marked `optional` may be missing. For use in an FFI module with the declarations that the SDK documents:
/// the caller of a function guarantees its arguments.
#[macro_export]
macro_rules! sdk_functions {
    (
        $(#[$meta:meta])* $visibility:vis struct $table:ident needs $needed:literal {
            $(fn $name:ident($($argument:ty),* $(,)?) $(-> $result:ty)?;)+
            $(safe fn $method:ident = $plain:ident($($place:ident: $number:ty),* $(,)?) $(-> $code:ty)?;)*
            $(optional fn $perhaps:ident($($given:ty),* $(,)?) $(-> $answer:ty)?;)*
        }
    ) => {
        $(#[$meta])*
        #[allow(non_snake_case)] // the names are another maker's
        #[derive(Clone, Copy, Debug)]
        $visibility struct $table {
            $($visibility $name: unsafe extern "C" fn($($argument),*) $(-> $result)?,)+
            $($visibility $plain: unsafe extern "C" fn($($number),*) $(-> $code)?,)*
            $($visibility $perhaps: Option<unsafe extern "C" fn($($given),*) $(-> $answer)?>,)*
        }

        impl $table {
            /// Looks up all functions; fails if a function that is not optional is missing. Not real-time.
            $visibility fn load(library: &$crate::Library) -> Result<Self, $crate::LibraryProblem> {
                let missing = |function| $crate::LibraryProblem::MissingFunction {
                    path: library.path().to_path_buf(),
                    function,
                    needed: $needed.to_owned(),
                };
                Ok(Self {
                    // SAFETY: the types of this block are those the SDK documents for the names.
                    $($name: unsafe { library.optional(concat!(stringify!($name), "\0").as_bytes()) }
                        .ok_or_else(|| missing(stringify!($name)))?,)+
                    // SAFETY: as above.
                    $($plain: unsafe { library.optional(concat!(stringify!($plain), "\0").as_bytes()) }
                        .ok_or_else(|| missing(stringify!($plain)))?,)*
                    // SAFETY: as above.
                    $($perhaps: unsafe { library.optional(concat!(stringify!($perhaps), "\0").as_bytes()) },)*
                })
            }

            $($visibility fn $method(&self, $($place: $number),*) $(-> $code)? {
                // SAFETY: by its mark `safe` the function takes any numbers.
                unsafe { (self.$plain)($($place),*) }
            })*
        }
    };
}
