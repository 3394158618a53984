//! Requests: a function and its arguments.

use super::event::EventKind;
use super::frame::{Field, Fields, Frame};
use super::function::Function;
use super::values::{Axis, AxisValues, CellOffset, Gain, GainSet, Pid, Status, WirePose, of_code};

/// Request from a client. Units of [`super`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Request {
    /// A function without arguments.
    Plain(Function),
    /// Keeps an axis between two values, m or rad.
    ConstrainAxis {
        /// Axis to constrain.
        axis: Axis,
        /// Smallest and largest value, m or rad.
        range: [f32; 2],
    },
    /// A function of one axis: read its force, lock or unlock the axis.
    OfAxis(Function, Axis),
    /// A function of one gain set: read or reset the set.
    OfSet(Function, GainSet),
    /// Reads the gains of an axis.
    GetGainVecAxis(GainSet, Axis),
    /// Reads one gain.
    GetGainVecSingle(GainSet, Axis, Gain),
    /// Registers for events or unregisters from events; with the client's process id.
    Register(Function, i32),
    /// A function of one number: radius m, voltage V, current A, frequency Hz.
    Number(Function, f32),
    /// A function of six numbers: currents A, speeds m/s and rad/s, wrenches N and N·m.
    AxisValues(Function, AxisValues),
    /// A function of a pose: desired position, frame.
    Pose(Function, WirePose),
    /// Sets the force of one axis, N or N·m.
    SetForceAxis(Axis, f32),
    /// Sets the gains of all axes.
    SetGainVecAxes(GainSet, [Pid; 6]),
    /// Sets the gains of an axis.
    SetGainVecAxis(GainSet, Axis, Pid),
    /// Sets the gains of the grasp.
    SetGainVecGrasp(Pid),
    /// Sets one gain.
    SetGainVecSingle(GainSet, Axis, Gain, f32),
    /// Sets the placement of the position sensors.
    SetLatCellOffset([CellOffset; 3]),
    /// Assigns the callback connection with this token to the client.
    MapToken(i32),
}

/// An invalid request, with the status for the reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InvalidRequest {
    /// The requested function; `None` if the number is unknown.
    pub function: Option<Function>,
    /// Status for the reply.
    pub status: Status,
}

impl Request {
    /// Returns the function of the request.
    #[must_use]
    pub const fn function(&self) -> Function {
        match *self {
            Self::Plain(function)
            | Self::OfAxis(function, _)
            | Self::OfSet(function, _)
            | Self::Register(function, _)
            | Self::Number(function, _)
            | Self::AxisValues(function, _)
            | Self::Pose(function, _) => function,
            Self::ConstrainAxis { .. } => Function::ConstrainAxis,
            Self::GetGainVecAxis(..) => Function::GetGainVecAxis,
            Self::GetGainVecSingle(..) => Function::GetGainVecSingle,
            Self::SetForceAxis(..) => Function::SetForceAxis,
            Self::SetGainVecAxes(..) => Function::SetGainVecAxes,
            Self::SetGainVecAxis(..) => Function::SetGainVecAxis,
            Self::SetGainVecGrasp(_) => Function::SetGainVecGrasp,
            Self::SetGainVecSingle(..) => Function::SetGainVecSingle,
            Self::SetLatCellOffset(_) => Function::SetLatCellOffset,
            Self::MapToken(_) => Function::MapToken,
        }
    }

    /// Creates the request that registers for events.
    #[must_use]
    pub const fn register(kind: EventKind, process: i32) -> Self {
        Self::Register(kind.functions().0, process)
    }

    /// Encodes the request as a frame.
    pub fn encode(&self) -> Frame {
        let mut frame = Frame::new(self.function().id());
        match *self {
            Self::Plain(_) => &mut frame,
            Self::ConstrainAxis { axis, range } => frame.add(axis as i32).add(range),
            Self::OfAxis(_, axis) => frame.add(axis as i32),
            Self::OfSet(_, set) => frame.add(set as i32),
            Self::GetGainVecAxis(set, axis) => frame.add([set as i32, axis as i32]),
            Self::GetGainVecSingle(set, axis, gain) => frame.add([set as i32, axis as i32, gain as i32]),
            Self::Register(_, process) => frame.add(process),
            Self::Number(_, value) => frame.add(value),
            Self::AxisValues(_, values) => frame.add(values),
            Self::Pose(_, pose) => frame.add(pose),
            Self::SetForceAxis(axis, force) => frame.add(axis as i32).add(force),
            Self::SetGainVecAxes(set, gains) => frame.add(set as i32).add(gains),
            Self::SetGainVecAxis(set, axis, pid) => frame.add([set as i32, axis as i32]).add(pid),
            Self::SetGainVecGrasp(pid) => frame.add(pid),
            Self::SetGainVecSingle(set, axis, gain, value) => {
                frame.add([set as i32, axis as i32, gain as i32]).add(value)
            }
            Self::SetLatCellOffset(cells) => frame.add(cells),
            Self::MapToken(token) => frame.add(token),
        };
        frame
    }

    /// Decodes a frame; bytes after the arguments are ignored. Never panics.
    ///
    /// # Errors
    /// [`InvalidRequest`] for an unknown function, missing arguments or an invalid axis, gain or gain set.
    pub fn decode(frame: &[u8]) -> Result<Self, InvalidRequest> {
        let unknown = InvalidRequest { function: None, status: Status::UNKNOWN };
        let (id, fields) = Fields::of(frame).ok_or(unknown)?;
        let function = Function::of(id).ok_or(unknown)?;
        Arguments { fields, function }.read()
    }
}

/// Reader for the arguments of a function.
struct Arguments<'a> {
    fields: Fields<'a>,
    function: Function,
}

impl Arguments<'_> {
    fn read(mut self) -> Result<Request, InvalidRequest> {
        let function = self.function;
        Ok(match function {
            Function::ConstrainAxis => Request::ConstrainAxis { axis: self.axis()?, range: self.next()? },
            Function::GetForceAxis | Function::LockAxis | Function::UnlockAxis => {
                Request::OfAxis(function, self.axis()?)
            }
            Function::GetGainVecAxes | Function::ResetGainVecAxes => Request::OfSet(function, self.set()?),
            Function::GetGainVecAxis => Request::GetGainVecAxis(self.set()?, self.axis()?),
            Function::GetGainVecSingle => Request::GetGainVecSingle(self.set()?, self.axis()?, self.gain()?),
            Function::SetAuxDac
            | Function::SetBoundaryRadius
            | Function::SetGraspCurrent
            | Function::SetGraspCurrentLimit
            | Function::SetServoFrequency => Request::Number(function, self.next()?),
            Function::SetCurrentLimits
            | Function::SetCurrents
            | Function::SetForces
            | Function::SetGravity
            | Function::SetSpeedLimits
            | Function::SetVelocity => Request::AxisValues(function, self.next()?),
            Function::SetDesiredPosition | Function::SetFrame => {
                // The flag is ignored: clients send uninitialised memory.
                Request::Pose(function, WirePose { out_of_range: false, ..self.next()? })
            }
            Function::SetForceAxis => Request::SetForceAxis(self.axis()?, self.next()?),
            Function::SetGainVecAxes => Request::SetGainVecAxes(self.set()?, self.next()?),
            Function::SetGainVecAxis => Request::SetGainVecAxis(self.set()?, self.axis()?, self.next()?),
            Function::SetGainVecGrasp => Request::SetGainVecGrasp(self.next()?),
            Function::SetGainVecSingle => {
                Request::SetGainVecSingle(self.set()?, self.axis()?, self.gain()?, self.next()?)
            }
            Function::SetLatCellOffset => Request::SetLatCellOffset(self.next()?),
            Function::MapToken => Request::MapToken(self.next()?),
            _ if function.registers().is_some() || function.unregisters().is_some() => {
                Request::Register(function, self.next()?)
            }
            _ => Request::Plain(function),
        })
    }

    fn invalid(&self, status: Status) -> InvalidRequest {
        InvalidRequest { function: Some(self.function), status }
    }

    fn next<T: Field>(&mut self) -> Result<T, InvalidRequest> {
        self.fields.next().ok_or(self.invalid(Status::COMMUNICATION))
    }

    fn axis(&mut self) -> Result<Axis, InvalidRequest> {
        of_code(&Axis::ALL, self.next()?).ok_or(self.invalid(Status::AXIS))
    }

    fn set(&mut self) -> Result<GainSet, InvalidRequest> {
        of_code(&GainSet::ALL, self.next()?).ok_or(self.invalid(Status::GAIN_TYPE))
    }

    fn gain(&mut self) -> Result<Gain, InvalidRequest> {
        of_code(&Gain::ALL, self.next()?).ok_or(self.invalid(Status::GAIN_TYPE))
    }
}
