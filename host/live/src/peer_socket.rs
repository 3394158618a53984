//! Datagram socket for the peer state of a coupling, between a host and a bridge, in addition to the socket of the run.
//!
//! ```text
//!  host: PeerSocket::listen  <- peer state, or an empty call -  PeerSocket::join :bridge
//!                            -  peer state                      ->
//! ```
//!
//! Datagrams are used because only the newest state matters: a datagram that finds no room is dropped, and delays no other. A
//! program that has joined repeats its subscription every [`CALL_PERIOD`]; the host drops subscribers that are silent for a second.
//! Not real-time.

use crate::Directory;
use crate::directory::{DirectoryError, private, process_number, unusable};
use crate::platform::{Datagrams, remove_if_dead};
use flotor_core::peer::{Dispatch, InvalidDispatch};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

/// Extension of a host's socket file.
const HOST: &str = "peer";
/// Extension of a subscriber's socket file.
const JOINED: &str = "joined";
/// Interval at which a subscriber has to repeat its subscription.
pub const CALL_PERIOD: Duration = Duration::from_millis(100);
/// Timeout of a subscription that is not repeated.
const FORGET_AFTER: Duration = Duration::from_secs(1);
/// Maximum number of subscribers of a coupling.
const MAX_JOINED: usize = 8;
/// Buffer size, bytes, more than any message: a datagram that fills it is malformed.
const BUFFER_BYTES: usize = 1024;

/// Coupling of a running host with a remote end on another host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundCoupling {
    /// Name of the coupling in both hosts' scenes.
    pub name: String,
    /// Process id of the run.
    pub process: u32,
    path: PathBuf,
}

/// One end of the local connection of a coupling, at the host or at a bridge; dropping it removes the socket file.
#[derive(Debug)]
pub struct PeerSocket {
    socket: Datagrams,
    path: PathBuf,
    peers: Vec<Peer>,
}

/// Receiver of the peer state.
#[derive(Debug)]
struct Peer {
    path: PathBuf,
    /// Time of the peer's last datagram; `None` for a host, which never times out.
    called: Option<Instant>,
}

impl Directory {
    /// Returns the couplings of running hosts with a remote end, by name and process; removes the files of closed sockets.
    #[must_use]
    pub fn couplings(&self) -> Vec<FoundCoupling> {
        let mut found: Vec<FoundCoupling> = (self.files().into_iter())
            .filter_map(|entry| {
                let path = entry.path();
                let ending = path.extension()?.to_str()?;
                let (process, name) = path.file_stem()?.to_str()?.split_once('-')?;
                let (process, name) = (process.parse().ok()?, name.to_owned());
                if [HOST, JOINED].contains(&ending) && remove_if_dead(&path) {
                    return None;
                }
                (ending == HOST).then_some(FoundCoupling { name, process, path })
            })
            .collect();
        found.sort_by(|a, b| (&a.name, a.process).cmp(&(&b.name, b.process)));
        found
    }
}

impl PeerSocket {
    /// Creates the host's end for the coupling named `coupling`.
    ///
    /// # Errors
    /// If the folder or the socket cannot be created, or other users may enter the folder.
    pub fn listen(directory: &Directory, coupling: &str) -> Result<Self, DirectoryError> {
        private(directory.path())?;
        let path = directory.path().join(format!("{}-{coupling}.{HOST}", process_number()));
        Self::bind(path)
    }

    /// Creates the end of a bridge, a program that transports the peer state between this host and another. The bridge
    /// receives states only after [`Self::subscribe`] or [`Self::send`].
    ///
    /// # Errors
    /// If the folder or the socket cannot be created, or other users may enter the folder.
    pub fn join(directory: &Directory, coupling: &FoundCoupling) -> Result<Self, DirectoryError> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        private(directory.path())?;
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let file = format!("{}-{}-{number}.{JOINED}", process_number(), coupling.name);
        let mut joined = Self::bind(directory.path().join(file))?;
        joined.peers.push(Peer { path: coupling.path.clone(), called: None });
        Ok(joined)
    }

    fn bind(path: PathBuf) -> Result<Self, DirectoryError> {
        // The file of a killed process may still exist.
        remove_if_dead(&path);
        let socket = Datagrams::bind(&path).map_err(unusable(&path))?;
        Ok(Self { socket, path, peers: Vec::new() })
    }

    /// Returns the path of the socket file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Sends the peer state to all receivers, without waiting. Removes receivers that have closed their socket or timed out; a
    /// receiver with a full socket misses the state.
    pub fn send(&mut self, dispatch: &Dispatch) {
        self.send_bytes(&dispatch.to_bytes());
    }

    /// Subscribes to the host's states, or renews the subscription. Returns false if the host has closed its socket.
    pub fn subscribe(&mut self) -> bool {
        self.send_bytes(&[]);
        !self.peers.is_empty()
    }

    fn send_bytes(&mut self, bytes: &[u8]) {
        let Self { socket, peers, .. } = self;
        peers.retain(|peer| {
            let is_here = peer.called.is_none_or(|called| called.elapsed() < FORGET_AFTER);
            let sent = socket.send_to(bytes, &peer.path);
            let is_gone = sent.is_err_and(|error| !is_passing(error.kind()));
            is_here && !is_gone
        });
    }

    /// Returns the next received state, without waiting; `None` if no state is pending. At the host, the sender of a
    /// datagram becomes a subscriber, up to eight.
    ///
    /// # Errors
    /// If a datagram is malformed.
    pub fn receive(&mut self) -> Result<Option<Dispatch>, InvalidDispatch> {
        let mut buffer = [0; BUFFER_BYTES];
        loop {
            let Ok((length, from)) = self.socket.recv_from(&mut buffer) else { return Ok(None) };
            if let Some(path) = from.as_pathname() {
                self.subscribe_peer(path);
            }
            match buffer.get(..length).unwrap_or_default() {
                [] => {} // a subscription
                bytes => return Dispatch::from_bytes(bytes).map(Some),
            }
        }
    }

    fn subscribe_peer(&mut self, path: &Path) {
        let has_room = self.peers.len() < MAX_JOINED;
        match self.peers.iter_mut().find(|peer| peer.path == path) {
            Some(Peer { called: None, .. }) => {} // the host, whom this end has joined
            Some(peer) => peer.called = Some(Instant::now()),
            None if has_room => {
                self.peers.push(Peer { path: path.to_path_buf(), called: Some(Instant::now()) });
            }
            None => {}
        }
    }
}

impl Drop for PeerSocket {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// Returns true for the error of a full socket, false for the error of a closed socket.
fn is_passing(kind: ErrorKind) -> bool {
    matches!(kind, ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_core::peer::{PeerState, TankState};

    fn dispatch(tick: u64) -> Dispatch {
        let state =
            PeerState { pose: flotor_hal::Pose::HOME, twist: flotor_hal::Twist::ZERO, passed_on_j: 0.0 };
        Dispatch { run: 1, partner: 0, since: 0, tick, state, tank: TankState::default() }
    }

    #[test]
    fn who_joined_is_told_and_heard_and_who_left_is_forgotten() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        let mut host = PeerSocket::listen(&directory, "pair").unwrap();
        let found = directory.couplings();
        assert_eq!(found.iter().map(|found| found.name.as_str()).collect::<Vec<_>>(), ["pair"]);
        let mut bridges = [(); 2].map(|()| PeerSocket::join(&directory, &found[0]).unwrap());
        host.send(&dispatch(1));
        assert_eq!(bridges[0].receive(), Ok(None), "nobody has called yet");
        assert!(bridges[0].subscribe());
        bridges[1].send(&dispatch(7));
        assert_eq!(host.receive(), Ok(Some(dispatch(7))), "a call is no message");
        assert_eq!(host.receive(), Ok(None));
        host.send(&dispatch(2));
        for bridge in &mut bridges {
            assert_eq!(bridge.receive(), Ok(Some(dispatch(2))));
        }
        let [mut first, second] = bridges;
        drop(second);
        // At the first word to it; on Windows, once its file is looked at again.
        let is_forgotten = (0..100).any(|_| {
            std::thread::sleep(Duration::from_millis(1));
            host.send(&dispatch(3));
            host.peers.len() == 1
        });
        assert!(is_forgotten);
        drop(host);
        assert_eq!(directory.couplings(), []);
        assert!(!first.subscribe(), "the host is gone");
    }

    #[test]
    fn who_takes_nothing_delays_nobody() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        let mut host = PeerSocket::listen(&directory, "pair").unwrap();
        let mut stalled = PeerSocket::join(&directory, &directory.couplings()[0]).unwrap();
        assert!(stalled.subscribe());
        assert_eq!(host.receive(), Ok(None));
        // More than a socket of any system has room for, and sent well within the time after which a caller is forgotten.
        (0..600).for_each(|tick| host.send(&dispatch(tick)));
        assert_eq!(host.peers.len(), 1, "no room is no reason to forget it");
        assert_eq!(stalled.receive(), Ok(Some(dispatch(0))));
    }

    #[test]
    fn a_malformed_message_is_reported() {
        let scratch = tempfile::tempdir().unwrap();
        let directory = Directory::at(scratch.path().join("runs"));
        let mut host = PeerSocket::listen(&directory, "pair").unwrap();
        let stranger = Datagrams::bind(&scratch.path().join("stranger")).unwrap();
        for length in [1, 168, 175, 177, 5000] {
            stranger.send_to(&vec![7; length], host.path()).unwrap();
            assert!(matches!(host.receive(), Err(InvalidDispatch::Length(_))), "{length} bytes");
        }
    }
}
