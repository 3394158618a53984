//! Entry point of `flotor-study`; the code is in the library.

fn main() -> std::process::ExitCode {
    flotor_study_program::main()
}
