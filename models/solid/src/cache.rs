//! Disk cache of prepared laws, so that a description is solved once.
//!
//! A file contains its full description, its numbers and a checksum of both; a file that differs anywhere is ignored
//! and rewritten. The last few laws are cached in memory too: without a writable folder every start prepares anew, but
//! not every instance. Not real-time.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

/// Magic bytes of a file. Raise the version when the same description would give other numbers.
const MAGIC: &[u8; 16] = b"flotor-solid 02\n";

/// Returns the 64-bit FNV-1a hash of some bytes: detects damage, not tampering.
pub(crate) fn digest(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Returns `$XDG_CACHE_HOME/flotor`, else `~/.cache/flotor`; relative folders are ignored.
fn folder() -> Option<PathBuf> {
    let own = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || std::env::var_os("HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    own.or_else(|| home().map(|home| home.join(".cache"))).map(|cache| cache.join("flotor"))
}

fn file(description: &str) -> Option<PathBuf> {
    let mut name = String::from("solid-");
    write!(name, "{:016x}", digest(description.as_bytes())).ok()?;
    Some(folder()?.join(name))
}

fn encode(description: &str, numbers: &[f64]) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend((description.len() as u64).to_le_bytes());
    bytes.extend(description.as_bytes());
    numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    bytes.extend(digest(&bytes).to_le_bytes());
    bytes
}

fn decode(description: &str, bytes: &[u8]) -> Option<Vec<f64>> {
    let (body, sum) = bytes.split_last_chunk::<8>()?;
    if u64::from_le_bytes(*sum) != digest(body) {
        return None;
    }
    let rest = body.strip_prefix(MAGIC)?;
    let rest = rest.strip_prefix(&(description.len() as u64).to_le_bytes())?;
    let (chunks, left) = rest.strip_prefix(description.as_bytes())?.as_chunks::<8>();
    left.is_empty().then(|| chunks.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect())
}

/// Descriptions with their numbers, the most recent last.
static LATEST: Mutex<Vec<(String, Vec<f64>)>> = Mutex::new(Vec::new());
/// Capacity of the memory cache.
const KEPT: usize = 4;

fn keep(description: &str, numbers: &[f64]) {
    let mut latest = LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    latest.retain(|(other, _)| other != description);
    if latest.len() >= KEPT {
        latest.remove(0);
    }
    latest.push((description.to_owned(), numbers.to_vec()));
}

fn kept(description: &str) -> Option<Vec<f64>> {
    let latest = LATEST.lock().unwrap_or_else(PoisonError::into_inner);
    latest.iter().find(|(other, _)| other == description).map(|(_, numbers)| numbers.clone())
}

/// Returns the numbers of a description from memory or disk; `None` if they are not cached, unreadable or damaged. Not real-time.
#[must_use]
pub fn load(description: &str) -> Option<Vec<f64>> {
    if let Some(numbers) = kept(description) {
        return Some(numbers);
    }
    decode(description, &fs::read(file(description)?).ok()?)
}

/// Stores the numbers of a description in memory and on disk. Ignores a failure: the next start prepares again. Not real-time.
pub fn store(description: &str, numbers: &[f64]) {
    keep(description, numbers);
    let Some(path) = file(description) else { return };
    let Some(folder) = path.parent() else { return };
    if fs::create_dir_all(folder).is_err() {
        return;
    }
    // Write to a temporary file and rename it: concurrent writers never leave half a file under the final name.
    let own = path.with_extension(format!("{}.tmp", std::process::id()));
    if fs::write(&own, encode(description, numbers)).is_err() || fs::rename(&own, &path).is_err() {
        let _ = fs::remove_file(&own);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_few_are_kept_in_memory() {
        for number in 0..=KEPT {
            keep(&format!("kept {number}"), &[number as f64]);
        }
        assert_eq!(kept("kept 0"), None);
        assert_eq!(kept("kept 2"), Some(vec![2.0]));
    }

    #[test]
    fn a_file_that_differs_anywhere_is_no_file() {
        let numbers = [1.0, -0.0, f64::MIN_POSITIVE];
        let bytes = encode("block", &numbers);
        assert_eq!(decode("block", &bytes).as_deref(), Some(&numbers[..]));
        assert_eq!(decode("beam", &bytes), None);
        for i in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[i] ^= 1;
            assert_eq!(decode("block", &damaged), None, "byte {i}");
            assert_eq!(decode("block", &bytes[..i]), None, "cut at {i}");
        }
    }
}
