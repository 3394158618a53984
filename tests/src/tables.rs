//! Tables computed elsewhere with higher precision, and what `flotor eval` answers to their poses.

use crate::program::{Flotor, Ran, exit_code};
use crate::workspace_root;
use std::collections::{BTreeMap, BTreeSet};

/// Header of a file of poses.
pub const POSE_HEADER: &str = "id,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad";
/// Header of a file of wrenches.
pub const WRENCH_HEADER: &str = "id,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,energy_j,status";
/// A millimetre in metres, a newton millimetre in newton metres.
pub const MM: f64 = 1.0e-3;

/// One row of a table, by column.
pub type Row = BTreeMap<String, String>;

/// A number of a row.
///
/// # Panics
/// If there is no such column, or something else in it.
#[must_use]
pub fn number(row: &Row, column: &str) -> f64 {
    let text = row.get(column).unwrap_or_else(|| panic!("no column {column}"));
    text.parse().unwrap_or_else(|_| panic!("{column} = {text}"))
}

/// The rows of CSV text with a header and no quotes.
///
/// # Panics
/// If a row has more or fewer fields than the header.
#[must_use]
pub fn rows_of(text: &str) -> Vec<Row> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        assert_eq!(fields.len(), header.len(), "{line}");
        header.iter().zip(fields).map(|(name, field)| ((*name).to_owned(), field.to_owned())).collect()
    };
    lines.map(row).collect()
}

/// A table of `tests/data/cases`.
///
/// # Panics
/// If it cannot be read.
#[must_use]
pub fn table(name: &str) -> Vec<Row> {
    let file = workspace_root().join("tests/data/cases").join(name);
    rows_of(&std::fs::read_to_string(file).expect("the table is there"))
}

/// Preset and free length, m, of a spring of the tables.
///
/// # Panics
/// If the tables do not know it.
#[must_use]
pub fn spring(number_in_table: &str) -> (&'static str, f64) {
    let preset = match number_in_table {
        "1" => "thesis-1",
        "2" => "thesis-2",
        "3" => "thesis-3",
        _ => "slender",
    };
    let constants = table("springs.csv").into_iter().find(|row| row["spring"] == number_in_table);
    (preset, number(&constants.expect("its constants are in the table"), "L0_mm") * MM)
}

/// Runs `flotor eval --model spring` from standard input to standard output.
#[must_use]
pub fn eval(poses: &str, arguments: &[&str]) -> Ran {
    let always = ["eval", "--model", "spring", "--poses", "-", "--out", "-"];
    Flotor::with(always.iter().chain(arguments)).reading(poses).run()
}

/// One line of an answer.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Its id.
    pub id: String,
    /// Force (N) and torque (N m).
    pub wrench: [f64; 6],
    /// Stored energy (J), if there is one.
    pub energy_j: Option<f64>,
    /// Its status.
    pub status: String,
    /// Further columns, by name.
    pub details: Row,
}

impl Answer {
    /// Distance of force, N, and torque, N m, from those of a table.
    #[must_use]
    pub fn distance(&self, force_n: [f64; 3], torque_nm: [f64; 3]) -> (f64, f64) {
        let [fx, fy, fz, tx, ty, tz] = self.wrench;
        (distance([fx, fy, fz], force_n), distance([tx, ty, tz], torque_nm))
    }
}

/// Distance of two points.
#[must_use]
pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// The rows of a file of wrenches.
///
/// # Panics
/// If it is none.
#[must_use]
pub fn answers(text: &str) -> Vec<Answer> {
    assert!(text.starts_with(WRENCH_HEADER), "{text}");
    let always: Vec<&str> = WRENCH_HEADER.split(',').collect();
    let answer = |row: Row| Answer {
        id: row["id"].clone(),
        wrench: ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"].map(|column| number(&row, column)),
        energy_j: (!row["energy_j"].is_empty()).then(|| number(&row, "energy_j")),
        status: row["status"].clone(),
        details: row.into_iter().filter(|(name, _)| !always.contains(&name.as_str())).collect(),
    };
    rows_of(text).into_iter().map(answer).collect()
}

/// Answers to poses `(id, position m, rotation vector rad)`, which the command must give.
///
/// # Panics
/// If it does not.
#[must_use]
pub fn evaluate(poses: &[(String, [f64; 6])], arguments: &[&str]) -> Vec<Answer> {
    let line = |(id, numbers): &(String, [f64; 6])| {
        let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
        format!("{id},{}\n", numbers.join(","))
    };
    let poses: String = std::iter::once(format!("{POSE_HEADER}\n")).chain(poses.iter().map(line)).collect();
    let ran = eval(&poses, arguments);
    assert_eq!((ran.code, ran.stderr.as_str()), (Some(exit_code::OK), ""), "{ran:#?}");
    answers(&ran.stdout)
}

/// Rows of a table with the command's answer to each, details and all.
///
/// # Panics
/// If there is not one for each, in order.
#[must_use]
pub fn compared(rows: Vec<Row>, pose: fn(&Row, f64) -> [f64; 6], sets: &[&str]) -> Vec<(Row, Answer)> {
    let springs: BTreeSet<String> = rows.iter().map(|row| row["spring"].clone()).collect();
    let one_spring = |name: String| {
        let (preset, free_length_m) = spring(&name);
        let rows: Vec<Row> = rows.iter().filter(|row| row["spring"] == name).cloned().collect();
        let poses: Vec<_> = rows.iter().map(|row| (row["id"].clone(), pose(row, free_length_m))).collect();
        let preset = format!("preset={preset}");
        let sets =
            sets.iter().copied().chain([preset.as_str()]).flat_map(|set| ["--set", set]).chain(["--details"]);
        let answers = evaluate(&poses, &sets.collect::<Vec<_>>());
        assert_eq!(answers.len(), rows.len());
        rows.into_iter().zip(answers)
    };
    springs
        .into_iter()
        .flat_map(one_spring)
        .inspect(|(row, answer)| assert_eq!(row["id"], answer.id))
        .collect()
}

/// Pose of a row of the thesis's law: device millimetres on a 15 mm range, left-handed angles.
#[must_use]
pub fn thesis_pose(row: &Row, free_length_m: f64) -> [f64; 6] {
    let scale = free_length_m / 15.0;
    let input = |axis: usize| number(row, &format!("fwpos{axis}_{}", if axis < 3 { "mm" } else { "rad" }));
    [scale * input(0), scale * input(1), scale * input(2), -input(3), -input(4), input(5)]
}

/// Pose of a row of the rod tables: position of the upper plate over the lower one. What a planar table has no column
/// for is zero.
#[must_use]
pub fn rod_pose(row: &Row, free_length_m: f64) -> [f64; 6] {
    let number = |column: &str| if row.contains_key(column) { number(row, column) } else { 0.0 };
    let tilt = if row.contains_key("tilt_rad") { "tilt_rad" } else { "vy_rad" };
    let (x_m, y_m, z_m) = (number("rx_mm") * MM, number("ry_mm") * MM, number("rz_mm") * MM - free_length_m);
    [x_m, y_m, z_m, number("vx_rad"), number(tilt), number("vz_rad")]
}

/// Force (N) and torque (N m) of a row of the rod tables.
#[must_use]
pub fn rod_wrench(row: &Row) -> ([f64; 3], [f64; 3]) {
    let number = |column: &str| if row.contains_key(column) { number(row, column) } else { 0.0 };
    (["FX_N", "FY_N", "FZ_N"].map(number), ["MX_Nmm", "MY_Nmm", "MZ_Nmm"].map(|column| number(column) * MM))
}
