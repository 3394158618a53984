//! Entry point of the `flotor` command; the code is in the library.

fn main() -> std::process::ExitCode {
    flotor::cli::main()
}
