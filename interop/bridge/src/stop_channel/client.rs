//! Member's end of a stop channel.

use super::{Content, MOST_BYTES, Nonce, StopChannel, StopMessage};
use crate::keys::Name;
use crate::link::{End, LinkOptions, open};
use crate::remote::Remote;
use crate::request::Request;
use std::io;
use std::net::{SocketAddr, ToSocketAddrs, UdpSocket};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Timeouts after a hello and after a press, before a new hello: in a flood, datagrams may be lost.
const HELLO_WAIT: Duration = Duration::from_millis(50);
const PRESS_WAIT: Duration = Duration::from_millis(300);
/// Timeout of the final reply, which includes the hosts' confirmation.
const ANSWER_WAIT: Duration = Duration::from_secs(5);
/// Grace period after the first confirmation: another endpoint may be a bridge of the same name that refuses.
const OTHERS_WAIT: Duration = Duration::from_secs(1);

/// Presses the emergency stop by datagrams and by a session in parallel; returns as soon as one path has succeeded.
///
/// # Errors
/// The causes as text, if neither path has succeeded.
pub fn press_both_ways(
    link: LinkOptions,
    datagrams: Option<StopChannel>,
    bridge: &Name,
) -> Result<(), String> {
    let (sender, outcomes) = channel();
    if let Some(stop) = datagrams {
        let (sender, bridge) = (sender.clone(), bridge.clone());
        std::thread::spawn(move || sender.send(press(&stop, &bridge)));
    }
    let bridge = bridge.clone();
    std::thread::spawn(move || {
        let session = open(&link, End::Visiting).and_then(|link| Remote::listen(&link, &bridge));
        let pressed = session.map_err(|error| error.to_string());
        sender.send(pressed.and_then(|remote| remote.requests().run(Request::EmergencyStop)))
    });
    let mut problems = Vec::new();
    for outcome in outcomes {
        match outcome {
            Ok(()) => return Ok(()),
            Err(problem) => problems.push(problem),
        }
    }
    Err(problems.join("; "))
}

/// Presses the emergency stop at a bridge of this name at each address, and waits for the replies.
///
/// # Errors
/// The cause as text: no reply, or a bridge does not confirm.
fn press(stop: &StopChannel, bridge: &Name) -> Result<(), String> {
    let (sender, answers) = channel();
    for address in &stop.addresses {
        let (sender, address, bridge, stop) =
            (sender.clone(), address.clone(), bridge.to_string(), stop.clone());
        std::thread::spawn(move || {
            let answer = press_at(&address, &bridge, &stop).map_err(|error| format!("{address}: {error}"));
            let _ = sender.send(answer);
        });
    }
    drop(sender);
    outcome(&answers)
}

/// Waits for the replies, after the first confirmation only for a grace period; succeeds with a confirmation and without a
/// refusal.
fn outcome(answers: &Receiver<Result<Option<String>, String>>) -> Result<(), String> {
    let mut until = Instant::now() + 2 * ANSWER_WAIT;
    let mut is_done = false;
    let mut problem = format!("no endpoint has replied within {} s", 2 * ANSWER_WAIT.as_secs());
    loop {
        match answers.recv_timeout(until.saturating_duration_since(Instant::now())) {
            Ok(Ok(Some(refused))) => return Err(refused),
            Ok(Ok(None)) => {
                is_done = true;
                until = until.min(Instant::now() + OTHERS_WAIT);
            }
            Ok(Err(error)) => problem = error,
            Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                return if is_done { Ok(()) } else { Err(problem) };
            }
        }
    }
}

/// Presses the emergency stop at one endpoint; returns the reason for a refusal, `None` on success.
fn press_at(address: &str, bridge: &str, stop: &StopChannel) -> io::Result<Option<String>> {
    let places: Vec<SocketAddr> = address.to_socket_addrs()?.collect();
    let of_family = |is_ipv4: bool, any: &str| {
        let places: Vec<SocketAddr> = places.iter().copied().filter(|at| at.is_ipv4() == is_ipv4).collect();
        (!places.is_empty()).then(|| UdpSocket::bind(any).map(|socket| (socket, places)))
    };
    let sockets = [of_family(true, "0.0.0.0:0"), of_family(false, "[::]:0")];
    let sockets: Vec<_> = sockets.into_iter().flatten().collect::<io::Result<_>>()?;
    for (socket, _) in &sockets {
        // The sockets are polled in turn.
        socket.set_read_timeout(Some(HELLO_WAIT / 4))?;
    }
    let message = |content| {
        let (bridge, member) = (bridge.to_owned(), stop.member.to_string());
        Nonce::new().map(|nonce| StopMessage { bridge, member, nonce, content })
    };
    let until = Instant::now() + ANSWER_WAIT;
    let mut pending = message(Content::Hello)?;
    // The bridge replies to each accepted press after the hosts have confirmed; any of these replies counts.
    let mut presses: Vec<Nonce> = Vec::new();
    while Instant::now() < until {
        let datagram = pending.sealed(&stop.keys).ok_or_else(|| {
            io::Error::other("the keys contain no stop key; create new keys with `flotor bridge keys`")
        })?;
        for (socket, places) in &sockets {
            for place in places {
                // Without a listener the next system call reports the error.
                let _ = socket.send_to(&datagram, place);
            }
        }
        let repeat = Instant::now()
            + if matches!(pending.content, Content::Press(_)) { PRESS_WAIT } else { HELLO_WAIT };
        let mut challenge = None;
        while challenge.is_none() && Instant::now() < repeat {
            let received = sockets.iter().find_map(|(socket, _)| receive(socket, stop));
            match received.map(|received| (received.nonce, received.content)) {
                Some((nonce, Content::Challenge(next))) if nonce == pending.nonce => challenge = Some(next),
                Some((nonce, Content::Answer(refused))) if presses.contains(&nonce) => return Ok(refused),
                _ => {}
            }
        }
        pending = match challenge {
            Some(challenge) => message(Content::Press(challenge))?,
            // A datagram was lost, or another member has used the challenge: restart with a hello.
            None => message(Content::Hello)?,
        };
        presses.extend(challenge.map(|_| pending.nonce));
    }
    Err(io::Error::other(format!("no reply by UDP within {} s", ANSWER_WAIT.as_secs())))
}

fn receive(socket: &UdpSocket, stop: &StopChannel) -> Option<StopMessage> {
    let mut datagram = [0; MOST_BYTES];
    let (length, _) = socket.recv_from(&mut datagram).ok()?;
    StopMessage::open(datagram.get(..length)?, &stop.keys)
}
