//! Many runs in lockstep, stepped by one call on all cores: environments of reinforcement learning.

use crate::error::{refuse, refuse_run};
use crate::scene::GivenScene;
use flotor_core::trace::TickRecord;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::scene::Scene;
use flotor_session::{Controls, LiveNumbers, Lockstep, Observer, RunOptions, SavedRun, Session};
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::sync::Mutex;

/// Numbers of an observation: position (m), velocity (m/s), and force on the hand (N), each along x, y, z.
const OBSERVED: usize = 9;
/// Live parameters of the device that an action sets: the position at which the hand aims, mm.
const AIMS: [&str; 3] = ["hand_target_x_mm", "hand_target_y_mm", "hand_target_z_mm"];
/// Largest number of runs: each has its devices and models.
const MOST: usize = 4096;

/// Runs of one scene, in lockstep. The hand of the first device follows the actions.
#[pyclass(frozen, module = "flotor")]
pub(crate) struct Environments(Mutex<Vec<Environment>>);

/// One run with the state before its first tick.
struct Environment {
    run: Lockstep,
    controls: Controls,
    aims: LiveNumbers,
    start: SavedRun,
    newest: Newest,
}

/// Observer that keeps the newest record of the first device.
#[derive(Default)]
struct Newest(Option<TickRecord>);

impl Observer for Newest {
    fn observe(&mut self, record: &TickRecord) {
        if record.device == 0 {
            self.0 = Some(*record);
        }
    }

    fn reads_changes(&self) -> bool {
        false
    }
}

#[pymethods]
impl Environments {
    /// Prepares `count` runs of a scene, and saves the state before the first tick of each.
    #[new]
    fn new(py: Python<'_>, given: GivenScene, count: usize) -> PyResult<Self> {
        if !(1..=MOST).contains(&count) {
            return Err(refuse(format!("num_envs = {count}: must be 1 to {MOST}")));
        }
        py.detach(|| {
            let (scene, registry, seed) = given.read()?;
            let options = RunOptions { clock: Clock::Virtual, seed };
            let prepare = |_| {
                let session = Session::prepare(&scene, &registry, &options).map_err(refuse_run)?;
                Environment::new(&scene, session)
            };
            Ok(Self(Mutex::new((0..count).map(prepare).collect::<PyResult<_>>()?)))
        })
    }

    /// Moves the aims of the hands to `actions` (n, 3), m, and runs `ticks` ticks of each run; writes the observations (n, 9).
    fn step(
        &self,
        py: Python<'_>,
        actions: PyReadonlyArray2<'_, f64>,
        ticks: u64,
        mut observations: PyReadwriteArray2<'_, f64>,
    ) -> PyResult<()> {
        let (aims, rows) = (actions.as_slice()?, observations.as_slice_mut()?);
        py.detach(|| {
            let mut environments = flotor_core::lock(&self.0);
            check(environments.len(), (aims.len(), 3), rows.len())?;
            let step = |(environment, (aim, row)): (&mut Environment, (&[f64], &mut [f64]))| {
                environment.step(aim, ticks, row)
            };
            let rows = aims.par_chunks_exact(3).zip(rows.par_chunks_exact_mut(OBSERVED));
            environments.par_iter_mut().zip(rows).try_for_each(step)
        })
    }

    /// Restores the state before the first tick of the runs with `which` (n,), and writes their observations (n, 9).
    fn reset(
        &self,
        py: Python<'_>,
        which: PyReadonlyArray1<'_, bool>,
        mut observations: PyReadwriteArray2<'_, f64>,
    ) -> PyResult<()> {
        let (which, rows) = (which.as_slice()?, observations.as_slice_mut()?);
        py.detach(|| {
            let mut environments = flotor_core::lock(&self.0);
            check(environments.len(), (which.len(), 1), rows.len())?;
            let rows = which.par_iter().zip(rows.par_chunks_exact_mut(OBSERVED));
            let reset = |(environment, (is_meant, row)): (&mut Environment, (&bool, &mut [f64]))| {
                if *is_meant { environment.reset(row) } else { Ok(()) }
            };
            environments.par_iter_mut().zip(rows).try_for_each(reset)
        })
    }
}

/// Checks the lengths of arrays: of the given numbers, `width` for each run, and of the observations.
fn check(runs: usize, (given, width): (usize, usize), observed: usize) -> PyResult<()> {
    if (given, observed) == (runs * width, runs * OBSERVED) {
        return Ok(());
    }
    Err(refuse(format!(
        "the arrays have {given} and {observed} numbers, but {runs} runs need {} and {}",
        runs * width,
        runs * OBSERVED
    )))
}

impl Environment {
    fn new(scene: &Scene, session: Session) -> PyResult<Self> {
        let controls = session.controls();
        let device = scene.devices.first().map_or("", |device| &device.name);
        let aims = controls.numbers(&AIMS.map(|id| (device, id))).map_err(refuse)?;
        let mut run = session.into_lockstep().map_err(refuse_run)?;
        let start = run.save().map_err(refuse_run)?;
        Ok(Self { run, controls, aims, start, newest: Newest::default() })
    }

    fn step(&mut self, aim_m: &[f64], ticks: u64, row: &mut [f64]) -> PyResult<()> {
        let aims_mm: Vec<f64> = aim_m.iter().map(|metre| metre * 1.0e3).collect();
        self.controls.set_numbers(&self.aims, &aims_mm).map_err(refuse)?;
        if let Some(end) = self.run.advance_by(ticks, &mut self.newest, &StopSwitch::default()) {
            return Err(refuse(format!("the run has ended: {}; reset it", end.word())));
        }
        self.observe(row);
        Ok(())
    }

    fn reset(&mut self, row: &mut [f64]) -> PyResult<()> {
        self.run.restore(&self.start).map_err(refuse_run)?;
        self.newest.0 = None;
        self.observe(row);
        Ok(())
    }

    /// Writes the observation: at the start the handle is at rest at home.
    fn observe(&self, row: &mut [f64]) {
        let Some(record) = &self.newest.0 else { return row.fill(0.0) };
        let numbers = [record.pose.position_m, record.twist.linear_m_per_s, record.commanded.force_n];
        row.iter_mut().zip(numbers.as_flattened()).for_each(|(to, number)| *to = *number);
    }
}
