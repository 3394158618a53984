//! The schemas inside a recording: up to date with `host/proto`, and enough for a stranger to read every field.

#[path = "../../src/plugin_description.rs"]
mod plugin_description;

use flotor_core::coupling::{CouplingConfig, CouplingDescription, CouplingEnd, CouplingEnds};
use flotor_core::grip::GripRecord;
use flotor_core::limits::PassivityMode;
use flotor_core::mapping::MappingConfig;
use flotor_core::trace::{Events, TickRecord};
use flotor_core::{Change, ChangeOutcome, ChangeSubject, ModelOutputs};
use flotor_hal::{GripKind, GripState, Pose, Twist, Wrench};
use flotor_record::{Note, PluginDescription, Recorder, Role, RunDescription, Severity};
use flotor_servo::Clock;
use plugin_description::described;
use prost_reflect::prost::Message;
use prost_reflect::prost_types::FileDescriptorSet;
use prost_reflect::{DescriptorPool, DynamicMessage, ReflectMessage, Value};
use std::path::{Path, PathBuf};

/// Set to write `host/proto/flotor.binpb` instead of comparing it.
const WRITE_SCHEMA: &str = "FLOTOR_WRITE_SCHEMA";

fn proto_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../host/proto")
}

/// Everything in the folder and what it imports, without comments and positions.
fn compiled() -> FileDescriptorSet {
    let mut compiler = protox::Compiler::new([proto_folder()]).expect("the folder exists");
    compiler.include_imports(true).include_source_info(false);
    compiler.open_files(["flotor.proto", "foxglove.proto"]).expect("well-formed protobuf");
    compiler.file_descriptor_set()
}

#[test]
fn the_committed_descriptor_set_is_the_compiled_proto_folder() {
    let path = proto_folder().join("flotor.binpb");
    let compiled = compiled().encode_to_vec();
    if std::env::var_os(WRITE_SCHEMA).is_some() {
        std::fs::write(&path, &compiled).unwrap();
    }
    let committed = std::fs::read(&path).unwrap();
    assert!(
        committed == compiled,
        "host/proto/flotor.binpb is out of date; {WRITE_SCHEMA}=1 cargo test -p flotor-tests --features formats recording_schema::"
    );
}

/// Names, numbers and types are facts of Foxglove's schemas; viewers find the messages by them.
#[test]
fn the_common_messages_are_foxgloves_in_name_number_and_type() {
    let pool = DescriptorPool::from_file_descriptor_set(compiled()).unwrap();
    let fields = |message: &str| -> Vec<String> {
        let message = pool.get_message_by_name(message).unwrap();
        let field = |f: prost_reflect::FieldDescriptor| format!("{} {} {:?}", f.number(), f.name(), f.kind());
        message.fields().map(field).collect()
    };
    let numbers = |names: &[&str]| -> Vec<String> {
        names.iter().enumerate().map(|(i, name)| format!("{} {name} double", i + 1)).collect()
    };
    assert_eq!(fields("foxglove.Vector3"), numbers(&["x", "y", "z"]));
    assert_eq!(fields("foxglove.Quaternion"), numbers(&["x", "y", "z", "w"]));
    assert_eq!(
        fields("foxglove.FrameTransform"),
        [
            "1 timestamp google.protobuf.Timestamp",
            "2 parent_frame_id string",
            "3 child_frame_id string",
            "4 translation foxglove.Vector3",
            "5 rotation foxglove.Quaternion",
        ]
    );
    assert_eq!(
        fields("foxglove.Log"),
        [
            "1 timestamp google.protobuf.Timestamp",
            "2 level foxglove.Log.Level",
            "3 message string",
            "4 name string",
            "5 file string",
            "6 line fixed32",
        ]
    );
}

/// A record whose every number differs from every other and from every default.
fn record() -> TickRecord {
    let mut last = 0.0;
    let mut number = || {
        last += 0.125;
        last
    };
    let mut three = || std::array::from_fn(|_| number());
    let position_m = three();
    let orientation_xyzw = [0.5, -0.5, 0.5, -0.5];
    let twist = Twist { linear_m_per_s: three(), angular_rad_per_s: three() };
    let mut wrench = || Wrench { force_n: three(), torque_nm: three() };
    TickRecord {
        tick: 7,
        device: 1,
        time_ns: 3_000_000_007,
        dt_ns: 1_000_001,
        pose: Pose { position_m, orientation_xyzw },
        twist,
        model: ModelOutputs::new(wrench(), 99.5),
        commanded: wrench(),
        delivered: wrench(),
        port_energy_j: 98.5,
        grip: Some(GripRecord {
            state: GripState::new(GripKind::Angular, 97.5, 96.5).with_delivered(95.5),
            model: 94.5,
            commanded: 93.5,
        }),
        events: Events::from_bits(0b101),
        buttons: 0b10,
        lateness_ns: 1234,
        compute_ns: 5678,
    }
}

fn run() -> RunDescription {
    let mapping = MappingConfig {
        rotation_xyzw: [0.5, 0.5, -0.5, 0.5],
        motion_scale: 25.0 / 15.0,
        force_scale: 2.0,
        torque_scale: Some(3.0),
    };
    RunDescription {
        flotor_version: "9.8.7".to_owned(),
        rate_hz: 1000.0,
        duration_s: 0.5,
        seed: u64::MAX,
        clock: Clock::Virtual,
        scene_toml: "rate_hz = 1000\n".to_owned(),
        plugins: vec![
            described("left", Role::Device),
            PluginDescription { device: 1, ..described("right", Role::Device) },
            PluginDescription { device: 1, ..described("spring", Role::Model(mapping)) },
        ],
        couplings: vec![CouplingDescription {
            name: "pair".to_owned(),
            config: CouplingConfig {
                stiffness_n_per_m: 600.5,
                damping_ns_per_m: 6.5,
                stiffness_nm_per_rad: 1.5,
                damping_nms_per_rad: 0.5,
                delay_ticks: 3,
                reserve_j: 0.25,
                passivity: PassivityMode::Control,
            },
            ends: CouplingEnds::Here([
                CouplingEnd { device: 0, mapping },
                CouplingEnd { device: 1, mapping },
            ]),
        }],
    }
}

/// The messages of a file, each decoded by the schema its channel carries: no type of ours takes part.
fn decode_as_a_stranger(file: &[u8]) -> Vec<(String, DynamicMessage)> {
    let decode = |message: mcap::Message<'_>| {
        let schema = message.channel.schema.as_ref().expect("every channel has a schema");
        assert_eq!(
            (schema.encoding.as_str(), message.channel.message_encoding.as_str()),
            ("protobuf", "protobuf")
        );
        let pool = DescriptorPool::decode(schema.data.as_ref()).expect("the schema is complete");
        let kind = pool.get_message_by_name(&schema.name).expect("the schema has its message");
        let decoded =
            DynamicMessage::decode(kind, message.data.as_ref()).expect("the message fits its schema");
        assert_eq!(decoded.unknown_fields().count(), 0, "{}: a field the schema does not know", schema.name);
        (message.channel.topic.clone(), decoded)
    };
    let stream = mcap::MessageStream::new(file).expect("a whole MCAP file");
    stream.map(|message| decode(message.expect("a whole message"))).collect()
}

/// Every leaf of a message as `path = value`, in the order of the schema; what is not set is left out.
fn leaves(prefix: &str, message: &DynamicMessage, out: &mut Vec<String>) {
    for (field, value) in message.fields() {
        value_leaves(&format!("{prefix}{}", field.name()), value, out);
    }
}

fn value_leaves(path: &str, value: &Value, out: &mut Vec<String>) {
    match value {
        Value::Message(message) => leaves(&format!("{path}."), message, out),
        Value::List(items) => {
            for (index, item) in items.iter().enumerate() {
                value_leaves(&format!("{path}[{index}]"), item, out);
            }
        }
        Value::String(text) => out.push(format!("{path} = {text:?}")),
        Value::F64(number) => out.push(format!("{path} = {number:?}")),
        other => out.push(format!("{path} = {other}")),
    }
}

fn expected_vector(path: &str, [x, y, z]: [f64; 3]) -> Vec<String> {
    vec![format!("{path}.x = {x:?}"), format!("{path}.y = {y:?}"), format!("{path}.z = {z:?}")]
}

fn expected_tick(record: &TickRecord) -> Vec<String> {
    let mut lines = vec![
        format!("tick = {}", record.tick),
        format!("time_ns = {}", record.time_ns),
        format!("dt_ns = {}", record.dt_ns),
    ];
    lines.extend(expected_vector("twist.linear_m_per_s", record.twist.linear_m_per_s));
    lines.extend(expected_vector("twist.angular_rad_per_s", record.twist.angular_rad_per_s));
    for (name, wrench) in [
        ("model", record.model.wrench().expect("all outputs")),
        ("commanded", record.commanded),
        ("delivered", record.delivered),
    ] {
        lines.extend(expected_vector(&format!("{name}.force_n"), wrench.force_n));
        lines.extend(expected_vector(&format!("{name}.torque_nm"), wrench.torque_nm));
    }
    lines.extend([
        "energy_j = 99.5".to_owned(),
        format!("events = {}", record.events.bits()),
        format!("buttons = {}", record.buttons),
        format!("lateness_ns = {}", record.lateness_ns),
        format!("compute_ns = {}", record.compute_ns),
        format!("port_energy_j = {:?}", record.port_energy_j),
        format!("device = {}", record.device),
    ]);
    let grip = [
        "opening = 97.5",
        "velocity = 96.5",
        "delivered = 95.5",
        "model = 94.5",
        "commanded = 93.5",
        "kind = 2",
    ];
    lines.extend(grip.map(|line| format!("grip.{line}")));
    lines
}

fn expected_pose(record: &TickRecord) -> Vec<String> {
    let [x, y, z, w] = record.pose.orientation_xyzw;
    let mut lines = vec![
        format!("timestamp.seconds = {}", record.time_ns / 1_000_000_000),
        format!("timestamp.nanos = {}", record.time_ns % 1_000_000_000),
        "parent_frame_id = \"right\"".to_owned(),
        "child_frame_id = \"right/handle\"".to_owned(),
    ];
    lines.extend(expected_vector("translation", record.pose.position_m));
    lines
        .extend([("x", x), ("y", y), ("z", z), ("w", w)].map(|(axis, v)| format!("rotation.{axis} = {v:?}")));
    lines
}

fn expected_run() -> Vec<String> {
    let plugin = |index: usize, name: &str| {
        let mut lines = vec![
            format!("plugins[{index}].name = {name:?}"),
            format!("plugins[{index}].id = \"{name}-id\""),
            format!("plugins[{index}].version = \"1.2.3\""),
            format!("plugins[{index}].file = \"lib{name}.so\""),
        ];
        for (list, item, key, value) in [
            ("settings", 0, "preset", "plain"),
            ("parameters", 0, "preset", "plain"),
            ("parameters", 1, "mass_kg", "0.58"),
        ] {
            lines.push(format!("plugins[{index}].{list}[{item}].key = {key:?}"));
            lines.push(format!("plugins[{index}].{list}[{item}].value = {value:?}"));
        }
        lines
    };
    let mut lines: Vec<String> = [
        "format = 2",
        "flotor_version = \"9.8.7\"",
        "rate_hz = 1000.0",
        "duration_s = 0.5",
        "seed = 18446744073709551615",
        "clock = 2",
        "scene_toml = \"rate_hz = 1000\\n\"",
    ]
    .map(str::to_owned)
    .into();
    lines.extend(plugin(0, "left"));
    lines.extend(["latency_s = 0.001", "felt = 2"].map(|line| format!("plugins[0].{line}")));
    lines.extend(plugin(1, "right"));
    lines.extend(["device = 1", "latency_s = 0.001", "felt = 2"].map(|line| format!("plugins[1].{line}")));
    lines.extend(plugin(2, "spring"));
    let mapping = [
        "rotation.x = 0.5".to_owned(),
        "rotation.y = 0.5".to_owned(),
        "rotation.z = -0.5".to_owned(),
        "rotation.w = 0.5".to_owned(),
        format!("motion_scale = {:?}", 25.0 / 15.0),
        "force_scale = 2.0".to_owned(),
        "torque_scale = 3.0".to_owned(),
    ];
    lines.extend(mapping.iter().map(|line| format!("plugins[2].mapping.{line}")));
    lines.extend(expected_vector("plugins[2].places[0]", [0.001, -0.002, 0.003]));
    lines.extend(expected_vector("plugins[2].places[1]", [0.25; 3]));
    lines.extend(
        ["weight = 0.5", "priority = 3", "fade_s = 0.25"].map(|line| format!("plugins[2].blend.{line}")),
    );
    lines.push("plugins[2].device = 1".to_owned());
    lines.extend(["rate_hz = 200.0", "latency_s = 0.0025"].map(|line| format!("plugins[2].field.{line}")));
    let contacts = [
        "stiffness_n_per_m = 900.0",
        "per_damping_1_per_s = 250.0",
        "surface_power_w = 0.5",
        "force_n = 3.0",
        "torque_nm = inf",
        "by_device_n_per_m = 120.0",
    ];
    lines.extend(contacts.map(|line| format!("plugins[2].field.contacts.{line}")));
    let coupling = [
        "name = \"pair\"",
        "stiffness_n_per_m = 600.5",
        "damping_ns_per_m = 6.5",
        "stiffness_nm_per_rad = 1.5",
        "damping_nms_per_rad = 0.5",
        "delay_ticks = 3",
        "reserve_j = 0.25",
        "passivity = 2",
    ];
    lines.extend(coupling.map(|line| format!("couplings[0].{line}")));
    lines.extend(mapping.iter().map(|line| format!("couplings[0].ends[0].mapping.{line}")));
    lines.push("couplings[0].ends[1].device = 1".to_owned());
    lines.extend(mapping.iter().map(|line| format!("couplings[0].ends[1].mapping.{line}")));
    lines
}

#[test]
fn a_stranger_reads_every_field_by_the_schema_in_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let note = Note {
        time_ns: 3_000_000_007,
        severity: Severity::Error,
        source: "device".to_owned(),
        text: "a coil is too hot".to_owned(),
    };
    let change = Change {
        tick: 7,
        time_ns: 3_000_000_007,
        plugin: "spring".to_owned(),
        parameter: "gamma_n".to_owned(),
        value: "20.5".to_owned(),
        number: 20.5,
        outcome: ChangeOutcome::Refused,
        subject: ChangeSubject::Weight,
        settings: vec![("variant".to_owned(), "rod".to_owned())],
    };
    let mut recorder = Recorder::create(&path, &run()).unwrap();
    recorder.change(&change).unwrap();
    recorder.record(&record()).unwrap();
    recorder.note(&note).unwrap();
    recorder.finish().unwrap();

    let messages = decode_as_a_stranger(&std::fs::read(&path).unwrap());
    let read: Vec<(&str, Vec<String>)> = messages
        .iter()
        .map(|(topic, message)| {
            let mut lines = Vec::new();
            leaves("", message, &mut lines);
            // A field that is never set must not hide behind this list; of a log, file and line are not.
            let set = message.fields().count();
            let known = message.descriptor().fields().count();
            assert!(set == known || topic == "/flotor/log", "{topic}: {set} of {known} fields are set");
            (topic.as_str(), lines)
        })
        .collect();
    let log = [
        "timestamp.seconds = 3".to_owned(),
        "timestamp.nanos = 7".to_owned(),
        "level = 4".to_owned(),
        "message = \"a coil is too hot\"".to_owned(),
        "name = \"device\"".to_owned(),
    ];
    let changed = [
        "tick = 7",
        "plugin = \"spring\"",
        "key = \"gamma_n\"",
        "value = \"20.5\"",
        "number = 20.5",
        "outcome = 2",
        "subject = 1",
        "settings[0].key = \"variant\"",
        "settings[0].value = \"rod\"",
    ];
    let expected = [
        ("/flotor/run", expected_run()),
        ("/flotor/change", changed.map(str::to_owned).into()),
        ("/tf", expected_pose(&record())),
        ("/flotor/tick", expected_tick(&record())),
        ("/flotor/log", log.into()),
    ];
    assert_eq!(read, expected);
}
