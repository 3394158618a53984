//! The program `flotor-lab`; everything is in the library.

fn main() -> std::process::ExitCode {
    flotor_lab::cli::main()
}
