//! The emergency stop from the network: presses the latch of this machine at once, and is answered when every host has confirmed.

use super::handler::reply;
use flotor_live::{Ask, Client, Directory, Event, Found, Latch};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::time::{Duration, Instant};
use zenoh::query::Query;

/// How long the hosts may take to confirm; who presses waits longer for the answer.
const CONFIRM_WAIT: Duration = Duration::from_millis(2000);
/// Pause before a host that could not be asked is looked for again.
const RETRY_PERIOD: Duration = Duration::from_millis(10);
/// Presses that wait for an answer at most. What finds no room has pressed all the same, and is never told that it is done.
const MOST_WAITING: usize = 1024;

/// Presses, and lets a thread of its own ask the hosts.
pub(super) struct Emergency {
    latch: Latch,
    pressed: SyncSender<(Query, Option<String>)>,
}

impl Emergency {
    pub(super) fn start(directory: &Directory) -> std::io::Result<Self> {
        let (pressed, queries) = sync_channel(MOST_WAITING);
        let of_thread = directory.clone();
        let thread = std::thread::Builder::new().name("flotor-emergency".to_owned());
        // Ends with the last sender.
        thread.spawn(move || attend(&of_thread, &queries))?;
        Ok(Self { latch: directory.latch(), pressed })
    }

    pub(super) fn latch(&self) -> &Latch {
        &self.latch
    }

    /// Before anything else the latch: a run that is not yet to be seen looks at it before it energises a device.
    pub(super) fn press(&self, who: &str, query: Query) {
        let problem = self.latch.press(who).err().map(|error| {
            format!("the runs that are on are stopped, but the emergency stop does not stay: {error}")
        });
        let _ = self.pressed.try_send((query, problem));
    }
}

fn attend(directory: &Directory, queries: &Receiver<(Query, Option<String>)>) {
    while let Ok(first) = queries.recv() {
        let together: Vec<_> = std::iter::once(first).chain(queries.try_iter()).collect();
        let unconfirmed = stop_all(directory);
        let missing = (!unconfirmed.is_empty()).then(|| {
            let processes: Vec<String> = unconfirmed.iter().map(u32::to_string).collect();
            format!("not confirmed by process {}: it may go on; switch its device off", processes.join(", "))
        });
        for (query, problem) in together {
            reply(&query, missing.clone().or(problem));
        }
    }
}

/// Asks every run of this machine to stop; the processes that have not confirmed it.
fn stop_all(directory: &Directory) -> Vec<u32> {
    let until = Instant::now() + CONFIRM_WAIT;
    let (done, confirmed) = channel();
    let mut missing: Vec<u32> = Vec::new();
    for run in directory.runs() {
        missing.push(run.process);
        let (done, directory) = (done.clone(), directory.clone());
        // Not waited for longer than agreed: a frozen host takes its time.
        std::thread::spawn(move || {
            if is_stopped(&directory, &run, until) {
                let _ = done.send(run.process);
            }
        });
    }
    drop(done);
    while !missing.is_empty() {
        let left = until.saturating_duration_since(Instant::now());
        let Ok(process) = confirmed.recv_timeout(left) else { break };
        missing.retain(|other| *other != process);
    }
    missing
}

/// Whether a run has confirmed, or is gone.
fn is_stopped(directory: &Directory, run: &Found, until: Instant) -> bool {
    while Instant::now() < until {
        if let Ok(mut client) = Client::connect(&run.path) {
            // A run of another machine that is shown here: its own is not pressed.
            if client.greeting().process != run.process {
                return true;
            }
            if is_confirmed(&mut client, until) {
                return true;
            }
        }
        if !directory.runs().contains(run) {
            return true;
        }
        std::thread::sleep(RETRY_PERIOD);
    }
    false
}

fn is_confirmed(client: &mut Client, until: Instant) -> bool {
    let Ok(number) = client.asker().ask(Ask::EmergencyStop) else { return false };
    loop {
        match client.next(until.saturating_duration_since(Instant::now())) {
            Ok(Some(Event::Answer(answer))) if answer.number == number => return true,
            Ok(Some(Event::End(_))) => return true,
            Ok(Some(_)) => {}
            Ok(None) | Err(_) => return false,
        }
    }
}
