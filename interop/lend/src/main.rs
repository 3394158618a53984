//! Entry point of the program `flotor-lend`; the rest is in the library.

fn main() -> std::process::ExitCode {
    flotor_lend::main()
}
