//! Native part of the Python package `flotor`; `python/flotor` contains the public interface.
//!
//! - [`rows`]: the contract's structs as NumPy records, so that arrays are passed without copies.
//! - [`model`]: a force model, in batches or at single poses as `flotor eval` does.
//! - [`run`]: scenes in virtual time.
//! - [`recording`]: recordings as columns.
//! - [`sweep`]: tasks of a sweep, for any executor.

mod error;
mod model;
mod recording;
mod rows;
mod run;
mod sweep;

use pyo3::prelude::*;

/// Native module of the package; documented in `_flotor.pyi`.
#[pymodule]
mod _flotor {
    #[pymodule_export]
    use crate::error::FlotorError;
    #[pymodule_export]
    use crate::model::{Model, Parameter};
    #[pymodule_export]
    use crate::recording::read_recording;
    #[pymodule_export]
    use crate::rows::{input_dtype, output_dtype};
    #[pymodule_export]
    use crate::run::{plugins, run_scene};
    #[pymodule_export]
    use crate::sweep::Sweep;
    use flotor_core::trace::Events;
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("EVENTS", PyTuple::new(module.py(), Events::NAMES)?)
    }
}
