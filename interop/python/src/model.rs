//! Python class of a force model.

use crate::error::refuse;
use crate::rows::{InputRow, OutputRow};
use flotor_hal::abi::{CallStatus, PluginKind};
use flotor_hal::{DVec3, ParameterKind};
use flotor_lab::evaluate::{Answer, Details, Evaluation, Handle, Travel};
use flotor_loader::{Plugin, Setting};
use flotor_session::registry::Registry;
use flotor_session::scene::nearest;
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, TryLockError};

/// Parameter of a plugin's schema.
#[pyclass(frozen, get_all, module = "flotor")]
pub(crate) struct Parameter {
    /// Key in scenes and commands.
    id: String,
    /// Unit of the value.
    unit: String,
    /// Description.
    doc: String,
    /// Smallest legal value (None for choices and text).
    min: Option<f64>,
    /// Largest legal value (None for choices and text).
    max: Option<f64>,
    /// Default, a number or a word.
    default: String,
    /// Legal words of a choice; empty for other kinds.
    choices: Vec<String>,
}

#[pymethods]
impl Parameter {
    fn __repr__(&self) -> String {
        let Self { id, min, max, default, choices, .. } = self;
        let unit = if self.unit == "1" { "" } else { &self.unit };
        let range = match (min, max) {
            (Some(min), Some(max)) => format!(", {min} to {max} {unit}").trim_end().to_owned(),
            _ if choices.is_empty() => String::new(),
            _ => format!(", one of {}", choices.join(", ")),
        };
        let default = if default.is_empty() { String::new() } else { format!(", default {default}") };
        format!("Parameter({id}{range}{default})")
    }
}

/// Forces, N, and torques, N·m, one row of three per pose, and energies, J, and statuses, one per pose.
type Columns<'py> =
    (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Vec<&'static str>);

/// A force model. May be shared between threads: calls are serialised.
#[pyclass(frozen, module = "flotor")]
pub(crate) struct Model {
    plugin: Plugin,
    settings: Vec<Setting>,
    instance: Mutex<flotor_loader::Model>,
    /// Id of the process that created the model: a lock held by another thread at an `os.fork()` is never released in the child.
    process: u32,
}

#[pymethods]
impl Model {
    #[new]
    fn new(id: &str, settings: Vec<(String, String)>, folders: Vec<PathBuf>) -> PyResult<Self> {
        let plugin = Registry::search(&folders).load(id, PluginKind::Model).map_err(refuse)?;
        let settings: Result<Vec<Setting>, _> =
            settings.iter().map(|(key, value)| Setting::parse(plugin.parameters(), key, value)).collect();
        let settings = settings.map_err(refuse)?;
        let instance = Mutex::new(plugin.create_model(&settings).map_err(refuse)?);
        Ok(Self { plugin, settings, instance, process: std::process::id() })
    }

    #[getter]
    fn id(&self) -> &str {
        &self.plugin.metadata().id
    }

    #[getter]
    fn version(&self) -> &str {
        &self.plugin.metadata().version
    }

    #[getter]
    fn path(&self) -> PathBuf {
        self.plugin.metadata().path.clone()
    }

    #[getter]
    fn parameters(&self) -> Vec<Parameter> {
        self.plugin.parameters().iter().map(describe).collect()
    }

    /// Returns the current value of a parameter, presets resolved.
    fn parameter(&self, id: &str) -> PyResult<f64> {
        let index = self.plugin.parameters().iter().position(|parameter| parameter.id() == id);
        let index = index.ok_or_else(|| refuse(self.no_parameter(id)))?;
        Ok(self.lock()?.parameter(index))
    }

    fn set_parameter(&self, id: &str, value: &str) -> PyResult<()> {
        let setting = Setting::parse(self.plugin.parameters(), id, value).map_err(refuse)?;
        let mut instance = self.lock()?;
        match instance.set_parameter(setting.index(), setting.value()) {
            CallStatus::Ok => Ok(()),
            CallStatus::Unsupported => Err(refuse(format!(
                "`{id}` cannot change in an existing model; create a new model with this value"
            ))),
            status => Err(refuse(format!("`{id}`: {}", instance.reason(status)))),
        }
    }

    fn reset(&self) -> PyResult<()> {
        self.lock()?.reset();
        Ok(())
    }

    /// Steps through rows in order, in place, with the model's own batch code, without copies and without the GIL.
    fn step_batch(
        &self,
        py: Python<'_>,
        inputs: PyReadonlyArray1<'_, InputRow>,
        mut outputs: PyReadwriteArray1<'_, OutputRow>,
    ) -> PyResult<()> {
        // NumPy accepts any address for a record, with a flag for misaligned data; a slice requires alignment.
        if !(inputs.data().is_aligned() && outputs.data().is_aligned()) {
            return Err(refuse("inputs or outputs are not aligned to 8 bytes; pass a copy of the array"));
        }
        let inputs = InputRow::peel(inputs.as_slice()?);
        // NumPy distinguishes views of one array, but not two arrays on one buffer.
        let [read, written] = [inputs.as_ptr() as usize, outputs.data() as usize];
        let (read_end, written_end) =
            (read + size_of_val(inputs), written + outputs.len() * size_of::<OutputRow>());
        if read < written_end && written < read_end {
            return Err(refuse("inputs and outputs share memory; pass a copy of one of the arrays"));
        }
        let outputs = OutputRow::peel_mut(outputs.as_slice_mut()?);
        if inputs.len() != outputs.len() {
            let (rows, room) = (inputs.len(), outputs.len());
            return Err(refuse(format!(
                "{rows} inputs, but {room} rows for outputs; pass arrays with the same number of rows"
            )));
        }
        py.detach(|| {
            let mut instance = self.lock()?;
            match instance.step_batch(inputs, outputs) {
                CallStatus::Ok => Ok(()),
                status => {
                    Err(refuse(format!("the model `{}` failed: {}", self.id(), instance.reason(status))))
                }
            }
        })
    }

    /// Evaluates poses like `flotor eval`: returns forces, torques, energies (NaN where there is none), statuses.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        poses: PyReadonlyArray2<'py, f64>,
        successive: bool,
    ) -> PyResult<Columns<'py>> {
        let poses = poses.as_array();
        if poses.ncols() != 6 {
            return Err(refuse(format!(
                "poses have {} columns; pass six columns x_m, y_m, z_m, rx_rad, ry_rad, rz_rad",
                poses.ncols()
            )));
        }
        let handles: Vec<Handle> = poses
            .rows()
            .into_iter()
            .map(|row| Handle {
                position_m: DVec3::new(row[0], row[1], row[2]),
                rotation_rad: DVec3::new(row[3], row[4], row[5]),
            })
            .collect();
        let travel = if successive { Travel::Successive } else { Travel::FromHome };
        // Separate instances: the result does not depend on earlier steps.
        let evaluation =
            Evaluation { plugin: &self.plugin, settings: &self.settings, travel, details: Details::Omitted };
        let answers = py.detach(|| evaluation.answers(&handles, &|| ())).map_err(refuse)?;
        Ok(columns(py, &answers))
    }

    fn __repr__(&self) -> String {
        format!("Model({:?}, version {}, {})", self.id(), self.version(), self.path().display())
    }
}

impl Model {
    /// Returns the error about an unknown parameter, with the most similar one.
    fn no_parameter(&self, id: &str) -> String {
        let known = self.plugin.parameters().iter().map(|parameter| parameter.id());
        let hint = nearest(id, known)
            .map_or("`parameters` lists the parameters".to_owned(), |near| format!("did you mean `{near}`?"));
        format!("`{}` has no parameter `{id}`; {hint}", self.id())
    }

    /// Locks the model. Ignores poisoning: the contract reports panics of a model as a status. In a child of `os.fork()` an error
    /// instead of a wait.
    fn lock(&self) -> PyResult<MutexGuard<'_, flotor_loader::Model>> {
        if self.process == std::process::id() {
            return Ok(flotor_core::lock(&self.instance));
        }
        match self.instance.try_lock() {
            Ok(instance) => Ok(instance),
            Err(TryLockError::Poisoned(poisoned)) => Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => Err(refuse(
                "another thread holds this model, which was created before the process was forked; create a new model in this process, \
                 or use the start method \"spawn\" of multiprocessing",
            )),
        }
    }
}

fn columns<'py>(py: Python<'py>, answers: &[Answer]) -> Columns<'py> {
    let count = answers.len();
    let three = |of: fn(&Answer) -> [f64; 3]| {
        let flat: Vec<f64> = answers.iter().flat_map(of).collect();
        numpy::ndarray::Array2::from_shape_vec((count, 3), flat)
            .unwrap_or_else(|_| numpy::ndarray::Array2::zeros((0, 3)))
            .into_pyarray(py)
    };
    let energies: Vec<f64> = answers.iter().map(|answer| answer.energy_j.unwrap_or(f64::NAN)).collect();
    let statuses = answers.iter().map(|answer| answer.status.name()).collect();
    let (forces, torques) = (three(|a| a.wrench.force_n), three(|a| a.wrench.torque_nm));
    (forces, torques, energies.into_pyarray(py), statuses)
}

fn describe(parameter: &flotor_hal::Parameter) -> Parameter {
    let choices: Vec<String> = parameter.choices().iter().map(|c| c.as_str().to_owned()).collect();
    let is_number = matches!(parameter.kind(), ParameterKind::Real);
    let default = match parameter.kind() {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a checked index of a few choices
        ParameterKind::Choice => choices.get(parameter.default() as usize).cloned().unwrap_or_default(),
        ParameterKind::Real => parameter.default().to_string(),
        ParameterKind::Text | ParameterKind::File => String::new(),
    };
    Parameter {
        id: parameter.id().to_owned(),
        unit: parameter.unit().to_owned(),
        doc: parameter.doc().to_owned(),
        min: is_number.then(|| parameter.min()),
        max: is_number.then(|| parameter.max()),
        default,
        choices,
    }
}
