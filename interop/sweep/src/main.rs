//! Program `flotor-sweep`, started by `flotor sweep`.

use clap::Parser;
use flotor_command::options::{PluginResultOptions, arguments};
use flotor_command::{CommandError, exit_code_of, progress_bar, say};
use flotor_sweep::executor::execute;
use flotor_sweep::plan::Plan;
use flotor_sweep::store::Store;
use flotor_sweep::task::Sweep;
use flotor_sweep::{picture, table};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;

/// Sweep a model or a scene over parameters, poses and seeds into a Parquet table.
#[derive(Parser)]
#[command(name = "flotor sweep", version, max_term_width = 110)]
#[command(
    after_help = "A sweep that was stopped or killed resumes with the next start: finished tasks are stored in OUT/tasks.\n\n\
    Examples:\n  \
    flotor sweep plan.toml\n  \
    flotor sweep plan.toml --out results --jobs 4 --plot force.svg --draw peak_force_n"
)]
struct Arguments {
    /// Plan of the sweep, a TOML file
    plan: PathBuf,
    /// Folder of finished tasks and results.parquet (default: the path of the plan without .toml)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Number of parallel tasks (default: one per core)
    #[arg(long, value_name = "N")]
    jobs: Option<NonZeroUsize>,
    /// Draw the results to an SVG file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Numeric results to draw, at most four, separated by commas (default: the first four); no effect without --plot
    #[arg(long, value_name = "COLUMN", value_delimiter = ',')]
    draw: Vec<String>,
    #[command(flatten)]
    options: PluginResultOptions,
}

fn main() -> ExitCode {
    exit_code_of(run(&arguments()))
}

fn run(arguments: &Arguments) -> Result<(), CommandError> {
    let usage = |error: &dyn std::fmt::Display| CommandError::Usage(error.to_string());
    let other = |error: &dyn std::fmt::Display| CommandError::Failed(error.to_string());
    let unwritten = |path: &Path, cause| CommandError::file(path, "cannot write the file", cause);
    let plan = Plan::load(&arguments.plan).map_err(|error| usage(&error))?;
    let sweep =
        Sweep::prepare(plan, arguments.options.plugin_path.folders()).map_err(|error| usage(&error))?;
    let out = arguments.out.clone().unwrap_or_else(|| arguments.plan.with_extension(""));
    let store = Store::open(&out).map_err(|error| other(&error))?;
    let jobs =
        arguments.jobs.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN);

    let bar = progress_bar(sweep.plan().row_count().unwrap_or(0), "{wide_bar} {pos}/{len} rows, {eta} left");
    let started = std::time::Instant::now();
    let stop = AtomicBool::new(false);
    let progress = execute(&sweep, &store, jobs, &stop, &|task| bar.inc(task.count));
    let progress = progress.map_err(|error| other(&error))?;
    bar.finish_and_clear();

    let (columns, rows) = (sweep.columns(), table::rows(&sweep, &store).map_err(|error| other(&error))?);
    let results = out.join("results.parquet");
    table::write(&results, &columns, &rows).map_err(|error| other(&error))?;
    if let Some(path) = &arguments.plot {
        let svg = picture::draw(sweep.plan(), &columns, &rows, &arguments.draw);
        std::fs::write(path, svg).map_err(|cause: std::io::Error| unwritten(path, cause))?;
    }
    let summary = serde_json::json!({
        "rows": rows.len(),
        "tasks_found": progress.found,
        "tasks_done": progress.done,
        "wall_s": started.elapsed().as_secs_f64(),
        "results": results,
    });
    match arguments.options.json.file() {
        Some(path) if path.as_os_str() == "-" => println!("{summary:#}"),
        Some(path) => {
            std::fs::write(path, format!("{summary:#}\n")).map_err(|cause| unwritten(path, cause))?;
        }
        None => say!(
            "{} rows in {} ({} tasks done now, {} found finished, {:.1} s)",
            rows.len(),
            results.display(),
            progress.done,
            progress.found,
            started.elapsed().as_secs_f64()
        ),
    }
    Ok(())
}
