//! Search for a device, its pair of endpoints, and the claim of its interface.

use crate::protocol::FRAME_BYTES;
use crate::transport::address::UsbAddress;
use rusb::{Context, Device, DeviceHandle, Direction, Error, TransferType, UsbContext};
use std::time::{Duration, Instant};

/// Timeout of a claim: the kernel may configure a device after its node appears (measured: up to 14 ms; udev rules take
/// longer).
const CLAIM_PATIENCE: Duration = Duration::from_secs(2);
const CLAIM_NAP: Duration = Duration::from_millis(10);
/// Pair of endpoints, with the interface and setting that select them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Endpoints {
    pub(super) interface: u8,
    pub(super) alternate: u8,
    pub(super) input: u8,
    pub(super) output: u8,
    pub(super) transfer: TransferType,
}

/// Finds and claims the device at an address.
pub(super) fn find(
    context: &Context,
    wanted: &UsbAddress,
) -> Result<(DeviceHandle<Context>, Endpoints), Error> {
    let mut problem = Error::NotFound;
    for device in context.devices()?.iter() {
        let descriptor = device.device_descriptor()?;
        if (descriptor.vendor_id(), descriptor.product_id()) != (wanted.vendor, wanted.product) {
            continue;
        }
        match claim(&device, wanted) {
            Ok(found) => return Ok(found),
            Err(error) => problem = error,
        }
    }
    Err(problem)
}

fn claim(device: &Device<Context>, wanted: &UsbAddress) -> Result<(DeviceHandle<Context>, Endpoints), Error> {
    let started = Instant::now();
    loop {
        let tried = try_claim(device, wanted);
        match tried {
            // Either not ready yet, or a lasting error: retry until the timeout.
            Err(Error::NotFound | Error::Busy | Error::Access) if started.elapsed() < CLAIM_PATIENCE => {
                std::thread::sleep(CLAIM_NAP);
            }
            settled => return settled,
        }
    }
}

fn try_claim(
    device: &Device<Context>,
    wanted: &UsbAddress,
) -> Result<(DeviceHandle<Context>, Endpoints), Error> {
    let handle = device.open()?;
    if let Some(serial) = &wanted.serial {
        let found = handle.read_serial_number_string_ascii(&device.device_descriptor()?)?;
        if found != *serial {
            return Err(Error::NoDevice);
        }
    }
    let endpoints = endpoints(device)?.ok_or(Error::NotSupported)?;
    // Detaches a generic driver of the kernel; where detaching is not supported, no such driver exists.
    let _ = handle.set_auto_detach_kernel_driver(true);
    handle.claim_interface(endpoints.interface)?;
    handle.set_alternate_setting(endpoints.interface, endpoints.alternate)?;
    Ok((handle, endpoints))
}

/// Returns the best pair of endpoints: interrupt before bulk, alternate settings before setting 0.
fn endpoints(device: &Device<Context>) -> Result<Option<Endpoints>, Error> {
    let configuration = device.active_config_descriptor()?;
    let settings = configuration.interfaces().flat_map(|interface| interface.descriptors());
    let pairs = settings.flat_map(|setting| {
        [TransferType::Interrupt, TransferType::Bulk].into_iter().filter_map(move |transfer| {
            let address = |direction| {
                let mut all = setting.endpoint_descriptors();
                let found = all.find(|endpoint| {
                    endpoint.direction() == direction
                        && endpoint.transfer_type() == transfer
                        && usize::from(endpoint.max_packet_size()) >= FRAME_BYTES
                });
                found.map(|endpoint| endpoint.address())
            };
            let (input, output) = (address(Direction::In)?, address(Direction::Out)?);
            let (interface, alternate) = (setting.interface_number(), setting.setting_number());
            Some(Endpoints { interface, alternate, input, output, transfer })
        })
    });
    Ok(pairs.min_by_key(|pair| (pair.transfer != TransferType::Interrupt, pair.alternate == 0)))
}
