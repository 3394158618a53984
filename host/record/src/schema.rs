//! Messages of a recording, as `host/proto` defines them, and their conversion from and to a [`TickRecord`].
//!
//! Numbers and types are repeated here by hand; a test reads a recording with the schema that it contains and compares
//! every field. Every `f64` is an `Option` that is always filled: protobuf leaves out a plain field that equals its
//! default, -0.0 equals 0.0, and a recording is bit-exact. On the wire it is the plain field of the schema.

use crate::{Note, Severity};
use flotor_core::grip::GripRecord;
use flotor_core::limits::PassivityMode;
use flotor_core::mapping::MappingConfig;
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{
    Change as ParameterChange, ChangeOutcome, ChangeSubject, Clock as ClockValue, ModelOutputs,
};
use flotor_hal::{Demand, GripKind, GripState, Pose, Twist as TwistValue, Wrench as WrenchValue};
use prost::{Enumeration, Message};
use prost_types::Timestamp;

/// Compiled `host/proto` (a `google.protobuf.FileDescriptorSet`): the schemas that other programs need to read the messages.
pub(crate) const DESCRIPTOR_SET: &[u8] = include_bytes!("../proto/flotor.binpb");

/// The encoding of messages and schemas, as MCAP's registry names it.
pub(crate) const ENCODING: &str = "protobuf";

/// Highest format that this program reads, and the one that it writes of a run with shared models.
pub(crate) const FORMAT: u32 = 3;

/// Format of a run without shared models.
pub(crate) const FORMAT_WITHOUT_SHARED: u32 = 2;

/// Frame of all numbers; its axes are those of the device frame.
const DEVICE_FRAME: &str = "device";
/// Frame that moves with the handle.
const HANDLE_FRAME: &str = "handle";

/// Topic of a channel. The number is the id of channel and schema in files written here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u16)]
pub(crate) enum Topic {
    Run = 1,
    Pose = 2,
    Tick = 3,
    Log = 4,
    Change = 5,
}

impl Topic {
    pub(crate) const ALL: [Topic; 5] = [Topic::Run, Topic::Pose, Topic::Tick, Topic::Log, Topic::Change];

    pub(crate) const fn id(self) -> u16 {
        self as u16
    }

    pub(crate) const fn name(self) -> &'static str {
        self.names().0
    }

    pub(crate) const fn schema(self) -> &'static str {
        self.names().1
    }

    /// Returns the names of topic and schema.
    const fn names(self) -> (&'static str, &'static str) {
        match self {
            Topic::Run => ("/flotor/run", "flotor.Run"),
            Topic::Pose => ("/tf", "foxglove.FrameTransform"),
            Topic::Tick => ("/flotor/tick", "flotor.Tick"),
            Topic::Log => ("/flotor/log", "foxglove.Log"),
            Topic::Change => ("/flotor/change", "flotor.Change"),
        }
    }
}

/// Name of a required field that is missing from a message, or whose value is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Missing(pub(crate) &'static str);

/// Defines a `prost` message for each name: type of each field here, its number and its kind on the wire.
macro_rules! messages {
    ($($message:ident $(: $also:ident)? { $($field:ident: $value:ty = $number:tt [$($kind:tt)+],)+ })+) => {
        $(#[derive(Clone, $($also,)? PartialEq, Message)]
        pub(crate) struct $message {
            $(#[prost($($kind)+, tag = $number)]
            pub(crate) $field: $value,)+
        })+
    };
}

messages! {
    Vector3: Copy {
        x: Option<f64> = 1 [double, optional],
        y: Option<f64> = 2 [double, optional],
        z: Option<f64> = 3 [double, optional],
    }

    Quaternion: Copy {
        x: Option<f64> = 1 [double, optional],
        y: Option<f64> = 2 [double, optional],
        z: Option<f64> = 3 [double, optional],
        w: Option<f64> = 4 [double, optional],
    }

    FrameTransform {
        timestamp: Option<Timestamp> = 1 [message, optional],
        parent_frame_id: String = 2 [string],
        child_frame_id: String = 3 [string],
        translation: Option<Vector3> = 4 [message, optional],
        rotation: Option<Quaternion> = 5 [message, optional],
    }

    Log {
        timestamp: Option<Timestamp> = 1 [message, optional],
        level: i32 = 2 [enumeration = "Level"],
        message: String = 3 [string],
        name: String = 4 [string],
        file: String = 5 [string],
        line: u32 = 6 [fixed32],
    }

    Twist: Copy {
        linear_m_per_s: Option<Vector3> = 1 [message, optional],
        angular_rad_per_s: Option<Vector3> = 2 [message, optional],
    }

    Wrench: Copy {
        force_n: Option<Vector3> = 1 [message, optional],
        torque_nm: Option<Vector3> = 2 [message, optional],
    }

    Tick: Copy {
        tick: u64 = 1 [uint64],
        time_ns: u64 = 2 [uint64],
        dt_ns: u64 = 3 [uint64],
        twist: Option<Twist> = 4 [message, optional],
        model: Option<Wrench> = 5 [message, optional],
        commanded: Option<Wrench> = 6 [message, optional],
        delivered: Option<Wrench> = 7 [message, optional],
        energy_j: Option<f64> = 8 [double, optional],
        events: u32 = 9 [uint32],
        buttons: u32 = 10 [uint32],
        lateness_ns: u64 = 11 [uint64],
        compute_ns: u64 = 12 [uint64],
        port_energy_j: Option<f64> = 13 [double, optional],
        device: u32 = 14 [uint32],
        grip: Option<Grip> = 15 [message, optional],
    }

    Grip: Copy {
        opening: Option<f64> = 1 [double, optional],
        velocity: Option<f64> = 2 [double, optional],
        delivered: Option<f64> = 3 [double, optional],
        model: Option<f64> = 4 [double, optional],
        commanded: Option<f64> = 5 [double, optional],
        kind: i32 = 6 [enumeration = "Kind"],
    }

    Change {
        tick: u64 = 1 [uint64],
        plugin: String = 2 [string],
        key: String = 3 [string],
        value: String = 4 [string],
        number: Option<f64> = 5 [double, optional],
        outcome: i32 = 6 [enumeration = "Outcome"],
        subject: i32 = 7 [enumeration = "Subject"],
        settings: Vec<Setting> = 8 [message, repeated],
    }

    Run {
        format: u32 = 1 [uint32],
        flotor_version: String = 2 [string],
        rate_hz: Option<f64> = 3 [double, optional],
        duration_s: Option<f64> = 4 [double, optional],
        seed: u64 = 5 [uint64],
        clock: i32 = 6 [enumeration = "Clock"],
        scene_toml: String = 7 [string],
        plugins: Vec<Plugin> = 8 [message, repeated],
        couplings: Vec<Coupling> = 9 [message, repeated],
    }

    Coupling {
        name: String = 1 [string],
        stiffness_n_per_m: Option<f64> = 2 [double, optional],
        damping_ns_per_m: Option<f64> = 3 [double, optional],
        stiffness_nm_per_rad: Option<f64> = 4 [double, optional],
        damping_nms_per_rad: Option<f64> = 5 [double, optional],
        delay_ticks: u32 = 6 [uint32],
        reserve_j: Option<f64> = 7 [double, optional],
        passivity: i32 = 8 [enumeration = "Passivity"],
        ends: Vec<CouplingEnd> = 9 [message, repeated],
    }

    CouplingEnd: Copy {
        device: u32 = 1 [uint32],
        mapping: Option<Mapping> = 2 [message, optional],
    }

    Plugin {
        name: String = 1 [string],
        id: String = 2 [string],
        version: String = 3 [string],
        file: String = 4 [string],
        settings: Vec<Setting> = 5 [message, repeated],
        parameters: Vec<Setting> = 6 [message, repeated],
        mapping: Option<Mapping> = 7 [message, optional],
        places: Vec<Vector3> = 8 [message, repeated],
        blend: Option<Blend> = 9 [message, optional],
        device: u32 = 10 [uint32],
        field: Option<FieldTiming> = 11 [message, optional],
        latency_s: Option<f64> = 12 [double, optional],
        felt: i32 = 13 [enumeration = "Felt"],
        shared_with: Vec<Port> = 14 [message, repeated],
    }

    Port: Copy {
        device: u32 = 1 [uint32],
        mapping: Option<Mapping> = 2 [message, optional],
        place: Option<Vector3> = 3 [message, optional],
        contacts: Option<ContactLimits> = 4 [message, optional],
    }

    FieldTiming: Copy {
        rate_hz: Option<f64> = 1 [double, optional],
        latency_s: Option<f64> = 2 [double, optional],
        contacts: Option<ContactLimits> = 3 [message, optional],
    }

    ContactLimits: Copy {
        stiffness_n_per_m: Option<f64> = 1 [double, optional],
        per_damping_1_per_s: Option<f64> = 2 [double, optional],
        surface_power_w: Option<f64> = 3 [double, optional],
        force_n: Option<f64> = 4 [double, optional],
        torque_nm: Option<f64> = 5 [double, optional],
        by_device_n_per_m: Option<f64> = 6 [double, optional],
    }

    Blend: Copy {
        weight: Option<f64> = 1 [double, optional],
        priority: u32 = 2 [uint32],
        fade_s: Option<f64> = 3 [double, optional],
    }

    Setting: Eq {
        key: String = 1 [string],
        value: String = 2 [string],
    }

    Mapping: Copy {
        rotation: Option<Quaternion> = 1 [message, optional],
        motion_scale: Option<f64> = 2 [double, optional],
        force_scale: Option<f64> = 3 [double, optional],
        torque_scale: Option<f64> = 4 [double, optional],
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Enumeration)]
#[repr(i32)]
enum Level {
    Unknown = 0,
    Debug = 1,
    Info = 2,
    Warning = 3,
    Error = 4,
    Fatal = 5,
}

/// Defines enumerations of the schema, with the name of 0 if 0 is not a value, and their conversion from and to the value of a field.
macro_rules! enumerations {
    ($($wire:ident $(($none:ident))? of $value:ident { $($name:ident = $number:tt),+ })+) => {
        $(#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Enumeration)]
        #[repr(i32)]
        pub(crate) enum $wire {
            $($none = 0,)?
            $($name = $number,)+
        }

        impl From<$value> for $wire {
            fn from(value: $value) -> Self {
                match value {
                    $($value::$name => Self::$name,)+
                }
            }
        }

        impl $wire {
            /// Returns the value; `None` if the field is not set.
            pub(crate) fn value(self) -> Option<$value> {
                match self {
                    $(Self::$none => None,)?
                    $(Self::$name => Some($value::$name),)+
                }
            }
        })+
    };
}

enumerations! {
    Outcome(Unspecified) of ChangeOutcome { Applied = 1, Refused = 2, Broke = 3 }
    Kind(Unspecified) of GripKind { Linear = 1, Angular = 2 }
    Subject of ChangeSubject { Parameter = 0, Weight = 1, Plugin = 2 }
    Passivity(Unspecified) of PassivityMode { Observe = 1, Control = 2 }
    Clock(Unspecified) of ClockValue { Real = 1, Virtual = 2 }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Enumeration)]
#[repr(i32)]
pub(crate) enum Felt {
    Unspecified = 0,
    Force = 1,
    Wrench = 2,
}

impl Mapping {
    pub(crate) fn new(mapping: &MappingConfig) -> Self {
        Self {
            rotation: Some(Quaternion::new(mapping.rotation_xyzw)),
            motion_scale: Some(mapping.motion_scale),
            force_scale: Some(mapping.force_scale),
            torque_scale: mapping.torque_scale,
        }
    }

    pub(crate) fn config(self) -> Result<MappingConfig, Missing> {
        Ok(MappingConfig {
            rotation_xyzw: self.rotation.ok_or(Missing("mapping.rotation"))?.to_array(),
            motion_scale: self.motion_scale.ok_or(Missing("mapping.motion_scale"))?,
            force_scale: self.force_scale.ok_or(Missing("mapping.force_scale"))?,
            torque_scale: self.torque_scale,
        })
    }
}

impl Vector3 {
    pub(crate) fn new([x, y, z]: [f64; 3]) -> Self {
        Self { x: Some(x), y: Some(y), z: Some(z) }
    }

    pub(crate) fn to_array(self) -> [f64; 3] {
        [self.x(), self.y(), self.z()]
    }
}

impl Quaternion {
    pub(crate) fn new([x, y, z, w]: [f64; 4]) -> Self {
        Self { x: Some(x), y: Some(y), z: Some(z), w: Some(w) }
    }

    pub(crate) fn to_array(self) -> [f64; 4] {
        [self.x(), self.y(), self.z(), self.w()]
    }
}

impl FrameTransform {
    /// Creates a message to be filled tick by tick: the names of the frames are allocated once.
    pub(crate) fn of_handle() -> Self {
        Self {
            parent_frame_id: DEVICE_FRAME.to_owned(),
            child_frame_id: HANDLE_FRAME.to_owned(),
            ..Self::default()
        }
    }

    /// Creates the message for one of several devices, by its name.
    pub(crate) fn of_handle_at(device: &str) -> Self {
        Self {
            parent_frame_id: device.to_owned(),
            child_frame_id: format!("{device}/{HANDLE_FRAME}"),
            ..Self::default()
        }
    }

    pub(crate) fn set(&mut self, record: &TickRecord) {
        self.timestamp = Some(timestamp(record.time_ns));
        self.translation = Some(Vector3::new(record.pose.position_m));
        self.rotation = Some(Quaternion::new(record.pose.orientation_xyzw));
    }

    /// Returns true if the message belongs to the tick of this record.
    pub(crate) fn is_of(&self, record: &TickRecord) -> bool {
        self.timestamp == Some(timestamp(record.time_ns))
    }

    pub(crate) fn pose(&self) -> Result<Pose, Missing> {
        Ok(Pose {
            position_m: self.translation.ok_or(Missing("translation"))?.to_array(),
            orientation_xyzw: self.rotation.ok_or(Missing("rotation"))?.to_array(),
        })
    }
}

impl Twist {
    fn new(twist: &TwistValue) -> Self {
        let [linear, angular] = [twist.linear_m_per_s, twist.angular_rad_per_s].map(Vector3::new);
        Self { linear_m_per_s: Some(linear), angular_rad_per_s: Some(angular) }
    }

    fn value(self) -> Result<TwistValue, Missing> {
        Ok(TwistValue {
            linear_m_per_s: self.linear_m_per_s.ok_or(Missing("linear_m_per_s"))?.to_array(),
            angular_rad_per_s: self.angular_rad_per_s.ok_or(Missing("angular_rad_per_s"))?.to_array(),
        })
    }
}

impl Wrench {
    fn new(wrench: &WrenchValue) -> Self {
        let [force, torque] = [wrench.force_n, wrench.torque_nm].map(Vector3::new);
        Self { force_n: Some(force), torque_nm: Some(torque) }
    }

    /// Creates the message of the models' wrench, without an absent torque.
    fn of_models(outputs: &ModelOutputs) -> Self {
        let force_n = Some(Vector3::new(outputs.force().to_array()));
        Self { force_n, torque_nm: outputs.torque().map(|torque| Vector3::new(torque.to_array())) }
    }

    /// Returns the outputs of the models, with torque and energy absent where the messages have none.
    fn outputs(self, energy_j: Option<f64>) -> Result<ModelOutputs, Missing> {
        let force_n = self.force_n.ok_or(Missing("force_n"))?.to_array();
        let torque_nm = self.torque_nm.map(Vector3::to_array);
        let mut computed = Demand::FORCE;
        if torque_nm.is_some() {
            computed = computed.with(Demand::TORQUE);
        }
        if energy_j.is_some() {
            computed = computed.with(Demand::ENERGY);
        }
        let wrench = WrenchValue { force_n, torque_nm: torque_nm.unwrap_or_default() };
        Ok(ModelOutputs::new(wrench, energy_j.unwrap_or_default()).limited_to(computed))
    }

    fn value(self) -> Result<WrenchValue, Missing> {
        Ok(WrenchValue {
            force_n: self.force_n.ok_or(Missing("force_n"))?.to_array(),
            torque_nm: self.torque_nm.ok_or(Missing("torque_nm"))?.to_array(),
        })
    }
}

impl Tick {
    pub(crate) fn new(record: &TickRecord) -> Self {
        Self {
            tick: record.tick,
            time_ns: record.time_ns,
            dt_ns: record.dt_ns,
            twist: Some(Twist::new(&record.twist)),
            model: Some(Wrench::of_models(&record.model)),
            commanded: Some(Wrench::new(&record.commanded)),
            delivered: Some(Wrench::new(&record.delivered)),
            energy_j: record.model.energy_j(),
            port_energy_j: Some(record.port_energy_j),
            events: record.events.bits(),
            buttons: record.buttons,
            lateness_ns: record.lateness_ns,
            compute_ns: record.compute_ns,
            device: record.device.into(),
            grip: record.grip.map(Grip::new),
        }
    }

    /// Combines the message with the pose of the same time into the record of the tick.
    pub(crate) fn record(&self, pose: Pose) -> Result<TickRecord, Missing> {
        Ok(TickRecord {
            tick: self.tick,
            device: u16::try_from(self.device).map_err(|_| Missing("device"))?,
            time_ns: self.time_ns,
            dt_ns: self.dt_ns,
            pose,
            twist: self.twist.ok_or(Missing("twist"))?.value()?,
            model: self.model.ok_or(Missing("model"))?.outputs(self.energy_j)?,
            commanded: self.commanded.ok_or(Missing("commanded"))?.value()?,
            delivered: self.delivered.ok_or(Missing("delivered"))?.value()?,
            port_energy_j: self.port_energy_j(),
            grip: self.grip.map(|grip| grip.record()).transpose()?,
            events: Events::from_bits(self.events),
            buttons: self.buttons,
            lateness_ns: self.lateness_ns,
            compute_ns: self.compute_ns,
        })
    }
}

impl Grip {
    fn new(GripRecord { state, model, commanded }: GripRecord) -> Self {
        Self {
            opening: Some(state.opening),
            velocity: Some(state.velocity),
            delivered: Some(state.delivered),
            model: Some(model),
            commanded: Some(commanded),
            kind: Kind::from(state.kind()).into(),
        }
    }

    fn record(&self) -> Result<GripRecord, Missing> {
        let kind = self.kind().value().ok_or(Missing("grip.kind"))?;
        let state = GripState::new(kind, self.opening(), self.velocity()).with_delivered(self.delivered());
        Ok(GripRecord { state, model: self.model(), commanded: self.commanded() })
    }
}

impl Log {
    pub(crate) fn new(note: &Note) -> Self {
        let level = match note.severity {
            Severity::Info => Level::Info,
            Severity::Warning => Level::Warning,
            Severity::Error => Level::Error,
        };
        Self {
            timestamp: Some(timestamp(note.time_ns)),
            level: level.into(),
            message: note.text.clone(),
            name: note.source.clone(),
            ..Self::default()
        }
    }

    pub(crate) fn note(self, time_ns: u64) -> Note {
        let severity = match self.level() {
            Level::Unknown | Level::Debug | Level::Info => Severity::Info,
            Level::Warning => Severity::Warning,
            Level::Error | Level::Fatal => Severity::Error,
        };
        Note { time_ns, severity, source: self.name, text: self.message }
    }
}

impl Change {
    pub(crate) fn new(change: &ParameterChange) -> Self {
        Self {
            tick: change.tick,
            plugin: change.plugin.clone(),
            key: change.parameter.clone(),
            value: change.value.clone(),
            number: Some(change.number),
            outcome: Outcome::from(change.outcome).into(),
            subject: Subject::from(change.subject).into(),
            settings: crate::run::to_settings(&change.settings),
        }
    }

    pub(crate) fn change(self, time_ns: u64) -> Result<ParameterChange, Missing> {
        Ok(ParameterChange {
            outcome: self.outcome().value().ok_or(Missing("outcome"))?,
            subject: self.subject().value().ok_or(Missing("subject"))?,
            settings: crate::run::from_settings(self.settings.clone()),
            tick: self.tick,
            time_ns,
            number: self.number(),
            plugin: self.plugin,
            parameter: self.key,
            value: self.value,
        })
    }
}

/// Converts nanoseconds since the loop started to protobuf's time.
fn timestamp(time_ns: u64) -> Timestamp {
    const NS_PER_S: u64 = 1_000_000_000;
    // Neither can saturate: 2^64 / 10^9 fits in an i64, a remainder below 10^9 in an i32.
    let seconds = i64::try_from(time_ns / NS_PER_S).unwrap_or(i64::MAX);
    let nanos = i32::try_from(time_ns % NS_PER_S).unwrap_or(i32::MAX);
    Timestamp { seconds, nanos }
}
