//! Shapes of the models of a run, from instances of the viewer's own.
//!
//! The viewer loads the plugins a run names and asks them where their bodies are (extensions
//! `flotor.centerline/1` and `flotor.shape/1`). The servo never computes a shape, and a recording holds none: 65 sections at 60 Hz would
//! double it, and nothing but the recorded parameters could be shown (docs/src/adr/0008-viewer-process.md).

use flotor_core::mapping::Mapping;
use flotor_drawing::geometry::{Body, Curve, Strain};
use flotor_hal::abi::CallStatus;
use flotor_hal::abi::loader::{LoadError, Model, Plugin, Setting, read_metadata};
use flotor_hal::{DVec3, Form, Input, Pose};
use flotor_record::{PluginDescription, Role, RunDescription};
use std::path::{Path, PathBuf};

/// A model that can be drawn.
pub struct Shape {
    name: String,
    device: usize,
    model: Model,
    mapping: Mapping,
    rest: Rest,
}

/// What is known of a model's body at rest.
#[derive(Clone, Debug)]
pub enum Rest {
    /// A centreline.
    Slender(Body),
    /// Anything else.
    Solid(Extent),
}

/// How much room a body at rest takes, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extent {
    /// How far it reaches below home.
    pub below_m: f64,
    /// How far it reaches from the vertical axis through home.
    pub beside_m: f64,
}

impl Extent {
    /// Of a shape.
    #[must_use]
    pub fn of(shape: &flotor_hal::Shape) -> Self {
        let corners = shape.surface.vertices.iter().map(|vertex| DVec3::from_array(vertex.position_m));
        let primitives = shape.primitives.iter().flat_map(|primitive| {
            let (pose, half) = (primitive.pose(), DVec3::from_array(primitive.half_sides_m()));
            let half = if primitive.form() == Some(Form::Sphere) { half * 0.58 } else { half }; // 1 / root of 3
            [-1.0, 1.0].into_iter().flat_map(move |x| {
                [-1.0, 1.0].into_iter().flat_map(move |y| {
                    [-1.0, 1.0].map(|z| pose.position() + pose.orientation() * (half * DVec3::new(x, y, z)))
                })
            })
        });
        corners.chain(primitives).fold(Self::default(), |extent, place| Self {
            below_m: extent.below_m.max(-place.z),
            beside_m: extent.beside_m.max(place.truncate().length()),
        })
    }
}

/// A body at one pose of the handle.
#[derive(Clone, Debug)]
pub enum Posed {
    /// A slender one.
    Slender {
        /// Its centreline.
        curve: Curve,
        /// How it is strained against rest.
        strain: Strain,
    },
    /// Any other.
    Solid(flotor_hal::Shape),
}

/// Why a model is not drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// Nobody told where its plugin is.
    #[error("the plugin `{id}` of model `{name}` is not here; FLOTOR_PLUGIN_PATH adds folders")]
    NoPlugin {
        /// What the scene calls the model.
        name: String,
        /// Id of the plugin.
        id: String,
    },
    /// The plugin was refused, or says no.
    #[error(transparent)]
    Refused(#[from] LoadError),
    /// A recorded setting is none of this plugin's.
    #[error("model `{name}`: {problem}; the recording was made with another version of the plugin")]
    Setting {
        /// What the scene calls the model.
        name: String,
        /// What is wrong.
        problem: String,
    },
}

/// Makes everything of a run that has a shape; the rest is reported as text. Not real-time.
#[must_use]
pub fn shapes_of(run: &RunDescription, plugin_files: &[PathBuf]) -> (Vec<Shape>, Vec<ShapeError>) {
    let (mut shapes, mut errors) = (Vec::new(), Vec::new());
    for plugin in &run.plugins {
        let Role::Model(mapping) = &plugin.role else { continue };
        match Shape::load(plugin, Mapping::new(mapping), plugin_files) {
            Ok(shape) => shapes.extend(shape),
            Err(error) => errors.push(error),
        }
    }
    (shapes, errors)
}

/// The one of some plugin files that has an id; runs no code.
#[must_use]
pub fn file_of<'a>(plugin_files: &'a [PathBuf], id: &str) -> Option<&'a PathBuf> {
    plugin_files.iter().find(|file| read_metadata(file).is_ok_and(|metadata| metadata.id == id))
}

/// Loads a plugin file; runs its code.
///
/// # Errors
/// [`LoadError`], with file, cause and remedy.
#[allow(unsafe_code)] // listed in tests/tests/system/architecture.rs
pub fn load_file(file: &Path) -> Result<Plugin, LoadError> {
    // SAFETY: whoever watches a run guarantees for its plugins, which are those the host runs or that lie in folders of the
    // viewer's command line.
    unsafe { Plugin::load(file) }
}

impl Shape {
    /// The shape of a model of a run; none if it has none.
    fn load(
        description: &PluginDescription,
        mapping: Mapping,
        plugin_files: &[PathBuf],
    ) -> Result<Option<Self>, ShapeError> {
        let PluginDescription { name, id, .. } = description;
        let no_plugin = || ShapeError::NoPlugin { name: name.clone(), id: id.clone() };
        let plugin = load_file(file_of(plugin_files, id).ok_or_else(no_plugin)?)?;
        let parse = |(key, value): &(String, String)| {
            Setting::parse(plugin.parameters(), key, value)
                .map_err(|error| ShapeError::Setting { name: name.clone(), problem: error.to_string() })
        };
        let settings = description.settings.iter().map(parse).collect::<Result<Vec<_>, _>>()?;
        let mut model = plugin.create_model(&settings)?;
        let Some(rest) = rest(&mut model) else { return Ok(None) };
        Ok(Some(Self { name: name.clone(), device: usize::from(description.device), model, mapping, rest }))
    }

    /// What the scene calls the model.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of the device it is on.
    #[must_use]
    pub fn device(&self) -> usize {
        self.device
    }

    /// The body at rest.
    #[must_use]
    pub fn rest(&self) -> &Rest {
        &self.rest
    }

    /// How far beneath home the ground of this body is, m.
    #[must_use]
    pub fn ground_m(&self) -> f64 {
        /// A flat body stands so high above the ground, in radii.
        const FLAT: f64 = 0.8;
        match &self.rest {
            Rest::Slender(body) => body.rest_length_m,
            Rest::Solid(extent) => extent.below_m.max(FLAT * extent.beside_m),
        }
    }

    /// Height of a slender body that fills a picture as this one does, m.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        /// A wide body needs more room.
        const WIDE: f64 = 1.3;
        match &self.rest {
            Rest::Slender(body) => body.rest_length_m,
            Rest::Solid(_) => WIDE * self.ground_m(),
        }
    }

    /// Way from the device's frame to the model's.
    #[must_use]
    pub fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// Changes a live parameter of the viewer's instance; the drawn shape follows.
    pub fn set_parameter(&mut self, key: &str, number: f64) {
        if let Ok(setting) = Setting::number(self.model.parameters(), key, number) {
            self.model.set_parameter(setting.index(), setting.value());
            if let Some(rest) = rest(&mut self.model) {
                self.rest = rest;
            }
        }
    }

    /// The value in force of a parameter of the viewer's instance; `None` for what is no number.
    #[must_use]
    pub fn parameter(&mut self, index: usize) -> Option<f64> {
        let number = self.model.parameter(index);
        number.is_finite().then_some(number)
    }

    /// Whether a parameter may be set: one that refuses the value it has follows from others, or has no effect.
    ///
    /// # Errors
    /// What the plugin says.
    pub fn accepts_its_own(&mut self, index: usize) -> Result<(), String> {
        let Some(number) = self.parameter(index) else { return Err("it is no number".to_owned()) };
        match self.model.set_parameter(index, number) {
            CallStatus::Ok => Ok(()),
            _ => Err(self.model.last_message()),
        }
    }

    /// The body with the handle at a pose in the device frame; `None` where the model has no shape.
    #[must_use]
    pub fn at(&mut self, handle: &Pose) -> Option<Posed> {
        let input = Input::at_rest(self.mapping.pose_to_model(handle));
        match &self.rest {
            Rest::Slender(body) => {
                let points = body.info.suggested_points as usize;
                let curve = Curve::through(&self.model.centerline()?.points(&input, points)?)?;
                let strain = Strain::between(&body.rest, &curve);
                Some(Posed::Slender { curve, strain })
            }
            Rest::Solid(_) => self.model.shape(&input).ok().map(Posed::Solid),
        }
    }
}

/// The body of a model at rest, if it has a shape.
fn rest(model: &mut Model) -> Option<Rest> {
    let home = Input::at_rest(Pose::HOME);
    if model.has_shape() {
        return model.shape(&home).ok().map(|shape| Rest::Solid(Extent::of(&shape)));
    }
    /// Sections asked for: as many as the model suggests, within what can be drawn well.
    const SECTIONS: std::ops::RangeInclusive<u32> = 17..=1025;
    let mut shape = model.centerline()?;
    let mut info = shape.info()?;
    info.suggested_points = info.suggested_points.clamp(*SECTIONS.start(), *SECTIONS.end());
    let sections = shape.points(&home, info.suggested_points as usize)?;
    Body::new(info, &sections).map(Rest::Slender)
}
