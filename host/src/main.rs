//! The `flotor` command; everything is in the library.

fn main() -> std::process::ExitCode {
    flotor::cli::main()
}
