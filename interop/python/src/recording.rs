//! Recordings as columns for Python.

use crate::error::refuse;
use flotor_core::trace::TickRecord;
use flotor_record::{Ending, Recording};
use numpy::IntoPyArray;
use numpy::ndarray::Array2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// Reads a recording; returns a dictionary of arrays, one row per tick, and true if the recording is complete.
#[pyfunction]
pub(crate) fn read_recording(py: Python<'_>, path: PathBuf) -> PyResult<(Bound<'_, PyDict>, bool)> {
    let (records, ending) = py
        .detach(|| {
            let recording = Recording::open(&path)?;
            let ending = recording.ending();
            recording.collect::<Result<Vec<TickRecord>, _>>().map(|records| (records, ending))
        })
        .map_err(refuse)?;
    let columns = PyDict::new(py);
    let whole = |of: fn(&TickRecord) -> u64| records.iter().map(of).collect::<Vec<_>>().into_pyarray(py);
    columns.set_item("tick", whole(|r| r.tick))?;
    columns.set_item("time_ns", whole(|r| r.time_ns))?;
    columns.set_item("dt_ns", whole(|r| r.dt_ns))?;
    matrix(&columns, &records, "position_m", |r| r.pose.position_m)?;
    matrix(&columns, &records, "orientation_xyzw", |r| r.pose.orientation_xyzw)?;
    matrix(&columns, &records, "linear_m_per_s", |r| r.twist.linear_m_per_s)?;
    matrix(&columns, &records, "angular_rad_per_s", |r| r.twist.angular_rad_per_s)?;
    for (wrench, force, torque) in
        [(0, "commanded_force_n", "commanded_torque_nm"), (1, "delivered_force_n", "delivered_torque_nm")]
    {
        let pick = move |r: &TickRecord| [r.commanded, r.delivered][wrench];
        matrix(&columns, &records, force, move |r| pick(r).force_n)?;
        matrix(&columns, &records, torque, move |r| pick(r).torque_nm)?;
    }
    matrix(&columns, &records, "model_force_n", |r| r.model.force().to_array())?;
    // Columns of computed outputs only; NaN in ticks without a value.
    if records.iter().any(|r| r.model.torque().is_some()) {
        let torque_nm = |r: &TickRecord| r.model.torque().map_or([f64::NAN; 3], |torque| torque.to_array());
        matrix(&columns, &records, "model_torque_nm", torque_nm)?;
    }
    if records.iter().any(|r| r.model.energy_j().is_some()) {
        let energy_j: Vec<f64> = records.iter().map(|r| r.model.energy_j().unwrap_or(f64::NAN)).collect();
        columns.set_item("energy_j", energy_j.into_pyarray(py))?;
    }
    let events: Vec<u32> = records.iter().map(|r| r.events.bits()).collect();
    columns.set_item("events", events.into_pyarray(py))?;
    columns.set_item("lateness_ns", whole(|r| r.lateness_ns))?;
    columns.set_item("compute_ns", whole(|r| r.compute_ns))?;
    Ok((columns, ending == Ending::Finished))
}

fn matrix<const N: usize>(
    columns: &Bound<'_, PyDict>,
    records: &[TickRecord],
    name: &str,
    of: impl Fn(&TickRecord) -> [f64; N],
) -> PyResult<()> {
    let flat: Vec<f64> = records.iter().flat_map(of).collect();
    let matrix = Array2::from_shape_vec((records.len(), N), flat).map_err(refuse)?;
    columns.set_item(name, matrix.into_pyarray(columns.py()))
}
