//! Connections: one outstanding call, one write per frame, a timeout for every read.

use crate::ml_api::{
    Acknowledgement, Event, Frame, Function, Intake, ReadResult, Reply, Request, Results, Status,
};
use crate::platform::{reset_when_dropped, wait_for};
use crate::transport::{OpenError, tcp};
use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// Cause of a call without results.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum NoResults {
    /// The connection is lost.
    #[error("the controller closed the connection, or refused it")]
    Lost,
    /// No reply within the timeout.
    #[error("the controller did not answer in time")]
    Silent,
    /// The received frame is not a reply to the call.
    #[error("the controller sent a malformed reply")]
    Malformed,
    /// The controller rejected the call with this status.
    #[error("the controller rejected the request: {0}")]
    Refused(Status),
}

/// A connection with timed reads of whole frames.
pub(crate) struct Line {
    pub(crate) stream: TcpStream,
    intake: Intake,
}

impl Line {
    pub(crate) fn open(address: &str) -> Result<Self, OpenError> {
        let stream = tcp::open(address)?;
        // Reset when dropped, so that the controller detects the end of its client at once.
        reset_when_dropped(&stream);
        Ok(Self { stream, intake: Intake::default() })
    }

    /// Sends a frame. Real-time: bounded, no allocation; one system call.
    fn send(&mut self, frame: &Frame) -> Result<(), NoResults> {
        let sent = self.stream.write(frame.bytes());
        // A frame of a hundred bytes fits into an empty send buffer, or the other end has stopped reading.
        if sent.is_ok_and(|length| length == frame.bytes().len()) { Ok(()) } else { Err(NoResults::Lost) }
    }

    /// Reads the next whole frame into the buffer; false on timeout.
    fn take(&mut self, patience: Duration) -> Result<bool, NoResults> {
        let until = Instant::now() + patience;
        loop {
            match self.intake.take(&mut self.stream) {
                ReadResult::Frame(_) => return Ok(true),
                ReadResult::Lost => return Err(NoResults::Lost),
                ReadResult::Malformed => return Err(NoResults::Malformed),
                ReadResult::Nothing => {}
            }
            let rest = until.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return Ok(false);
            }
            wait_for(&self.stream, rest);
        }
    }
}

/// Control connection: one call at a time.
pub(crate) struct Control {
    line: Line,
    outstanding: Option<(Function, Instant)>,
    /// True after an error of the connection or a timeout of [`Self::call`]; no further call is then sent.
    pub(crate) is_lost: bool,
}

impl Control {
    pub(crate) fn new(line: Line) -> Self {
        Self { line, outstanding: None, is_lost: false }
    }

    /// Returns the start of the outstanding call, if any.
    pub(crate) fn outstanding_since(&self) -> Option<Instant> {
        self.outstanding.map(|(_, since)| since)
    }

    /// Sends a call without waiting. Real-time: bounded, no allocation.
    pub(crate) fn begin(&mut self, request: &Request) -> Result<(), NoResults> {
        if self.is_lost || self.outstanding.is_some() {
            return Err(NoResults::Lost);
        }
        let sent = self.line.send(&request.encode());
        self.outstanding = Some((request.function(), Instant::now()));
        self.keep(sent)
    }

    /// Receives the reply to the outstanding call within `budget`; `None` without an outstanding call, or if the reply does not
    /// arrive in time: the call then stays outstanding. Real-time: bounded, no allocation.
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

    /// Makes a call and returns its results. Not real-time.
    pub(crate) fn call(&mut self, request: &Request, patience: Duration) -> Result<Results, NoResults> {
        // A call left outstanding by a tick.
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

/// Callback connection, for events.
pub(crate) struct Events {
    line: Line,
}

impl Events {
    /// Opens a callback connection; returns it with the token from the controller. Not real-time.
    pub(crate) fn open(address: &str, patience: Duration) -> Result<(Self, i32), NoResults> {
        let line = Line::open(address).map_err(|_| NoResults::Lost)?;
        let mut asking = Control::new(line);
        let results = asking.call(&Request::Plain(Function::RequestToken), patience)?;
        let token = results.try_into().map_err(|_| NoResults::Malformed)?;
        Ok((Self { line: asking.line }, token))
    }

    /// Reads the next event; `None` without one within the budget, and for an unknown event, which is acknowledged as
    /// unhandled. Real-time: bounded, no allocation.
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

    /// Acknowledges an event. Real-time: bounded, no allocation.
    pub(crate) fn acknowledge(&mut self, value: Acknowledgement) -> Result<(), NoResults> {
        self.line.send(&value.encode())
    }
}
