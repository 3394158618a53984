//! Conversion of couplings to messages of a recording, and back.

use crate::schema::{Coupling as CouplingMessage, CouplingEnd as EndMessage, Mapping, Missing, Passivity};
use flotor_core::coupling::{
    CouplingConfig, CouplingDescription, CouplingEnd, CouplingEnds, MAX_DELAY_TICKS,
};

impl From<&CouplingDescription> for CouplingMessage {
    fn from(description: &CouplingDescription) -> Self {
        let config = &description.config;
        let end = |end: &CouplingEnd| EndMessage {
            device: end.device.into(),
            mapping: Some(Mapping::new(&end.mapping)),
        };
        Self {
            name: description.name.clone(),
            stiffness_n_per_m: Some(config.stiffness_n_per_m),
            damping_ns_per_m: Some(config.damping_ns_per_m),
            stiffness_nm_per_rad: Some(config.stiffness_nm_per_rad),
            damping_nms_per_rad: Some(config.damping_nms_per_rad),
            delay_ticks: config.delay_ticks,
            reserve_j: Some(config.reserve_j),
            passivity: Passivity::from(config.passivity).into(),
            ends: description.ends.here().iter().map(end).collect(),
        }
    }
}

impl TryFrom<CouplingMessage> for CouplingDescription {
    type Error = Missing;

    fn try_from(message: CouplingMessage) -> Result<Self, Missing> {
        let config = CouplingConfig {
            stiffness_n_per_m: message.stiffness_n_per_m(),
            damping_ns_per_m: message.damping_ns_per_m(),
            stiffness_nm_per_rad: message.stiffness_nm_per_rad(),
            damping_nms_per_rad: message.damping_nms_per_rad(),
            delay_ticks: message.delay_ticks.min(MAX_DELAY_TICKS),
            reserve_j: message.reserve_j(),
            passivity: message.passivity().value().ok_or(Missing("coupling.passivity"))?,
        };
        let end = |end: &EndMessage| {
            let device = u16::try_from(end.device).map_err(|_| Missing("coupling.ends.device"))?;
            let mapping = end.mapping.ok_or(Missing("coupling.ends.mapping"))?.config()?;
            Ok(CouplingEnd { device, mapping })
        };
        let ends = match message.ends.as_slice() {
            [first, second] => CouplingEnds::Here([end(first)?, end(second)?]),
            [here] => CouplingEnds::Remote(end(here)?),
            _ => return Err(Missing("coupling.ends")),
        };
        Ok(Self { ends, config, name: message.name })
    }
}
