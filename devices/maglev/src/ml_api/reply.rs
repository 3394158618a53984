//! Replies: a status and always the full results. A client decodes results even with an error status: from a truncated reply the
//! client would take numbers of an earlier reply.

use super::frame::{Fields, Frame};
use super::function::Function;
use super::values::{
    AxisMode, AxisValues, Buttons, Cell, CellOffset, FaultBits, Pid, Status, Version, WirePose,
};

/// Declares the results with their types.
macro_rules! results {
    ($($(#[$doc:meta])* $name:ident($type:ty),)+) => {
        /// Results of a function. Units of [`super`].
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub enum Results {
            /// No results.
            None,
            $($(#[$doc])* $name($type),)+
        }

        impl Results {
            fn write(&self, frame: &mut Frame) {
                match *self {
                    Self::None => frame,
                    $(Self::$name(value) => frame.add(value),)+
                };
            }

            fn read(function: Function, fields: &mut Fields<'_>) -> Option<Self> {
                Some(match Self::zero(function) {
                    Self::None => Self::None,
                    $(Self::$name(_) => Self::$name(fields.next()?),)+
                })
            }
        }

        $(impl TryFrom<Results> for $type {
            type Error = Results;

            fn try_from(results: Results) -> Result<Self, Results> {
                match results {
                    Results::$name(value) => Ok(value),
                    other => Err(other),
                }
            }
        })+
    };
}

results! {
    /// One number.
    Number(f32),
    /// One number per axis or per coil.
    AxisValues(AxisValues),
    /// A pose of the flotor or a frame.
    Pose(WirePose),
    /// Control mode of each axis.
    Modes([AxisMode; 6]),
    /// State of the buttons.
    Buttons(Buttons),
    /// Light spots on the position sensors.
    Cells([Cell; 3]),
    /// Fault bits.
    Fault(FaultBits),
    /// Gains of all axes.
    Gains([Pid; 6]),
    /// Gains of one axis.
    Pid(Pid),
    /// Placement of the position sensors.
    CellOffsets([CellOffset; 3]),
    /// Voltages, four per position sensor.
    Voltages([f32; 12]),
    /// Version of the controller.
    Version(Version),
    /// Token of a callback connection.
    Token(i32),
}

/// Reply of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use]
pub struct Reply {
    /// Status of the call.
    pub status: Status,
    /// Results of the function; the function determines the variant.
    pub results: Results,
}

impl Results {
    /// Returns the results of a function with all numbers zero, for replies with an error.
    #[must_use]
    pub fn zero(function: Function) -> Self {
        match function {
            Function::FindGravity
            | Function::GetCurrentLimits
            | Function::GetCurrents
            | Function::GetForces
            | Function::GetGravity
            | Function::GetSpeedLimits
            | Function::GetTemp
            | Function::GetVelocity => Self::AxisValues([0.0; 6]),
            Function::GetActualPosition | Function::GetDesiredPosition | Function::GetFrame => {
                Self::Pose(WirePose::default())
            }
            Function::GetAxisModes => Self::Modes([AxisMode::Normal; 6]),
            Function::GetBoundaryRadius
            | Function::GetForceAxis
            | Function::GetGainVecSingle
            | Function::GetGraspCurrent
            | Function::GetGraspCurrentLimit
            | Function::GetLatCellLimit
            | Function::GetServoFrequency => Self::Number(0.0),
            Function::GetButtonStatus => Self::Buttons(Buttons::default()),
            Function::GetCellPosition => Self::Cells([Cell::default(); 3]),
            Function::GetFault => Self::Fault(FaultBits::NONE),
            Function::GetGainVecAxes => Self::Gains([Pid::ZERO; 6]),
            Function::GetGainVecAxis | Function::GetGainVecGrasp => Self::Pid(Pid::ZERO),
            Function::GetLatCellOffset => Self::CellOffsets([CellOffset::default(); 3]),
            Function::GetRawCellData => Self::Voltages([0.0; 12]),
            Function::GetVersion => Self::Version(Version::default()),
            Function::RequestToken => Self::Token(0),
            _ => Self::None,
        }
    }
}

impl Reply {
    /// Creates a reply with status OK and these results.
    pub const fn ok(results: Results) -> Self {
        Self { status: Status::OK, results }
    }

    /// Creates a reply with this status and no results.
    pub const fn status(status: Status) -> Self {
        Self { status, results: Results::None }
    }

    /// Creates a reply with an error status and with zeros as the results of the function; without results for an unknown
    /// function.
    pub fn failed(function: Option<Function>, status: Status) -> Self {
        Self { status, results: function.map_or(Results::None, Results::zero) }
    }

    /// Encodes the reply as a frame.
    pub fn encode(&self) -> Frame {
        let mut frame = Frame::new(self.status.0);
        self.results.write(&mut frame);
        // The first two modes are sent a second time: the vendor's decoder reads two further numbers.
        if let Results::Modes([first, second, ..]) = self.results {
            frame.add([first, second]);
        }
        frame
    }

    /// Decodes the reply to a function; `None` for any other bytes and for a frame shorter than the function's results.
    /// Never panics.
    #[must_use]
    pub fn decode(function: Function, frame: &[u8]) -> Option<Self> {
        let (status, mut fields) = Fields::of(frame)?;
        Some(Self { status: Status(status), results: Results::read(function, &mut fields)? })
    }
}
