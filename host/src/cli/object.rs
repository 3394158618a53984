//! Scene around a mesh file, for `flotor run --object` and `flotor new scene`.

use flotor_command::options::{KeyValue, PluginKeyValue, settings};
use flotor_command::{CommandError, while_preparing};
use flotor_hal::abi::PluginKind;
use flotor_hal::{DQuat, DVec3, Input, Pose};
use flotor_loader::Model;
use flotor_session::registry::Registry;
use std::path::Path;

/// Id of the model that touches a mesh.
pub(crate) const SURFACE: &str = "surface";
/// Distance of the top of the file's box below home, mm.
const BELOW_MM: f64 = 5.0;
/// Place of the tool while the shape is queried, m: far from any object.
const FAR_M: f64 = 9.0;

/// Scene around a mesh file.
pub(crate) struct ObjectScene {
    /// TOML text.
    pub(crate) text: String,
    /// Model that has read the file; while it exists, other instances need not read the file again.
    _reader: Model,
}

/// Writes the scene around a mesh file. `sets`: settings of the command line, of which those of the surface count here.
///
/// # Errors
/// [`CommandError`] for a missing plugin, a setting of no parameter, or a file that is not a mesh.
pub(crate) fn object_scene(
    file: &Path,
    sets: &[PluginKeyValue],
    registry: &Registry,
) -> Result<ObjectScene, CommandError> {
    let absolute =
        std::path::absolute(file).map_err(|cause| CommandError::file(file, "cannot read", cause))?;
    let path = absolute.to_str().ok_or_else(|| {
        CommandError::Usage(format!(
            "`{}`: the path is not UTF-8, as a scene requires; rename the file",
            file.display()
        ))
    })?;
    let plugin = registry.load(SURFACE, PluginKind::Model)?;
    let of_surface = |set: &PluginKeyValue| {
        let text = set.to_string();
        let own = text.strip_prefix(SURFACE)?.strip_prefix('.')?.parse::<KeyValue>();
        own.ok()
    };
    let mut values = vec![format!("file={path}").parse::<KeyValue>().map_err(CommandError::Usage)?];
    values.extend(sets.iter().filter_map(of_surface));
    let settings = settings(&plugin, "--set", &values)?;
    let mut model = while_preparing(SURFACE, || plugin.create_model(&settings))?;
    let far = Input::at_rest(Pose::new(DVec3::splat(FAR_M), DQuat::IDENTITY));
    let shape =
        model.shape(&far).map_err(|error| CommandError::PluginRefused(format!("`{SURFACE}`: {error}")))?;
    let ends =
        shape.surface.vertices.iter().fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], vertex| {
            let p = DVec3::from_array(vertex.position_m);
            [low.min(p), high.max(p)]
        });
    let middle_mm = (ends[0] + ends[1]) * 500.0;
    let place_mm = [-middle_mm.x, -middle_mm.y, -BELOW_MM - ends[1].z * 1.0e3];
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    Ok(ObjectScene { text: text(&name, path, place_mm), _reader: model })
}

/// Returns the text of the scene; positions to a nanometre.
fn text(name: &str, path: &str, place_mm: [f64; 3]) -> String {
    let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
    let place = place_mm.map(|x| format!("{:.6}", x + 0.0)).join(", ");
    format!(
        "# The object of a mesh file: the top of its box lies {BELOW_MM} mm below home.\n\
         title = {}\n\
         duration_s = 10\n\
         \n\
         [device]\n\
         plugin = \"simulated\"\n\
         \n\
         [device.parameters]\n\
         hand = \"oscillate\" # replace by the device in your hand, or push with the mouse in `flotor view`\n\
         hand_centre_mm = -4\n\
         hand_amplitude_mm = 3\n\
         hand_frequency_hz = 0.5\n\
         \n\
         [[model]]\n\
         plugin = \"{SURFACE}\"\n\
         \n\
         [model.parameters]\n\
         file = {}\n\
         \n\
         [model.mapping]\n\
         position_mm = [{place}]\n",
        quoted(name),
        quoted(path),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use flotor_session::scene::Scene;

    #[test]
    fn the_scene_of_any_name_is_read() {
        for name in ["duck.stl", "a \"b\".ply", "c\\d.obj", "é.glb"] {
            let text = text(name, name, [1.0, -2.5, -0.0]);
            let scene =
                Scene::parse(Path::new("object.toml"), &text).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!((scene.title.as_str(), scene.models.len()), (name, 1));
        }
    }
}
