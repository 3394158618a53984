//! Parameters of the solid: schema, names of the choices, and values.

use crate::punch::Bond;
use crate::remainder::Resolution;
use flotor_hal::{Choices, Parameter, Settings, choices};

/// Declares the values of a choice with their names, in the order of the schema.
macro_rules! choice {
    ($(#[$doc:meta])* $name:ident { $($value:ident = $word:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(crate) enum $name { $($value),+ }

        impl $name {
            const WORDS: Choices = choices![$($word),+];

            /// Returns the value of the choice parameter `id`, or its default.
            pub(crate) fn of(settings: &Settings<'_>, id: &str) -> Self {
                settings.one_of(id, [$(Self::$value),+])
            }
        }
    };
}

choice! {
    /// Kind of the touched body.
    BodyChoice { Block = "block", Beam = "beam", Cylinder = "cylinder", HalfSpace = "half-space", File = "file" }
}
choice! {
    /// Kind of the tool.
    ToolChoice { Sphere = "sphere", Plate = "plate", PunchRound = "punch-round", PunchSquare = "punch-square" }
}

choice! {
    /// Unit of the coordinates of a mesh.
    Unit { Metre = "m", Millimetre = "mm" }
}
choice! {
    /// Meaning of the pose: displacement from home, or position of the sphere's centre in the frame of the mesh.
    Origin { Home = "home", Body = "body" }
}

const BONDS: Choices = choices!["bonded", "frictionless"];

/// Returns the bond of a punch.
pub(crate) fn bond(settings: &Settings<'_>) -> Bond {
    [Bond::Bonded, Bond::Frictionless][settings.choice_or_default("bond")]
}

const RESOLUTIONS: Choices = choices!["quick", "standard", "fine", "linear-tetrahedra"];

/// Returns the resolution; `None` for linear tetrahedra.
pub(crate) fn resolution(settings: &Settings<'_>) -> Option<Resolution> {
    [Some(Resolution::QUICK), Some(Resolution::STANDARD), Some(Resolution::FINE), None]
        [settings.choice_or_default("resolution")]
}

/// Numbers of spheres, from one.
const COUNTS: Choices = choices!["1", "2", "3", "4"];

/// Index of the only live parameter.
pub(crate) const YOUNGS_MODULUS: usize = 4;

pub(crate) const SCHEMA: &[Parameter] = &[
    Parameter::choice(
        "body",
        BodyChoice::WORDS,
        0,
        "Touched body; a block or a cylinder is clamped at the bottom, a beam at its end at -x",
    ),
    Parameter::real(
        "size_x_mm",
        "mm",
        1.0,
        2000.0,
        80.0,
        "Side along x of a block or a beam (default for a beam: 200 mm), diameter of a cylinder",
    ),
    Parameter::real(
        "size_y_mm",
        "mm",
        1.0,
        2000.0,
        80.0,
        "Side along y of a block or a beam (default for a beam: 40 mm)",
    ),
    Parameter::real(
        "size_z_mm",
        "mm",
        1.0,
        2000.0,
        80.0,
        "Side along z of a block or a beam (default for a beam: 40 mm), height of a cylinder",
    ),
    Parameter::real("youngs_modulus_pa", "Pa", 1.0, 1.0e9, 1.0e4, "Young's modulus").live(),
    Parameter::real("poisson_ratio", "1", 0.0, 0.49, 0.3, "Poisson's ratio"),
    Parameter::choice("tool", ToolChoice::WORDS, 0, "Tool: a sphere, or a punch or plate on a face"),
    Parameter::real("tool_radius_mm", "mm", 0.1, 500.0, 12.7, "Radius of the sphere or of the round punch"),
    Parameter::real("tool_side_mm", "mm", 0.1, 1000.0, 20.0, "Side of the square punch"),
    Parameter::choice(
        "tool_count",
        COUNTS,
        0,
        "Number of spheres on the handle: two along x, or the corners of a triangle or square",
    ),
    Parameter::real(
        "tool_spacing_mm",
        "mm",
        0.2,
        1000.0,
        30.0,
        "Distance between the centres of neighbouring spheres",
    ),
    Parameter::choice("bond", BONDS, 0, "Contact of a punch with the surface"),
    Parameter::real("friction", "1", 0.0, 10.0, 0.0, "Coefficient of friction of the sphere"),
    Parameter::choice(
        "resolution",
        RESOLUTIONS,
        1,
        "Fineness of elements and contact cells in the preparation, without effect on the time of a tick; \
         linear-tetrahedra: for comparison, only for a plate on a block or a beam",
    ),
    Parameter::file(
        "file",
        choices![],
        "Mesh for `body = \"file\"`: Gmsh 4.1 (.msh), 10-node tetrahedra or 20-node hexahedra",
    ),
    Parameter::text("fixed_face", "Name of the fixed physical surface of the mesh (default: fixed)"),
    Parameter::text(
        "touched_face",
        "Name of the touched physical surface of the mesh (default: touched; with origin = \"body\" all that is not fixed)",
    ),
    Parameter::choice("unit", Unit::WORDS, 0, "Unit of the coordinates of the mesh"),
    Parameter::choice(
        "origin",
        Origin::WORDS,
        0,
        "home: the pose is the displacement from first touch at the middle of the touched face; body: the pose is the \
         centre of the sphere in the frame of the mesh, and the sphere may touch all of the surface",
    ),
    Parameter::file(
        "materials",
        choices![],
        "Materials of the physical volumes of the mesh, for origin = \"body\": a TOML file with a table for each volume \
         (youngs_modulus_pa, poisson_ratio); the live youngs_modulus_pa scales all of them",
    ),
];

/// Returns the value of every parameter: from the settings, or the default. A beam has its own default sizes.
pub(crate) fn resolve(settings: &Settings<'_>) -> [f64; SCHEMA.len()] {
    let mut values = [0.0; SCHEMA.len()];
    let beam = BodyChoice::of(settings, "body") == BodyChoice::Beam;
    for (value, parameter) in values.iter_mut().zip(SCHEMA) {
        let id = parameter.id();
        let own = match id {
            "size_x_mm" if beam => Some(200.0),
            "size_y_mm" | "size_z_mm" if beam => Some(40.0),
            _ => None,
        };
        *value = settings.number(id).or(own).unwrap_or(parameter.default());
    }
    values
}
