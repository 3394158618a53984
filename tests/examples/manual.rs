//! Writes the man page of each command into a folder.
//!
//! ```text
//! cargo run --release -p flotor-tests --features manual --example manual -- share/man/man1
//! ```

use flotor_tests::commands::whole_program;
use std::io::{Error, ErrorKind};

fn main() -> Result<(), Error> {
    let folder =
        std::env::args_os().nth(1).ok_or(Error::new(ErrorKind::InvalidInput, "no folder is given"))?;
    clap_mangen::generate_to(whole_program(), folder)
}
