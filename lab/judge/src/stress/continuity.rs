//! M1, continuity: jumps of the wrench between very close poses.
//!
//! Straight lines cross the workspace in pieces of 0.01 mm. On each line, the pieces whose change of wrench differs
//! most from the changes of their neighbours are divided into ten, the most different of the new pieces into ten again,
//! and so on down to 1e-8 mm. The criterion is the second difference of the changes: it vanishes for a constant slope
//! and curvature, but not for a step. `J(h)` is the largest change over pieces of length `h`: for a continuous law it
//! falls in proportion to `h`, at a jump it has a plateau. The thesis's code jumps by 8.6 N at its buckling rule.
//!
//! The length of a piece is that of the motion with angles as lengths at the device's lever arm ([`super::LEVER_M`]).

use super::jacobian::size_n;
use super::measure::{Measure, NO_ANSWER, Verdict};
use super::poses::Reach;
use super::sweep::sweep;
use super::{LEVER_M, Setup, WIDER};
use crate::PERIOD_NS;
use crate::sampling::{Random, Sobol};
use crate::subject::Subject;
use crate::tally::{Worst, tally};
use crate::trajectory::at;
use flotor_hal::{DVec3, Memory, Pose, Twist, Wrench};
use flotor_loader::LoadError;
use serde::{Deserialize, Serialize};

const NAME: &str = "continuity";
/// Lengths of the pieces by refinement level, mm; the first is the length before any refinement.
pub(super) const PIECES_MM: [f64; 7] = [1.0e-2, 1.0e-3, 1.0e-4, 1.0e-5, 1.0e-6, 1.0e-7, 1.0e-8];
/// Pieces of a line: 10 mm.
const PIECES_PER_LINE: usize = 1000;
/// Number of pieces per line that are refined.
const SUSPECTS: usize = 3;
/// Parts of a refined piece; one more on either side serves as neighbour of the outermost.
const CUTS: usize = 10;

/// Largest imperceptible step of force, N: the resolution of the device (5 to 10 µm) times a stiffness; smaller steps
/// have no physical meaning.
pub(super) const FELT_N: f64 = 1.0e-3;
/// Largest imperceptible step of torque, N·m.
pub(super) const FELT_NM: f64 = 2.0e-5;
/// Fraction of [`FELT_N`] and [`FELT_NM`] up to which a step passes; a larger but imperceptible step is noted.
pub(super) const HARMLESS: f64 = 1.0e-3;

/// Largest changes of force and torque over all pieces of one length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Jump {
    /// Length of the piece, mm.
    pub length_mm: f64,
    /// Largest change of force, N.
    pub force_n: f64,
    /// Largest change of torque, N·m.
    pub torque_nm: f64,
}

tally! {
    pub(super) struct Jumps {
        pub(super) force: [Worst; PIECES_MM.len()],
        pub(super) torque: [Worst; PIECES_MM.len()],
        /// Largest change of force over the shortest pieces inside the workspace itself, without the margin around it.
        inside: Worst,
        /// Largest jump that drift at rest may hide over the shortest pieces, in units of the perception limit.
        possible: f64,
        pieces: u64,
        shortest_pieces: u64,
    }
}

/// Change of wrench over a piece.
#[derive(Clone, Copy)]
pub(super) struct Change {
    /// Change beyond that at rest: a mass in motion or creep is not a jump.
    beyond: Wrench,
    /// Change at rest in a tick.
    at_rest: Wrench,
}

impl Change {
    fn new(change: Wrench, at_rest: Wrench) -> Self {
        let rest_of = |change: DVec3, at_rest: DVec3| match change.length() {
            size if size > 0.0 => change * ((size - at_rest.length()).max(0.0) / size),
            _ => change,
        };
        let force = rest_of(change.force(), at_rest.force());
        Self { beyond: Wrench::new(force, rest_of(change.torque(), at_rest.torque())), at_rest }
    }

    /// Returns the largest jump that the change may contain, in units of the perception limit.
    fn possible(&self) -> f64 {
        let force_n = self.beyond.force().length() + self.at_rest.force().length();
        let torque_nm = self.beyond.torque().length() + self.at_rest.torque().length();
        (force_n / FELT_N).max(torque_nm / FELT_NM)
    }
}

impl Jumps {
    fn offer(&mut self, reach: Reach, level: usize, change: Change, pose: Pose) {
        let (change, possible) = (change.beyond, change.possible());
        if level == PIECES_MM.len() - 1 {
            self.shortest_pieces += 1;
            self.possible = self.possible.max(possible);
            if reach.holds(pose) {
                self.inside.offer(change.force().length(), pose);
            }
        }
        self.pieces += 1;
        self.force[level].offer(change.force().length(), pose);
        self.torque[level].offer(change.torque().length(), pose);
    }
}

/// Straight line in position and rotation vector; its parameter is a length, m.
pub(super) struct Line {
    pub(super) position_m: DVec3,
    pub(super) rotation_rad: DVec3,
    pub(super) along_m: DVec3,
    pub(super) along_rad: DVec3,
}

impl Line {
    pub(super) fn pose(&self, length_m: f64) -> Pose {
        at(self.position_m + self.along_m * length_m, self.rotation_rad + self.along_rad * length_m)
    }
}

/// Crosses the workspace on straight lines and refines the most irregular pieces.
pub(super) fn measure(setup: &Setup<'_>) -> Result<(Measure, Vec<Jump>), LoadError> {
    let sobol = Sobol::new(setup.options.seed);
    let total = sweep(setup, NAME, setup.share(40_000, 16), |subject, block| {
        let line = line(setup, &sobol, block);
        let mut jumps = Jumps::default();
        let first_m = PIECES_MM[0] * 1.0e-3;
        let start_m = -0.5 * first_m * PIECES_PER_LINE as f64;
        let changes = changes(subject, &line, start_m, first_m, PIECES_PER_LINE);
        for (index, change) in changes.iter().enumerate() {
            if let Some(change) = change {
                jumps.offer(setup.options.reach, 0, *change, line.pose(start_m + first_m * index as f64));
            }
        }
        for suspect in suspects(&changes) {
            close_in(subject, setup.options.reach, &line, start_m + first_m * suspect as f64, &mut jumps);
        }
        jumps
    })?;
    Ok((judge(&total), curve(&total)))
}

/// Returns a line through one of evenly spread poses, every fourth one through home: along all axes at once, or only
/// translating, or only rotating, or along one axis.
fn line(setup: &Setup<'_>, sobol: &Sobol, block: u64) -> Line {
    let reach = setup.options.reach.scaled(WIDER);
    let mut random = Random::new(setup.options.seed, block);
    let [x, y, z, rx, ry, rz] = sobol.point(block).map(|u| 2.0 * u - 1.0);
    let mut position_m = DVec3::new(x, y, z) * reach.position_m;
    let mut rotation_rad = DVec3::new(rx, ry, rz) * reach.rotation_rad;
    let (along, around) = match block / 4 % 4 {
        0 => {
            let (along, around) = (random.vector(), random.vector());
            let length = (along.length_squared() + around.length_squared()).sqrt().max(f64::MIN_POSITIVE);
            (along / length, around / length)
        }
        1 => (random.direction(), DVec3::ZERO),
        2 => (DVec3::ZERO, random.direction()),
        _ => ([DVec3::X, DVec3::Y, DVec3::Z][(block / 16 % 3) as usize], DVec3::ZERO),
    };
    if block.is_multiple_of(4) {
        // Offset from the middle: a piece must cross home, not end there.
        let aside_m = PIECES_MM[0] * 1.0e-3 * random.unit();
        (position_m, rotation_rad) = (along * aside_m, around * (aside_m / LEVER_M));
    }
    Line { position_m, rotation_rad, along_m: along, along_rad: around / LEVER_M }
}

/// Returns the change of wrench over each piece, beyond that of a model with memory at rest; `None` without an answer.
pub(super) fn changes(
    subject: &mut Subject<'_>,
    line: &Line,
    start_m: f64,
    piece_m: f64,
    pieces: usize,
) -> Vec<Option<Change>> {
    let mut ask = |index: usize| {
        let pose = line.pose(start_m + piece_m * index as f64);
        let here = subject.answer_at(pose).ok()?.wrench;
        match subject.memory() {
            Memory::Stateless => Some([here; 2]),
            // Step again at the same pose, a tick later.
            Memory::PathDependent => Some([here, subject.advance(pose, Twist::ZERO, PERIOD_NS).ok()?.wrench]),
        }
    };
    let mut before = ask(0);
    (1..=pieces)
        .map(|index| {
            let here = ask(index);
            let change =
                before.zip(here).map(|([_, before], [here, later])| Change::new(here - before, later - here));
            before = here;
            change
        })
        .collect()
}

/// Returns the irregularity of a piece: second difference of the changes around it, N, torque at the lever arm.
pub(super) fn standing_out(changes: &[Option<Change>], index: usize) -> f64 {
    let around = index.checked_sub(1).and_then(|from| changes.get(from..=index + 1));
    let Some([Some(before), Some(here), Some(after)]) = around else { return 0.0 };
    let second = before.beyond + here.beyond * -2.0 + after.beyond;
    size_n(&second)
}

/// Returns the most irregular pieces, no two of them neighbours.
fn suspects(changes: &[Option<Change>]) -> Vec<usize> {
    let mut ranked: Vec<(f64, usize)> =
        (0..changes.len()).map(|index| (standing_out(changes, index), index)).collect();
    ranked.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut chosen: Vec<usize> = Vec::with_capacity(SUSPECTS);
    for (_, index) in ranked {
        if chosen.len() == SUSPECTS {
            break;
        }
        if chosen.iter().all(|other| other.abs_diff(index) > 2) {
            chosen.push(index);
        }
    }
    chosen
}

/// Refines a piece from the first length down to the last, into the most irregular tenth each time.
pub(super) fn close_in(subject: &mut Subject<'_>, reach: Reach, line: &Line, from_m: f64, jumps: &mut Jumps) {
    let mut from_m = from_m;
    for (level, length_mm) in PIECES_MM.iter().enumerate().skip(1) {
        let piece_m = length_mm * 1.0e-3;
        let changes = changes(subject, line, from_m - piece_m, piece_m, CUTS + 2);
        let start_m = |index: usize| from_m + piece_m * (index as f64 - 1.0);
        let mut chosen = (0.0, CUTS / 2);
        for index in 1..=CUTS {
            if let Some(Some(change)) = changes.get(index) {
                jumps.offer(reach, level, *change, line.pose(start_m(index)));
            }
            let rank = standing_out(&changes, index);
            if rank > chosen.0 {
                chosen = (rank, index);
            }
        }
        from_m = start_m(chosen.1);
    }
}

fn curve(total: &Jumps) -> Vec<Jump> {
    let levels = PIECES_MM.iter().zip(total.force.iter().zip(&total.torque));
    levels
        .map(|(length_mm, (force, torque))| Jump {
            length_mm: *length_mm,
            force_n: force.value,
            torque_nm: torque.value,
        })
        .collect()
}

fn judge(total: &Jumps) -> Measure {
    let last = PIECES_MM.len() - 1;
    let (force, torque) = (total.force[last], total.torque[last]);
    let of_force = Verdict::of(force.value, FELT_N * HARMLESS, FELT_N);
    let verdict = of_force.max(Verdict::of(torque.value, FELT_NM * HARMLESS, FELT_NM));
    // Report the more severe of the two.
    let torque_is_graver = torque.value / FELT_NM > force.value / FELT_N;
    let (worst, unit, felt) = if torque_is_graver { (torque, "N·m", FELT_NM) } else { (force, "N", FELT_N) };
    let comment = match verdict {
        Verdict::Pass => String::new(),
        _ => format!(
            "plateau over {:.0e} mm ({:.1e} N in the workspace itself); felt from {felt:.0e} {unit} on",
            PIECES_MM[last], total.inside.value
        ),
    };
    let possible = total.possible * felt;
    let mut measure = Measure::of(["M1", NAME, unit], &worst, [felt * HARMLESS, felt], comment);
    measure.verdict = verdict;
    for Jump { length_mm, force_n, torque_nm } in curve(total) {
        measure = measure.with(format!("force jump over {length_mm:.0e} mm"), force_n, "N").with(
            format!("torque jump over {length_mm:.0e} mm"),
            torque_nm,
            "N·m",
        );
    }
    measure
        .with("force jump over 1e-8 mm inside the workspace", total.inside.value, "N")
        .count("pieces", total.pieces)
        .unless_uncertain(possible, || {
            "the wrench of the model at rest changes by more than the bound".to_owned()
        })
        .unless_empty(total.shortest_pieces, NO_ANSWER)
}
