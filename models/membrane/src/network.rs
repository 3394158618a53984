//! State of a network, and its time step.
//!
//! Positions, velocities and forces are one array per coordinate. The step is the symplectic Euler method with implicit
//! damping,
//!
//! ```text
//! v <- (v + h a) / (1 + h c),    x <- x + h v
//! ```
//!
//! stable for `h < 2 / omega`, with the highest frequency bounded by Gershgorin: `omega^2 <= 2 sum(k) / m` over the
//! springs at a mass. [`Network::longest_step_s`] is 0.8 of that limit.

use crate::ball::Ball;
use crate::links::Links;
use crate::mesh::Mesh;
use crate::regions::Regions;
use crate::vectors::Vectors;
use flotor_hal::{DVec3, restorable};

/// Gravity, drag and contact stiffness: forces on every mass from outside the network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Gravity downwards, m/s².
    pub gravity_m_per_s2: f64,
    /// Rate of velocity decay by drag, 1/s.
    pub damping_per_s: f64,
    /// Stiffness of the contact between ball and mass, N/m.
    pub contact_n_per_m: f64,
}

/// Positions, velocities and activity of the masses: the state that a step changes.
#[derive(Debug)]
pub struct State {
    positions_m: Vectors,
    velocities_m_per_s: Vectors,
    regions: Regions,
}

restorable!(State { positions_m, velocities_m_per_s, regions });

impl State {
    /// Returns the positions of the masses, m.
    #[must_use]
    pub fn positions_m(&self) -> &Vectors {
        &self.positions_m
    }
}

impl Clone for State {
    fn clone(&self) -> Self {
        Self {
            positions_m: self.positions_m.clone(),
            velocities_m_per_s: self.velocities_m_per_s.clone(),
            regions: self.regions.clone(),
        }
    }

    /// Copies without allocation between two states of one network.
    fn clone_from(&mut self, other: &Self) {
        self.positions_m.clone_from(&other.positions_m);
        self.velocities_m_per_s.clone_from(&other.velocities_m_per_s);
        self.regions.clone_from(&other.regions);
    }
}

/// Masses and springs in motion.
#[derive(Debug)]
pub struct Network {
    state: State,
    forces_n: Vectors,
    /// Inverse of each mass, 1/kg; 0 for a fixed mass.
    inverse_masses_per_kg: Vec<f64>,
    /// Gravitational acceleration of each mass along z, m/s²; 0 for a fixed mass.
    weights_m_per_s2: Vec<f64>,
    links: Links,
    surroundings: Surroundings,
    longest_step_s: f64,
}

restorable!(Network { state } without {
    forces_n, inverse_masses_per_kg, weights_m_per_s2, links, surroundings, longest_step_s
});

/// Fraction of the stability limit in use: contact and stretching shift the limit a little.
const SHARE_OF_LIMIT: f64 = 0.8;

impl Network {
    /// Creates a network at rest in the mesh's positions. Not real-time.
    #[must_use]
    pub fn new(mesh: &Mesh, surroundings: Surroundings) -> Self {
        let nodes = mesh.positions_m.len();
        let links = Links::new(&mesh.links);
        let regions = Regions::new(nodes, links.joined_blocks());
        let inverse = |mass_kg: &f64| if *mass_kg > 0.0 { 1.0 / mass_kg } else { 0.0 };
        let inverse_masses_per_kg: Vec<f64> = mesh.masses_kg.iter().map(inverse).collect();
        let weight = |inverse: &f64| if *inverse > 0.0 { -surroundings.gravity_m_per_s2 } else { 0.0 };

        let mut stiffness_n_per_m = vec![surroundings.contact_n_per_m; nodes];
        for link in &mesh.links {
            link.ends.iter().for_each(|end| stiffness_n_per_m[*end] += 2.0 * link.stiffness_n_per_m);
        }
        let squares = stiffness_n_per_m.iter().zip(&inverse_masses_per_kg).map(|(k, inverse)| k * inverse);
        let highest_per_s = squares.fold(0.0, f64::max).sqrt();
        Self {
            state: State {
                positions_m: Vectors::from_points(&mesh.positions_m),
                velocities_m_per_s: Vectors::zero(nodes),
                regions,
            },
            forces_n: Vectors::zero(nodes),
            weights_m_per_s2: inverse_masses_per_kg.iter().map(weight).collect(),
            inverse_masses_per_kg,
            links,
            surroundings,
            longest_step_s: SHARE_OF_LIMIT * 2.0 / highest_per_s,
        }
    }

    /// Returns the longest permitted step, s: 0.8 of the stability limit.
    #[must_use]
    pub fn longest_step_s(&self) -> f64 {
        self.longest_step_s
    }

    /// Returns the positions of the masses, m.
    #[must_use]
    pub fn positions_m(&self) -> &Vectors {
        &self.state.positions_m
    }

    /// Returns the state, for a later [`Self::restore`].
    #[must_use]
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Restores a state of this network. Real-time: bounded, no allocation.
    pub fn restore(&mut self, state: &State) {
        self.state.clone_from(state);
    }

    /// Returns the number of active masses. Real-time: bounded, no allocation.
    #[must_use]
    pub fn active_nodes(&self) -> usize {
        self.state.regions.active().map(|range| range.len()).sum()
    }

    /// Activates all masses, as at the start. Real-time: bounded, no allocation.
    pub fn activate(&mut self) {
        self.state.regions.activate_all();
    }

    /// Advances the network by a step of `step_s`, at most [`Self::longest_step_s`]; returns the force on the ball, N, zero
    /// without a ball. Real-time: bounded, no allocation.
    pub fn step(&mut self, step_s: f64, ball: Option<&Ball>) -> DVec3 {
        let mut on_ball_n = [DVec3::ZERO];
        self.step_among(step_s, ball.map_or(&[], std::slice::from_ref), &mut on_ball_n);
        let [on_ball_n] = on_ball_n;
        on_ball_n
    }

    /// Advances the network by a step of `step_s` among several balls, and writes the force on each, N. At most
    /// [`Self::longest_step_s`] over the root of their number: all of them may push one mass. Real-time: bounded, no allocation.
    pub fn step_among(&mut self, step_s: f64, balls: &[Ball], on_balls_n: &mut [DVec3]) {
        let Self { state: State { positions_m, velocities_m_per_s, regions }, forces_n, .. } = self;
        balls.iter().for_each(|ball| regions.activate_near(ball));
        for range in regions.active() {
            forces_n.clear(range);
        }
        self.links.add_forces(positions_m, forces_n, regions);
        for (ball, on_ball_n) in balls.iter().zip(on_balls_n) {
            *on_ball_n = DVec3::ZERO;
            for range in regions.active() {
                *on_ball_n += ball.push(self.surroundings.contact_n_per_m, positions_m, forces_n, range);
            }
        }
        let damped = 1.0 / (1.0 + step_s * self.surroundings.damping_per_s);
        for range in regions.active() {
            let inverse = &self.inverse_masses_per_kg[range.clone()];
            let weight = &self.weights_m_per_s2[range.clone()];
            let [vx, vy, vz] = velocities_m_per_s.slices_mut(range.clone());
            let [x, y, z] = positions_m.slices_mut(range.clone());
            let [fx, fy, fz] = forces_n.slices(range);
            move_masses(x, vx, fx, inverse, None, step_s, damped);
            move_masses(y, vy, fy, inverse, None, step_s, damped);
            move_masses(z, vz, fz, inverse, Some(weight), step_s, damped);
        }
        regions.settle(positions_m, velocities_m_per_s);
    }

    /// Steps without a ball until all masses are inactive, at most `most_steps` times; returns true if all masses are inactive.
    /// Not real-time.
    pub fn come_to_rest(&mut self, most_steps: usize) -> bool {
        (0..most_steps).any(|_| {
            self.step(self.longest_step_s, None);
            self.active_nodes() == 0
        })
    }

    /// Steps without drag until the masses rest against a ball, at most `most_steps` times. Resets all velocities at the start and
    /// after each peak of the kinetic energy (kinetic damping, Cundall 1976). Returns true if the masses rest. Not real-time.
    pub fn relax(&mut self, ball: &Ball, most_steps: usize) -> bool {
        /// Largest movement in a step, in radii of the ball, that counts as rest (root sum of squares of all masses): a
        /// sheet is then within some micrometres of its final position, a tenth of a pixel.
        const STILL: f64 = 1.0e-4;
        // Without drag, intermittent contacts excite modes of three or four steps per period, but none of eight or more.
        let step_s = 0.5 * self.longest_step_s;
        let drag_per_s = std::mem::take(&mut self.surroundings.damping_per_s);
        let nodes = self.inverse_masses_per_kg.len();
        self.state.velocities_m_per_s.clear(0..nodes);
        let (mut rising, mut rests) = (0.0, false);
        for _ in 0..most_steps {
            self.step(step_s, Some(ball));
            let squares = self.state.velocities_m_per_s.sum_of_squares();
            if squares > rising {
                rising = squares;
                continue;
            }
            rests = rising.sqrt() * step_s <= STILL * ball.radius_m;
            if rests {
                break;
            }
            self.state.velocities_m_per_s.clear(0..nodes);
            rising = 0.0;
        }
        self.surroundings.damping_per_s = drag_per_s;
        rests
    }

    /// Sets the rate of velocity decay by drag, 1/s. Real-time: bounded, no allocation.
    pub fn set_damping_per_s(&mut self, damping_per_s: f64) {
        self.surroundings.damping_per_s = damping_per_s;
    }
}

/// Advances one coordinate of a block by one step.
#[inline]
fn move_masses(
    x: &mut [f64],
    v: &mut [f64],
    f: &[f64],
    inverse: &[f64],
    weight: Option<&[f64]>,
    step_s: f64,
    damped: f64,
) {
    let count = x.len();
    let (v, f, inverse) = (&mut v[..count], &f[..count], &inverse[..count]);
    match weight {
        None => {
            for i in 0..count {
                v[i] = (v[i] + step_s * (f[i] * inverse[i])) * damped;
                x[i] += step_s * v[i];
            }
        }
        Some(weight) => {
            let weight = &weight[..count];
            for i in 0..count {
                v[i] = (v[i] + step_s * (f[i] * inverse[i] + weight[i])) * damped;
                x[i] += step_s * v[i];
            }
        }
    }
}
