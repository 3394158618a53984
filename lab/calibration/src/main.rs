//! The program `flotor-calibration`; everything is in the library.

fn main() -> std::process::ExitCode {
    flotor_calibration::cli::main()
}
