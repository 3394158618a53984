//! Callback connection: sends an event and waits for its acknowledgement before the next one.

use super::connection::{is_gone, send};
use super::hub::Hub;
use super::state::{CallbackEnd, Id, Next};
use flotor_maglev::ml_api::{Event, Frame, Intake, ReadResult, Reply, Results};
use std::net::{Shutdown, TcpStream};
use std::time::Duration;

/// Poll interval for the end of a waiting connection.
const LOOK: Duration = Duration::from_millis(50);
/// Delay of a late tick, as an injected fault.
const LATE: Duration = Duration::from_millis(50);

/// Serves a callback connection after its token request, until its end.
pub(super) fn serve(mut stream: TcpStream, hub: &Hub, token: Id) {
    let ready = stream.set_read_timeout(Some(LOOK)).is_ok();
    if ready && send(&mut stream, token_reply(token).bytes()) {
        let end = tell(&mut stream, hub, token);
        if end == CallbackEnd::Close {
            let _ = stream.shutdown(Shutdown::Both);
        }
    }
    hub.callback_gone(token);
}

/// Sends events until the end of the connection.
fn tell(stream: &mut TcpStream, hub: &Hub, token: Id) -> CallbackEnd {
    let mut intake = Intake::default();
    loop {
        let event = match hub.next(token, LOOK) {
            Some(Next::Event(event)) => event,
            Some(Next::LateTick(event)) => {
                std::thread::sleep(LATE);
                event
            }
            Some(Next::End(CallbackEnd::Asked)) => Event::End,
            Some(Next::End(end)) => return end,
            None => {
                if is_gone(stream) {
                    return CallbackEnd::Gone;
                }
                continue;
            }
        };
        if !send(stream, event.encode().bytes()) {
            return CallbackEnd::Gone;
        }
        loop {
            match intake.take(stream) {
                // The handler's return value is ignored: no known effect depends on it.
                ReadResult::Frame(_) => break,
                ReadResult::Malformed | ReadResult::Lost => return CallbackEnd::Gone,
                ReadResult::Nothing => {
                    if let Some(end) = hub.is_over(token) {
                        return end;
                    }
                }
            }
        }
        hub.acknowledged(token);
        if event == Event::End {
            return CallbackEnd::Asked;
        }
    }
}

/// Returns the reply to a token request.
fn token_reply(token: Id) -> Frame {
    Reply::ok(Results::Token(i32::try_from(token).unwrap_or(i32::MAX))).encode()
}
