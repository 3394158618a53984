//! The program `flotor-study`; everything is in the library.

fn main() -> std::process::ExitCode {
    flotor_study_program::main()
}
