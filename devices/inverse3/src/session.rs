//! Session of the service: opened with settings that are read back, then one sample per force.

use crate::foreign::ForeignForce;
use crate::message::{self, Chosen, Grip, Inventory, Sample};
use crate::session_error::SessionError;
use crate::socket::Socket;
use flotor_hal::DVec3;
use std::time::Duration;

/// Timeout of the replies that open a session.
const PATIENCE: Duration = Duration::from_secs(3);
/// Buffer size of a command, bytes: the longest has some 200.
const MESSAGE_BYTES: usize = 512;

/// Configuration of a session.
#[derive(Clone, Debug, PartialEq)]
pub struct Request {
    /// `host:port` of the service.
    pub address: String,
    /// Id of the arm, in upper or lower case; `None` for the only arm of the service.
    pub arm: Option<String>,
    /// Selection of the grip.
    pub grip: GripRequest,
    /// Gain of the service's force gate, 0 to 1.
    pub force_gate: f64,
    /// Timeout of a reply from the service; a missing reply is a fault.
    pub timeout: Duration,
    /// Largest deviation of a component of the exerted force from the range of this session's recent commands, N; a larger
    /// deviation is a fault.
    pub foreign_force_n: f64,
}

/// Selection of a grip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum GripRequest {
    /// The only grip, or none if the service has none.
    OnlyOne,
    /// No grip.
    None,
    /// The grip with this id, in upper or lower case.
    Named(String),
}

/// Open session with its selected devices.
#[derive(Debug)]
pub struct Session {
    socket: Socket,
    chosen: Chosen,
    message: Vec<u8>,
    foreign: ForeignForce,
}

impl Session {
    /// Opens a session, changes the settings and reads them back. Not real-time.
    ///
    /// # Errors
    /// One sentence with the cause and the remedy.
    pub fn open(request: &Request) -> Result<Self, String> {
        let address = &request.address;
        let of_service = |cause: String| format!("the Inverse Service at {address}: {cause}");
        let mut socket = Socket::connect(address, PATIENCE).map_err(|cause| {
            of_service(format!(
                "{cause}; check `address`, and start Haply's service, or `flotor emulate haply-service` (on Linux) without hardware"
            ))
        })?;
        let mut talk = |text: &str| {
            if !text.is_empty() {
                socket.send(text.as_bytes())?;
            }
            socket.receive().map(<[u8]>::to_vec)
        };
        let failed = |error: SessionError| of_service(error.to_string());
        // The service sends the first message.
        let first = talk("").map_err(failed)?;
        let inventory = message::inventory(&first).map_err(|malformed| failed(malformed.into()))?;
        let chosen = choose(request, &inventory).map_err(of_service)?;
        let reported = talk(&message::configure(&chosen, request.force_gate)).map_err(failed)?;
        let wanted = message::settings(request.force_gate);
        if let Some((path, said)) = message::differing(&reported, &chosen.arm, &wanted).map_err(failed)? {
            return Err(of_service(format!(
                "`{}` of the device {} is {said}, and cannot be changed; the force on the hand would differ from the commanded force. End other programs that configure the device, and update the service to 3.5 or newer",
                path.join("."),
                chosen.arm
            )));
        }
        socket.set_patience(request.timeout).map_err(|error| of_service(error.to_string()))?;
        let message = Vec::with_capacity(MESSAGE_BYTES);
        Ok(Self { socket, chosen, message, foreign: ForeignForce::new(request.foreign_force_n) })
    }

    /// Returns the selected devices.
    #[must_use]
    pub fn chosen(&self) -> &Chosen {
        &self.chosen
    }

    /// Reads a sample without a command. Real-time except for the wait: no allocation.
    ///
    /// # Errors
    /// A [`SessionError`] of the connection or of the state.
    pub fn poll(&mut self) -> Result<Sample, SessionError> {
        self.socket.send(message::LOOK)?;
        message::sample(self.socket.receive()?, &self.chosen)
    }

    /// Commands a force on the hand, N, and waits for the sample of the reply. Real-time except for the wait: no allocation.
    ///
    /// # Errors
    /// A [`SessionError`]; call [`Self::end`] then, which removes the force.
    pub fn exchange(&mut self, force_n: DVec3) -> Result<Sample, SessionError> {
        message::force(&mut self.message, &self.chosen.arm, force_n);
        self.socket.send(&self.message)?;
        let sample = message::sample(self.socket.receive()?, &self.chosen)?;
        match self.foreign.is_there(force_n, sample.force_n) {
            true => Err(SessionError::ForeignForce),
            false => Ok(sample),
        }
    }

    /// Removes the force and ends the session, also after a fault.
    pub fn end(&mut self) {
        message::force(&mut self.message, &self.chosen.arm, DVec3::ZERO);
        // A closed connection has removed its force already.
        let _ = self.socket.send(&self.message);
        self.socket.close();
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.end();
    }
}

fn choose(request: &Request, Inventory { arms, grips }: &Inventory) -> Result<Chosen, String> {
    let listed = |ids: &[&str]| if ids.is_empty() { "none".to_owned() } else { ids.join(", ") };
    let ids: Vec<&str> = arms.iter().map(String::as_str).collect();
    let arm = match (&request.arm, arms.as_slice()) {
        (_, []) => return Err("the service has no device; connect a device and switch it on".to_owned()),
        (Some(named), _) => arms.iter().find(|id| id.eq_ignore_ascii_case(named)).ok_or_else(|| {
            format!(
                "the service has no device {named}; set `device` to the id of one of its devices: {}",
                listed(&ids)
            )
        })?,
        (None, [only]) => only,
        (None, _) => {
            return Err(format!(
                "the service has several devices ({}); set `device` to one of their ids",
                listed(&ids)
            ));
        }
    };
    let ids: Vec<&str> = grips.iter().map(|grip| grip.id.as_str()).collect();
    let grip = match (&request.grip, grips.as_slice()) {
        (GripRequest::None, _) | (GripRequest::OnlyOne, []) => None,
        (GripRequest::OnlyOne, [only]) => Some(only.clone()),
        (GripRequest::OnlyOne, _) => {
            return Err(format!(
                "the service has several grips ({}); set `grip` to one of their ids, or to `none` to use the \
                 arm without a grip",
                listed(&ids)
            ));
        }
        (GripRequest::Named(named), _) => {
            let found: Option<&Grip> = grips.iter().find(|grip| grip.id.eq_ignore_ascii_case(named));
            Some(found.cloned().ok_or_else(|| {
                format!(
                    "the service has no grip {named} (its grips: {}); connect the grip, or set `grip` to one of \
                     their ids, or to `none` to use the arm without a grip",
                    listed(&ids)
                )
            })?)
        }
    };
    Ok(Chosen { arm: arm.clone(), grip })
}
