//! Connections: one call outstanding, one write a frame, a deadline for everything.

use crate::ml_api::{
    Acknowledgement, Event, Frame, Function, Intake, Reply, Request, Results, Status, Taken,
};
use crate::platform::{reset_when_dropped, wait_for};
use crate::transport::{OpenError, tcp};
use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Why a call has no results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NoResults {
    /// There is no other side any more.
    Lost,
    /// Nothing came in time.
    Silent,
    /// What came is no reply to that call.
    Malformed,
    /// The controller says why not.
    Refused(Status),
}

impl std::fmt::Display for NoResults {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Lost => f.write_str("the controller closed the connection"),
            Self::Silent => f.write_str("the controller did not answer in time"),
            Self::Malformed => f.write_str("the controller answered something that is no reply"),
            Self::Refused(status) => write!(f, "the controller refused: {status}"),
        }
    }
}

/// A connection that can be waited for.
pub(crate) struct Line {
    stream: TcpStream,
    intake: Intake,
}

impl Line {
    pub(crate) fn open(address: &str) -> Result<Self, OpenError> {
        let stream = tcp::open(address)?;
        // Reset when dropped: a controller whose client is gone is to know it at once.
        reset_when_dropped(&stream);
        Ok(Self { stream, intake: Intake::default() })
    }

    pub(crate) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Sends a frame. Real-time: bounded, no allocation; one call of the system.
    fn send(&mut self, frame: &Frame) -> Result<(), NoResults> {
        let sent = self.stream.write(frame.bytes());
        // A frame of a hundred bytes on a connection with nothing outstanding has room, or nobody reads.
        if sent.is_ok_and(|length| length == frame.bytes().len()) { Ok(()) } else { Err(NoResults::Lost) }
    }

    /// The next whole frame's bytes; nothing if it does not come in time.
    fn take(&mut self, patience: Duration) -> Result<bool, NoResults> {
        let until = Instant::now() + patience;
        loop {
            match self.intake.take(&mut self.stream) {
                Taken::Frame(_) => return Ok(true),
                Taken::Lost => return Err(NoResults::Lost),
                Taken::Malformed => return Err(NoResults::Malformed),
                Taken::Nothing => {}
            }
            let rest = until.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return Ok(false);
            }
            wait_for(&self.stream, rest);
        }
    }
}

/// The control connection.
pub(crate) struct Control {
    line: Line,
    outstanding: Option<(Function, Instant)>,
    is_lost: bool,
}

impl Control {
    pub(crate) fn new(line: Line) -> Self {
        Self { line, outstanding: None, is_lost: false }
    }

    /// True once a reply is overdue or the other side is gone: nothing is asked on it any more.
    pub(crate) fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// When the call was made that is not answered yet.
    pub(crate) fn outstanding_since(&self) -> Option<Instant> {
        self.outstanding.map(|(_, since)| since)
    }

    /// Makes a call without waiting. Real-time: bounded, no allocation.
    pub(crate) fn begin(&mut self, request: &Request) -> Result<(), NoResults> {
        if self.is_lost || self.outstanding.is_some() {
            return Err(NoResults::Lost);
        }
        let sent = self.line.send(&request.encode());
        self.outstanding = Some((request.function(), Instant::now()));
        self.keep(sent)
    }

    /// The reply to the call that was made; nothing if it does not come within the budget. Real-time: bounded, no allocation.
    pub(crate) fn finish(&mut self, budget: Duration) -> Result<Option<Reply>, NoResults> {
        let Some((function, _)) = self.outstanding else { return Ok(None) };
        let taken = self.line.take(budget);
        if !self.keep(taken)? {
            return Ok(None);
        }
        self.outstanding = None;
        let reply = Reply::decode(function, self.line.intake.frame()).ok_or(NoResults::Malformed);
        self.keep(reply).map(Some)
    }

    fn keep<T>(&mut self, result: Result<T, NoResults>) -> Result<T, NoResults> {
        self.is_lost |= result.is_err();
        result
    }

    /// A call and its results. Not real-time.
    pub(crate) fn call(&mut self, request: &Request, patience: Duration) -> Result<Results, NoResults> {
        // One that a tick left behind.
        if self.outstanding.is_some() && self.finish(patience)?.is_none() {
            return self.keep(Err(NoResults::Silent));
        }
        self.begin(request)?;
        match self.finish(patience)? {
            Some(Reply { status: Status::OK, results }) => Ok(results),
            Some(Reply { status, .. }) => Err(NoResults::Refused(status)),
            None => self.keep(Err(NoResults::Silent)),
        }
    }
}

/// The connection that carries events.
pub(crate) struct Events {
    line: Line,
}

impl Events {
    /// A new connection, with the token the controller gave it. Not real-time.
    pub(crate) fn open(address: &str, patience: Duration) -> Result<(Self, i32), NoResults> {
        let line = Line::open(address).map_err(|_| NoResults::Lost)?;
        let mut asking = Control::new(line);
        match asking.call(&Request::Plain(Function::RequestToken), patience)? {
            Results::Token(token) => Ok((Self { line: asking.line }, token)),
            _ => Err(NoResults::Malformed),
        }
    }

    /// The next event; nothing if there is none within the budget. Real-time: bounded, no allocation. What is no event is
    /// acknowledged as such, and the next one looked at.
    pub(crate) fn next(&mut self, budget: Duration) -> Result<Option<Event>, NoResults> {
        if !self.line.take(budget)? {
            return Ok(None);
        }
        let event = Event::decode(self.line.intake.frame());
        if event.is_none() {
            self.acknowledge(Acknowledgement::UNHANDLED)?;
        }
        Ok(event)
    }

    /// Answers an event. Real-time: bounded, no allocation.
    pub(crate) fn acknowledge(&mut self, value: Acknowledgement) -> Result<(), NoResults> {
        self.line.send(&value.encode())
    }
}
