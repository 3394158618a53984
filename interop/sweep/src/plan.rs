//! Plan of a sweep: axes, seeds, and the model or scene, read from TOML and checked before anything runs.

use flotor_command::options::LARGEST_SEED;
use flotor_hal::{TextProblem, read_file, text_from_bytes};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Checked plan.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Title of the picture.
    pub title: String,
    /// Evaluation or run at every point.
    pub question: Question,
    /// Placement of the points in the space of the axes.
    pub layout: Layout,
    /// Varied quantities. The first axis varies slowest in a grid.
    pub axes: Vec<Axis>,
    /// Seeds at every point.
    pub seeds: Vec<u64>,
    /// Rows (points times seeds) per task.
    pub block: usize,
}

/// Evaluation or run at a point.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Question {
    /// Run in virtual time; axes are settings `PLUGIN.KEY`.
    Run {
        /// Scene file, relative to the plan; `None` for the built-in demo.
        scene: Option<PathBuf>,
        /// Duration of each run, s of virtual time; `None` for the scene's.
        duration_s: Option<f64>,
    },
    /// Evaluation of a force model at a pose; axes are parameters of the model or the pose columns of `flotor eval`.
    Eval {
        /// Id of the model, or path to its plugin.
        model: String,
    },
}

/// Placement of the points in the space of the axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// Grid of all combinations.
    Grid,
    /// First points of the Sobol sequence with a random digital shift; every axis must be a range, at most six axes.
    Sobol {
        /// Number of points.
        points: u64,
        /// Seed of the shift.
        seed: u64,
    },
}

/// Varied quantity with its values.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Setting, parameter or pose column.
    pub key: String,
    /// Values along the axis.
    pub values: Values,
}

/// Values along an axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Listed numbers.
    Numbers(Vec<f64>),
    /// Listed words of a choice.
    Words(Vec<String>),
    /// Interval with equal or logarithmic spacing.
    Range {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// Number of values on a grid, ends included; at least 2.
        steps: u32,
        /// Linear or logarithmic spacing.
        scale: Scale,
    },
}

/// Spacing of a range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// Equal differences.
    #[default]
    Linear,
    /// Equal ratios; both ends positive.
    Log,
}

/// Error of a plan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The file cannot be read.
    #[error("{}: cannot read the plan: {cause}; check the path and its permissions", path.display())]
    Unreadable {
        /// Path of the plan.
        path: PathBuf,
        /// Error of the system.
        cause: std::io::Error,
    },
    /// The file is not UTF-8 or not TOML, or a key is unknown or of the wrong type.
    #[error("{}:{line}: {problem}", path.display())]
    Malformed {
        /// Path of the plan.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Cause.
        problem: String,
    },
    /// The values are not a valid plan.
    #[error("{}: {problem}", path.display())]
    Unfit {
        /// Path of the plan.
        path: PathBuf,
        /// Cause and remedy.
        problem: String,
    },
}

/// Limit on the number of rows: a table of this size can still be written by a machine with 16 GB.
const MOST_ROWS: u64 = 100_000_000;
/// Default number of rows per task of evaluations, which are cheap; a task of runs has one row by default.
const EVAL_BLOCK: usize = 4096;
/// Axis keys that are pose coordinates rather than parameters, in order.
pub const POSE_COLUMNS: [&str; 6] = ["x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    title: Option<String>,
    ask: Question,
    #[serde(default)]
    layout: LayoutText,
    points: Option<u64>,
    #[serde(default)]
    layout_seed: u64,
    #[serde(default)]
    axis: Vec<AxisText>,
    seeds: Option<Vec<u64>>,
    block: Option<usize>,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum LayoutText {
    #[default]
    Grid,
    Sobol,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AxisText {
    key: String,
    values: Option<Vec<f64>>,
    words: Option<Vec<String>>,
    from: Option<f64>,
    to: Option<f64>,
    steps: Option<u32>,
    #[serde(default)]
    scale: Scale,
}

/// Limit on the size of a plan, bytes.
const MOST_BYTES: u64 = 64 << 20;

impl Plan {
    /// Reads a plan from its file.
    ///
    /// # Errors
    /// [`PlanError`] with file and line, or with the remedy.
    pub fn load(path: &Path) -> Result<Self, PlanError> {
        let bytes = read_file(path, MOST_BYTES)
            .map_err(|cause| PlanError::Unreadable { path: path.into(), cause })?;
        let text = text_from_bytes(bytes).map_err(|TextProblem { line, problem }| PlanError::Malformed {
            path: path.into(),
            line,
            problem,
        })?;
        Self::parse(&text, path)
    }

    /// Parses and checks a plan; `path`: file for error messages, whose folder is the base of a relative scene file.
    ///
    /// # Errors
    /// [`PlanError`] of the text or its values.
    pub fn parse(text: &str, path: &Path) -> Result<Self, PlanError> {
        let file: File = toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let line = 1 + text.get(..start).unwrap_or_default().matches('\n').count();
            PlanError::Malformed { path: path.into(), line, problem: error.message().to_owned() }
        })?;
        let unfit = |problem: String| PlanError::Unfit { path: path.into(), problem };
        let axes: Result<Vec<Axis>, String> = file.axis.into_iter().map(AxisText::check).collect();
        let question = match file.ask {
            Question::Run { scene: Some(scene), duration_s } => {
                let folder = path.parent().unwrap_or(Path::new(""));
                Question::Run { scene: Some(folder.join(scene)), duration_s }
            }
            other => other,
        };
        let default_block = if matches!(question, Question::Eval { .. }) { EVAL_BLOCK } else { 1 };
        let layout = match (file.layout, file.points) {
            (LayoutText::Grid, None) => Layout::Grid,
            (LayoutText::Grid, Some(_)) => {
                return Err(unfit(
                    "`points` is only for layout = \"sobol\"; in a grid, set `steps` of each range".into(),
                ));
            }
            (LayoutText::Sobol, Some(points)) => Layout::Sobol { points, seed: file.layout_seed },
            (LayoutText::Sobol, None) => {
                return Err(unfit(
                    "layout = \"sobol\" without `points`; write `points = N`, the number of points".into(),
                ));
            }
        };
        let plan = Self {
            title: file.title.unwrap_or_else(|| "Sweep".to_owned()),
            question,
            layout,
            axes: axes.map_err(unfit)?,
            seeds: file.seeds.unwrap_or_else(|| vec![0]),
            block: file.block.unwrap_or(default_block),
        };
        plan.check().map_err(unfit)?;
        Ok(plan)
    }

    fn check(&self) -> Result<(), String> {
        if self.axes.is_empty() {
            return Err("the plan has no axis; add [[axis]] with key and values".into());
        }
        if let Some(repeated) =
            self.axes.iter().enumerate().find(|(at, axis)| self.axes[..*at].iter().any(|a| a.key == axis.key))
        {
            return Err(format!("`{}` is the key of two axes; remove one", repeated.1.key));
        }
        if let Some(large) = self.seeds.iter().find(|seed| **seed > LARGEST_SEED) {
            return Err(format!(
                "the seed {large} is larger than {LARGEST_SEED} (2^53); write a smaller seed"
            ));
        }
        if self.seeds.is_empty() {
            return Err("`seeds` is empty; write at least one seed".into());
        }
        if self.block == 0 {
            return Err("`block` is 0; write 1 or more".into());
        }
        if let Question::Run { .. } = self.question
            && let Some(axis) = self.axes.iter().find(|axis| !axis.key.contains('.'))
        {
            return Err(format!(
                "`{}` is not a setting of a scene; write PLUGIN.KEY, like spring.gamma_n",
                axis.key
            ));
        }
        if let Layout::Sobol { .. } = self.layout {
            let most = flotor_lab::sampling::DIMENSIONS;
            if self.axes.len() > most {
                return Err(format!(
                    "the plan has {} axes, but the Sobol sequence has at most {most} dimensions; remove axes",
                    self.axes.len()
                ));
            }
            if let Some(axis) = self.axes.iter().find(|axis| !matches!(axis.values, Values::Range { .. })) {
                return Err(format!(
                    "`{}` lists values, but layout = \"sobol\" needs `from` and `to`; write a range, or set layout = \"grid\"",
                    axis.key
                ));
            }
        }
        match self.row_count() {
            Some(1..=MOST_ROWS) => Ok(()),
            Some(0) => Err("`points` is 0; write 1 or more".into()),
            rows => {
                let rows = rows.map_or("more than 2^64".to_owned(), |rows| rows.to_string());
                Err(format!("the plan has {rows} rows, above the limit of {MOST_ROWS}; split the plan"))
            }
        }
    }

    /// Returns the number of rows, points times seeds; `None` on overflow.
    #[must_use]
    pub fn row_count(&self) -> Option<u64> {
        let points = match self.layout {
            Layout::Sobol { points, .. } => points,
            Layout::Grid => {
                self.axes.iter().try_fold(1_u64, |product, axis| product.checked_mul(axis.values.len()))?
            }
        };
        points.checked_mul(self.seeds.len() as u64)
    }
}

impl Values {
    /// Returns the number of values on a grid.
    #[must_use]
    pub fn len(&self) -> u64 {
        match self {
            Self::Numbers(values) => values.len() as u64,
            Self::Words(words) => words.len() as u64,
            Self::Range { steps, .. } => u64::from(*steps),
        }
    }

    /// Returns true if there are no values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl AxisText {
    fn check(self) -> Result<Axis, String> {
        let Self { key, values, words, from, to, steps, scale } = self;
        let values = match (values, words, from, to) {
            (Some(values), None, None, None) => match values.iter().copied().find(|v| !v.is_finite()) {
                None => Values::Numbers(values),
                Some(value) => {
                    return Err(format!("axis `{key}`: {value} is not finite; write finite numbers"));
                }
            },
            (None, Some(words), None, None) => Values::Words(words),
            (None, None, Some(from), Some(to)) => {
                if !(from.is_finite() && to.is_finite() && from < to) {
                    return Err(format!(
                        "axis `{key}`: `from` = {from} and `to` = {to} must be finite, and `from` below `to`"
                    ));
                }
                if scale == Scale::Log && from <= 0.0 {
                    return Err(format!(
                        "axis `{key}`: a logarithmic range must start above 0, not at {from}"
                    ));
                }
                Values::Range { from, to, steps: steps.unwrap_or(2).max(2), scale }
            }
            _ => {
                return Err(format!(
                    "axis `{key}`: write exactly one of values = [..], words = [..], or from and to"
                ));
            }
        };
        if values.is_empty() {
            return Err(format!("axis `{key}` has no values; write at least one"));
        }
        Ok(Axis { key, values })
    }
}
