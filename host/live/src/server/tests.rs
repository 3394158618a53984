use super::*;
use crate::platform::connect;
use crate::{Client, Event, Frames, WrenchLimits};
use flotor_core::Clock;
use std::io::Write;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, Sender, channel};

/// A host whose every request but an emergency stop takes until the end of the test.
struct Slow {
    over: Mutex<Receiver<()>>,
}

impl Serve for Slow {
    fn serve(&self, ask: Ask) -> Result<(), (RefusalCause, String)> {
        if ask != Ask::EmergencyStop {
            let _ = self.over.lock().unwrap().recv();
        }
        Ok(())
    }
}

fn publication() -> (tempfile::TempDir, Directory, Publication, Sender<()>) {
    let scratch = tempfile::tempdir().unwrap();
    let directory = Directory::at(scratch.path().join("runs"));
    let greeting = Greeting {
        protocol: crate::PROTOCOL,
        flotor_version: String::new(),
        process: 1,
        title: String::new(),
        plugins: Vec::new(),
        limits: WrenchLimits::default(),
    };
    let (over, receiver) = channel();
    let host = Slow { over: Mutex::new(receiver) };
    let run = RunDescription {
        flotor_version: String::new(),
        rate_hz: 1000.0,
        duration_s: 1.0,
        seed: 0,
        clock: Clock::Real,
        scene_toml: String::new(),
        plugins: Vec::new(),
        couplings: Vec::new(),
    };
    let publication =
        Publication::open(&directory, greeting, &run, Arc::new(host), ObserverDemand::default());
    (scratch, directory, publication.unwrap(), over)
}

/// The time until an emergency stop of a new client is answered.
fn stop_of_a_new_client(path: &Path) -> Duration {
    let since = Instant::now();
    let mut client = Client::connect(path).unwrap();
    let number = client.request_client().ask(Ask::EmergencyStop).unwrap();
    loop {
        match client.next(Duration::from_secs(20)).unwrap() {
            Some(Event::Answer(answer)) if answer.number == number => return since.elapsed(),
            Some(_) => {}
            None => panic!("no answer"),
        }
    }
}

/// Each client that was evicted for a new one was waited for: half a second, if it was at a request.
#[test]
fn a_stop_waits_for_no_client_that_makes_room_for_it() {
    let (_scratch, _directory, publication, over) = publication();
    let busy = || {
        let client = Client::connect(publication.path()).unwrap();
        client.request_client().ask(Ask::Stop).unwrap();
        client
    };
    let busy: Vec<Client> = (0..MAX_CONNECTIONS).map(|_| busy()).collect();
    let stops = MAX_CONNECTIONS / 2;
    let all: Duration = (0..stops).map(|_| stop_of_a_new_client(publication.path())).sum();
    let evictions = u32::try_from(stops).unwrap();
    assert!(all < evictions * PATIENCE / 4, "{all:?} for {evictions} stops");
    drop((busy, over));
}

/// Accepts, and serves each client in a thread of its own: an answer to whatever comes.
fn stand_in(path: &Path) -> Arc<Listening> {
    let listening = Arc::new(Listening::bind(path).unwrap());
    let socket = Arc::clone(&listening);
    std::thread::spawn(move || {
        while let Ok(Some(mut stream)) = socket.accept() {
            std::thread::spawn(move || {
                let (answer, mut frames) = (br#"{"number":0,"refused":null}"#, Frames::default());
                while frames.fill(&mut stream).is_ok_and(|length| length > 0) {
                    let _ = stream.write_all(&frame(Kind::Answer, answer));
                }
            });
        }
    });
    listening
}

/// The time until a request of a new client is answered.
fn answered(path: &Path) -> Duration {
    let since = Instant::now();
    let (mut stream, mut frames) = (connect(path).unwrap(), Frames::default());
    stream.write_all(&frame(Kind::Request, br#"{"number":0,"ask":"emergency-stop"}"#)).unwrap();
    loop {
        assert_ne!(frames.fill(&mut stream).unwrap(), 0, "turned away");
        while let Some((kind, _)) = frames.take().unwrap() {
            if kind == Kind::Answer {
                return since.elapsed();
            }
        }
    }
}

/// Programs that connect without end, and leave at once or stay silent: a stop is as soon as at a server that does nothing else.
#[test]
fn a_stop_under_a_flood_of_connections_is_as_soon_as_at_a_plain_server() {
    const CLIENTS: usize = 4;
    const HELD: usize = 100;
    let (scratch, _directory, publication, _over) = publication();
    let plain = scratch.path().join("plain");
    let _listening = stand_in(&plain);
    let of = |path: &Path| {
        let is_over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            for client in 0..CLIENTS {
                let is_over = &is_over;
                scope.spawn(move || {
                    let mut held = std::collections::VecDeque::new();
                    while !is_over.load(Ordering::Relaxed) {
                        held.extend(connect(path));
                        // Half of them leave at once.
                        let stay = if client % 2 == 0 { HELD } else { 0 };
                        held.drain(..held.len().saturating_sub(stay));
                    }
                });
            }
            std::thread::sleep(Duration::from_millis(50));
            let took = answered(path);
            is_over.store(true, Ordering::Relaxed);
            took
        })
    };
    let rounds: Vec<(Duration, Duration)> = (0..11).map(|_| (of(publication.path()), of(&plain))).collect();
    let median = |mut all: Vec<Duration>| {
        all.sort();
        all[all.len() / 2]
    };
    let (own, other) = rounds.into_iter().unzip();
    let (own, other) = (median(own), median(other));
    println!("answered after {own:?}, by a plain server after {other:?}");
    assert!(own <= Duration::from_millis(50).max(2 * other), "{own:?}, by a plain server {other:?}");
}

/// Two containers with one folder: the file at the path of its socket may be of another run.
#[test]
fn a_run_ends_though_its_path_leads_to_another() {
    let (_scratch, _directory, publication, _over) = publication();
    let path = publication.path().to_path_buf();
    std::fs::remove_file(&path).unwrap();
    let other = Listening::bind(&path).unwrap();
    let (ended, has_ended) = channel();
    std::thread::spawn(move || {
        drop(publication);
        let _ = ended.send(());
    });
    assert_eq!(has_ended.recv_timeout(Duration::from_secs(20)), Ok(()));
    assert!(path.exists(), "it removes no socket of another run");
    drop(other);
}

/// A run that is asked by another to stop, one that is over, and one that confirms nothing.
#[test]
fn runs_that_have_not_confirmed_a_stop_are_named() {
    let (_scratch, directory, publication, over) = publication();
    drop(over);
    let latch = directory.latch();
    let soon = || Instant::now() + Duration::from_millis(200);
    assert_eq!(latch.stop_runs(Instant::now() + Duration::from_secs(20)).unwrap(), Vec::<u32>::new());
    let silent = directory.listen().unwrap();
    assert_eq!(latch.stop_runs(soon()).unwrap(), [std::process::id()]);
    drop(silent);
    let left = directory.path().join("4711-0.run");
    drop(std::fs::File::create(&left));
    assert_eq!(latch.stop_runs(soon()).unwrap(), Vec::<u32>::new());
    drop(publication);
}
