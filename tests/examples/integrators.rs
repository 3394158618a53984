//! Work against error of the simulated flotor's integrator and of what else could have been used: table and picture.
//!
//! A flotor tumbles freely for two seconds, six turns a second; the attitude at the end is compared with that of the plant in steps
//! sixteen times finer. Columns: method, step (s), error (rad), time per simulated millisecond (ns). Times are of
//! this machine, errors are not.
//!
//! ```text
//! cargo run --release -p flotor-tests --features measurements --example integrators -- integrators.svg > integrators.csv
//! ```

use flotor_hal::glam::{DQuat, DVec3};
use flotor_plot::{Axis, Figure, Panel, Series};
use flotor_simulated::hand::Impedance;
use flotor_simulated::plant::{Drag, FeedForward, FlotorParameters, Plant, State, Wrench};
use std::time::Instant;

const FLOTOR: FlotorParameters = FlotorParameters {
    inertia_kg_m2: DVec3::new(3.2e-3, 3.9e-3, 5.1e-3),
    centre_of_mass_m: DVec3::ZERO,
    gravity_m_per_s2: 0.0,
    feed_forward: FeedForward::Weight,
    drag: Drag { translational_ns_per_m: 0.0, rotational_nms_per_rad: 0.0 },
    ..FlotorParameters::THESIS
};

/// Close to the unstable middle axis and six turns a second: harder than anything a hand does.
const SPIN_RAD_PER_S: DVec3 = DVec3::new(4.0, 39.5, 2.5);

/// Length of the run, ns.
const RUN_NS: u64 = 2_000_000_000;

/// Orientation and angular velocity in the body.
#[derive(Clone, Copy)]
struct Body {
    orientation: DQuat,
    spin: DVec3,
}

/// Final orientation of a run with steps of a length in ns, for a time in ns.
type Method = fn(u64, u64) -> DQuat;

/// Steps tried, ns.
const STEPS_NS: [u64; 4] = [1_000_000, 500_000, 250_000, 125_000];

/// Length of the runs that are timed, ns, and how many: short enough to fit between two other programs, and the
/// fastest counts, because neighbours only slow a run.
const TIMED_RUN_NS: u64 = 100_000_000;
const TIMED_RUNS: usize = 50;

/// In the order of the table.
const METHODS: [(&str, Method); 4] = [
    ("explicit Euler", |step_ns, run_ns| stepped(step_ns, run_ns, euler)),
    ("implicit midpoint (geometric)", |step_ns, run_ns| stepped(step_ns, run_ns, midpoint)),
    ("classical Runge-Kutta", |step_ns, run_ns| stepped(step_ns, run_ns, runge_kutta_4)),
    ("Butcher, order 6 (the plant)", with_plant),
];

/// Method with a step, and its error.
pub(crate) struct Error {
    method: usize,
    step_ns: u64,
    pub(crate) error_rad: f64,
}

impl Error {
    /// Returns the name of the method and the step, s.
    pub(crate) fn case(&self) -> (&'static str, f64) {
        (METHODS[self.method].0, self.step_ns as f64 * 1.0e-9)
    }

    /// Returns the line of the table without the time.
    pub(crate) fn line(&self) -> String {
        let (name, step_s) = self.case();
        format!("\"{name}\",{step_s},{:.1e}", self.error_rad)
    }
}

/// Computes the errors of all methods, method by method.
pub(crate) fn errors() -> Vec<Error> {
    let exact = with_plant(62_500, RUN_NS);
    let error = |method: usize, step_ns: u64| {
        let end = METHODS[method].1(step_ns, RUN_NS);
        Error { method, step_ns, error_rad: 2.0 * (end.conjugate() * exact).xyz().length() }
    };
    let of_method = |method| STEPS_NS.map(|step_ns| error(method, step_ns));
    (0..METHODS.len()).flat_map(of_method).collect()
}

fn main() -> std::io::Result<()> {
    println!("method,step_s,error_rad,ns_per_ms");
    let mut panel = Panel::new(Axis::log("Attitude error after 2 s", "rad"));
    for errors in errors().chunk_by(|one, next| one.method == next.method) {
        let (name, run) = METHODS[errors[0].method];
        let mut points = Vec::new();
        for error in errors {
            let ns_per_ms = time_ns_per_ms(run, error.step_ns);
            println!("{},{ns_per_ms:.0}", error.line());
            points.push((ns_per_ms, error.error_rad));
        }
        panel = panel.series(Series::line(name, points));
    }
    let figure =
        Figure::new("Integrators of a tumbling flotor", Axis::log("Time for a simulated millisecond", "ns"))
            .subtitle("steps of 1, 1/2, 1/4 and 1/8 ms; the plant keeps its energy balance meanwhile")
            .panel_height_px(320.0)
            .panel(panel);
    match std::env::args().nth(1) {
        Some(file) => std::fs::write(file, figure.to_svg()),
        None => Ok(()),
    }
}

/// Time of a method per simulated millisecond, ns.
fn time_ns_per_ms(run: Method, step_ns: u64) -> f64 {
    let once = || {
        let started = Instant::now();
        std::hint::black_box(run(step_ns, TIMED_RUN_NS));
        started.elapsed().as_nanos() as f64 * 1.0e6 / TIMED_RUN_NS as f64
    };
    (0..TIMED_RUNS).map(|_| once()).fold(f64::INFINITY, f64::min)
}

fn with_plant(step_ns: u64, run_ns: u64) -> DQuat {
    let start = State { angular_velocity_rad_per_s: SPIN_RAD_PER_S, ..State::HOME };
    let mut plant =
        Plant::new(&FLOTOR, &Impedance::RELAXED, &start, step_ns).expect("the parameters above are physical");
    for _ in 0..run_ns / step_ns {
        plant.advance(step_ns, &Wrench::ZERO, None);
    }
    plant.state().orientation
}

fn stepped(step_ns: u64, run_ns: u64, step: fn(Body, f64) -> Body) -> DQuat {
    let mut body = Body { orientation: DQuat::IDENTITY, spin: SPIN_RAD_PER_S };
    for _ in 0..run_ns / step_ns {
        body = step(body, step_ns as f64 * 1.0e-9);
    }
    body.orientation
}

/// Euler's equations and the kinematics of the quaternion.
fn rate(body: Body) -> Body {
    let momentum = FLOTOR.inertia_kg_m2 * body.spin;
    let half = body.spin * 0.5;
    Body {
        orientation: body.orientation * DQuat::from_xyzw(half.x, half.y, half.z, 0.0),
        spin: momentum.cross(body.spin) / FLOTOR.inertia_kg_m2,
    }
}

fn moved(body: Body, rate: Body, time_s: f64) -> Body {
    Body { orientation: body.orientation + rate.orientation * time_s, spin: body.spin + rate.spin * time_s }
}

fn normalized(body: Body) -> Body {
    Body { orientation: body.orientation.normalize(), ..body }
}

fn euler(body: Body, h: f64) -> Body {
    normalized(moved(body, rate(body), h))
}

fn runge_kutta_4(body: Body, h: f64) -> Body {
    let k1 = rate(body);
    let k2 = rate(moved(body, k1, 0.5 * h));
    let k3 = rate(moved(body, k2, 0.5 * h));
    let k4 = rate(moved(body, k3, h));
    let outer = moved(moved(body, k1, h / 6.0), k4, h / 6.0);
    normalized(moved(moved(outer, k2, h / 3.0), k3, h / 3.0))
}

/// Implicit midpoint rule for the momentum in the body, Cayley map for the attitude: keeps energy and momentum.
fn midpoint(body: Body, h: f64) -> Body {
    let momentum = FLOTOR.inertia_kg_m2 * body.spin;
    let mut next = momentum;
    for _ in 0..8 {
        let middle = 0.5 * (momentum + next);
        next = momentum + h * middle.cross(middle / FLOTOR.inertia_kg_m2);
    }
    let half = 0.25 * h * (momentum + next) / FLOTOR.inertia_kg_m2;
    let turn = DQuat::from_xyzw(half.x, half.y, half.z, 1.0);
    normalized(Body { orientation: body.orientation * turn, spin: next / FLOTOR.inertia_kg_m2 })
}
