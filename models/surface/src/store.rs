//! Objects in use, shared by all instances of a process: one copy for the loop, the viewer's picture, and a hot swap. Not real-time.

use crate::object::{self, Object, Reading, Unfit};
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Objects in use by their key.
static IN_USE: Mutex<Vec<(String, Weak<Object>)>> = Mutex::new(Vec::new());
/// Remarks that were printed.
static TOLD: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Returns the 64-bit hash of some bytes: finds the same file again, no protection against intent.
fn digest(bytes: &[u8]) -> u64 {
    let (words, rest) = bytes.as_chunks::<8>();
    let step = |hash: u64, word: u64| (hash ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    let hash = words.iter().fold(bytes.len() as u64, |hash, word| step(hash, u64::from_le_bytes(*word)));
    rest.iter().fold(hash, |hash, byte| step(hash, u64::from(*byte)))
}

/// Returns the object of a name and its bytes, from another instance or by `build`; prints its remarks once in a process.
///
/// # Errors
/// The [`Unfit`] of `build`.
pub(crate) fn shared(
    name: &str,
    bytes: &[u8],
    reading: &Reading,
    build: impl FnOnce() -> Result<Object, Unfit>,
) -> Result<Arc<Object>, Unfit> {
    let key = format!("{name} {:016x} {reading:?}", digest(bytes));
    // Held while building: a second instance of the same object waits for the first.
    let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
    in_use.retain(|(_, object)| object.strong_count() > 0);
    if let Some(object) = in_use.iter().find(|(other, _)| *other == key).and_then(|(_, object)| object.upgrade()) {
        return Ok(object);
    }
    let object = Arc::new(build()?);
    in_use.push((key.clone(), Arc::downgrade(&object)));
    drop(in_use);
    if TOLD.lock().unwrap_or_else(PoisonError::into_inner).insert(key) {
        object.remarks.iter().for_each(|remark| eprintln!("surface: {name}: {remark}"));
    }
    Ok(object)
}

/// Returns the object of a file.
///
/// # Errors
/// [`Unfit`] for a file that is no mesh, or one that cannot be touched.
pub(crate) fn shared_file(name: &str, bytes: Vec<u8>, reading: &Reading) -> Result<Arc<Object>, Unfit> {
    let hash = digest(&bytes);
    shared(name, &hash.to_le_bytes(), reading, || object::read(name, bytes, reading))
}
