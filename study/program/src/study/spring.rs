//! `flotor study spring`: fits a spring to a measured curve, plots both, and writes scenes of the fitted spring or of the
//! curve.

use super::curve::{CurveError, FITTED, MeasuredCurve, ServedCurve, SpringFit};
use clap::Args;
use flotor_command::options::{JsonOption, new_file, number, svg_file};
use flotor_command::{CommandError, print_result, style, write_text};
use flotor_hal::{TextProblem, read_text};
use flotor_plot::{Axis, Figure, Panel, Quantity, Series};
use flotor_session::registry::is_same_file;
use std::path::{Path, PathBuf};

#[derive(Args)]
#[command(after_help = "The table has the header `length_mm,force_n` or `compression_mm,force_n`.\n\n\
    Examples:\n  \
    flotor study spring measured.csv --plot measured.svg\n  \
    flotor study spring measured.csv --scene real.toml\n  \
    flotor study jnd --scene real.toml --bases 17 --out real\n  \
    flotor study spring measured.csv --curve-scene curve.toml\n  \
    flotor study jnd --scene curve.toml --stimulus measured.stiffness_scale --bases 1 --out curve")]
pub(super) struct SpringArguments {
    /// Measured force over length or compression (CSV)
    #[arg(value_name = "FILE.csv")]
    curve: PathBuf,
    /// Free length: length without load, in mm (default: the longest length in the table; required for --scene if the
    /// table has compressions)
    #[arg(long, value_parser = number("mm", "length", 0.01..=1000.0), value_name = "MM")]
    free_length_mm: Option<f64>,
    /// Diameter of the coil between wire centres, in mm, for --scene (default: 6.07) and --curve-scene (default: 6)
    #[arg(long, value_parser = number("mm", "length", 0.01..=1000.0), value_name = "MM")]
    coil_diameter_mm: Option<f64>,
    /// Plot the measurement and the fitted spring
    #[arg(long, value_parser = svg_file, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Write a scene with the fitted spring, for `flotor study jnd --scene` and `flotor run`
    #[arg(long, value_parser = new_file, value_name = "FILE.toml")]
    scene: Option<PathBuf>,
    /// Write a scene with the measured curve, and beside it the table of the curve, FILE.csv
    #[arg(long, value_parser = new_file, value_name = "FILE.toml")]
    curve_scene: Option<PathBuf>,
    #[command(flatten)]
    json: JsonOption,
}

pub(super) fn run(arguments: &SpringArguments) -> Result<(), CommandError> {
    let path = &arguments.curve;
    let text =
        read_text(path, "the table").map_err(|wrong| CommandError::Usage(wrong.in_file(path.display())))?;
    let refused = |error| {
        let wrong = match error {
            CurveError::Line(problem) => problem,
            other => TextProblem::of_file(other.to_string()),
        };
        CommandError::Usage(wrong.in_file(path.display()))
    };
    let curve =
        MeasuredCurve::parse(&text, arguments.free_length_mm.map(|mm| mm * 1.0e-3)).map_err(refused)?;
    let fit = curve.fit().map_err(refused)?;
    let served = curve.served().map_err(refused)?;
    let fitted = arguments.scene.as_ref().map(|_| scene(&fit, arguments.coil_diameter_mm));
    let fitted = fitted.transpose().map_err(refused)?;
    let title = style::title(&path.display().to_string());
    print_result(arguments.json.file(), &fit, || format!("{title}\n{}", to_text(&fit, &served)))?;
    write_text(arguments.plot.as_deref(), || picture(&curve, &fit, &served))?;
    write_text(arguments.scene.as_deref(), || fitted.unwrap_or_default())?;
    if let Some(path) = &arguments.curve_scene {
        let table = path.with_extension("csv");
        if is_same_file(&table, &arguments.curve) {
            let table = table.display();
            let why = format!(
                "--curve-scene {}: `{table}` is the measurement itself; choose another name",
                path.display()
            );
            return Err(CommandError::Usage(why));
        }
        write_text(Some(&table), || served.to_table())?;
        write_text(Some(path), || curve_scene(&table, &fit, &served, arguments.coil_diameter_mm))?;
    }
    Ok(())
}

fn to_text(fit: &SpringFit, served: &ServedCurve) -> String {
    let [low, high] = fit.stiffness_interval_n_per_m.map(|end| end * 1.0e-3);
    let known = |value: Option<f64>, text: &dyn Fn(f64) -> String| {
        value.map_or_else(|| "unknown (--free-length-mm)".to_owned(), text)
    };
    [
        format!("stiffness    {:.4} N/mm  (95 %: {low:.4} to {high:.4})", fit.stiffness_n_per_m * 1.0e-3),
        format!("play         {:.3} mm", fit.offset_m * 1.0e3),
        format!(
            "free length  {}",
            known(fit.free_length_m, &|length_m: f64| format!("{:.3} mm", length_m * 1.0e3))
        ),
        format!("gamma        {}", known(fit.gamma_n, &|gamma_n: f64| format!("{gamma_n:.3} N"))),
        format!(
            "R²           {:.6} over {} points between 30 and 70 % of the deflection",
            fit.r_squared, fit.points
        ),
        format!("nonlinearity {:.1} % of the largest force, ends included", fit.nonlinearity * 100.0),
        format!("as measured  {} knots, {:.3} N rms from the points", served.knots.len(), served.rms_n),
    ]
    .map(|line| format!("  {line}"))
    .join("\n")
}

/// Plots the measurement with the fitted spring and the rendered curve.
fn picture(curve: &MeasuredCurve, fit: &SpringFit, served: &ServedCurve) -> String {
    let points = || curve.points.iter().map(|(x_m, force_n)| (x_m * 1.0e3, *force_n));
    let deepest_mm = points().map(|(x_mm, _)| x_mm).fold(0.0, f64::max);
    let line = |share: f64| {
        let x_mm = share * deepest_mm;
        (x_mm, fit.stiffness_n_per_m * (x_mm * 1.0e-3 - fit.offset_m))
    };
    let panel = Panel::new(Axis::of("Force", Quantity::Force))
        .series(Series::points("measured", points()).slot(0))
        .series(Series::line("fitted spring", [0.0, 1.0].map(line)).slot(1))
        .series(Series::line("fitted here", FITTED.map(line)).slot(2))
        .series(
            Series::line("rendered measured curve", served.knots.iter().map(|(x_m, n)| (x_m * 1.0e3, *n)))
                .slot(3),
        );
    Figure::new("A real spring", Axis::of("Compression", Quantity::Length))
        .subtitle(format!(
            "{:.4} N/mm{}, R² {:.5}",
            fit.stiffness_n_per_m * 1.0e-3,
            fit.gamma_n.map_or_else(String::new, |gamma_n| format!(", gamma {gamma_n:.3} N")),
            fit.r_squared
        ))
        .panel_height_px(320.0)
        .panel(panel)
        .to_svg()
}

/// Returns the scene (TOML) of the fitted spring, with the model `spring`; an error without a free length.
fn scene(fit: &SpringFit, coil_diameter_mm: Option<f64>) -> Result<String, CurveError> {
    let (free_length_m, gamma_n) = fit.free_length_m.zip(fit.gamma_n).ok_or(CurveError::NoFreeLength)?;
    let parameters = format!(
        "preset = \"thesis-1\"\nvariant = \"energy\"\nmode = \"gamma\"\n# Fitted to a measured curve.\n\
         gamma_n = {gamma_n:.6}\nfree_length_mm = {:.6}\n{}",
        free_length_m * 1.0e3,
        coil(coil_diameter_mm)
    );
    let head = "# A spring fitted to a real spring; an experiment sets its stiffness gamma / L0 between trials.\n\
                title = \"A real spring, fitted\"\n";
    Ok(life_size(head, "spring", &parameters))
}

/// Drawn length of a spring of unknown free length, as a multiple of the largest compression.
const DRAWN: f64 = 1.5;

/// Returns the scene (TOML) of the measured curve, with the model `measured` and the file `table`.
fn curve_scene(table: &Path, fit: &SpringFit, served: &ServedCurve, coil_diameter_mm: Option<f64>) -> String {
    let table = table.file_name().unwrap_or_default().to_string_lossy();
    let deepest_m = served.knots.last().map_or(0.0, |(x_m, _)| *x_m);
    let (note, length_m) = match fit.free_length_m {
        Some(length_m) => ("", length_m),
        None => ("# Unknown; used only for the drawing.\n", (DRAWN * deepest_m).max(1.0e-3)),
    };
    let parameters = format!(
        "curve = {table:?}\n{note}free_length_mm = {:.6}\n{}",
        length_m * 1.0e3,
        coil(coil_diameter_mm)
    );
    let head = "# A real spring as it was measured; `stiffness_scale` makes it stiffer or softer as a whole.\n\
                title = \"A real spring, as measured\"\n";
    life_size(head, "measured", &parameters)
}

fn coil(diameter_mm: Option<f64>) -> String {
    diameter_mm.map_or_else(String::new, |mm| format!("coil_diameter_mm = {mm}\n"))
}

/// Returns a scene without scaling of motion or force, as for a real spring.
fn life_size(head: &str, plugin: &str, parameters: &str) -> String {
    format!(
        "{head}rate_hz = 1000\n\n[device]\nplugin = \"simulated\"\n\n[[model]]\nplugin = \"{plugin}\"\n\n\
         [model.parameters]\n{parameters}\n[model.mapping]\nmotion_scale = 1.0\nforce_scale = 1.0\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_session::scene::Scene;

    fn fit(free_length_m: Option<f64>) -> SpringFit {
        SpringFit {
            stiffness_n_per_m: 680.0,
            stiffness_interval_n_per_m: [679.0, 681.0],
            offset_m: 0.0,
            free_length_m,
            gamma_n: free_length_m.map(|length_m| 680.0 * length_m),
            r_squared: 1.0,
            points: 41,
            nonlinearity: 0.0,
        }
    }

    #[test]
    fn a_fitted_spring_makes_a_scene_of_its_own_size() {
        let text = scene(&fit(Some(0.025)), Some(6.0)).unwrap();
        let scene = Scene::parse(Path::new("real.toml"), &text).unwrap();
        let parameters = &scene.models[0].plugin.parameters;
        let value =
            |key: &str| parameters.iter().find(|p| p.key == key).unwrap().value.parse::<f64>().unwrap();
        assert_eq!([value("gamma_n"), value("free_length_mm"), value("coil_diameter_mm")], [17.0, 25.0, 6.0]);
        assert_eq!((scene.models[0].mapping.motion_scale, scene.models[0].mapping.force_scale), (1.0, 1.0));
    }

    #[test]
    fn a_length_that_is_not_known_is_needed_for_the_fit_and_not_for_the_curve() {
        assert_eq!(scene(&fit(None), None), Err(CurveError::NoFreeLength));
        let served = ServedCurve { knots: vec![(0.0, 0.0), (0.02, 9.0)], rms_n: 0.0 };
        let text = curve_scene(Path::new("real.csv"), &fit(None), &served, None);
        assert!(text.contains("free_length_mm = 30.000000\n"), "{text}");
        Scene::parse(Path::new("real.toml"), &text).unwrap();
    }
}
