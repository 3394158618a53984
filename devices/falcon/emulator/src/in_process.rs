//! The device in the process of its host: the plugin's trait of a chip.

use crate::machine::Machine;
use flotor_falcon::chip::{Chip, ChipLost, Request};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// How long a read sleeps between two looks.
const NAP: Duration = Duration::from_micros(100);

/// A device that several hold: the plugin as a chip, and a test that looks at it.
#[derive(Clone, Debug)]
pub struct InProcess {
    machine: Arc<Mutex<Machine>>,
    started: Instant,
}

impl InProcess {
    /// Plugs it in.
    #[must_use]
    pub fn new(machine: Machine) -> Self {
        Self { machine: Arc::new(Mutex::new(machine)), started: Instant::now() }
    }

    /// The device.
    pub fn machine(&self) -> MutexGuard<'_, Machine> {
        self.machine.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Its time.
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
