//! Functions of the controller, with their numbers on the wire.

use super::event::EventKind;

macro_rules! is_marked {
    () => {
        false
    };
    (commands) => {
        true
    };
}

/// Declares the functions with their numbers; `commands` marks the functions of the commanding client.
macro_rules! functions {
    ($($(#[$doc:meta])* $name:ident = $id:literal $($mark:ident)?,)+) => {
        /// Function of the controller, with its number on the wire; units of [`super`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function {
            $($(#[$doc])* $name = $id,)+
        }

        impl Function {
            /// All functions, by number.
            pub const ALL: &'static [Self] = &[$(Self::$name),+];

            /// Returns the name of the function in the ML API.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$name => stringify!($name),)+
                }
            }

            /// Returns true if only the commanding client may call the function. All clients may read and land.
            #[must_use]
            pub const fn commands(self) -> bool {
                match self {
                    $(Self::$name => is_marked!($($mark)?),)+
                }
            }
        }
    };
}

functions! {
    /// Keeps an axis inside a range.
    ConstrainAxis = 1 commands,
    /// Sets the feed-forward of the normal gains to the stored gravity wrench.
    DefyGravity = 2 commands,
    /// Ends the session of the client.
    Disconnect = 3,
    /// Measures the gravity wrench, which balances the weight of the flotor; takes seconds.
    FindGravity = 4 commands,
    /// Returns the pose of the flotor.
    GetActualPosition = 5,
    /// Returns the control mode of each axis.
    GetAxisModes = 6,
    /// Returns the radius of the boundary sphere.
    GetBoundaryRadius = 7,
    /// Returns the state of the buttons.
    GetButtonStatus = 8,
    /// Returns the light spots on the position sensors.
    GetCellPosition = 9,
    /// Returns the current limit of each coil.
    GetCurrentLimits = 10,
    /// Returns the current of each coil.
    GetCurrents = 11,
    /// Returns the desired pose of the flotor.
    GetDesiredPosition = 12,
    /// Returns the fault bits.
    GetFault = 14,
    /// Returns the applied force or torque of one axis.
    GetForceAxis = 15,
    /// Returns the applied wrench.
    GetForces = 16,
    /// Returns the frame set by a client.
    GetFrame = 17,
    /// Returns the gains of all axes.
    GetGainVecAxes = 18,
    /// Returns the gains of one axis.
    GetGainVecAxis = 19,
    /// Returns the gains of the grasp.
    GetGainVecGrasp = 20,
    /// Returns one gain.
    GetGainVecSingle = 21,
    /// Returns the current of the grasp.
    GetGraspCurrent = 22,
    /// Returns the current limit of the grasp.
    GetGraspCurrentLimit = 23,
    /// Returns the stored gravity wrench.
    GetGravity = 24,
    /// Returns the range of the position sensors.
    GetLatCellLimit = 25,
    /// Returns the placement of the position sensors.
    GetLatCellOffset = 26,
    /// Returns the voltages of the position sensors.
    GetRawCellData = 27,
    /// Returns the servo rate.
    GetServoFrequency = 28,
    /// Returns the speed limits.
    GetSpeedLimits = 29,
    /// Returns the temperature of each coil.
    GetTemp = 30,
    /// Returns the velocity of the flotor.
    GetVelocity = 31,
    /// Returns the controller's version.
    GetVersion = 32,
    /// Sets the flotor down; takes seconds.
    Land = 33,
    /// Locks an axis at its present position.
    LockAxis = 34 commands,
    /// Registers for changes of the buttons.
    RegisterButton = 36,
    /// Registers for changes of the fault bits.
    RegisterFault = 37,
    /// Registers for crossings of boundaries.
    RegisterBoundary = 38,
    /// Registers for overheated coils.
    RegisterOvertemp = 39,
    /// Registers for ticks, one per servo interval.
    RegisterTick = 40,
    /// Clears the faults whose cause has ended.
    ResetFault = 41 commands,
    /// Restores the default gains of a set; takes seconds.
    ResetGainVecAxes = 42 commands,
    /// Sets the voltage of the spare output.
    SetAuxDac = 43 commands,
    /// Sets the radius of the boundary sphere.
    SetBoundaryRadius = 44 commands,
    /// Sets the current limit of each coil.
    SetCurrentLimits = 45 commands,
    /// Commands the current of each coil.
    SetCurrents = 46 commands,
    /// Sets the desired pose of the flotor.
    SetDesiredPosition = 47 commands,
    /// Commands the force of one axis.
    SetForceAxis = 48 commands,
    /// Commands a wrench.
    SetForces = 49 commands,
    /// Sets the frame in which poses and velocities are reported to clients.
    SetFrame = 50 commands,
    /// Sets the gains of all axes.
    SetGainVecAxes = 51 commands,
    /// Sets the gains of one axis.
    SetGainVecAxis = 52 commands,
    /// Sets the gains of the grasp.
    SetGainVecGrasp = 53 commands,
    /// Sets one gain.
    SetGainVecSingle = 54 commands,
    /// Sets the current of the grasp.
    SetGraspCurrent = 55 commands,
    /// Sets the current limit of the grasp.
    SetGraspCurrentLimit = 56 commands,
    /// Stores the gravity wrench, which balances the weight of the flotor.
    SetGravity = 57 commands,
    /// Sets the placement of the position sensors.
    SetLatCellOffset = 58 commands,
    /// Sets the servo rate.
    SetServoFrequency = 59 commands,
    /// Sets the speed limits.
    SetSpeedLimits = 60 commands,
    /// Sets the velocity of the desired pose.
    SetVelocity = 61 commands,
    /// Restarts the controller.
    Shutdown = 62 commands,
    /// Lifts the flotor home; takes seconds.
    Takeoff = 63 commands,
    /// Ends the lock or the constraint of an axis.
    UnlockAxis = 64 commands,
    /// Unregisters from button events.
    UnregisterButton = 65,
    /// Unregisters from fault events.
    UnregisterFault = 66,
    /// Unregisters from boundary events.
    UnregisterBoundary = 67,
    /// Unregisters from temperature events.
    UnregisterOvertemp = 68,
    /// Unregisters from ticks.
    UnregisterTick = 69,
    /// Ends the callback connection.
    StopCallbacks = 71,
    /// Returns a token for this connection, which carries events from then on.
    RequestToken = 72,
    /// Assigns the callback connection with this token to the client.
    MapToken = 73,
}

impl EventKind {
    /// Returns the functions that register a client for the events and unregister the client.
    #[must_use]
    pub const fn functions(self) -> (Function, Function) {
        match self {
            Self::Button => (Function::RegisterButton, Function::UnregisterButton),
            Self::Boundary => (Function::RegisterBoundary, Function::UnregisterBoundary),
            Self::Overtemp => (Function::RegisterOvertemp, Function::UnregisterOvertemp),
            Self::Fault => (Function::RegisterFault, Function::UnregisterFault),
            Self::Tick => (Function::RegisterTick, Function::UnregisterTick),
        }
    }
}

impl Function {
    /// Returns the number of the function on the wire.
    #[must_use]
    pub const fn id(self) -> i32 {
        self as i32
    }

    /// Returns the function with a number; `None` if there is none.
    #[must_use]
    pub fn of(id: i32) -> Option<Self> {
        Self::ALL.iter().copied().find(|function| *function as i32 == id)
    }

    /// Returns the kind of event for which the function registers a client; `None` for other functions.
    #[must_use]
    pub fn registers(self) -> Option<EventKind> {
        EventKind::ALL.into_iter().find(|kind| kind.functions().0 == self)
    }

    /// Returns the kind of event from which the function unregisters a client; `None` for other functions.
    #[must_use]
    pub fn unregisters(self) -> Option<EventKind> {
        EventKind::ALL.into_iter().find(|kind| kind.functions().1 == self)
    }
}
