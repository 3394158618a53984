//! Entry point of the program `flotor-lab`; the rest is in the library.

fn main() -> std::process::ExitCode {
    flotor_lab::cli::main()
}
