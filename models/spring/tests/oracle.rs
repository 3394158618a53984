//! The spring against reference tables computed elsewhere: parameters, the thesis's closed form in 50-digit
//! arithmetic, and the exact spatial rod. The tables are in `tests/data/cases`.

use crate::preset::preset;
use crate::table::{Row, rows};
use flotor_hal::glam::{DQuat, DVec3};
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::energy::EnergyForm;
use flotor_spring::pose::Pose;
use flotor_spring::precision::Precision;
use flotor_spring::response::Demand;
use flotor_spring::rigidity::{Spring, Stiffness};
use flotor_spring::validity::Validity;

/// Pose of a row of the thesis table: the device's millimetres and left-handed angles.
fn thesis_pose(row: &Row, spring: &Spring) -> Pose {
    // The device's 15 mm of travel stand for the whole free length.
    let metres = spring.geometry().free_length_m / 15.0;
    let position_m = row.vector(["fwpos0_mm", "fwpos1_mm", "fwpos2_mm"]) * metres;
    let angles = row.vector(["fwpos3_rad", "fwpos4_rad", "fwpos5_rad"]);
    Pose::from_rotation_vector(position_m, DVec3::new(-angles.x, -angles.y, angles.z))
}

#[test]
fn presets_have_the_tabulated_rigidities() {
    let table = rows("springs.csv");
    assert_eq!(table.len(), 4);
    for row in &table {
        let spring = preset(row).spring();
        // A dozen roundings, and millimetres converted once.
        let same = |found: f64, column: &str| {
            let expected = row.number(column);
            assert!((found - expected).abs() < 4e-15 * expected, "{column}: {found} {expected}");
        };
        let check = |spring: &Spring, suffix: &str| {
            let rigidities = spring.rigidities();
            let column = |name: &str, unit: &str| format!("{name}{suffix}_{unit}");
            same(rigidities.alpha_n_m2 * 1e6, &column("alpha", "Nmm2"));
            same(rigidities.beta_n, &column("beta", "N"));
            same(rigidities.gamma_n, &column("gamma", "N"));
            same(rigidities.tau_n_m2 * 1e6, &column("tau", "Nmm2"));
        };
        check(&spring, "");
        check(&Spring::new(*spring.geometry(), *spring.material(), Stiffness::Physical).unwrap(), "_phys");
        same(spring.geometry().free_length_m * 1e3, "L0_mm");
        same(spring.geometry().solid_length_m() * 1e3, "solid_length_mm");
    }
}

/// Largest errors of the regularised law over the thesis table: force (N) and tilting torque (N·m).
fn thesis_table_errors(precision: Precision) -> (f64, f64) {
    let table = rows("a_thesis_closed_form.csv");
    assert!(table.len() > 100, "the table is there");
    let (mut worst_force_n, mut worst_torque_nm) = (0.0f64, 0.0f64);
    for row in &table {
        let spring = preset(row).spring();
        let law = ClosedForm::new(&spring, Form::Printed).with_precision(precision);
        let answer = law.respond(&thesis_pose(row, &spring), Demand::Wrench);
        assert_eq!(answer.validity, Validity::Ok, "{}", row.text("id"));
        let force_n = row.vector(["forceX_N", "forceZ_N", "forceY_N"]);
        worst_force_n = worst_force_n.max((answer.force_n - force_n).length());
        let torque_nm = -1e-3 * DVec3::new(row.number("force3_Nmm"), row.number("force4_Nmm"), 0.0);
        worst_torque_nm = worst_torque_nm.max((answer.torque_nm - torque_nm).truncate().length());
        let yaw_nm =
            -spring.rigidities().tau_n_m2 / spring.geometry().free_length_m * row.number("fwpos5_rad");
        let rounding = if precision == Precision::Double { 1e-15 } else { 1e-7 };
        assert!((answer.torque_nm.z - yaw_nm).abs() <= rounding * yaw_nm.abs(), "{}", row.text("id"));
    }
    (worst_force_n, worst_torque_nm)
}

#[test]
fn printed_law_agrees_with_fifty_digits() {
    let (worst_force_n, worst_torque_nm) = thesis_table_errors(Precision::Double);
    // Required: 1e-13 N on forces of tens of newtons, 1e-16 N·m.
    assert!(worst_force_n < 1e-13, "{worst_force_n:e} N");
    assert!(worst_torque_nm < 1e-16, "{worst_torque_nm:e} N·m");
}

#[test]
fn printed_law_in_single_precision_is_regular_too() {
    let (worst_force_n, worst_torque_nm) = thesis_table_errors(Precision::Single);
    // Required: 1e-5 N. The torque: as much at an arm of the coil's diameter.
    assert!(worst_force_n < 1e-5, "{worst_force_n:e} N");
    assert!(worst_torque_nm < 1e-7, "{worst_torque_nm:e} N·m");
}

/// Pose of a row of the rod table: upper plate relative to the lower one, quaternion.
fn rod_pose(row: &Row, spring: &Spring) -> Pose {
    let free_length_mm = spring.geometry().free_length_m * 1e3;
    let position_mm = row.vector(["rx_mm", "ry_mm", "rz_mm"]) - DVec3::new(0.0, 0.0, free_length_mm);
    let [w, x, y, z] = ["qw", "qx", "qy", "qz"].map(|column| row.number(column));
    Pose { position_m: position_mm * 1e-3, orientation: DQuat::from_xyzw(x, y, z, w) }
}

/// Deviation of the energy form from the rod over the rows kept.
#[derive(Debug, Default)]
struct Deviation {
    rows: u32,
    force_n: f64,
    /// Root mean square force of the rod itself.
    rod_force_n: f64,
    /// Relative to the root mean square torque of the rod.
    torque: f64,
    energy_j: f64,
}

fn deviation(keep: impl Fn(&Row) -> bool) -> Deviation {
    let (mut sum, mut torque_scale) = (Deviation::default(), 0.0);
    for row in rows("b_exact_rod_prebuckling.csv").iter().filter(|row| keep(row)) {
        let spring = preset(row).spring();
        let answer = EnergyForm::new(&spring).respond(&rod_pose(row, &spring), Demand::WrenchAndEnergy);
        let torque_nm = row.vector(["MX_Nmm", "MY_Nmm", "MZ_Nmm"]) * 1e-3;
        sum.rows += 1;
        let force_n = row.vector(["FX_N", "FY_N", "FZ_N"]);
        sum.force_n += (answer.force_n - force_n).length_squared();
        sum.rod_force_n += force_n.length_squared();
        sum.torque += (answer.torque_nm - torque_nm).length_squared();
        sum.energy_j += (answer.energy_j.expect("demanded") - row.number("W_Nmm") * 1e-3).powi(2);
        torque_scale += torque_nm.length_squared();
    }
    let mean = |square: f64| (square / f64::from(sum.rows)).sqrt();
    Deviation {
        rows: sum.rows,
        force_n: mean(sum.force_n),
        rod_force_n: mean(sum.rod_force_n),
        torque: (sum.torque / torque_scale).sqrt(),
        energy_j: mean(sum.energy_j),
    }
}

#[test]
fn energy_form_agrees_with_the_exact_rod_in_the_workspace() {
    // Required of this law: root mean square force (N) and torque (relative). The energy follows from a force
    // wrong by that much over a tenth of the free length.
    for (number, rows, force_n, torque) in
        [("1", 12, 0.0012, 0.003), ("2", 17, 0.006, 0.01), ("3", 16, 0.002, 0.01)]
    {
        let moderate = |row: &Row| !["combined", "large_rotation"].contains(&row.text("category"));
        let found = deviation(|row| row.text("spring") == number && moderate(row));
        assert_eq!(found.rows, rows);
        assert!(found.force_n < force_n, "spring {number}: {} N", found.force_n);
        assert!(found.torque < torque, "spring {number}: {} of the torque", found.torque);
        assert!(found.energy_j < force_n * 0.003, "spring {number}: {} J", found.energy_j);
    }
}

#[test]
fn energy_form_stays_close_for_combined_poses() {
    // A tenth of the just noticeable difference of stiffness (14 %) is out of anybody's reach: 1.4 % of force and
    // torque for poses of up to 60 % compression, 7 degrees of tilt and of yaw.
    let combined = deviation(|row| row.text("category") == "combined");
    assert!(combined.rows > 20);
    assert!(combined.force_n < 0.014 * combined.rod_force_n && combined.torque < 0.014, "{combined:?}");
    // Half a radian is no small angle: all of the just noticeable difference, halved.
    let turned = deviation(|row| row.text("category") == "large_rotation");
    assert!(turned.rows > 3);
    assert!(turned.force_n < 0.07 * turned.rod_force_n && turned.torque < 0.07, "{turned:?}");
}

#[test]
fn energy_form_is_the_rod_in_the_limit_of_small_angles() {
    // Rows with angles of up to 0.006 rad: the fifth power times gamma is 1e-10 N (the third would be 2e-6).
    for id in ["b0022", "b0152", "b0176", "b0286"] {
        let found = deviation(|row| row.text("id") == id);
        assert_eq!(found.rows, 1);
        assert!(found.force_n < 1e-10, "{id}: {} N", found.force_n);
    }
}

#[test]
fn current_length_form_is_the_rod_in_the_plane() {
    // Exact linearisation: a transverse force wrong by the third power of the angle only.
    for (id, angle_rad) in [("b0022", 4e-3f64), ("b0152", 4e-3), ("b0176", 6e-3), ("b0286", 1e-3)] {
        let table = rows("b_exact_rod_prebuckling.csv");
        let row = table.iter().find(|row| row.text("id") == id).unwrap();
        let spring = preset(row).spring();
        let law = ClosedForm::new(&spring, Form::CurrentLength);
        let answer = law.respond(&rod_pose(row, &spring), Demand::Wrench);
        let cube = angle_rad.powi(3) * spring.rigidities().gamma_n;
        assert!((answer.force_n.x - row.number("FX_N")).abs() < cube, "{id}");
        let torque_nm = row.number("MY_Nmm") * 1e-3;
        assert!((answer.torque_nm.y - torque_nm).abs() < cube * spring.geometry().free_length_m, "{id}");
    }
}
