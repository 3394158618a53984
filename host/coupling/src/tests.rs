//! The coupling against what it promises: energy, delay, lost and overtaken messages, scales and frames.

#[path = "../../../tests/src/random.rs"]
pub(crate) mod random;

use super::*;
use flotor_core::mapping::MappingConfig;
use flotor_hal::{DQuat, DVec3, Pose, Twist};
use random::Random;

const PERIOD_S: f64 = 1.0e-3;

/// A flotor of 0.58 kg that slides along z in a hand, or free; exact between two samples, as the wrench is held.
struct Slider {
    z_m: f64,
    velocity_m_per_s: f64,
    held_n: f64,
}

impl Slider {
    const MASS_KG: f64 = 0.58;
    const AT_REST: Slider = Slider { z_m: 0.0, velocity_m_per_s: 0.0, held_n: 0.0 };

    fn state(&self) -> DeviceState {
        DeviceState {
            pose: Pose::new(DVec3::Z * self.z_m, DQuat::IDENTITY),
            twist: Twist::new(DVec3::Z * self.velocity_m_per_s, DVec3::ZERO),
            ..DeviceState::HOME
        }
    }

    fn held(&self) -> Wrench {
        Wrench::from_force(DVec3::Z * self.held_n)
    }

    /// One period with the hand's force and the end's; energy that the hand put in, J.
    fn slide(&mut self, hand_n: f64, pull: &Pull) -> f64 {
        self.held_n = pull.wrench.force().z;
        let acceleration = (hand_n + self.held_n) / Self::MASS_KG;
        let way_m = self.velocity_m_per_s * PERIOD_S + 0.5 * acceleration * PERIOD_S * PERIOD_S;
        self.z_m += way_m;
        self.velocity_m_per_s += acceleration * PERIOD_S;
        hand_n * way_m
    }
}

fn ends() -> [CouplingEnd; 2] {
    [0, 1].map(|device| CouplingEnd { device, mapping: MappingConfig::default() })
}

/// Two sliders, the hand of the first shaking, the second free, for five seconds. The lowest that was ever there of
/// what has gone in at both ends together, J, and how fast the second slider ever was, m/s.
fn shaken(config: CouplingConfig) -> (f64, f64) {
    let mut coupling = Coupling::new(&config, &ends(), PERIOD_S);
    let mut sliders = [Slider::AT_REST, Slider::AT_REST];
    let (mut lowest_j, mut fastest_m_per_s) = (0.0_f64, 0.0_f64);
    for tick in 0..5000 {
        let states = sliders.each_ref().map(Slider::state);
        let [first, second] = [0, 1].map(|end| PortSample { state: &states[end], held: sliders[end].held() });
        let pulls = coupling.step([first, second]);
        let gone_in_j: f64 = coupling.tanks().iter().map(|tank| tank.state().gone_in_j).sum();
        lowest_j = lowest_j.min(gone_in_j);
        let [first, second] = &mut sliders;
        // A hand that intends to go up and down at 2 Hz and holds with 400 N/m and 4 N s/m; it releases after three
        // seconds.
        let aim_m = 0.004 * (2.0 * std::f64::consts::TAU * f64::from(tick) * PERIOD_S).sin();
        let grip = if tick < 3000 { 1.0 } else { 0.0 };
        let hand_n = grip * (400.0 * (aim_m - first.z_m) - 4.0 * first.velocity_m_per_s);
        first.slide(hand_n, &pulls[0]);
        second.slide(0.0, &pulls[1]);
        fastest_m_per_s = fastest_m_per_s.max(second.velocity_m_per_s.abs());
    }
    (lowest_j, fastest_m_per_s)
}

#[test]
fn what_one_hand_does_moves_the_other_handle() {
    let (lowest_j, fastest_m_per_s) = shaken(CouplingConfig::default());
    assert_eq!(lowest_j, 0.0);
    // The intended motion of the hand has 50 mm/s.
    assert!((0.02..0.2).contains(&fastest_m_per_s), "{fastest_m_per_s} m/s");
}

#[test]
fn a_long_delay_generates_energy_and_the_controller_removes_it() {
    for delay_ticks in [30, 100, 300] {
        let with = |passivity| shaken(CouplingConfig { delay_ticks, passivity, ..CouplingConfig::default() });
        let (free, kept) = (with(PassivityMode::Observe), with(PassivityMode::Control));
        assert!(free.0 < -1.0e-3, "{delay_ticks} ticks: the pair drives itself: {free:?}");
        assert_eq!(kept.0, 0.0, "{delay_ticks} ticks: {kept:?}");
    }
}

#[test]
fn tanks_balance_and_energy_on_its_way_is_in_neither() {
    let config = CouplingConfig { delay_ticks: 7, ..CouplingConfig::default() };
    let mut coupling = Coupling::new(&config, &ends(), PERIOD_S);
    let mut sliders = [Slider::AT_REST, Slider::AT_REST];
    for tick in 0..2000 {
        let states = sliders.each_ref().map(Slider::state);
        let samples = [0, 1].map(|end| PortSample { state: &states[end], held: sliders[end].held() });
        let pulls = coupling.step(samples);
        let push_n = 0.5 * (0.02 * f64::from(tick)).sin();
        sliders.iter_mut().zip([push_n, -push_n]).zip(pulls).for_each(|((slider, push_n), pull)| {
            slider.slide(push_n, &pull);
        });
        let tanks = coupling.tanks();
        for tank in tanks {
            assert!(tank.imbalance_j().abs() < 1.0e-12, "tick {tick}: {tank:?}");
        }
        let there_j: f64 = tanks.iter().map(|tank| tank.level_j() + tank.state().discarded_j).sum();
        let gone_in_j: f64 = tanks.iter().map(|tank| tank.state().gone_in_j).sum();
        assert!(there_j <= gone_in_j + 1.0e-12, "tick {tick}: {there_j} J of {gone_in_j} J");
    }
}

/// Two ends on two machines: messages are late by a time that changes, overtake one another, and a third of them is
/// lost.
#[test]
fn the_pair_generates_no_energy_whatever_becomes_of_the_messages() {
    for seed in 0..200 {
        let mut random = Random(seed);
        let config = CouplingConfig::default();
        let mut ends = [(); 2].map(|()| End::new(&config, &MappingConfig::default(), PERIOD_S));
        let mut sliders = [Slider::AT_REST, Slider::AT_REST];
        // Peer states on their way to an end, and when they arrive.
        let mut ways: [Vec<(i32, PeerState)>; 2] = [Vec::new(), Vec::new()];
        let mut hand_n = [0.0; 2];
        let mut moved_m = 0.0_f64;
        for tick in 0..3000 {
            let states = sliders.each_ref().map(Slider::state);
            for from in [0, 1] {
                ends[from].observe(&states[from], &sliders[from].held());
                let peer = ends[from].send_state(&states[from]);
                #[allow(clippy::cast_possible_truncation)] // up to 80 ticks
                let late = (40.0 + 40.0 * random.symmetric()) as i32;
                if random.symmetric() > -1.0 / 3.0 {
                    ways[1 - from].push((tick + late, peer));
                }
            }
            for (end, way) in ends.iter_mut().zip(&mut ways) {
                way.iter().filter(|(arrives, _)| *arrives == tick).for_each(|(_, peer)| end.receive(peer));
                way.retain(|(arrives, _)| *arrives > tick);
            }
            let gone_in_j: f64 = ends.iter().map(|end| end.tank.state().gone_in_j).sum();
            assert!(gone_in_j >= -1.0e-12, "seed {seed}, tick {tick}: {gone_in_j} J");
            for index in [0, 1] {
                // Hands that push now here, now there, softly held in the middle.
                hand_n[index] += 0.02 * random.symmetric() - 0.01 * hand_n[index];
                let hold_n = -40.0 * sliders[index].z_m - 2.0 * sliders[index].velocity_m_per_s;
                let pull = ends[index].pull(&states[index]);
                sliders[index].slide(hand_n[index] + hold_n, &pull);
                moved_m = moved_m.max(sliders[index].z_m.abs());
            }
        }
        assert!((1.0e-4..0.05).contains(&moved_m), "seed {seed}: {moved_m} m");
    }
}

#[test]
fn scales_and_frames_are_the_mappings_and_energy_balances_across_them() {
    let turned = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    // The second device is half as large, twice as strong, and lies on its back.
    let mapping = MappingConfig {
        rotation_xyzw: turned.to_array(),
        motion_scale: 2.0,
        force_scale: 2.0,
        torque_scale: None,
    };
    let config = CouplingConfig { delay_ticks: 1, ..CouplingConfig::default() };
    let mut pair = ends();
    pair[1].mapping = mapping;
    let mut coupling = Coupling::new(&config, &pair, PERIOD_S);
    // The first is drawn up by 4 mm at 20 mm/s, the second rests: first energy goes in, then there is a force.
    let still = DeviceState::HOME;
    let mut pulls = [Pull::default(); 2];
    for tick in 0..200 {
        let up = DeviceState {
            pose: Pose::new(DVec3::Z * (2.0e-5 * f64::from(tick)), DQuat::IDENTITY),
            twist: Twist::new(DVec3::Z * 0.02, DVec3::ZERO),
            ..DeviceState::HOME
        };
        let sample = |state, pull: &Pull| PortSample { state, held: pull.wrench };
        pulls = coupling.step([sample(&up, &pulls[0]), sample(&still, &pulls[1])]);
    }
    let spring_n = config.stiffness_n_per_m * 0.00398 + config.damping_ns_per_m * 0.02;
    let [first, second] = pulls.map(|pull| pull.wrench.force());
    assert!((first - DVec3::NEG_Z * spring_n).length() < 0.05, "{first}");
    // Up in the shared frame is the second device's -y.. its own axis turned back; twice the force.
    let expected = turned.conjugate() * DVec3::Z * spring_n * 2.0;
    assert!((second - expected).length() < 0.1, "{second} for {expected}");
}
