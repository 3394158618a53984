//! The errors of the spring's laws in `docs/src/bench.md`, and the gains in `docs/src/stress.md`, against exact rods of an
//! independent shooting method (`tests/generators/bench.py`).

use flotor_hal::{DVec3, Demand, Input, Pose, StepStatus, Wrench};
use flotor_judge::subject::{call, input_of, prepared};
use flotor_judge::trajectory::sensed;
use flotor_lab::bench::{Hand, Sampling, Workspace};
use flotor_loader::Setting;
use flotor_session::registry::load_file;
use flotor_tests::library::plugin_file;
use flotor_tests::printed::assert_chapter_prints;
use flotor_tests::tables::{Row, number, table};
use flotor_tests::{TestSize, workspace_root};

const CHAPTER: &str = "bench.md";

/// Spacing of the ticks that means are of; ticks with the largest errors stand between them.
const EVERY_OF_THE_HAND: usize = 50;
const EVERY_OF_THE_WORKSPACE: usize = 2;

/// Accuracy of force and torque in the table: rods are solved for the shape to some 1e-13 of its length; the force follows with
/// some 700 N/m, the torque with a lever of 0.1 m.
const EXACT_N: f64 = 2.0e-12;
const EXACT_NM: f64 = 2.0e-13;

/// Laws of a spring as the tables of the chapter name them. None of them has a memory.
const LAWS: [(&str, &[&str]); 7] = [
    ("thesis", &["variant=thesis"]),
    ("thesis f32", &["variant=thesis", "precision=f32"]),
    ("closed-form", &["variant=closed-form"]),
    ("closed-form f32", &["variant=closed-form", "precision=f32"]),
    ("current-length", &["variant=current-length"]),
    ("energy hand_over off", &["variant=energy", "hand_over=off"]),
    ("energy", &["variant=energy"]),
];

/// Answers pose by pose; `None` where a law has none.
fn answers(settings: &[&str], poses: &[Pose]) -> Vec<Option<Wrench>> {
    let plugin = load_file(&plugin_file("flotor-spring")).unwrap_or_else(|error| panic!("{error}"));
    let parse = |setting: &&str| {
        let (id, value) = setting.split_once('=').expect("a setting");
        Setting::parse(plugin.parameters(), id, value).expect("a legal value")
    };
    let settings: Vec<Setting> = settings.iter().map(parse).collect();
    let mut model = prepared(&plugin, &settings, 0).unwrap_or_else(|error| panic!("{error}"));
    let answer = |(pose, tick): (&Pose, u64)| {
        let input = Input { demand: Demand::WRENCH, ..input_of(tick, *pose) };
        let output = call(&mut model, &input).ok()?;
        matches!(output.status(), Some(StepStatus::Ok | StepStatus::Clamped)).then_some(output.wrench)
    };
    poses.iter().zip(0..).map(answer).collect()
}

fn tick(row: &Row) -> usize {
    row["tick"].parse().expect("a tick")
}

fn vector(row: &Row, columns: [&str; 3]) -> DVec3 {
    DVec3::from(columns.map(|column| number(row, column)))
}

/// Largest distance over the rows, and root mean square over those of every so many ticks, of force (N) and torque (N·m).
fn distances(rows: &[Row], every: usize, answers: &[Option<Wrench>]) -> [f64; 4] {
    assert_eq!(rows.len(), answers.len());
    let ([mut largest, mut squares], mut count) = ([[0.0_f64; 2]; 2], 0.0);
    for (row, answer) in rows.iter().zip(answers) {
        let Some(answer) = answer else { continue };
        let force_n = answer.force() - vector(row, ["fx_n", "fy_n", "fz_n"]);
        let torque_nm = answer.torque() - vector(row, ["tx_nm", "ty_nm", "tz_nm"]);
        let weight = if tick(row).is_multiple_of(every) { 1.0 } else { 0.0 };
        for (index, distance) in [force_n.length(), torque_nm.length()].into_iter().enumerate() {
            largest[index] = largest[index].max(distance);
            squares[index] += weight * distance * distance;
        }
        count += weight;
    }
    let [force_n, torque_nm] = squares.map(|sum: f64| (sum / count).sqrt());
    [largest[0], force_n, largest[1], torque_nm]
}

/// Numbers as the chapter prints them, after a name.
fn printed(name: &str, numbers: &[f64]) -> String {
    let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:.1e}")).collect();
    format!("{name} {}", numbers.join(" "))
}

#[test]
fn the_book_prints_errors_and_losses_along_the_hand() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let rows = table("bench_hand.csv");
    assert!(rows.len() > 600, "{}", rows.len());
    let path = Hand::default().poses(30_000);
    let poses: Vec<Pose> = rows.iter().map(|row| path[tick(row)]).collect();
    let Sampling { quantum_m, quantum_rad, .. } = Sampling::FULL;
    let shown: Vec<Pose> = poses.iter().map(|pose| sensed(*pose, quantum_m, quantum_rad)).collect();
    let losses = table("bench_losses.csv");
    let [hold_n, delay_n, sensor_n] = ["hold_n", "delay_n", "sensor_n"].map(|name| number(&losses[0], name));
    for (name, settings) in LAWS {
        let errors = distances(&rows, EVERY_OF_THE_HAND, &answers(settings, &poses));
        assert_chapter_prints(CHAPTER, &printed(name, &errors));
        // The force that answers a sample is rendered in the period after the next tick: by Gauss's rule of two points.
        let late = |row: &Row, moment: u32| {
            DVec3::from(["x", "y", "z"].map(|axis| number(row, &format!("late_{moment}_{axis}_n"))))
        };
        let squares: Vec<f64> = rows
            .iter()
            .zip(answers(settings, &shown))
            .filter(|(row, _)| tick(row).is_multiple_of(EVERY_OF_THE_HAND))
            .flat_map(|(row, answer)| {
                let force_n = answer.expect("the hand stays in the domain").force();
                [1, 2].map(|moment| (force_n - late(row, moment)).length_squared())
            })
            .collect();
        let all_n = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert_chapter_prints(CHAPTER, &printed(name, &[errors[1], hold_n, delay_n, sensor_n, all_n]));
    }
}

/// The rod continues from its last shape, so that its errors rise for some ticks here and there: the mean over one tick of fifty
/// is known to its standard error.
#[test]
fn the_book_prints_errors_of_the_continued_rod_along_the_hand() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let rows = table("bench_hand.csv");
    let servo = answers(&["variant=rod"], &Hand::default().poses(30_000));
    let servo: Vec<Wrench> = rows.iter().map(|row| servo[tick(row)].expect("in the domain")).collect();
    let printed: Vec<f64> = printed_row("Errors against rod tight", "rod servo")
        .iter()
        .map(|number| number.parse().expect("a number"))
        .collect();
    let distances = |of: fn(&Wrench) -> DVec3, columns| -> Vec<(usize, f64)> {
        let exact = rows.iter().map(|row| vector(row, columns));
        servo
            .iter()
            .zip(exact)
            .zip(&rows)
            .map(|((found, exact), row)| (tick(row), (of(found) - exact).length()))
            .collect()
    };
    let force_n = distances(Wrench::force, ["fx_n", "fy_n", "fz_n"]);
    let torque_nm = distances(Wrench::torque, ["tx_nm", "ty_nm", "tz_nm"]);
    for (errors, accuracy, printed) in
        [(force_n, EXACT_N, &printed[..2]), (torque_nm, EXACT_NM, &printed[2..])]
    {
        let largest = errors.iter().fold(0.0_f64, |largest, (_, error)| largest.max(*error));
        // Half a unit of the second printed digit, and the accuracy of the table.
        assert!((printed[0] - largest).abs() < 0.007 * printed[0] + accuracy, "{printed:?}, not {largest:e}");
        let squares: Vec<f64> = errors
            .iter()
            .filter(|(tick, _)| tick.is_multiple_of(EVERY_OF_THE_HAND))
            .map(|(_, error)| error * error)
            .collect();
        let count = squares.len() as f64;
        let mean = squares.iter().sum::<f64>() / count;
        let variance =
            squares.iter().map(|square| (square - mean) * (square - mean)).sum::<f64>() / (count - 1.0);
        let deviation = (printed[1] * printed[1] - mean).abs();
        assert!(
            deviation < 3.0 * (variance / count).sqrt() + accuracy * accuracy,
            "{printed:?}, not {:e}",
            mean.sqrt()
        );
    }
}

/// Returns the columns of a case in the chapter's table below a heading.
fn printed_row(heading: &str, name: &str) -> Vec<String> {
    let chapter = std::fs::read_to_string(workspace_root().join("docs/src").join(CHAPTER));
    let chapter = chapter.expect("the chapter is there");
    let (_, text) = chapter.split_once(heading).expect("the table is there");
    let beginning = format!("  {name}  ");
    let row = text.lines().find(|line| line.starts_with(&beginning)).expect("a row of the case");
    row[beginning.len()..].split_whitespace().map(str::to_owned).collect()
}

/// Returns largest and mean error of the force, and largest error of the torque, in the chapter's table of the workspace.
fn printed_of_the_workspace(name: &str) -> String {
    printed_row("The whole workspace, a ball", name)[2..5].join(" ")
}

#[test]
fn the_book_prints_errors_through_the_whole_workspace() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let rows = table("bench_workspace.csv");
    assert!(rows.len() >= 1000, "{}", rows.len());
    let path = Workspace { radius_m: 20.0e-3, rotation_rad: 7.0_f64.to_radians() }.poses(2000);
    let poses: Vec<Pose> = rows.iter().map(|row| path[tick(row)]).collect();
    for (name, settings) in LAWS {
        let [force_n, rms_n, torque_nm, _] =
            distances(&rows, EVERY_OF_THE_WORKSPACE, &answers(settings, &poses));
        let found = printed("", &[force_n, rms_n, torque_nm]);
        assert_eq!(printed_of_the_workspace(name), found.trim(), "{name}");
    }
    // The rod needs the ticks between.
    let servo = answers(&["variant=rod"], &path);
    let servo: Vec<_> = rows.iter().map(|row| servo[tick(row)]).collect();
    let [force_n, rms_n, torque_nm, _] = distances(&rows, EVERY_OF_THE_WORKSPACE, &servo);
    assert_eq!(printed_of_the_workspace("rod servo"), printed("", &[force_n, rms_n, torque_nm]).trim());
}

/// Shares of the ticks that blend with the rod: the bound in `energy.md` evaluated along the path.
#[test]
fn the_book_prints_the_shares_of_calls_that_blend_with_the_rod() {
    for row in table("bench_shares.csv") {
        let [radius_mm, share_percent] = ["radius_mm", "share_percent"].map(|column| number(&row, column));
        assert_chapter_prints(CHAPTER, &format!("{} {radius_mm:.1} {share_percent:.1} ", row["preset"]));
    }
}

/// The reference of all errors is the rod at its tight setting: it is the exact one.
#[test]
fn the_reference_of_the_errors_is_the_exact_rod() {
    if TestSize::of_this_run().leaves_out_long_tests() {
        return;
    }
    let path = Hand::default().poses(30_000);
    let rows: Vec<Row> = table("bench_hand.csv").into_iter().step_by(10).collect();
    // Some ticks at each pose, until it has converged.
    let poses: Vec<Pose> = rows.iter().flat_map(|row| [path[tick(row)]; 5]).collect();
    let tight: Vec<_> =
        answers(&["variant=rod", "accuracy=tight"], &poses).into_iter().skip(4).step_by(5).collect();
    let [force_n, _, torque_nm, _] = distances(&rows, EVERY_OF_THE_HAND, &tight);
    assert!(
        tight.iter().all(Option::is_some) && force_n < EXACT_N && torque_nm < EXACT_NM,
        "{force_n} {torque_nm}"
    );
}

/// M2 and M5 at the poses where they are largest.
#[test]
fn the_largest_gains_of_the_stress_chapter_are_those_of_the_exact_rod() {
    let rows = table("stress_gains.csv");
    let gain = |row: &Row| (number(row, "gain_n_per_m"), number(row, "stiffness_n_per_m"));
    let of = |preset: &str| rows.iter().find(|row| row["preset"] == preset).expect("a row of the preset");
    // The slender spring is the rod: M5 is half of a period of 1 ms times its largest stiffness.
    let (slender, stiffest) = gain(of("slender"));
    assert_chapter_prints("stress.md", &format!("Lipschitz constant {slender:.4} N/m"));
    assert_chapter_prints("stress.md", &format!("sampled energy {:.4} N s/m", stiffest * 0.5e-3));
    // The default law is within 5 mN of the rod, by an error that grows at most with the eighth power of the way there: its
    // gain is within eight times that over the way.
    let (row, law) = (of("thesis-1"), printed_gain(1));
    let place_m = vector(row, ["x_m", "y_m", "z_m"]);
    let (exact, _) = gain(row);
    assert!((law - exact).abs() < 8.0 * 5.0e-3 / place_m.length(), "{law}, not {exact}");
    let place = place_m.to_array().map(|coordinate| format!("{:.4}", 1.0e3 * coordinate)).join(", ");
    assert_chapter_prints("stress.md", &format!("worst at ({place}) mm"));
}

/// The Lipschitz constant of a block of the chapter on stress, N/m.
fn printed_gain(block: usize) -> f64 {
    let text = std::fs::read_to_string(workspace_root().join("docs/src/stress.md")).expect("the chapter");
    let gain = |line: &str| line.split_whitespace().nth(4)?.parse().ok();
    let mut gains = text.lines().filter(|line| line.contains("M2  Lipschitz constant")).map(gain);
    gains.nth(block).flatten().expect("a number")
}
