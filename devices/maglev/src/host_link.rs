//! Host end of a link: numbers requests, validates replies, stores the newest status.

use crate::protocol::description::PAGES;
use crate::protocol::{
    Answer, AnswerFrame, Description, Intake, Mode, Rejection, Rejections, Request, RequestFrame, Status,
};
use crate::transport::{Incoming, LinkLost, Transport};
use std::hash::{BuildHasher, RandomState};
use std::time::{Duration, Instant};

/// Limit of replies read per tick: a controller sends one for each request, so more is a backlog after a stop.
const ANSWERS_PER_LOOK: usize = 32;
/// Retry interval of requests outside the real-time loop.
const ASK_AGAIN: Duration = Duration::from_millis(20);

/// Cause of a missing reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unanswered {
    /// The link broke.
    Lost,
    /// No reply within the timeout.
    Silent,
}

/// Status with the sequence number of the answered request.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AcknowledgedStatus {
    pub(crate) status: Status,
    pub(crate) acknowledged: u32,
}

/// A link with its session.
pub(crate) struct HostLink {
    /// `None` once the link is lost: the system gives the name of the port to the next device only after this one is
    /// closed.
    transport: Option<Box<dyn Transport>>,
    /// Sequence number of the newest request.
    pub(crate) sequence: u32,
    /// 0 until armed.
    session: u32,
    intake: Intake,
    newest: Option<AcknowledgedStatus>,
}

impl HostLink {
    pub(crate) fn new(transport: Box<dyn Transport>) -> Self {
        Self { transport: Some(transport), sequence: 0, session: 0, intake: Intake::default(), newest: None }
    }

    /// Returns the numbers of rejected replies, by reason.
    pub(crate) fn rejections(&self) -> &Rejections {
        self.intake.rejections()
    }

    /// Sends a request. Real-time: bounded, no allocation; one system call.
    pub(crate) fn send(&mut self, request: Request, time_us: u32) -> Result<(), LinkLost> {
        self.sequence = self.sequence.wrapping_add(1);
        let frame = RequestFrame {
            sequence: self.sequence,
            acknowledged: self.intake.last().unwrap_or(0),
            time_us,
            session: self.session,
            request,
        };
        self.transport.as_mut().ok_or(LinkLost)?.send(&frame.encode())
    }

    /// Reads pending replies, at most 32, and returns the newest status not returned before. Real-time: bounded, no allocation.
    pub(crate) fn take(&mut self) -> Result<Option<AcknowledgedStatus>, LinkLost> {
        for _ in 0..ANSWERS_PER_LOOK {
            match self.receive()? {
                Received::Nothing => break,
                Received::Status(newest) => self.newest = Some(newest),
                Received::Page(_) | Received::Rejected => {}
            }
        }
        Ok(self.newest.take())
    }

    /// Returns the status that answers the request `awaited`; `None` on timeout. Spins: for hosts on a virtual clock.
    pub(crate) fn wait_for(
        &mut self,
        awaited: u32,
        patience: Duration,
    ) -> Result<Option<AcknowledgedStatus>, LinkLost> {
        let started = Instant::now();
        loop {
            match self.take()? {
                Some(newest) if newest.acknowledged == awaited => return Ok(Some(newest)),
                _ if started.elapsed() > patience => return Ok(None),
                Some(_) => {}
                None => std::thread::yield_now(),
            }
        }
    }

    fn receive(&mut self) -> Result<Received, LinkLost> {
        let incoming = self.transport.as_mut().ok_or(LinkLost)?.receive()?;
        Ok(self.judge(&incoming))
    }

    /// Validates an incoming packet and decodes it.
    fn judge(&mut self, incoming: &Incoming) -> Received {
        let packet = match incoming {
            Incoming::Nothing => return Received::Nothing,
            Incoming::Malformed => {
                self.intake.reject(Rejection::Length);
                return Received::Rejected;
            }
            Incoming::Packet(packet) => packet,
        };
        let frame = match AnswerFrame::decode(packet) {
            Ok(frame) => frame,
            Err(rejection) => {
                self.intake.reject(rejection);
                return Received::Rejected;
            }
        };
        if !self.intake.accept(frame.sequence) {
            return Received::Rejected;
        }
        match frame.answer {
            Answer::Status(status) => {
                Received::Status(AcknowledgedStatus { status, acknowledged: frame.acknowledged })
            }
            Answer::Description(page) => Received::Page(page),
        }
    }

    /// Repeats a request until `satisfies` returns a value, or until the timeout. Not real-time.
    fn ask<T>(
        &mut self,
        request: Request,
        patience: Duration,
        mut satisfies: impl FnMut(&Received) -> Option<T>,
    ) -> Result<T, Unanswered> {
        let started = Instant::now();
        while started.elapsed() < patience {
            self.send(request, 0).map_err(|LinkLost| Unanswered::Lost)?;
            let asked = Instant::now();
            while let Some(rest) = ASK_AGAIN.checked_sub(asked.elapsed()) {
                let transport = self.transport.as_mut().ok_or(Unanswered::Lost)?;
                let incoming = transport.wait(rest).map_err(|LinkLost| Unanswered::Lost)?;
                let received = self.judge(&incoming);
                if let Some(answer) = satisfies(&received) {
                    return Ok(answer);
                }
            }
        }
        Err(Unanswered::Silent)
    }

    /// Requests the description of the controller. Not real-time.
    pub(crate) fn describe(&mut self, patience: Duration) -> Result<Description, Unanswered> {
        let mut pages = Vec::new();
        for number in 0..PAGES {
            pages.push(self.ask(
                Request::Describe { page: number },
                patience,
                |received| match received {
                    Received::Page(page) if page.number() == number => Some(*page),
                    _ => None,
                },
            )?);
        }
        let pages = pages.try_into().ok().and_then(Description::from_pages);
        pages.ok_or(Unanswered::Silent)
    }

    /// Disarms the controller, begins a session and starts the levitation; returns the first status in the mode Levitating. Not
    /// real-time.
    pub(crate) fn take_off(
        &mut self,
        period_us: u32,
        watchdog_us: u32,
        patience: Duration,
    ) -> Result<Status, Unanswered> {
        // Ends the session of an earlier host; disarming also clears a fault.
        self.disarm(patience)?;
        self.session = nonce();
        self.ask_mode(Request::Arm { period_us, watchdog_us }, Mode::Armed, patience)?;
        self.ask_mode(Request::TakeOff, Mode::Levitating, patience)
    }

    /// Switches the coils off and ends the session; closes a lost link. Not real-time.
    pub(crate) fn disarm(&mut self, patience: Duration) -> Result<(), Unanswered> {
        let off = self.ask_mode(Request::Disarm, Mode::Disarmed, patience).map(|_| ());
        if off == Err(Unanswered::Lost) {
            self.transport = None;
        }
        self.session = 0;
        off
    }

    fn ask_mode(&mut self, request: Request, mode: Mode, patience: Duration) -> Result<Status, Unanswered> {
        self.ask(request, patience, |received| match received {
            Received::Status(newest) if newest.status.mode == mode => Some(newest.status),
            _ => None,
        })
    }
}

/// Result of one read of the link.
#[derive(Clone, Copy, Debug)]
enum Received {
    Nothing,
    Rejected,
    Status(AcknowledgedStatus),
    Page(crate::protocol::description::Page),
}

/// Returns a random session number, never 0; the chance of a collision with an earlier host is 2⁻³².
fn nonce() -> u32 {
    #[allow(clippy::cast_possible_truncation)] // any 32 bits of the hash
    let random = RandomState::new().hash_one(std::process::id()) as u32;
    random.max(1)
}
