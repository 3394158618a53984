//! What `tests/budgets.rs` counts: runs one workload, by name. What is counted happens within [`one_counted_part`],
//! so that what is made before it, which takes time that depends on the machine, is left out.

mod demand;
#[allow(dead_code)] // the spring's tests use the rest
#[path = "../../../models/spring/tests/sample/mod.rs"]
mod sample;

use flotor_core::trace::TickRecord;
use flotor_hal::glam::{DQuat, DVec3};
use flotor_hal::{Demand as Demanded, DeviceState, Input, Output, Tick};
use flotor_lab::bench::{BenchDevice, WholeTick};
use flotor_live::Directory;
use flotor_servo::{Clock, StopSwitch};
use flotor_session::registry::Registry;
use flotor_session::scene::Scene;
use flotor_session::{Observer, RunOptions, Session};
use flotor_simulated::machine::{Machine, MachineParameters};
use flotor_simulated::plant::{State, Wrench};
use flotor_simulated::simulation::{Setup, Simulation};
use flotor_spring::batch::Batch;
use flotor_spring::closed_form::{ClosedForm, Form};
use flotor_spring::energy::EnergyForm;
use flotor_spring::held::HeldSpring;
use flotor_spring::pose::Pose;
use flotor_spring::precision::Precision;
use flotor_spring::preset::Preset;
use flotor_spring::response::Demand;
use flotor_spring::rod::{Accuracy, Rod};
use flotor_spring::rod_blend::RodBlend;
use flotor_spring::thesis::Thesis;
use sample::{Sampler, Workspace};
use std::hint::black_box;
use std::path::Path;

/// Where the counter begins and ends.
#[inline(never)]
fn one_counted_part(work: &mut dyn FnMut()) {
    work();
    black_box(&work); // else the call would be a jump, and this function over before its work
}

fn main() {
    let name = std::env::args().nth(1).expect("the name of a workload");
    match name.as_str() {
        "tick-scripted" => whole_ticks(BenchDevice::Scripted),
        "tick-simulated" => whole_ticks(BenchDevice::Simulated),
        "scene-alone" => scenes(""),
        "scene-among-inactive" => scenes(INACTIVE),
        "scene-replacing" => scene(1000, &replacements(1000)),
        "demands" => demand::demands(one_counted_part),
        "laws" => laws(),
        "rod" => rod(),
        "flotor-plain" => twice(1000, 2000, ticks_of_the_flotor(None)),
        "flotor-full" => twice(1000, 2000, ticks_of_the_flotor(Some(MachineParameters::MAGLEV))),
        "rigid-body" => twice(1000, 2000, steps_of_a_rigid_body()),
        other => panic!("no workload {other}"),
    }
}

/// Two parts of so many repetitions: the first warms up.
fn twice(first: u32, second: u32, mut work: impl FnMut()) {
    for count in [first, second] {
        one_counted_part(&mut || (0..count).for_each(|_| work()));
    }
}

fn whole_ticks(device: BenchDevice) {
    let mut ticks = WholeTick::prepare(device, Registry::search(&[]), "spring").expect("the spring is built");
    for count in [1024, 3072] {
        one_counted_part(&mut || ticks.run(count));
    }
}

// -- scenes

const ALONE: &str = "[device]\nplugin = \"simulated\"\n[[model]]\nplugin = \"spring\"\n";
/// Balls of 1 mm, 3 mm apart, far from where the handle goes.
const INACTIVE: &str = "[[model]]\nplugin = \"wall\"\n[model.parameters]\nshape = \"sphere\"\nsize_mm = 1\n\
    [model.mapping]\nposition_mm = [0, 0, 100]\ngrid = { count = [20, 25, 20], spacing_mm = 3 }\n";

struct Nobody;

impl Observer for Nobody {
    fn observe(&mut self, _: &TickRecord) {}
}

/// A run for what is done once in a process, then a short and a long one, whose difference is ticks and nothing else.
fn scenes(beside: &str) {
    for ticks in [1024, 1024, 4096] {
        scene(ticks, beside);
    }
}

fn scene(ticks: u32, beside: &str) {
    let scene = format!("duration_s = {}\n{ALONE}{beside}", f64::from(ticks) * 1.0e-3);
    let mut session = Some(prepared(&scene));
    one_counted_part(&mut || {
        let run = session.take().map(|session| session.run(&mut Nobody, &StopSwitch::default()));
        assert!(run.is_some_and(|run| run.is_ok()));
    });
}

/// A scene on the virtual clock, with the plugins built beside this program.
fn prepared(scene: &str) -> Session {
    let scene = Scene::parse(Path::new("scene.toml"), scene).expect("the scene is right");
    let options = RunOptions { clock: Clock::Virtual, seed: 1 };
    let session = Session::prepare(&scene, &Registry::search(&[]), &options);
    // No folder: an emergency stop of another run is not looked for.
    session.expect("the plugins are built").latched_in(&Directory::at("/dev/null/no-folder"))
}

/// Another model every 100 ms, in turns, and a change of a parameter of the one between.
fn replacements(ticks: u32) -> String {
    let change = |number: u32| {
        let (plugin, set) =
            if number.is_multiple_of(2) { ("spring", "gamma_n=9") } else { ("wall", "friction=0.1") };
        let at_s = f64::from(number) * 0.1;
        let set_at_s = at_s + 0.06;
        format!(
            "[[change]]\nat_s = {at_s}\nswap = \"spring\"\nplugin = \"{plugin}\"\n\
             [[change]]\nat_s = {set_at_s}\nset = \"spring.{set}\"\n"
        )
    };
    let blend = "[model.blend]\nfade_s = 0.05\n";
    blend.to_owned() + &(1..ticks / 100).map(change).collect::<String>()
}

// -- the laws of the spring

/// The workspace of the thesis: a quarter of the free length, seven degrees.
const WORKSPACE: Workspace = Workspace { shear: 0.25, height: 0.3, tilt_rad: 0.12, yaw_rad: 0.12 };

/// Two parts of each law: printed, closed-form, energy; energy and energy that may blend where the rod has no share; and the
/// batches of closed-form and energy.
fn laws() {
    let spring = Preset::Thesis1.spring();
    let (_, _, stiffness) = Preset::Thesis1.parameters();
    let mut sampler = Sampler::new(3);
    let mut drawn = || WORKSPACE.pose(&mut sampler, spring.geometry().free_length_m);
    let poses: Vec<Pose> = (0..1024).map(|_| drawn()).collect();
    let printed = Thesis::new(&spring, stiffness, Precision::Double);
    let closed = ClosedForm::new(&spring, Form::Printed);
    let energy = EnergyForm::new(&spring);
    let mut blending = RodBlend::new(&spring);
    let mut has_no_rod = |pose: &Pose| {
        let _ = blending.respond(pose, Demand::Wrench);
        blending.share() == 0.0
    };
    let without_rod: Vec<Pose> =
        std::iter::repeat_with(drawn).filter(|pose| has_no_rod(pose)).take(1024).collect();
    law(&poses, |pose| printed.respond(pose, Demand::Wrench));
    law(&poses, |pose| closed.respond(pose, Demand::Wrench));
    law(&poses, |pose| energy.respond(pose, Demand::Wrench));
    law(&without_rod, |pose| energy.respond(pose, Demand::Wrench));
    law(&without_rod, |pose| blending.respond(pose, Demand::Wrench));

    let input = |pose: &Pose| Input {
        demand: Demanded::WRENCH,
        ..Input::at_rest(flotor_hal::Pose::new(pose.position_m, pose.orientation))
    };
    let inputs: Vec<Input> = poses.iter().map(input).collect();
    let mut answers = vec![Output::default(); inputs.len()];
    let batch = Batch::default();
    twice(1, 1, || batch.respond(&closed, black_box(&inputs), black_box(&mut answers)));
    twice(1, 1, || batch.respond(&energy, black_box(&inputs), black_box(&mut answers)));
}

fn law<R>(poses: &[Pose], mut respond: impl FnMut(&Pose) -> R) {
    twice(1, 1, || black_box(poses).iter().for_each(|pose| _ = black_box(respond(pose))));
}

/// A part for each tick of a hand that moves smoothly, one to three times a second.
fn rod() {
    let mut rod = Rod::new(&Preset::Thesis1.spring(), Accuracy::Servo);
    for tick in 0..200 {
        let _ = rod.step(&smooth(tick.min(1)), Demand::Wrench);
    }
    for tick in 1..=400 {
        let pose = smooth(tick);
        one_counted_part(&mut || _ = black_box(rod.step(&pose, Demand::Wrench)));
    }
}

fn smooth(tick: u32) -> Pose {
    let phase = std::f64::consts::TAU * 1e-3 * f64::from(tick);
    let position =
        DVec3::new(0.1 * (2.0 * phase).sin(), 0.1 * (3.0 * phase + 1.0).sin(), -0.2 + 0.15 * phase.cos());
    let rotation_rad =
        DVec3::new(0.1 * (1.5 * phase).sin(), 0.1 * (2.5 * phase + 0.4).cos(), 0.1 * phase.sin());
    Pose::from_rotation_vector(position * Preset::Thesis1.spring().geometry().free_length_m, rotation_rad)
}

// -- the simulated flotor

/// A spring of 1 N/mm: 1 ms of flotor and hand, with or without the machine around them.
fn ticks_of_the_flotor(machine: Option<MachineParameters>) -> impl FnMut() {
    let mut simulation = Simulation::new(&Setup::DEMO).expect("the demo is physical");
    let mut machine = machine.map(|parameters| Machine::new(&parameters, &State::HOME, 1).expect("physical"));
    let mut state = DeviceState::HOME;
    let mut index = 0;
    move || {
        let tick = Tick { index, time_ns: index * 1_000_000, dt_ns: 1_000_000 };
        index += 1;
        let wrench = Wrench { force_n: simulation.state().position_m * -1000.0, torque_nm: DVec3::ZERO };
        match &mut machine {
            Some(machine) => {
                let _ = black_box(machine.cycle(&mut simulation, &tick, &wrench, &mut state));
            }
            None => {
                black_box(simulation.advance(tick.dt_ns, wrench));
            }
        }
    }
}

/// The yardstick: a rigid body that tumbles, one step of the classical Runge-Kutta method at a time.
fn steps_of_a_rigid_body() -> impl FnMut() {
    let inertia = black_box(DVec3::new(3.2e-3, 3.9e-3, 5.1e-3));
    let rate = move |(attitude, spin): (DQuat, DVec3)| {
        let half = spin * 0.5;
        let turning = attitude * DQuat::from_xyzw(half.x, half.y, half.z, 0.0);
        (turning, (inertia * spin).cross(spin) / inertia)
    };
    let moved = |(q, w): (DQuat, DVec3), (dq, dw): (DQuat, DVec3), h: f64| (q + dq * h, w + dw * h);
    let mut body = (DQuat::IDENTITY, DVec3::new(0.8, 7.9, 0.5));
    let h = 1.0e-3;
    move || {
        let k1 = rate(body);
        let k2 = rate(moved(body, k1, 0.5 * h));
        let k3 = rate(moved(body, k2, 0.5 * h));
        let k4 = rate(moved(body, k3, h));
        let outer = moved(moved(body, k1, h / 6.0), k4, h / 6.0);
        let (attitude, spin) = moved(moved(outer, k2, h / 3.0), k3, h / 3.0);
        body = black_box((attitude.normalize(), spin));
    }
}
