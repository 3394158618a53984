//! Programs that answer, hang, end and lie, with the solver of the loop at 1 kHz beside them.

use flotor_contact::{Coupling, Limits, PublishedContacts, Replacement, Solver, StableStiffness};
use flotor_hal::{ContactSet, DQuat, DVec3, Input, LoopConfig, Pose, Twist};
use flotor_loader::{Plugin, Setting};
use flotor_simulator::FLOTOR_ENTRY;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Period of the loop and of the simulator, ns.
const LOOP_NS: u64 = 1_000_000;
const MODEL_NS: u64 = 4_000_000;
/// Validity of a set of the double, and time for a force to fade, ns.
const VALID_NS: u64 = 50_000_000;
const FADE_NS: u64 = 20_000_000;
/// Limit of the force, N.
const LIMIT_N: f64 = 5.0;

/// Returns true on a system without simulators, and says so.
fn is_elsewhere() -> bool {
    let is_elsewhere = std::env::consts::FAMILY != "unix";
    if is_elsewhere {
        println!("skipped: simulators need a Unix");
    }
    is_elsewhere
}

fn built(name: &str) -> PathBuf {
    let own = std::env::current_exe().expect("a running test has a file");
    own.parent().and_then(Path::parent).expect("it is in `deps`").join("examples").join(name)
}

/// Program of the test `name` that is the double with these arguments.
fn double(name: &str, arguments: &str) -> PathBuf {
    let program = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.sh"));
    let text = format!("#!/bin/sh\nexec '{}' {arguments}\n", built("double").display());
    std::fs::write(&program, text).expect("there is room");
    let made = Command::new("chmod").arg("+x").arg(&program).status();
    assert!(made.is_ok_and(|status| status.success()), "it is ours");
    program
}

/// Loop of a millisecond with a simulator beside it, whose answers come a period late, in lockstep.
struct Beside {
    model: flotor_loader::Model,
    contacts: PublishedContacts,
    held: Option<(u64, ContactSet)>,
    time_ns: u64,
    pose: Pose,
    /// Messages about sets that the loop refused.
    refused: Vec<String>,
    /// Last message of the model after it has ended.
    end: Option<String>,
}

impl Beside {
    fn new(program: &Path) -> Self {
        let plugin = Plugin::in_process(&FLOTOR_ENTRY).expect("linked in");
        let program = program.display().to_string();
        let settings = [("program", program.as_str()), ("pace", "lockstep"), ("patience_ms", "200")];
        let settings = settings.map(|(key, value)| {
            Setting::parse(plugin.parameters(), key, value).expect("the plugin has this parameter")
        });
        let mut model = plugin.create_model(&settings).expect("the settings are right");
        model.prepare(&LoopConfig { period_ns: MODEL_NS, seed: 1 }).expect("any rate");
        let coupling = Coupling::new(10_000.0, 5.0).expect("above 0");
        let limits = Limits::new(LIMIT_N, 1.0).expect("above 0");
        let replacement = Replacement::Conserving { surface_power_w: 1.0 };
        let solver = Solver::new(coupling, limits, replacement, 1.0e-3).expect("above 0");
        let contacts = PublishedContacts::new(solver, StableStiffness::UNLIMITED, 0.012);
        Self { model, contacts, held: None, time_ns: 0, pose: Pose::HOME, refused: Vec::new(), end: None }
    }

    /// Moves the handle, and returns the force on the hand, N.
    fn tick(&mut self, position_m: DVec3) -> DVec3 {
        let pose = Pose::new(position_m, DQuat::IDENTITY);
        let velocity =
            if self.time_ns == 0 { DVec3::ZERO } else { (position_m - self.pose.position()) * 1.0e3 };
        let twist = Twist::new(velocity, DVec3::ZERO);
        let input = Input { time_ns: self.time_ns, dt_ns: LOOP_NS, twist, ..Input::at_rest(pose) };
        (self.pose, self.time_ns) = (pose, self.time_ns + LOOP_NS);
        if let Some((_, set)) = self.held.take_if(|(ready_ns, _)| input.time_ns >= *ready_ns)
            && let Err(error) = self.contacts.publish(&set)
        {
            self.refused.push(error.to_string());
        }
        if input.time_ns.is_multiple_of(MODEL_NS) && self.end.is_none() {
            let mut set = ContactSet::NONE;
            let status = self.model.contact_set(&Input { dt_ns: MODEL_NS, ..input }, &mut set);
            if status == flotor_hal::abi::CallStatus::Ok {
                set.time_ns = input.time_ns;
                self.held = Some((input.time_ns + MODEL_NS, set));
            } else {
                self.end = Some(self.model.last_message());
            }
        }
        self.contacts.touch(&input).map_or(DVec3::ZERO, |touch| touch.wrench.force())
    }

    /// Holds the handle for so many ticks, and returns the forces, N.
    fn hold(&mut self, ticks: u32, position_m: DVec3) -> Vec<DVec3> {
        (0..ticks).map(|_| self.tick(position_m)).collect()
    }

    /// Moves the handle from above into the floor, 3 mm deep, and swings there; returns time, ns, and force, N, of each tick.
    fn swing(&mut self, ticks: u32) -> Vec<(u64, DVec3)> {
        (0..ticks)
            .map(|tick| {
                let time_s = f64::from(tick) * 1.0e-3;
                let depth_m = 0.004 * (time_s / 0.5).min(1.0) + 0.001 * (6.0 * time_s).sin();
                (self.time_ns, self.tick(DVec3::Z * (0.001 - depth_m)))
            })
            .collect()
    }
}

#[test]
fn a_floor_of_a_program_is_felt_only_pushes_and_repeats_to_the_bit() {
    if is_elsewhere() {
        return;
    }
    let run = |arguments| Beside::new(&double("floor", arguments)).swing(2_000);
    let floor = run("floor");
    assert!(floor.iter().all(|(_, force_n)| force_n.z >= 0.0));
    assert!(floor.last().is_some_and(|(_, force_n)| (0.9..2.1).contains(&force_n.z)), "{floor:?}");
    assert_eq!(floor, run("floor"));
    assert_eq!(floor, run("flood"), "forty times as many sets change nothing");
}

#[test]
fn a_force_is_gone_when_the_last_set_has_aged_whatever_the_program_does() {
    if is_elsewhere() {
        return;
    }
    for (kind, words) in [
        ("hang", None),
        ("end", Some("has ended (exit status: 3)")),
        ("nan", Some("`gap_m` is not finite")),
        ("huge", Some("`stiffness_n_per_m` is not finite, or larger than 1e9")),
        ("back", Some("after one for pose")),
        ("ahead", Some("which was not sent")),
        ("short", Some("a message of 60 bytes")),
        ("slow", None),
    ] {
        let from = 300_u64;
        let mut beside = Beside::new(&double(kind, &format!("{kind} {from}")));
        // At full size a million ticks in all.
        let is_full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
        let ticks = beside.swing(if is_full { 125_000 } else { 4_000 });
        let last_set_ns = (from - 2) * MODEL_NS;
        let gone_ns = last_set_ns + VALID_NS + FADE_NS;
        let before =
            ticks.iter().filter(|(time_ns, _)| (last_set_ns - 50_000_000..last_set_ns).contains(time_ns));
        assert!(
            before.map(|(_, force_n)| force_n.z).fold(f64::INFINITY, f64::min) > 0.5,
            "{kind}: no force before"
        );
        let violations = ticks.iter().filter(|(time_ns, force_n)| {
            // One set in ten seconds is felt as long as it is valid, from the period after its pose on.
            let is_set_again = kind == "slow" && *time_ns % (2_500 * MODEL_NS) < VALID_NS + FADE_NS;
            let is_old = *time_ns > gone_ns && !is_set_again;
            force_n.length() > LIMIT_N + 1.0e-9 || (is_old && force_n.length() > 0.0)
        });
        assert_eq!(violations.count(), 0, "{kind}");
        let said = beside.end.as_ref().or_else(|| beside.refused.first());
        assert_eq!(said.is_some(), words.is_some(), "{kind}: {said:?}");
        assert!(words.is_none_or(|words| said.is_some_and(|said| said.contains(words))), "{kind}: {said:?}");
    }
}

#[test]
fn a_floor_that_jumps_over_the_hand_adds_no_energy() {
    if is_elsewhere() {
        return;
    }
    let mut beside = Beside::new(&double("above", "above 300"));
    let held = DVec3::Z * -0.003;
    let mut before_n = 0.0;
    let (mut energy_j, mut last_m) = (0.0, 0.0);
    for tick in 0..4_000_u32 {
        let way = (f64::from(tick) * 1.0e-3 / 0.5).min(1.0);
        let force_n = beside.tick(held * way).z;
        energy_j -= before_n * (held.z * way - last_m);
        (before_n, last_m) = (force_n, held.z * way);
        assert!((0.0..=2.0).contains(&force_n), "tick {tick}: {force_n} N");
    }
    assert!(energy_j > -1.0e-4, "{energy_j} J");
}

#[test]
fn a_pendulum_in_c_is_held_with_the_force_of_its_weight() {
    if is_elsewhere() {
        return;
    }
    let sources = Path::new(env!("CARGO_MANIFEST_DIR"));
    let program = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("pendulum");
    let mut cc = Command::new("cc");
    cc.args(["-O2", "-Wall", "-Wextra", "-Werror", "-I"]).arg(sources.join("include"));
    cc.arg(sources.join("examples/pendulum.c")).arg("-o").arg(&program).arg("-lm");
    let compiled = cc.status();
    if compiled.is_err() {
        println!("skipped: cc: there is no C compiler");
        return;
    }
    assert!(compiled.is_ok_and(|status| status.success()), "the example compiles without a warning");
    let mut beside = Beside::new(&program);
    // From beside its ball, 40 mm to the side, and there.
    for tick in 0..1_000_u32 {
        beside.tick(DVec3::X * (0.04 * f64::from(tick) * 1.0e-3));
    }
    let forces_n = beside.hold(2_000, DVec3::X * 0.04);
    let force_n = forces_n.last().expect("it ran").length();
    // Ball of 100 g on a rod of 0.2 m, both radii 30 mm: the ball touches the handle at its own height, pushed aside along x. The
    // angle follows from the gap, the force from the balance of torques about the pivot.
    let (mut low, mut high) = (0.0_f64, 0.5_f64);
    let along = |angle: f64| {
        let ball_m = DVec3::new(0.031 + 0.2 * angle.sin(), 0.0, 0.2 - 0.2 * angle.cos());
        let apart_m = DVec3::X * 0.04 - ball_m;
        let pushed_n = 400.0 * (0.03 - apart_m.length());
        let lever = -(angle.cos() * apart_m.x + angle.sin() * apart_m.z) / apart_m.length();
        (pushed_n, pushed_n * lever - 0.1 * 9.81 * angle.sin())
    };
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if along(middle).1 > 0.0 { low = middle } else { high = middle }
    }
    let (expected_n, _) = along(low);
    assert!(expected_n > 0.1 && (force_n / expected_n - 1.0).abs() < 0.01, "{force_n} N, not {expected_n} N");
    assert!(beside.refused.is_empty() && beside.end.is_none());
}
