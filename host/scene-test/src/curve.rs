//! A force-position curve: a CSV with poses and the wrench expected at each.

use flotor_hal::{HashLines, Table, TextProblem, read_text};
use std::path::Path;

/// Columns of a pose, as `flotor eval` reads them.
pub(crate) const POSE: [&str; 6] = ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];
/// Columns of a wrench, as `flotor eval` writes them: force N, then torque N·m.
pub(crate) const WRENCH: [&str; 6] = ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"];

/// Poses and wrenches, in the model frame.
#[derive(Debug)]
pub(crate) struct Points {
    /// Which of [`WRENCH`] the file has.
    pub(crate) compared: Vec<usize>,
    rows: Vec<([f64; 6], [f64; 6])>,
}

impl Points {
    /// Reads a file. A column of the pose that it does not have is 0, one of the wrench that it does not have is not compared.
    ///
    /// # Errors
    /// In words, with the line.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let read = read_text(path, "the curve").and_then(|text| Self::parse(&text));
        read.map_err(|wrong| wrong.in_file(path.display()))
    }

    fn parse(text: &str) -> Result<Self, TextProblem> {
        let table = Table::parse(text, HashLines::Comments)?;
        let columns = table.columns();
        let is_known = |name: &String| POSE.contains(&name.as_str()) || WRENCH.contains(&name.as_str());
        if let Some(unknown) = columns.iter().find(|name| !is_known(name)) {
            let problem =
                format!("unknown column `{unknown}`; they are {}, {}", POSE.join(", "), WRENCH.join(", "));
            return Err(table.header_problem(problem));
        }
        let of_pose = POSE.map(|name| table.column(name));
        let of_wrench = WRENCH.map(|name| table.column(name));
        let compared: Vec<usize> = (0..6).filter(|index| of_wrench[*index].is_some()).collect();
        if compared.is_empty() {
            return Err(table.header_problem("no column to compare, such as fz_n"));
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
            Err(table.header_problem("no point follows"))
        } else {
            Ok(Self { compared, rows })
        }
    }

    /// The poses, as `flotor eval` reads them.
    pub(crate) fn poses(&self) -> String {
        let row = |(pose, _): &([f64; 6], [f64; 6])| pose.map(|number| format!("{number:e}")).join(",");
        let rows: Vec<String> = std::iter::once(POSE.join(",")).chain(self.rows.iter().map(row)).collect();
        rows.join("\n") + "\n"
    }

    /// The worst point for which `error` over its tolerance is largest, if one is outside: the column, the pose, expected and
    /// got. `answers` is what `flotor eval` wrote.
    ///
    /// # Errors
    /// In words: the answers are not those of these poses.
    pub(crate) fn worst(
        &self,
        answers: &str,
        tolerance: impl Fn(usize) -> f64,
    ) -> Result<Option<Worst>, String> {
        let mut lines = answers.lines();
        let head: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
        let place = |name: &str| head.iter().position(|known| *known == name);
        let mut worst: Option<(f64, Worst)> = None;
        for (pose, expected) in &self.rows {
            let cells: Vec<&str> = lines.next().ok_or("eval gave too few answers")?.split(',').collect();
            let cell = |name: &str| place(name).and_then(|place| cells.get(place).copied());
            let status = cell("status").unwrap_or_default();
            for index in self.compared.iter().copied() {
                let got: f64 = cell(WRENCH[index]).and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN);
                let error = (got - expected[index]).abs();
                let is_inside =
                    error <= tolerance(index) && status != "invalid_input" && status != "not_converged";
                let excess = if is_inside { continue } else { error };
                if worst.as_ref().is_none_or(|(largest, _)| excess > *largest || excess.is_nan()) {
                    let column = WRENCH[index];
                    let found = Worst {
                        column,
                        pose: *pose,
                        expected: expected[index],
                        got,
                        status: status.to_owned(),
                    };
                    worst = Some((excess, found));
                }
            }
        }
        Ok(worst.map(|(_, worst)| worst))
    }
}

/// A point that is too far from the curve.
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
        assert!(points.worst(&answers(0.5, 2.0).replace("ok", "invalid_input"), |_| 0.0).unwrap().is_some());
    }

    #[test]
    fn a_mistake_has_a_line() {
        for (text, says) in [
            ("", "c:1: the table is empty"),
            ("z_m\n1", "no column to compare"),
            ("z_mm,fz_n\n1,1", "unknown column `z_mm`"),
            ("z_m,fz_n\n1,1\n2", "c:3: 1 cell for 2"),
            ("z_m,fz_n\n1,x", "c:2: `fz_n` must be a number, not `x`"),
            ("z_m,fz_n\n", "no point"),
        ] {
            let told = Points::parse(text).unwrap_err().in_file("c");
            assert!(told.contains(says), "{told}");
        }
    }
}
