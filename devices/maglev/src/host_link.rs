//! The host's end of a link: numbers what is asked, takes what is answered, keeps the newest.

use crate::protocol::description::PAGES;
use crate::protocol::{
    Answer, AnswerFrame, Description, Intake, Mode, Rejection, Rejections, Request, RequestFrame, Status,
};
use crate::transport::{Incoming, LinkLost, Transport};
use std::hash::{BuildHasher, RandomState};
use std::time::{Duration, Instant};

/// Answers taken in one look: a controller gives one for each request, so more is a backlog after a stop.
const ANSWERS_PER_LOOK: usize = 32;
/// How long a question that is not real-time waits before it is asked again.
const ASK_AGAIN: Duration = Duration::from_millis(20);

/// Why a question got no answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unanswered {
    /// There is no other side any more.
    Lost,
    /// Nothing was heard in time.
    Silent,
}

/// The newest status, and what it answers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Heard {
    pub(crate) status: Status,
    pub(crate) acknowledged: u32,
}

/// A link with its session.
pub(crate) struct HostLink {
    /// Nothing once the other side was found gone: the system gives the port's name to the next device only when this
    /// one is closed.
    transport: Option<Box<dyn Transport>>,
    sequence: u32,
    /// 0 until armed.
    session: u32,
    intake: Intake,
    newest: Option<Heard>,
}

impl HostLink {
    pub(crate) fn new(transport: Box<dyn Transport>) -> Self {
        Self { transport: Some(transport), sequence: 0, session: 0, intake: Intake::default(), newest: None }
    }

    /// Answers that were not used, by reason.
    pub(crate) fn rejections(&self) -> &Rejections {
        self.intake.rejections()
    }

    /// Sequence number of the newest request.
    pub(crate) fn sequence(&self) -> u32 {
        self.sequence
    }

    /// Sends a request. Real-time: bounded, no allocation; one call of the system.
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

    /// Takes what has arrived; the newest status that has not been taken yet. Real-time: bounded, no allocation.
    pub(crate) fn take(&mut self) -> Result<Option<Heard>, LinkLost> {
        for _ in 0..ANSWERS_PER_LOOK {
            match self.receive()? {
                Received::Nothing => break,
                Received::Status(heard) => self.newest = Some(heard),
                Received::Page(_) | Received::Rejected => {}
            }
        }
        Ok(self.newest.take())
    }

    /// The status that answers this request; nothing if it does not come in time. Spins: for hosts on a virtual clock.
    pub(crate) fn wait_for(&mut self, awaited: u32, patience: Duration) -> Result<Option<Heard>, LinkLost> {
        let started = Instant::now();
        loop {
            match self.take()? {
                Some(heard) if heard.acknowledged == awaited => return Ok(Some(heard)),
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

    /// Uses what came in, if it may be used.
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
            Answer::Status(status) => Received::Status(Heard { status, acknowledged: frame.acknowledged }),
            Answer::Description(page) => Received::Page(page),
        }
    }

    /// Asks until the answer satisfies, or time is over. Not real-time.
    fn ask<T>(
        &mut self,
        request: Request,
        patience: Duration,
        mut satisfies: impl FnMut(&Received, u32) -> Option<T>,
    ) -> Result<T, Unanswered> {
        let started = Instant::now();
        while started.elapsed() < patience {
            self.send(request, 0).map_err(|LinkLost| Unanswered::Lost)?;
            let asked = Instant::now();
            while let Some(rest) = ASK_AGAIN.checked_sub(asked.elapsed()) {
                let transport = self.transport.as_mut().ok_or(Unanswered::Lost)?;
                let incoming = transport.wait(rest).map_err(|LinkLost| Unanswered::Lost)?;
                let received = self.judge(&incoming);
                if let Some(answer) = satisfies(&received, self.sequence) {
                    return Ok(answer);
                }
            }
        }
        Err(Unanswered::Silent)
    }

    /// What the controller says about itself. Not real-time.
    pub(crate) fn describe(&mut self, patience: Duration) -> Result<Description, Unanswered> {
        let mut pages = Vec::new();
        for number in 0..PAGES {
            pages.push(self.ask(
                Request::Describe { page: number },
                patience,
                |received, _| match received {
                    Received::Page(page) if page.number() == number => Some(*page),
                    _ => None,
                },
            )?);
        }
        let pages = pages.try_into().ok().and_then(Description::from_pages);
        pages.ok_or(Unanswered::Silent)
    }

    /// Begins a session and takes off. Not real-time.
    pub(crate) fn take_off(
        &mut self,
        period_us: u32,
        watchdog_us: u32,
        patience: Duration,
    ) -> Result<Status, Unanswered> {
        // Whoever was here before is over; a fault is cleared by switching off.
        self.disarm(patience)?;
        self.session = nonce();
        self.ask_mode(Request::Arm { period_us, watchdog_us }, Mode::Armed, patience)?;
        self.ask_mode(Request::TakeOff, Mode::Levitating, patience)
    }

    /// Switches the coils off and ends the session; a link without another side is closed. Not real-time.
    pub(crate) fn disarm(&mut self, patience: Duration) -> Result<(), Unanswered> {
        let off = self.ask_mode(Request::Disarm, Mode::Disarmed, patience).map(|_| ());
        if off == Err(Unanswered::Lost) {
            self.transport = None;
        }
        self.session = 0;
        off
    }

    fn ask_mode(&mut self, request: Request, mode: Mode, patience: Duration) -> Result<Status, Unanswered> {
        self.ask(request, patience, |received, _| match received {
            Received::Status(heard) if heard.status.mode == mode => Some(heard.status),
            _ => None,
        })
    }
}

/// What a look at the link found.
#[derive(Clone, Copy, Debug)]
enum Received {
    Nothing,
    Rejected,
    Status(Heard),
    Page(crate::protocol::description::Page),
}

/// A number no host before has used, but by a chance of one in four thousand million; never 0.
fn nonce() -> u32 {
    #[allow(clippy::cast_possible_truncation)] // any 32 of its bits
    let random = RandomState::new().hash_one(std::process::id()) as u32;
    random.max(1)
}
