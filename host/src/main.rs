//! The `flotor` command; its code is in the library.

fn main() -> std::process::ExitCode {
    flotor::cli::main()
}
