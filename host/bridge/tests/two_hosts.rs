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
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_bridge::request::Right;
use flotor_bridge::serve::{Service, serve};
use flotor_core::trace::{Events, TickRecord};
use flotor_live::Directory;
use flotor_record::Recording;
use proxy::Proxy;
use rustix::process::Signal;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

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
        let (name, stop) = (Name::new("lab").unwrap(), Arc::<AtomicBool>::default());
        let port = free_port();
        let proxy = Proxy::to(port);
        let at = |port: u16| vec![format!("tcp/127.0.0.1:{port}")];
        let serving = LinkOptions { listen: at(port), ..LinkOptions::default() };
        let serving = open(&serving, End::Serving).unwrap();
        let service = Service { name: name.clone(), allow: Right::Operate, every: 1, launcher: None };
        let (directory, until) = (hosts[0].directory(), Arc::clone(&stop));
        let served = std::thread::spawn(move || {
            serve(&serving, &directory, service, &until, &mut |_| {}).unwrap();
        });
        let visiting = LinkOptions { connect: at(proxy.port), ..LinkOptions::default() };
        let visiting = open(&visiting, End::Visiting).unwrap();
        let (directory, until) = (hosts[1].directory(), Arc::clone(&stop));
        let coupled = std::thread::spawn(move || {
            couple(&visiting, &directory, &name, &until, &mut |_| {}).unwrap();
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
            run.signal(Signal::STOP);
            std::thread::sleep(Duration::from_millis(40));
            run.signal(Signal::CONT);
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
