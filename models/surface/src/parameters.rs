//! Parameters of the surface.

use crate::object::{Reading, Unit};
use flotor_hal::{Choices, Parameter, Settings, choices};

const UNITS: Choices = choices!["auto", "m", "mm", "inch"];
const TOOLS: Choices = choices!["ball"];
const BUILT_IN: Choices = choices!["bumpy-sphere", "torus"];

/// Index of the first live parameter; the others follow it in the order of a material.
pub(crate) const FIRST_LIVE: usize = 0;

/// Parameters of the surface.
pub(crate) const SCHEMA: &[Parameter] = &[
    Parameter::real("stiffness_n_per_m", "N/m", 0.0, 1.0e6, 1000.0, "Stiffness of the surface").live(),
    Parameter::real("damping_ns_per_m", "N s/m", 0.0, 1000.0, 0.0, "Damping along the normal, in contact")
        .live(),
    Parameter::real("static_friction", "1", 0.0, 10.0, 0.0, "Coefficient of static friction").live(),
    Parameter::real(
        "kinetic_friction",
        "1",
        0.0,
        10.0,
        0.0,
        "Coefficient of kinetic friction, at most the static coefficient (default: the static coefficient)",
    )
    .live(),
    Parameter::real(
        "viscous_ns_per_m",
        "N s/m",
        0.0,
        1000.0,
        0.0,
        "Viscous friction along the surface, in contact",
    )
    .live(),
    Parameter::file(
        "file",
        BUILT_IN,
        "Mesh file (STL, OBJ, PLY, GLB), or a built-in object, with its top 2 mm below home (default: bumpy-sphere)",
    ),
    Parameter::choice(
        "unit",
        UNITS,
        0,
        "Unit of the coordinates in the file; auto: m for GLB and for objects up to a size of 3, else mm",
    ),
    Parameter::real("scale", "1", 1.0e-6, 1.0e6, 1.0, "Scale factor of the object"),
    Parameter::choice("tool", TOOLS, 0, "Tool; the pose is its centre, in the frame of the file"),
    Parameter::real("tool_radius_mm", "mm", 0.0, 100.0, 0.5, "Radius of the ball; 0 is a point"),
    Parameter::real(
        "edge_angle_deg",
        "deg",
        0.0,
        180.0,
        30.0,
        "Angle between two faces above which their common edge is sharp; below, the surface is smooth there",
    ),
    Parameter::file(
        "materials",
        choices![],
        "Materials by group of the mesh: a TOML file with a table for each",
    ),
];

/// Returns the import options of the mesh file.
pub(crate) fn reading(settings: &Settings<'_>) -> Reading {
    Reading {
        unit: settings.one_of("unit", [Unit::Auto, Unit::Metre, Unit::Millimetre, Unit::Inch]),
        scale: settings.number_or_default("scale"),
        edge_angle_rad: settings.number_or_default("edge_angle_deg").to_radians(),
    }
}
