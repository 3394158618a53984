//! M6, closed loop: stability of a released device under the model.
//!
//! The simplest device (a mass with a damper per axis, [`crate::plant`]) is released away from home under the model's
//! wrench: with light and heavy damping, 0 to 3 ticks of delay, quantised sensing and ticks whose wrench is lost. The
//! results are settling time, peak force, buzz (force between 50 and 500 Hz), and whether the device settles at all.
//!
//! Not every loop can: a spring of stiffness `K` is stable only up to `K < b / (T/2 + t_d)` (Gil, Sanchez, Hulin,
//! Preusche and Hirzinger, J. Comput. Inf. Sci. Eng. 9, 2009; without virtual damping). A release that diverges
//! although the stiffness along its path never exceeded this limit is an error of the model and fails; where the rule
//! predicts divergence too, the stiffness is the cause. A release that comes to rest away from home is counted; if the
//! model reports more energy there than at the start, its force has done work on the device, and the release fails too.
//! A constant pull, as of a weight, has no rest position: a device that leaves under a pull of constant direction is
//! not judged, because no loop could hold it. The rule itself is checked near home: the model's wrench is scaled until
//! the loop becomes unstable, and the stiffness there is reported beside the limit of the rule.

use super::jacobian::Jacobian;
use super::measure::{Measure, NO_ANSWER, Verdict};
use super::sweep::sweep;
use super::{DAMPINGS_NS_PER_M, LEVER_M, PERIOD_S, Setup};
use crate::PERIOD_NS;
use crate::plant::Flotor;
use crate::sampling::Random;
use crate::subject::Subject;
use crate::tally::Worst;
use crate::trajectory::{at, sensed};
use flotor_hal::{DVec3, Memory, Pose, Wrench, math, rotation_vector};
use flotor_loader::LoadError;
use std::collections::VecDeque;
use std::f64::consts::TAU;

const NAME: &str = "closed loop";
/// Delays of the loop, ticks.
const DELAYS_TICKS: [usize; 4] = [0, 1, 2, 3];
/// Quantisation of the sensed position, m: none, Maglev 200, prototype.
const QUANTA_M: [f64; 3] = [0.0, 2.0e-6, 10.0e-6];
/// Fractions of ticks whose wrench is lost; the device continues with the previous one.
const DROPS: [f64; 3] = [0.0, 0.01, 0.05];
/// Ticks of a release: with the lightest damping, an oscillation loses half its energy in about a second.
const TICKS: usize = 10_000;
/// Region of the starts, relative to the workspace.
const NEAR: f64 = 0.3;
/// Radius of the settled region, relative to the start's distance.
const SETTLED: f64 = 0.02;
/// Distance beyond which a release counts as diverged, m.
const LOST_M: f64 = 10.0;
/// Ratio of the kinetic energies of two quarters that counts as growth.
const GROWING: f64 = 1.01;
/// Kinetic energy, relative to the first quarter, below which a growing loop buzzes but does not diverge.
const BUZZ: f64 = 0.05;
/// Kinetic energy, relative to the earlier one, at which a handle counts as at rest.
const AT_REST: f64 = 1.0e-3;
/// Largest tolerated gain of energy in a release, J: a tenth of a millijoule is a millinewton over ten centimetres.
const UPHILL_J: f64 = 1.0e-4;
/// Kinetic energy, relative to the gained energy, below which a handle counts as nearly still.
const NEARLY_STILL: f64 = 0.1;
/// Least cosine of the angle between a pull and its first direction for a constant pull. Oscillation and circling exceed it.
const STEADY: f64 = 0.5;
/// Shortest motion in a tick for a stiffness estimate, m: far above rounding.
const MOVING_M: f64 = 1.0e-7;

/// Damping, delay, sensor resolution and lost ticks of a loop.
#[derive(Clone, Copy)]
struct Loop {
    damping_ns_per_m: f64,
    delay_ticks: usize,
    quantum_m: f64,
    dropped: f64,
    /// Factor on the model's wrench.
    gain: f64,
}

impl Loop {
    /// Returns the stiffness limit of the loop without quantisation and lost ticks, N/m.
    fn stiffest_n_per_m(&self) -> f64 {
        self.damping_ns_per_m / (PERIOD_S * (0.5 + self.delay_ticks as f64))
    }

    fn sees(&self, pose: Pose) -> Pose {
        match self.quantum_m > 0.0 {
            true => sensed(pose, self.quantum_m, self.quantum_m / LEVER_M),
            false => pose,
        }
    }

    fn is_clean(&self) -> bool {
        self.quantum_m == 0.0 && self.dropped == 0.0
    }
}

/// Result of a release.
struct Release {
    diverged: bool,
    /// True if the device left under a pull of constant direction.
    carried_off: bool,
    /// True if the device came to rest away from home.
    rests_elsewhere: bool,
    /// Stored energy at the end less that at the start, J; NaN if the model reports none.
    uphill_j: f64,
    /// Mean kinetic energy in the last quarter, J.
    restless_j: f64,
    /// Value of `steepest_n_per_m` up to the first tick whose stored energy is above the start's by the tolerance.
    steepest_below_n_per_m: f64,
    settle_s: f64,
    peak_force_n: f64,
    buzz_n: f64,
    /// Largest change of wrench per motion on the path, N/m at the lever arm.
    steepest_n_per_m: f64,
}

/// Releases the device and simulates it; `None` if the model gives no answer.
fn release(subject: &mut Subject<'_>, conditions: Loop, start: Pose, random: &mut Random) -> Option<Release> {
    subject.restart();
    if subject.memory() == Memory::PathDependent {
        subject.answer_at(start).ok()?;
    }
    let mut plant = Flotor::at_rest(start, conditions.damping_ns_per_m, LEVER_M, PERIOD_S);
    let mut way = VecDeque::from(vec![(start, plant.twist()); conditions.delay_ticks]);
    let mut held = Wrench::ZERO;
    let mut before: Option<(Pose, Wrench)> = None;
    let (mut first_pull, mut steady) = (None, true);
    let mut forces_n = Vec::with_capacity(TICKS);
    let mut kinetic_j = [0.0; 4];
    let start_m = distance_m(Pose::HOME, start);
    let (mut stored_j, mut steepest_below) = ([f64::NAN; 2], None);
    let (mut settled_tick, mut steepest, mut lost) = (0, 0.0, false);
    for tick in 0..TICKS {
        way.push_back((conditions.sees(plant.pose()), plant.twist()));
        let (pose, twist) = way.pop_front()?;
        let answer = subject.advance(pose, twist, PERIOD_NS).ok()?;
        let wrench = answer.wrench;
        stored_j = [if tick == 0 { answer.energy_j } else { stored_j[0] }, answer.energy_j];
        if stored_j[1] - stored_j[0] > UPHILL_J {
            steepest_below.get_or_insert(steepest);
        }
        if let Some((from, last)) = before {
            let motion_m = distance_m(from, pose);
            if motion_m > MOVING_M {
                steepest = f64::max(steepest, size_n(&(wrench + last * -1.0)) / motion_m);
            }
        }
        before = Some((pose, wrench));
        let first_pull = *first_pull.get_or_insert(wrench);
        steady &= product_n2(&first_pull, &wrench) > STEADY * size_n(&first_pull) * size_n(&wrench);
        if conditions.dropped == 0.0 || random.unit() >= conditions.dropped {
            held = wrench * conditions.gain;
        }
        plant.advance(&held);
        forces_n.push(held.force());
        kinetic_j[4 * tick / TICKS] += plant.kinetic_j();
        let from_home_m = distance_m(Pose::HOME, plant.pose());
        if from_home_m > SETTLED * start_m {
            settled_tick = tick + 1;
        }
        // Written so that NaN counts as lost too.
        lost = !(from_home_m <= LOST_M && plant.pose().is_finite());
        if lost {
            break;
        }
    }
    let [first, _, third, last] = kinetic_j;
    let growing = last > GROWING * third && last > BUZZ * first;
    let gone = lost || growing;
    Some(Release {
        diverged: gone && !steady,
        carried_off: gone && steady,
        rests_elsewhere: !gone && settled_tick == TICKS && last <= AT_REST * first.max(third),
        uphill_j: stored_j[1] - stored_j[0],
        restless_j: 4.0 * last / TICKS as f64,
        steepest_below_n_per_m: steepest_below.unwrap_or(steepest),
        settle_s: if settled_tick < TICKS { settled_tick as f64 * PERIOD_S } else { f64::NAN },
        peak_force_n: forces_n.iter().map(|force| force.length()).fold(0.0, f64::max),
        buzz_n: buzz_n(&forces_n),
        steepest_n_per_m: steepest,
    })
}

/// Returns the distance between two poses, with rotations at the lever arm, m.
fn distance_m(from: Pose, to: Pose) -> f64 {
    let turn_m = rotation_vector(to.orientation() * from.orientation().conjugate()) * LEVER_M;
    ((to.position() - from.position()).length_squared() + turn_m.length_squared()).sqrt()
}

/// Returns the magnitude of a wrench, with torques at the lever arm, N.
fn size_n(wrench: &Wrench) -> f64 {
    product_n2(wrench, wrench).sqrt()
}

/// Returns the scalar product of two wrenches, with torques at the lever arm, N².
fn product_n2(one: &Wrench, other: &Wrench) -> f64 {
    one.force().dot(other.force()) + (one.torque() / LEVER_M).dot(other.torque() / LEVER_M)
}

/// Number of last samples for the buzz, about a second.
const BUZZ_WINDOW: usize = 1024;
/// Lower end of the buzz band, Hz; the upper end is half the rate.
const BUZZ_FROM_HZ: f64 = 50.0;

/// Returns the root mean square of the force above 50 Hz over the last second, N: Hann-windowed total less the slow
/// part (Parseval).
fn buzz_n(forces_n: &[DVec3]) -> f64 {
    let Some(last) = forces_n.len().checked_sub(BUZZ_WINDOW).and_then(|from| forces_n.get(from..)) else {
        return f64::NAN;
    };
    let count = BUZZ_WINDOW as f64;
    let mean = last.iter().copied().sum::<DVec3>() / count;
    let circle: Vec<(f64, f64)> =
        (0..BUZZ_WINDOW).map(|step| math::sin_cos(TAU * step as f64 / count)).collect();
    let windowed: Vec<DVec3> =
        last.iter().zip(&circle).map(|(force, (_, cosine))| (*force - mean) * (0.5 - 0.5 * cosine)).collect();
    let whole = windowed.iter().map(|force| force.length_squared()).sum::<f64>() / count;
    let slow_bins = (0..BUZZ_WINDOW).take_while(|bin| *bin as f64 / (count * PERIOD_S) < BUZZ_FROM_HZ);
    let slow: f64 = slow_bins
        .map(|bin| {
            let (real, imaginary) =
                (0..BUZZ_WINDOW).fold((DVec3::ZERO, DVec3::ZERO), |(real, imaginary), step| {
                    let (sine, cosine) = circle[bin * step % BUZZ_WINDOW];
                    (real + windowed[step] * cosine, imaginary + windowed[step] * sine)
                });
            // Every frequency but zero counts twice, for its mirror image.
            let images = if bin == 0 { 1.0 } else { 2.0 };
            images * (real.length_squared() + imaginary.length_squared()) / (count * count)
        })
        .sum();
    // A Hann window reduces the power to 3/8.
    ((whole - slow).max(0.0) * 8.0 / 3.0).sqrt()
}

/// Returns all combinations of imperfections, the clean ones first.
fn loops() -> Vec<Loop> {
    let mut loops = Vec::new();
    for dropped in DROPS {
        for quantum_m in QUANTA_M {
            for delay_ticks in DELAYS_TICKS {
                for damping_ns_per_m in DAMPINGS_NS_PER_M {
                    loops.push(Loop { damping_ns_per_m, delay_ticks, quantum_m, dropped, gain: 1.0 });
                }
            }
        }
    }
    loops
}

/// Release with its conditions.
struct Row {
    conditions: Loop,
    start: Pose,
    release: Option<Release>,
}

impl Row {
    fn diverged(&self) -> bool {
        self.release.as_ref().is_some_and(|release| release.diverged)
    }

    fn carried_off(&self) -> bool {
        self.release.as_ref().is_some_and(|release| release.carried_off)
    }

    /// Returns true if the model moved a purely dissipative device to a place of higher stored energy, where it hardly
    /// moves; a loop that is too stiff would oscillate.
    fn driven_uphill(&self) -> bool {
        self.release.as_ref().is_some_and(|release| {
            let Release { uphill_j, restless_j, steepest_below_n_per_m, .. } = *release;
            let may_swing = steepest_below_n_per_m > 0.98 * self.conditions.stiffest_n_per_m();
            self.conditions.is_clean()
                && !may_swing
                && uphill_j > UPHILL_J
                && restless_j < NEARLY_STILL * uphill_j
        })
    }

    /// Returns true if the rule predicts that this release settles; 2 % are the rule's own error.
    fn must_settle(&self) -> bool {
        let steepest = self.release.as_ref().map_or(f64::INFINITY, |release| release.steepest_n_per_m);
        self.conditions.is_clean()
            && !self.carried_off()
            && steepest <= 0.98 * self.conditions.stiffest_n_per_m()
    }
}

/// Measures releases under all conditions, and the stiffness limit of each clean loop.
pub(super) fn measure(setup: &Setup<'_>) -> Result<Measure, LoadError> {
    let loops = loops();
    let count = loops.len() as u64;
    let reach = setup.options.reach.scaled(NEAR);
    let rows = sweep(setup, NAME, setup.share(100, 2) * count, |subject, block| {
        let mut random = Random::new(setup.options.seed, block / count);
        let start = at(random.vector() * reach.position_m, random.vector() * reach.rotation_rad);
        let conditions = loops[usize::try_from(block % count).unwrap_or(0)];
        vec![Row { conditions, start, release: release(subject, conditions, start, &mut random) }]
    })?;
    let mut measure = judge(&rows);
    let mut limits = limits(setup)?;
    limits.sort_by(|(a, ..), (b, ..)| a.cmp(b));
    for (name, seen_n_per_m, rule_n_per_m) in limits {
        measure = measure.with(format!("stiffness limit, {name}"), seen_n_per_m, "N/m").with(
            format!("stiffness limit by the rule, {name}"),
            rule_n_per_m,
            "N/m",
        );
    }
    Ok(measure)
}

/// Number of bisections: two decades to a thousandth.
const HALVINGS: usize = 12;
/// Start of the search for the limit, relative to the workspace: small enough for a linear law.
const LINEAR: f64 = 1.0e-3;

/// Returns the stability limit of each clean loop near home, N/m: measured, and by the rule.
fn limits(setup: &Setup<'_>) -> Result<Vec<(String, f64, f64)>, LoadError> {
    let clean: Vec<Loop> = loops().into_iter().filter(Loop::is_clean).collect();
    let reach = setup.options.reach.scaled(LINEAR);
    let start = at(DVec3::ONE * reach.position_m, DVec3::ONE * reach.rotation_rad);
    sweep(setup, "stiffness limits", clean.len() as u64, |subject, block| {
        let clean = clean[usize::try_from(block).unwrap_or(0)];
        let name = format!("b = {} N s/m, delay {}", clean.damping_ns_per_m, clean.delay_ticks);
        vec![(name, limit(subject, clean, start).unwrap_or(f64::NAN), clean.stiffest_n_per_m())]
    })
}

/// Returns the stiffness at home times the gain at which the loop starts to grow, N/m; `None` without a stiffness.
fn limit(subject: &mut Subject<'_>, clean: Loop, start: Pose) -> Option<f64> {
    let stiffness = Jacobian::at(subject, Pose::HOME)?.gain();
    let rule = clean.stiffest_n_per_m();
    if stiffness <= 0.0 {
        return None;
    }
    let mut random = Random::new(0, 0); // never drawn from: no tick is lost
    let mut diverges = |gain| Some(release(subject, Loop { gain, ..clean }, start, &mut random)?.diverged);
    let (mut stable, mut unstable) = (0.1 * rule / stiffness, 10.0 * rule / stiffness);
    if diverges(stable)? || !diverges(unstable)? {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = (stable * unstable).sqrt();
        if diverges(middle)? { unstable = middle } else { stable = middle }
    }
    Some(stiffness * (stable * unstable).sqrt())
}

fn judge(rows: &[Row]) -> Measure {
    let count = |is: &dyn Fn(&Row) -> bool| rows.iter().filter(|row| is(row)).count() as u64;
    let is_surprise = |row: &Row| (row.diverged() && row.must_settle()) || row.driven_uphill();
    let uphill = count(&Row::driven_uphill);
    let elsewhere = count(&|row| {
        row.must_settle() && row.release.as_ref().is_some_and(|release| release.rests_elsewhere)
    });
    let surprises = count(&is_surprise);
    let answered = count(&|row| row.release.is_some());
    let foretold = count(&Row::must_settle);
    let carried_off = count(&Row::carried_off);
    let (verdict, comment) = match (surprises, foretold) {
        (1.., _) if uphill > 0 => {
            (Verdict::Fail, format!("{uphill} releases came to rest with more energy than they started with"))
        }
        (1.., _) => (
            Verdict::Fail,
            "a release diverges although its stiffness stays below the stability limit".to_owned(),
        ),
        (0, 0) if carried_off > 0 => {
            (Verdict::NothingToJudge, "no release has an equilibrium to settle at".to_owned())
        }
        (0, 0) => (
            Verdict::NothingToJudge,
            "no release stays below the stability limit on its whole path".to_owned(),
        ),
        _ if elsewhere > 0 => {
            let text = format!(
                "{foretold} releases below the stability limit, all settled, {elsewhere} of them away from home"
            );
            (Verdict::Pass, text)
        }
        _ => (Verdict::Pass, format!("{foretold} releases below the stability limit, all settled")),
    };
    let pose = rows.iter().find(|row| is_surprise(row)).map(|row| row.start);
    let worst = Worst { value: surprises as f64, pose };
    let mut measure = Measure { verdict, ..Measure::of(["M6", NAME, ""], &worst, [0.0, 0.0], comment) }
        .count("releases", rows.len() as u64)
        .count("releases without answer", rows.len() as u64 - answered)
        .count("releases carried off", carried_off)
        .count("releases at rest away from home", elsewhere)
        .count("releases driven uphill", uphill)
        .unless_empty(answered, NO_ANSWER);
    let largest = |is: &dyn Fn(&Row) -> bool, pick: fn(&Release) -> f64| {
        let releases = rows.iter().filter(|row| is(row)).filter_map(|row| row.release.as_ref());
        releases.map(pick).fold(0.0, |a: f64, b| if b.is_nan() { b } else { a.max(b) })
    };
    for damping in DAMPINGS_NS_PER_M {
        let here = |row: &Row| {
            let Loop { damping_ns_per_m, delay_ticks, .. } = row.conditions;
            row.conditions.is_clean() && delay_ticks == 0 && damping_ns_per_m == damping
        };
        let name = |what: &str| format!("{what}, b = {damping} N s/m");
        measure = measure
            .with(name("longest settling"), largest(&here, |release| release.settle_s), "s")
            .with(name("peak force"), largest(&here, |release| release.peak_force_n), "N")
            .with(name("steepest on the way"), largest(&here, |release| release.steepest_n_per_m), "N/m");
    }
    let diverged =
        |is: &dyn Fn(&Row) -> bool| count(&|row| is(row) && row.diverged()) as f64 / count(is).max(1) as f64;
    for delay in DELAYS_TICKS {
        let share = diverged(&|row| row.conditions.delay_ticks == delay);
        measure = measure.with(format!("share diverged, delay {delay}"), share, "");
    }
    for quantum_m in QUANTA_M {
        let calm = |row: &Row| {
            let Loop { quantum_m: quantum, dropped, .. } = row.conditions;
            quantum == quantum_m && dropped == 0.0 && !row.diverged()
        };
        let buzz_n = largest(&calm, |release| release.buzz_n.max(0.0));
        measure = measure.with(format!("buzz, {} µm", quantum_m * 1.0e6), buzz_n, "N");
    }
    for dropped in DROPS {
        let share = diverged(&|row| row.conditions.dropped == dropped);
        measure = measure.with(format!("share diverged, {} % dropped", dropped * 100.0), share, "");
    }
    measure
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buzz_hears_a_hundred_hertz_and_not_ten() {
        let tone = |hertz: f64| -> Vec<DVec3> {
            (0..2000).map(|tick| DVec3::X * (TAU * hertz * f64::from(tick) * PERIOD_S).sin()).collect()
        };
        // A tone of amplitude 1 has a root mean square of 0.707; the window's side lobes leave a thousandth.
        assert!((buzz_n(&tone(100.0)) - 0.5_f64.sqrt()).abs() < 2.0e-3);
        assert!(buzz_n(&tone(10.0)) < 1.0e-3);
    }
}
