//! What a device has written down of a run (`tests/c/campaign/device.c`), and what must hold in it.

use std::path::Path;

/// Bytes of an entry; the first of a file counts the others.
const ENTRY: usize = 64;

/// What a host did with a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Entry {
    /// Energised, in a loop of this period, ns.
    Activated(u64),
    /// Told this force (N) and torque (N·m).
    Commanded([f64; 3], [f64; 3]),
    /// Told to stop.
    Stopped,
    /// De-energised.
    Deactivated,
    /// Closed.
    Closed,
}

/// The entries of a file; one that its process was writing when it died is left out.
pub(crate) fn read(path: &Path) -> Vec<Entry> {
    let bytes = std::fs::read(path).unwrap_or_default();
    let word =
        |entry: &[u8], at: usize| u64::from_le_bytes(entry[at..at + 8].try_into().expect("eight bytes"));
    let count = bytes.get(..ENTRY).map_or(0, |entry| word(entry, 8));
    let count = usize::try_from(count).expect("a run has fewer");
    assert!(ENTRY * (count + 1) <= bytes.len() || count == 0, "the file is too small for {count} entries");
    let parse = |entry: &[u8]| {
        let numbers = |at: usize| [0, 8, 16].map(|more| f64::from_bits(word(entry, at + more)));
        match word(entry, 0) {
            1 => Some(Entry::Activated(word(entry, 8))),
            2 => Some(Entry::Commanded(numbers(16), numbers(40))),
            3 => Some(Entry::Stopped),
            4 => Some(Entry::Deactivated),
            5 => Some(Entry::Closed),
            _ => None,
        }
    };
    bytes.chunks_exact(ENTRY).skip(1).take(count).filter_map(parse).collect()
}

/// What may reach a hand at a device: norms, shares of the axes, the fastest change, and the fastest change that is not the fall of a
/// part; of force (N), then of torque (N·m).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Allowed {
    pub(crate) norm: [f64; 2],
    pub(crate) axes: [[f64; 3]; 2],
    pub(crate) slew_per_s: [f64; 2],
    pub(crate) rise_per_s: [f64; 2],
}

/// What was seen of a device.
#[derive(Debug, Default)]
pub(crate) struct Seen {
    /// Commands, and those with force.
    pub(crate) commands: usize,
    pub(crate) felt: usize,
    /// What must not be, with the number of the entry.
    pub(crate) violations: Vec<(usize, &'static str)>,
}

/// Relative slack for a norm that is computed here once more, and for a difference.
const ROUNDING: f64 = 1.0e-12;
const ROUNDING_OF_A_STEP: f64 = 1.0e-9;

/// Holds a log against what is allowed.
pub(crate) fn check(log: &[Entry], allowed: &Allowed) -> Seen {
    let mut seen = Seen::default();
    let (mut last, mut period_s, mut is_active, mut is_stopped) = ([[0.0; 3]; 2], 0.0, false, false);
    for (number, entry) in log.iter().enumerate() {
        let mut violated = |what| seen.violations.push((number, what));
        match entry {
            Entry::Activated(period_ns) => (period_s, is_active) = (*period_ns as f64 * 1.0e-9, true),
            Entry::Commanded(force_n, torque_nm) => {
                let told = [*force_n, *torque_nm];
                if told.iter().flatten().any(|number| !number.is_finite()) {
                    violated("not finite");
                    continue;
                }
                let is_force = told.iter().flatten().any(|number| *number != 0.0);
                if is_force && (is_stopped || !is_active) {
                    violated("force while it is stopped");
                }
                for part in 0..2 {
                    if norm(told[part]) > allowed.norm[part] * (1.0 + ROUNDING) {
                        violated("longer than the norm");
                    }
                    if told[part].iter().zip(allowed.axes[part]).any(|(number, most)| number.abs() > most) {
                        violated("more than an axis may have");
                    }
                    let step = norm(std::array::from_fn(|axis| told[part][axis] - last[part][axis]));
                    if step > allowed.slew_per_s[part] * period_s * (1.0 + ROUNDING_OF_A_STEP) {
                        violated("a jump");
                    }
                    // Forces that lack a part of the last one, in whichever direction, fill the ball between the last one and zero.
                    let beyond = norm(std::array::from_fn(|axis| told[part][axis] - 0.5 * last[part][axis]))
                        - 0.5 * norm(last[part]);
                    let rise = allowed.rise_per_s[part] * period_s;
                    if beyond > rise + ROUNDING_OF_A_STEP * (rise + norm(last[part])) {
                        violated("a jump that is no fall");
                    }
                }
                last = told;
                seen.commands += 1;
                seen.felt += usize::from(is_force);
            }
            Entry::Stopped => (is_stopped, last) = (true, [[0.0; 3]; 2]),
            Entry::Deactivated | Entry::Closed => {
                if is_active && !is_stopped {
                    violated("not told to stop before its end");
                }
                is_active = false;
            }
        }
    }
    if last != [[0.0; 3]; 2] {
        seen.violations.push((log.len(), "force stays"));
    }
    seen
}

fn norm(vector: [f64; 3]) -> f64 {
    vector.iter().map(|number| number * number).sum::<f64>().sqrt()
}

const BOUNDS: Allowed = Allowed {
    norm: [5.0, 1.0],
    axes: [[4.0; 3], [0.9; 3]],
    slew_per_s: [600.0, 100.0],
    rise_per_s: [600.0, 100.0],
};

/// A run in which everything is as it should be: force grows along a diagonal to the limit.
fn honest() -> Vec<Entry> {
    let told = |share: f64| Entry::Commanded([2.8 * share; 3], [0.5 * share, 0.0, 0.0]);
    let mut log = vec![Entry::Activated(1_000_000)];
    log.extend((0..=10).map(|tick| told(f64::from(tick) * 0.1)));
    log.extend([
        Entry::Stopped,
        Entry::Stopped,
        Entry::Commanded([0.0; 3], [0.0; 3]),
        Entry::Deactivated,
        Entry::Closed,
    ]);
    log
}

/// What is wrong with a log, and how it comes in.
type Planted = (&'static str, fn(&mut Vec<Entry>));

#[test]
fn what_must_not_be_in_a_log_is_seen() {
    let seen = check(&honest(), &BOUNDS);
    assert_eq!((seen.commands, seen.felt, seen.violations.len()), (12, 10, 0), "{seen:?}");
    let planted: [Planted; 9] = [
        ("longer than the norm", |log| log[11] = Entry::Commanded([2.9; 3], [0.5, 0.0, 0.0])),
        ("longer than the norm", |log| log[11] = Entry::Commanded([2.8; 3], [0.6, 0.6, 0.6])),
        ("more than an axis may have", |log| log[11] = Entry::Commanded([4.1, 0.0, 0.0], [0.5, 0.0, 0.0])),
        ("a jump", |log| log[5] = log[4]),
        ("a jump that is no fall", |log| log[5] = log[4]),
        ("not finite", |log| log[11] = Entry::Commanded([0.0, f64::NAN, 0.0], [0.0; 3])),
        ("force while it is stopped", |log| log[14] = Entry::Commanded([1.0e-9, 0.0, 0.0], [0.0; 3])),
        ("not told to stop before its end", |log| log.retain(|entry| *entry != Entry::Stopped)),
        ("force stays", |log| log.truncate(8)),
    ];
    for (what, plant) in planted {
        let mut log = honest();
        plant(&mut log);
        let found = check(&log, &BOUNDS).violations;
        assert!(found.iter().any(|(_, found)| *found == what), "{what}: {found:?}");
    }
}
