//! `flotor eval`: wrenches at poses, as CSV.

use crate::evaluate::{Answer, Details, EvaluateError, Evaluation, Travel};
use crate::poses::Poses;
use clap::Args;
use flotor_command::options::{KeyValue, ModelOption, PluginPathOption, new_file, settings};
use flotor_command::tables::to_csv;
use flotor_command::{CommandError, note, progress_bar, while_preparing, write_text};
use flotor_hal::abi::PluginKind;
use flotor_hal::{Detail, read_file};
use flotor_session::registry::is_same_file;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Evaluate a force model at poses from a CSV file.
#[derive(Args)]
#[command(
    after_help = "Poses: a header [id,]x_m,y_m,z_m,rx_rad,ry_rad,rz_rad and one row per pose, in the model frame (home is \
    the origin, z up; rx, ry, rz is a rotation vector). nan and inf are valid. Result: id, force, torque, energy, status; \
    with --details also the details of the model (the spring: branch, stable, seat_roll_rad, \
    rod_share).\n\n\
    Examples:\n  \
    flotor eval --model spring --poses poses.csv --out wrenches.csv\n  \
    flotor eval --model spring --set variant=rod --set accuracy=tight --details --poses poses.csv\n  \
    echo 'x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,-0.005,0,0,0' | flotor eval --model spring --poses -"
)]
pub(crate) struct EvalArguments {
    #[command(flatten)]
    model: ModelOption,
    /// Set a parameter of the model (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// CSV file of the poses (- for standard input)
    #[arg(long, value_name = "IN.csv")]
    poses: PathBuf,
    /// CSV file for the wrenches (- for standard output)
    #[arg(long, value_name = "OUT.csv", default_value = "-", value_parser = new_file)]
    out: PathBuf,
    /// Rows are successive poses of one handle; no effect on a model without a history (default: each pose is reached from home)
    #[arg(long)]
    path: bool,
    /// Rows are the ticks of a loop: exactly one step per row, without intermediate steps and without settling
    #[arg(long, conflicts_with = "path")]
    per_tick: bool,
    /// Append the details of the model, one column per detail
    #[arg(long)]
    details: bool,
    #[command(flatten)]
    plugin_path: PluginPathOption,
}

pub(crate) fn run(arguments: &EvalArguments) -> Result<(), CommandError> {
    if is_same_file(&arguments.out, &arguments.poses) {
        let out = arguments.out.display();
        return Err(CommandError::Usage(format!(
            "--out {out}: this is the file of the poses; choose another file"
        )));
    }
    let plugin = arguments.plugin_path.registry().load(arguments.model.name(), PluginKind::Model)?;
    let settings = settings(&plugin, "--set", &arguments.sets)?;
    // Report a rejected setting before a long file is read.
    let first = while_preparing(&plugin.metadata().id, || plugin.create_model(&settings))?;
    let details = if arguments.details { first.details() } else { &[] };
    let Poses { ids, handles } = read_poses(&arguments.poses)?;
    let evaluation = Evaluation {
        plugin: &plugin,
        settings: &settings,
        travel: match (arguments.path, arguments.per_tick) {
            (_, true) => Travel::PerTick,
            (true, false) => Travel::Successive,
            (false, false) => Travel::FromHome,
        },
        details: if arguments.details { Details::Asked } else { Details::Omitted },
    };
    let bar = progress_bar(handles.len() as u64, "{wide_bar} {pos}/{len} poses  {elapsed}");
    let answers = evaluation.answers(&handles, &|| bar.inc(1)).map_err(|error| match error {
        EvaluateError::Load(error) => CommandError::from(error),
        failed @ EvaluateError::Failed(_) => {
            CommandError::PluginRefused(format!("{}: {failed}", plugin.metadata().path.display()))
        }
    })?;
    bar.finish_and_clear();
    write_text(Some(&arguments.out), || csv_text(&ids, &answers, details))
}

/// Reads the poses from a file or from standard input.
fn read_poses(path: &Path) -> Result<Poses, CommandError> {
    let file = if path.as_os_str() == "-" { "standard input".into() } else { path.display().to_string() };
    let problem = |cause| {
        CommandError::Usage(format!(
            "{file}: cannot read the poses: {cause}; check the path and its permissions"
        ))
    };
    let bytes = read(path).map_err(problem)?;
    Poses::parse(&file, bytes).map_err(|error| CommandError::Usage(error.to_string()))
}

/// Maximum size of a file of poses, bytes: twenty million poses.
const MOST_BYTES: u64 = 2 << 30;

fn read(path: &Path) -> std::io::Result<Vec<u8>> {
    if path.as_os_str() != "-" {
        return read_file(path, MOST_BYTES);
    }
    if std::io::IsTerminal::is_terminal(&std::io::stdin()) {
        note("reading poses from the terminal; end with Ctrl-D");
    }
    let mut bytes = Vec::new();
    std::io::stdin().lock().read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn csv_text(ids: &[String], answers: &[Answer], details: &[Detail]) -> String {
    let always = ["id", "fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm", "energy_j", "status"];
    let head = always.into_iter().chain(details.iter().map(Detail::id));
    let row = |(id, answer): (&String, &Answer)| -> Vec<String> {
        let numbers = answer.wrench.force_n.into_iter().chain(answer.wrench.torque_nm).map(shortest);
        let energy = answer.energy_j.map(shortest).unwrap_or_default();
        let known = details.iter().zip(&answer.details).map(|(detail, value)| written(detail, *value));
        let others = [energy, answer.status.name().to_owned()].into_iter().chain(known);
        std::iter::once(id.clone()).chain(numbers).chain(others).collect()
    };
    to_csv(head, ids.iter().zip(answers).map(row))
}

/// Formats a detail for its column.
fn written(detail: &Detail, value: Option<f64>) -> String {
    let Some(value) = value else { return String::new() };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // `as` saturates: an invalid value has no word
    let word = detail.words().get(value as usize);
    word.map_or_else(|| shortest(value), |word| word.as_str().to_owned())
}

/// Formats a number as the shortest text that parses to the same bits.
fn shortest(number: f64) -> String {
    format!("{number:?}")
}
