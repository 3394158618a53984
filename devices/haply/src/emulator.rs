//! Emulated board without hardware: replies as the maker's firmware does; a rigid hand holds the handle. Not real-time.

use crate::pantograph::Pantograph;
use crate::protocol::{Arm, Request, answer};
use flotor_hal::glam::DVec2;

/// Emulated board with its linkage and a held handle.
#[derive(Clone, Debug)]
pub struct EmulatedBoard {
    linkage: Pantograph,
    handle_m: DVec2,
    arms: Option<[Arm; 2]>,
    torques_nm: [f64; 2],
    received: Vec<u8>,
}

impl EmulatedBoard {
    /// Creates a board whose handle is held at a position in the board's frame, m. A host must configure the arms first.
    #[must_use]
    pub fn new(linkage: Pantograph, handle_m: DVec2) -> Self {
        Self { linkage, handle_m, arms: None, torques_nm: [0.0; 2], received: Vec::new() }
    }

    /// Moves the handle to a position in the board's frame, m.
    pub fn move_handle(&mut self, handle_m: DVec2) {
        self.handle_m = handle_m;
    }

    /// Processes received bytes and returns the replies; requests may be split between calls.
    pub fn receive(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.received.extend_from_slice(bytes);
        let mut said = Vec::new();
        loop {
            match Request::parse(&self.received) {
                Ok(None) => return said,
                Ok(Some((request, length))) => {
                    self.received.drain(..length);
                    said.extend(self.execute(request));
                }
                Err(length) => drop(self.received.drain(..length)),
            }
        }
    }

    fn execute(&mut self, request: Request) -> Vec<u8> {
        match request {
            Request::Reset => (self.arms, self.torques_nm) = (None, [0.0; 2]),
            Request::Setup(arms) => self.arms = Some(arms),
            Request::Torques(torques_nm) => {
                // Without configured arms the board does not reply.
                if self.arms.is_some()
                    && let Some(angles_rad) = self.linkage.angles_rad(self.handle_m)
                {
                    self.torques_nm = torques_nm.map(f64::from);
                    #[allow(clippy::cast_possible_truncation)] // f32 is what the board has
                    return answer(angles_rad.map(|angle| angle.to_degrees() as f32)).to_vec();
                }
            }
        }
        Vec::new()
    }

    /// Returns the configured arms; `None` before a setup request.
    #[must_use]
    pub fn arms(&self) -> Option<&[Arm; 2]> {
        self.arms.as_ref()
    }

    /// Returns the force of the motors on the hand in the board's frame, N; `None` where the linkage has no posture.
    #[must_use]
    pub fn force_n(&self) -> Option<DVec2> {
        let posture = self.linkage.posture(self.linkage.angles_rad(self.handle_m)?)?;
        Some(posture.force_n(self.torques_nm))
    }
}
