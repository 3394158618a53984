//! State shared by all connections: the run, its devices, the sessions and their settings.

use crate::access::Access;
use crate::device::kept_at_first;
use crate::events::{Events, Level, device_data};
use crate::force::{Domain, Forces, SessionCommand};
use crate::view::View;
use flotor_compat::{Host, Pace, State, Station};
use flotor_core::civil_date;
use flotor_hal::Wrench;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::io;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

/// Service with its run and shared state.
pub(crate) struct Service {
    pub(crate) host: &'static Host,
    pub(crate) events: Events,
    pub(crate) access: Access,
    shared: Mutex<Shared>,
    /// Wakes the thread of `follow`.
    following: Condvar,
    next_session: AtomicU64,
}

/// Session: a client of the simulation channel, visible to all connections.
#[derive(Debug)]
pub(crate) struct Session {
    pub(crate) id: u64,
    pub(crate) profile: String,
    pub(crate) started: String,
    /// Views of each device: of the arm, and of the grip.
    pub(crate) views: Vec<[View; 2]>,
}

/// Mutable state of the service.
#[derive(Default)]
pub(crate) struct Shared {
    pub(crate) sessions: Vec<Session>,
    /// Commands to each device.
    pub(crate) forces: Vec<Forces>,
    /// Stored settings of each device, by their names in a path.
    pub(crate) kept: Vec<BTreeMap<&'static str, Value>>,
    /// Stored settings of the service.
    pub(crate) settings: BTreeMap<String, Value>,
}

/// Limit on the settings of the service, bytes of keys and values as JSON.
pub(crate) const MOST_SETTINGS_BYTES: usize = 1 << 20;

impl Shared {
    /// Stores a setting of the service; returns false, and stores nothing, without room for the setting.
    pub(crate) fn keep_setting(&mut self, key: &str, value: &Value) -> bool {
        let size = |key: &str, value: &Value| key.len() + value.to_string().len();
        let others = self.settings.iter().filter(|(other, _)| *other != key);
        let kept: usize = others.map(|(key, value)| size(key, value)).sum();
        let has_room = kept + size(key, value) <= MOST_SETTINGS_BYTES;
        if has_room {
            self.settings.insert(key.to_owned(), value.clone());
        }
        has_room
    }
}

impl Service {
    /// Creates the service, which lives as long as the process.
    pub(crate) fn leak(host: &'static Host, access: Access) -> &'static Self {
        let devices = host.stations().len();
        let shared = Shared {
            forces: std::iter::repeat_with(Forces::default).take(devices).collect(),
            kept: std::iter::repeat_with(kept_at_first).take(devices).collect(),
            ..Shared::default()
        };
        Box::leak(Box::new(Self {
            host,
            events: Events::default(),
            access,
            shared: Mutex::new(shared),
            following: Condvar::new(),
            next_session: AtomicU64::new(1),
        }))
    }

    pub(crate) fn shared(&self) -> MutexGuard<'_, Shared> {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts a session; returns its id.
    pub(crate) fn enter(&self) -> u64 {
        let mut shared = self.shared();
        let id = self.next_session.fetch_add(1, Ordering::Relaxed);
        let views = self.host.stations().iter().map(|_| <[View; 2]>::default()).collect();
        let profile = "default".to_owned();
        shared.sessions.push(Session { id, profile, started: now_text(), views });
        id
    }

    /// Ends a session and removes its commands.
    pub(crate) fn remove(&self, session: u64) {
        let mut shared = self.shared();
        shared.sessions.retain(|there| there.id != session);
        for (forces, station) in shared.forces.iter_mut().zip(self.host.stations()) {
            forces.remove(session);
            self.command(forces, station, &station.state());
        }
    }

    /// Sets the command of a session to a device, in Flotor's axes. The first command enables force, which fades in.
    pub(crate) fn set(&self, shared: &mut Shared, session: u64, device: usize, wanted: SessionCommand) {
        let (Some(forces), Some(station)) = (shared.forces.get_mut(device), self.host.station(device)) else {
            return;
        };
        forces.set(session, self.host.now_ns(), wanted);
        self.command(forces, station, &station.state());
        if self.host.pace() == Pace::Real && forces.follow_the_handle() {
            self.following.notify_one();
        }
    }

    /// Sends the sum of all commands to a device and enables force; without commands disables force.
    fn command(&self, forces: &mut Forces, station: &Station, state: &State) {
        let now_ns = self.host.now_ns();
        if forces.remove_expired(now_ns) {
            station.disable();
            return;
        }
        let sum_n = forces.sum(state, now_ns);
        // The sum is finite: its parts are finite and limited.
        let _ = station.command(&Wrench::from_force(sum_n), now_ns);
        station.enable();
    }

    /// Starts a thread that updates sums that depend on the handle, and fades expired commands. The thread acts in real time only.
    ///
    /// # Errors
    /// If the thread cannot be created.
    pub(crate) fn follow(&'static self) -> io::Result<()> {
        let thread = std::thread::Builder::new().name("flotor-sum".to_owned());
        thread.spawn(move || {
            let period = Duration::from_nanos(self.host.period_ns());
            loop {
                let mut shared = self.shared();
                while !shared.forces.iter().any(Forces::follow_the_handle) {
                    shared = self.following.wait(shared).unwrap_or_else(PoisonError::into_inner);
                }
                for (forces, station) in shared.forces.iter_mut().zip(self.host.stations()) {
                    if forces.follow_the_handle() {
                        self.command(forces, station, &station.state());
                    }
                }
                drop(shared);
                std::thread::sleep(period);
            }
        })?;
        Ok(())
    }

    /// Returns the values of `mode`, `control_domain` and `control_mode` for a device.
    pub(crate) fn control(&self, shared: &Shared, device: usize) -> [&'static str; 3] {
        let newest = shared.forces.get(device).and_then(|forces| forces.newest(self.host.now_ns()));
        let Some(wanted) = newest else { return ["idle", "cartesian", "idle"] };
        let domain = if wanted.domain == Domain::Angular { "angular" } else { "cartesian" };
        match (wanted.target_m, wanted.domain) {
            (Some(_), _) => ["position", domain, "position"],
            (None, Domain::Angular) => ["angular", domain, "force"],
            (None, Domain::Cartesian) => ["idle", domain, "force"],
        }
    }

    /// Emits a `device-disconnected` event for each device.
    pub(crate) fn device_lost(&self) {
        for number in 0..self.host.stations().len() {
            let data = device_data(number);
            self.events.emit("device-disconnected", "device", Level::Warning, data, "the run ended");
        }
    }

    /// Emits an `invalid-value` event: a client sent an illegal value.
    pub(crate) fn refuse(&self, field: &str, reason: &str, context: &str) {
        let context: String = context.chars().take(200).collect();
        let data = json!({ "field": field, "reason": reason, "context": context });
        self.events.emit("invalid-value", "input", Level::Warning, data, reason);
    }
}

impl Shared {
    pub(crate) fn session(&self, id: u64) -> Option<&Session> {
        self.sessions.iter().find(|session| session.id == id)
    }

    pub(crate) fn session_mut(&mut self, id: u64) -> Option<&mut Session> {
        self.sessions.iter_mut().find(|session| session.id == id)
    }
}

/// Returns the current time in the service's format: `YYYY-MM-DD HH:MM:SS`, UTC.
fn now_text() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let (year, month, day) = civil_date(days);
    format!("{year:04}-{month:02}-{day:02} {:02}:{:02}:{:02}", second / 3600, second / 60 % 60, second % 60)
}
