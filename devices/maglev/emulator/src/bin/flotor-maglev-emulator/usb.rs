//! Serves the controller as a USB device of this machine.

use super::{Arguments, tell};
use crate::plant::LoadedPlant;
use flotor_emulation::command_line::say;
use flotor_maglev_emulator::Emulator;
use flotor_maglev_emulator::gadget::{Gadget, Personality};
use std::error::Error;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// Timeout of one wait for a host.
const PATIENCE: Duration = Duration::from_secs(3600);

pub(crate) fn serve(
    emulator: &mut Emulator<LoadedPlant>,
    arguments: &Arguments,
    personality: Personality,
) -> Result<(), Box<dyn Error>> {
    let gadget = Gadget::plug_in(personality, &arguments.serial)?;
    say(&format!("listening usb {}", personality.address()));
    while gadget.is_plugged_in() {
        let Some(mut link) = gadget.wait_for_host(PATIENCE) else { continue };
        say(&format!("connected {}", personality.address()));
        emulator.serve(link.as_mut(), &AtomicBool::new(false), &mut tell);
        if arguments.once {
            break;
        }
    }
    Ok(())
}
