//! Native part of the Python package `flotor`; `python/flotor` contains the public interface.
//!
//! - [`rows`]: the contract's structs as NumPy records, so that arrays are passed without copies.
//! - [`model`]: a force model, in batches or at single poses as `flotor eval` does.
//! - [`scene`]: scenes from Python; [`run`]: whole runs in virtual time; [`ending`]: the end of a run, as of the command line.
//! - [`open_run`]: runs that a program is part of, live or in lockstep; [`state`]: the newest state of a device;
//!   [`joined`]: runs of other programs.
//! - [`environments`]: many runs in lockstep, stepped by one call.
//! - [`recording`]: recordings as columns.
//! - [`sweep`]: tasks of a sweep, for any executor.

mod ending;
mod environments;
mod error;
mod joined;
mod model;
mod open_run;
mod recording;
mod rows;
mod run;
mod scene;
mod state;
mod sweep;

use pyo3::prelude::*;

/// Native module of the package; documented in `_flotor.pyi`.
#[pymodule]
mod _flotor {
    #[pymodule_export]
    use crate::environments::Environments;
    #[pymodule_export]
    use crate::error::FlotorError;
    #[pymodule_export]
    use crate::joined::JoinedRun;
    #[pymodule_export]
    use crate::model::{Model, Parameter};
    #[pymodule_export]
    use crate::open_run::enter_program;
    #[pymodule_export]
    use crate::open_run::{OpenRun, SavedState};
    #[pymodule_export]
    use crate::recording::read_recording;
    #[pymodule_export]
    use crate::rows::{input_dtype, output_dtype};
    #[pymodule_export]
    use crate::run::{plugins, run_scene};
    #[pymodule_export]
    use crate::state::State;
    #[pymodule_export]
    use crate::sweep::Sweep;
    use flotor_core::trace::Events;
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        // Of an error that no run has raised.
        module.getattr("FlotorError")?.setattr("exit_code", 1)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("EVENTS", PyTuple::new(module.py(), Events::NAMES)?)
    }
}
