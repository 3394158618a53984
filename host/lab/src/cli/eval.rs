//! `flotor eval`: poses in, wrenches out, as CSV.

use crate::evaluate::{Answer, Details, EvaluateError, Evaluation, Handle, Travel};
use clap::Args;
use flotor_command::options::{KeyValue, new_file, settings};
use flotor_command::tables::to_csv;
use flotor_command::{CommandError, note, progress_bar, write_text};
use flotor_hal::abi::PluginKind;
use flotor_hal::{DVec3, Detail};
use flotor_session::registry::{Registry, is_same_file};
use flotor_session::scene::{cannot_read, did_you_mean};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Evaluate a force model at poses from a CSV file.
#[derive(Args)]
#[command(
    after_help = "Poses: a header [id,]x_m,y_m,z_m,rx_rad,ry_rad,rz_rad and one row a pose, in the model frame (home is \
    the origin, z up; rx, ry, rz is a rotation vector). nan and inf are legal. Result: id, force, torque, energy, status; \
    with --details also the details of the model (the spring: branch, stable, seat_roll_rad, \
    rod_share).\n\n\
    Examples:\n  \
    flotor eval --model spring --poses poses.csv --out wrenches.csv\n  \
    flotor eval --model spring --set variant=rod --set accuracy=tight --details --poses poses.csv\n  \
    echo 'x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\n0,0,-0.005,0,0,0' | flotor eval --model spring --poses -"
)]
pub(crate) struct EvalArguments {
    /// Id of the model, or path to its plugin file
    #[arg(long, value_name = "ID")]
    model: String,
    /// Set a parameter of the model (repeatable)
    #[arg(long = "set", value_name = "KEY=VALUE")]
    sets: Vec<KeyValue>,
    /// Poses (- for standard input)
    #[arg(long, value_name = "IN.csv")]
    poses: PathBuf,
    /// Wrenches (- for standard output)
    #[arg(long, value_name = "OUT.csv", default_value = "-", value_parser = new_file)]
    out: PathBuf,
    /// Rows are successive poses of one handle (default: each pose is reached from home)
    #[arg(long)]
    path: bool,
    /// Append the details of the model, a column each
    #[arg(long)]
    details: bool,
}

/// Columns of a pose, in order.
const POSE_COLUMNS: [&str; 6] = ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];
/// Optional first column.
const ID_COLUMN: &str = "id";

pub(crate) fn run(arguments: &EvalArguments) -> Result<(), CommandError> {
    if is_same_file(&arguments.out, &arguments.poses) {
        let out = arguments.out.display();
        return Err(CommandError::Usage(format!("--out {out}: holds the poses; choose another file")));
    }
    let plugin = Registry::search(&[]).load(&arguments.model, PluginKind::Model)?;
    let settings = settings(&plugin, &arguments.sets)?;
    // A refused setting is told before a long file is read.
    let details = if arguments.details { plugin.create_model(&settings)?.details() } else { &[] };
    let (ids, handles) = read_poses(&arguments.poses)?;
    let evaluation = Evaluation {
        plugin: &plugin,
        settings: &settings,
        travel: if arguments.path { Travel::Successive } else { Travel::FromHome },
        details: if arguments.details { Details::Asked } else { Details::Omitted },
    };
    let bar = progress_bar(handles.len() as u64, "{wide_bar} {pos}/{len} poses  {elapsed}");
    let answers = evaluation.answers(&handles, &|| bar.inc(1)).map_err(|error| match error {
        EvaluateError::Load(error) => CommandError::from(error),
        broke @ EvaluateError::Broke { .. } => {
            CommandError::PluginRefused(format!("{}: {broke}", plugin.metadata().path.display()))
        }
    })?;
    bar.finish_and_clear();
    write_text(Some(&arguments.out), || csv_text(&ids, &answers, details))
}

fn read_poses(path: &Path) -> Result<(Vec<String>, Vec<Handle>), CommandError> {
    let problem = |text: String| CommandError::Usage(format!("{}{text}", path.display()));
    let bytes =
        read_bytes(path).map_err(|cause| problem(format!(": {}", cannot_read("the poses", &cause))))?;
    let text = String::from_utf8(bytes).map_err(|error| {
        let before = error.as_bytes().get(..error.utf8_error().valid_up_to()).unwrap_or_default();
        let line = 1 + before.iter().filter(|byte| **byte == b'\n').count();
        problem(format!(":{line}: this is not UTF-8; save the poses as UTF-8"))
    })?;
    if text.trim().is_empty() {
        return Err(problem(format!(": no poses; the header is {}", header_text())));
    }
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_bytes());
    let line = |at: Option<&csv::Position>| at.map_or(1, |at| line_of(&text, at));
    let malformed = |error: csv::Error| {
        let line = line(error.position());
        let problem = match error.kind() {
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
                format!("{len} columns, but the header has {expected_len}")
            }
            _ => error.to_string(),
        };
        CommandError::Usage(format!("{}:{line}: {problem}", path.display()))
    };
    let header = reader.headers().map_err(malformed)?.clone();
    let columns = columns(path, &header)?;
    let id_column = header.iter().position(|name| name == ID_COLUMN);

    let (mut ids, mut handles) = (Vec::new(), Vec::new());
    for record in reader.into_records() {
        let record = record.map_err(malformed)?;
        let mut numbers = [0.0; 6];
        for ((number, column), name) in numbers.iter_mut().zip(columns).zip(POSE_COLUMNS) {
            let text = record.get(column).unwrap_or_default();
            *number = text.parse().map_err(|_| {
                let line = line(record.position());
                CommandError::Usage(format!(
                    "{}:{line}: {name} must be a number, not `{text}`",
                    path.display()
                ))
            })?;
        }
        let id = id_column.and_then(|column| record.get(column)).map(str::to_owned);
        ids.push(id.unwrap_or_else(|| handles.len().to_string()));
        let [x, y, z, rx, ry, rz] = numbers;
        handles.push(Handle { position_m: DVec3::new(x, y, z), rotation_rad: DVec3::new(rx, ry, rz) });
    }
    Ok((ids, handles))
}

fn read_bytes(path: &Path) -> std::io::Result<Vec<u8>> {
    if path.as_os_str() != "-" {
        return std::fs::read(path);
    }
    if std::io::IsTerminal::is_terminal(&std::io::stdin()) {
        note("reading poses from the terminal; end with Ctrl-D");
    }
    let mut bytes = Vec::new();
    std::io::stdin().lock().read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Line, from 1, on which a record stands. The reader's own count ends before blank lines it is about to skip.
fn line_of(text: &str, at: &csv::Position) -> usize {
    let start = usize::try_from(at.byte()).unwrap_or(usize::MAX).min(text.len());
    let (before, from_here) = text.split_at_checked(start).unwrap_or((text, ""));
    let blank = from_here.len() - from_here.trim_start_matches(['\n', '\r']).len();
    let skipped = from_here.get(..blank).unwrap_or_default();
    1 + before.matches('\n').count() + skipped.matches('\n').count()
}

/// Where each pose column is; the error of a missing or unknown one names the right columns.
fn columns(path: &Path, header: &csv::StringRecord) -> Result<[usize; 6], CommandError> {
    let problem = |text: String| CommandError::Usage(format!("{}:1: {text}", path.display()));
    let known = || POSE_COLUMNS.iter().copied().chain([ID_COLUMN]);
    if let Some(unknown) = header.iter().find(|name| !known().any(|column| column == *name)) {
        let hint = did_you_mean(unknown, known());
        return Err(problem(format!("unknown column `{unknown}`{hint} (the header is {})", header_text())));
    }
    let mut columns = [0; 6];
    for (column, name) in columns.iter_mut().zip(POSE_COLUMNS) {
        *column = header
            .iter()
            .position(|found| found == name)
            .ok_or_else(|| problem(format!("column `{name}` is missing")))?;
    }
    Ok(columns)
}

/// The header as people write it.
fn header_text() -> String {
    format!("[{ID_COLUMN},]{}", POSE_COLUMNS.join(","))
}

fn csv_text(ids: &[String], answers: &[Answer], details: &[Detail]) -> String {
    let always = ["id", "fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm", "energy_j", "status"];
    let head = always.into_iter().chain(details.iter().map(Detail::id));
    let row = |(id, answer): (&String, &Answer)| -> Vec<String> {
        let numbers = answer.wrench.force_n.into_iter().chain(answer.wrench.torque_nm).map(shortest);
        let energy = answer.energy_j.map(shortest).unwrap_or_default();
        let known = details.iter().zip(&answer.details).map(|(detail, value)| written(detail, *value));
        let others = [energy, answer.status.word().to_owned()].into_iter().chain(known);
        std::iter::once(id.clone()).chain(numbers).chain(others).collect()
    };
    to_csv(head, ids.iter().zip(answers).map(row))
}

/// A detail as the text of its column.
fn written(detail: &Detail, value: Option<f64>) -> String {
    let Some(value) = value else { return String::new() };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    // saturates: then there is no such word
    let word = detail.words().get(value as usize);
    word.map_or_else(|| shortest(value), |word| word.as_str().to_owned())
}

/// The shortest text that reads back as the same number.
fn shortest(number: f64) -> String {
    format!("{number:?}")
}
