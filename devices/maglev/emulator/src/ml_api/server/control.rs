//! Control connection: one reply per request.

use super::callback;
use super::connection::{is_gone, send};
use super::hub::Hub;
use super::state::Id;
use crate::ml_api::controller::{Answer, ProcedureId};
use crate::ml_api::injected_fault::Deed;
use flotor_emulation::clients::FIRST_MESSAGE;
use flotor_maglev::ml_api::{Frame, Function, Intake, ReadResult, Reply, Request};
use std::io::{self, ErrorKind, Read};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Delay of a stalled reply, as an injected fault.
const STALL: Duration = Duration::from_secs(3);
/// Poll interval for the end of a client that waits for a procedure.
const LOOK: Duration = Duration::from_millis(20);

/// Serves a connection until its end.
pub(super) fn serve(mut stream: TcpStream, hub: &Hub) {
    let from = stream.peer_addr().map_or_else(|_| "?".to_owned(), |address| address.to_string());
    let id = hub.connect(&from);
    let mut intake = Intake::default();
    let mut deadline = Some(Instant::now() + FIRST_MESSAGE);
    // Dropping the connection resets it.
    while let ReadResult::Frame(_) = intake.take(&mut Timed { stream: &mut stream, deadline }) {
        // A client may be silent between requests without limit, but not within one.
        deadline = intake.has_partial_frame().then(|| Instant::now() + FIRST_MESSAGE);
        let request = Request::decode(intake.frame());
        if request == Ok(Request::Plain(Function::RequestToken)) {
            callback::serve(stream, hub, hub.becomes_callback(id));
            return;
        }
        if !call(&mut stream, hub, id, request) {
            break;
        }
    }
    // Before the connection is dropped: at its close the flotor is landing already.
    hub.disconnect(id);
}

/// A connection with a deadline per request; without one the first bytes of the request start the deadline.
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

/// Handles one request; returns false if the connection must be dropped.
fn call(
    stream: &mut TcpStream,
    hub: &Hub,
    id: Id,
    request: Result<Request, flotor_maglev::ml_api::InvalidRequest>,
) -> bool {
    let handled = hub.handle(id, request);
    let reply = match handled.answer {
        Answer::Now(reply) => reply,
        Answer::When(procedure_id) => match wait(stream, hub, procedure_id) {
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

/// Waits for the reply of a procedure; `None` if its client disconnects.
fn wait(stream: &TcpStream, hub: &Hub, procedure_id: ProcedureId) -> Option<Reply> {
    loop {
        if let Some(reply) = hub.wait_for_reply(procedure_id, LOOK) {
            return Some(reply);
        }
        if is_gone(stream) {
            return None;
        }
    }
}

/// Returns a frame without its last four bytes, with a matching length field.
fn shortened(frame: &Frame) -> Vec<u8> {
    let kept = frame.bytes().len().saturating_sub(4);
    let mut bytes = frame.bytes().get(..kept).unwrap_or_default().to_vec();
    if let (Some(head), Ok(length)) = (bytes.first_chunk_mut(), u32::try_from(kept)) {
        *head = length.to_le_bytes();
    }
    bytes
}
