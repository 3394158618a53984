//! `flotor eval` against tables computed elsewhere with higher precision, and its contract as a command: what it
//! answers to poses nobody can be in, and what it says to wrong files and wrong parameters.
//!
//! The tables in `data/cases` hold a quarter of the rows their authors computed; nothing is tuned on them.

use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use flotor_tests::tables::{
    MM, POSE_HEADER, answers, compared, distance, eval, evaluate, number, rod_pose, table, thesis_pose,
};

// ---------------------------------------------------------------- accuracy

/// Table a is the printed law in 50 digits; the command must be it to rounding, in every branch of the printed code.
#[test]
fn closed_form_is_the_printed_law_to_rounding() {
    let compared = compared(table("a_thesis_closed_form.csv"), thesis_pose, &["variant=closed-form"]);
    assert!(compared.len() > 100, "{} rows", compared.len());
    for (row, answer) in compared {
        let number = |column| number(&row, column);
        let [fx, fy, fz, tx, ty, _] = answer.wrench;
        let force_n = [number("forceX_N"), number("forceZ_N"), number("forceY_N")];
        let torque_nm = [-number("force3_Nmm") * MM, -number("force4_Nmm") * MM, 0.0];
        let off_n = distance([fx, fy, fz], force_n);
        let off_nm = distance([tx, ty, 0.0], torque_nm); // the table has no torque about the axis
        // The bounds of the requirement.
        assert!(off_n <= 1.0e-12, "{}: {off_n} N", row["id"]);
        assert!(off_nm <= 1.0e-15, "{}: {off_nm} N m", row["id"]);
    }
}

/// Table b is the exact rod; the energy law must be near it, spring by spring, in the root mean square.
#[test]
fn energy_is_near_the_exact_rod() {
    const CATEGORIES: [&str; 5] = ["axial", "shear", "tilt", "shear_tilt", "yaw"];
    let mut rows = table("b_exact_rod_prebuckling.csv");
    rows.retain(|row| CATEGORIES.contains(&row["category"].as_str()));
    let compared = compared(rows, rod_pose, &["variant=energy"]);
    // The bounds of the requirement, N.
    for (spring, bound_n) in [("1", 2.0e-3), ("2", 8.0e-3), ("3", 15.0e-3)] {
        let squares = compared.iter().filter(|(row, _)| row["spring"] == spring).map(|(row, answer)| {
            let force_n = ["FX_N", "FY_N", "FZ_N"].map(|column| number(row, column));
            answer.distance(force_n, [0.0; 3]).0.powi(2)
        });
        let squares: Vec<f64> = squares.collect();
        assert!(squares.len() > 10, "spring {spring}: {} rows", squares.len());
        let rms_n = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(rms_n <= bound_n, "spring {spring}: {rms_n} N");
    }
}

/// The energy that is reported is that of the table where the law is good: its gradient cannot be near and it not.
#[test]
fn the_energy_column_is_the_stored_energy() {
    let mut rows = table("b_exact_rod_prebuckling.csv");
    rows.retain(|row| row["category"] == "axial");
    for (row, answer) in compared(rows, rod_pose, &["variant=energy"]) {
        let (stored_j, reported_j) = (number(&row, "W_Nmm") * MM, answer.energy_j.expect("it has one"));
        // Axially the law is exact; the lengths, some 0.04 m, are rounded to 1e-17 m at forces of some 10 N.
        assert!((stored_j - reported_j).abs() < 1.0e-15, "{}: {reported_j} J", row["id"]);
    }
}

// ---------------------------------------------------------------- poses nobody can be in

const VARIANTS: [&str; 4] = ["energy", "closed-form", "current-length", "rod"];

fn pose(id: &str, numbers: [f64; 6]) -> (String, [f64; 6]) {
    (id.to_owned(), numbers)
}

#[test]
fn every_pose_has_finite_columns_and_a_status() {
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    let mut poses = vec![
        pose("home", [0.0; 6]),
        // Length of the chord equal to the free length, sheared: 0.015^2 + 0.02^2 = 0.025^2.
        pose("at free length", [0.015, 0.0, -0.005, 0.0, 0.0, 0.0]),
        pose("past solid", [0.0, 0.0, -0.02, 0.0, 0.0, 0.0]),
        pose("flat", [0.0, 0.0, -0.025, 0.0, 0.0, 0.0]),
        pose("below the base", [0.0, 0.0, -0.03, 0.0, 0.0, 0.0]),
        pose("upside down", [0.0, 0.0, -0.001, std::f64::consts::PI, 0.0, 0.0]),
        pose("a million kilometres off", [1.0e9; 6]),
        pose("beyond all numbers", [1.0e300, -1.0e300, 1.0e300, 0.0, 0.0, 0.0]),
        pose("hardly anywhere", [1.0e-300; 6]),
    ];
    for axis in 0..6 {
        for (name, bad) in [("nan", nan), ("inf", inf), ("-inf", -inf)] {
            let mut numbers = [0.0; 6];
            numbers[axis] = bad;
            poses.push(pose(&format!("{name} in {axis}"), numbers));
        }
    }
    for variant in VARIANTS {
        let answers = evaluate(&poses, &["--set", &format!("variant={variant}")]);
        assert_eq!(answers.len(), poses.len());
        for ((id, numbers), answer) in poses.iter().zip(&answers) {
            assert_eq!(id, &answer.id);
            assert!(answer.wrench.iter().all(|column| column.is_finite()), "{variant}: {answer:?}");
            assert!(answer.energy_j.is_none_or(f64::is_finite), "{variant}: {answer:?}");
            let legal = ["ok", "clamped", "out_of_domain", "not_converged", "invalid_input"];
            assert!(legal.contains(&answer.status.as_str()), "{variant}: {answer:?}");
            let invalid = numbers.iter().any(|number| !number.is_finite());
            assert_eq!(answer.status == "invalid_input", invalid, "{variant}: {answer:?}");
            if invalid {
                assert_eq!(answer.wrench, [0.0; 6], "{variant}: {answer:?}");
            }
        }
        let home = &answers[0];
        assert_eq!((home.wrench, home.status.as_str()), ([0.0; 6], "ok"), "{variant}");
        assert_eq!(answers[1].status, "ok", "{variant}: nothing is special about the free length");
    }
}

// ---------------------------------------------------------------- files

#[test]
fn ids_go_through_and_are_counted_where_there_are_none() {
    let row = "0,0,-0.005,0,0,0\n";
    let with = format!("{POSE_HEADER}\nfirst,{row}\"a, b\",{row}");
    let ran = eval(&with, &[]);
    let ids: Vec<&str> = ran.stdout.lines().skip(1).filter_map(|line| line.split(",0").next()).collect();
    assert_eq!(ids, ["first", "\"a, b\""], "{ran:#?}");
    let without = format!("{}\n{row}{row}", POSE_HEADER.trim_start_matches("id,"));
    let ran = eval(&without, &[]);
    let ids: Vec<String> = answers(&ran.stdout).into_iter().map(|answer| answer.id).collect();
    assert_eq!(ids, ["0", "1"]);
}

#[test]
fn columns_may_stand_in_any_order() {
    let usual = format!("{POSE_HEADER}\na,0.001,0,-0.005,0,0.01,0\n");
    let other = "ry_rad,z_m,id,x_m,y_m,rz_rad,rx_rad\n0.01,-0.005,a,0.001,0,0,0\n";
    assert_eq!(eval(&usual, &[]), eval(other, &[]));
}

#[test]
fn files_and_pipes_carry_the_same() {
    let poses = format!("{POSE_HEADER}\na,0.001,0,-0.005,0,0.01,0\n");
    let scratch = Scratch::default();
    let (input, output) = (scratch.file("poses.csv", &poses), scratch.path().join("wrenches.csv"));
    let arguments = ["eval".as_ref(), "--model".as_ref(), "spring".as_ref()];
    let files = ["--poses".as_ref(), input.as_os_str(), "--out".as_ref(), output.as_os_str()];
    let ran = Flotor::with(arguments.into_iter().chain(files)).run();
    assert_eq!(ran, Ran { code: Some(exit_code::OK), stdout: String::new(), stderr: String::new() });
    assert_eq!(std::fs::read_to_string(output).expect("it was written"), eval(&poses, &[]).stdout);
}

/// A spring has no history: the way to a pose does not matter.
#[test]
fn successive_poses_of_one_handle_are_the_same_poses() {
    let poses =
        format!("{POSE_HEADER}\na,0.001,0,-0.005,0,0.01,0\nb,0,0.002,-0.003,0,0,0.1\nc,0,0,0,0,0,0\n");
    assert_eq!(eval(&poses, &[]), eval(&poses, &["--path"]));
}

#[test]
fn a_wrong_file_is_told_with_file_and_line() {
    let good = "a,0,0,0,0,0,0";
    let expected = "[id,]x_m,y_m,z_m,rx_rad,ry_rad,rz_rad";
    let wrong = [
        (
            "id,x_m,y_m,z_m,rx_rad,ry_rad,rz_deg\n".to_owned() + good,
            format!("1: unknown column `rz_deg`; did you mean `rz_rad`? (the header must be {expected})"),
        ),
        (
            "x_m,y_m,z_m,rx_rad,ry_rad\n0,0,0,0,0\n".to_owned(),
            format!("1: column `rz_rad` is missing (the header must be {expected})"),
        ),
        (
            String::new(),
            format!(" the table is empty; write the header {expected} and one row for each pose"),
        ),
        (
            format!("{POSE_HEADER}\n{good}\nb,0,0,zero,0,0,0\n"),
            "3: `z_m` must be a number, not `zero`".to_owned(),
        ),
        (format!("{POSE_HEADER}\n{good}\n\nb,0,0,,0,0,0\n"), "4: `z_m` must be a number, not ``".to_owned()),
    ];
    for (poses, cause) in wrong {
        let scratch = Scratch::default();
        let file = scratch.file("poses.csv", &poses);
        let always = ["eval".as_ref(), "--model".as_ref(), "spring".as_ref(), "--out".as_ref(), "-".as_ref()];
        let ran = Flotor::with(always.into_iter().chain(["--poses".as_ref(), file.as_os_str()])).run();
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert_eq!(ran.error(), format!("{}:{cause}", file.display()));
        assert_eq!(ran.stdout, "", "nothing is written before all is read");
    }
    let ran = eval(&format!("{POSE_HEADER}\n{good},0\n"), &[]);
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().starts_with("standard input:2: "), "a row that is too long: {ran:#?}");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let ran = Flotor::with(["eval", "--model", "spring", "--poses", "no/such.csv", "--out", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().starts_with("no/such.csv: cannot read the poses: "), "{ran:#?}");
}

// ---------------------------------------------------------------- parameters

#[test]
fn wrong_parameters_are_told_with_what_would_be_right() {
    let wrong = [
        (&["variant=energie"][..], "--set variant: `variant` = `energie`: must be thesis | closed-form | "),
        (&["gama_n=17"], "--set gama_n: no parameter `gama_n`; did you mean `gamma_n`?"),
        (&["spring.gamma_n=3"], "no parameter `spring.gamma_n`; did you mean `gamma_n`?"),
        (&["port=1"], "--set port: no parameter `port`; `flotor plugins ID` lists the parameters"),
        (&["gamma_n=many"], "--set gamma_n: `gamma_n` must be a number in N, not `many`"),
        (&["free_length_mm=0"], "--set free_length_mm: `free_length_mm` = 0: must be 1 to 1000 mm"),
        (&["gamma_n=nan"], "--set gamma_n: `gamma_n` = NaN: must be 0.01 to 10000 N"),
        (
            &["alpha_n_mm2=180"],
            "`alpha_n_mm2` has no effect in mode `gamma`, which computes it from other parameters; set `mode` to `alpha`",
        ),
        (
            &["seat_friction=0.2"],
            "`seat_friction` has no effect on a fixed seat; set `seat` to `free` as well",
        ),
        (
            &["mode=physical", "gamma_n=17"],
            "`gamma_n` has no effect in mode `physical`, which computes it from other parameters; set `mode` to `gamma`",
        ),
    ];
    for (sets, cause) in wrong {
        let arguments: Vec<&str> = sets.iter().flat_map(|set| ["--set", *set]).collect();
        let ran = eval(&format!("{POSE_HEADER}\na,0,0,0,0,0,0\n"), &arguments);
        assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
        assert!(ran.error().contains(cause), "{ran:#?}");
        assert_eq!(ran.stdout, "");
    }
}

/// Each mode takes its own constant; `gamma = 2 x` is twice the axial force.
#[test]
fn each_mode_takes_its_own_constant() {
    let axial_n = |sets: &[&str]| {
        let arguments: Vec<&str> = sets.iter().flat_map(|set| ["--set", *set]).collect();
        evaluate(&[pose("a", [0.0, 0.0, -0.005, 0.0, 0.0, 0.0])], &arguments)[0].wrench[2]
    };
    // F = gamma (L0 - L) / L0; a handful of roundings.
    let near = |force_n: f64, expected_n: f64| (force_n / expected_n - 1.0).abs() < 1.0e-14;
    assert!(near(axial_n(&[]), 16.97 * 0.2));
    assert!(near(axial_n(&["gamma_n=33.94"]), 2.0 * 16.97 * 0.2));
    assert!(near(axial_n(&["mode=alpha", "alpha_n_mm2=358.1578785296652"]), 2.0 * 16.97 * 0.2));
    assert!(near(axial_n(&["mode=beta", "beta_n=91.02115318688852"]), 2.0 * 16.97 * 0.2));
    // The wire's own rigidity, from the constants of springs.csv.
    assert!(near(axial_n(&["mode=physical"]), 14.147_311_499_554_837 * 0.2));
}

#[test]
fn a_model_nobody_has_is_a_mistake() {
    let ran = Flotor::with(["eval", "--model", "sprang", "--poses", "-", "--out", "-"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().starts_with("no model plugin `sprang`; did you mean `spring`?"), "{ran:#?}");
}

#[test]
fn poses_are_not_overwritten() {
    let scratch = Scratch::default();
    let file = scratch.file("poses.csv", format!("{POSE_HEADER}\na,0,0,0,0,0,0\n"));
    let file = file.display().to_string();
    let same = ["eval", "--model", "spring", "--poses", &file, "--out", &file];
    let ran = Flotor::with(same).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(ran.error().contains("this is the file of the poses; choose another file"), "{ran:#?}");
}

#[test]
fn bench_lists_the_details_of_the_model() {
    let ran = Flotor::with(["bench", "--case", "variant=energy", "--apart", "nosuch"]).run();
    assert_eq!(ran.code, Some(exit_code::CONFIGURATION), "{ran:#?}");
    assert!(
        ran.error().starts_with("--apart nosuch: the model has no such detail; its details are ["),
        "{ran:#?}"
    );
    assert!(ran.error().contains("rod_share"), "{ran:#?}");
}
