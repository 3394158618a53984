//! Options that several commands have, and parsers of option values.

use crate::CommandError;
use clap::{Args, Command, CommandFactory, Parser, Subcommand, ValueEnum};
pub use flotor_core::LARGEST_SEED;
use flotor_core::limits::Limits;
use flotor_hal::terminal::escaped_arguments;
use flotor_loader::{Plugin, Setting};
use flotor_servo::Core;
use flotor_session::Strength;
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
pub use flotor_session::scene::{KeyValue, PluginKeyValue};
use std::ffi::OsStr;
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Smallest stack size with which the parser of all options works in every build, bytes.
const LEAST_STACK_BYTES: u64 = 1 << 20;

/// Parses the arguments of this process; ends the process after an invalid argument, `--help` or `--version`, and if the stack is
/// too small for the parser. A negative number counts as the value of an option, not as another option. First restores the default
/// action of interrupts, which a shell ignores for commands in the background. Not real-time.
pub fn arguments<T: Parser>() -> T {
    crate::platform::accept_interrupts();
    if let Some(bytes) = crate::platform::stack_limit_bytes().filter(|bytes| *bytes < LEAST_STACK_BYTES) {
        let (has, least) = (bytes >> 10, LEAST_STACK_BYTES >> 10);
        crate::print_error_line(format_args!(
            "error: the stack limit of {has} kB is too small; raise the limit to at least {least} kB, for example with `ulimit -s 8192`"
        ));
        std::process::exit(2);
    }
    let command = || with_negative_numbers(T::command());
    let refused = |error: clap::Error| {
        let _ = command().get_matches_from(escaped_arguments());
        error.exit()
    };
    let matches = command().try_get_matches().unwrap_or_else(refused);
    T::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
}

// Without a doc comment, which would replace the description of the program: that of the commands.
#[derive(Parser)]
#[command(name = "flotor", bin_name = "flotor", version, max_term_width = 110)]
struct SeparateArguments<C: Subcommand> {
    #[command(subcommand)]
    command: C,
}

/// Returns the parser of a separate program that `flotor` starts for the commands `C`. Not real-time.
#[must_use]
pub fn parser_of<C: Subcommand>() -> Command {
    SeparateArguments::<C>::command()
}

/// Parses the command of this process, a separate program that `flotor` starts, as [`arguments`] does.
pub fn command_of<C: Subcommand>() -> C {
    arguments::<SeparateArguments<C>>().command
}

fn with_negative_numbers(command: Command) -> Command {
    let command = command.mut_args(|arg| {
        let takes_values = arg.get_action().takes_values();
        arg.allow_negative_numbers(takes_values)
    });
    command.mut_subcommands(with_negative_numbers)
}

/// Clock of a run for `--clock`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum ClockOption {
    /// The machine's clock
    #[default]
    Real,
    /// As fast as possible, bit-exact
    Virtual,
}

/// Options of each command that runs a scene on a device.
#[derive(Args, Clone, Debug, Default)]
pub struct SceneOptions {
    #[command(flatten)]
    plugin_path: PluginPathOption,
    /// Lift the host's ceiling of 20 N and 1 N·m for devices that are not simulated
    #[arg(long)]
    allow_strong: bool,
    #[command(flatten)]
    control_group: ControlGroupOption,
}

impl SceneOptions {
    /// Returns the strength permitted to devices: above the host's ceiling with `--allow-strong`.
    #[must_use]
    pub fn strength(&self) -> Strength {
        if self.allow_strong { Strength::Strong } else { Strength::UnderCeiling }
    }

    /// Searches the given plugin folders, then the default ones, and returns the registry of their plugins. Not real-time.
    #[must_use]
    pub fn registry(&self) -> Registry {
        self.plugin_path.registry()
    }

    /// Inserts the given plugin folders before the plugin folders of a scene, and sets the scene's consent to a shared control
    /// group if it was given on the command line.
    pub fn apply(&self, scene: &mut Scene) {
        self.plugin_path.put_before_those_of(scene);
        self.control_group.apply(&mut scene.limits);
    }
}

/// Options of each command that lends a device to programs written for another maker's interface.
#[derive(Args, Clone, Debug, Default)]
pub struct LendOptions {
    /// Record every tick to an MCAP file
    #[arg(long, value_parser = mcap_file, value_name = "FILE.mcap")]
    pub record: Option<PathBuf>,
    /// Write the summary as JSON
    #[arg(long, value_parser = json_file, value_name = "FILE.json")]
    pub json: Option<PathBuf>,
    /// Folders to search for plugins.
    #[command(flatten)]
    pub plugin_path: PluginPathOption,
    /// Consent to a shared control group.
    #[command(flatten)]
    pub control_group: ControlGroupOption,
}

/// `--accept-shared-control-group`, of each command that drives a device.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ControlGroupOption {
    /// Accept a device without a watchdog of its own although a kill of this program's control group also ends the watchdog
    /// process, and no process stops the device (default: refuse)
    #[arg(long)]
    accept_shared_control_group: bool,
}

impl ControlGroupOption {
    /// Sets the consent in the limits of a scene, if it was given on the command line.
    pub fn apply(self, limits: &mut Limits) {
        limits.accept_shared_control_group |= self.accept_shared_control_group;
    }

    /// Returns true if the consent was given on the command line.
    #[must_use]
    pub fn is_accepted(self) -> bool {
        self.accept_shared_control_group
    }

    /// Returns the option as an argument for another process of Flotor; none if it was not given.
    pub fn arguments(self) -> impl Iterator<Item = &'static str> {
        self.accept_shared_control_group.then_some("--accept-shared-control-group").into_iter()
    }
}

/// `--plugin-path`, of each command that searches for plugins.
#[derive(Args, Clone, Debug, Default)]
pub struct PluginPathOption {
    /// Folder to search for plugins before all others (repeatable)
    #[arg(long = "plugin-path", value_parser = folder, value_name = "FOLDER")]
    folders: Vec<PathBuf>,
}

impl PluginPathOption {
    /// Returns the given folders, in their order.
    #[must_use]
    pub fn folders(&self) -> &[PathBuf] {
        &self.folders
    }

    /// Searches the given folders, then the default folders, and returns the registry of their plugins. Not real-time.
    #[must_use]
    pub fn registry(&self) -> Registry {
        Registry::search(&self.folders)
    }

    /// Inserts the given folders before the plugin folders of the scene.
    pub fn put_before_those_of(&self, scene: &mut Scene) {
        scene.plugin_folders.splice(0..0, self.folders.iter().cloned());
    }

    /// Returns the option with its folders as arguments for another process of Flotor.
    pub fn arguments(&self) -> impl Iterator<Item = &OsStr> {
        self.folders.iter().flat_map(|folder| [OsStr::new("--plugin-path"), folder.as_os_str()])
    }
}

/// `--json`, of each command with a result for programs. Without a file, or with `-`, the JSON is all that appears on standard
/// output.
#[derive(Args, Clone, Debug, Default)]
pub struct JsonOption {
    /// Write the result as JSON to this file; without a file or with -, to standard output
    #[arg(long, value_name = "FILE.json", num_args = 0..=1, default_missing_value = "-", value_parser = json_output)]
    json: Option<PathBuf>,
}

impl JsonOption {
    /// Returns the path of the JSON file, `-` for standard output; `None` without the option.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        self.json.as_deref()
    }

    /// Returns true if the JSON goes to standard output, which then has no other output.
    #[must_use]
    pub fn is_on_standard_output(&self) -> bool {
        self.file().is_some_and(|file| file.as_os_str() == "-")
    }

    /// Writes a result as JSON, if requested; returns true if standard output is free for text. Not real-time.
    ///
    /// # Errors
    /// As [`write_json`](crate::write_json).
    pub fn write(&self, value: &impl serde::Serialize) -> Result<bool, CommandError> {
        self.file().map_or(Ok(()), |file| crate::write_json(file, value))?;
        Ok(!self.is_on_standard_output())
    }
}

/// Options of each command that searches for plugins and has a result for programs.
#[derive(Args, Clone, Debug, Default)]
pub struct PluginResultOptions {
    /// Output as JSON.
    #[command(flatten)]
    pub json: JsonOption,
    /// Folders to search for plugins.
    #[command(flatten)]
    pub plugin_path: PluginPathOption,
}

/// Model of a command: the first argument, or `--model`.
#[derive(Args, Clone, Debug)]
pub struct ModelOption {
    /// Id of the model, or path to its plugin file
    #[arg(value_name = "ID", required_unless_present = "named_model")]
    model: Option<String>,
    /// The model, in place of the first argument
    #[arg(long = "model", value_name = "ID", conflicts_with = "model")]
    named_model: Option<String>,
}

impl ModelOption {
    /// Returns the id of the model, or the path to its plugin file.
    #[must_use]
    pub fn name(&self) -> &str {
        self.model.as_ref().or(self.named_model.as_ref()).map_or("", String::as_str)
    }
}

/// Parses a duration such as `10`, `10s`, `500ms`, `2min` or `1h`, and returns it in seconds; a number without unit is in seconds.
///
/// # Errors
/// If the text is not a duration from 0 to 1 year.
pub fn duration_s(text: &str) -> Result<f64, String> {
    let text = text.trim();
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let scale = match unit {
        "" | "s" => 1.0,
        "ms" => 1.0e-3,
        "min" | "m" => 60.0,
        "h" => 3600.0,
        other => return Err(format!("unknown unit of time `{other}`; use ms, s, min or h")),
    };
    let number: f64 = number.trim().parse().map_err(|_| {
        format!("invalid duration `{text}`; write a number, in s or with its unit, such as 10, 10s or 500ms")
    })?;
    let seconds = number * scale;
    let is_legal = (0.0..=31_536_000.0).contains(&seconds);
    if is_legal {
        Ok(seconds)
    } else {
        Err(format!("the duration `{text}` is outside the range of 0 to 1 year"))
    }
}

/// Parses a loop rate in Hz, with or without the unit.
///
/// # Errors
/// If the text is not a rate from 100 to 10000 Hz.
pub fn rate_hz(text: &str) -> Result<f64, String> {
    number("Hz", "rate", 100.0..=10_000.0)(text)
}

/// Returns a parser of numbers in the range `legal`, with or without the unit; the parser's error messages call the number `what`.
pub fn number(
    unit: &'static str,
    what: &'static str,
    legal: RangeInclusive<f64>,
) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let number = text.trim().trim_end_matches(unit).trim().parse();
        let (least, most) = (legal.start(), legal.end());
        let number = number
            .map_err(|_| format!("invalid {what} `{text}`; write a number from {least} to {most} {unit}"))?;
        let legal = legal.contains(&number).then_some(number);
        legal.ok_or_else(|| format!("the range is {least} to {most} {unit}"))
    }
}

/// Returns a parser of whole numbers in the range `legal`.
pub fn count<T: FromStr + PartialOrd + Display + Clone>(
    legal: RangeInclusive<T>,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text| {
        let number = text.trim().parse().ok().filter(|number| legal.contains(number));
        number.ok_or_else(|| format!("write a whole number from {} to {}", legal.start(), legal.end()))
    }
}

/// Parses the path of a file to write.
///
/// # Errors
/// If the path has no file name, or its folder does not exist.
pub fn new_file(text: &str) -> Result<PathBuf, String> {
    let file = PathBuf::from(text);
    match file.parent() {
        None => Err("name a file".to_owned()),
        Some(folder) if folder.as_os_str().is_empty() || folder.is_dir() => Ok(file),
        Some(folder) => Err(format!("no folder `{}`; create it first", folder.display())),
    }
}

/// Parses the path of a picture to write, `.svg` or without extension.
///
/// # Errors
/// If the path has no file name or another extension, or its folder does not exist.
pub fn svg_file(text: &str) -> Result<PathBuf, String> {
    file_of(text, "svg")?.ok_or_else(|| "the picture is an SVG; name it FILE.svg".to_owned())
}

/// Parses the path of a recording to write, `.mcap` or without extension.
///
/// # Errors
/// If the path has no file name or another extension, or its folder does not exist.
pub fn mcap_file(text: &str) -> Result<PathBuf, String> {
    file_of(text, "mcap")?.ok_or_else(|| "the recording is an MCAP file; name it FILE.mcap".to_owned())
}

/// Parses the path of a JSON file to write. The extension has to be `.json`, except for a pipe or a device: an option with an
/// optional file would otherwise overwrite the file named by the next argument.
///
/// # Errors
/// If the path has no file name or another extension, or its folder does not exist.
pub fn json_file(text: &str) -> Result<PathBuf, String> {
    let file = new_file(text)?;
    let is_json = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("json"));
    // A pipe or a device, such as /dev/stderr.
    let is_special = || std::fs::metadata(&file).is_ok_and(|known| !known.is_file() && !known.is_dir());
    if is_json || is_special() { Ok(file) } else { Err("the result is JSON; name it FILE.json".to_owned()) }
}

/// Parses the value of `--json`.
fn json_output(text: &str) -> Result<PathBuf, String> {
    if text == "-" {
        return Ok(text.into());
    }
    json_file(text).map_err(|problem| format!("{problem}, or write - for standard output"))
}

/// Parses the path of an existing folder.
///
/// # Errors
/// If the folder does not exist.
pub fn folder(text: &str) -> Result<PathBuf, String> {
    let folder = PathBuf::from(text);
    if folder.is_dir() { Ok(folder) } else { Err("no such folder; check the path".to_owned()) }
}

/// Parses the path of a file to write; `None` if it has an extension other than `kind`.
fn file_of(text: &str, kind: &str) -> Result<Option<PathBuf>, String> {
    let file = new_file(text)?;
    Ok(file.extension().is_none_or(|extension| extension.eq_ignore_ascii_case(kind)).then_some(file))
}

/// Parses a finite floating-point number, without a check of its range.
///
/// # Errors
/// If the text is not a number, or the number is infinite or NaN.
pub fn real(text: &str) -> Result<f64, String> {
    let number = text.trim().parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| "write a number such as 0.75".to_owned())
}

/// Parses a seed, at most [`LARGEST_SEED`].
///
/// # Errors
/// If the text is not a whole number in this range.
pub fn seed(text: &str) -> Result<u64, String> {
    let number = text.trim().parse().ok().filter(|seed| *seed <= LARGEST_SEED);
    number.ok_or_else(|| {
        format!("write a whole number from 0 to {LARGEST_SEED} (2^53, the largest whole number that every JSON reader keeps exact)")
    })
}

/// Parses the number of a processor core.
///
/// # Errors
/// If the text is not a number, or the system cannot address a core with this number.
pub fn core(text: &str) -> Result<Core, String> {
    let number = text
        .trim()
        .parse()
        .map_err(|_| format!("invalid core number `{text}`; write a whole number, 0 or more"))?;
    Core::new(number).ok_or_else(|| {
        format!("the system cannot address core {number}; write a smaller number: the first core is 0")
    })
}

/// Parses the values `KEY=VALUE` of an option, such as `--set`, with the parameter schema of a plugin.
///
/// # Errors
/// If the schema has no such parameter, or the value is invalid.
pub fn settings(plugin: &Plugin, option: &str, sets: &[KeyValue]) -> Result<Vec<Setting>, CommandError> {
    let check = |set: &KeyValue| {
        let parameter = set.parameter();
        Setting::parse(plugin.parameters(), &parameter.key, &parameter.value)
            .map_err(|error| CommandError::Usage(format!("{option} {}: {error}", parameter.key)))
    };
    sets.iter().map(check).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_may_have_its_unit_and_stays_in_its_range() {
        let force = number("N", "force", 1.0..=50.0);
        assert_eq!((force("10"), force(" 2.5 N ")), (Ok(10.0), Ok(2.5)));
        assert_eq!(force("ten N"), Err("invalid force `ten N`; write a number from 1 to 50 N".to_owned()));
        for outside in ["0.5", "51N", "inf", "nan"] {
            assert_eq!(force(outside), Err("the range is 1 to 50 N".to_owned()), "{outside}");
        }
        assert_eq!(rate_hz("1000 Hz"), Ok(1000.0));
        assert_eq!(rate_hz("99"), Err("the range is 100 to 10000 Hz".to_owned()));
    }

    /// The error of clap has the option and the value before this text.
    #[test]
    fn a_number_without_a_range_is_finite() {
        assert_eq!((real(" -0.5 "), real("1e3")), (Ok(-0.5), Ok(1000.0)));
        let argument = clap::Arg::new("step").long("step").value_parser(real);
        let command = with_negative_numbers(Command::new("test").arg(argument));
        for wrong in ["nan", "inf", "-inf", "infinity", "1e999", "half"] {
            let matched = command.clone().try_get_matches_from(["test", &format!("--step={wrong}")]);
            let error = matched.unwrap_err().to_string();
            for part in [format!("'{wrong}'").as_str(), "--step", "write a number such as 0.75"] {
                assert!(error.contains(part), "{error}");
            }
        }
    }

    #[test]
    fn a_whole_number_stays_in_its_range() {
        assert_eq!(count(1..=200_u32)(" 200 "), Ok(200));
        for outside in ["0", "201", "-1", "2.5", "two", ""] {
            assert_eq!(count(1..=200_u32)(outside), Err("write a whole number from 1 to 200".to_owned()));
        }
    }

    #[test]
    fn a_new_file_has_a_name_and_a_folder() {
        assert_eq!(svg_file("run.svg"), Ok("run.svg".into()));
        assert_eq!(svg_file(""), Err("name a file".to_owned()));
        assert_eq!(new_file("nosuch/c.toml"), Err("no folder `nosuch`; create it first".to_owned()));
    }

    #[test]
    fn a_negative_number_is_a_value_and_not_an_option() {
        let argument = clap::Arg::new("seed").long("seed").value_parser(seed);
        let command = with_negative_numbers(Command::new("test").arg(argument));
        let error = command.try_get_matches_from(["test", "--seed", "-1"]).unwrap_err().to_string();
        assert!(error.contains("write a whole number from 0 to 9007199254740992"), "{error}");
    }

    #[test]
    fn a_seed_is_a_number_that_json_keeps() {
        assert_eq!(seed("9007199254740992"), Ok(LARGEST_SEED));
        for large in ["9007199254740993", "18446744073709551615", "99999999999999999999"] {
            assert!(seed(large).is_err(), "{large}");
        }
        // What a program reads that keeps the numbers of JSON as f64.
        assert_eq!((LARGEST_SEED as f64).to_string(), LARGEST_SEED.to_string());
    }

    #[test]
    fn a_file_has_the_extension_of_its_kind_or_none() {
        assert!(
            [svg_file("a.SVG"), svg_file("a"), mcap_file("a.mcap"), mcap_file("/dev/full")]
                .iter()
                .all(Result::is_ok)
        );
        assert!(svg_file("a.mcap").is_err());
        assert_eq!(mcap_file("r.txt"), Err("the recording is an MCAP file; name it FILE.mcap".to_owned()));
    }

    #[test]
    fn the_argument_after_json_is_not_overwritten() {
        assert_eq!(json_output("-"), Ok("-".into()));
        assert_eq!(json_output("run.json"), Ok("run.json".into()));
        if Path::new("/dev/full").is_absolute() {
            assert_eq!(json_output("/dev/full"), Ok("/dev/full".into()));
        }
        for other in ["scene.toml", "spring", "libmy_model.so", "/tmp"] {
            let told = "the result is JSON; name it FILE.json, or write - for standard output";
            assert_eq!(json_output(other), Err(told.to_owned()), "{other}");
        }
    }

    #[test]
    fn durations_have_units() {
        assert_eq!(duration_s("10"), Ok(10.0));
        assert_eq!(duration_s("10s"), Ok(10.0));
        assert_eq!(duration_s(" 500 ms"), Ok(0.5));
        assert_eq!(duration_s("2min"), Ok(120.0));
        assert!(duration_s("10 parsec").is_err());
        assert!(duration_s("-1s").is_err());
        assert!(duration_s("nan").is_err());
    }
}
