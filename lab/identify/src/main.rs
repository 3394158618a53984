//! Entry point of the program `flotor-identify`; the rest is in the library.

fn main() -> std::process::ExitCode {
    flotor_identify::cli::main()
}
