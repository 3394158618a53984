//! Objects in use, shared by all instances of a process: the loop, the viewer's picture and a hot swap use the same copy. Not
//! real-time.

use crate::cache;
use crate::files::Format;
use crate::object::{self, Object, Reading, Unfit};
use crate::soup::Soup;
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Objects in use, by key.
static IN_USE: Mutex<Vec<(String, Weak<Object>)>> = Mutex::new(Vec::new());
/// Remarks already printed.
static PRINTED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Returns the object with a key, shared with another instance or built by `build`; prints its remarks once per process.
fn shared(
    name: &str,
    key: String,
    build: impl FnOnce(&str) -> Result<Object, Unfit>,
) -> Result<Arc<Object>, Unfit> {
    // Locked while building: a second instance of the same object waits for the first.
    let mut in_use = IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
    in_use.retain(|(_, object)| object.strong_count() > 0);
    if let Some(object) =
        in_use.iter().find(|(other, _)| *other == key).and_then(|(_, object)| object.upgrade())
    {
        return Ok(object);
    }
    let object = Arc::new(build(&key)?);
    in_use.push((key.clone(), Arc::downgrade(&object)));
    drop(in_use);
    if PRINTED.lock().unwrap_or_else(PoisonError::into_inner).insert(key) {
        object.remarks.iter().for_each(|remark| eprintln!("surface: {name}: {remark}"));
    }
    Ok(object)
}

/// Returns the object of a built-in soup.
///
/// # Errors
/// [`Unfit`] if the object is too large.
pub(crate) fn of_soup(name: &str, soup: Soup, reading: &Reading) -> Result<Arc<Object>, Unfit> {
    shared(name, format!("{name} {reading:?}"), |_| object::build(soup, reading))
}

/// Returns the object of a file, from the cache if possible.
///
/// # Errors
/// [`Unfit`] if the file is not a mesh or the mesh is unsuitable.
pub(crate) fn of_file(name: &str, bytes: Vec<u8>, reading: &Reading) -> Result<Arc<Object>, Unfit> {
    let format = Format::of(name, &bytes);
    let key = format!("{format:?} {} {:016x} {reading:?}", bytes.len(), cache::digest(0, &bytes));
    shared(name, key, |key| {
        if let Some(object) = cache::load(key) {
            return Ok(object);
        }
        let object = object::read(name, bytes, reading)?;
        cache::store(key, &object);
        Ok(object)
    })
}
