//! A control connection: one request, one reply.

use super::callback;
use super::hub::{Hub, Id};
use crate::ml_api::controller::{Answer, Ticket};
use crate::ml_api::misbehavior::Deed;
use flotor_emulation::clients::FIRST_MESSAGE;
use flotor_maglev::ml_api::{Frame, Function, Intake, Reply, Request, Results, Status, Taken};
use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// How late a reply comes that is to come late.
const STALL: Duration = Duration::from_secs(3);
/// How often a client that waits for a procedure is looked after.
const LOOK: Duration = Duration::from_millis(20);

/// Serves a connection until it is gone.
pub(super) fn serve(mut stream: TcpStream, hub: &Hub) {
    let from = stream.peer_addr().map_or_else(|_| "?".to_owned(), |address| address.to_string());
    let id = hub.connect(&from);
    let mut intake = Intake::default();
    let mut deadline = Some(Instant::now() + FIRST_MESSAGE);
    // Dropping the connection resets it.
    while let Taken::Frame(_) = intake.take(&mut Timed { stream: &mut stream, deadline }) {
        // A client may be silent for as long as it likes, but not in the middle of a request.
        deadline = intake.is_in_the_middle().then(|| Instant::now() + FIRST_MESSAGE);
        let request = Request::decode(intake.frame());
        if request == Ok(Request::Plain(Function::RequestToken)) {
            callback::serve(stream, hub, hub.becomes_callback(id));
            return;
        }
        if !call(&mut stream, hub, id, request) {
            break;
        }
    }
    // Before the connection is dropped: whoever sees it closed finds the flotor landing.
    hub.disconnect(id);
}

/// A connection from which a whole request is read before a deadline, which the first bytes of the request set where there is none.
struct Timed<'s> {
    stream: &'s mut TcpStream,
    deadline: Option<Instant>,
}

impl Read for Timed<'_> {
    fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
        let left = self.deadline.map(|deadline| deadline.saturating_duration_since(Instant::now()));
        if left.is_some_and(|left| left.is_zero()) {
            return Err(ErrorKind::TimedOut.into());
        }
        self.stream.set_read_timeout(left)?;
        let read = self.stream.read(room)?;
        self.deadline.get_or_insert_with(|| Instant::now() + FIRST_MESSAGE);
        Ok(read)
    }
}

/// Handles one request; false if the connection is to be dropped.
fn call(
    stream: &mut TcpStream,
    hub: &Hub,
    id: Id,
    request: Result<Request, flotor_maglev::ml_api::Unreadable>,
) -> bool {
    let handled = hub.handle(id, request);
    let reply = match handled.answer {
        Answer::Now(reply) => reply,
        Answer::When(ticket) => match wait(stream, hub, ticket) {
            Some(reply) => reply,
            None => return false,
        },
    };
    let frame = reply.encode();
    match handled.deed {
        Deed::Answer | Deed::Status(_) => send(stream, frame.bytes()),
        Deed::Silence => true,
        Deed::HalfFrame => send(stream, frame.bytes().get(..frame.bytes().len() / 2).unwrap_or_default()),
        Deed::Close => {
            let _ = stream.shutdown(Shutdown::Both);
            false
        }
        Deed::Reset => false,
        Deed::Stall => {
            std::thread::sleep(STALL);
            send(stream, frame.bytes())
        }
        Deed::WrongLength => send(stream, &shortened(&frame)),
    }
}

/// The reply of a procedure; nothing if its client does not wait for it any more.
fn wait(stream: &TcpStream, hub: &Hub, ticket: Ticket) -> Option<Reply> {
    loop {
        if let Some(reply) = hub.wait_for_reply(ticket, LOOK) {
            return Some(reply);
        }
        if is_gone(stream) {
            return None;
        }
    }
}

/// True if the other end has closed the connection, or it is broken.
pub(super) fn is_gone(stream: &TcpStream) -> bool {
    let looked = stream.set_nonblocking(true).and_then(|()| stream.peek(&mut [0]));
    let gone = match looked {
        Ok(length) => length == 0,
        Err(error) => !matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted),
    };
    gone || stream.set_nonblocking(false).is_err()
}

/// One write a frame: what is collected for a second one would wait for an acknowledgement.
pub(super) fn send(stream: &mut TcpStream, bytes: &[u8]) -> bool {
    stream.write_all(bytes).is_ok()
}

/// A frame without its last four bytes, with a length that says so.
fn shortened(frame: &Frame) -> Vec<u8> {
    let kept = frame.bytes().len().saturating_sub(4);
    let mut bytes = frame.bytes().get(..kept).unwrap_or_default().to_vec();
    if let (Some(head), Ok(length)) = (bytes.first_chunk_mut(), u32::try_from(kept)) {
        *head = length.to_le_bytes();
    }
    bytes
}

/// The reply to a client that asks for a token.
pub(super) fn token_reply(token: Id) -> Frame {
    let token = i32::try_from(token).unwrap_or(i32::MAX);
    Reply { status: Status::OK, results: Results::Token(token) }.encode()
}
