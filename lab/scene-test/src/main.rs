//! Entry point of the program `flotor-test`; the rest is in the library.

fn main() -> std::process::ExitCode {
    flotor_test::cli::main()
}
