//! `flotor study bias`: bias and error of each threshold estimator.

use clap::Args;
use flotor_command::options::{JsonOption, count, seed};
use flotor_command::{CommandError, print_result, progress_bar, style};
use flotor_study::bias::{BiasRow, rows};
use flotor_study::observer::TernaryObserver;
use rayon::prelude::*;

/// Simulated observers: true threshold as a share of the base, and criterion. First the two of the default population, then one
/// threshold over the range of criteria.
const OBSERVERS: [(f64, f64); 7] =
    [(0.1114, 1.0), (0.1357, 1.0), (0.142, 0.0), (0.142, 0.25), (0.142, 0.5), (0.142, 0.75), (0.142, 1.0)];

#[derive(Args)]
#[command(
    after_help = "Three estimators of the threshold. thesis: mean of the differences from the 4th to the 8th \
    reversal; map: the threshold of the observer model (threshold and criterion) with the maximum posterior \
    probability given the same trials; questplus: 18 trials, each at the difference of the largest expected information.\n\n\
    Examples:\n  \
    flotor study bias --runs 1000\n  \
    flotor study bias --tracks 1 --json bias.json"
)]
pub(super) struct BiasArguments {
    /// Number of estimates per observer and method
    #[arg(long, default_value_t = 10_000, value_parser = count(2..=1_000_000_u32), value_name = "N")]
    runs: u32,
    /// Number of tracks per estimate
    #[arg(long, default_value_t = 2, value_parser = count(1..=100_u32), value_name = "N")]
    tracks: u32,
    /// Seed of the answers
    #[arg(long, value_parser = seed, default_value_t = 1, value_name = "N")]
    seed: u64,
    #[command(flatten)]
    json: JsonOption,
}

pub(super) fn run(arguments: &BiasArguments) -> Result<(), CommandError> {
    let progress = progress_bar(OBSERVERS.len() as u64, "{percent:>3} %  observer {pos} of {len}");
    let of_one = |(threshold, criterion)| {
        let observer = TernaryObserver::with_threshold(threshold, criterion);
        let rows = rows(&observer, arguments.tracks, arguments.runs, arguments.seed);
        progress.inc(1);
        rows
    };
    let rows: Vec<BiasRow> = OBSERVERS.into_par_iter().flat_map_iter(of_one).collect();
    progress.finish_and_clear();
    let title = format!("{} tracks per estimate, {} estimates", arguments.tracks, arguments.runs);
    print_result(arguments.json.file(), &rows, || format!("{}\n{}", style::title(&title), to_text(&rows)))
}

fn to_text(rows: &[BiasRow]) -> String {
    let head = format!(
        "  {:>9}{:>11}  {:<11}{:>8}{:>11}{:>11}{:>9}",
        "threshold", "criterion", "method", "bias", "deviation", "rms error", "trials"
    );
    let percent = |share: f64| format!("{:.1} %", share * 100.0);
    let line = |row: &BiasRow| {
        format!(
            "  {:>9}{:>11}  {:<11}{:>8}{:>11}{:>11}{:>9.1}",
            percent(row.threshold),
            row.criterion,
            row.method.word(),
            percent(row.bias),
            percent(row.deviation),
            percent(row.rms_error),
            row.trials
        )
    };
    [head].into_iter().chain(rows.iter().map(line)).collect::<Vec<_>>().join("\n")
}
