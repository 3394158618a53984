//! Models that several devices share: `shared = true`, and the mapping of each port.

use super::devices::{self, DeviceUse};
use super::reader::{Location, SceneError, Section};
use super::{Isolation, ModelUse, mapping};
use flotor_core::mapping::{MappingConfig, PortConfig};
use flotor_hal::MAX_PORTS;

/// Key `shared` of a model, with the mappings of single ports.
pub(super) struct Sharing {
    location: Location,
    own: Vec<OwnMapping>,
}

/// Device, scales and positions of a port with a mapping of its own.
type OwnMapping = (u16, MappingConfig, Vec<[f64; 3]>);

/// Reads `shared` and `[[model.port]]` of a model on the devices `on`; `None` if each device has an instance of its own.
pub(super) fn read(
    model: &mut Section<'_>,
    on: &[u16],
    devices: &[DeviceUse],
) -> Result<Option<Sharing>, SceneError> {
    let place = model.location();
    let shared = model.read("shared", |value| Ok((value.location.clone(), value.truth()?)))?;
    let ports = model.sections("port")?;
    let Some((location, true)) = shared else {
        let unused =
            "`model.port` is the port of a shared model: set `shared = true`, or write `[model.mapping]`";
        return if ports.is_empty() { Ok(None) } else { Err(place.problem(unused)) };
    };
    let is_twice = |device: &u16| on.iter().filter(|other| *other == device).count() > 1;
    if !(2..=MAX_PORTS).contains(&on.len()) || on.iter().any(is_twice) {
        return Err(location.problem(format!(
            "`model.shared` needs 2 to {MAX_PORTS} different devices: list them in `device`, or remove the key"
        )));
    }
    let mut own: Vec<OwnMapping> = Vec::new();
    for mut section in ports {
        let here = section.location();
        let device = devices::number(devices, section.require("device")?)?;
        let missing = section.missing("mapping");
        let (config, places_m) = mapping(section.section("mapping")?.ok_or(missing)?)?;
        section.finish()?;
        if !on.contains(&device) || own.iter().any(|(of, ..)| *of == device) {
            return Err(
                here.problem("each `model.port` needs a different device of the model; correct its `device`")
            );
        }
        own.push((device, config, places_m));
    }
    Ok(Some(Sharing { location, own }))
}

impl Sharing {
    /// Returns the model, shared by the devices `on`: each has the mapping of its port, or that of the model.
    pub(super) fn of(self, model: ModelUse, on: &[u16]) -> Result<ModelUse, SceneError> {
        let wrong = |problem: &str| Err(self.location.problem(problem));
        if model.isolation == Isolation::Process {
            return wrong("a shared model runs in the host process: remove `isolation`, or `shared`");
        }
        let mut ports = Vec::new();
        for device in on {
            let own = self.own.iter().find(|(of, ..)| of == device);
            let (mapping, places_m) =
                own.map_or((model.mapping, &model.places_m), |(_, mapping, places_m)| (*mapping, places_m));
            let [place_m] = places_m[..] else {
                return wrong(
                    "a shared model has one position on each device: remove `positions_mm` and `grid`",
                );
            };
            ports.push(PortConfig { device: *device, mapping, place_m, contacts: None });
        }
        let PortConfig { device, mapping, place_m, .. } = ports.remove(0); // there are two or more
        Ok(ModelUse { device, mapping, places_m: vec![place_m], shared_with: ports, ..model })
    }
}
