//! A host that can be watched, without a host: records at a steady rate, and a list of what it was requested.

#![allow(dead_code)] // each test program uses its part

#[path = "../../../../tests/src/process.rs"]
pub mod process;
#[path = "../../../../tests/src/tools.rs"]
pub mod tools;

use flotor_bridge::keys::Name;
use flotor_bridge::link::{End, LinkOptions, open};
use flotor_bridge::remote::Remote;
use flotor_bridge::request::Right;
use flotor_bridge::serve::{Service, serve};
use flotor_core::Clock;
use flotor_core::demand::ObserverDemand;
use flotor_core::trace::{Events, RECORD_WORDS, TickRecord};
use flotor_live::{Ask, Directory, Greeting, PROTOCOL, Publication, RefusalCause, Serve, WrenchLimits};
use flotor_record::RunDescription;
use flotor_sync::Words;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// No test waits longer than this for anything.
pub const PATIENCE: Duration = Duration::from_secs(20);

/// A record in which every number says which tick it is of.
pub fn record(tick: u64) -> TickRecord {
    let record = TickRecord::from_words(&std::array::from_fn::<u64, RECORD_WORDS, _>(|word| {
        (tick as f64 + word as f64 * 0.015_625).to_bits()
    }));
    let (time_ns, dt_ns) = (tick * 1_000_000, 1_000_000);
    TickRecord {
        tick,
        time_ns,
        dt_ns,
        events: Events::NONE,
        buttons: 0,
        lateness_ns: 0,
        compute_ns: 0,
        ..record
    }
}

pub fn description() -> RunDescription {
    RunDescription {
        flotor_version: "0.1.0".to_owned(),
        rate_hz: 1000.0,
        duration_s: 60.0,
        seed: 7,
        clock: Clock::Real,
        scene_toml: "title = \"Far away\"".to_owned(),
        couplings: Vec::new(),
        plugins: Vec::new(),
    }
}

/// A model that takes its time to be weighted.
pub const SLOW: &str = "slow";

/// What a host was requested.
#[derive(Default)]
pub struct Asked(pub Mutex<Vec<Ask>>);

impl Serve for Asked {
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)> {
        self.0.lock().unwrap().push(ask.clone());
        match ask {
            Ask::Weight { model, .. } if model == SLOW => {
                std::thread::sleep(Duration::from_millis(20));
                Ok(())
            }
            Ask::Set { values } if values.iter().any(|value| value.parameter == "gamma") => {
                Err((RefusalCause::Request, "no parameter `gamma`; did you mean `gamma_n`?".to_owned()))
            }
            _ => Ok(()),
        }
    }
}

/// A run that is published in a folder of its own.
pub struct FakeHost {
    pub directory: Directory,
    pub asked: Arc<Asked>,
    publication: Option<Publication>,
    _folder: tempfile::TempDir,
}

impl FakeHost {
    pub fn start() -> Self {
        Self::start_in("runs")
    }

    /// In a folder of this name.
    pub fn start_in(name: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let directory = Directory::at(folder.path().join(name));
        let mut host = Self { directory, asked: Arc::default(), publication: None, _folder: folder };
        host.run();
        host
    }

    pub fn run(&mut self) {
        let greeting = Greeting {
            protocol: PROTOCOL,
            flotor_version: "0.1.0".to_owned(),
            process: std::process::id(),
            title: "Far away".to_owned(),
            plugins: Vec::new(),
            limits: WrenchLimits::default(),
        };
        let host = Arc::clone(&self.asked);
        let demand = ObserverDemand::default();
        let opened = Publication::open(&self.directory, greeting, &description(), host, demand);
        self.publication = Some(opened.unwrap());
    }

    pub fn publication(&self) -> &Publication {
        self.publication.as_ref().expect("the run is on")
    }

    pub fn end(&mut self, words: &str) {
        self.publication.take().expect("the run is on").end(words, flotor_live::EndKind::InOrder);
    }

    /// Ticks at 1 kHz in bursts of ten, as a host's observers see them.
    pub fn ticks(&self, ticks: std::ops::Range<u64>) {
        let (started, first) = (Instant::now(), ticks.start);
        for tick in ticks {
            self.publication().observe(&record(tick));
            if tick % 10 == 0 {
                let due = Duration::from_millis(tick - first);
                std::thread::sleep(due.saturating_sub(started.elapsed()));
            }
        }
    }
}

/// A bridge in a thread of its own.
pub struct Bridge {
    pub name: Name,
    pub endpoint: String,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Bridge {
    pub fn start(directory: &Directory, allow: Right) -> Self {
        Self::start_with(directory, allow, format!("tcp/127.0.0.1:{}", free_port()), LinkOptions::default())
    }

    pub fn start_with(directory: &Directory, allow: Right, endpoint: String, link: LinkOptions) -> Self {
        let name = Name::new("far").unwrap();
        let link = LinkOptions { listen: vec![endpoint.clone()], ..link };
        let stop = Arc::new(AtomicBool::new(false));
        let (for_thread, of_host) = (Arc::clone(&stop), directory.clone());
        let service = Service { name: name.clone(), allow, every: 1, launcher: None };
        let session = open(&link, End::Serving).unwrap();
        let thread = std::thread::spawn(move || {
            serve(&session, &of_host, service, &for_thread, &mut |_| {}).unwrap();
        });
        Self { name, endpoint, stop, thread: Some(thread) }
    }

    pub fn visit(&self) -> Remote {
        let link = LinkOptions { connect: vec![self.endpoint.clone()], ..LinkOptions::default() };
        Remote::listen(&open(&link, End::Visiting).unwrap(), &self.name).unwrap()
    }
}

impl Drop for Bridge {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// The `flotor` program under test; `None`, and a word about it, where there is none.
pub fn program() -> Option<PathBuf> {
    let program = std::env::var_os("FLOTOR").map(PathBuf::from);
    if program.is_none() {
        tools::skipped("FLOTOR names no `flotor` program to run");
    }
    // Tests run in the folder of their crate, who set it may have been elsewhere.
    program.map(|path| if path.exists() { path } else { Path::new("../..").join(path) })
}

/// Whether the tests are to be thorough, not quick.
pub fn is_full_size() -> bool {
    std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full")
}

/// A port nobody listens on.
pub fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Waits until something is so.
pub fn wait_until(what: &str, mut is_so: impl FnMut() -> bool) {
    let started = Instant::now();
    while !is_so() {
        assert!(started.elapsed() < PATIENCE, "{what} within {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}
