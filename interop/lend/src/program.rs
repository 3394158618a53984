//! Program of `flotor lend`: its path, and a check that a drop-in library can replace the library of the other maker.

use crate::api::Api;
use flotor_command::CommandError;
use std::ffi::OsStr;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Largest size of a program file that is searched for names of libraries, bytes.
const MAX_BYTES: u64 = 512 << 20;

/// Program to be run on a device.
pub(crate) struct Program {
    pub(crate) path: PathBuf,
    /// Properties of its file; `None` for a script or a very large file.
    native: Option<Native>,
}

/// Properties of a native program's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Native {
    bits: Bits,
    is_dynamic: bool,
    /// For each interface, in the order of [`Api::ALL`], true if the file contains the name of its library.
    names: [bool; 3],
}

/// Address size of a native program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bits {
    ThirtyTwo,
    SixtyFour,
}

impl Program {
    /// Finds an executable file by path or, for a name without a folder, in `PATH`.
    pub(crate) fn find(name: &OsStr) -> Result<Self, CommandError> {
        let is_program = |path: &PathBuf| {
            std::fs::metadata(path).is_ok_and(|file| file.is_file() && file.permissions().mode() & 0o111 != 0)
        };
        let given = Path::new(name);
        let found = if given.components().count() > 1 {
            Some(given.to_path_buf()).filter(is_program)
        } else {
            let path = std::env::var_os("PATH").unwrap_or_default();
            std::env::split_paths(&path).map(|folder| folder.join(given)).find(is_program)
        };
        let Some(path) = found else {
            let here = given.is_file();
            let help = match (here, given.components().count()) {
                (true, 1) => "; for a program in this folder write `./NAME`",
                (true, _) => {
                    "; the file is not executable: `chmod +x` the file, or write its interpreter before it"
                }
                (false, _) => "; write a path, or a name in a folder of PATH",
            };
            return Err(CommandError::Usage(format!("there is no program `{}`{help}", given.display())));
        };
        let native = read_native(&path);
        Ok(Self { path, native })
    }

    /// Returns true if the program's file contains the name of the interface's library.
    pub(crate) fn calls(&self, api: Api) -> bool {
        self.native.is_some_and(|native| native.calls(api))
    }

    /// Checks that a drop-in library can replace the library that the program uses; accepts a program that cannot be judged.
    pub(crate) fn check(&self, api: Option<Api>) -> Result<(), CommandError> {
        let Some(native) = self.native else { return Ok(()) };
        let name = self.path.display();
        if native.bits == Bits::ThirtyTwo {
            return Err(CommandError::Usage(format!(
                "`{name}` is a 32-bit program, and the drop-in libraries have 64 bits: build the program for 64 \
                 bits; only a program of a service (`--api haply`, `--api ml-api`) may have 32 bits"
            )));
        }
        if !native.is_dynamic {
            return Err(CommandError::Usage(format!(
                "`{name}` is statically linked, so no drop-in library can replace its functions; link the program \
                 with the shared library (`flotor lend` has libdhd, libdrd, libHD and libhdPhantom); a program of a \
                 service needs `--api haply` or `--api ml-api`"
            )));
        }
        let Some(api) = api.filter(|api| !native.calls(*api)) else { return Ok(()) };
        // Programs with CHAI3D name the libraries of all devices that it supports, and can use the library that libhdPhantom
        // replaces.
        let others = [Api::Chai3d].into_iter().chain(Api::ALL);
        match others.into_iter().find(|other| native.calls(*other)) {
            Some(other) => Err(CommandError::Usage(format!(
                "`{name}` uses {}, not the library of `--api {}`: write `--api {}`, or omit the option",
                other.library().marks.join(" or "),
                api.word(),
                other.word()
            ))),
            // The program may compose the name of a library at run time.
            None => Ok(()),
        }
    }
}

impl Native {
    fn calls(self, api: Api) -> bool {
        Api::ALL.into_iter().zip(self.names).any(|(other, named)| other == api && named)
    }
}

/// Reads the properties of a native program's file; `None` for a script or a file above [`MAX_BYTES`].
fn read_native(path: &Path) -> Option<Native> {
    let length = std::fs::metadata(path).ok()?.len();
    if length > MAX_BYTES {
        return None;
    }
    let bytes = std::fs::read(path).ok()?;
    let bits = bits(&bytes)?;
    let is_dynamic = bits == Bits::ThirtyTwo || has_interpreter(&bytes)?;
    let holds = |mark: &&str| bytes.windows(mark.len()).any(|window| window == mark.as_bytes());
    Some(Native { bits, is_dynamic, names: Api::ALL.map(|api| api.library().marks.iter().any(holds)) })
}

/// Returns the address size of an ELF program; `None` for another file.
fn bits(bytes: &[u8]) -> Option<Bits> {
    match bytes.get(..5)? {
        b"\x7fELF\x01" => Some(Bits::ThirtyTwo),
        b"\x7fELF\x02" => Some(Bits::SixtyFour),
        _ => None,
    }
}

/// Returns true if a 64-bit ELF program requires a dynamic loader; `None` for another or malformed file.
fn has_interpreter(bytes: &[u8]) -> Option<bool> {
    /// Type of the program header that names the loader (`PT_INTERP`).
    const INTERPRETER: u32 = 3;
    let number = |at: usize, length: usize| {
        let bytes = bytes.get(at..at.checked_add(length)?)?;
        Some(bytes.iter().rev().fold(0_u64, |number, byte| number << 8 | u64::from(*byte)))
    };
    if bytes.get(..5)? != b"\x7fELF\x02" {
        return None;
    }
    let first = usize::try_from(number(0x20, 8)?).ok()?;
    let (size, count) = (usize::try_from(number(0x36, 2)?).ok()?, usize::try_from(number(0x38, 2)?).ok()?);
    let kinds = (0..count).map(|index| number(first.checked_add(index.checked_mul(size)?)?, 4));
    Some(kinds.flatten().any(|kind| kind == u64::from(INTERPRETER)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A header with one segment of a kind.
    fn elf(kind: u32) -> Vec<u8> {
        let mut bytes = vec![0; 0x40 + 0x38];
        bytes[..5].copy_from_slice(b"\x7fELF\x02");
        (bytes[0x20], bytes[0x36], bytes[0x38]) = (0x40, 0x38, 1);
        bytes[0x40..0x44].copy_from_slice(&kind.to_le_bytes());
        bytes
    }

    #[test]
    fn a_program_without_a_loader_is_told_from_one_with() {
        assert_eq!(has_interpreter(&elf(3)), Some(true));
        assert_eq!(has_interpreter(&elf(1)), Some(false));
        assert_eq!(has_interpreter(b"#!/bin/sh\n"), None);
        // Cut off anywhere: no answer, no panic.
        assert!((0..0x44).all(|length| has_interpreter(&elf(3)[..length]) != Some(true)));
    }

    #[test]
    fn a_static_program_and_one_of_another_interface_are_refused_in_one_line() {
        let refused = |native, api| {
            let program = Program { path: PathBuf::from("/usr/bin/demo"), native: Some(native) };
            program.check(api).map_err(|error| error.to_string())
        };
        let plain = Native { bits: Bits::SixtyFour, is_dynamic: true, names: [false, true, false] };
        let said = refused(Native { is_dynamic: false, ..plain }, None).expect_err("it is static");
        assert!(said.contains("statically linked") && !said.contains('\n'), "{said}");
        let said = refused(Native { bits: Bits::ThirtyTwo, ..plain }, None).expect_err("it has 32 bits");
        assert!(said.contains("32-bit program") && !said.contains('\n'), "{said}");
        assert_eq!((bits(b"\x7fELF\x01"), bits(b"#!/bin/sh")), (Some(Bits::ThirtyTwo), None));
        let said = refused(plain, Some(Api::Dhd)).expect_err("it is another interface");
        assert!(said.contains("--api openhaptics") && !said.contains('\n'), "{said}");
        let said = refused(Native { names: [false, true, true], ..plain }, Some(Api::Dhd));
        assert!(said.as_ref().is_err_and(|said| said.contains("--api chai3d")), "{said:?}");
        assert_eq!(refused(plain, None), Ok(()));
        assert_eq!(refused(plain, Some(Api::Openhaptics)), Ok(()));
        assert_eq!(refused(Native { names: [false; 3], ..plain }, Some(Api::Chai3d)), Ok(()));
    }
}
