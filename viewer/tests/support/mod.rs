//! What the tests of the window share: a host that is none, where plugins lie, and a display.

#![allow(dead_code)] // each test program uses its part

pub(crate) mod display;
#[path = "../../../tests/src/process.rs"]
#[allow(unreachable_pub)]
pub(crate) mod process;
#[path = "../../../tests/src/tools.rs"]
#[allow(unreachable_pub)]
pub(crate) mod tools;

use flotor_core::Clock;
use flotor_core::mapping::{Blend, MappingConfig};
use flotor_core::trace::{Events, RECORD_WORDS, TickRecord};
use flotor_hal::{Demand, SoftRange};
use flotor_live::{
    Answer, Ask, ChangeMessage, Directory, End, EndKind, Frames, Greeting, Kind, Listener, Outcome, PROTOCOL,
    PanelPlugin, RefusalCause, Request, SetValue, Subject, WrenchLimits, frame, ticks_to_payload,
};
use flotor_record::{PluginDescription, Role, RunDescription};
use flotor_sync::Words;
use std::io::Write;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// No test waits longer than this for anything.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// The library of a plugin: beside the tests, where `cargo build` and `cargo test` put what they compile.
pub(crate) fn plugin_file(name: &str) -> PathBuf {
    let own = std::env::current_exe().expect("a test is a program");
    let file = own.with_file_name(format!("libflotor_{name}.so"));
    assert!(file.is_file(), "{} is missing: run `cargo build` first", file.display());
    file
}

/// A run of a spring that nobody computes: what `flotor run` would say of it.
pub(crate) fn spring_run(settings: &[(&str, &str)]) -> (RunDescription, Vec<PanelPlugin>) {
    model_run("spring", settings)
}

/// A run of a model that nobody computes: what `flotor run` would say of it.
pub(crate) fn model_run(id: &str, settings: &[(&str, &str)]) -> (RunDescription, Vec<PanelPlugin>) {
    let file = plugin_file(id);
    let plugin = flotor_viewer::shape::load_file(&file).expect("the model loads");
    let owned = |(key, value): &(&str, &str)| ((*key).to_owned(), (*value).to_owned());
    let settings: Vec<(String, String)> = settings.iter().map(owned).collect();
    let parse = |(key, value): &(String, String)| {
        flotor_loader::Setting::parse(plugin.parameters(), key, value).expect("a legal setting")
    };
    let parsed: Vec<_> = settings.iter().map(parse).collect();
    let mut model = plugin.create_model(&parsed).expect("a legal model");
    let schema = plugin.parameters();
    let in_force = schema.iter().enumerate().map(|(index, parameter)| {
        let number = model.parameter(index);
        let mut choices = (0_u32..).zip(parameter.choices());
        let choice =
            choices.find(|(at, _)| f64::from(*at) == number).map(|(_, choice)| choice.as_str().to_owned());
        (parameter.id().to_owned(), choice.unwrap_or_else(|| number.to_string()))
    });
    let parameters: Vec<(String, String)> = in_force.collect();
    let description = |name: &str, role, settings: Vec<(String, String)>, parameters| PluginDescription {
        name: name.to_owned(),
        id: if name == "device" { "simulated".to_owned() } else { name.to_owned() },
        version: "0.1.0".to_owned(),
        file: String::new(),
        role,
        places_m: Vec::new(),
        shared_with: Vec::new(),
        blend: Blend::default(),
        field: None,
        latency_s: 0.0,
        at_hand: Demand::WRENCH,
        settings,
        parameters,
        device: 0,
    };
    let run = RunDescription {
        flotor_version: "0.1.0".to_owned(),
        rate_hz: 1000.0,
        duration_s: 10.0,
        seed: 1,
        clock: Clock::Real,
        scene_toml: "title = \"A spring under test\"\n".to_owned(),
        plugins: vec![
            description("device", Role::Device, Vec::new(), Vec::new()),
            description(id, Role::Model(MappingConfig::default()), settings, parameters.clone()),
        ],
        couplings: Vec::new(),
    };
    let number = |(_, value): &(String, String)| value.parse().unwrap_or(f64::NAN);
    let values = parameters.iter().map(number);
    let soft: Vec<_> = schema.iter().zip(values).map(|(one, value)| SoftRange::around(one, value)).collect();
    let panels = vec![guided_device(), PanelPlugin::new(id, id, file, schema, &parameters, &soft)];
    (run, panels)
}

/// A run of devices with these names, without a model.
pub(crate) fn run_of_devices(title: &str, names: &[&str]) -> RunDescription {
    let (mut run, _) = spring_run(&[]);
    run.scene_toml = format!("title = \"{title}\"\n");
    run.plugins.retain(|plugin| plugin.role == Role::Device);
    let first = run.plugins.remove(0);
    let device = |(device, name): (u16, &&str)| PluginDescription {
        name: (*name).to_owned(),
        device,
        ..first.clone()
    };
    run.plugins = (0..).zip(names).map(device).collect();
    run
}

/// What a host says of the simulated device, as far as it is live: the guide of its hand.
fn guided_device() -> PanelPlugin {
    let plugin = flotor_viewer::shape::load_file(&plugin_file("simulated")).expect("the device loads");
    let mut device = PanelPlugin::new("device", "simulated", PathBuf::new(), plugin.parameters(), &[], &[]);
    device.is_simulated = true;
    device.parameters.retain(|parameter| parameter.live);
    device
}

/// A tick of a handle that goes up and down once a second.
pub(crate) fn tick(number: u64, events: Events) -> TickRecord {
    let mut record = TickRecord::from_words(&[0; RECORD_WORDS]);
    let time_s = number as f64 * 1.0e-3;
    let z_m = -0.002 * (1.0 - (std::f64::consts::TAU * time_s).cos());
    record.tick = number;
    record.time_ns = number * 1_000_000;
    record.dt_ns = 1_000_000;
    record.pose.position_m = [0.0, 0.0, z_m];
    record.pose.orientation_xyzw = [0.0, 0.0, 0.0, 1.0];
    record.commanded.force_n = [0.0, 0.0, -700.0 * z_m];
    record.events = events;
    record
}

/// Something that talks like a host.
pub(crate) struct FakeHost {
    pub(crate) directory: Directory,
    listener: Listener,
    greeting: Greeting,
    run: RunDescription,
    stream: Option<UnixStream>,
    frames: Frames,
    next_tick: u64,
}

impl FakeHost {
    /// Listens in a folder of its own.
    pub(crate) fn new(folder: &tempfile::TempDir, settings: &[(&str, &str)]) -> Self {
        Self::of_model(folder, "spring", settings)
    }

    /// Listens in a folder of its own, for a run of a simulated device with a model.
    pub(crate) fn of_model(folder: &tempfile::TempDir, id: &str, settings: &[(&str, &str)]) -> Self {
        let directory = Directory::at(folder.path().join("runs"));
        let listener = directory.listen().expect("a scratch folder takes a socket");
        let (run, plugins) = model_run(id, settings);
        let greeting = Greeting {
            protocol: PROTOCOL,
            flotor_version: "0.1.0".to_owned(),
            process: std::process::id(),
            title: "A spring under test".to_owned(),
            plugins,
            limits: WrenchLimits {
                force_n: [Some(30.0); 3],
                torque_nm: [Some(1.0); 3],
                force_norm_n: Some(30.0),
                torque_norm_nm: Some(1.0),
            },
        };
        Self { directory, listener, greeting, run, stream: None, frames: Frames::default(), next_tick: 0 }
    }

    /// Listens in a folder of its own, for a run of these devices without a model.
    pub(crate) fn of_devices(folder: &tempfile::TempDir, title: &str, names: &[&str]) -> Self {
        let mut host = Self::new(folder, &[]);
        host.run = run_of_devices(title, names);
        title.clone_into(&mut host.greeting.title);
        host
    }

    /// Sends the next so many ticks of so many devices.
    pub(crate) fn run_ticks_of(&mut self, devices: u16, count: u64, events: Events) {
        let numbers = self.next_tick..self.next_tick + count;
        let of_device = |number, device| TickRecord { device, ..tick(number, events) };
        let records: Vec<TickRecord> =
            numbers.flat_map(|number| (0..devices).map(move |device| of_device(number, device))).collect();
        self.next_tick += count;
        for some in records.chunks(1000) {
            self.send(Kind::Ticks, &ticks_to_payload(0, some.iter()));
        }
    }

    /// Meets a client on a thread while `meet` makes one.
    pub(crate) fn welcome<T>(&mut self, meet: impl FnOnce(&Directory) -> T) -> T {
        let hello = [
            frame(Kind::Greeting, &serde_json::to_vec(&self.greeting).expect("it is JSON")),
            frame(Kind::Run, &self.run.to_bytes()),
        ]
        .concat();
        let (met, stream) = std::thread::scope(|scope| {
            let accepting = scope.spawn(|| {
                let mut stream = self.listener.accept().expect("somebody comes");
                stream.write_all(&hello).expect("they listen");
                stream.set_read_timeout(Some(PATIENCE)).expect("a time-out is legal");
                stream
            });
            let met = meet(&self.directory);
            (met, accepting.join().expect("the host waits"))
        });
        self.stream = Some(stream);
        met
    }

    fn send(&mut self, kind: Kind, payload: &[u8]) {
        let stream = self.stream.as_mut().expect("somebody watches");
        stream.write_all(&frame(kind, payload)).expect("they listen");
    }

    /// Sends the next so many ticks.
    pub(crate) fn run_ticks(&mut self, count: u64, events: Events) {
        let records: Vec<TickRecord> =
            (self.next_tick..self.next_tick + count).map(|n| tick(n, events)).collect();
        self.next_tick += count;
        for some in records.chunks(1000) {
            self.send(Kind::Ticks, &ticks_to_payload(0, some.iter()));
        }
    }

    /// Nothing has been asked that was not answered, as far as it has arrived.
    pub(crate) fn nothing_is_asked(&mut self) {
        let stream = self.stream.as_mut().expect("somebody watches");
        stream.set_read_timeout(Some(Duration::from_millis(200))).expect("a time-out is legal");
        let filled = self.frames.fill(stream);
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out is legal");
        let asked = self.frames.take().expect("they talk sense");
        assert!(filled.is_err() && asked.is_none(), "something was asked: {asked:?}");
    }

    /// All requests that have arrived, or do soon.
    pub(crate) fn all_requests(&mut self) -> Vec<Ask> {
        let mut asked = Vec::new();
        loop {
            while let Some((_, payload)) = self.frames.take().expect("they talk sense") {
                asked.push(serde_json::from_slice::<Request>(payload).expect("a request").ask);
            }
            let stream = self.stream.as_mut().expect("somebody watches");
            stream.set_read_timeout(Some(Duration::from_millis(200))).expect("a time-out is legal");
            let filled = self.frames.fill(stream);
            stream.set_read_timeout(Some(PATIENCE)).expect("a time-out is legal");
            if filled.is_err() {
                return asked;
            }
        }
    }

    /// The next request; answered with yes or the reason why not.
    pub(crate) fn request(&mut self, refused: Option<&str>) -> Ask {
        let until = Instant::now() + PATIENCE;
        loop {
            assert!(Instant::now() < until, "nothing is asked");
            if let Some((kind, payload)) = self.frames.take().expect("they talk sense") {
                assert_eq!(kind, Kind::Request);
                let Request { number, ask } = serde_json::from_slice(payload).expect("a request");
                let cause = RefusalCause::Other;
                let answer = Answer { number, refused: refused.map(str::to_owned), cause };
                self.send(Kind::Answer, &serde_json::to_vec(&answer).expect("it is JSON"));
                return ask;
            }
            let stream = self.stream.as_mut().expect("somebody watches");
            self.frames.fill(stream).expect("they talk");
        }
    }

    /// Tells that a parameter changed, as a loop does.
    pub(crate) fn changed(&mut self, SetValue { plugin, parameter, value }: &SetValue, outcome: Outcome) {
        let change = ChangeMessage {
            tick: self.next_tick,
            time_ns: self.next_tick * 1_000_000,
            plugin: plugin.clone(),
            subject: Subject::Parameter,
            parameter: parameter.clone(),
            value: value.clone(),
            number: value.parse().unwrap_or(0.0),
            outcome,
            settings: Vec::new(),
        };
        self.send(Kind::Change, &serde_json::to_vec(&change).expect("it is JSON"));
    }

    /// The run is over.
    pub(crate) fn end(&mut self, words: &str) {
        self.end_as(words, EndKind::InOrder);
    }

    /// The run is over, in order or not.
    pub(crate) fn end_as(&mut self, words: &str, kind: EndKind) {
        let end = End { words: words.to_owned(), kind };
        self.send(Kind::End, &serde_json::to_vec(&end).expect("it is JSON"));
        self.stream = None;
    }
}
