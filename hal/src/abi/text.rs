//! Text across the boundary: pointer and length, never null-terminated, never owned by the receiver.

use super::layout::layout;
use std::fmt;

/// Borrowed UTF-8 text. A text in a schema or an info struct lives as long as the process (plugins are never unloaded);
/// a text in an argument lives for the call.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Str {
    ptr: *const u8,
    len: usize,
}

// SAFETY: a `Str` is a shared borrow of immutable bytes; its makers are `new` (a `&'static str`), `borrowed`
// (whose caller guarantees the lifetime) and a plugin's own read-only data, which is never unmapped.
unsafe impl Sync for Str {}
// SAFETY: as for `Sync`: it owns nothing.
unsafe impl Send for Str {}

impl Str {
    /// Empty text.
    pub const EMPTY: Str = Str::new("");

    /// Wraps a text that lives as long as the process.
    pub const fn new(text: &'static str) -> Self {
        Self { ptr: text.as_ptr(), len: text.len() }
    }

    /// Converts constant words to texts, for [`crate::choices!`].
    #[doc(hidden)]
    pub const fn all<const N: usize>(words: &[&'static str]) -> [Str; N] {
        assert!(words.len() == N);
        let (mut texts, mut i) = ([Str::EMPTY; N], 0);
        while i < N {
            texts[i] = Str::new(words[i]);
            i += 1;
        }
        texts
    }

    /// Borrows a text for the duration of a call.
    ///
    /// # Safety
    /// No copy of the result may outlive `text`.
    pub unsafe fn borrowed(text: &str) -> Self {
        Self { ptr: text.as_ptr(), len: text.len() }
    }

    /// Returns the text; empty if a foreign plugin wrote null or bytes that are not UTF-8.
    #[must_use]
    pub const fn as_str(&self) -> &str {
        if self.ptr.is_null() || self.len > isize::MAX as usize {
            return "";
        }
        // SAFETY: not null, and the maker of this value guarantees `len` readable bytes (see `Sync`).
        let bytes = unsafe { std::slice::from_raw_parts(self.ptr, self.len) };
        match std::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(_) => "",
        }
    }
}

impl Str {
    /// Returns the declared length, bytes; 0 if null.
    pub(crate) const fn bytes(&self) -> usize {
        if self.ptr.is_null() { 0 } else { self.len }
    }

    /// Builds the value from raw parts, as a foreign plugin may.
    #[cfg(test)]
    pub(crate) const fn of_raw(ptr: *const u8, len: usize) -> Self {
        Self { ptr, len }
    }
}

impl fmt::Debug for Str {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

/// Constant list of words, built by [`crate::choices!`].
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Choices {
    ptr: *const Str,
    len: usize,
}

// SAFETY: like `Str`, a shared borrow of immutable static data.
unsafe impl Sync for Choices {}
// SAFETY: as for `Sync`: it owns nothing.
unsafe impl Send for Choices {}

impl Choices {
    /// Empty list.
    pub const EMPTY: Choices = Choices { ptr: std::ptr::null(), len: 0 };

    /// Wraps a list that lives as long as the process.
    #[must_use]
    pub const fn new(texts: &'static [Str]) -> Self {
        Self { ptr: texts.as_ptr(), len: texts.len() }
    }

    /// Returns the texts; empty if null or if the length exceeds the address space.
    pub const fn as_slice(&self) -> &[Str] {
        if self.ptr.is_null() || self.len > isize::MAX as usize / size_of::<Str>() {
            return &[];
        }
        // SAFETY: not null, not larger than memory; `new` stored pointer and length of one static slice, a plugin's own data likewise.
        unsafe { std::slice::from_raw_parts(self.ptr, self.len) }
    }
}

impl Choices {
    /// Returns the declared number of texts; 0 if null.
    pub(crate) const fn count(&self) -> usize {
        if self.ptr.is_null() { 0 } else { self.len }
    }

    /// Builds the value from raw parts, as a foreign plugin may.
    #[cfg(test)]
    pub(crate) const fn of_raw(ptr: *const Str, len: usize) -> Self {
        Self { ptr, len }
    }
}

impl fmt::Debug for Choices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_slice(), f)
    }
}

/// Capacity of a [`Message`], bytes.
pub const MESSAGE_BYTES: usize = 508;

/// Message for users, at most [`MESSAGE_BYTES`] bytes of UTF-8, written by the callee to memory of the caller: nothing to
/// allocate or to free.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct Message {
    len: u32,
    text: [u8; MESSAGE_BYTES],
}

impl Default for Message {
    fn default() -> Self {
        Self { len: 0, text: [0; MESSAGE_BYTES] }
    }
}

impl Message {
    /// Returns the format error of a foreign plugin's message: too long or not UTF-8; `None` if valid.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        let Some(bytes) = self.text.get(..self.len as usize) else {
            return Some(format!("a message of {} bytes, above the limit of {MESSAGE_BYTES}", self.len));
        };
        std::str::from_utf8(bytes).is_err().then(|| "a message that is not UTF-8".to_owned())
    }

    /// Stores `text`, truncated at a character boundary to [`MESSAGE_BYTES`] bytes. Real-time: bounded, no allocation.
    #[allow(clippy::cast_possible_truncation)] // at most MESSAGE_BYTES
    pub fn set(&mut self, text: &str) {
        let mut len = text.len().min(MESSAGE_BYTES);
        while !text.is_char_boundary(len) {
            len -= 1;
        }
        if let (Some(to), Some(from)) = (self.text.get_mut(..len), text.as_bytes().get(..len)) {
            to.copy_from_slice(from);
            self.len = len as u32;
        }
    }

    /// Returns the text; for malformed bytes of a foreign plugin, the longest valid prefix.
    #[must_use]
    pub fn as_str(&self) -> &str {
        let bytes = self.text.get(..self.len as usize).unwrap_or(&self.text);
        match std::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => std::str::from_utf8(bytes.get(..error.valid_up_to()).unwrap_or(&[])).unwrap_or(""),
        }
    }

    /// Returns the text up to the first NUL byte, for a terminal: bytes that are not UTF-8 become replacement characters,
    /// control characters are escaped. Not real-time.
    #[must_use]
    pub fn for_people(&self) -> String {
        let bytes = self.text.get(..self.len as usize).unwrap_or(&self.text);
        let bytes = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
        crate::terminal::escaped(&String::from_utf8_lossy(bytes))
    }
}

layout! {
    Str { ptr, len }
    Choices { ptr, len }
    Message { len, text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_that_is_none_is_told() {
        let mut message = Message::default();
        message.set("ok");
        assert_eq!(message.problem(), None);
        message.text[1] = 0xff;
        assert_eq!(message.problem().as_deref(), Some("a message that is not UTF-8"));
        message.len = 4_000_000_000;
        assert_eq!(
            message.problem().as_deref(),
            Some("a message of 4000000000 bytes, above the limit of 508")
        );
    }

    #[test]
    fn a_message_is_cut_at_a_character() {
        let mut message = Message::default();
        message.set(&"µ".repeat(MESSAGE_BYTES)); // two bytes each, 508 is even: 254 whole characters
        assert_eq!(message.as_str().chars().count(), MESSAGE_BYTES / 2);
        message.set(&format!("a{}", "µ".repeat(MESSAGE_BYTES)));
        assert_eq!(message.as_str().len(), MESSAGE_BYTES - 1);
    }

    #[test]
    fn garbage_from_a_plugin_reads_as_its_valid_start() {
        let mut message = Message::default();
        message.set("ok");
        message.text[2] = 0xff;
        message.len = u32::MAX;
        assert_eq!(message.as_str(), "ok");
    }

    #[test]
    fn a_reason_is_told_whatever_its_bytes() {
        let mut message = Message::default();
        message.set("no table ??\x1b[2J of forces\n");
        message.text[9] = 0xff;
        assert_eq!(message.for_people(), "no table \u{fffd}?\\u{1b}[2J of forces\n");
        message.len = u32::MAX;
        assert!(message.for_people().ends_with("of forces\n"), "what was not written is not told");
    }

    #[test]
    fn null_and_more_than_memory_read_as_empty() {
        let text = Str { ptr: std::ptr::null(), len: 7 };
        assert_eq!(text.as_str(), "");
        let words = Choices { ptr: &raw const text, len: usize::MAX / 8 };
        assert!(words.as_slice().is_empty());
    }
}
