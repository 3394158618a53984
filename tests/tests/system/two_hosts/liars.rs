//! A partner that lies, and a third that wants to be one: what comes out of a port is bounded by what was checked at that end.

use super::{Host, Random, Registry, WATCHDOG_TICKS, Way, scene};
use flotor_core::peer::{Dispatch, PeerState, TankState};
use flotor_core::trace::Events;
use flotor_coupling::ClaimExcess;
use flotor_hal::{DQuat, DVec3, Pose, Twist};
use flotor_tests::TestSize;
use rayon::prelude::*;

/// The run that lies.
const LIAR: u64 = 99;
/// What a hand is believed to put in, W, and at once, J: as `coupling/claims.rs` has it.
const HAND_W: f64 = 1.0;
const AT_ONCE_J: f64 = 0.25;

/// A lie: the message that the partner sends in a tick, made of an honest one with the pose of the run's own handle.
type Lie = fn(u64, &mut Random, Dispatch) -> Dispatch;

fn up(z_m: f64, speed_m_per_s: f64, passed_on_j: f64) -> PeerState {
    let pose = Pose::new(DVec3::Z * z_m, DQuat::IDENTITY);
    PeerState { pose, twist: Twist::new(DVec3::Z * speed_m_per_s, DVec3::ZERO), passed_on_j }
}

fn swing(tick: u64, most_m: f64, frequency_hz: f64, passed_on_j: f64) -> PeerState {
    let rate = std::f64::consts::TAU * frequency_hz;
    let phase = rate * 1.0e-3 * tick as f64;
    up(most_m * phase.sin(), most_m * rate * phase.cos(), passed_on_j)
}

/// From one end of the range to the other and back, almost as fast as is believed, with almost all the energy that is.
fn throw(tick: u64, period: u64, dispatch: Dispatch) -> Dispatch {
    const SPEED_M_PER_S: f64 = 1.9;
    let (half, most_m) = (period / 2, 7.0e-3);
    let way_m = (1.0e-3 * SPEED_M_PER_S * (tick % half) as f64).min(2.0 * most_m);
    let direction = if tick % period < half { 1.0 } else { -1.0 };
    let speed_m_per_s = if way_m < 2.0 * most_m { SPEED_M_PER_S } else { 0.0 };
    Dispatch {
        state: up(direction * (way_m - most_m), direction * speed_m_per_s, 0.95e-3 * tick as f64),
        ..dispatch
    }
}

/// Ahead of the handle by its own speed times a time: a damper that drives. A small swing begins it.
fn drive(tick: u64, ahead_s: f64, dispatch: Dispatch) -> Dispatch {
    let PeerState { pose, twist, .. } = dispatch.state;
    let begin_m = 0.5e-3 * (std::f64::consts::TAU * 4.0e-3 * tick as f64).sin();
    let position = pose.position() + twist.linear() * ahead_s + DVec3::Z * begin_m;
    let orientation =
        DQuat::from_scaled_axis(twist.angular() * ahead_s + DVec3::X * begin_m) * pose.orientation();
    let pose = Pose::new(position, orientation.normalize());
    Dispatch { state: PeerState { pose, twist, passed_on_j: 0.95e-3 * tick as f64 }, ..dispatch }
}

/// Any number there is, of any size.
fn wild(random: &mut Random) -> f64 {
    let exponent = 40.0 * random.share() - 20.0;
    (random.share() - 0.5) * 10.0_f64.powf(exponent)
}

fn wild_state(random: &mut Random) -> PeerState {
    let mut vector = || DVec3::new(wild(random), wild(random), wild(random));
    let (position, linear, angular) = (vector(), vector(), vector());
    let turn = DQuat::from_scaled_axis(vector().clamp_length_max(3.0));
    let pose = Pose::new(position, turn.normalize());
    PeerState { pose, twist: Twist::new(linear, angular), passed_on_j: wild(random).abs() }
}

const LIES: [(&str, Lie); 24] = [
    ("a throw at 1 Hz", |tick, _, d| throw(tick, 1000, d)),
    ("a throw at 2 Hz", |tick, _, d| throw(tick, 500, d)),
    ("a throw at 3 Hz", |tick, _, d| throw(tick, 334, d)),
    ("a throw at 4 Hz", |tick, _, d| throw(tick, 250, d)),
    ("a throw at 6 Hz", |tick, _, d| throw(tick, 166, d)),
    ("a throw at 10 Hz", |tick, _, d| throw(tick, 100, d)),
    ("a throw at 25 Hz", |tick, _, d| throw(tick, 40, d)),
    ("a drive 50 ms ahead", |tick, _, d| drive(tick, 0.05, d)),
    ("a drive 0.2 s ahead", |tick, _, d| drive(tick, 0.2, d)),
    ("a drive 1 s ahead", |tick, _, d| drive(tick, 1.0, d)),
    ("a drive that is let go at its fastest", |tick, _, d| {
        let told = drive(tick, 0.2, d);
        let is_fast = d.state.twist.linear().length() > 0.2;
        let passed_on_j = if is_fast { f64::MAX } else { told.state.passed_on_j };
        Dispatch { state: PeerState { passed_on_j, ..told.state }, ..told }
    }),
    ("1 J a tick on a swing at its resonance", |tick, _, d| Dispatch {
        state: swing(tick, 0.01, 4.0, tick as f64),
        ..d
    }),
    ("50 mJ a tick on a small swing", |tick, _, d| Dispatch {
        state: swing(tick, 0.002, 8.0, 0.05 * tick as f64),
        ..d
    }),
    ("0.9 W for nothing", |tick, _, d| Dispatch { state: up(0.0, 0.0, 0.9e-3 * tick as f64), ..d }),
    ("0.9 W on a swing", |tick, _, d| Dispatch { state: swing(tick, 0.004, 3.0, 0.9e-3 * tick as f64), ..d }),
    ("all the energy there is", |tick, _, d| Dispatch { state: swing(tick, 0.005, 2.0, f64::MAX), ..d }),
    ("a pose that jumps", |tick, random, d| Dispatch {
        state: up(0.02 * (random.share() - 0.5), 0.0, 1.0e-3 * tick as f64),
        ..d
    }),
    ("a pose out of this world", |tick, _, d| Dispatch { state: up(1.7e308, 0.0, 0.01 * tick as f64), ..d }),
    ("a place beyond its range", |tick, _, d| Dispatch { state: up(0.5, 0.0, 1.0e-3 * tick as f64), ..d }),
    ("a twist without a motion", |tick, _, d| Dispatch { state: up(0.0, 1.0e9, 1.0e-3 * tick as f64), ..d }),
    ("another run each tick", |tick, _, d| Dispatch {
        run: LIAR + tick,
        state: swing(tick, 0.01, 4.0, tick as f64),
        ..d
    }),
    ("a new beginning every other tick", |tick, _, d| Dispatch {
        since: tick / 2,
        state: swing(tick, 0.01, 4.0, 0.02 * tick as f64),
        ..d
    }),
    ("a time that jumps", |tick, random, d| Dispatch {
        tick: random.bits(),
        state: swing(tick, 0.01, 4.0, 0.05 * tick as f64),
        ..d
    }),
    ("anything", |_, random, d| Dispatch {
        run: if random.below(4) == 0 { random.bits() } else { d.run },
        partner: if random.below(8) == 0 { random.bits() } else { d.partner },
        since: if random.below(8) == 0 { random.bits() } else { d.since },
        tick: if random.below(8) == 0 { random.bits() } else { d.tick },
        state: wild_state(random),
        ..d
    }),
];

#[test]
fn no_lie_brings_out_more_than_was_checked_here_or_throws_the_handle() {
    let registry = Registry::search(&[]);
    let ticks = TestSize::of_this_run().pick(5_000, 100_000) as u64;
    for (name, lie) in LIES {
        let duration_s = 1.0e-3 * ticks as f64 + 1.0;
        let mut host =
            Host::start(&registry, &scene("hand = \"hold\"\nhand_grip = \"relaxed\"", duration_s, ""), 5);
        let mut random = Random(30);
        let mut seen = up(0.0, 0.0, 0.0);
        for tick in 0..ticks {
            let honest = Dispatch {
                run: LIAR,
                partner: 5,
                since: 1,
                tick: tick + 1,
                state: seen,
                tank: TankState::default(),
            };
            host.hear(lie(tick, &mut random, honest), tick);
            host.advance();
            seen = host.told().map_or(seen, |told| told.state);
            assert_eq!(host.end, None, "{name}: in tick {tick}");
        }
        let coupling = host.coupling();
        let link = coupling.link.expect("its other end is elsewhere");
        let port = host.records.0.iter().map(|record| record.port_energy_j);
        let out_j = -port.fold(0.0, f64::min);
        let cut_ticks =
            host.records.0.iter().filter(|r| r.events.intersects(Events::PARTNER_LIMITED)).count();
        println!(
            "{name}: {:.3} mJ out of {:.3} mJ believed; cut {:?} in {cut_ticks} ticks, let go {:?}",
            out_j * 1.0e3,
            link.accepted_j * 1.0e3,
            link.cut,
            link.rejected_runs
        );
        // What is not foreseen of a hand is paid for afterwards.
        assert!(out_j <= link.accepted_j + 1.0e-4, "{name}: {out_j} J, {link:?}");
        // What this end has passed on may come back any number of times; the rest is at most the work of a hand.
        let TankState { level_j, gone_in_j, discarded_j, .. } = coupling.tanks[0];
        let kept_j = level_j + discarded_j - gone_in_j;
        assert!(kept_j <= HAND_W * duration_s + AT_ONCE_J, "{name}: {coupling:?}");
        assert!(link.cut.energy_j.is_finite() && coupling.tanks[0].lowest_j >= -1.0e-4, "{name}");
        assert!(link.cut == ClaimExcess::default() || cut_ticks > 0, "{name}: what is cut is an event");
        // Another host, which tells the truth, is heard again soon.
        let is_deaf = !link.rejected_runs.contains(&0);
        for tick in ticks..ticks + 500 {
            let honest = Dispatch {
                run: 7,
                partner: 5,
                since: ticks,
                tick: tick + 1,
                state: up(0.0, 0.0, 0.0),
                tank: TankState::default(),
            };
            host.hear(honest, tick);
            host.advance();
        }
        let hears = host.coupling().link.expect("its other end is elsewhere").run == 7;
        assert!(hears || is_deaf, "{name}");
    }
}

/// Three programs on one coupling, the last of which begins so many ticks after the others.
fn three(registry: &Registry, seed: u64, late: u64) {
    let mut hosts: Vec<Host> = (["oscillate", "hold", "hold"].iter().zip([11, 12, 13]))
        .map(|(hand, run)| {
            let grip = if *hand == "oscillate" { "firm" } else { "relaxed" };
            let hand = format!("hand = \"{hand}\"\nhand_grip = \"{grip}\"");
            Host::start(registry, &scene(&hand, 6.0, ""), run)
        })
        .collect();
    let mut way = Way::new(seed);
    let mut lowest_j = 0.0_f64;
    for tick in 0..5000 {
        for (to, dispatch) in way.arrived(tick) {
            hosts[to].hear(dispatch, tick);
        }
        let present = if tick < late { 2 } else { 3 };
        for (from, host) in hosts.iter_mut().enumerate().take(present) {
            host.advance();
            // As a bridge does: what it serves is heard by all that come to it, and it hears all of them.
            let to: &[usize] = if from == 0 { &[1, 2] } else { &[0] };
            if let Some(dispatch) = host.told() {
                to.iter().for_each(|to| way.send(tick, *to, dispatch));
            }
        }
        let ports = hosts.iter().filter_map(|host| host.records.0.last());
        lowest_j = lowest_j.min(ports.map(|record| record.port_energy_j).sum());
    }
    let case = format!("seed {seed}, the third {late} ticks later");
    // Sums of some thousand terms of up to 10 mJ.
    assert!(lowest_j >= -1.0e-12, "{case}: more came out of the three ports than went in: {lowest_j} J");
    let links: Vec<_> = hosts.iter_mut().map(|host| host.coupling().link.expect("it is elsewhere")).collect();
    let (partner, third) = if links[0].run == 12 { (1, 2) } else { (2, 1) };
    let most = 5000 - if third == 1 { late } else { 0 };
    // Of messages that overtake one another only the newer ones count.
    assert!([0, partner].iter().all(|host| links[*host].ticks > most / 5), "{case}: {links:?}");
    for host in [0, third] {
        let others = hosts[host].pairing.counts().others;
        assert!(others > (4500 - late) / 2, "{case}: {others} are told, and counted");
    }
    // Who is asked first may hear a word until another has answered sooner; nobody pulls by then.
    assert!(links[third].ticks < WATCHDOG_TICKS, "{case}: {links:?}");
    let later = hosts[third].records.0.iter().skip(500);
    assert!(
        later.clone().count() > 0 && later.into_iter().all(|record| record.commanded.force() == DVec3::ZERO),
        "{case}"
    );
}

#[test]
fn a_third_program_on_a_coupling_is_let_in_by_nobody_and_adds_no_energy() {
    let registry = Registry::search(&[]);
    let seeds = 0..TestSize::of_this_run().pick(3, 100) as u64;
    let cases: Vec<(u64, u64)> = seeds.flat_map(|seed| [0, 15, 1000].map(|late| (seed, late))).collect();
    cases.into_par_iter().for_each(|(seed, late)| three(&registry, seed, late));
}
