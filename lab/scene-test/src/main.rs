//! The program `flotor-test`; everything is in the library.

fn main() -> std::process::ExitCode {
    flotor_test::cli::main()
}
