//! Access to pointers of a program: null is legal, and means that the program does not request the value.

/// Writes a value unless the pointer is null; returns whether it was written.
///
/// # Safety
/// `place` is null or may be written.
pub unsafe fn put<T>(place: *mut T, value: T) -> bool {
    if place.is_null() {
        return false;
    }
    // SAFETY: by the contract of this function; a program may have packed it, so it need not be aligned.
    unsafe { place.write_unaligned(value) };
    true
}

/// Reads a value; `None` for a null pointer.
///
/// # Safety
/// `place` is null or may be read.
#[must_use]
pub unsafe fn get<T: Copy>(place: *const T) -> Option<T> {
    if place.is_null() {
        return None;
    }
    // SAFETY: by the contract of this function; a program may have packed it, so it need not be aligned.
    Some(unsafe { place.read_unaligned() })
}

/// Writes consecutive values unless the pointer is null; returns whether they were written.
///
/// # Safety
/// `place` is null or as many values may be written from there on.
pub unsafe fn put_all<T: Copy>(place: *mut T, values: &[T]) -> bool {
    if place.is_null() {
        return false;
    }
    for (index, value) in values.iter().enumerate() {
        // SAFETY: by the contract of this function there is room for all of them.
        unsafe { place.add(index).write_unaligned(*value) };
    }
    true
}

/// Reads consecutive values; `None` for a null pointer.
///
/// # Safety
/// `place` is null or as many values may be read from there on.
#[must_use]
pub unsafe fn get_all<T: Copy, const N: usize>(place: *const T) -> Option<[T; N]> {
    if place.is_null() {
        return None;
    }
    // SAFETY: by the contract of this function all of them are there.
    Some(std::array::from_fn(|index| unsafe { place.add(index).read_unaligned() }))
}

/// Writes a null-terminated text of at most `room` bytes, the terminator included; truncates a longer one.
///
/// # Safety
/// `place` is null or `room` bytes may be written from there on; `room` is not 0.
pub unsafe fn put_text(place: *mut std::ffi::c_char, text: &str, room: usize) {
    let cut = text.bytes().filter(|byte| *byte != 0).take(room.saturating_sub(1));
    let terminated: Vec<std::ffi::c_char> =
        cut.chain([0]).map(|byte| std::ffi::c_char::from_ne_bytes([byte])).collect();
    // SAFETY: not longer than `room`.
    unsafe { put_all(place, &terminated) };
}

/// Reads a null-terminated text; replaces invalid UTF-8. `None` for a null pointer.
///
/// # Safety
/// `place` is null or leads to a terminated text.
#[must_use]
pub unsafe fn get_text(place: *const std::ffi::c_char) -> Option<String> {
    if place.is_null() {
        return None;
    }
    // SAFETY: by the contract of this function.
    Some(unsafe { std::ffi::CStr::from_ptr(place) }.to_string_lossy().into_owned())
}

/// Output pointer of a program; only an entry point receives one, as an argument.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct Out<T>(*mut T);

impl<T: Copy> Out<T> {
    /// Writes the value unless the pointer is null.
    pub fn put(self, value: T) {
        // SAFETY: whoever calls an entry point passes null or a place for the value.
        unsafe { put(self.0, value) };
    }

    /// Writes consecutive values unless the pointer is null.
    pub fn put_all(self, values: &[T]) {
        // SAFETY: whoever calls an entry point passes null or a place for as many values as that writes.
        unsafe { put_all(self.0, values) };
    }

    /// Returns whether the pointer is null, so that the program does not request the value.
    #[must_use]
    pub fn is_null(self) -> bool {
        self.0.is_null()
    }
}

/// Input pointer of a program; only an entry point receives one, as an argument.
#[repr(transparent)]
#[derive(Clone, Copy, Debug)]
pub struct In<T>(*const T);

impl<T: Copy> In<T> {
    /// Reads consecutive values; `None` for a null pointer.
    #[must_use]
    pub fn get_all<const N: usize>(self) -> Option<[T; N]> {
        // SAFETY: whoever calls an entry point passes null or as many values as that reads.
        unsafe { get_all(self.0) }
    }
}
