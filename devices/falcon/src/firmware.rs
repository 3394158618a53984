//! Firmware file of the user. This repository contains none, and must not: see the chapter of the book.

use flotor_hal::read_file;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::io::ErrorKind;
use std::path::Path;

/// Limit on the file's size, bytes: twice the known firmware.
const MOST_BYTES: u64 = 20_000;

/// Known firmware: name, size, and first digits of the SHA-256 (libnifalcon, folder `firmware`).
const KNOWN: [(&str, usize, &str); 2] =
    [("nvent", 8492, "1119e39c39fab1f3"), ("test_firmware", 7324, "b2700d5cd5ca217e")];
/// Minimum length of `firmware_sha256`, hex digits.
const LEAST_DIGITS: usize = 16;

/// Reads a firmware file and checks its SHA-256: it must begin with the hex digits `expected` (at least 16), or,
/// without `expected`, belong to a known firmware. Not real-time.
///
/// # Errors
/// One sentence with the cause and the remedy: the file cannot be read, is too large, or has another digest.
pub fn read(path: &str, expected: Option<&str>) -> Result<Vec<u8>, String> {
    let bytes = read_file(Path::new(path), MOST_BYTES).map_err(|error| match error.kind() {
        ErrorKind::FileTooLarge => {
            format!(
                "firmware {path} has more than {MOST_BYTES} bytes, the limit of this plugin; set `firmware` to another file"
            )
        }
        _ => format!("cannot read the firmware {path}: {error}; set `firmware` to a file that you may read"),
    })?;
    let digest = digest(&bytes);
    let is_right = match expected {
        Some(expected) => {
            expected.len() >= LEAST_DIGITS
                && digest.starts_with(&expected.to_ascii_lowercase())
                && !bytes.is_empty()
        }
        None => KNOWN.iter().any(|(_, size, begins)| bytes.len() == *size && digest.starts_with(begins)),
    };
    if is_right {
        return Ok(bytes);
    }
    Err(match expected {
        _ if bytes.is_empty() => format!("firmware {path} is empty; set `firmware` to another file"),
        Some(expected) if expected.len() < LEAST_DIGITS => format!(
            "`firmware_sha256` is {expected}, but must have {LEAST_DIGITS} or more hex digits; firmware {path} has the \
             SHA-256 {digest}"
        ),
        Some(expected) => format!(
            "firmware {path} has the SHA-256 {digest}, but `firmware_sha256` is {expected}; set `firmware` to the file with \
             this SHA-256, or, if the file is right, give the first {LEAST_DIGITS} or more digits of its SHA-256"
        ),
        None => {
            let known =
                KNOWN.map(|(name, size, begins)| format!("{name} ({size} bytes, SHA-256 {begins}...)"));
            format!(
                "firmware {path} has {} bytes and the SHA-256 {digest}; known firmware: {}. If the file is right, confirm \
                 its SHA-256 with `firmware_sha256`",
                bytes.len(),
                known.join(" and ")
            )
        }
    })
}

/// Returns the SHA-256 of bytes as lower-case hex digits. Not real-time.
#[must_use]
pub fn digest(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_taken_for_its_digest_and_for_nothing_else() {
        let path = std::env::temp_dir().join(format!("flotor-falcon-{}", std::process::id()));
        let name = path.display().to_string();
        std::fs::write(&path, b"abc").expect("a folder for such files");
        // FIPS 180-4, example of one block.
        let known = "ba7816bf8f01cfea414140de5dae2223";
        assert_eq!(read(&name, Some(known)), Ok(b"abc".to_vec()));
        for (expected, words) in [
            (None, "known firmware: nvent (8492 bytes"),
            (Some("ba78"), "16 or more hex digits"),
            (Some(&known[1..]), "give the first"),
        ] {
            let refused = read(&name, expected).expect_err("it is another");
            assert!(refused.contains(words) && refused.contains(known), "{refused}");
        }
        std::fs::write(&path, vec![0; 30_000]).expect("it is ours");
        assert!(read(&name, None).expect_err("it is too long").contains("more than 20000 bytes"));
        std::fs::remove_file(&path).expect("it is ours");
        assert!(read(&name, None).is_err());
    }
}
