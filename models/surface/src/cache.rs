//! Disk cache of large surfaces: loading a million patches takes no longer than reading their bytes. Not real-time.
//!
//! A file contains the key of its surface, the patches and a checksum; a file with another key or checksum is ignored and
//! rewritten. Small surfaces are not cached: building one is faster than a search of the folder. The cache keeps the
//! [`MOST_FILES`] newest files.

use crate::object::Object;
use crate::patch::Patch;
use crate::surface::{Surface, Trait};
use crate::topology::EdgeRef;
use serde_json::{Value, json};
use std::fs::{self, File};
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::PathBuf;

/// Magic bytes of a file. Raise the version if the same mesh would give different patches.
const MAGIC: &[u8; 16] = b"flotor-surf  01\n";
/// Minimum number of patches of a cached surface.
const LEAST: usize = 50_000;
/// Maximum number of files in the cache.
const MOST_FILES: usize = 4;
/// Maximum length of a description, bytes.
const LONGEST: usize = 1 << 24;
/// Size of a patch with its neighbours, bytes.
const RECORD: usize = Patch::BYTES + 16;
/// Number of patches read or written at a time.
const BLOCK: usize = 4096;

/// Updates a 64-bit hash with bytes. Identifies a file and detects damage; not cryptographic.
pub(crate) fn digest(hash: u64, bytes: &[u8]) -> u64 {
    let step = |hash: u64, word: u64| (hash ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    let (words, rest) = bytes.as_chunks::<8>();
    let hash =
        words.iter().fold(step(hash, bytes.len() as u64), |hash, word| step(hash, u64::from_le_bytes(*word)));
    rest.iter().fold(hash, |hash, byte| step(hash, u64::from(*byte)))
}

/// Returns `$XDG_CACHE_HOME/flotor`, else `~/.cache/flotor`; relative folders are ignored.
fn folder() -> Option<PathBuf> {
    let own = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || std::env::var_os("HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    own.or_else(|| home().map(|home| home.join(".cache"))).map(|cache| cache.join("flotor"))
}

fn file(key: &str) -> Option<PathBuf> {
    Some(folder()?.join(format!("surface-{:016x}", digest(0, key.as_bytes()))))
}

/// Returns the object with this key; `None` if it is not cached, unreadable or damaged.
pub(crate) fn load(key: &str) -> Option<Object> {
    let file = File::open(file(key)?).ok()?;
    let most = usize::try_from(file.metadata().ok()?.len()).ok()? / RECORD;
    decode(&mut BufReader::with_capacity(BLOCK * RECORD, file), key, most)
}

/// Stores a large object. Ignores a failure: the next start builds the surface again.
pub(crate) fn store(key: &str, object: &Object) {
    let Some(path) = file(key).filter(|_| object.surface.count() >= LEAST) else { return };
    let Some(folder) = path.parent().filter(|folder| fs::create_dir_all(folder).is_ok()) else { return };
    // Write to a temporary file and rename it: concurrent writers never leave half a file under the final name.
    let own = path.with_extension(format!("{}.tmp", std::process::id()));
    let written = File::create(&own)
        .and_then(|file| encode(&mut BufWriter::with_capacity(BLOCK * RECORD, file), key, object));
    if written.is_err() || fs::rename(&own, &path).is_err() {
        let _ = fs::remove_file(&own);
        return;
    }
    let entries = fs::read_dir(folder).into_iter().flatten().filter_map(Result::ok);
    let own = |name: &str| name.starts_with("surface-") && !name.ends_with(".tmp");
    let mut files: Vec<_> = entries
        .filter(|entry| entry.file_name().to_str().is_some_and(own))
        .filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path())))
        .collect();
    files.sort();
    let surplus = files.len().saturating_sub(MOST_FILES);
    files.into_iter().take(surplus).for_each(|(_, path)| drop(fs::remove_file(path)));
}

fn encode(to: &mut impl Write, key: &str, object: &Object) -> io::Result<()> {
    let Object { surface, names, remarks } = object;
    let head =
        json!({ "key": key, "names": names, "remarks": remarks, "count": surface.count() }).to_string();
    let mut hash = 0;
    let mut put = |bytes: &[u8]| {
        hash = digest(hash, bytes);
        to.write_all(bytes)
    };
    put(MAGIC)?;
    put(&(head.len() as u64).to_le_bytes())?;
    put(head.as_bytes())?;
    let mut block = Vec::with_capacity(BLOCK * RECORD);
    for first in (0..surface.count()).step_by(BLOCK) {
        block.clear();
        for i in first..(first + BLOCK).min(surface.count()) {
            surface.patches[i].write(&mut block);
            surface.neighbours[i].iter().for_each(|edge| block.extend(edge.code().to_le_bytes()));
            let Trait { group, is_closed } = surface.traits[i];
            block.extend(group.to_le_bytes());
            block.extend(u16::from(is_closed).to_le_bytes());
        }
        put(&block)?;
    }
    to.write_all(&hash.to_le_bytes())?;
    to.flush()
}

fn decode(from: &mut impl Read, key: &str, most: usize) -> Option<Object> {
    let mut hash = 0;
    let mut get = |bytes: &mut [u8]| {
        from.read_exact(bytes).ok()?;
        hash = digest(hash, bytes);
        Some(())
    };
    let (mut magic, mut length) = ([0; 16], [0; 8]);
    get(&mut magic)?;
    get(&mut length)?;
    let length = usize::try_from(u64::from_le_bytes(length)).ok().filter(|length| *length <= LONGEST)?;
    let mut head = vec![0; length];
    get(&mut head)?;
    let head: Value = serde_json::from_slice(&head).ok()?;
    let count = usize::try_from(head.get("count")?.as_u64()?).ok()?;
    if magic != *MAGIC || head.get("key")?.as_str()? != key || count > most {
        return None;
    }
    let texts = |name: &str| -> Option<Vec<String>> {
        head.get(name)?.as_array()?.iter().map(|text| text.as_str().map(str::to_owned)).collect()
    };
    let (mut patches, mut neighbours, mut traits) =
        (Vec::with_capacity(count), Vec::with_capacity(count), Vec::with_capacity(count));
    let mut block = vec![0; BLOCK * RECORD];
    for first in (0..count).step_by(BLOCK) {
        let bytes = &mut block[..(count - first).min(BLOCK) * RECORD];
        get(bytes)?;
        for record in bytes.as_chunks::<RECORD>().0 {
            let (patch, rest) = record.split_first_chunk::<{ Patch::BYTES }>()?;
            patches.push(Patch::read(patch));
            let word = |i: usize| Some(u32::from_le_bytes(*rest.get(4 * i..)?.first_chunk::<4>()?));
            let edges = [word(0)?, word(1)?, word(2)?].map(EdgeRef::from_code);
            if edges.iter().any(|edge| edge.get().is_some_and(|(other, _)| other >= count)) {
                return None;
            }
            neighbours.push(edges);
            let sides = word(3)?.to_le_bytes();
            traits.push(Trait { group: u16::from_le_bytes([sides[0], sides[1]]), is_closed: sides[2] != 0 });
        }
    }
    let expected = hash;
    let mut sum = [0; 8];
    from.read_exact(&mut sum).ok()?;
    let surface =
        (u64::from_le_bytes(sum) == expected).then(|| Surface::from_parts(patches, neighbours, traits))?;
    Some(Object { surface, names: texts("names")?, remarks: texts("remarks")? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in;
    use crate::object::{Reading, Unit, build};

    #[test]
    fn a_file_that_differs_anywhere_is_no_file() {
        let reading = Reading { unit: Unit::Metre, scale: 1.0, edge_angle_rad: 0.5 };
        let mut object = build(built_in::soup("torus").expect("a name"), &reading).expect("a mesh");
        object.names.push("part".to_owned());
        let mut bytes = Vec::new();
        encode(&mut bytes, "torus", &object).expect("memory");
        let again = decode(&mut &bytes[..], "torus", usize::MAX).expect("the same");
        assert_eq!((again.surface == object.surface, again.names), (true, object.names));
        assert!(decode(&mut &bytes[..], "globe", usize::MAX).is_none());
        for at in (0..bytes.len()).step_by(bytes.len() / 97) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1;
            assert!(decode(&mut &damaged[..], "torus", usize::MAX).is_none(), "byte {at}");
            assert!(decode(&mut &bytes[..at], "torus", usize::MAX).is_none(), "cut at {at}");
        }
    }
}
