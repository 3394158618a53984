//! Reference tables, computed with higher precision, and the output of `flotor eval` for their poses.

use crate::program::{Flotor, Ran, exit_code};
use crate::workspace_root;
use std::collections::{BTreeMap, BTreeSet};

/// Header of the table of poses for `flotor eval`.
pub const POSE_HEADER: &str = "id,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad";
/// First columns of the header of the table of wrenches from `flotor eval`.
pub const WRENCH_HEADER: &str = "id,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,energy_j,status";
/// Millimetre in metres, and newton millimetre in newton metres.
pub const MM: f64 = 1.0e-3;

/// Row of a table: cells by column name.
pub type Row = BTreeMap<String, String>;

/// Returns the number in a cell.
///
/// # Panics
/// If there is no such column, or the cell is not a number.
#[must_use]
pub fn number(row: &Row, column: &str) -> f64 {
    let text = row.get(column).unwrap_or_else(|| panic!("no column {column}"));
    text.parse().unwrap_or_else(|_| panic!("{column} = {text}"))
}

/// Parses CSV text with a header and no quotes, and returns its rows.
///
/// # Panics
/// If there is no header, or a row has more or fewer fields than the header.
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

/// Reads a table in `tests/data/cases`.
///
/// # Panics
/// If the file cannot be read, or as [`rows_of`].
#[must_use]
pub fn table(name: &str) -> Vec<Row> {
    let file = workspace_root().join("tests/data/cases").join(name);
    rows_of(&std::fs::read_to_string(file).expect("the table is there"))
}

/// Returns preset and free length, m, of a spring of the tables.
///
/// # Panics
/// If the table `springs.csv` has no such spring.
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

/// Runs `flotor eval --model spring` with `poses` on standard input and these further arguments; the result is on standard output.
#[must_use]
pub fn eval(poses: &str, arguments: &[&str]) -> Ran {
    let always = ["eval", "--model", "spring", "--poses", "-", "--out", "-"];
    Flotor::with(always.iter().chain(arguments)).reading(poses).run()
}

/// Row of the output of `flotor eval`.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Id of the pose.
    pub id: String,
    /// Force (N) and torque (N m).
    pub wrench: [f64; 6],
    /// Stored energy (J); `None` for an empty cell.
    pub energy_j: Option<f64>,
    /// Status of the step.
    pub status: String,
    /// Columns beyond [`WRENCH_HEADER`], by name.
    pub details: Row,
}

impl Answer {
    /// Returns the length of the difference from a reference force, N, and from a reference torque, N m.
    #[must_use]
    pub fn distance(&self, force_n: [f64; 3], torque_nm: [f64; 3]) -> (f64, f64) {
        let [fx, fy, fz, tx, ty, tz] = self.wrench;
        (distance([fx, fy, fz], force_n), distance([tx, ty, tz], torque_nm))
    }
}

/// Returns the distance between two points.
#[must_use]
pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// Parses a table of wrenches.
///
/// # Panics
/// If the header does not begin with [`WRENCH_HEADER`], or a row is malformed.
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

/// Runs [`eval`] on poses `(id, position m and rotation vector rad)`, and returns the rows of its output.
///
/// # Panics
/// If the command fails or writes to standard error.
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

/// Runs [`eval`] with `--details` on the poses of all rows, for each spring with its preset and the parameters `sets`; returns each
/// row with its output.
///
/// # Panics
/// If the command fails, or its rows differ from the poses in number or order.
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

/// Returns the pose in a row of the thesis's law: position m and rotation vector rad. The table has device coordinates: 15 mm for
/// the free length, and left-handed angles.
#[must_use]
pub fn thesis_pose(row: &Row, free_length_m: f64) -> [f64; 6] {
    let scale = free_length_m / 15.0;
    let input = |axis: usize| number(row, &format!("fwpos{axis}_{}", if axis < 3 { "mm" } else { "rad" }));
    [scale * input(0), scale * input(1), scale * input(2), -input(3), -input(4), input(5)]
}

/// Returns the pose in a row of the rod tables: position m and rotation vector rad. The table has the position of the upper plate
/// from the lower plate. Columns missing in a planar table count as zero.
#[must_use]
pub fn rod_pose(row: &Row, free_length_m: f64) -> [f64; 6] {
    let number = |column: &str| if row.contains_key(column) { number(row, column) } else { 0.0 };
    let tilt = if row.contains_key("tilt_rad") { "tilt_rad" } else { "vy_rad" };
    let (x_m, y_m, z_m) = (number("rx_mm") * MM, number("ry_mm") * MM, number("rz_mm") * MM - free_length_m);
    [x_m, y_m, z_m, number("vx_rad"), number(tilt), number("vz_rad")]
}

/// Returns force (N) and torque (N m) in a row of the rod tables. Columns missing in a planar table count as zero.
#[must_use]
pub fn rod_wrench(row: &Row) -> ([f64; 3], [f64; 3]) {
    let number = |column: &str| if row.contains_key(column) { number(row, column) } else { 0.0 };
    (["FX_N", "FY_N", "FZ_N"].map(number), ["MX_Nmm", "MY_Nmm", "MZ_Nmm"].map(|column| number(column) * MM))
}
