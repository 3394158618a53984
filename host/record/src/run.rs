//! Description of a run, known before the run begins and sufficient to repeat it.

use crate::schema::{self, FORMAT, FORMAT_WITHOUT_SHARED, Mapping, Missing, Plugin, Run, Setting, Vector3};
use flotor_core::Clock;
use flotor_core::asynchronous::{ContactLimits, FieldTiming, StiffnessCap};
use flotor_core::coupling::CouplingDescription;
use flotor_core::mapping::{Blend, MappingConfig, PortConfig};
use flotor_hal::Demand;
use prost::Message;
use std::collections::BTreeMap;

/// Error of bytes that do not describe a run.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("invalid run description: {0}")]
pub struct InvalidRun(String);

/// Description of a run before its start.
#[derive(Clone, Debug, PartialEq)]
pub struct RunDescription {
    /// Version of the program that carried out the run.
    pub flotor_version: String,
    /// Requested loop rate, Hz.
    pub rate_hz: f64,
    /// Planned duration, s.
    pub duration_s: f64,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Clock of the loop: real or virtual.
    pub clock: Clock,
    /// The scene as written (TOML); the command line may have overridden rate, duration and settings.
    pub scene_toml: String,
    /// Plugins: devices first, then the models, both in the order of the scene.
    pub plugins: Vec<PluginDescription>,
    /// Couplings between devices.
    pub couplings: Vec<CouplingDescription>,
}

/// Plugin of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct PluginDescription {
    /// Name in the scene.
    pub name: String,
    /// Id of the plugin.
    pub id: String,
    /// Version of the plugin.
    pub version: String,
    /// File name of the library, without folders, which differ between machines.
    pub file: String,
    /// Role in the run.
    pub role: Role,
    /// Index of the device; for a model, the index of its device.
    pub device: u16,
    /// Home positions of a model in the device frame, m, one for each instance.
    pub places_m: Vec<[f64; 3]>,
    /// Further ports of a model whose one instance several devices share; empty for other plugins.
    pub shared_with: Vec<PortConfig>,
    /// Blending of a model with the other models.
    pub blend: Blend,
    /// Timing of an asynchronous model; `None` for other plugins.
    pub field: Option<FieldTiming>,
    /// Declared latency of a device, s; 0 for a model, and in recordings of earlier versions.
    pub latency_s: f64,
    /// Outputs of models that reach the hand at a device; force and torque for a model, and in recordings of earlier versions.
    pub at_hand: Demand,
    /// Settings of scene and command line, as written, in order; sufficient to repeat the run.
    pub settings: Vec<(String, String)>,
    /// All parameters with the values that the run used at its start, and path and hash of files that they name.
    pub parameters: Vec<(String, String)>,
}

/// Role of a plugin in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// Device, which provided the pose and received the wrench.
    Device,
    /// Model, which provided a wrench through this mapping.
    Model(MappingConfig),
}

impl RunDescription {
    /// Encodes the protobuf message `flotor.Run` of a recording. Not real-time.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.to_message().encode_to_vec()
    }

    /// Decodes a protobuf message `flotor.Run`. Not real-time.
    ///
    /// # Errors
    /// If the message cannot be decoded, has a later format, or is incomplete.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, InvalidRun> {
        let run = Run::decode(bytes).map_err(|cause| InvalidRun(cause.to_string()))?;
        if run.format > FORMAT {
            return Err(InvalidRun(format!(
                "format {} is not supported; this version reads formats up to {FORMAT}: update flotor",
                run.format
            )));
        }
        Self::from_message(run)
            .map_err(|Missing(field)| InvalidRun(format!("the field `{field}` is missing or invalid")))
    }

    pub(crate) fn to_message(&self) -> Run {
        Run {
            format: self.format(),
            flotor_version: self.flotor_version.clone(),
            rate_hz: Some(self.rate_hz),
            duration_s: Some(self.duration_s),
            seed: self.seed,
            clock: schema::Clock::from(self.clock).into(),
            scene_toml: self.scene_toml.clone(),
            plugins: self.plugins.iter().map(PluginDescription::to_message).collect(),
            couplings: self.couplings.iter().map(Into::into).collect(),
        }
    }

    pub(crate) fn from_message(run: Run) -> Result<Self, Missing> {
        let clock = run.clock().value().ok_or(Missing("clock"))?;
        let (rate_hz, duration_s) = (run.rate_hz(), run.duration_s());
        let plugins = run.plugins.into_iter().map(PluginDescription::from_message);
        let couplings = run.couplings.into_iter().map(CouplingDescription::try_from);
        Ok(Self {
            rate_hz,
            duration_s,
            seed: run.seed,
            clock,
            flotor_version: run.flotor_version,
            scene_toml: run.scene_toml,
            plugins: plugins.collect::<Result<_, _>>()?,
            couplings: couplings.collect::<Result<_, _>>()?,
        })
    }

    /// Returns the format: the earlier one without shared models, so that earlier versions can read the recording.
    fn format(&self) -> u32 {
        let is_shared = self.plugins.iter().any(|plugin| !plugin.shared_with.is_empty());
        if is_shared { FORMAT } else { FORMAT_WITHOUT_SHARED }
    }

    /// Returns the devices, in the order of the scene.
    pub fn devices(&self) -> impl Iterator<Item = &PluginDescription> {
        self.plugins.iter().filter(|plugin| plugin.role == Role::Device)
    }

    /// Returns the description as keys and values, for tools that show the metadata of an MCAP file.
    pub(crate) fn to_metadata(&self) -> BTreeMap<String, String> {
        let mut texts = BTreeMap::from([
            ("format".to_owned(), self.format().to_string()),
            ("flotor_version".to_owned(), self.flotor_version.clone()),
            ("rate_hz".to_owned(), self.rate_hz.to_string()),
            ("duration_s".to_owned(), self.duration_s.to_string()),
            ("seed".to_owned(), self.seed.to_string()),
            ("clock".to_owned(), self.clock.word().to_owned()),
            ("scene_toml".to_owned(), self.scene_toml.clone()),
        ]);
        for plugin in &self.plugins {
            let facts = plugin.to_metadata();
            texts.extend(facts.into_iter().map(|(key, value)| (format!("{}.{key}", plugin.name), value)));
        }
        texts
    }
}

impl PluginDescription {
    fn to_message(&self) -> Plugin {
        let mapping = match &self.role {
            Role::Device => None,
            Role::Model(mapping) => Some(Mapping::new(mapping)),
        };
        Plugin {
            name: self.name.clone(),
            id: self.id.clone(),
            version: self.version.clone(),
            file: self.file.clone(),
            settings: to_settings(&self.settings),
            parameters: to_settings(&self.parameters),
            mapping,
            places: self.places_m.iter().copied().map(Vector3::new).collect(),
            blend: matches!(self.role, Role::Model(_)).then(|| schema::Blend {
                weight: Some(self.blend.weight),
                priority: self.blend.priority.into(),
                fade_s: Some(self.blend.fade_s),
            }),
            device: self.device.into(),
            field: self.field.map(|field| schema::FieldTiming {
                rate_hz: Some(field.rate_hz),
                latency_s: Some(field.latency_s),
                contacts: Some(schema::ContactLimits::from(field.contacts)),
            }),
            latency_s: matches!(self.role, Role::Device).then_some(self.latency_s),
            felt: match self.role {
                Role::Model(_) => schema::Felt::Unspecified,
                Role::Device if self.at_hand.contains(Demand::TORQUE) => schema::Felt::Wrench,
                Role::Device => schema::Felt::Force,
            }
            .into(),
            shared_with: self.shared_with.iter().map(schema::Port::from).collect(),
        }
    }

    fn from_message(plugin: Plugin) -> Result<Self, Missing> {
        let at_hand = match plugin.felt() {
            schema::Felt::Force => Demand::FORCE,
            schema::Felt::Wrench | schema::Felt::Unspecified => Demand::WRENCH,
        };
        let role = match plugin.mapping {
            None => Role::Device,
            Some(mapping) => Role::Model(mapping.config()?),
        };
        // Recordings from versions without places have each model at the device's home only.
        let places_m = match (role, plugin.places.as_slice()) {
            (Role::Model(_), []) => vec![[0.0; 3]],
            (_, places) => places.iter().map(|place| place.to_array()).collect(),
        };
        let blend = plugin.blend.map_or_else(Blend::default, |blend| Blend {
            weight: blend.weight(),
            priority: u8::try_from(blend.priority).unwrap_or(u8::MAX),
            fade_s: blend.fade_s(),
        });
        let field = plugin.field.map(|field| FieldTiming {
            rate_hz: field.rate_hz(),
            latency_s: field.latency_s(),
            // Recordings from versions without contacts have no limits of contacts.
            contacts: field.contacts.map_or(ContactLimits::UNKNOWN, ContactLimits::from),
        });
        Ok(Self {
            places_m,
            shared_with: plugin
                .shared_with
                .into_iter()
                .map(PortConfig::try_from)
                .collect::<Result<_, _>>()?,
            blend,
            device: u16::try_from(plugin.device).map_err(|_| Missing("plugin.device"))?,
            field,
            latency_s: plugin.latency_s.unwrap_or(0.0),
            at_hand,
            name: plugin.name,
            id: plugin.id,
            version: plugin.version,
            file: plugin.file,
            role,
            settings: from_settings(plugin.settings),
            parameters: from_settings(plugin.parameters),
        })
    }

    fn to_metadata(&self) -> Vec<(String, String)> {
        let mut texts = vec![
            ("id".to_owned(), self.id.clone()),
            ("version".to_owned(), self.version.clone()),
            ("file".to_owned(), self.file.clone()),
        ];
        if let Role::Model(mapping) = &self.role {
            texts.push(("mapping.rotation_xyzw".to_owned(), format!("{:?}", mapping.rotation_xyzw)));
            texts.push(("mapping.motion_scale".to_owned(), mapping.motion_scale.to_string()));
            texts.push(("mapping.force_scale".to_owned(), mapping.force_scale.to_string()));
            texts.extend(
                mapping.torque_scale.map(|scale| ("mapping.torque_scale".to_owned(), scale.to_string())),
            );
        }
        texts.extend(self.settings.iter().map(|(key, value)| (format!("settings.{key}"), value.clone())));
        texts.extend(self.parameters.iter().map(|(key, value)| (format!("parameters.{key}"), value.clone())));
        texts
    }
}

pub(crate) fn to_settings(pairs: &[(String, String)]) -> Vec<Setting> {
    pairs.iter().cloned().map(|(key, value)| Setting { key, value }).collect()
}

pub(crate) fn from_settings(settings: Vec<Setting>) -> Vec<(String, String)> {
    settings.into_iter().map(|setting| (setting.key, setting.value)).collect()
}

impl From<&PortConfig> for schema::Port {
    fn from(port: &PortConfig) -> Self {
        Self {
            device: port.device.into(),
            mapping: Some(Mapping::new(&port.mapping)),
            place: Some(Vector3::new(port.place_m)),
            contacts: port.contacts.map(schema::ContactLimits::from),
        }
    }
}

impl TryFrom<schema::Port> for PortConfig {
    type Error = Missing;

    fn try_from(port: schema::Port) -> Result<Self, Missing> {
        Ok(Self {
            device: u16::try_from(port.device).map_err(|_| Missing("plugin.shared_with.device"))?,
            mapping: port.mapping.ok_or(Missing("plugin.shared_with.mapping"))?.config()?,
            place_m: port.place.ok_or(Missing("plugin.shared_with.place"))?.to_array(),
            contacts: port.contacts.map(ContactLimits::from),
        })
    }
}

impl From<ContactLimits> for schema::ContactLimits {
    fn from(limits: ContactLimits) -> Self {
        Self {
            stiffness_n_per_m: limits.cap.map(|cap| cap.stiffness_n_per_m),
            per_damping_1_per_s: limits.cap.map(|cap| cap.per_damping_1_per_s),
            surface_power_w: Some(limits.surface_power_w),
            force_n: Some(limits.force_n),
            torque_nm: Some(limits.torque_nm),
            by_device_n_per_m: limits.cap.map(|cap| cap.by_device_n_per_m),
        }
    }
}

impl From<schema::ContactLimits> for ContactLimits {
    fn from(limits: schema::ContactLimits) -> Self {
        let cap = limits.stiffness_n_per_m.zip(limits.per_damping_1_per_s);
        Self {
            cap: cap.map(|(stiffness_n_per_m, per_damping_1_per_s)| StiffnessCap {
                stiffness_n_per_m,
                by_device_n_per_m: limits.by_device_n_per_m(),
                per_damping_1_per_s,
            }),
            surface_power_w: limits.surface_power_w(),
            force_n: limits.force_n(),
            torque_nm: limits.torque_nm(),
        }
    }
}
