//! Pointers passed by a program: null is legal, and means that the program does not request the value. Values need not be
//! aligned: they may be fields of packed structures.

use std::ffi::{CStr, c_char};

/// Output pointer of a program; only an entry point receives one, as an argument.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct Out<T>(*mut T);

impl<T: Copy> Out<T> {
    /// Writes the value unless the pointer is null.
    pub fn put(self, value: T) {
        self.put_all(&[value]);
    }

    /// Writes consecutive values unless the pointer is null.
    pub fn put_all(self, values: &[T]) {
        if self.is_null() {
            return;
        }
        for (index, value) in values.iter().enumerate() {
            // SAFETY: the caller of an entry point passes null or a place for as many values as the entry point writes.
            unsafe { self.0.add(index).write_unaligned(*value) };
        }
    }

    /// Returns true if the pointer is null, so that the program does not request the value.
    #[must_use]
    pub fn is_null(self) -> bool {
        self.0.is_null()
    }
}

impl Out<c_char> {
    /// Writes a text and a NUL byte, together at most `room` bytes; truncates a longer text.
    pub fn put_text(self, text: &str, room: usize) {
        let cut = text.bytes().filter(|byte| *byte != 0).take(room.saturating_sub(1));
        let terminated: Vec<c_char> = cut.chain([0]).map(|byte| c_char::from_ne_bytes([byte])).collect();
        self.put_all(&terminated);
    }
}

/// Input pointer of a program; only an entry point receives one, as an argument.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct In<T>(*const T);

impl<T: Copy> In<T> {
    /// Reads the value; `None` for a null pointer.
    #[must_use]
    pub fn get(self) -> Option<T> {
        self.get_all().map(|[value]| value)
    }

    /// Reads consecutive values; `None` for a null pointer.
    #[must_use]
    pub fn get_all<const N: usize>(self) -> Option<[T; N]> {
        // SAFETY: the caller of an entry point passes null or as many values as the entry point reads.
        (!self.0.is_null())
            .then(|| std::array::from_fn(|index| unsafe { self.0.add(index).read_unaligned() }))
    }
}

impl In<c_char> {
    /// Reads a NUL-terminated text; replaces invalid UTF-8. `None` for a null pointer.
    #[must_use]
    pub fn get_text(self) -> Option<String> {
        // SAFETY: the caller of an entry point passes null or a terminated text.
        (!self.0.is_null()).then(|| unsafe { CStr::from_ptr(self.0) }.to_string_lossy().into_owned())
    }
}
