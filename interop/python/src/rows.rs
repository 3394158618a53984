//! The contract's step structs as NumPy records: an array of records has the memory layout of the slice that a model steps through.

#![allow(unsafe_code)] // listed in tests/tests/system/architecture.rs

use flotor_hal::{Input, Output};
use numpy::{Element, PyArrayDescr, PyArrayDescrMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyList};
use std::mem::offset_of;

/// Element of an array of inputs.
#[repr(transparent)]
#[derive(Clone, Copy)]
pub(crate) struct InputRow(Input);

/// Element of an array of outputs.
#[repr(transparent)]
#[derive(Clone, Copy)]
pub(crate) struct OutputRow(Output);

impl InputRow {
    /// Views the rows as the contract's structs.
    pub(crate) fn peel(rows: &[InputRow]) -> &[Input] {
        // SAFETY: `InputRow` is `repr(transparent)` over `Input`, so layout, length and lifetime are the same.
        unsafe { std::slice::from_raw_parts(rows.as_ptr().cast(), rows.len()) }
    }
}

impl OutputRow {
    /// Views the rows as the contract's structs.
    pub(crate) fn peel_mut(rows: &mut [OutputRow]) -> &mut [Output] {
        // SAFETY: `OutputRow` is `repr(transparent)` over `Output`; the borrow stays exclusive.
        unsafe { std::slice::from_raw_parts_mut(rows.as_mut_ptr().cast(), rows.len()) }
    }
}

// SAFETY: the dtype below gives every field of `Input` its offset and size and the struct its size; all fields are
// numbers for which any bits are valid; no field is a Python object.
unsafe impl Element for InputRow {
    const IS_COPY: bool = true;

    fn get_dtype(py: Python<'_>) -> Bound<'_, PyArrayDescr> {
        static DTYPE: PyOnceLock<Py<PyArrayDescr>> = PyOnceLock::new();
        let pose = offset_of!(Input, pose);
        let twist = offset_of!(Input, twist);
        let fields = [
            ("position_m", "(3,)f8", pose),
            ("orientation_xyzw", "(4,)f8", pose + 24),
            ("linear_m_per_s", "(3,)f8", twist),
            ("angular_rad_per_s", "(3,)f8", twist + 24),
            ("time_ns", "u8", offset_of!(Input, time_ns)),
            ("dt_ns", "u8", offset_of!(Input, dt_ns)),
            ("tick", "u8", offset_of!(Input, tick)),
            ("buttons", "u4", offset_of!(Input, buttons)),
            ("demand", "u4", offset_of!(Input, demand)),
        ];
        record(py, &DTYPE, &fields, size_of::<Input>())
    }

    fn clone_ref(&self, _py: Python<'_>) -> Self {
        *self
    }
}

// SAFETY: as for `InputRow`: the last two numbers of `Output` are two `u32` that follow the energy.
unsafe impl Element for OutputRow {
    const IS_COPY: bool = true;

    fn get_dtype(py: Python<'_>) -> Bound<'_, PyArrayDescr> {
        static DTYPE: PyOnceLock<Py<PyArrayDescr>> = PyOnceLock::new();
        let (wrench, energy) = (offset_of!(Output, wrench), offset_of!(Output, energy_j));
        let fields = [
            ("force_n", "(3,)f8", wrench),
            ("torque_nm", "(3,)f8", wrench + 24),
            ("energy_j", "f8", energy),
            ("status", "u4", energy + 8),
            ("reserved", "u4", energy + 12),
        ];
        record(py, &DTYPE, &fields, size_of::<Output>())
    }

    fn clone_ref(&self, _py: Python<'_>) -> Self {
        *self
    }
}

/// Returns a NumPy record dtype, created once from names, formats and offsets of its fields.
fn record<'py>(
    py: Python<'py>,
    once: &'static PyOnceLock<Py<PyArrayDescr>>,
    fields: &[(&str, &str, usize)],
    size_bytes: usize,
) -> Bound<'py, PyArrayDescr> {
    let make = || -> PyResult<Py<PyArrayDescr>> {
        let names = PyList::new(py, fields.iter().map(|field| field.0))?;
        let formats = PyList::new(py, fields.iter().map(|field| field.1))?;
        let offsets = PyList::new(py, fields.iter().map(|field| field.2))?;
        let layout = PyDict::new(py);
        layout.set_item("names", names)?;
        layout.set_item("formats", formats)?;
        layout.set_item("offsets", offsets)?;
        layout.set_item("itemsize", size_bytes)?;
        // Then NumPy lays out arrays like the structs, and detects misaligned ones.
        layout.set_item("aligned", true)?;
        let dtype = PyArrayDescr::new(py, layout)?;
        assert_eq!(dtype.itemsize(), size_bytes, "NumPy read the record layout differently");
        assert_eq!(dtype.alignment(), align_of::<Input>(), "NumPy aligns the record differently");
        Ok(dtype.unbind())
    };
    let dtype = once.get_or_try_init(py, make);
    dtype.expect("a constant layout that NumPy accepts").bind(py).clone()
}

/// Returns the `numpy.dtype` of a row of `Model.step_batch`'s inputs.
#[pyfunction]
pub(crate) fn input_dtype(py: Python<'_>) -> Bound<'_, PyArrayDescr> {
    InputRow::get_dtype(py)
}

/// Returns the `numpy.dtype` of a row of `Model.step_batch`'s outputs.
#[pyfunction]
pub(crate) fn output_dtype(py: Python<'_>) -> Bound<'_, PyArrayDescr> {
    OutputRow::get_dtype(py)
}
