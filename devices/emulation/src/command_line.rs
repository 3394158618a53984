//! Command line arguments and output lines of emulators.

use clap::Parser;
use flotor_hal::terminal::{escaped, escaped_arguments};
use std::error::Error;
use std::io::Write;
use std::path::Path;

/// Parses the arguments of this process. Ends the process on an error, and after help or version; control characters in messages
/// are escaped.
#[must_use]
pub fn arguments<T: Parser>() -> T {
    T::try_parse().unwrap_or_else(|error| {
        let _ = T::parse_from(escaped_arguments());
        error.exit()
    })
}

/// Returns the parser of an option whose number has these limits.
///
/// The parser returns a message if the text is not a number within the limits.
pub fn within(
    least: f64,
    most: f64,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text: &str| {
        let number: f64 = text.trim().parse().map_err(|_| {
            format!("`{text}` is not a number; write {least} to {most}, without the unit {unit}")
        })?;
        if (least..=most).contains(&number) {
            Ok(number)
        } else {
            Err(format!("must be {least} to {most} {unit}"))
        }
    }
}

/// Writes a line to standard output and flushes, with control characters escaped.
pub fn say(line: &str) {
    let mut out = std::io::stdout().lock();
    // Without a reader the write fails; the emulator continues.
    let _ = writeln!(out, "{}", escaped(line)).and_then(|()| out.flush());
}

/// Writes a line to standard error, with control characters escaped.
pub fn warn(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", escaped(line));
}

/// Creates a symbolic link, replacing an earlier link but never a file.
///
/// # Errors
/// If the link cannot be replaced or created.
pub fn link_to(target: &Path, link: &Path) -> Result<(), Box<dyn Error>> {
    let cleared = if link.is_symlink() { std::fs::remove_file(link) } else { Ok(()) };
    cleared.and_then(|()| std::os::unix::fs::symlink(target, link)).map_err(|error| {
        let link = link.display();
        format!("cannot create the link {link}: {error}; name a new file in a folder you may write to").into()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_beyond_their_limits_are_refused_with_them() {
        assert_eq!(within(0.1, 7.0, "mm")(" 7 "), Ok(7.0));
        for text in ["7.01", "0", "-1", "inf", "NaN"] {
            assert_eq!(within(0.1, 7.0, "mm")(text), Err("must be 0.1 to 7 mm".to_owned()), "{text}");
        }
        assert_eq!(
            within(0.1, 7.0, "mm")("1 mm"),
            Err("`1 mm` is not a number; write 0.1 to 7, without the unit mm".to_owned())
        );
    }
}
