//! Bar of gel. Its forces come from a solver in another language and another process, too slow for the loop.

use flotor_hal::{
    Contact, ContactSet, ContactSetModel, DVec3, ForceModel, Input, ModelInfo, Output, Parameter, Refusal,
    SetParameterError, Settings, StepStatus, Wrench,
};
use std::io::{self, BufRead, BufReader, Write};
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::process::{Child, Command};
use std::time::Duration;

/// Source of the solver, embedded in the plugin file.
const SOLVER: &str = include_str!("solver.py");
/// Timeout for the start of Python.
const START: Duration = Duration::from_secs(5);
/// Timeout of a reply. A process that hangs must not block the calling thread.
const PATIENCE: Duration = Duration::from_millis(500);
/// Largest compression passed to the solver, m. Below this depth the stiffness is constant.
const DEEPEST_M: f64 = 0.012;
/// Range of validity of a contact around its anchor, m: within it the stiffness changes by less than a tenth.
const VALID_M: f64 = 0.0005;

struct Gel {
    shear_modulus_pa: f64,
    solver: Asking,
}

/// State of the solver.
enum Asking {
    NotYet,
    Running(Solver),
    /// The solver did not start, timed out, or sent an invalid reply. It gets no further requests: a reply could belong to an
    /// earlier request.
    Failed,
}

impl ForceModel for Gel {
    const INFO: ModelInfo = ModelInfo::new("gel", "Gel", "A bar of gel, computed by a solver in Python");
    const PARAMETERS: &'static [Parameter] =
        &[Parameter::real("shear_modulus_pa", "Pa", 100.0, 1.0e5, 5000.0, "Shear modulus at the top").live()];

    fn create(settings: &Settings<'_>) -> Result<Self, Refusal> {
        Ok(Self { shear_modulus_pa: settings.number_or_default("shear_modulus_pa"), solver: Asking::NotYet })
    }

    /// Returns no force, with the status `OutOfDomain`: the solver is too slow for the loop.
    fn step(&mut self, input: &Input) -> Output {
        let is_finite = input.pose.is_finite();
        let status = if is_finite { StepStatus::OutOfDomain } else { StepStatus::InvalidInput };
        Output::new(Wrench::ZERO, f64::NAN, status)
    }

    fn set_parameter(&mut self, _index: usize, value: f64) -> Result<(), SetParameterError> {
        self.shear_modulus_pa = value;
        Ok(())
    }

    fn parameter(&self, _index: usize) -> f64 {
        self.shear_modulus_pa
    }
}

impl ContactSetModel for Gel {
    /// Returns the plane whose spring has force and stiffness of the gel at this depth; above the gel, its surface.
    fn contact_set(&mut self, input: &Input) -> ContactSet {
        let height_m = input.pose.position().z;
        if !input.pose.is_finite() {
            return ContactSet::NONE;
        }
        let depth_m = (-height_m).clamp(0.0, DEEPEST_M);
        // NaN: the host refuses the contact, and its summary names this model.
        let [force_n, stiffness_n_per_m] = self.solve(depth_m).unwrap_or([f64::NAN; 2]);
        let gap_m = height_m + depth_m - force_n / stiffness_n_per_m;
        let contact = Contact::of_handle(input, DVec3::Z, gap_m, stiffness_n_per_m);
        ContactSet { valid_m: VALID_M, ..ContactSet::at(input).with(contact) }
    }
}
flotor_hal::export_model!(Gel, contact_set);

impl Gel {
    /// Returns force, N, and stiffness, N/m, at a depth. The first call starts the solver and waits for it.
    fn solve(&mut self, depth_m: f64) -> Option<[f64; 2]> {
        if let Asking::NotYet = self.solver {
            self.solver = Solver::start().map_or(Asking::Failed, Asking::Running);
        }
        let Asking::Running(solver) = &mut self.solver else { return None };
        let answer = solver.answer(depth_m, self.shear_modulus_pa).ok();
        if answer.is_none() {
            self.solver = Asking::Failed;
        }
        answer
    }
}

/// Solver process that replies to each line with a line.
struct Solver {
    process: Child,
    answers: BufReader<UnixStream>,
    line: String,
}

impl Solver {
    fn start() -> io::Result<Self> {
        let (ours, theirs) = UnixStream::pair()?;
        ours.set_read_timeout(Some(START))?;
        ours.set_write_timeout(Some(PATIENCE))?;
        let mut python = Command::new("python3");
        python.args(["-c", SOLVER]).stdin(OwnedFd::from(theirs.try_clone()?)).stdout(OwnedFd::from(theirs));
        let mut solver =
            Self { process: python.spawn()?, answers: BufReader::new(ours), line: String::new() };
        solver.answer(0.0, 1.0)?;
        solver.answers.get_ref().set_read_timeout(Some(PATIENCE))?;
        Ok(solver)
    }

    fn answer(&mut self, depth_m: f64, modulus_pa: f64) -> io::Result<[f64; 2]> {
        writeln!(self.answers.get_mut(), "{depth_m:e} {modulus_pa:e}")?;
        self.line.clear();
        self.answers.read_line(&mut self.line)?;
        let mut numbers = self.line.split_whitespace().map(str::parse);
        match (numbers.next(), numbers.next()) {
            (Some(Ok(force_n)), Some(Ok(stiffness_n_per_m))) => Ok([force_n, stiffness_n_per_m]),
            _ => Err(io::ErrorKind::InvalidData.into()),
        }
    }
}

impl Drop for Solver {
    fn drop(&mut self) {
        let _ = self.process.kill(); // it may have ended already
        let _ = self.process.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_hal::{DQuat, Pose};

    fn gel() -> Gel {
        Gel { shear_modulus_pa: 5000.0, solver: Asking::NotYet }
    }

    fn at(z_m: f64) -> Input {
        Input::at_rest(Pose::new(DVec3::Z * z_m, DQuat::IDENTITY))
    }

    /// Compression of the bar under a force: each element by bisection of its own law.
    fn depth_m(force_n: f64, modulus_pa: f64) -> f64 {
        let element = |i: u8| {
            let pressure = force_n / 4.0e-4 / (modulus_pa * (2.0 - (f64::from(i) + 0.5) / 20.0));
            let (mut low, mut high) = (0.1, 1.0_f64);
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if middle.powi(-2) - middle > pressure { low = middle } else { high = middle }
            }
            (1.0 - low) * 0.03 / 20.0
        };
        (0..20).map(element).sum()
    }

    /// Force and stiffness of the contact with the handle where the set was computed.
    fn felt(gel: &mut Gel, z_m: f64) -> [f64; 2] {
        let contact = gel.contact_set(&at(z_m)).contacts[0];
        [-contact.gap_m * contact.stiffness_n_per_m, contact.stiffness_n_per_m]
    }

    #[test]
    fn the_solver_finds_the_force_of_elements_in_series() {
        let mut gel = gel();
        for z_m in [-0.0005, -0.004, -0.012] {
            let [force_n, _] = felt(&mut gel, z_m);
            assert!((depth_m(force_n, 5000.0) + z_m).abs() < 1.0e-9, "{force_n} N at {z_m} m");
        }
    }

    #[test]
    fn a_contact_is_near_the_solver_as_far_as_it_says() {
        let mut gel = gel();
        let [force_n, stiffness_n_per_m] = felt(&mut gel, -0.004);
        for z_m in [-0.0045, -0.0035] {
            let there_n = force_n - stiffness_n_per_m * (z_m + 0.004);
            let [exact_n, _] = felt(&mut gel, z_m);
            // The slope changes by less than a tenth, so the force is off by less than a twentieth of its change.
            assert!((there_n - exact_n).abs() < 0.05 * (exact_n - force_n).abs(), "{there_n} {exact_n}");
        }
        assert_eq!(gel.contact_set(&at(0.001)).contacts[0].gap_m, 0.001);
    }

    #[test]
    fn a_solver_that_has_died_gives_no_number() {
        let mut gel = gel();
        let _ = gel.contact_set(&at(-0.004));
        let Asking::Running(solver) = &mut gel.solver else { panic!("it was asked") };
        solver.process.kill().expect("it runs");
        solver.process.wait().expect("it ends");
        assert!(gel.contact_set(&at(-0.004)).contacts[0].stiffness_n_per_m.is_nan());
    }
}
