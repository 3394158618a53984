//! Two hands on one membrane against a simulation of its own: masses in a list, springs in a list, no blocks.

use flotor_hal::{
    ContactSet, ContactSetModel, DQuat, DVec3, ForceModel, Input, Output, Pose, Settings, WorldContactsModel,
    WorldModel,
};
use flotor_membrane::Membrane;
use flotor_membrane::mesh::{Mesh, Sheet};

/// The membrane of the plugin with its defaults.
const SHEET: Sheet =
    Sheet { nodes_per_side: 17, side_m: 0.04, mass_kg: 0.01, stiffness_n_per_m: 200.0, stretch: 1.25 };
const CONTACT_N_PER_M: f64 = 400.0;
const DAMPING_PER_S: f64 = 50.0;
const RADIUS_M: f64 = 0.005;
const PERIOD_S: f64 = 1.0e-3;

fn input(tick: u64, position_m: DVec3) -> Input {
    let dt_ns = if tick == 0 { 0 } else { 1_000_000 };
    let pose = Pose::new(position_m, DQuat::IDENTITY);
    Input { tick, time_ns: tick * 1_000_000, dt_ns, ..Input::at_rest(pose) }
}

/// Handles of two hands 16 mm apart: the left one presses 2 mm into the sheet and stays, the right one goes up and down.
fn hands(tick: u64) -> [DVec3; 2] {
    let time_s = tick as f64 * PERIOD_S;
    let press_m = 0.002 * (time_s / 0.05).min(1.0);
    let swing_m = 0.0015 * (1.0 - (60.0 * time_s).cos());
    [DVec3::new(-0.008, 0.0, -press_m), DVec3::new(0.008, 0.001, -swing_m)]
}

/// Plain network: the same method, in the plainest form.
struct Plain {
    mesh: Mesh,
    velocities_m_per_s: Vec<DVec3>,
    centres_m: [DVec3; 2],
}

impl Plain {
    fn new() -> Self {
        let mesh = Mesh::sheet(&SHEET);
        let velocities_m_per_s = vec![DVec3::ZERO; mesh.positions_m.len()];
        Self { mesh, velocities_m_per_s, centres_m: [DVec3::Z * RADIUS_M; 2] }
    }

    /// Returns 0.8 of the stability limit of two balls on one mass, from Gershgorin's bound.
    fn longest_step_s(&self) -> f64 {
        let mut sums = vec![CONTACT_N_PER_M; self.mesh.positions_m.len()];
        for link in &self.mesh.links {
            link.ends.iter().for_each(|end| sums[*end] += 2.0 * link.stiffness_n_per_m);
        }
        let highest = sums.iter().zip(&self.mesh.masses_kg).filter(|(_, mass_kg)| **mass_kg > 0.0);
        let highest = highest.map(|(sum, mass_kg)| sum / mass_kg).fold(0.0, f64::max);
        0.8 * 2.0 / highest.sqrt() / 2.0_f64.sqrt()
    }

    /// Advances by a time while the balls move to their places; the forces on them in the last step.
    fn advance(&mut self, to_m: [DVec3; 2], time_s: f64) -> [DVec3; 2] {
        let steps = (time_s / self.longest_step_s()).ceil().max(1.0);
        let step_s = time_s / steps;
        let from_m = self.centres_m;
        let mut on_balls_n = [DVec3::ZERO; 2];
        for step in (1..).map(f64::from).take_while(|step: &f64| *step <= steps) {
            self.centres_m = [0, 1].map(|hand| from_m[hand].lerp(to_m[hand], step / steps));
            on_balls_n = self.step(step_s);
        }
        self.centres_m = to_m;
        on_balls_n
    }

    fn step(&mut self, step_s: f64) -> [DVec3; 2] {
        let mut forces_n = vec![DVec3::ZERO; self.mesh.positions_m.len()];
        for link in &self.mesh.links {
            let [a, b] = link.ends;
            let way_m = self.mesh.positions_m[b] - self.mesh.positions_m[a];
            let pull_n = way_m * (link.stiffness_n_per_m * (1.0 - link.rest_m / way_m.length()));
            forces_n[a] += pull_n;
            forces_n[b] -= pull_n;
        }
        let mut on_balls_n = [DVec3::ZERO; 2];
        for (centre_m, on_ball_n) in self.centres_m.iter().zip(&mut on_balls_n) {
            for (position_m, force_n) in self.mesh.positions_m.iter().zip(&mut forces_n) {
                let out_m = *position_m - *centre_m;
                let depth_m = RADIUS_M - out_m.length();
                if depth_m > 0.0 {
                    *force_n += out_m.normalize() * (CONTACT_N_PER_M * depth_m);
                    *on_ball_n -= out_m.normalize() * (CONTACT_N_PER_M * depth_m);
                }
            }
        }
        for (node, mass_kg) in self.mesh.masses_kg.iter().enumerate().filter(|(_, mass_kg)| **mass_kg > 0.0) {
            let velocity = &mut self.velocities_m_per_s[node];
            *velocity = (*velocity + forces_n[node] * (step_s / mass_kg)) / (1.0 + step_s * DAMPING_PER_S);
            self.mesh.positions_m[node] += *velocity * step_s;
        }
        on_balls_n
    }
}

fn membrane() -> Membrane {
    Membrane::create(&Settings::defaults(Membrane::PARAMETERS)).expect("the defaults are legal")
}

#[test]
fn two_hands_feel_what_a_plain_simulation_says_and_one_feels_the_other() {
    let (mut shared, mut alone, mut plain) = (membrane(), membrane(), Plain::new());
    let (mut farthest, mut largest_n) = (0.0_f64, 0.0_f64);
    for tick in 0..300 {
        let [left, right] = hands(tick);
        let inputs = [input(tick, left), input(tick, right)];
        let mut outputs = [Output::default(); 2];
        shared.step_ports(&inputs, &mut outputs);
        let time_s = if tick == 0 { 0.0 } else { PERIOD_S };
        let expected_n = plain.advance([left, right].map(|hand| hand + DVec3::Z * RADIUS_M), time_s);
        for (output, expected_n) in outputs.iter().zip(expected_n) {
            largest_n = largest_n.max(expected_n.length());
            let wrong_n = (output.wrench.force() - expected_n).length();
            // Relative to the force in contact; without contact both are zero.
            assert!(wrong_n <= 1.0e-9 * expected_n.length().max(1.0e-3), "tick {tick}: {wrong_n} N");
        }
        let on_left_n = alone.step(&inputs[0]).wrench.force();
        farthest = farthest.max((outputs[0].wrench.force() - on_left_n).length());
    }
    assert!(largest_n > 0.2, "both hands press: {largest_n} N");
    assert!(farthest > 0.02, "the left hand feels the right one: {farthest} N");
}

#[test]
fn a_port_whose_pose_is_lost_leaves_its_ball_and_feels_nothing() {
    let (mut lost, mut still) = (membrane(), membrane());
    let mut outputs = [[Output::default(); 2]; 2];
    for tick in 0..100 {
        let [left, _] = hands(tick);
        let held = DVec3::new(0.008, 0.001, -0.001);
        let right = if tick < 50 { held } else { DVec3::NAN };
        lost.step_ports(&[input(tick, left), input(tick, right)], &mut outputs[0]);
        still.step_ports(&[input(tick, left), input(tick, held)], &mut outputs[1]);
        assert_eq!(
            outputs[0][0].wrench, outputs[1][0].wrench,
            "the left hand feels the ball that stays, tick {tick}"
        );
    }
    assert_eq!(outputs[0][1].wrench.force(), DVec3::ZERO);
    assert!(outputs[1][1].wrench.force().z > 0.0);
}

#[test]
fn the_planes_under_two_hands_push_as_a_plain_simulation_at_the_rate_of_the_model() {
    const EVERY: u64 = 5;
    let (mut shared, mut alone, mut plain) = (membrane(), membrane(), Plain::new());
    let at_anchor_n = |set: &ContactSet| {
        let contacts = set.contacts().iter();
        contacts
            .map(|contact| {
                DVec3::from_array(contact.normal) * (contact.stiffness_n_per_m * (-contact.gap_m).max(0.0))
            })
            .sum::<DVec3>()
    };
    let (mut farthest, mut largest_n) = (0.0_f64, 0.0_f64);
    for tick in (0..600).step_by(5) {
        let dt_ns = if tick == 0 { 0 } else { EVERY * 1_000_000 };
        let inputs = hands(tick).map(|hand| Input { dt_ns, ..input(tick, hand) });
        let (mut sets, mut one) = ([ContactSet::NONE; 2], [ContactSet::NONE]);
        shared.contact_sets(&inputs, &mut sets);
        alone.contact_sets(&inputs[..1], &mut one);
        let expected_n =
            plain.advance(hands(tick).map(|hand| hand + DVec3::Z * RADIUS_M), dt_ns as f64 * 1.0e-9);
        for (set, expected_n) in sets.iter().zip(expected_n) {
            largest_n = largest_n.max(expected_n.length());
            let wrong_n = (at_anchor_n(set) - expected_n).length();
            // Relative to the force in contact; without contact both are zero.
            assert!(wrong_n <= 1.0e-9 * expected_n.length().max(1.0e-3), "tick {tick}: {wrong_n} N");
        }
        farthest = farthest.max((at_anchor_n(&sets[0]) - at_anchor_n(&one[0])).length());
    }
    assert!(largest_n > 0.2, "both hands press: {largest_n} N");
    assert!(farthest > 0.02, "the left hand feels the right one: {farthest} N");
}

#[test]
fn one_port_has_the_contacts_of_a_model_on_one_device() {
    let (mut shared, mut alone) = (membrane(), membrane());
    for tick in 0..200 {
        let input = input(tick, hands(tick)[1]);
        let mut set = [ContactSet::NONE];
        shared.contact_sets(&[input], &mut set);
        assert_eq!(set[0], alone.contact_set(&input), "tick {tick}");
    }
}
