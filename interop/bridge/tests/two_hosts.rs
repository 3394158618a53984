//! Two `flotor run` processes, each with a hand, held together over Zenoh through a long, bad way.
//!
//! Needs the program: `FLOTOR=target/release/flotor`, as `.ci/full` sets it; says so and does nothing without.

mod common;
#[path = "common/proxy.rs"]
mod proxy;

use common::process::Owned;
use common::{free_port, is_full_size, program, wait_until};
use flotor_bridge::couple::couple;
use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, Link, LinkOptions, open};
use flotor_bridge::request::Right;
use flotor_bridge::serve::{Service, serve};
use flotor_core::peer::{DISPATCH_WORDS, Dispatch};
use flotor_core::trace::{Events, TickRecord};
use flotor_live::Directory;
use flotor_record::Recording;
use flotor_sync::Words;
use proxy::Proxy;
use rustix::process::Signal;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use zenoh::Wait;

/// Every hand preset of the simulated flotor, and how it may be held.
const HANDS: [&str; 5] = ["oscillate", "press", "release", "hold", "open"];
const GRIPS: [&str; 2] = ["firm", "relaxed"];
/// Time without a message after which an end removes the force, ms: long enough that a loaded machine is not taken for a cut cable.
const WATCHDOG_MS: f64 = 300.0;

fn scene(hand: &str, grip: &str, watchdog_ms: f64) -> String {
    format!(
        "[device]\nplugin = \"simulated\"\n[device.parameters]\nhand = \"{hand}\"\nhand_grip = \"{grip}\"\n\
         [[coupling]]\nname = \"pair\"\npartner = \"elsewhere\"\nend = [{{ device = \"device\" }}]\n\
         [limits]\nwatchdog_ms = {watchdog_ms}\n"
    )
}

fn lab() -> Name {
    Name::new("lab").unwrap()
}

fn at(port: u16) -> Vec<String> {
    vec![format!("tcp/127.0.0.1:{port}")]
}

fn visit(port: u16) -> Link {
    open(&LinkOptions { connect: at(port), ..LinkOptions::default() }, End::Visiting).unwrap()
}

/// A host: a folder in which its run is found, and the run.
struct Host {
    folder: tempfile::TempDir,
}

impl Host {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("runtime")).unwrap();
        Self { folder }
    }

    fn directory(&self) -> Directory {
        Directory::at(self.folder.path().join("runtime/flotor"))
    }

    fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn run(&self, program: &Path, scene: &str, duration_s: f64) -> Owned {
        std::fs::write(self.file("scene.toml"), scene).unwrap();
        let mut command = Command::new(program);
        command.arg("run").arg(self.file("scene.toml")).arg("--duration").arg(format!("{duration_s}s"));
        command.arg("--record").arg(self.file("run.mcap")).arg("--json").arg(self.file("run.json"));
        command.env("XDG_RUNTIME_DIR", self.folder.path().join("runtime"));
        command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        Owned::start(&mut command)
    }

    /// Its bridge, at this port until told to stop.
    fn serve(&self, port: u16, stop: &Arc<AtomicBool>) -> JoinHandle<()> {
        let serving = LinkOptions { listen: at(port), ..LinkOptions::default() };
        let serving = open(&serving, End::Serving).unwrap();
        let service = Service { name: lab(), allow: Right::Operate, every: 1, launcher: None };
        let (directory, until) = (self.directory(), Arc::clone(stop));
        std::thread::spawn(move || serve(&serving, &directory, service, &until, &mut |_| {}).unwrap())
    }

    fn summary(&self) -> Value {
        serde_json::from_slice(&std::fs::read(self.file("run.json")).unwrap()).unwrap()
    }

    fn records(&self) -> Vec<TickRecord> {
        Recording::open(&self.file("run.mcap")).unwrap().map(|record| record.unwrap()).collect()
    }
}

/// Both hosts, the bridge of the one, who couples the other with it, and the way between them.
struct Network {
    hosts: [Host; 2],
    proxy: Proxy,
    stop: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
}

impl Network {
    fn start() -> Self {
        let hosts = [Host::new(), Host::new()];
        let (stop, port) = (Arc::<AtomicBool>::default(), free_port());
        let proxy = Proxy::to(port);
        let served = hosts[0].serve(port, &stop);
        let visiting = visit(proxy.port);
        let (directory, until) = (hosts[1].directory(), Arc::clone(&stop));
        let coupled = std::thread::spawn(move || {
            couple(&visiting, &directory, &lab(), &until, &mut |_| {}).unwrap();
        });
        Self { hosts, proxy, stop, threads: vec![served, coupled] }
    }

    /// Runs both hosts; `meanwhile` may do something to them or to the way.
    fn run(
        &self,
        program: &Path,
        scenes: [String; 2],
        duration_s: f64,
        meanwhile: impl FnOnce(&[Owned], &Proxy),
    ) {
        let mut runs: Vec<Owned> = (self.hosts.iter().zip(&scenes))
            .map(|(host, scene)| host.run(program, scene, duration_s))
            .collect();
        wait_until("both hosts run", || {
            self.hosts.iter().all(|host| !host.directory().couplings().is_empty())
        });
        meanwhile(&runs, &self.proxy);
        for run in &mut runs {
            assert!(run.wait().unwrap().success(), "a run that ends in order");
        }
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

/// What came out at a host's port while it missed ticks and was not paid back yet, J, the most that ever was: its machine kept it
/// from running, and the last force went on acting. No controller can have known.
fn out_while_missing_j(records: &[TickRecord]) -> f64 {
    let (mut unpaid_j, mut most_j) = (0.0_f64, 0.0_f64);
    for pair in records.windows(2) {
        let gone_in_j = pair[1].port_energy_j - pair[0].port_energy_j;
        let was_missing = pair[1].events.intersects(Events::MISSED);
        unpaid_j = if was_missing { unpaid_j - gone_in_j } else { unpaid_j - gone_in_j.max(0.0) }.max(0.0);
        most_j = most_j.max(unpaid_j);
    }
    most_j
}

/// the tanks of this end and of the other one, as it told, are below zero by no more than what came out while ticks were missed.
fn assert_below_zero_by_no_more(coupling: &Value, missing_j: [f64; 2]) {
    for (end, missing_j) in missing_j.into_iter().enumerate() {
        assert!(number(&coupling["lowest_j"][end]) >= -missing_j - 1.0e-12, "end {end}: {coupling}");
    }
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("no number: {value}"))
}

#[test]
fn a_pair_over_zenoh_and_a_bad_way_is_stable_and_no_tank_is_below_zero() {
    let Some(program) = program() else { return };
    let hands: Vec<(&str, &str)> = HANDS.iter().flat_map(|hand| GRIPS.map(|grip| (*hand, grip))).collect();
    let hands = if is_full_size() { hands } else { vec![("press", "firm"), ("oscillate", "relaxed")] };
    for (hand, grip) in hands {
        let network = Network::start();
        let scenes = [scene(hand, grip, WATCHDOG_MS), scene("hold", "relaxed", WATCHDOG_MS)];
        network.run(&program, scenes, 4.0, |_, _| {});
        let mut gone_in_j = 0.0;
        let records: Vec<Vec<TickRecord>> = network.hosts.iter().map(Host::records).collect();
        let missing_j: Vec<f64> = records.iter().map(|records| out_while_missing_j(records)).collect();
        for (index, (host, records)) in network.hosts.iter().zip(&records).enumerate() {
            let summary = host.summary();
            let coupling = &summary["couplings"][0];
            let link = &coupling["link"];
            println!("{hand}, {grip}: {coupling}, out while missing ticks {missing_j:?} J");
            assert_eq!(summary["end"], "finished");
            assert_below_zero_by_no_more(coupling, [missing_j[index], missing_j[1 - index]]);
            assert!(number(&link["heard_ticks"]) > 100.0, "{link}");
            assert!(number(&link["longest_wait_ms"]) < WATCHDOG_MS, "{link}");
            assert_eq!(link["carried"]["refused"], 0);
            gone_in_j += number(&coupling["gone_in_j"][0]);
            let fastest = records.iter().map(|record| record.twist.linear().length()).fold(0.0, f64::max);
            // A hand swings with up to 0.1 m/s or so; what drives itself gets to the boundary and past it.
            assert!(fastest < 0.5, "{fastest} m/s");
        }
        assert!(network.proxy.lost() > 0, "a way that loses nothing proves nothing");
        let missing_j: f64 = missing_j.iter().sum();
        assert!(gone_in_j >= -missing_j - 1.0e-12, "more came out at both ends than went in: {gone_in_j} J");
    }
}

#[test]
fn a_cut_cable_leaves_both_devices_without_force_within_the_watchdog() {
    let Some(program) = program() else { return };
    let network = Network::start();
    let scenes = [scene("press", "firm", WATCHDOG_MS), scene("oscillate", "firm", WATCHDOG_MS)];
    network.run(&program, scenes, 5.0, |_, proxy| {
        std::thread::sleep(Duration::from_millis(3000));
        proxy.cut();
    });
    for host in &network.hosts {
        let (summary, records) = (host.summary(), host.records());
        let link = &summary["couplings"][0]["link"];
        let last_felt =
            records.iter().rposition(|record| record.commanded.force().length() > 0.0).expect("a pull");
        let silent = |record: &TickRecord| record.events.intersects(Events::PARTNER_SILENT);
        let first_silent = 1 + records.iter().rposition(|record| !silent(record)).expect("it was heard");
        println!("force until {} ms, {link}", records[last_felt].time_ns / 1_000_000);
        // No tick goes by a state as old as the watchdog, and none after that has force.
        assert!(number(&link["longest_wait_ms"]) < WATCHDOG_MS, "{link}");
        assert!(number(&link["silences"]) >= 1.0, "{link}");
        assert!(first_silent < records.len(), "the cut is seen");
        assert!(last_felt < first_silent, "no force from the tick on that misses the partner");
    }
}

/// Whatever a host does, a force that was sent goes on acting while it is kept from running. The tank knows of it afterwards.
#[test]
fn a_host_that_is_delayed_overdraws_by_what_came_out_meanwhile_and_no_more() {
    let Some(program) = program() else { return };
    let network = Network::start();
    let scenes = GRIPS.map(|grip| scene("oscillate", grip, 60_000.0)); // however long they are delayed
    network.run(&program, scenes, 4.0, |runs, _| {
        for run in runs.iter().cycle().take(40) {
            std::thread::sleep(Duration::from_millis(37)); // no part of a swing's period
            run.signal_host(Signal::STOP);
            std::thread::sleep(Duration::from_millis(40));
            run.signal_host(Signal::CONT);
        }
    });
    let missing_j = [0, 1].map(|index| out_while_missing_j(&network.hosts[index].records()));
    for (index, host) in network.hosts.iter().enumerate() {
        let summary = host.summary();
        println!("{}, out while missing ticks {missing_j:?} J", summary["couplings"][0]);
        assert_below_zero_by_no_more(&summary["couplings"][0], [missing_j[index], missing_j[1 - index]]);
    }
    assert!(missing_j.iter().sum::<f64>() > 1.0e-6, "nothing came out: {missing_j:?}");
}

/// The run that a liar claims to be.
const LIAR: u64 = 99;

/// A lie: what is claimed in a tick, of what an honest run would say.
type Lie = fn(u64, Dispatch) -> Dispatch;

/// A handle on a swing that nobody moves, and energy that nobody has put in.
fn swing(tick: u64, most_m: f64, frequency_hz: f64, passed_on_j: f64, mut dispatch: Dispatch) -> Dispatch {
    let rate = std::f64::consts::TAU * frequency_hz;
    let (sin, cos) = (rate * 1.0e-3 * tick as f64).sin_cos();
    dispatch.state.pose.position_m[2] = most_m * sin;
    dispatch.state.twist.linear_m_per_s[2] = most_m * rate * cos;
    dispatch.state.passed_on_j = passed_on_j;
    dispatch
}

const LIES: [(&str, Lie); 6] = [
    ("1 J a tick", |tick, d| swing(tick, 0.01, 4.0, tick as f64, d)),
    ("50 mJ a tick", |tick, d| swing(tick, 0.002, 8.0, 0.05 * tick as f64, d)),
    ("no energy", |tick, d| swing(tick, 0.002, 8.0, 0.0, d)),
    ("out of this world", |tick, mut d| {
        d.state.pose.position_m = [1.7e308; 3];
        d.state.passed_on_j = tick as f64;
        d
    }),
    ("the last of all runs", |tick, d| swing(tick, 0.01, 4.0, tick as f64, Dispatch { run: u64::MAX, ..d })),
    ("a time that jumps", |tick, d| {
        let jumped = tick.wrapping_mul(0x9e37_79b9_7f4a_7c15);
        swing(tick, 0.005, 4.0, 0.05 * tick as f64, Dispatch { tick: jumped, ..d })
    }),
];

/// A program that is no host, and says on the keys of one what it likes, until told to stop.
fn lies(port: u16, lie: Lie, until: &AtomicBool) {
    let (session, heard) = (visit(port), Arc::<AtomicU64>::default());
    let of_callback = Arc::clone(&heard);
    let hear = move |sample: zenoh::sample::Sample| {
        let dispatch = Dispatch::from_bytes(&sample.payload().to_bytes()).unwrap();
        of_callback.store(dispatch.run, Ordering::Relaxed);
    };
    let _subscriber = session.declare_subscriber(lab().key("news/pair")).callback(hear).wait().unwrap();
    for tick in 1.. {
        if until.load(Ordering::Relaxed) {
            return;
        }
        let mut honest = Dispatch::from_words(&[0; DISPATCH_WORDS]);
        (honest.run, honest.partner, honest.since) = (LIAR, heard.load(Ordering::Relaxed), 1);
        honest.tick = tick;
        honest.state.pose.orientation_xyzw[3] = 1.0;
        session.put(lab().key("couple/pair"), lie(tick, honest).to_bytes()).wait().unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// What a host says of its partner is no more than was checked, and where the partner lies it is named.
#[test]
fn a_program_that_lies_over_zenoh_brings_out_no_more_than_was_believed() {
    let Some(program) = program() else { return };
    for (name, lie) in LIES {
        let (host, stop, port) = (Host::new(), Arc::<AtomicBool>::default(), free_port());
        let served = host.serve(port, &stop);
        let mut run = host.run(&program, &scene("hold", "relaxed", WATCHDOG_MS), 3.0);
        std::thread::scope(|scope| {
            let until = Arc::clone(&stop);
            scope.spawn(move || lies(port, lie, &until));
            let is_well = run.wait().unwrap().success();
            stop.store(true, Ordering::Relaxed);
            assert!(is_well, "{name}: the handle stays in its range");
        });
        served.join().unwrap();
        let (summary, records) = (host.summary(), host.records());
        let link = &summary["couplings"][0]["link"];
        let out_j = -records.iter().map(|record| record.port_energy_j).fold(0.0, f64::min);
        println!("{name}: {:.3} mJ out; {link}", 1.0e3 * out_j);
        // What is not foreseen of a hand is paid for afterwards, and so is what comes out in ticks that this machine misses.
        let most_j = number(&link["believed_j"]) + out_while_missing_j(&records) + 1.0e-4;
        assert!(out_j <= most_j, "{name}: {out_j} J of {most_j} J");
        let cut_ticks = number(&link["cut_ticks"]);
        let events = records.iter().filter(|record| record.events.intersects(Events::PARTNER_LIMITED));
        assert!(events.count() as f64 <= cut_ticks, "{name}: an event for what was not believed");
        let run = if name == "the last of all runs" { u64::MAX } else { LIAR }.to_string();
        match name {
            "no energy" => assert!(cut_ticks == 0.0 && link["partner"] == run, "{link}"),
            "out of this world" => {
                assert!(number(&link["implausible"]) > 0.0 && link["partner"] == run, "{link}");
                assert!(records.iter().all(|record| record.commanded.force().length() == 0.0));
            }
            "a time that jumps" => assert!(link["partner"] == run || link["let_go"][0] == run, "{link}"),
            _ => assert!(cut_ticks > 0.0 && link["let_go"][0] == run, "{name}: who lies is named: {link}"),
        }
    }
}
