//! Calibration file of a device's vertical force: TOML, checked when loaded.
//!
//! ```toml
//! format = 1
//!
//! [device]
//! plugin = "simulated"
//! serial = "simulated"
//!
//! [vertical] # delivered over commanded force: c0 + c1 z + c2 z² ..., z in mm
//! range_mm = [-7.0, 7.0]
//! coefficients_per_mm = [1.05, -0.006, -0.0011]
//!
//! [quality]
//! error_after_percent = 0.1
//!
//! [provenance]
//! source = "measured"
//! program = "flotor 0.1.0"
//! ```

use crate::scene::Location;
pub use crate::scene::SceneError as CalibrationFileError;
use flotor_core::civil_date;
use flotor_hal::{InvalidCalibration, TextProblem, VerticalCalibration, read_text};
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::de::DeTable;

/// Version of the format that this program writes and reads.
pub const FORMAT: u32 = 1;

/// Calibration of one device, as in its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFile {
    /// Version of the file format; [`FORMAT`] is the only legal one.
    pub format: u32,
    /// Calibrated device.
    pub device: CalibratedDevice,
    /// Ratio of delivered to commanded vertical force, over the height.
    pub vertical: VerticalCurve,
    /// Quality of the fit.
    #[serde(default)]
    pub quality: Quality,
    /// Origin of the calibration.
    pub provenance: Provenance,
}

/// Device for which a calibration was made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedDevice {
    /// Id of the device's plugin.
    pub plugin: String,
    /// Serial number; empty: fits every device of the plugin.
    #[serde(default)]
    pub serial: String,
}

/// Ratio of delivered to commanded vertical force, as a polynomial in the height z, mm.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VerticalCurve {
    /// Lowest and highest measured height, mm above the centre of the device's range.
    pub range_mm: [f64; 2],
    /// Coefficients of 1, z, z² ..., in units of 1, 1/mm, 1/mm² ...
    pub coefficients_per_mm: Vec<f64>,
}

/// Quality of the fit and of the check after the correction; `None` for values that were not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quality {
    /// Number of readings of the force sensor.
    pub readings: Option<u32>,
    /// Standard deviation of the residuals, N.
    pub residual_n: Option<f64>,
    /// Largest half width of the 95 % confidence band of the curve's shape, percent of the commanded force.
    pub band_95_percent: Option<f64>,
    /// Unevenness before the correction, percent, peak to peak.
    pub error_before_percent: Option<f64>,
    /// Unevenness after the correction, percent, peak to peak.
    pub error_after_percent: Option<f64>,
    /// Fitted weight of the moving parts of the rig, N.
    pub weight_n: Option<f64>,
}

/// Origin of a calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Measured or imported.
    pub source: Source,
    /// Program that wrote the file, with its version.
    pub program: String,
    /// Date of the calibration; `None` if unknown.
    pub date: Option<toml::value::Datetime>,
    /// Seed of the random numbers of a simulated rig; `None` for a real rig.
    pub seed: Option<i64>,
    /// Note of the user, free text.
    pub note: Option<String>,
}

/// Source of the values of a calibration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Measured by `flotor calibrate vertical`.
    Measured,
    /// Imported from another source.
    Imported,
}

fn error(file: &str, line: usize, problem: impl Into<String>) -> CalibrationFileError {
    Location { file: file.into(), line }.problem(problem)
}

const MM: f64 = 1.0e-3;

/// Returns the powers of a millimetre, in m, from the power 0.
fn powers_of_mm() -> impl Iterator<Item = f64> {
    std::iter::successors(Some(1.0), |power| Some(power * MM))
}

impl VerticalCurve {
    /// Converts a calibration, in metres, to a curve in millimetres, without trailing zero coefficients.
    #[must_use]
    pub fn of(calibration: &VerticalCalibration) -> Self {
        let scaled = calibration.coefficients().iter().zip(powers_of_mm());
        let mut coefficients: Vec<f64> = scaled.map(|(coefficient, scale)| coefficient * scale).collect();
        while coefficients.len() > 1 && coefficients.last() == Some(&0.0) {
            coefficients.pop();
        }
        Self { range_mm: calibration.range_m().map(|height| height / MM), coefficients_per_mm: coefficients }
    }

    /// Converts the curve, in millimetres, to a calibration in metres.
    ///
    /// # Errors
    /// [`flotor_hal::InvalidCalibration`] if range or coefficients are not valid.
    pub fn calibration(&self) -> Result<VerticalCalibration, flotor_hal::InvalidCalibration> {
        let scaled = self.coefficients_per_mm.iter().zip(powers_of_mm());
        let coefficients: Vec<f64> = scaled.map(|(coefficient, scale)| coefficient / scale).collect();
        VerticalCalibration::new(self.range_mm.map(|height| height * MM), &coefficients)
    }
}

/// Returns the line, from 1, of the value under these nested keys; 0 if there is no value.
fn line_of(text: &str, keys: &[&str]) -> usize {
    let Ok(root) = DeTable::parse(text) else { return 0 };
    let (mut table, mut start) = (Some(root.get_ref()), None);
    for key in keys {
        let value = table.and_then(|table| table.get(*key));
        start = value.map(|value| value.span().start);
        table = value.and_then(|value| value.get_ref().as_table());
    }
    start.and_then(|start| text.get(..start)).map_or(0, |before| before.matches('\n').count() + 1)
}

impl CalibrationFile {
    /// Reads and checks a calibration file; returns its content and the calibration of the curve. Not real-time.
    ///
    /// # Errors
    /// [`CalibrationFileError`] with file, line and remedy, if the file cannot be read or is not a valid calibration.
    pub fn load(path: &Path) -> Result<(Self, VerticalCalibration), CalibrationFileError> {
        let file = path.display().to_string();
        let text = read_text(path, "the calibration")
            .map_err(|TextProblem { line, problem }| error(&file, line, problem))?;
        Self::parse(&file, &text)
    }

    /// Parses and checks the text of a calibration file; returns its content and the calibration of the curve. `file` is its name in
    /// error messages. Not real-time.
    ///
    /// # Errors
    /// [`CalibrationFileError`] with file, line and remedy, if the text is not a valid calibration.
    pub fn parse(file: &str, text: &str) -> Result<(Self, VerticalCalibration), CalibrationFileError> {
        let read: Self = toml::from_str(text).map_err(|wrong: toml::de::Error| {
            let before = wrong.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            let message = wrong.message().lines().next().unwrap_or_default();
            let cause =
                message.split(", expected one of").next().unwrap_or_default().replace(" field ", " key ");
            let problem =
                format!("the file is not a valid calibration file ({cause}); correct the file, or write a new one with `flotor calibrate`");
            error(file, before.matches('\n').count() + 1, problem)
        })?;
        let wrong = |keys: &[&str], problem: String| error(file, line_of(text, keys), problem);
        if read.format != FORMAT {
            let problem = format!(
                "the file has format {}, but this program reads format {FORMAT}; calibrate again",
                read.format
            );
            return Err(wrong(&["format"], problem));
        }
        let calibration = read.vertical.calibration().map_err(|invalid| match invalid {
            // In mm, the unit of the file.
            InvalidCalibration::Range(_) => {
                let [from, to] = read.vertical.range_mm;
                wrong(&["vertical", "range_mm"], format!(
                    "[vertical] the range {from:?} mm to {to:?} mm is invalid; write two heights within 1000 mm of \
                     the centre, the lower first"))
            }
            other => wrong(&["vertical", "coefficients_per_mm"], format!("[vertical] {other}")),
        })?;
        Ok((read, calibration))
    }

    /// Serialises the file as TOML with a comment header; equal content gives equal text. Not real-time.
    ///
    /// # Errors
    /// Errors of the serialiser; none is known.
    pub fn to_text(&self) -> Result<String, toml::ser::Error> {
        const HEAD: &str = "# Vertical calibration of a haptic device: delivered over commanded force is\n\
                            # c0 + c1 z + c2 z² ..., z in mm above the centre of its range.\n";
        Ok(format!("{HEAD}{}", toml::to_string(self)?))
    }

    /// Checks that the calibration was made for this device; `file` is its name in error messages.
    ///
    /// # Errors
    /// [`CalibrationFileError`] if plugin id or serial number differ.
    pub fn check_device(&self, file: &str, plugin: &str, serial: &str) -> Result<(), CalibrationFileError> {
        let CalibratedDevice { plugin: wanted, serial: wanted_serial } = &self.device;
        if wanted == plugin && (wanted_serial.is_empty() || wanted_serial == serial) {
            return Ok(());
        }
        let [wanted, device] = [(&**wanted, &**wanted_serial), (plugin, serial)]
            .map(|(id, serial)| format!("`{id}` {serial}").trim_end().to_owned());
        let problem = format!("the file is for {wanted}, the device is {device}; calibrate this device");
        Err(error(file, 0, problem))
    }
}

/// Returns the current UTC date as a TOML date. Not real-time.
#[must_use]
pub fn today() -> toml::value::Datetime {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
    let (year, month, day) = civil_date(now.as_secs() / 86_400);
    toml::value::Datetime { date: Some(toml::value::Date { year, month, day }), time: None, offset: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) const EXAMPLE: &str = "format = 1\n[device]\nplugin = \"simulated\"\nserial = \"s1\"\n[vertical]\n\
        range_mm = [-7.0, 7.0]\ncoefficients_per_mm = [1.05, -0.006, -0.0011]\n[quality]\nresidual_n = 0.02\n\
        [provenance]\nsource = \"measured\"\nprogram = \"flotor 0.1.0\"\ndate = 2026-03-01\n";

    #[test]
    fn what_is_written_is_read() {
        let (file, calibration) = CalibrationFile::parse("c.toml", EXAMPLE).unwrap();
        let (again, same) = CalibrationFile::parse("c.toml", &file.to_text().unwrap()).unwrap();
        assert_eq!(file, again);
        assert_eq!(calibration, same);
        let back = VerticalCurve::of(&calibration);
        assert!(
            (back.coefficients_per_mm[2] + 0.0011).abs() < 1.0e-18 && back.coefficients_per_mm.len() == 3
        );
    }

    #[test]
    fn complaints_name_file_line_and_cause() {
        let said = |from: &str, to: &str| {
            let text = EXAMPLE.replace(from, to);
            assert_ne!(text, EXAMPLE, "{from} stands in the example");
            CalibrationFile::parse("c.toml", &text).unwrap_err().to_string()
        };
        let unknown = "c.toml:4: the file is not a valid calibration file (unknown key `seriel`, expected `plugin` or `serial`); correct the file, or write a new one with `flotor calibrate`";
        assert_eq!(said("serial", "seriel"), unknown);
        assert_eq!(
            said("format = 1", "model = 1"),
            "c.toml:1: the file is not a valid calibration file (unknown key `model`); correct the file, or write a new one with `flotor calibrate`"
        );
        assert!(said("[-7.0, 7.0]", "[-7.0, true]").starts_with("c.toml:6: "));
        assert!(said("format = 1", "format = 2").contains("format 2, but this program reads format 1"));
        assert!(said("1.05", "nan").contains("[vertical]"));
        assert!(said("1.05", "0.01").contains("must be between 0.5 and 2"));
        assert!(said("[-7.0, 7.0]", "[7.0, -7.0]").contains("the range 7.0 mm to -7.0 mm is invalid"));
        assert!(said("-0.0011]", "0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]").contains("9 coefficients"));
    }

    #[test]
    fn a_file_for_another_device_is_refused() {
        let (file, _) = CalibrationFile::parse("c.toml", EXAMPLE).unwrap();
        assert!(file.check_device("c.toml", "simulated", "s1").is_ok());
        assert!(file.check_device("c.toml", "simulated", "s2").is_err());
        let refused = file.check_device("c.toml", "maglev", "s1").unwrap_err().to_string();
        assert!(refused.contains("`simulated` s1") && refused.contains("`maglev` s1"), "{refused}");
    }

    /// Mutated files: never a panic, and whatever is accepted is a curve that multiplies no force beyond two.
    #[test]
    fn no_text_becomes_a_dangerous_curve() {
        use rand_core::{Rng, SeedableRng};
        let cases = if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") {
            2_000_000
        } else {
            20_000
        };
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        let pieces: [&[u8]; 12] = [
            b"nan",
            b"-inf",
            b"1e308",
            b"[",
            b"]",
            b"-",
            b"0",
            b"9",
            b"\n",
            b"\xff",
            b"format = 1",
            b"\"\"\"",
        ];
        let mut accepted = 0_u32;
        for _ in 0..cases {
            let mut bytes = EXAMPLE.as_bytes().to_vec();
            for _ in 0..=random.next_u64() % 4 {
                let at = usize::try_from(random.next_u64() % (bytes.len() as u64 + 1)).unwrap();
                let to = bytes.len().min(at + usize::try_from(random.next_u64() % 4).unwrap());
                let piece = pieces[usize::try_from(random.next_u64() % 12).unwrap()];
                bytes.splice(at..to, piece.iter().copied());
            }
            let text = String::from_utf8_lossy(&bytes);
            if let Ok((_, calibration)) = CalibrationFile::parse("fuzz", &text) {
                accepted += 1;
                for height_mm in -20..=20 {
                    let command_n = calibration.command_n(10.0, f64::from(height_mm) * MM);
                    assert!((4.9..=20.1).contains(&command_n), "{command_n} N from {text}");
                }
            }
        }
        assert!(accepted > 0, "some mutations leave a file whole");
    }
}
