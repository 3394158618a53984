//! Emulated device in the process of its host: implements the plugin's [`Chip`] trait.

use crate::machine::Machine;
use flotor_falcon::chip::{Chip, ChipLost, Request};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Poll interval of a read.
const NAP: Duration = Duration::from_micros(100);

/// Shared handle of an emulated device: the plugin uses it as a chip, and a test inspects it. Clones share the device.
#[derive(Clone, Debug)]
pub struct InProcess {
    machine: Arc<Mutex<Machine>>,
    started: Instant,
}

impl InProcess {
    /// Wraps a device and starts its clock.
    #[must_use]
    pub fn new(machine: Machine) -> Self {
        Self { machine: Arc::new(Mutex::new(machine)), started: Instant::now() }
    }

    /// Locks the device and returns its state machine; every other use of the device waits until the guard is dropped.
    pub fn machine(&self) -> MutexGuard<'_, Machine> {
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the time since the device was wrapped: the clock of [`Machine`].
    #[must_use]
    pub fn now(&self) -> Duration {
        self.started.elapsed()
    }

    fn used(&self) -> Result<MutexGuard<'_, Machine>, ChipLost> {
        let machine = self.machine();
        if machine.is_gone() { Err(ChipLost) } else { Ok(machine) }
    }
}

impl Chip for InProcess {
    fn request(&self, request: Request, value: u16) -> Result<(), ChipLost> {
        self.used()?.request(request as u8, value).map(drop).ok_or(ChipLost)
    }

    fn write(&self, bytes: &[u8]) -> Result<(), ChipLost> {
        let now = self.now();
        self.used()?.output(bytes, now);
        Ok(())
    }

    fn read(&self, packets: &mut [u8], patience: Duration) -> Result<usize, ChipLost> {
        let until = Instant::now() + patience;
        loop {
            let packet = self.used()?.packet(self.now());
            if let Some(packet) = packet {
                packets.iter_mut().zip(&packet).for_each(|(place, byte)| *place = *byte);
                return Ok(packet.len().min(packets.len()));
            }
            if Instant::now() >= until {
                return Ok(0);
            }
            std::thread::sleep(NAP);
        }
    }
}
