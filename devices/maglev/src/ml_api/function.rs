//! The functions, by their numbers on the wire.

use super::event::EventKind;

macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident = $id:literal,)+) => {
        /// A function of the controller.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function {
            $($(#[$doc])* $name = $id,)+
        }

        impl Function {
            /// All of them.
            pub const ALL: &'static [Self] = &[$(Self::$name),+];

            /// Returns the name that the ML API gives it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => stringify!($name),)+
                }
            }
        }
    };
}

functions! {
    /// Keeps an axis inside a range.
    ConstrainAxis = 1,
    /// Gravity becomes the feed-forward of the normal gains.
    DefyGravity = 2,
    /// The client goes.
    Disconnect = 3,
    /// Finds the wrench that holds the flotor; takes seconds.
    FindGravity = 4,
    /// Where the flotor is.
    GetActualPosition = 5,
    /// How each axis is controlled.
    GetAxisModes = 6,
    /// Radius of the boundary sphere.
    GetBoundaryRadius = 7,
    /// The buttons.
    GetButtonStatus = 8,
    /// The light spots.
    GetCellPosition = 9,
    /// Largest current of each coil.
    GetCurrentLimits = 10,
    /// Current of each coil.
    GetCurrents = 11,
    /// Where the flotor should be.
    GetDesiredPosition = 12,
    /// What is wrong.
    GetFault = 14,
    /// Force of one axis.
    GetForceAxis = 15,
    /// The wrench in force.
    GetForces = 16,
    /// The user's frame.
    GetFrame = 17,
    /// Gains of all axes.
    GetGainVecAxes = 18,
    /// Gains of one axis.
    GetGainVecAxis = 19,
    /// Gains of the grasp.
    GetGainVecGrasp = 20,
    /// One gain.
    GetGainVecSingle = 21,
    /// Current of the grasp.
    GetGraspCurrent = 22,
    /// Largest current of the grasp.
    GetGraspCurrentLimit = 23,
    /// The stored gravity.
    GetGravity = 24,
    /// Reach of the cells.
    GetLatCellLimit = 25,
    /// Where the cells sit.
    GetLatCellOffset = 26,
    /// Voltages of the cells.
    GetRawCellData = 27,
    /// Servo rate.
    GetServoFrequency = 28,
    /// Largest speeds.
    GetSpeedLimits = 29,
    /// Temperature of each coil.
    GetTemp = 30,
    /// How the flotor moves.
    GetVelocity = 31,
    /// The controller's version.
    GetVersion = 32,
    /// Sets the flotor down; takes seconds.
    Land = 33,
    /// Holds an axis where it is.
    LockAxis = 34,
    /// From now on, changes of the buttons.
    RegisterButton = 36,
    /// From now on, changes of the fault bits.
    RegisterFault = 37,
    /// From now on, crossings of boundaries.
    RegisterBoundary = 38,
    /// From now on, coils that are too hot.
    RegisterOvertemp = 39,
    /// From now on, each servo interval.
    RegisterTick = 40,
    /// Clears the faults whose cause is gone.
    ResetFault = 41,
    /// Default gains of a set; takes seconds.
    ResetGainVecAxes = 42,
    /// Voltage of the spare output.
    SetAuxDac = 43,
    /// Radius of the boundary sphere.
    SetBoundaryRadius = 44,
    /// Largest current of each coil.
    SetCurrentLimits = 45,
    /// Current of each coil.
    SetCurrents = 46,
    /// Where the flotor should be.
    SetDesiredPosition = 47,
    /// Force of one axis.
    SetForceAxis = 48,
    /// The wrench.
    SetForces = 49,
    /// The user's frame.
    SetFrame = 50,
    /// Gains of all axes.
    SetGainVecAxes = 51,
    /// Gains of one axis.
    SetGainVecAxis = 52,
    /// Gains of the grasp.
    SetGainVecGrasp = 53,
    /// One gain.
    SetGainVecSingle = 54,
    /// Current of the grasp.
    SetGraspCurrent = 55,
    /// Largest current of the grasp.
    SetGraspCurrentLimit = 56,
    /// Stores gravity.
    SetGravity = 57,
    /// Where the cells sit.
    SetLatCellOffset = 58,
    /// Servo rate.
    SetServoFrequency = 59,
    /// Largest speeds.
    SetSpeedLimits = 60,
    /// How the desired position moves.
    SetVelocity = 61,
    /// Starts the controller anew.
    Shutdown = 62,
    /// Lifts the flotor home; takes seconds.
    Takeoff = 63,
    /// Frees an axis.
    UnlockAxis = 64,
    /// No button events any more.
    UnregisterButton = 65,
    /// No fault events any more.
    UnregisterFault = 66,
    /// No boundary events any more.
    UnregisterBoundary = 67,
    /// No temperature events any more.
    UnregisterOvertemp = 68,
    /// No ticks any more.
    UnregisterTick = 69,
    /// Ends the callback connection.
    StopCallbacks = 71,
    /// A token for this connection, which carries events from now on.
    RequestToken = 72,
    /// The callback connection with this token belongs to this client.
    MapToken = 73,
}

impl Function {
    /// Its number on the wire.
    #[must_use]
    pub const fn id(self) -> i32 {
        self as i32
    }

    /// The function of a number, if there is one.
    #[must_use]
    pub fn of(id: i32) -> Option<Self> {
        Self::ALL.iter().copied().find(|function| *function as i32 == id)
    }

    /// The events it begins.
    #[must_use]
    pub const fn registers(self) -> Option<EventKind> {
        Some(match self {
            Self::RegisterButton => EventKind::Button,
            Self::RegisterFault => EventKind::Fault,
            Self::RegisterBoundary => EventKind::Boundary,
            Self::RegisterOvertemp => EventKind::Overtemp,
            Self::RegisterTick => EventKind::Tick,
            _ => return None,
        })
    }

    /// The events it ends.
    #[must_use]
    pub const fn unregisters(self) -> Option<EventKind> {
        Some(match self {
            Self::UnregisterButton => EventKind::Button,
            Self::UnregisterFault => EventKind::Fault,
            Self::UnregisterBoundary => EventKind::Boundary,
            Self::UnregisterOvertemp => EventKind::Overtemp,
            Self::UnregisterTick => EventKind::Tick,
            _ => return None,
        })
    }

    /// True if it moves the flotor or changes how the controller does; what only looks, and landing, is free to all clients.
    #[must_use]
    pub const fn commands(self) -> bool {
        matches!(
            self,
            Self::ConstrainAxis
                | Self::DefyGravity
                | Self::FindGravity
                | Self::LockAxis
                | Self::ResetFault
                | Self::ResetGainVecAxes
                | Self::SetAuxDac
                | Self::SetBoundaryRadius
                | Self::SetCurrentLimits
                | Self::SetCurrents
                | Self::SetDesiredPosition
                | Self::SetForceAxis
                | Self::SetForces
                | Self::SetFrame
                | Self::SetGainVecAxes
                | Self::SetGainVecAxis
                | Self::SetGainVecGrasp
                | Self::SetGainVecSingle
                | Self::SetGraspCurrent
                | Self::SetGraspCurrentLimit
                | Self::SetGravity
                | Self::SetLatCellOffset
                | Self::SetServoFrequency
                | Self::SetSpeedLimits
                | Self::SetVelocity
                | Self::Shutdown
                | Self::Takeoff
                | Self::UnlockAxis
        )
    }
}
