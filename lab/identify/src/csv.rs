//! Measurement from a table: force over displacement, as testing machines write it.

use crate::measurement::{Measurement, MeasurementError};
use flotor_hal::{HashLines, Table, TextProblem};

const TIME: &str = "time_s";
const FORCE: &str = "force_n";
/// Columns of the displacement with their factors to m.
const DISPLACEMENTS: [(&str, f64); 2] = [("displacement_m", 1.0), ("displacement_mm", 1.0e-3)];

/// Measurement of a table, and its ignored columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Parsed {
    /// The samples.
    pub measurement: Measurement,
    /// Names of unknown columns.
    pub ignored: Vec<String>,
}

/// Parses a table with the columns `displacement_m` or `displacement_mm`, `force_n`, and optionally `time_s`, in any order;
/// displacement into the object and force on the object are positive. Other columns are ignored. Not real-time.
///
/// # Errors
/// A [`TextProblem`] with the line: a missing column, a displacement in both units, a malformed row, a number that is not finite, or
/// samples that [`Measurement::new`] rejects.
pub fn parse(text: &str) -> Result<Parsed, TextProblem> {
    let table = Table::parse(text, HashLines::Comments)?;
    let expected =
        "the columns are displacement_m or displacement_mm, force_n, and time_s for laws with a rate";
    let missing = |name: &str| table.header_problem(format!("column `{name}` is missing ({expected})"));
    let displacements: Vec<(usize, f64)> =
        DISPLACEMENTS.into_iter().filter_map(|(name, factor)| Some((table.column(name)?, factor))).collect();
    let (x_column, to_m) = match displacements.as_slice() {
        [] => return Err(missing("displacement_m")),
        [one] => *one,
        _ => {
            return Err(
                table.header_problem("the displacement is given twice, in m and mm; remove one column")
            );
        }
    };
    let f_column = table.column(FORCE).ok_or_else(|| missing(FORCE))?;
    let t_column = table.column(TIME);
    let (mut time_s, mut displacement_m, mut force_n, mut lines) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for row in table.rows() {
        let row = row?;
        lines.push(row.line());
        displacement_m.push(row.finite(x_column)? * to_m);
        force_n.push(row.finite(f_column)?);
        time_s.extend(t_column.map(|column| row.finite(column)).transpose()?);
    }
    let measurement = Measurement::new(t_column.map(|_| time_s), displacement_m, force_n);
    let measurement = measurement.map_err(|error| match error {
        MeasurementError::TimeFalls(sample) | MeasurementError::NotFinite(sample) => {
            TextProblem::at(lines.get(sample).copied().unwrap_or(1), error.without_sample())
        }
        error => TextProblem::at(lines.last().copied().unwrap_or(1), error.to_string()),
    })?;
    let is_known = |index: &usize| [Some(x_column), Some(f_column), t_column].contains(&Some(*index));
    let ignored = table.columns().iter().enumerate().filter(|(index, _)| !is_known(index));
    Ok(Parsed { measurement, ignored: ignored.map(|(_, name)| name.clone()).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(header: &str, row: impl Fn(u32) -> String) -> String {
        let rows: String = (0..30).map(|index| row(index) + "\n").collect();
        format!("{header}\n{rows}")
    }

    #[test]
    fn columns_have_any_order_and_the_unit_of_their_name() {
        let metres =
            parse(&rows("displacement_m,force_n", |i| format!("{},{i}", f64::from(i) * 1.0e-3))).unwrap();
        let millimetres =
            parse(&rows("load cell,force_n,displacement_mm", |i| format!("9,{i},{i}"))).unwrap();
        assert_eq!(metres.measurement, millimetres.measurement);
        assert_eq!((metres.ignored.len(), millimetres.ignored), (0, vec!["load cell".to_owned()]));
        let timed =
            parse(&rows("force_n,time_s,displacement_mm", |i| format!("{i},{},{i}", 0.1 * f64::from(i))))
                .unwrap();
        assert_eq!(timed.measurement.time_s().map(<[f64]>::len), Some(30));
    }

    #[test]
    fn what_is_wrong_has_its_line_and_a_remedy() {
        for (text, says) in [
            ("x,force_n\n1,2\n".to_owned(), "f:1: column `displacement_m` is missing"),
            (
                "displacement_m,displacement_mm,force_n\n1,2,3\n".to_owned(),
                "f:1: the displacement is given twice",
            ),
            ("displacement_m,force_n\n0,1\n0.1,2\n".to_owned(), "f:3: the measurement has 2 samples"),
            (
                rows("displacement_mm,force_n", |i| {
                    format!("{i},{}", if i == 7 { "nan".into() } else { i.to_string() })
                }),
                "f:9: `force_n` must be finite",
            ),
            (
                rows("time_s,displacement_mm,force_n", |i| format!("{},{i},{i}", if i == 5 { 0 } else { i })),
                "f:7: the time decreases",
            ),
            (rows("displacement_mm,force_n", |i| format!("1,{i}")), "f:31: the displacement is constant"),
            (rows("displacement_mm,force_n", |i| format!("{i},0")), "f:31: the force is zero everywhere"),
        ] {
            let told = parse(&text).unwrap_err().in_file("f");
            assert!(told.starts_with(says), "{told}, not {says}");
        }
    }
}
