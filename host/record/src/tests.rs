#[path = "../../../tests/src/plugin_description.rs"]
mod plugin_description;
#[path = "../../../tests/src/random.rs"]
mod random;

use super::file::NewFile;
use super::schema::{DESCRIPTOR_SET, ENCODING, FORMAT, Topic};
use super::*;
use flotor_core::Clock;
use flotor_core::mapping::MappingConfig;
use flotor_core::trace::{Events, RECORD_WORDS, TIMING_WORDS, TickRecord};
use flotor_hal::Demand;
use flotor_sync::Words;
use mcap::records::op;
use plugin_description::described;
use prost::Message;
use random::Random;
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A file of its own for a test, gone afterwards.
struct TestFile(PathBuf);

impl TestFile {
    fn new(test: &str) -> Self {
        Self(std::env::temp_dir().join(format!("flotor-record-{}-{test}.mcap", std::process::id())))
    }

    fn with(test: &str, bytes: &[u8]) -> Self {
        let file = Self::new(test);
        fs::write(&file.0, bytes).unwrap();
        file
    }

    fn length(&self) -> u64 {
        fs::metadata(&self.0).unwrap().len()
    }
}

impl Drop for TestFile {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

fn run() -> RunDescription {
    let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
    let turned = MappingConfig { rotation_xyzw: [0.6, 0.0, -0.0, 0.8], ..MappingConfig::default() };
    let scaled = MappingConfig { motion_scale: 25.0 / 15.0, torque_scale: Some(0.1), ..turned };
    let plugin = |name: &str, role, settings| PluginDescription {
        at_hand: if role == Role::Device { Demand::FORCE } else { Demand::WRENCH },
        settings,
        ..described(name, role)
    };
    RunDescription {
        flotor_version: "9.8.7".to_owned(),
        rate_hz: 1000.0 / 3.0,
        duration_s: 0.1,
        seed: u64::MAX,
        clock: Clock::Real,
        scene_toml: "title = \"ü\"\n".to_owned(),
        plugins: vec![
            plugin("device", Role::Device, vec![pair("preset", "full")]),
            plugin("left", Role::Model(turned), vec![]),
            plugin("right", Role::Model(scaled), vec![pair("variant", "rod"), pair("variant", "energy")]),
        ],
        couplings: Vec::new(),
    }
}

/// A tick with a number of its own in every field; `dt_ns` after the one before.
fn tick(index: u64, dt_ns: u64) -> TickRecord {
    let mut words: [u64; RECORD_WORDS] = std::array::from_fn(|i| (index as f64 + i as f64 / 64.0).to_bits());
    [words[0], words[1], words[2]] = [index, index * dt_ns, dt_ns];
    words[36] = index | (index + 1) << 32;
    let [.., kind, lateness_ns, compute_ns] = &mut words;
    [*kind, *lateness_ns, *compute_ns] = [1 + index % 2, 10 * index, 20 * index];
    TickRecord::from_words(&words)
}

fn write(path: &Path, ticks: &[TickRecord]) {
    let mut recorder = Recorder::create(path, &run()).unwrap();
    ticks.iter().for_each(|tick| recorder.record(tick).unwrap());
    recorder.finish().unwrap();
}

/// Everything that can be read, and what ended it.
fn read(path: &Path) -> (Vec<TickRecord>, Result<Ending, ReadError>) {
    let mut recording = match Recording::open(path) {
        Ok(recording) => recording,
        Err(error) => return (Vec::new(), Err(error)),
    };
    let mut ticks = Vec::new();
    for tick in &mut recording {
        match tick {
            Ok(tick) => ticks.push(tick),
            Err(error) => return (ticks, Err(error)),
        }
    }
    (ticks, Ok(recording.ending()))
}

fn words(ticks: &[TickRecord]) -> Vec<[u64; RECORD_WORDS]> {
    ticks.iter().map(Words::to_words).collect()
}

/// Asserts that a text contains all parts.
fn holds(text: &str, parts: &[&str]) {
    parts.iter().for_each(|part| assert!(text.contains(part), "{text}"));
}

/// Ticks of 100 ms: a chunk holds three of them.
fn three_chunks() -> Vec<TickRecord> {
    (0..9).map(|index| tick(index, 100_000_000)).collect()
}

#[test]
fn ticks_come_back_bit_for_bit() {
    let signaling_nan = 0x7ff0_0000_dead_beef;
    let specials = [
        0,
        (-0.0_f64).to_bits(),
        1,
        u64::MAX,
        f64::INFINITY.to_bits(),
        signaling_nan,
        f64::MIN_POSITIVE.to_bits(),
    ];
    let mut ticks: Vec<TickRecord> =
        specials.iter().map(|&word| TickRecord::from_words(&[word; RECORD_WORDS])).collect();
    let mut random = Random(1);
    ticks.extend((0..2000).map(|kind| {
        TickRecord::from_words(&std::array::from_fn(|word| if word == 42 { kind % 3 } else { random.bits() }))
    }));

    let file = TestFile::new("bits");
    write(&file.0, &ticks);
    let (back, end) = read(&file.0);
    assert_eq!(end.unwrap(), Ending::Finished);
    assert!(words(&back) == words(&ticks));
}

#[test]
fn the_description_of_a_run_comes_back() {
    let file = TestFile::new("description");
    write(&file.0, &[]);
    let mut recording = Recording::open(&file.0).unwrap();
    assert_eq!(recording.run(), &run());
    assert!(recording.next().is_none());

    // The same in the metadata record, as flat text.
    let bytes = fs::read(&file.0).unwrap();
    let is_metadata = |record| match record {
        mcap::records::Record::Metadata(metadata) => Some(metadata),
        _ => None,
    };
    let records = mcap::read::LinearReader::new(&bytes).unwrap().map(Result::unwrap);
    let metadata = records.filter_map(is_metadata).next().unwrap();
    assert_eq!(metadata.name, "flotor.run");
    for (key, value) in [
        ("rate_hz", "333.3333333333333"),
        ("clock", "real"),
        ("scene_toml", "title = \"ü\"\n"),
        ("right.mapping.motion_scale", "1.6666666666666667"),
        ("device.settings.preset", "full"),
        ("left.parameters.mass_kg", "0.58"),
    ] {
        assert_eq!(metadata.metadata.get(key).map(String::as_str), Some(value), "{key}");
    }
}

#[test]
fn notes_are_there_once_the_ticks_before_them_are_read() {
    let note = |time_ns, severity, text: &str| Note {
        time_ns,
        severity,
        source: "spring".into(),
        text: text.into(),
    };
    let notes = [note(5, Severity::Warning, "left its domain"), note(9, Severity::Error, "panicked")];
    let file = TestFile::new("notes");
    let mut recorder = Recorder::create(&file.0, &run()).unwrap();
    recorder.record(&tick(0, 1)).unwrap();
    recorder.note(&notes[0]).unwrap();
    recorder.record(&tick(1, 1)).unwrap();
    recorder.note(&notes[1]).unwrap();
    recorder.finish().unwrap();

    let mut recording = Recording::open(&file.0).unwrap();
    assert_eq!(recording.next().unwrap().unwrap().tick, 0);
    assert_eq!(recording.notes(), []);
    assert_eq!(recording.next().unwrap().unwrap().tick, 1);
    assert_eq!(recording.notes(), &notes[..1]);
    assert!(recording.next().is_none());
    assert_eq!(recording.notes(), notes);
}

#[test]
fn a_file_cut_off_at_any_byte_gives_its_whole_chunks_and_says_so() {
    let ticks = three_chunks();
    let file = TestFile::new("cut");
    let mut recorder = Recorder::create(&file.0, &run()).unwrap();
    // Where the description ends, and each chunk after it.
    let mut flushed = vec![file.length()];
    for tick in &ticks {
        recorder.record(tick).unwrap();
        if file.length() > flushed[flushed.len() - 1] {
            flushed.push(file.length());
        }
    }
    recorder.finish().unwrap();
    assert_eq!(flushed.len(), 4, "three chunks");

    let handle = OpenOptions::new().write(true).open(&file.0).unwrap();
    for length in (0..file.length()).rev() {
        handle.set_len(length).unwrap();
        let (back, end) = read(&file.0);
        assert!(words(&back) == words(&ticks[..back.len()]), "cut at {length}");
        assert_eq!(back.len() % 3, 0, "cut at {length}: {} ticks", back.len());
        let whole_chunks = flushed.iter().skip(1).filter(|&&end| end <= length).count();
        assert!(back.len() >= 3 * whole_chunks, "cut at {length}: {} ticks", back.len());
        match end {
            Ok(ending) => assert_eq!(ending, Ending::CutOff, "cut at {length}"),
            Err(ReadError::CutOffAtStart(_)) => assert!(length < flushed[0]),
            Err(other) => panic!("cut at {length}: {other}"),
        }
    }
}

/// Whatever is left of a file, the repaired one has an index and an end, all that could be read, and still says that it is truncated.
#[test]
fn a_truncated_file_is_repaired_for_every_reader() {
    let ticks = three_chunks();
    let (file, cut, whole) = (TestFile::new("to-cut"), TestFile::new("is-cut"), TestFile::new("repaired"));
    write(&file.0, &ticks);
    let bytes = std::fs::read(&file.0).unwrap();
    assert!(matches!(repair(&file.0, &whole.0), Err(RepairError::Complete(_))));
    assert!(!whole.0.exists(), "nothing was to be written");
    let mut counts = std::collections::BTreeSet::new();
    for length in (0..bytes.len()).step_by(7) {
        std::fs::write(&cut.0, &bytes[..length]).unwrap();
        let (back, end) = read(&cut.0);
        let _ = std::fs::remove_file(&whole.0);
        let repaired = repair(&cut.0, &whole.0);
        if let Err(ReadError::CutOffAtStart(_)) = end {
            assert!(matches!(repaired, Err(RepairError::Read(ReadError::CutOffAtStart(_)))), "{length}");
            continue;
        }
        let repaired = repaired.unwrap();
        assert_eq!((repaired.ticks, repaired.damage.is_none()), (back.len() as u64, true), "{length}");
        let (again, ending) = read(&whole.0);
        assert!(words(&again) == words(&back), "cut at {length}");
        assert_eq!(ending.unwrap(), Ending::CutOff, "cut at {length}");
        let bytes = std::fs::read(&whole.0).unwrap();
        let summary = mcap::Summary::read(&bytes).unwrap().expect("it has a summary");
        let messages =
            mcap::MessageStream::new(&bytes).unwrap().collect::<Result<Vec<_>, _>>().unwrap().len() as u64;
        assert_eq!(summary.stats.unwrap().message_count, messages, "cut at {length}");
        counts.insert(back.len());
    }
    assert_eq!(counts.into_iter().collect::<Vec<_>>(), [0, 3, 6, 9]);
    // A repaired file is whole: there is nothing more to repair.
    assert!(matches!(repair(&whole.0, &cut.0.with_extension("again")), Err(RepairError::Complete(_))));
}

#[test]
fn a_damaged_file_is_repaired_up_to_the_damage() {
    let (file, whole) = (TestFile::new("damaged"), TestFile::new("repaired-damage"));
    write(&file.0, &three_chunks());
    let mut bytes = std::fs::read(&file.0).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x20;
    std::fs::write(&file.0, &bytes).unwrap();
    let (back, end) = read(&file.0);
    assert!(matches!(end, Err(ReadError::Damaged { .. })), "{end:?}");
    let repaired = repair(&file.0, &whole.0).unwrap();
    assert!(repaired.damage.is_some() && repaired.ticks == back.len() as u64, "{repaired:?}");
    let (again, ending) = read(&whole.0);
    assert_eq!((words(&again), ending.unwrap()), (words(&back), Ending::CutOff));
}

#[test]
fn a_process_killed_at_any_tick_loses_less_than_250_ms() {
    for (rate_hz, count) in [(1_000, 1_100), (100, 110), (10_000, 11_000), (3, 10)] {
        let dt_ns = 1_000_000_000 / rate_hz;
        let file = TestFile::new(&format!("killed-{rate_hz}"));
        let mut recorder = Recorder::create(&file.0, &run()).unwrap();
        let (mut length, mut kept) = (file.length(), 0);
        for index in 0..count {
            recorder.record(&tick(index, dt_ns)).unwrap();
            if file.length() > length {
                (length, kept) = (file.length(), index + 1);
            }
            let lost_ns = (index + 1 - kept) * dt_ns;
            assert!(lost_ns < 250_000_000, "{lost_ns} ns lost at {rate_hz} Hz, tick {index}");
        }
        // What is in the process's own buffers never reaches the file, no destructor runs.
        std::mem::forget(recorder);
        let (back, end) = read(&file.0);
        assert_eq!((back.len() as u64, end.unwrap()), (kept, Ending::CutOff));
    }
}

#[test]
fn room_a_file_system_never_filled_is_the_end() {
    let file = TestFile::new("zeros");
    let mut recorder = Recorder::create(&file.0, &run()).unwrap();
    three_chunks().iter().for_each(|tick| recorder.record(tick).unwrap());
    std::mem::forget(recorder);
    OpenOptions::new().append(true).open(&file.0).unwrap().write_all(&[0; 5000]).unwrap();
    let (back, end) = read(&file.0);
    assert_eq!((back.len(), end.unwrap()), (9, Ending::CutOff));
}

/// Offsets of the file's own records (not those in chunks) with their opcode.
fn records(bytes: &[u8]) -> Vec<(usize, u8)> {
    let mut at = mcap::MAGIC.len();
    let mut found = Vec::new();
    while let Some((&opcode, rest)) = bytes[at..].split_first().filter(|(_, rest)| rest.len() > 8) {
        found.push((at, opcode));
        at += 9 + usize::try_from(u64::from_le_bytes(rest[..8].try_into().unwrap())).unwrap();
    }
    found
}

/// Distance of the bytes that are changed: one, but three where no size is asked for (`FLOTOR_TEST_SIZE`).
fn stride() -> usize {
    if std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size != "quick") { 1 } else { 3 }
}

/// Reads the file once for every byte of it, that byte turned to something else.
fn for_every_wrong_byte(
    file: &TestFile,
    mut check: impl FnMut(usize, Vec<TickRecord>, Result<Ending, ReadError>),
) {
    let bytes = fs::read(&file.0).unwrap();
    let mut handle = OpenOptions::new().write(true).open(&file.0).unwrap();
    let mut put = |at: usize, byte: u8| {
        handle.seek(SeekFrom::Start(at as u64)).unwrap();
        handle.write_all(&[byte]).unwrap();
    };
    for (at, &byte) in bytes.iter().enumerate().step_by(stride()) {
        for wrong in [byte ^ 0xff, byte ^ 0x01] {
            put(at, wrong);
            let (ticks, end) = read(&file.0);
            check(at, ticks, end);
        }
        put(at, byte);
    }
}

#[test]
fn a_wrong_byte_is_told_or_does_no_harm() {
    let ticks = three_chunks();
    let file = TestFile::new("wrong-byte");
    write(&file.0, &ticks);
    let data_end =
        records(&fs::read(&file.0).unwrap()).into_iter().find(|(_, opcode)| *opcode == op::DATA_END);
    let (data_end, _) = data_end.unwrap();
    for_every_wrong_byte(&file, |at, back, end| {
        assert!(words(&back) == words(&ticks[..back.len()]), "byte {at}");
        match end {
            Ok(_) => assert_eq!(back.len(), ticks.len(), "byte {at}"),
            Err(_) => assert!(at < data_end + 9 + 4, "byte {at} of the index is not needed"),
        }
    });
}

#[test]
fn nonsense_without_checksums_never_panics() {
    let file = TestFile::new("nonsense");
    write(&file.0, &three_chunks()[..4]);
    let mut bytes = fs::read(&file.0).unwrap();
    for (at, opcode) in records(&bytes) {
        // MCAP: a checksum of zero is none. Chunk: after two times and a size; data end: its only field.
        let checksum = match opcode {
            op::CHUNK => at + 9 + 24,
            op::DATA_END => at + 9,
            _ => continue,
        };
        bytes[checksum..checksum + 4].fill(0);
    }
    fs::write(&file.0, &bytes).unwrap();
    let mut refused = 0;
    for_every_wrong_byte(&file, |_, _, end| refused += usize::from(end.is_err()));
    assert!(refused > 1000 / stride(), "{refused}");
}

#[test]
fn a_record_longer_than_its_chunk_is_damage() {
    let file = TestFile::new("long-record");
    write(&file.0, &[]);
    let mut bytes = fs::read(&file.0).unwrap();
    let chunk = records(&bytes).into_iter().find(|(_, opcode)| *opcode == op::CHUNK);
    let (chunk, _) = chunk.unwrap();
    bytes[chunk + 9 + 24..][..4].fill(0);
    // After the chunk's header (40 bytes, compression "") and the opcode of its first record.
    bytes[chunk + 9 + 40 + 1..][..8].copy_from_slice(&100_000_u64.to_le_bytes());
    fs::write(&file.0, &bytes).unwrap();
    let end = read(&file.0).1;
    assert!(
        matches!(end, Err(ReadError::Damaged { cause: Damage::File(flotor_mcap::Damage::Chunk), .. })),
        "{end:?}"
    );
}

#[test]
fn missing_ticks_are_damage() {
    let file = TestFile::new("gap");
    let chunks = three_chunks();
    write(&file.0, &chunks);
    let mut bytes = fs::read(&file.0).unwrap();
    // The second chunk of ticks (the first of all is the description's) becomes a record nobody knows.
    let (chunk, _) = records(&bytes).into_iter().filter(|(_, opcode)| *opcode == op::CHUNK).nth(2).unwrap();
    bytes[chunk] = 0x80;
    fs::write(&file.0, &bytes).unwrap();
    let (back, end) = read(&file.0);
    assert_eq!(back.len(), 3);
    let text = end.unwrap_err().to_string();
    assert!(text.contains("after tick 2: 3 ticks are missing"), "{text}");
}

#[test]
fn other_files_are_refused_with_name_reason_and_remedy() {
    let refusal = |path: &Path| read(path).1.unwrap_err().to_string();

    let nowhere = Path::new("/nowhere/run.mcap");
    let said = std::fs::read(nowhere).unwrap_err().to_string();
    for (path, said) in [(nowhere, said.as_str()), (&std::env::temp_dir(), "is a directory")] {
        holds(&refusal(path), &[&path.display().to_string(), said]);
    }
    let text = TestFile::with("text", b"time,force\n0,1\n");
    holds(&refusal(&text.0), &["flotor-record", "not an MCAP file", "--record"]);
    let empty = TestFile::with("empty", b"");
    holds(&refusal(&empty.0), &["truncated", "record again"]);

    let foreign = TestFile::new("foreign");
    let mut writer = mcap::Writer::new(File::create(&foreign.0).unwrap()).unwrap();
    let channel = writer.add_channel(0, "/flotor/tick", "json", &Default::default()).unwrap();
    let header =
        mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    writer.write_to_known_channel(&header, b"{}").unwrap();
    writer.finish().unwrap();
    holds(&refusal(&foreign.0), &["not a recording of a run", "--record"]);

    let newer = TestFile::new("newer");
    let mut writer = mcap::Writer::new(File::create(&newer.0).unwrap()).unwrap();
    let topic = Topic::Run;
    let schema = writer.add_schema(topic.schema(), ENCODING, DESCRIPTOR_SET).unwrap();
    let channel = writer.add_channel(schema, topic.name(), ENCODING, &Default::default()).unwrap();
    let message = super::schema::Run { format: FORMAT + 1, ..run().to_message() };
    let header =
        mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 0, publish_time: 0 };
    writer.write_to_known_channel(&header, &message.encode_to_vec()).unwrap();
    writer.finish().unwrap();
    holds(&refusal(&newer.0), &[&format!("format {}", FORMAT + 1), "9.8.7", "update flotor"]);
}

#[test]
fn a_full_disk_is_told_with_the_name_of_the_file() {
    let full = Path::new("/dev/full");
    if full.is_absolute() {
        let file = NewFile::over(File::options().write(true).open(full).unwrap());
        let Err(error) = Recorder::begin(full, file, &run(), "") else { panic!("the disk is full") };
        let text = error.to_string();
        assert!(text.contains("`/dev/full`") && text.contains("No space left"), "{text}");
    } else {
        println!("skipped: a disk that is full (Linux)"); // such a path begins with a drive elsewhere
    }
    let Err(error) = Recorder::create(Path::new("/nowhere/run.mcap"), &run()) else {
        panic!("no such folder")
    };
    assert!(error.to_string().contains("`/nowhere/run.mcap`"), "{error}");
}

#[test]
fn a_recording_never_replaces_anything() {
    let file = TestFile::new("exists");
    write(&file.0, &[tick(0, 1)]);
    let before = fs::read(&file.0).unwrap();
    let Err(error) = Recorder::create(&file.0, &run()) else { panic!("the file exists") };
    holds(&error.to_string(), &["exists", "not overwritten", "exists.mcap"]);
    assert_eq!(fs::read(&file.0).unwrap(), before);
}

#[test]
fn a_discarded_recording_leaves_room_for_the_next() {
    let file = TestFile::new("discarded");
    Recorder::create(&file.0, &run()).unwrap().discard();
    write(&file.0, &[tick(0, 1)]);
    assert_eq!(read(&file.0).0.len(), 1);
}

#[test]
fn a_recording_that_another_program_removes_replaces_or_cuts_is_an_error() {
    let file = TestFile::new("lost");
    let damaged = |damage: &dyn Fn(&Path), then: &[TickRecord]| {
        let mut recorder = Recorder::create(&file.0, &run()).unwrap();
        recorder.record(&tick(0, 1)).unwrap();
        damage(&file.0);
        let recorded = then.iter().try_for_each(|tick| recorder.record(tick));
        let error = recorded.and_then(|()| recorder.finish()).expect_err("the file is damaged").to_string();
        let _ = fs::remove_file(&file.0);
        error
    };
    let remove = |path: &Path| fs::remove_file(path).unwrap();
    let replace = |path: &Path| {
        fs::remove_file(path).unwrap();
        fs::write(path, "another").unwrap();
    };
    let cut = |path: &Path| File::options().write(true).open(path).unwrap().set_len(9).unwrap();
    holds(&damaged(&remove, &[]), &["lost.mcap", "removed or replaced", "try again"]);
    holds(&damaged(&replace, &[]), &["lost.mcap", "removed or replaced"]);
    holds(&damaged(&cut, &[]), &["lost.mcap", "to 9 bytes"]);
    // The recording goes on after the cut: the next chunk finds it.
    let chunk: Vec<TickRecord> = (1..3).map(|index| tick(index, 1_000_000_000)).collect();
    holds(&damaged(&cut, &chunk), &["lost.mcap", "to 9 bytes"]);
}

#[test]
fn the_digest_is_xxh3_of_the_words_little_endian() {
    // From the reference implementation: Python's xxhash, xxh3_64 over struct.pack("<37Q", *range(37)), once and
    // twice in a row.
    let record = TickRecord::from_words(&std::array::from_fn(|i| i as u64));
    let mut digest = TraceDigest::covering(Coverage::Everything);
    assert_eq!(digest.finish(), "xxh3:2d06800538d394c2-0");
    digest.update(&record);
    assert_eq!(digest.finish(), "xxh3:93137961786a04cc-1");
    digest.update(&record);
    assert_eq!(digest.finish(), "xxh3:1420234c6443381c-2");
}

/// As bits of a number these would be a zero with a sign, and numbers that are none.
#[test]
fn every_combination_of_buttons_has_a_digest_of_its_own() {
    let digest = |buttons: u32| {
        let mut digest = TraceDigest::new();
        digest.update(&TickRecord { buttons, events: Events::default(), ..tick(3, 1_000_000) });
        digest.finish()
    };
    let most = 0b111_1111_1111 << 20;
    let digests = BTreeSet::from([0, 1 << 31, most | 1, most | 2, most | 1 << 31].map(digest));
    assert_eq!(digests.len(), 5, "{digests:#?}");
}

/// Bits of the first word that are set where an output of the models is absent.
const ABSENCE: std::ops::Range<u32> = 46..48;

/// The words of a record in which a changed bit changes the digest; each bit of a word does, or none, but those of absent
/// outputs, which [`the_digest_of_the_hand_does_not_see_which_outputs_are_absent`].
fn covered_words(coverage: Coverage) -> Vec<usize> {
    let digest = |words: &[u64; RECORD_WORDS]| {
        let mut digest = TraceDigest::covering(coverage);
        digest.update(&TickRecord::from_words(words));
        digest.finish()
    };
    let words = tick(3, 1_000_000).to_words();
    let plain = digest(&words);
    let is_covered = |word: usize| {
        let bits = (0..u64::BITS).filter(|bit| word > 0 || !ABSENCE.contains(bit));
        let (count, changed) = (
            bits.clone().count(),
            bits.filter(|bit| {
                let mut other = words;
                other[word] ^= 1 << bit;
                digest(&other) != plain
            }),
        );
        let changed = changed.count();
        assert!([0, count].contains(&changed), "word {word}: {changed} bits");
        changed > 0
    };
    (0..RECORD_WORDS).filter(|word| is_covered(*word)).collect()
}

#[test]
fn the_digest_of_everything_sees_every_bit_but_measured_times() {
    let expected: Vec<usize> = (0..RECORD_WORDS - TIMING_WORDS).collect();
    assert_eq!(covered_words(Coverage::Everything), expected);
}

#[test]
fn the_digest_sees_every_bit_of_what_the_hand_gets_and_nothing_for_an_observer() {
    // Tick, time, step, pose and twist; commanded and delivered; events and buttons; the grip. Not the wrench of the models (16
    // to 21), their energy (34) and that of the port (35), and their effort (40).
    let expected: Vec<usize> = (0..16).chain(22..34).chain(36..40).chain([41, 42]).collect();
    assert_eq!(covered_words(Coverage::Hand), expected);
}

#[test]
fn the_digest_of_the_hand_does_not_see_which_outputs_are_absent() {
    let digest = |coverage, record: &TickRecord| {
        let mut digest = TraceDigest::covering(coverage);
        digest.update(record);
        digest.finish()
    };
    let all = tick(3, 1_000_000);
    for demand in [Demand::FORCE, Demand::WRENCH, Demand::FORCE.with(Demand::ENERGY)] {
        let fewer = TickRecord { model: all.model.limited_to(demand), ..all };
        assert_eq!(digest(Coverage::Hand, &fewer), digest(Coverage::Hand, &all));
        assert_ne!(digest(Coverage::Everything, &fewer), digest(Coverage::Everything, &all));
    }
}

#[test]
fn outputs_that_were_not_computed_come_back_absent_and_others_bit_for_bit() {
    let file = TestFile::new("absent");
    let demands = [Demand::FORCE, Demand::WRENCH, Demand::FORCE.with(Demand::ENERGY), Demand::ALL];
    let all = (0..40).map(|index| tick(index, 1_000_000)).zip(demands.iter().cycle());
    let ticks: Vec<TickRecord> =
        all.map(|(tick, demand)| TickRecord { model: tick.model.limited_to(*demand), ..tick }).collect();
    write(&file.0, &ticks);
    let (back, end) = read(&file.0);
    assert_eq!(end.unwrap(), Ending::Finished);
    assert_eq!(back, ticks);
}

#[test]
fn a_file_beside_a_parameter_comes_back_and_its_content_tells_it_from_another() {
    let file = TestFile::with("named-file", b"0,0\n6,4.08\n");
    let named = NamedFile::read(&file.0).unwrap();
    assert!(named.path.is_absolute() && named.hash_text().len() == "xxh3:".len() + 16, "{named:?}");
    let pair = |key: &str, value: &str| (key.to_owned(), value.to_owned());
    let mut parameters = vec![pair("curve", "c.csv"), pair("stiffness_scale", "1")];
    assert_eq!(NamedFile::among(&parameters, "curve"), None, "a recording of an earlier version");
    parameters.extend(named.to_parameters("curve"));
    assert_eq!(NamedFile::among(&parameters, "curve"), Some(named.clone()));
    assert_eq!(NamedFile::among(&parameters, "stiffness_scale"), None);
    fs::write(&file.0, b"0,0\n6,4.09\n").unwrap();
    assert_ne!(NamedFile::read(&file.0).unwrap().hash, named.hash);
    assert!(NamedFile::read(&std::env::temp_dir()).is_err(), "a folder has no content");
}

/// The end of a file, as another reader of MCAP understands it: every chunk and message is listed, at its place.
#[test]
fn the_end_lists_every_chunk_and_message() {
    let file = TestFile::new("end");
    write(&file.0, &three_chunks());
    let bytes = fs::read(&file.0).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let statistics = summary.stats.as_ref().unwrap();
    // The run, then a pose and a tick each time; the run has a chunk of its own.
    assert_eq!((statistics.message_count, statistics.chunk_count), (19, 4));
    assert_eq!((statistics.message_start_time, statistics.message_end_time), (0, 800_000_000));
    assert_eq!((summary.schemas.len(), summary.channels.len(), summary.metadata_indexes.len()), (5, 5, 1));
    let mut listed = 0;
    for chunk in &summary.chunk_indexes {
        let messages: Vec<_> = summary.stream_chunk(&bytes, chunk).unwrap().map(Result::unwrap).collect();
        let places = summary.read_message_indexes(&bytes, chunk).unwrap();
        let entries =
            places.iter().flat_map(|(channel, entries)| entries.iter().map(|entry| (channel.id, *entry)));
        let before = listed;
        for (channel, entry) in entries {
            let found = summary.seek_message(&bytes, chunk, &entry).unwrap();
            assert_eq!((found.channel.id, found.log_time), (channel, entry.log_time));
            listed += 1;
        }
        assert_eq!(listed - before, messages.len());
    }
    assert_eq!(listed, 19);
    let in_the_end = |name: &str| bytes.windows(name.len()).filter(|at| *at == name.as_bytes()).count();
    assert_eq!(in_the_end("flotor/9.8.7"), 1, "the library stands in the head alone");
}
