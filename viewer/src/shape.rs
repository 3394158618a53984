//! Shapes of the models of a run, computed by the viewer's own model instances.
//!
//! The viewer loads the plugins of a run and queries their shapes (extensions `flotor.centerline/1` and `flotor.shape/1`). The
//! servo never computes a shape, and a recording contains no shape: 65 sections at 60 Hz would double its size, and only the
//! recorded parameters could be shown (docs/src/adr/0008-viewer-process.md).

use flotor_core::mapping::Mapping;
use flotor_drawing::geometry::{Body, Curve, Strain};
use flotor_hal::abi::CallStatus;
use flotor_hal::{DVec3, Form, Input, Pose};
use flotor_loader::{LoadError, Model, Plugin, Setting, read_metadata};
use flotor_record::{PluginDescription, Role, RunDescription};
use std::path::{Path, PathBuf};

/// Drawable model, with the viewer's own instance.
pub struct Shape {
    name: String,
    device: usize,
    model: Model,
    mapping: Mapping,
    rest: Rest,
}

/// Body of a model at rest.
#[derive(Clone, Debug)]
pub enum Rest {
    /// Slender body with a centreline.
    Slender(Body),
    /// Any other body, with its extent.
    Solid(Extent),
}

/// Extent of a body at rest, m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Extent {
    /// Depth of the lowest point below home.
    pub below_m: f64,
    /// Largest distance from the vertical axis through home.
    pub beside_m: f64,
}

impl Extent {
    /// Returns the extent of the vertices of a shape and of the corners of its primitives.
    #[must_use]
    pub fn of(shape: &flotor_hal::Shape) -> Self {
        let corners = shape.surface.vertices.iter().map(|vertex| DVec3::from_array(vertex.position_m));
        let primitives = shape.primitives.iter().flat_map(|primitive| {
            let (pose, half) = (primitive.pose(), DVec3::from_array(primitive.half_sides_m()));
            let half = if primitive.form() == Some(Form::Sphere) { half * 0.58 } else { half }; // 1 / square root of 3
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

/// Body at one pose of the handle.
#[derive(Clone, Debug)]
pub enum Posed {
    /// Slender body.
    Slender {
        /// Centreline.
        curve: Curve,
        /// Strain relative to the body at rest.
        strain: Strain,
    },
    /// Any other body.
    Solid(flotor_hal::Shape),
}

/// Reason why a model is not drawn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ShapeError {
    /// The plugin file of the model is unknown.
    #[error(
        "the plugin `{id}` of model `{name}` was not found; add its folder to FLOTOR_PLUGIN_PATH (recording), or put its file on this machine at the path that it has on the host's machine (running session)"
    )]
    NoPlugin {
        /// Name of the model in the scene.
        name: String,
        /// Id of the plugin.
        id: String,
    },
    /// The plugin cannot be loaded, or refuses the settings.
    #[error(transparent)]
    Refused(#[from] LoadError),
    /// A recorded setting does not fit the plugin.
    #[error("model `{name}`: {problem}; the run used another version of the plugin: use that version")]
    Setting {
        /// Name of the model in the scene.
        name: String,
        /// Description of the problem.
        problem: String,
    },
}

/// Creates the shapes of a run's models, with an error for each model that cannot be drawn. Not real-time.
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

/// Returns the plugin file with this id; runs no plugin code.
#[must_use]
pub fn file_of<'a>(plugin_files: &'a [PathBuf], id: &str) -> Option<&'a PathBuf> {
    plugin_files.iter().find(|file| read_metadata(file).is_ok_and(|metadata| metadata.id == id))
}

/// Loads a plugin file; runs plugin code.
///
/// # Errors
/// [`LoadError`], with file, cause and remedy.
#[allow(unsafe_code)] // listed in tests/tests/system/architecture.rs
pub fn load_file(file: &Path) -> Result<Plugin, LoadError> {
    // SAFETY: the user guarantees that the plugin is sound: the host runs the same file, or the viewer's command line names the
    // file.
    unsafe { Plugin::load(file) }
}

impl Shape {
    /// Loads the shape of a model of a run; `None` if the model has no shape.
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

    /// Returns the name of the model in the scene.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the number of the model's device.
    #[must_use]
    pub fn device(&self) -> usize {
        self.device
    }

    /// Returns the body at rest.
    #[must_use]
    pub fn rest(&self) -> &Rest {
        &self.rest
    }

    /// Returns the depth of the ground beneath home for this body, m.
    #[must_use]
    pub fn ground_m(&self) -> f64 {
        /// Height of a flat body above the ground, in radii.
        const FLAT: f64 = 0.8;
        match &self.rest {
            Rest::Slender(body) => body.rest_length_m,
            Rest::Solid(extent) => extent.below_m.max(FLAT * extent.beside_m),
        }
    }

    /// Returns the height for framing the body in a picture, m; for a wide body more than its own height.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        /// Ratio of the framing height to the depth of the ground, for a wide body.
        const WIDE: f64 = 1.3;
        match &self.rest {
            Rest::Slender(body) => body.rest_length_m,
            Rest::Solid(_) => WIDE * self.ground_m(),
        }
    }

    /// Returns the mapping from the device frame to the model frame.
    pub fn mapping(&self) -> &Mapping {
        &self.mapping
    }

    /// Sets a live parameter of the viewer's instance and updates the body at rest; ignores an unknown key and an invalid number.
    pub fn set_parameter(&mut self, key: &str, number: f64) {
        if let Ok(setting) = Setting::number(self.model.parameters(), key, number) {
            self.model.set_parameter(setting.index(), setting.value());
            if let Some(rest) = rest(&mut self.model) {
                self.rest = rest;
            }
        }
    }

    /// Returns the value of a parameter of the viewer's instance; `None` if the value is not a finite number.
    #[must_use]
    pub fn parameter(&mut self, index: usize) -> Option<f64> {
        let number = self.model.parameter(index);
        number.is_finite().then_some(number)
    }

    /// Checks that a parameter can be set: a parameter that refuses its own value follows from others, or has no effect.
    ///
    /// # Errors
    /// The plugin's message if the parameter cannot be set, or a message about a value that is not a number.
    pub fn accepts_its_own(&mut self, index: usize) -> Result<(), String> {
        let Some(number) = self.parameter(index) else {
            return Err(
                "the plugin returns no finite number as the value; report this to the author of the plugin"
                    .to_owned(),
            );
        };
        match self.model.set_parameter(index, number) {
            CallStatus::Ok => Ok(()),
            _ => Err(self.model.last_message()),
        }
    }

    /// Computes the body with the handle at a pose in the device frame; `None` if the model has no shape at this pose.
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

/// Computes the body of a model at rest; `None` if the model has no shape.
fn rest(model: &mut Model) -> Option<Rest> {
    let home = Input::at_rest(Pose::HOME);
    if model.has_shape() {
        return model.shape(&home).ok().map(|shape| Rest::Solid(Extent::of(&shape)));
    }
    /// Range for the number of sections: the model's suggestion, within limits for good pictures.
    const SECTIONS: std::ops::RangeInclusive<u32> = 17..=1025;
    let mut shape = model.centerline()?;
    let mut info = shape.info()?;
    info.suggested_points = info.suggested_points.clamp(*SECTIONS.start(), *SECTIONS.end());
    let sections = shape.points(&home, info.suggested_points as usize)?;
    Body::new(info, &sections).map(Rest::Slender)
}
