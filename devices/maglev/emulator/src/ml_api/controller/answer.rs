//! Execution of the clients' requests: queries, settings, procedures.

use super::machine::{Command, Controller, Flight, narrow, vector};
use super::procedure::ProcedureId;
use flotor_maglev::ml_api::{
    Axis, AxisMode, AxisValues, Cell, Function, GainSet, Pid, Reply, Request, Results, Status, Version,
    WirePose,
};

/// Version of the controller.
const VERSION: &[u8] = b"1.5b-flotor";
/// Slowest and fastest servo rate, Hz.
const SERVO_HZ: [f32; 2] = [100.0, 10_000.0];
/// Largest voltage of the spare output, V.
const AUX_LIMIT_V: f32 = 10.0;
/// Range of a position sensor, m.
const CELL_LIMIT_M: f32 = 9.0e-3;

/// Reply to a request, or the procedure whose end produces the reply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Answer {
    /// An immediate reply.
    Now(Reply),
    /// The reply of a procedure, at its end.
    When(ProcedureId),
}

impl Controller {
    /// Executes a request. Requests about connections (disconnecting, callbacks) are handled by the server; the
    /// controller only acknowledges them.
    pub fn answer(&mut self, request: &Request) -> Answer {
        match *request {
            Request::Plain(Function::FindGravity) => self.find_gravity(),
            Request::Plain(Function::Land) => self.land_for_a_client(),
            Request::Plain(Function::Takeoff) => self.take_off_for_a_client(),
            Request::OfSet(Function::ResetGainVecAxes, set) => Answer::When(self.begin_reset(set)),
            Request::Plain(function) => Answer::Now(match self.look_up(function) {
                Some(results) => Reply::ok(results),
                None => Reply::status(self.act(function)),
            }),
            Request::OfAxis(Function::GetForceAxis, axis) => {
                Answer::Now(Reply::ok(Results::Number(self.forces()[axis as usize])))
            }
            Request::OfSet(_, set) => Answer::Now(Reply::ok(Results::Gains(*self.gains.set(set)))),
            Request::GetGainVecAxis(set, axis) => {
                Answer::Now(Reply::ok(Results::Pid(self.gains.of(set, axis))))
            }
            Request::GetGainVecSingle(set, axis, gain) => {
                Answer::Now(Reply::ok(Results::Number(self.gains.one(set, axis, gain))))
            }
            _ => Answer::Now(Reply::status(self.set(request))),
        }
    }

    fn refused(function: Function, status: Status) -> Answer {
        Answer::Now(Reply::failed(Some(function), status))
    }

    fn take_off_for_a_client(&mut self) -> Answer {
        match self.flight {
            _ if !self.faults.is_empty() => Self::refused(Function::Takeoff, self.cause_status()),
            // Allowed from any height, also during a landing.
            Flight::Landed | Flight::Landing => Answer::When(self.begin_take_off()),
            Flight::TakingOff | Flight::Flying => Self::refused(Function::Takeoff, Status::TAKEN_OFF),
        }
    }

    fn land_for_a_client(&mut self) -> Answer {
        match self.flight {
            Flight::Landed => Self::refused(Function::Land, Status::LANDED),
            // A second request waits for the landing in progress.
            Flight::Landing => match self.procedure {
                Some((landing, _)) => Answer::When(landing),
                None => Answer::When(self.begin_landing()),
            },
            Flight::TakingOff | Flight::Flying => Answer::When(self.begin_landing()),
        }
    }

    fn find_gravity(&mut self) -> Answer {
        match self.flight {
            Flight::Flying => Answer::When(self.begin_search()),
            _ => Self::refused(Function::FindGravity, Status::LANDED),
        }
    }

    /// Returns the applied wrench in the wire format.
    fn forces(&self) -> AxisValues {
        let applied = self.applied();
        narrow(applied.force(), applied.torque())
    }

    fn look_up(&self, function: Function) -> Option<Results> {
        let desired = WirePose { out_of_range: false, at: self.desired_told() };
        Some(match function {
            Function::GetActualPosition => Results::Pose(self.pose()),
            Function::GetAxisModes => Results::Modes(self.modes),
            Function::GetBoundaryRadius => Results::Number(self.boundary_radius_m),
            Function::GetButtonStatus => Results::Buttons(self.buttons()),
            Function::GetCellPosition if self.pose().out_of_range => Results::Cells([Cell::default(); 3]),
            Function::GetCellPosition => Results::Cells(self.coils.cells(&self.sample.pose)),
            Function::GetCurrentLimits => Results::AxisValues(self.coils.limits_a),
            Function::GetCurrents => Results::AxisValues(self.currents_a()),
            Function::GetDesiredPosition => Results::Pose(desired),
            Function::GetFault => Results::Fault(self.faults),
            Function::GetForces => Results::AxisValues(self.forces()),
            Function::GetFrame => Results::Pose(WirePose { out_of_range: false, at: self.frame }),
            Function::GetGainVecGrasp => Results::Pid(self.grasp.gains),
            Function::GetGraspCurrent => Results::Number(self.grasp.current_a),
            Function::GetGraspCurrentLimit => Results::Number(self.grasp.limit_a),
            Function::GetGravity => Results::AxisValues(self.gravity),
            Function::GetLatCellLimit => Results::Number(CELL_LIMIT_M),
            Function::GetLatCellOffset => Results::CellOffsets(self.cell_offsets),
            Function::GetRawCellData => Results::Voltages(self.coils.voltages(&self.sample.pose)),
            Function::GetServoFrequency => Results::Number(self.servo_hz),
            Function::GetSpeedLimits => Results::AxisValues(self.speed_limits),
            Function::GetTemp => Results::AxisValues(self.temperatures_c()),
            Function::GetVelocity => Results::AxisValues(self.velocity()),
            Function::GetVersion => Results::Version(Version::new(VERSION)),
            _ => return None,
        })
    }

    #[allow(clippy::cast_possible_truncation)] // the wire format is f32
    fn currents_a(&self) -> AxisValues {
        match self.command {
            Command::Currents(currents_a) if self.faults.is_empty() => currents_a,
            _ => self.coils.driven(&self.wanted()).0.map(|current| current as f32),
        }
    }

    /// Returns the desired position, clamped to the ranges of constrained axes.
    fn desired_told(&self) -> AxisValues {
        let mut told = self.desired_told;
        for axis in Axis::ALL {
            let [least, most] = self.ranges[axis as usize];
            if self.modes[axis as usize] == AxisMode::Constrained {
                told[axis as usize] = told[axis as usize].max(least).min(most);
            }
        }
        told
    }

    /// Executes a function with neither arguments nor results.
    fn act(&mut self, function: Function) -> Status {
        match function {
            Function::DefyGravity => {
                let carried = Axis::ALL.map(|axis| {
                    let ff = self.gravity[axis as usize];
                    (axis, Pid { ff, ..self.gains.of(GainSet::Normal, axis) })
                });
                self.gains.take(GainSet::Normal, &carried)
            }
            Function::ResetFault => {
                let left = self.causes();
                if left != self.faults {
                    self.set_faults(left);
                }
                if left.is_empty() { Status::OK } else { self.cause_status() }
            }
            Function::Shutdown => {
                self.end_procedure(Status::OFF_LINE);
                self.end_resets(Status::OFF_LINE, |_| true);
                let mut anew = Self::new(self.config);
                // Calls waiting for a procedure still get their reply.
                (anew.finished, anew.last_procedure_id) =
                    (std::mem::take(&mut self.finished), self.last_procedure_id);
                anew.injected = self.injected;
                anew.observe(&self.sample);
                *self = anew;
                Status::OK
            }
            _ => Status::OK,
        }
    }

    fn set(&mut self, request: &Request) -> Status {
        let moves = is_command(request.function());
        let drives =
            moves && !matches!(request.function(), Function::SetDesiredPosition | Function::SetVelocity);
        match self.flight {
            Flight::TakingOff | Flight::Landing if moves => return Status::OFF_LINE,
            // After a landing, forces and currents are rejected: a program that continues must not lift the flotor open-loop.
            Flight::Landed if drives => return Status::LANDED,
            _ => {}
        }
        match *request {
            Request::ConstrainAxis { axis, range: range @ [least, most] } => {
                if !(least.is_finite() && most.is_finite() && least <= most) {
                    return Status::POSITION;
                }
                self.ranges[axis as usize] = range;
                self.modes[axis as usize] = AxisMode::Constrained;
                Status::OK
            }
            Request::OfAxis(Function::LockAxis, axis) => {
                self.locked_at[axis as usize] = self.at[axis as usize];
                self.modes[axis as usize] = AxisMode::Locked;
                Status::OK
            }
            Request::OfAxis(_, axis) => {
                self.modes[axis as usize] = AxisMode::Normal;
                Status::OK
            }
            Request::Number(function, value) => self.set_number(function, value),
            Request::AxisValues(function, values) => self.set_six(function, values),
            Request::Pose(function, pose) => self.set_pose(function, pose),
            Request::SetForceAxis(axis, force) => {
                let mut forces = match self.command {
                    Command::Forces(forces) => forces,
                    _ => [0.0; 6],
                };
                forces[axis as usize] = force;
                self.set_six(Function::SetForces, forces)
            }
            Request::SetGainVecAxes(set, gains) => {
                self.gains.take(set, &Axis::ALL.map(|axis| (axis, gains[axis as usize])))
            }
            Request::SetGainVecAxis(set, axis, pid) => self.gains.take(set, &[(axis, pid)]),
            Request::SetGainVecSingle(set, axis, gain, value) => {
                let mut pid = self.gains.of(set, axis);
                *pid.gain_mut(gain) = value;
                self.gains.take(set, &[(axis, pid)])
            }
            Request::SetGainVecGrasp(pid) => {
                self.grasp.gains = pid;
                Status::OK
            }
            Request::SetLatCellOffset(offsets) => {
                self.cell_offsets = offsets;
                Status::OK
            }
            // Handled by the server.
            _ => Status::OK,
        }
    }

    fn set_number(&mut self, function: Function, value: f32) -> Status {
        match function {
            Function::SetAuxDac if value.is_finite() => {
                self.aux_v = value.clamp(-AUX_LIMIT_V, AUX_LIMIT_V);
            }
            Function::SetBoundaryRadius if value.is_finite() && value >= 0.0 => {
                self.boundary_radius_m = value;
            }
            Function::SetBoundaryRadius => return Status::POSITION,
            Function::SetServoFrequency if (SERVO_HZ[0]..=SERVO_HZ[1]).contains(&value) => {
                self.servo_hz = value;
            }
            Function::SetServoFrequency => return Status::FREQUENCY,
            Function::SetGraspCurrent if value.is_finite() => self.grasp.current_a = value,
            Function::SetGraspCurrentLimit if value.is_finite() => self.grasp.limit_a = value,
            _ => return Status::CURRENT,
        }
        Status::OK
    }

    fn set_six(&mut self, function: Function, values: AxisValues) -> Status {
        let is_finite = values.iter().all(|value| value.is_finite());
        match function {
            Function::SetForces if is_finite => self.command = Command::Forces(values),
            Function::SetForces => return Status::FORCE,
            Function::SetCurrents if is_finite => {
                let (within, clipped) = self.coils.clipped(&values);
                self.command = Command::Currents(within);
                return if clipped { Status::CURRENT } else { Status::OK };
            }
            Function::SetCurrentLimits if is_finite && values.iter().all(|value| *value >= 0.0) => {
                self.coils.limits_a = values;
            }
            Function::SetCurrentLimits | Function::SetCurrents => return Status::CURRENT,
            Function::SetGravity if is_finite => self.gravity = values,
            Function::SetGravity => return Status::FORCE,
            Function::SetSpeedLimits if is_finite && values.iter().all(|value| *value >= 0.0) => {
                self.speed_limits = values;
            }
            Function::SetSpeedLimits => return Status::SPEED,
            Function::SetVelocity if is_finite => {
                self.desired = self.at_target();
                self.command = Command::Velocity(values);
            }
            _ => return Status::SPEED,
        }
        Status::OK
    }

    /// Returns the start of a velocity command: the target in position or velocity control, else the actual position.
    pub(super) fn at_target(&self) -> [f64; 6] {
        match self.command {
            Command::Position | Command::Velocity(_) => self.desired,
            Command::Forces(_) | Command::Currents(_) => self.at,
        }
    }

    fn set_pose(&mut self, function: Function, pose: WirePose) -> Status {
        if !pose.at.iter().all(|value| value.is_finite()) {
            return Status::POSITION;
        }
        if function == Function::SetFrame {
            self.frame = pose.at;
        } else {
            self.desired = pose.at.map(f64::from);
            self.desired_told = narrow(vector(&self.desired, 0), vector(&self.desired, 3));
            self.command = Command::Position;
        }
        Status::OK
    }
}

/// Returns true for a function that only sets the target or the wrench of the next servo interval.
pub(in crate::ml_api) fn is_command(function: Function) -> bool {
    matches!(
        function,
        Function::SetForces
            | Function::SetForceAxis
            | Function::SetCurrents
            | Function::SetDesiredPosition
            | Function::SetVelocity
    )
}
