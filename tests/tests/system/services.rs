//! Haply's Inverse Service and the ML API, served for any device: one state for each message, forces of all clients added inside the
//! limits, and whatever a client does, neither limits nor summary go with it.

use super::drop_ins::{MOST_N, largest_n};
use flotor_hal::DVec3;
use flotor_tests::TestSize;
use flotor_tests::library::build_folder;
use flotor_tests::process::Owned;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::scratch::Scratch;
use rustix::process::Signal;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::time::Duration;

/// The service in a process of its own; ended with the test.
pub(super) struct Service {
    pub(super) process: Owned,
    pub(super) simulation: String,
    events: String,
}

impl Service {
    pub(super) fn start(arguments: &[&str]) -> Self {
        let program =
            build_folder().join(format!("flotor-haply-service-emulator{}", std::env::consts::EXE_SUFFIX));
        let mut command = Command::new(program);
        command.args(["--listen", "127.0.0.1:0", "--events", "127.0.0.1:0"]).args(arguments);
        let mut process = Owned::start(command.stdout(Stdio::piped()).stderr(Stdio::piped()));
        let mut first = String::new();
        let output = process.stdout.take().expect("a pipe was requested");
        BufReader::new(output).read_line(&mut first).expect("its output is text");
        let address = |before: &str| {
            let rest = first.split(before).nth(1).expect("the first line says where it is");
            rest.split('/').next().unwrap_or_default().to_owned()
        };
        let (simulation, events) = (address("listening ws://"), address("events ws://"));
        Self { process, simulation, events }
    }

    fn client(&self) -> Client {
        Client::connect(&self.simulation)
    }

    /// A session, and the id of its first device.
    fn session(&self) -> (Client, String) {
        let mut client = self.client();
        let first = client.receive();
        let id = first["inverse3"][0]["device_id"].as_str().expect("a device has an id").to_owned();
        (client, id)
    }

    /// An answer by HTTP: its status and its JSON.
    fn http(&self, method: &str, path: &str, body: &str) -> (String, Value) {
        let mut stream = TcpStream::connect(&self.simulation).expect("it listens");
        let length = body.len();
        write!(
            stream,
            "{method} {path} HTTP/1.1\r\nHost: localhost\r\nContent-Length: {length}\r\n\r\n{body}"
        )
        .expect("it reads");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("it answers and closes");
        let (head, body) = answer.split_once("\r\n\r\n").expect("it is an answer by HTTP");
        (head.lines().next().unwrap_or_default().to_owned(), serde_json::from_str(body).expect("it is JSON"))
    }

    /// Ends it in order; what it said of the run.
    pub(super) fn end(self) -> String {
        self.process.signal(Signal::TERM);
        let output = self.process.output();
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).expect("it writes text")
    }
}

/// A client of a WebSocket: bytes and no more.
struct Client(TcpStream);

const TEXT: u8 = 1;
const PING: u8 = 9;

impl Client {
    fn connect(address: &str) -> Self {
        let mut stream = TcpStream::connect(address).expect("it listens");
        stream.set_read_timeout(Some(Duration::from_secs(20))).expect("it is a connection");
        stream.set_nodelay(true).expect("it is a connection");
        let key = "dGhlIHNhbXBsZSBub25jZQ==";
        write!(
            stream,
            "GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: {key}\r\n\
             Sec-WebSocket-Version: 13\r\n\r\n"
        )
        .expect("it reads");
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).expect("it answers");
            head.extend(byte);
        }
        // The accept key of RFC 6455, section 1.3.
        assert!(String::from_utf8_lossy(&head).contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), "{head:?}");
        Self(stream)
    }

    fn frame(first: u8, payload: &[u8]) -> Vec<u8> {
        let mut frame = vec![first];
        match payload.len() {
            short @ 0..126 => frame.push(0x80 | u8::try_from(short).expect("it is short")),
            long => {
                frame.push(0x80 | 127);
                frame.extend((long as u64).to_be_bytes());
            }
        }
        frame.extend([0; 4]); // a mask that changes nothing
        frame.extend(payload);
        frame
    }

    fn send_raw(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).expect("it reads");
    }

    /// The next frame: its kind and its text.
    fn receive_frame(&mut self) -> Option<(u8, String)> {
        let mut head = [0; 2];
        self.0.read_exact(&mut head).ok()?;
        let length = match head[1] {
            126 => {
                let mut length = [0; 2];
                self.0.read_exact(&mut length).ok()?;
                usize::from(u16::from_be_bytes(length))
            }
            short => usize::from(short),
        };
        let mut payload = vec![0; length];
        self.0.read_exact(&mut payload).ok()?;
        Some((head[0] & 0xF, String::from_utf8_lossy(&payload).into_owned()))
    }

    fn receive(&mut self) -> Value {
        let (kind, text) = self.receive_frame().expect("it answers");
        assert_eq!(kind, TEXT, "{text}");
        serde_json::from_str(&text).expect("it is JSON")
    }

    fn ask(&mut self, message: &str) -> Value {
        self.send_raw(&Self::frame(0x80 | TEXT, message.as_bytes()));
        self.receive()
    }

    fn push(&mut self, id: &str, force: [f64; 3]) -> Value {
        self.ask(&force_of(id, "vector", force))
    }
}

fn force_of(id: &str, key: &str, [x, y, z]: [f64; 3]) -> String {
    let force = json!({ key: { "x": x, "y": y, "z": z } });
    json!({ "inverse3": [{ "device_id": id, "commands": { "set_cursor_force": force } }] }).to_string()
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from_array(["x", "y", "z"].map(|name| value[name].as_f64().expect("it is a number")))
}

fn state(message: &Value) -> &Value {
    &message["inverse3"][0]["state"]
}

/// Ticks until force has faded in.
const RAMP: usize = 220;

#[test]
fn a_web_page_and_a_foreign_name_are_refused_and_settings_have_a_bound() {
    let service = Service::start(&["--pace", "lockstep"]);
    for port in [&service.simulation, &service.events] {
        for headers in
            ["Host: localhost\r\nOrigin: http://evil.example\r\n", "Host: rebound.evil.example\r\n"]
        {
            let mut stream = TcpStream::connect(port).expect("it listens");
            let upgrade =
                "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZQ==\r\n";
            write!(stream, "GET / HTTP/1.1\r\n{headers}{upgrade}\r\n").expect("it reads");
            let mut answer = String::new();
            stream.read_to_string(&mut answer).expect("it answers and closes");
            assert!(answer.starts_with("HTTP/1.1 403 "), "{answer}");
        }
    }
    let setting = format!("\"{}\"", "x".repeat(60_000));
    let kept = (0..40).map(|number| service.http("POST", &format!("/settings/{number}"), &setting).0);
    let refused = kept.filter(|status| status.contains(" 507 ")).count();
    assert_eq!(refused, 40 - (1 << 20) / 60_010, "settings have 1 MB together");
    let _ = service.end();
}

#[test]
fn a_port_beyond_this_machine_needs_consent() {
    let program =
        build_folder().join(format!("flotor-haply-service-emulator{}", std::env::consts::EXE_SUFFIX));
    let output = Command::new(program).args(["--listen", "0.0.0.0:0"]).output().expect("it starts");
    let text = String::from_utf8_lossy(&output.stderr);
    assert!(
        output.status.code() == Some(exit_code::CONFIGURATION) && text.contains("--allow-remote"),
        "{text}"
    );
}

#[test]
fn a_client_gets_an_inventory_then_one_state_for_each_message_and_its_force_with_those_of_others() {
    let service = Service::start(&["--pace", "lockstep"]);
    let mut client = service.client();
    let first = client.receive();
    assert_eq!(first["inverse3"][0]["config"]["type"], "inverse3", "{first}");
    assert_eq!(
        first["wireless_verse_grip"][0]["state"]["buttons"],
        json!({ "a": false, "b": false, "c": false })
    );
    let id = first["inverse3"][0]["device_id"].as_str().expect("a device has an id").to_owned();
    // What only reads makes no tick; nothing comes that nobody asked for.
    assert_eq!(state(&client.ask("{}"))["cursor_position"], state(&first)["cursor_position"]);
    let (mut other, _) = service.session();
    let mut before = vector(&state(&first)["cursor_position"]);
    let mut highest = f64::MIN;
    for _ in 0..RAMP {
        other.push(&id, [0.5, 0.0, 0.0]);
        let told = client.ask(&force_of(&id, "values", [0.0, 0.0, 1.0]));
        let (at, velocity) =
            (vector(&state(&told)["cursor_position"]), vector(&state(&told)["cursor_velocity"]));
        // Two ticks of a millisecond between two states; 8 N on half a kilogram change the velocity by 0.03 m/s in them.
        assert!(((at - before) / 2.0e-3 - velocity).length() < 0.03, "{told}");
        highest = highest.max(at.z);
        before = at;
    }
    let told = client.push(&id, [0.0, 0.0, 1.0]);
    let applied = vector(&state(&told)["current_cursor_force"]);
    assert!((applied - DVec3::new(0.5, 0.0, 1.0)).length() < 1.0e-12, "{told}");
    assert_eq!((&state(&told)["control_mode"], &state(&told)["mode"]), (&json!("force"), &json!("idle")));
    assert!((before - DVec3::new(0.0, -0.12, 0.15)).length() < 0.02 && highest > before.z - 0.02, "{before}");
    // A session that is gone takes its force along, at once.
    drop(other);
    std::thread::sleep(Duration::from_millis(200));
    let told = (0..30).map(|_| client.push(&id, [0.0, 0.0, 1.0])).last().expect("there is one");
    assert!((vector(&state(&told)["current_cursor_force"]) - DVec3::Z).length() < 1.0e-12, "{told}");
    let summary = service.end();
    assert!(summary.contains("asked for 1.118 N"), "{summary}");
}

/// The loop of a simulator's client: it receives, sends a force for the first device, and pauses for 5 ms. Each of its messages has its
/// answer, and the hand gets the force.
#[test]
fn a_client_that_receives_first_and_pauses_gets_an_answer_to_each_message() {
    let service = Service::start(&[]);
    let mut client = service.client();
    let mut told = client.receive();
    let grip = &told["wireless_verse_grip"][0];
    assert!(grip["device_id"].is_string() && grip["state"]["orientation"].is_object(), "{told}");
    assert!(grip["state"]["buttons"].is_object(), "{told}");
    for _ in 0..600 {
        let id = told["inverse3"][0]["device_id"].as_str().expect("a device has an id");
        let force = force_of(id, "values", [0.0, 0.0, 1.0]);
        client.send_raw(&Client::frame(0x80 | TEXT, force.as_bytes()));
        std::thread::sleep(Duration::from_millis(5));
        told = client.receive();
    }
    let applied = vector(&state(&told)["current_cursor_force"]);
    assert!((applied - DVec3::Z).length() < 1.0e-12, "{told}");
    let _ = service.end();
}

#[test]
fn a_session_sees_a_device_in_axes_of_its_own_and_all_of_it_can_be_set_by_http_too() {
    let service = Service::start(&["--pace", "lockstep"]);
    let (mut client, id) = service.session();
    let plain = vector(&state(&client.ask("{}"))["cursor_position"]);
    let configure = json!({ "session": { "configure": { "profile": { "name": "test:one" }, "basis": { "permutation": "XZ-Y" } },
        "force_render_full_state": {} } });
    let told = client.ask(&configure.to_string());
    assert_eq!(told["session"]["config"]["profile"]["name"], "test:one");
    assert_eq!(told["inverse3"][0]["config"]["basis"]["permutation"], "XZ-Y");
    let own = vector(&state(&told)["cursor_position"]);
    assert_eq!(own, DVec3::new(plain.x, plain.z, -plain.y));
    // Up is y here: the force that is told is the one that was sent.
    let told = (0..RAMP).map(|_| client.push(&id, [0.0, 1.0, 0.0])).last().expect("there is one");
    assert!((vector(&state(&told)["current_cursor_force"]) - DVec3::Y).length() < 1.0e-12, "{told}");

    let (status, version) = service.http("GET", "/version", "");
    assert!(status.ends_with("200 OK") && version["project_version"].is_string(), "{version}");
    assert_eq!(service.http("GET", "/devices", "").1["inverse3"][0]["device_id"], id.as_str());
    let sessions = service.http("GET", "/sessions", "").1;
    assert_eq!(sessions["data"]["sessions"][0]["config"]["profile"]["name"], "test:one", "{sessions}");
    let path = "/inverse3/0/config/basis?session=test:one";
    assert_eq!(service.http("POST", path, r#"{"permutation": "XYZ"}"#).1["ok"], true);
    assert_eq!(service.http("GET", path, "").1["data"]["permutation"], "XYZ");
    let moved = r#"{"transform": {"position": {"x": 1.0, "y": 0.0, "z": 0.0}}}"#;
    assert_eq!(service.http("POST", &format!("/inverse3/{id}/config/mount?session=:0"), moved).1["ok"], true);
    let at = vector(&state(&client.ask("{}"))["cursor_position"]);
    assert!((at.x - 1.0).abs() < 0.02, "{at}");
    let filter = format!("/inverse3/{id}/config/filters/force_gate?session=:-1");
    assert_eq!(service.http("POST", &filter, r#"{"gain": 1.0}"#).1["data"]["gain"], 1.0);
    for (method, path) in [
        ("GET", "/nowhere"),
        ("GET", "/inverse3/9/config/basis?session=:0"),
        ("GET", "/inverse3/0/config/basis?session=:7"),
    ] {
        let (status, told) = service.http(method, path, "");
        assert!(status.contains("404") && told["ok"] == false, "{path}: {status} {told}");
    }
    let mut events = Client::connect(&service.events);
    assert_eq!(events.receive()["name"], "device-connected");
    client.ask(r#"{"inverse3": [{"device_id": "none"}]}"#);
    let event = events.receive();
    assert_eq!(
        (&event["name"], &event["data"]["field"]),
        (&json!("invalid-value"), &json!("device_id")),
        "{event}"
    );
}

#[test]
fn messages_that_are_wrong_get_a_state_and_an_event_and_never_more_force_than_the_limits() {
    let scratch = Scratch::default();
    let recording = scratch.path().join("run.mcap");
    let service = Service::start(&["--pace", "lockstep", "--record", &recording.display().to_string()]);
    let (mut client, id) = service.session();
    let command =
        |commands: &str| format!(r#"{{"inverse3": [{{"device_id": "{id}", "commands": {{{commands}}}}}]}}"#);
    let wrong = [
        "nonsense".to_owned(),
        "[]".to_owned(),
        "null".to_owned(),
        "[".repeat(100_000),
        r#"{"inverse3": 5, "session": []}"#.to_owned(),
        command(r#""set_cursor_force": {"vector": {"x": NaN, "y": 0, "z": 0}}"#),
        command(r#""set_cursor_force": {"vector": {"x": 1e999, "y": 0, "z": 0}}"#),
        command(r#""set_cursor_force": {"vector": {"x": 1}}"#),
        command(r#""set_cursor_force": 7"#),
        command(r#""set_transform": {"transform": {"scale": {"x": 0, "y": 1, "z": 1}}}"#),
        command(r#""fly": {}"#),
    ];
    let mut events = Client::connect(&service.events);
    events.receive();
    for message in &wrong[..] {
        let told = client.ask(message);
        assert!(state(&told)["cursor_position"].is_object(), "{told}");
        if !message.contains(r#""inverse3": 5"#) {
            assert_eq!(events.receive()["name"], "invalid-value", "{}", message.get(..80).unwrap_or(message));
        }
    }
    let calls = TestSize::of_this_run().pick(2_000, 1_000_000);
    for call in 0..calls {
        let sign = if call / 20 % 2 == 0 { 1.0 } else { -1.0 };
        let size = [40.0, 1.0e308, 1.0e12][call % 3];
        let told = client.push(&id, [sign * size, -size, size]);
        assert!(vector(&state(&told)["current_cursor_force"]).length() <= MOST_N * (1.0 + 1.0e-12), "{told}");
    }
    // Control frames are no messages; pieces of a message are one.
    client.send_raw(&Client::frame(0x80 | PING, b"still there"));
    assert_eq!(client.receive_frame(), Some((10, "still there".to_owned())));
    let whole = force_of(&id, "vector", [1.0, 0.0, 0.0]);
    client.send_raw(&Client::frame(TEXT, &whole.as_bytes()[..20]));
    client.send_raw(&Client::frame(0x80, &whole.as_bytes()[20..]));
    assert_eq!(state(&client.receive())["control_mode"], "force");
    // One that is too long, one that is cut off, one that is no frame: the connection ends, the service does not.
    for bytes in [Client::frame(0x80 | TEXT, &vec![b' '; 10_000_000]), vec![0x81, 0xFE, 0x10], vec![0xFF; 64]]
    {
        let (mut hostile, _) = service.session();
        let _ = hostile.0.write_all(&bytes);
    }
    assert!(state(&client.ask("{}"))["cursor_position"].is_object());
    let summary = service.end();
    assert!(summary.contains("the hand got 8.000 N"), "{summary}");
    let (largest_n, ticks) = largest_n(&recording);
    assert!(largest_n > 0.9 * MOST_N && largest_n <= MOST_N * (1.0 + 1.0e-12), "{largest_n} N");
    assert!(ticks >= calls, "{ticks} ticks");
}

#[test]
fn in_lockstep_messages_that_only_read_make_a_tick_now_and_then() {
    let service = Service::start(&["--pace", "lockstep"]);
    let (mut client, _) = service.session();
    let places: Vec<DVec3> =
        (0..1000).map(|_| vector(&state(&client.ask("{}"))["cursor_position"])).collect();
    let ticks = places.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert!((9..=10).contains(&ticks), "a hundred reads for a tick, not {ticks} in 1000");
    let summary = service.end();
    assert!(summary.contains("this program only reads"), "{summary}");
}

#[test]
fn in_lockstep_the_same_messages_give_the_same_digest() {
    let scratch = Scratch::default();
    let summary = scratch.path().join("summary.json");
    let run = || {
        let service = Service::start(&["--pace", "lockstep", "--json", &summary.display().to_string()]);
        let (mut client, id) = service.session();
        for call in 0..1000 {
            let told = client.push(&id, [f64::from(call % 7) * 0.1, 0.0, -0.5]);
            assert!(told["session_id"].is_u64());
        }
        drop(client);
        service.end();
        let text = std::fs::read_to_string(&summary).expect("a summary was requested");
        serde_json::from_str::<Value>(&text).expect("it is JSON")
    };
    let first = run();
    assert_eq!(first["ticks"], 1001, "one at the start, one for each command");
    assert_eq!(run()["trace_digest"], first["trace_digest"]);
}

/// In real time: a client that stalls, and one that ends without a word.
#[test]
fn the_force_of_a_client_that_stalls_or_dies_fades() {
    let service = Service::start(&[]);
    let (mut client, id) = service.session();
    let pushed = (0..400).map(|_| client.push(&id, [3.0, 0.0, 0.0])).last().expect("there is one");
    assert!(vector(&state(&pushed)["current_cursor_force"]).x > 0.0, "{pushed}");
    std::thread::sleep(Duration::from_millis(400));
    let told = client.ask("{}");
    assert_eq!(vector(&state(&told)["current_cursor_force"]), DVec3::ZERO, "{told}");
    assert_eq!(state(&told)["control_mode"], "idle", "{told}");
    client.push(&id, [3.0, 0.0, 0.0]);
    drop(client);
    let (mut watcher, _) = service.session();
    std::thread::sleep(Duration::from_millis(400));
    assert_eq!(vector(&state(&watcher.ask("{}"))["current_cursor_force"]), DVec3::ZERO);
    let summary = service.end();
    assert!(summary.contains("expired without a newer wrench"), "{summary}");
}

#[test]
fn a_service_is_lent_beside_a_program_and_what_cannot_be_is_said_in_one_line() {
    for (api, address) in [("haply", "ws://127.0.0.1:"), ("ml-api", "127.0.0.1:")] {
        let ran =
            Flotor::with(["lend", "--api", api, "--listen", "127.0.0.1:0", "--", "sh", "-c", "exit 7"]).run();
        assert_eq!(ran.code, Some(7), "{ran:?}");
        assert!(ran.stderr.contains(&format!("`--api {api}` is served at {address}")), "{ran:?}");
        assert!(ran.stdout.contains("  digest     xxh3:"), "{ran:?}");
    }
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port is free");
    let taken = taken.local_addr().map(|address| (address.to_string(), taken)).expect("it is bound");
    let cases = [
        (vec!["--api", "haply", "--listen", &taken.0], "cannot listen at", exit_code::CONFIGURATION),
        (vec!["--api", "ml-api", "--listen", &taken.0], "cannot listen at", exit_code::PLUGIN_REFUSED),
        (vec!["--listen", "127.0.0.1:0"], "--listen is for", exit_code::CONFIGURATION),
        (vec!["--api", "haply", "no-such.toml"], "`no-such.toml` is not a scene", exit_code::CONFIGURATION),
        (vec!["--api", "ml-api", "--pace", "lockstep"], "flotor emulate maglev", exit_code::CONFIGURATION),
        (vec!["--api", "hd"], "haply and ml-api", exit_code::CONFIGURATION),
    ];
    for (arguments, said, code) in cases {
        let ran = Flotor::with([&["lend"], &arguments[..], &["--", "true"]].concat()).run();
        assert_eq!(ran.code, Some(code), "{arguments:?}: {ran:?}");
        assert!(ran.error().contains(said), "{arguments:?}: {ran:?}");
    }
    // Without the service: the programs in a folder of their own.
    let scratch = Scratch::default();
    let alone = scratch.folder("alone");
    let programs = ["flotor", "flotor-lend"].map(|name| build_folder().join(name));
    let copied = Command::new("cp").args(programs).arg(&alone).status();
    assert!(copied.is_ok_and(|copied| copied.success()), "they can be copied");
    let output = Command::new(alone.join("flotor"))
        .args(["lend", "--api", "haply", "--", "true"])
        .output()
        .expect("it starts");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("-p flotor-haply-service`") && said.trim_end().lines().count() == 1, "{said}");
}

/// A device may be refused before the service listens, which ends `lend` before the program, or after it.
#[test]
fn a_lent_run_that_is_refused_is_the_exit_code_of_a_program_that_did_not_mind() {
    let scratch = Scratch::default();
    let scene = "[device]\nplugin = \"haply\"\n[device.parameters]\nport = \"/dev/no-such-port\"\n";
    let scene = scratch.file("scene.toml", scene).display().to_string();
    let lend = ["lend", "--api", "ml-api", "--listen", "127.0.0.1:0", &scene, "--", "sh", "-c"];
    for (end, code) in [("exit 0", exit_code::PLUGIN_REFUSED), ("exit 7", 7)] {
        let ran = Flotor::with([&lend[..], &[end]].concat()).run();
        let code = if ran.stderr.contains("is served at") { code } else { exit_code::PLUGIN_REFUSED };
        assert_eq!(ran.code, Some(code), "{ran:?}");
        assert!(ran.stderr.contains("/dev/no-such-port"), "{ran:?}");
    }
}

/// A service that nobody needs any more would hold a device, and the port of the next one.
#[test]
fn a_service_ends_with_the_process_that_lends_it() {
    let free =
        TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port is free");
    let address = free.to_string();
    for api in ["haply", "ml-api"] {
        let lending = Flotor::with(["lend", "--api", api, "--listen", &address, "--", "sleep", "20"]).start();
        let becomes = |is_there: bool| {
            let looks = (0..600).find(|_| {
                std::thread::sleep(Duration::from_millis(50));
                TcpStream::connect(&address).is_ok() == is_there
            });
            assert!(looks.is_some(), "{api}: there: {is_there}");
        };
        becomes(true);
        lending.signal(Signal::KILL);
        becomes(false);
    }
}
