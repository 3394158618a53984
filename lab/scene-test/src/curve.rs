//! Force-position curve: CSV with poses and the expected wrench at each.

use flotor_hal::{HashLines, Table, TextProblem, read_text};
use flotor_plot::{Axis, Figure, Panel, Quantity, Series};
use std::path::Path;

/// Columns of a pose, as in the input of `flotor eval`.
pub(crate) const POSE: [&str; 6] = ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];
/// Columns of a wrench, as in the output of `flotor eval`: force N, then torque N·m.
pub(crate) const WRENCH: [&str; 6] = ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"];

/// Poses and wrenches, in the model frame.
#[derive(Debug)]
pub(crate) struct Points {
    /// Indices in [`WRENCH`] of the columns in the file.
    pub(crate) compared: Vec<usize>,
    rows: Vec<([f64; 6], [f64; 6])>,
}

impl Points {
    /// Reads a file. A missing column of the pose is 0, a missing column of the wrench is not compared.
    ///
    /// # Errors
    /// A message with the line.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let read = read_text(path, "the curve").and_then(|text| Self::parse(&text));
        read.map_err(|wrong| wrong.in_file(path.display()))
    }

    fn parse(text: &str) -> Result<Self, TextProblem> {
        let table = Table::parse(text, HashLines::Comments)?;
        let columns = table.columns();
        let is_known = |name: &String| POSE.contains(&name.as_str()) || WRENCH.contains(&name.as_str());
        if let Some(unknown) = columns.iter().find(|name| !is_known(name)) {
            let problem = format!(
                "unknown column `{unknown}`; the columns are {}, {}",
                POSE.join(", "),
                WRENCH.join(", ")
            );
            return Err(table.header_problem(problem));
        }
        let of_pose = POSE.map(|name| table.column(name));
        let of_wrench = WRENCH.map(|name| table.column(name));
        let compared: Vec<usize> = (0..6).filter(|index| of_wrench[*index].is_some()).collect();
        if compared.is_empty() {
            return Err(
                table.header_problem("the table has no column to compare; add at least one, such as fz_n")
            );
        }
        let mut rows = Vec::new();
        for row in table.rows() {
            let row = row?;
            let number = |column: Option<usize>| column.map_or(Ok(0.0), |column| row.number(column));
            let (mut pose, mut wrench) = ([0.0; 6], [0.0; 6]);
            for (numbers, columns) in [(&mut pose, of_pose), (&mut wrench, of_wrench)] {
                for (value, column) in numbers.iter_mut().zip(columns) {
                    *value = number(column)?;
                }
            }
            rows.push((pose, wrench));
        }
        if rows.is_empty() {
            return Err(table.header_problem("the table has no row; write at least one"));
        }
        Ok(Self { compared, rows })
    }

    /// Formats the poses for `flotor eval`.
    pub(crate) fn poses(&self) -> String {
        let row = |(pose, _): &([f64; 6], [f64; 6])| pose.map(|number| format!("{number:e}")).join(",");
        let rows: Vec<String> = std::iter::once(POSE.join(",")).chain(self.rows.iter().map(row)).collect();
        rows.join("\n") + "\n"
    }

    /// Parses the wrench at each pose, in the compared columns, and its status. `answers`: output of `flotor eval`.
    ///
    /// # Errors
    /// A message if the answers do not match these poses.
    fn answers(&self, answers: &str) -> Result<Vec<Answer>, String> {
        let mut lines = answers.lines();
        let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let place = |name: &str| head.iter().position(|known| *known == name);
        let rows = answers.lines().count().saturating_sub(1);
        let answer = |_: &([f64; 6], [f64; 6])| {
            let too_few = || format!("results for {rows} of {} poses from `flotor eval`", self.rows.len());
            let cells: Vec<&str> = lines.next().ok_or_else(too_few)?.split(',').collect();
            let cell = |name: &str| place(name).and_then(|place| cells.get(place).copied());
            let number = |name: &str| cell(name).and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN);
            Ok(Answer { wrench: WRENCH.map(number), status: cell("status").unwrap_or_default().to_owned() })
        };
        self.rows.iter().map(answer).collect()
    }

    /// Returns the value with the largest error relative to its tolerance among the values beyond it or with the status
    /// `invalid_input` or `not_converged`; `None` if there is no such value. `answers`: output of `flotor eval`.
    ///
    /// # Errors
    /// A message if the answers do not match these poses.
    pub(crate) fn worst(
        &self,
        answers: &str,
        tolerance: impl Fn(usize) -> f64,
    ) -> Result<Option<Worst>, String> {
        let mut worst: Option<(f64, Worst)> = None;
        for ((pose, expected), Answer { wrench, status }) in self.rows.iter().zip(self.answers(answers)?) {
            for index in self.compared.iter().copied() {
                let got = wrench[index];
                let error = (got - expected[index]).abs();
                let is_inside =
                    error <= tolerance(index) && status != "invalid_input" && status != "not_converged";
                // NaN if both are 0, or if the value is not a number: as bad as any error.
                let excess = if is_inside { continue } else { error / tolerance(index) };
                if worst.as_ref().is_none_or(|(largest, _)| excess > *largest || excess.is_nan()) {
                    let column = WRENCH[index];
                    let found =
                        Worst { column, pose: *pose, expected: expected[index], got, status: status.clone() };
                    worst = Some((excess, found));
                }
            }
        }
        Ok(worst.map(|(_, worst)| worst))
    }

    /// Draws each compared column with its bounds and the answers, over the coordinate of the pose that changes most.
    ///
    /// # Errors
    /// A message if the answers do not match these poses.
    pub(crate) fn picture(
        &self,
        title: &str,
        answers: &str,
        tolerance: impl Fn(usize) -> f64,
    ) -> Result<String, String> {
        let answers = self.answers(answers)?;
        let along = self.coordinate_that_changes();
        let (name, quantity) = COORDINATES[along];
        let (_, per_si) = quantity.unit();
        let panel = |figure: Figure, index: usize| {
            let (column, measured) = COLUMNS[index];
            let (_, per_si_y) = measured.unit();
            let at = |value: &dyn Fn(usize) -> f64| {
                let mut samples: Vec<(f64, f64)> = (0..self.rows.len())
                    .map(|row| (self.rows[row].0[along] * per_si, value(row) * per_si_y))
                    .collect();
                samples.sort_by(|one, other| one.0.total_cmp(&other.0));
                samples
            };
            let expected = |row: usize| self.rows[row].1[index];
            let within = tolerance(index);
            let panel = Panel::new(Axis::of(column, measured))
                .series(Series::line("expected", at(&expected)).slot(0))
                .series(Series::line("least", at(&|row| expected(row) - within)).slot(7))
                .series(Series::line("most", at(&|row| expected(row) + within)).slot(7))
                .series(Series::points("got", at(&|row| answers[row].wrench[index])).slot(1));
            figure.panel(panel)
        };
        let figure = Figure::new(title, Axis::of(name, quantity)).panel_height_px(220.0);
        Ok(self.compared.iter().copied().fold(figure, panel).to_svg())
    }

    /// Returns the index of the coordinate with the widest range, in millimetres and degrees.
    fn coordinate_that_changes(&self) -> usize {
        let range = |index: usize| {
            let numbers = self.rows.iter().map(|(pose, _)| pose[index] * COORDINATES[index].1.unit().1);
            let (low, high) =
                numbers.fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
            high - low
        };
        (0..6).max_by(|one, other| range(*one).total_cmp(&range(*other)).then(other.cmp(one))).unwrap_or(0)
    }
}

/// Answer of `flotor eval`.
struct Answer {
    wrench: [f64; 6],
    status: String,
}

/// Name and quantity of each coordinate of a pose.
const COORDINATES: [(&str, Quantity); 6] = [
    ("x", Quantity::Length),
    ("y", Quantity::Length),
    ("z", Quantity::Length),
    ("Rotation, x", Quantity::Angle),
    ("Rotation, y", Quantity::Angle),
    ("Rotation, z", Quantity::Angle),
];

/// Name and quantity of each column of a wrench.
const COLUMNS: [(&str, Quantity); 6] = [
    ("Force, x", Quantity::Force),
    ("Force, y", Quantity::Force),
    ("Force, z", Quantity::Force),
    ("Torque, x", Quantity::Torque),
    ("Torque, y", Quantity::Torque),
    ("Torque, z", Quantity::Torque),
];

/// Component of a wrench that is outside the tolerance of the curve or has a rejected status, with its pose.
#[derive(Debug, PartialEq)]
pub(crate) struct Worst {
    pub(crate) column: &'static str,
    pub(crate) pose: [f64; 6],
    pub(crate) expected: f64,
    pub(crate) got: f64,
    pub(crate) status: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_point_outside_is_found() {
        let points = Points::parse("# a floor\nz_m, fz_n\n-0.001, 0.5\n-0.004, 2.0\n").unwrap();
        assert!(points.poses().ends_with("0e0,0e0,-4e-3,0e0,0e0,0e0\n"), "{}", points.poses());
        let answers = |first: f64, second: f64| {
            format!(
                "id,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,energy_j,status\n0,0,0,{first},0,0,0,,ok\n1,0,0,{second},0,0,0,,ok\n"
            )
        };
        assert_eq!(points.worst(&answers(0.5, 2.0), |_| 0.0), Ok(None));
        let worst = points.worst(&answers(0.6, 1.0), |_| 0.05).unwrap().unwrap();
        assert_eq!((worst.column, worst.expected, worst.got), ("fz_n", 2.0, 1.0));
        assert!(points.worst("fz_n\n", |_| 0.0).is_err());
        let both = Points::parse("z_m,fz_n,tx_nm\n-0.001,0.5,0\n-0.004,2.0,0.1\n").unwrap();
        let found = both.worst(&answers(0.5, 3.0), |index| [1.0, 0.01][index / 3] / 2.0).unwrap().unwrap();
        assert_eq!(found.column, "tx_nm", "a tenth of N·m is 20 tolerances, a newton 2");
        assert!(points.worst(&answers(0.5, 2.0).replace("ok", "invalid_input"), |_| 0.0).unwrap().is_some());
    }

    #[test]
    fn a_picture_shows_the_curve_its_bounds_and_the_answers() {
        let points = Points::parse("z_m,fz_n\n-0.004,2.0\n-0.001,0.5\n").unwrap();
        let answers =
            "id,fx_n,fy_n,fz_n,tx_nm,ty_nm,tz_nm,energy_j,status\n0,0,0,1.0,0,0,0,,ok\n1,0,0,0.5,0,0,0,,ok\n";
        let svg = points.picture("floor: curve", answers, |_| 0.25).unwrap();
        assert!(
            svg.contains("<title>floor: curve</title>") && svg.contains("Force, z (N) against z (mm)"),
            "{svg}"
        );
        for series in [
            "expected, 2 samples, 0.5 to 2",
            "least, 2 samples, 0.25 to 1.75",
            "most, 2 samples, 0.75 to 2.25",
            "got, 2 samples, 0.5 to 1",
        ] {
            assert!(svg.contains(series), "{series}: {svg}");
        }
        assert!(points.picture("t", "fz_n\n", |_| 0.0).is_err());
    }

    #[test]
    fn a_mistake_has_a_line() {
        for (text, says) in [
            ("", "c:1: the table is empty; write a header and at least one row"),
            ("z_m\n1", "the table has no column to compare"),
            ("z_mm,fz_n\n1,1", "unknown column `z_mm`"),
            ("z_m,fz_n\n1,1\n2", "c:3: the line has 1 cell for 2"),
            ("z_m,fz_n\n1,x", "c:2: `fz_n` must be a number, not `x`"),
            ("z_m,fz_n\n", "the table has no row"),
        ] {
            let told = Points::parse(text).unwrap_err().in_file("c");
            assert!(told.contains(says), "{told}");
        }
    }
}
