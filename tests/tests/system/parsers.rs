//! Whatever lies in a file, reading it ends with an answer or one line that says what is wrong: no panic, no endless
//! loop, no half-read value. Files are whole ones with a few bytes, lines or lengths changed, which gets deeper than
//! noise does; the seeds are fixed, so a failure comes back.

use flotor_hal::Demand;
use flotor_lab::poses::Poses;
use flotor_live::{Ask, Frames, Kind, Request, SetValue, frame, ticks_from_payload};
use flotor_loader::read_metadata;
use flotor_record::Recording;
use flotor_session::calibration_file::CalibrationFile;
use flotor_session::scene::{DEMO, Scene};
use flotor_simulated::hand::Script;
use flotor_study::log::SittingLog;
use flotor_tests::library::plugin_bytes;
use flotor_tests::program::{Flotor, exit_code};
use flotor_tests::random::Random;
use flotor_tests::scratch::Scratch;
use flotor_tests::{TestSize, workspace_root};
use sha2::{Digest, Sha256};
use std::path::Path;

/// Files per reader.
fn cases() -> usize {
    TestSize::of_this_run().pick(2_000, 200_000)
}

/// A copy of `whole` with one to eight wounds: flipped bits, wild bytes, wild 32-bit numbers, cuts, repeats.
fn wounded(whole: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = whole.to_vec();
    for _ in 0..=random.below(8) {
        let at = random.below(bytes.len());
        let length = 1 + random.below(40);
        let end = (at + length).min(bytes.len());
        match random.below(6) {
            0 if at < bytes.len() => bytes[at] ^= 1 << random.below(8),
            1 if at < bytes.len() => bytes[at] = [0, 1, 0x7f, 0x80, 0xff, b'"', b'\n', b'-'][random.below(8)],
            2 if at + 4 <= bytes.len() => {
                let wild = [0_u32, 1, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff, 64][random.below(6)];
                bytes[at..at + 4].copy_from_slice(&wild.to_le_bytes());
            }
            3 => bytes.truncate(at),
            4 => drop(bytes.drain(at..end)),
            _ => {
                let again = bytes[at..end].to_vec();
                bytes.splice(at..at, again);
            }
        }
    }
    bytes
}

/// Reads mutated copies of a text; of each that is refused, how many errors name a line. Both kinds must occur.
fn mutated(seed: u64, whole: &[u8], read: impl Fn(&[u8]) -> Result<(), String>) -> (usize, usize) {
    let mut random = Random(seed);
    let (mut refused, mut placed) = (0, 0);
    let cases = TestSize::of_this_run().pick(2_000, 50_000);
    for _ in 0..cases {
        if let Err(text) = read(&wounded(whole, &mut random)) {
            assert_one_line(&text);
            refused += 1;
            placed += usize::from(names_a_line(&text));
        }
    }
    assert!(0 < refused && refused < cases, "{refused} of {cases} refused");
    (refused, placed)
}

/// Whether a text begins with `FILE:LINE: `, or with `line LINE: ` where the caller knows the file.
fn names_a_line(text: &str) -> bool {
    let after = text.strip_prefix("line ").or_else(|| text.split_once(':').map(|(_, rest)| rest));
    let number = after.and_then(|rest| rest.split_once(':')).map_or("", |(number, _)| number);
    !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit())
}

/// What a reader says must be one line that a person can act on.
fn assert_one_line(error: &dyn std::fmt::Display) {
    let text = error.to_string();
    assert!(!text.trim().is_empty() && text.lines().count() == 1, "{text:?}");
}

#[test]
fn scenes() {
    let mut random = Random(1);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..cases() {
        let text = String::from_utf8_lossy(&wounded(DEMO.as_bytes(), &mut random)).into_owned();
        match Scene::parse(Path::new("scene.toml"), &text) {
            Ok(scene) => {
                read += 1;
                assert!((100.0..=10_000.0).contains(&scene.rate_hz), "{}", scene.rate_hz);
                assert!(scene.duration_s >= 0.0 && scene.duration_s.is_finite(), "{}", scene.duration_s);
            }
            Err(error) => {
                refused += 1;
                let text = error.to_string();
                assert!(text.starts_with("scene.toml"), "no place: {text}");
                assert_one_line(&error);
            }
        }
    }
    // Wounds in comments leave a scene whole, most others do not: both kinds of file were met.
    assert!(read > 0 && refused > 0, "{read} read, {refused} refused");
}

/// Processor time of this thread.
fn processor_time_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + time.tv_nsec as f64 * 1.0e-9
}

/// Four times the changes take four times as long, not sixteen.
#[test]
fn a_scene_is_read_in_time_proportional_to_its_length() {
    let change = "[[change]]\nat_s = 1\nset = \"spring.gamma_n=20\"\n";
    let scene = |changes| format!("{DEMO}\n{}", change.repeat(changes));
    let took = |text: &str| {
        let shortest = (0..5).map(|_| {
            let started = processor_time_s();
            Scene::parse(Path::new("scene.toml"), text).expect("a scene");
            processor_time_s() - started
        });
        shortest.fold(f64::INFINITY, f64::min)
    };
    let ratio = took(&scene(8000)) / took(&scene(2000));
    assert!(ratio < 8.0, "{ratio}");
}

#[test]
fn recordings() {
    let scratch = Scratch::default();
    let whole = scratch.path().join("whole.mcap");
    let mut scene = Scene::demo().expect("the demo is a scene");
    scene.duration_s = 0.05;
    let registry =
        flotor_session::registry::Registry::search(&[flotor_tests::library::build_folder().join("deps")]);
    flotor_session::headless::run(&scene, &registry, 1, Some(&whole), Demand::FORCE).expect("the demo runs");
    let whole = std::fs::read(whole).expect("it was just written");
    let file = scratch.path().join("wounded.mcap");
    let mut random = Random(2);
    let (mut read, mut refused) = (0, 0);
    // Each is a file of its own, and a reader takes milliseconds to open one.
    for _ in 0..cases() / 16 {
        std::fs::write(&file, wounded(&whole, &mut random)).expect("scratch can be written");
        match Recording::open(&file) {
            Ok(recording) => {
                // Never more ticks than were recorded, give or take what a wound repeats.
                let mut ticks = 0;
                for record in recording {
                    match record {
                        Ok(_) => ticks += 1,
                        Err(error) => assert_one_line(&error),
                    }
                    assert!(ticks <= 200, "a recording of 50 ticks has no end");
                }
                read += 1;
            }
            Err(error) => {
                refused += 1;
                assert_one_line(&error);
            }
        }
    }
    assert!(read > 0 && refused > 0, "{read} read, {refused} refused");
}

#[test]
fn metadata_of_plugins() {
    let scratch = Scratch::default();
    let whole = plugin_bytes("flotor-wall");
    let file = scratch.path().join("wounded.so");
    let mut random = Random(3);
    let (mut read, mut refused) = (0, 0);
    // A library is large, and each case writes one.
    for _ in 0..cases() / 10 {
        // Headers are where a reader can be led astray: half of the wounds go there.
        let head = whole.len().min(4096);
        let bytes = match random.below(2) {
            0 => [&wounded(&whole[..head], &mut random), &whole[head..]].concat(),
            _ => wounded(&whole, &mut random),
        };
        std::fs::write(&file, bytes).expect("scratch can be written");
        match read_metadata(&file) {
            Ok(metadata) => {
                read += 1;
                assert!(!metadata.id.is_empty());
            }
            Err(error) => {
                refused += 1;
                assert_one_line(&error);
            }
        }
    }
    assert!(read > 0 && refused > 0, "{read} read, {refused} refused");
}

/// Text that is no UTF-8 is what a reader of text never sees: these read bytes as they are, the others a repaired copy.
fn text_of(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn scripts_of_the_hand() {
    let whole =
        std::fs::read(workspace_root().join("devices/simulated/scripts/press.toml")).expect("it is there");
    let (refused, placed) = mutated(4, &whole, |bytes| {
        let script = Script::parse("hand.toml", &text_of(bytes)).map_err(|error| error.to_string())?;
        assert!(script.end_ns() < u64::MAX / 2, "a script without an end");
        Ok(())
    });
    // A file without a step has no line to name.
    assert!(placed * 10 > refused * 9, "{placed} of {refused} with a line");
}

#[test]
fn calibrations() {
    let whole = "format = 1\n[device]\nplugin = \"simulated\"\nserial = \"s1\"\n[vertical]\nrange_mm = [-7.0, 7.0]\n\
                 coefficients_per_mm = [1.05, -0.006, -0.0011]\n[quality]\nresidual_n = 0.02\n[provenance]\n\
                 source = \"measured\"\nprogram = \"flotor 0.1.0\"\ndate = 2026-03-01\n";
    let (refused, placed) = mutated(5, whole.as_bytes(), |bytes| {
        let read = CalibrationFile::parse("unit.toml", &text_of(bytes));
        let (_, curve) = read.map_err(|error| error.to_string())?;
        assert!((4.9..=20.1).contains(&curve.command_n(10.0, 0.0)), "{curve:?}");
        Ok(())
    });
    // A missing table has none.
    assert!(placed * 2 > refused, "{placed} of {refused} with a line");
}

#[test]
fn curves() {
    let whole = "# measured\ncompression_mm,force_n\n0,0\n2,1.36\n4,2.75\n6,4.2\n8,5.7\n";
    let (refused, placed) = mutated(6, whole.as_bytes(), |bytes| {
        let read = flotor_measured::table::parse(&text_of(bytes));
        read.map(drop).map_err(|wrong| wrong.in_file("curve.csv"))
    });
    assert_eq!(placed, refused, "each names a line");
}

#[test]
fn poses() {
    let whole =
        "id,x_m,y_m,z_m,rx_rad,ry_rad,rz_rad\na,0,0,-0.005,0,0,0\nb,0.001,nan,0,0.1,0,0\nc,0,0,inf,0,0,0\n";
    let (refused, placed) = mutated(7, whole.as_bytes(), |bytes| {
        let poses = Poses::parse("poses.csv", bytes.to_vec()).map_err(|error| error.to_string())?;
        assert_eq!(poses.ids.len(), poses.handles.len());
        Ok(())
    });
    // A file without a line has none.
    assert!(placed * 10 > refused * 9, "{placed} of {refused} with a line");
}

/// Of a log, half of the copies get a chain that fits, so that what lies behind it is read too.
#[test]
fn logs_of_experiments() {
    let scratch = Scratch::default();
    let out = scratch.path().join("data");
    let jnd =
        "study jnd --bases 26 --replications 2 --no-demo --feel 50ms --apparatus none --subjects 1 --out";
    let ran = Flotor::with(jnd.split(' ').chain(out.to_str())).run();
    assert_eq!(ran.code, Some(exit_code::OK), "{ran:#?}");
    let log = out.join("sourcedata/sub-01/sub-01_task-jnd_log.jsonl");
    let whole = std::fs::read_to_string(log).expect("the experiment has written it");
    let (file, mut random) = (scratch.path().join("log.jsonl"), Random(8));
    let (cases, mut read, mut refused) = (TestSize::of_this_run().pick(300, 5_000), 0, 0);
    for case in 0..cases {
        let bytes = if case % 2 == 0 {
            wounded(whole.as_bytes(), &mut random)
        } else {
            rechained(&whole, &mut random)
        };
        std::fs::write(&file, bytes).expect("scratch can be written");
        match SittingLog::read(&file) {
            Ok(_) => read += 1,
            Err(error) => {
                refused += 1;
                assert_one_line(&error);
                let text = error.to_string();
                let has_line = text.contains("log.jsonl:") && error.line > 0;
                assert!(has_line || text.contains("has no complete line"), "{text}");
            }
        }
    }
    assert!(read > 0 && refused > 0, "{read} read, {refused} refused");
}

/// A copy with one wounded event, and a chain over what is there now.
fn rechained(whole: &str, random: &mut Random) -> Vec<u8> {
    let events = whole.lines().filter_map(|line| line.split_once("\"event\":")?.1.strip_suffix('}'));
    let mut events: Vec<String> = events.map(str::to_owned).collect();
    let at = random.below(events.len());
    events[at] = text_of(&wounded(events[at].as_bytes(), random)).replace('\n', " ");
    let mut chain = "flotor-study-log".to_owned();
    let mut text = String::new();
    for event in events {
        let digest = Sha256::new().chain_update(&chain).chain_update(&event).finalize();
        chain = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        text.push_str(&format!("{{\"chain\":\"{chain}\",\"event\":{event}}}\n"));
    }
    text.into_bytes()
}

/// What a client sends and what a host sends, cut into frames and read as far as it goes.
#[test]
fn messages_on_the_socket() {
    let set = SetValue { plugin: "spring".into(), parameter: "gamma_n".into(), value: "17".into() };
    let request = |number, ask| serde_json::to_vec(&Request { number, ask }).expect("a request is JSON");
    let whole = [
        frame(Kind::Request, &request(1, Ask::Watch { every: 10 })),
        frame(Kind::Request, &request(2, Ask::Set { values: vec![set] })),
        frame(Kind::Request, &request(3, Ask::Weight { model: "spring".into(), weight: 0.5 })),
        frame(Kind::Ticks, &[7; 8 + 39 * 8 * 3]),
    ]
    .concat();
    mutated(9, &whole, |bytes| {
        let mut frames = Frames::default();
        frames.push(bytes);
        let mut taken = 0;
        while let Some((kind, payload)) = frames.take().map_err(|error| error.to_string())? {
            taken += 1;
            assert!(taken <= bytes.len() / 5, "more frames than there are heads");
            match kind {
                Kind::Ticks => drop(ticks_from_payload(payload)),
                _ => drop(serde_json::from_slice::<Request>(payload).map_err(|error| error.to_string())?),
            }
        }
        Ok(())
    });
}
