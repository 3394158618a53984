//! The `flotor` command of the wheel, packed beside the plugins; also the program behind the processes that a run of Python's starts.

fn main() -> std::process::ExitCode {
    flotor::cli::main()
}
