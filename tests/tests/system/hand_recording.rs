//! A damaged recording never drives the simulated hand: it is refused, or its trajectory is the undamaged one, bit for bit.

use flotor_simulated::hand::Recording;
use flotor_tests::TestSize;
use flotor_tests::program::{Flotor, Ran, exit_code};
use flotor_tests::scratch::Scratch;
use rayon::prelude::*;
use std::ops::Range;

/// Damaged copies read in this process, and those of them that also drive a run.
const COPIES: usize = 150;
const RUNS: usize = 12;

/// Damage to a file of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Damage {
    Flipped,
    Zeroed,
    Deleted,
    Cut,
    Doubled,
}

const KINDS: [Damage; 5] = [Damage::Flipped, Damage::Zeroed, Damage::Deleted, Damage::Cut, Damage::Doubled];

impl Damage {
    /// Damages a copy from this byte on.
    fn done_to(self, bytes: &[u8], at: usize) -> Vec<u8> {
        let mut copy = bytes.to_vec();
        let part: Range<usize> = at..bytes.len().min(at + 3000);
        match self {
            Damage::Flipped => copy[at] ^= 1 << (at % 8),
            Damage::Zeroed => copy[part].fill(0),
            Damage::Deleted => drop(copy.drain(part)),
            Damage::Cut => copy.truncate(at),
            Damage::Doubled => drop(copy.splice(at..at, bytes[part].to_vec())),
        }
        copy
    }
}

/// Places spread over a file by the golden ratio: any number of them leaves no large part out.
fn places(length: usize, count: usize) -> impl Iterator<Item = usize> {
    const INVERSE_GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    (1..=count).map(move |index| ((index as f64 * INVERSE_GOLDEN_RATIO).fract() * length as f64) as usize)
}

fn digest(ran: &Ran) -> Option<&str> {
    ran.stdout.lines().find(|line| line.contains("digest"))
}

#[test]
fn a_damaged_recording_is_refused_or_read_bit_for_bit() {
    let scratch = Scratch::default();
    let whole = scratch.path().join("whole.mcap");
    let path = |name: &str| scratch.path().join(name).display().to_string();
    let record = ["run", "--clock", "virtual", "--duration", "300ms", "--record", &path("whole.mcap")];
    assert_eq!(Flotor::with(record).run().code, Some(exit_code::OK));
    let bytes = std::fs::read(&whole).expect("it was recorded");
    let undamaged = Recording::load(&whole).expect("it is whole");
    let drive = |file: &str| {
        let hand = format!("device.hand_recording={}", path(file));
        Flotor::with(["run", "--clock", "virtual", "--duration", "50ms", "--set", &hand]).run()
    };
    let driven = drive("whole.mcap");
    assert_eq!(driven.code, Some(exit_code::OK), "{driven:?}");

    let copies = if TestSize::of_this_run() == TestSize::Full { 10 * COPIES } else { COPIES };
    let tries: Vec<_> = places(bytes.len(), copies).zip(KINDS.into_iter().cycle()).enumerate().collect();
    let refused: Vec<bool> = tries
        .into_par_iter()
        .map(|(number, (at, damage))| {
            let name = format!("{number}.mcap");
            let file = scratch.file(&name, damage.done_to(&bytes, at));
            let read = Recording::load(&file);
            if let Ok(trajectory) = &read {
                assert!(
                    *trajectory == undamaged,
                    "{damage:?} at byte {at}: another trajectory, without an error"
                );
            }
            if number % (copies / RUNS) == 0 {
                let ran = drive(&name);
                match &read {
                    Ok(_) => assert_eq!(digest(&ran), digest(&driven), "{damage:?} at byte {at}"),
                    Err(error) => {
                        assert_eq!(
                            ran.code,
                            Some(exit_code::CONFIGURATION),
                            "{damage:?} at byte {at}: {ran:?}"
                        );
                        assert!(ran.stderr.contains(&error.problem), "{error}: {}", ran.stderr);
                    }
                }
            }
            let _ = std::fs::remove_file(file);
            read.is_err()
        })
        .collect();
    let refused = refused.into_iter().filter(|refused| *refused).count();
    println!("{copies} damaged copies: {refused} refused, the others read bit for bit");
    // The index at the end, which is not needed, is less than a tenth of the file.
    assert!(refused > copies * 8 / 10, "{refused} of {copies}");
}

#[test]
fn a_truncated_recording_is_refused_with_cause_and_remedy() {
    let scratch = Scratch::default();
    let record = ["run", "--clock", "virtual", "--duration", "300ms", "--record", "whole.mcap"];
    assert_eq!(Flotor::with(record).inside(scratch.path()).run().code, Some(exit_code::OK));
    let bytes = std::fs::read(scratch.path().join("whole.mcap")).expect("it was recorded");
    let file = scratch.file("cut.mcap", &bytes[..bytes.len() / 2]);
    let error = Recording::load(&file).expect_err("half of the run is missing").to_string();
    assert!(error.contains("cut.mcap: the file is truncated") && error.contains("record again"), "{error}");
}
