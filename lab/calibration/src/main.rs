//! Entry point of the program `flotor-calibration`; the rest is in the library.

fn main() -> std::process::ExitCode {
    flotor_calibration::cli::main()
}
