//! A recording of any length needs the same memory. Alone in its process: it reads the memory of the process.

use flotor_core::trace::{RECORD_WORDS, TickRecord};
use flotor_core::{Clock, mapping::Blend};
use flotor_record::{PluginDescription, Recorder, Role, RunDescription};
use flotor_sync::Words;

/// Chunks before memory is read first, and between the two readings: an index of 375 bytes each in memory would be 7.5 MB.
const WARM_UP: u64 = 1_000;
const CHUNKS: u64 = 20_000;
/// Growth that counts as none, kB: buffers and pages of the allocator.
const SLACK_KB: u64 = 500;

/// Reads the memory of this process that no file backs, kB; `None` where the system has no such file.
fn anonymous_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("RssAnon:"))?;
    line.trim().trim_end_matches(" kB").parse().ok()
}

#[test]
fn the_index_of_a_long_recording_is_not_in_memory() {
    let device = PluginDescription {
        name: "device".to_owned(),
        id: "device".to_owned(),
        version: "1.0.0".to_owned(),
        file: "libdevice.so".to_owned(),
        role: Role::Device,
        places_m: Vec::new(),
        shared_with: Vec::new(),
        blend: Blend::default(),
        field: None,
        latency_s: 0.0,
        at_hand: flotor_hal::Demand::WRENCH,
        settings: Vec::new(),
        parameters: Vec::new(),
        device: 0,
    };
    let run = RunDescription {
        flotor_version: "1.0.0".to_owned(),
        rate_hz: 1000.0,
        duration_s: 0.0,
        seed: 0,
        clock: Clock::Virtual,
        scene_toml: String::new(),
        plugins: vec![device],
        couplings: Vec::new(),
    };
    let path = std::env::temp_dir().join(format!("flotor-memory-{}.mcap", std::process::id()));
    let mut recorder = Recorder::create(&path, &run).unwrap();
    // A tick as long as a chunk.
    let mut record = |tick: u64| {
        let mut words = [0; RECORD_WORDS];
        [words[0], words[1], words[2]] = [tick, tick * 250_000_000, 250_000_000];
        recorder.record(&TickRecord::from_words(&words)).unwrap();
    };
    (0..WARM_UP).for_each(&mut record);
    let before_kb = anonymous_kb();
    (WARM_UP..WARM_UP + CHUNKS).for_each(&mut record);
    let after_kb = anonymous_kb();
    recorder.finish().unwrap();
    let bytes = std::fs::read(&path).unwrap();
    std::fs::remove_file(&path).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    assert_eq!(summary.chunk_indexes.len() as u64, WARM_UP + CHUNKS + 1, "the index is complete");
    let Some((before_kb, after_kb)) = before_kb.zip(after_kb) else {
        println!("skipped: this system does not tell the memory of a process in a file");
        return;
    };
    assert!(after_kb <= before_kb + SLACK_KB, "{before_kb} kB grew to {after_kb} kB");
}
