//! Whatever lies in a file, reading it ends with an answer or one line that says what is wrong: no panic, no endless
//! loop, no half-read value. Files are whole ones with a few bytes, lines or lengths changed, which gets deeper than
//! noise does; the seeds are fixed, so a failure comes back.

use flotor_hal::abi::loader::read_metadata;
use flotor_record::Recording;
use flotor_session::scene::{DEMO, Scene};
use flotor_tests::TestSize;
use flotor_tests::library::plugin_bytes;
use flotor_tests::scratch::Scratch;
use std::path::Path;

/// Files per reader.
fn cases() -> usize {
    TestSize::of_this_run().pick(2_000, 200_000)
}

/// SplitMix64 (Steele, Lea and Flood, OOPSLA 2014): random enough to break files.
struct Random(u64);

impl Random {
    #[allow(clippy::cast_possible_truncation)] // less than `bound`
    fn below(&mut self, bound: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ mixed >> 31) % bound.max(1) as u64) as usize
    }
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

#[test]
fn recordings() {
    let scratch = Scratch::default();
    let whole = scratch.path().join("whole.mcap");
    let mut scene = Scene::demo().expect("the demo is a scene");
    scene.duration_s = 0.05;
    let registry =
        flotor_session::registry::Registry::search(&[flotor_tests::library::build_folder().join("deps")]);
    flotor_session::headless::run(&scene, &registry, 1, Some(&whole)).expect("the demo runs");
    let whole = std::fs::read(whole).expect("it was just written");
    let file = scratch.path().join("wounded.mcap");
    let mut random = Random(2);
    let (mut read, mut refused) = (0, 0);
    for _ in 0..cases() {
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
