//! Tasks of a sweep: blocks of rows with their keys, and their execution.

use crate::design::{Cell, Design, Point};
use crate::plan::{POSE_COLUMNS, Plan, PlanError, Question};
use flotor_hal::abi::PluginKind;
use flotor_hal::{DVec3, Demand};
use flotor_lab::evaluate::{Answer, Details, Evaluation, Handle, Travel};
use flotor_loader::{Plugin, Setting};
use flotor_session::headless;
use flotor_session::registry::Registry;
use flotor_session::scene::{PluginKeyValue, Scene};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Plan with its loaded scene or plugin. May be shared between threads.
pub struct Sweep {
    plan: Plan,
    subject: Subject,
    /// Result columns.
    answers: Vec<Column>,
    /// Digest of the data common to all tasks: question, scene text, plugin files, axes.
    context: u128,
}

enum Subject {
    Run { scene: Box<Scene>, folders: Vec<PathBuf> },
    Eval { plugin: Box<Plugin> },
}

/// Task: rows `first..first + count` of the plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Task {
    /// Hash of all data that the result depends on, 32 hexadecimal digits.
    pub key: String,
    /// Index of the first row, from 0.
    pub first: u64,
    /// Number of rows.
    pub count: u64,
}

/// Column of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name of the axis or result.
    pub name: String,
    /// Type of the cells.
    pub kind: ColumnKind,
}

/// Type of the cells of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Double-precision numbers; NaN for a missing number.
    Number,
    /// Words; empty for a missing word.
    Word,
}

/// Error of preparing a sweep.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// The plan is invalid.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// A plugin is unknown or cannot be loaded.
    #[error(transparent)]
    Lookup(#[from] flotor_session::registry::LookupError),
    /// The scene is invalid.
    #[error(transparent)]
    Scene(#[from] flotor_session::scene::SceneError),
    /// An axis names no parameter, or its first value is invalid.
    #[error("axis `{key}`: {problem}")]
    Axis {
        /// Key of the axis.
        key: String,
        /// Cause.
        problem: String,
    },
    /// A plugin file cannot be read, for its digest.
    #[error("cannot read `{}`: {cause}; check the path and its permissions", path.display())]
    Plugin {
        /// Path of the plugin file.
        path: PathBuf,
        /// Error of the system.
        cause: std::io::Error,
    },
}

/// Result columns of a run.
const RUN_COLUMNS: [(&str, ColumnKind); 8] = [
    ("ticks", ColumnKind::Number),
    ("peak_force_n", ColumnKind::Number),
    ("peak_torque_nm", ColumnKind::Number),
    ("loop_generated_j", ColumnKind::Number),
    ("device_peak_j", ColumnKind::Number),
    ("end", ColumnKind::Word),
    ("trace_digest", ColumnKind::Word),
    ("error", ColumnKind::Word),
];
/// Result columns of an evaluation.
const EVAL_COLUMNS: [(&str, ColumnKind); 9] = [
    ("fx_n", ColumnKind::Number),
    ("fy_n", ColumnKind::Number),
    ("fz_n", ColumnKind::Number),
    ("tx_nm", ColumnKind::Number),
    ("ty_nm", ColumnKind::Number),
    ("tz_nm", ColumnKind::Number),
    ("energy_j", ColumnKind::Number),
    ("status", ColumnKind::Word),
    ("error", ColumnKind::Word),
];

impl Sweep {
    /// Loads the scene or plugin of a plan and checks the axes, before anything runs. Plugins are searched in `folders` first. Not
    /// real-time.
    ///
    /// # Errors
    /// [`SweepError`] of the plan, the scene, a plugin or an axis.
    pub fn prepare(plan: Plan, folders: &[PathBuf]) -> Result<Self, SweepError> {
        let registry = Registry::search(folders);
        let mut context = Xxh3::new();
        context.update(env!("CARGO_PKG_VERSION").as_bytes());
        let (subject, answers) = match &plan.question {
            Question::Eval { model } => {
                let plugin = registry.load(model, PluginKind::Model)?;
                check_model_axes(&plan, &plugin)?;
                digest_file(&mut context, &plugin.metadata().path)?;
                (Subject::Eval { plugin: Box::new(plugin) }, EVAL_COLUMNS.as_slice())
            }
            Question::Run { scene, duration_s } => {
                let mut scene = match scene {
                    Some(path) => Scene::load(path)?,
                    None => Scene::demo()?,
                };
                scene.duration_s = duration_s.unwrap_or(scene.duration_s);
                context.update(scene.text.as_bytes());
                context.update(&scene.duration_s.to_bits().to_le_bytes());
                let all_folders = [folders, &scene.plugin_folders].concat();
                for metadata in used_plugins(&scene, &Registry::search(&all_folders))? {
                    digest_file(&mut context, &metadata)?;
                }
                let subject = Subject::Run { scene: Box::new(scene), folders: all_folders };
                (subject, RUN_COLUMNS.as_slice())
            }
        };
        for axis in &plan.axes {
            context.update(axis.key.as_bytes());
            context.update(&[0]);
        }
        let answers =
            answers.iter().map(|(name, kind)| Column { name: (*name).to_owned(), kind: *kind }).collect();
        let sweep = Self { plan, subject, answers, context: context.digest128() };
        sweep.check_first_row()?;
        Ok(sweep)
    }

    /// Returns the checked plan of the sweep.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Returns the columns of the table: axes, seed, results.
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        let design = Design::new(&self.plan);
        let axes = self.plan.axes.iter().zip(design.point(0).values).map(|(axis, value)| Column {
            name: axis.key.clone(),
            kind: if matches!(value, Cell::Word(_)) { ColumnKind::Word } else { ColumnKind::Number },
        });
        let seed = Column { name: "seed".to_owned(), kind: ColumnKind::Number };
        axes.chain([seed]).chain(self.answers.iter().cloned()).collect()
    }

    /// Returns all tasks, in the order of their rows.
    #[must_use]
    pub fn tasks(&self) -> Vec<Task> {
        let rows = self.plan.row_count().unwrap_or(0);
        let block = self.plan.block as u64;
        (0..rows.div_ceil(block))
            .map(|number| {
                let first = number * block;
                let count = block.min(rows - first);
                Task { key: self.key(first, count), first, count }
            })
            .collect()
    }

    /// Returns the hash of the context and of every point: all data that the result depends on, and nothing else.
    fn key(&self, first: u64, count: u64) -> String {
        let design = Design::new(&self.plan);
        let mut hash = Xxh3::new();
        hash.update(&self.context.to_le_bytes());
        for row in first..first + count {
            let Point { values, seed } = design.point(row);
            for value in values {
                hash.update(value.text().as_bytes());
                hash.update(&[0]);
            }
            hash.update(&seed.to_le_bytes());
        }
        format!("{:032x}", hash.digest128())
    }

    /// Executes a task: returns a row per point, axes and seed first. The row of a rejected point has the reason in its last cell.
    #[must_use]
    pub fn answer(&self, task: &Task) -> Vec<Vec<Cell>> {
        let design = Design::new(&self.plan);
        let points: Vec<Point> = (task.first..task.first + task.count).map(|row| design.point(row)).collect();
        let answers = match &self.subject {
            Subject::Run { scene, folders } => points.iter().map(|p| self.run(p, scene, folders)).collect(),
            Subject::Eval { plugin } => self.evaluate(&points, plugin),
        };
        let rows = points.into_iter().zip(answers);
        rows.map(|(Point { values, seed }, answer)| {
            let seed = Cell::number(seed as f64);
            values.into_iter().chain([seed]).chain(answer).collect()
        })
        .collect()
    }

    fn run(&self, point: &Point, scene: &Scene, folders: &[PathBuf]) -> Vec<Cell> {
        let answer = self.scene_at(point, scene).map_err(|e| e.to_string()).and_then(|scene| {
            let registry = Registry::search(folders);
            headless::run(&scene, &registry, point.seed, None, Demand::ALL).map_err(|e| e.to_string())
        });
        match answer {
            Ok(summary) => vec![
                Cell::number(summary.ticks as f64),
                Cell::number(summary.peak_force_n),
                Cell::number(summary.peak_torque_nm),
                Cell::number(summary.energy.loop_generated_j.unwrap_or(f64::NAN)),
                Cell::number(summary.energy.device_peak_j.unwrap_or(f64::NAN)),
                Cell::Word(summary.end.word().to_owned()),
                Cell::Word(summary.trace_digest),
                Cell::Word(String::new()),
            ],
            Err(reason) => refused(&RUN_COLUMNS, &reason),
        }
    }

    /// Returns the scene with the settings of a point.
    fn scene_at(&self, point: &Point, scene: &Scene) -> Result<Scene, SweepError> {
        let mut scene = scene.clone();
        for (axis, value) in self.plan.axes.iter().zip(&point.values) {
            let setting = format!("{}={}", axis.key, value.text()).parse::<PluginKeyValue>();
            setting
                .and_then(|setting| setting.apply(&mut scene))
                .map_err(|problem| SweepError::Axis { key: axis.key.clone(), problem })?;
        }
        Ok(scene)
    }

    /// Evaluates points; consecutive points with the same parameters share a model, which receives their poses in batches.
    fn evaluate(&self, points: &[Point], plugin: &Plugin) -> Vec<Vec<Cell>> {
        let mut answers = Vec::with_capacity(points.len());
        for group in points.chunk_by(|a, b| self.parameters(a) == self.parameters(b)) {
            let handles: Vec<Handle> = group.iter().map(|point| self.handle(point)).collect();
            let evaluated = group.first().ok_or_else(String::new).and_then(|point| {
                let settings = self.settings(point, plugin)?;
                let evaluation = Evaluation {
                    plugin,
                    settings: &settings,
                    travel: Travel::FromHome,
                    details: Details::Omitted,
                };
                evaluation.answers(&handles, &|| ()).map_err(|error| error.to_string())
            });
            match evaluated {
                Ok(evaluated) => answers.extend(evaluated.iter().map(answered)),
                Err(reason) => answers.extend(group.iter().map(|_| refused(&EVAL_COLUMNS, &reason))),
            }
        }
        answers
    }

    fn parameters(&self, point: &Point) -> Vec<(String, String)> {
        let axes = self.plan.axes.iter().zip(&point.values);
        let parameters = axes.filter(|(axis, _)| !is_pose(&axis.key));
        parameters.map(|(axis, value)| (axis.key.clone(), value.text())).collect()
    }

    fn settings(&self, point: &Point, plugin: &Plugin) -> Result<Vec<Setting>, String> {
        let parse = |(key, value): (String, String)| Setting::parse(plugin.parameters(), &key, &value);
        self.parameters(point).into_iter().map(parse).collect::<Result<_, _>>().map_err(|e| e.to_string())
    }

    fn handle(&self, point: &Point) -> Handle {
        let coordinate = |name: &str| {
            let axes = self.plan.axes.iter().zip(&point.values);
            let found = axes.filter(|(axis, _)| axis.key == name).map(|(_, value)| value).next();
            match found {
                Some(Cell::Number(value)) => value.unwrap_or(f64::NAN),
                _ => 0.0,
            }
        };
        let [x, y, z, rx, ry, rz] = POSE_COLUMNS.map(coordinate);
        Handle { position_m: DVec3::new(x, y, z), rotation_rad: DVec3::new(rx, ry, rz) }
    }

    /// Rejects the plan of a scene if a setting, the scene or a plugin is invalid in its first row.
    fn check_first_row(&self) -> Result<(), SweepError> {
        let Subject::Run { scene, folders } = &self.subject else { return Ok(()) };
        let point = Design::new(&self.plan).point(0);
        let scene = self.scene_at(&point, scene)?;
        let options = flotor_session::RunOptions { clock: flotor_servo::Clock::Virtual, seed: point.seed };
        match flotor_session::Session::prepare(&scene, &Registry::search(folders), &options) {
            Err(flotor_session::RunError::Scene(error)) => Err(error.into()),
            Err(flotor_session::RunError::Lookup(error)) => Err(error.into()),
            // Other errors belong to this point, and become its row.
            Ok(_) | Err(_) => Ok(()),
        }
    }
}

fn is_pose(key: &str) -> bool {
    POSE_COLUMNS.contains(&key)
}

fn answered(answer: &Answer) -> Vec<Cell> {
    let wrench = answer.wrench.force_n.into_iter().chain(answer.wrench.torque_nm).map(Cell::number);
    let energy = Cell::number(answer.energy_j.unwrap_or(f64::NAN));
    let words = [Cell::Word(answer.status.name().to_owned()), Cell::Word(String::new())];
    wrench.chain([energy]).chain(words).collect()
}

/// Returns the row of a rejected point: the reason in the last column, the others empty.
fn refused(columns: &[(&str, ColumnKind)], reason: &str) -> Vec<Cell> {
    let empty = |(_, kind): &(&str, ColumnKind)| match kind {
        ColumnKind::Number => Cell::Number(None),
        ColumnKind::Word => Cell::Word(String::new()),
    };
    let mut row: Vec<Cell> = columns.iter().map(empty).collect();
    row.pop();
    row.push(Cell::Word(reason.to_owned()));
    row
}

/// Checks that every axis is a pose column or a parameter of the model.
fn check_model_axes(plan: &Plan, plugin: &Plugin) -> Result<(), SweepError> {
    let point = Design::new(plan).point(0);
    for (axis, value) in plan.axes.iter().zip(point.values) {
        if is_pose(&axis.key) {
            continue;
        }
        Setting::parse(plugin.parameters(), &axis.key, &value.text())
            .map_err(|error| SweepError::Axis { key: axis.key.clone(), problem: error.to_string() })?;
    }
    Ok(())
}

/// Returns the files of a scene's plugins.
fn used_plugins(scene: &Scene, registry: &Registry) -> Result<Vec<PathBuf>, SweepError> {
    let devices = scene.devices.iter().map(|device| (&device.plugin.plugin, PluginKind::Device));
    let models = scene.models.iter().map(|model| (&model.plugin.plugin, PluginKind::Model));
    devices.chain(models).map(|(id, kind)| Ok(registry.load(id, kind)?.metadata().path.clone())).collect()
}

fn digest_file(hash: &mut Xxh3, path: &Path) -> Result<(), SweepError> {
    let bytes = std::fs::read(path).map_err(|cause| SweepError::Plugin { path: path.into(), cause })?;
    hash.update(&bytes);
    Ok(())
}
