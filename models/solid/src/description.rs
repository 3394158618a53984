//! Description of a solid and its tool, from the parameters, and check of the combination.

use crate::parameters::{BodyChoice, ToolChoice, bond, resolution};
use crate::plate::PlateBox;
use crate::punch::{Bond, Outline};
use crate::remainder::{Resolution, Size};
use flotor_hal::{Refusal, Settings};

/// Touched body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// Block: top face about the origin, bottom clamped.
    Block(Size),
    /// Beam: free end about the origin, the end at `-length_m` along x clamped.
    Beam {
        /// Length, width and height, m.
        size_m: [f64; 3],
    },
    /// Half-space `z <= 0`.
    HalfSpace,
    /// Round cylinder: top about the origin, bottom clamped.
    Cylinder {
        /// Radius, m.
        radius_m: f64,
        /// Height, m.
        height_m: f64,
    },
    /// Mesh from a file; the origin is the middle of the touched face.
    File {
        /// Hash of the file's text and of the names of its faces.
        digest: u64,
    },
}

/// Tool that touches the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tool {
    /// Sphere without bond.
    Sphere {
        /// Radius of the sphere, m.
        radius_m: f64,
    },
    /// Equal spheres on one handle, without bond; several may be in contact at once.
    Spheres {
        /// Radius of each sphere, m.
        radius_m: f64,
        /// Number of spheres, two to four.
        count: usize,
        /// Distance between the centres of neighbours, m.
        spacing_m: f64,
    },
    /// Plate bonded to the whole of a face.
    Plate,
    /// Plate bonded to a face of a body of linear tetrahedra, for comparison.
    LinearPlate,
    /// Flat punch on part of the top face.
    Punch {
        /// Outline of the contact.
        outline: Outline,
        /// Bond to the surface.
        bond: Bond,
    },
}

impl Body {
    /// Returns the elements under a plate on a block or a beam; `None` for another body.
    pub(crate) fn plate_box(self) -> Option<PlateBox> {
        match self {
            Self::Beam { size_m: [x, y, z] } => Some(PlateBox {
                ends_m: [[-x, 0.0], [-0.5 * y, 0.5 * y], [-0.5 * z, 0.5 * z]],
                axis: 0,
                halves: [4, 2, 2],
                cells: [10, 2, 2],
            }),
            Self::Block(Size { half_x_m: x, half_y_m: y, height_m: z }) => {
                let ends_m = [[-x, x], [-y, y], [-z, 0.0]];
                Some(PlateBox { ends_m, axis: 2, halves: [2; 3], cells: [4; 3] })
            }
            Self::HalfSpace | Self::Cylinder { .. } | Self::File { .. } => None,
        }
    }
}

/// Solid with its tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Description {
    /// Touched body.
    pub body: Body,
    /// Tool that touches the body.
    pub tool: Tool,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Fineness of the preparation.
    pub resolution: Resolution,
}

impl Description {
    /// Reads and checks the parameters. `value`: current value by id; `mesh_digest`: hash of the mesh's text and names. Not
    /// real-time.
    ///
    /// # Errors
    /// A [`Refusal`] for a combination that is invalid or not supported.
    pub fn new(
        settings: &Settings<'_>,
        value: impl Fn(&str) -> f64,
        mesh_digest: u64,
    ) -> Result<Self, Refusal> {
        let metres = |id| value(id) * 1.0e-3;
        let size_m = [metres("size_x_mm"), metres("size_y_mm"), metres("size_z_mm")];
        let body = match BodyChoice::of(settings, "body") {
            BodyChoice::Block => Body::Block(Size {
                half_x_m: 0.5 * size_m[0],
                half_y_m: 0.5 * size_m[1],
                height_m: size_m[2],
            }),
            BodyChoice::Beam => Body::Beam { size_m },
            BodyChoice::Cylinder => {
                if settings.number("size_y_mm").is_some_and(|y| y * 1.0e-3 != size_m[0]) {
                    return Err(Refusal::parameter(
                        "a cylinder is round: omit `size_y_mm`, because `size_x_mm` is its diameter",
                    ));
                }
                Body::Cylinder { radius_m: 0.5 * size_m[0], height_m: size_m[2] }
            }
            BodyChoice::HalfSpace => Body::HalfSpace,
            BodyChoice::File => Body::File { digest: mesh_digest },
        };
        let radius_m = metres("tool_radius_mm");
        let bond = bond(settings);
        let punch = |outline| Tool::Punch { outline, bond };
        let more = settings.choice_or_default("tool_count");
        let mut tool = match ToolChoice::of(settings, "tool") {
            ToolChoice::Sphere if more == 0 => Tool::Sphere { radius_m },
            ToolChoice::Sphere => {
                Tool::Spheres { radius_m, count: 1 + more, spacing_m: metres("tool_spacing_mm") }
            }
            ToolChoice::Plate => Tool::Plate,
            ToolChoice::PunchRound => punch(Outline::Round { radius_m }),
            ToolChoice::PunchSquare => punch(Outline::Square { half_m: 0.5 * metres("tool_side_mm") }),
        };
        let is_sphere = matches!(tool, Tool::Sphere { .. } | Tool::Spheres { .. });
        if more > 0 && !is_sphere {
            return Err(Refusal::parameter(
                "`tool_count` is only for spheres: omit this parameter, or set tool = \"sphere\"",
            ));
        }
        if is_sphere && bond == Bond::Bonded && settings.number("bond").is_some() {
            return Err(Refusal::parameter(
                "a sphere is not bonded: omit `bond`, and set `friction` for a sphere that does not slide freely",
            ));
        }
        if bond == Bond::Frictionless && tool == Tool::Plate {
            return Err(Refusal::unsupported("a plate is bonded to its face: set bond = \"bonded\""));
        }
        let resolution = match resolution(settings) {
            Some(resolution) => resolution,
            None if tool == Tool::Plate && body.plate_box().is_some() => {
                tool = Tool::LinearPlate;
                Resolution::STANDARD
            }
            None => {
                return Err(Refusal::unsupported(
                    "resolution = \"linear-tetrahedra\" is available only for a plate on a block or a beam: \
                     set tool = \"plate\" and body = \"block\" or \"beam\", or choose another resolution",
                ));
            }
        };
        let description = Self { body, tool, poisson_ratio: value("poisson_ratio"), resolution };
        description.check()?;
        Ok(description)
    }

    fn check(&self) -> Result<(), Refusal> {
        let (extent_m, what) = match self.tool {
            Tool::Sphere { radius_m } | Tool::Spheres { radius_m, .. } => (radius_m, "`tool_radius_mm`"),
            Tool::Punch { outline: Outline::Round { radius_m }, .. } => (radius_m, "`tool_radius_mm`"),
            Tool::Punch { outline: Outline::Square { half_m }, .. } => (half_m, "half of `tool_side_mm`"),
            Tool::Plate | Tool::LinearPlate => (0.0, ""),
        };
        if let Tool::Spheres { radius_m, spacing_m, .. } = self.tool {
            self.check_spheres(radius_m, spacing_m)?;
        }
        let is_plate = matches!(self.tool, Tool::Plate | Tool::LinearPlate);
        let least_m = match self.body {
            Body::File { .. } => return Ok(()),
            Body::Beam { .. } if is_plate => return Ok(()),
            Body::HalfSpace if !is_plate => return Ok(()),
            Body::Beam { .. } | Body::HalfSpace => return Err(self.unfit()),
            Body::Cylinder { radius_m, height_m } => radius_m.min(height_m),
            Body::Block(size) => size.half_x_m.min(size.half_y_m).min(size.height_m),
        };
        let limit_m = 0.9 * least_m;
        if extent_m > limit_m {
            return Err(Refusal::parameter(format!(
                "{what} is {:.4} mm, but may be at most {:.4} mm for this body: reduce it, or increase the sizes of the \
                 body (`size_x_mm`, `size_z_mm`, for a block also `size_y_mm`)",
                extent_m * 1.0e3,
                below_mm(limit_m)
            )));
        }
        Ok(())
    }

    /// Returns the refusal of a body and a tool that do not fit.
    pub(crate) fn unfit(&self) -> Refusal {
        match self.body {
            Body::Beam { .. } => {
                Refusal::unsupported("a beam is loaded only by a plate at its end: set tool = \"plate\"")
            }
            _ => Refusal::parameter("a half-space has no face for a plate: choose another `tool` or `body`"),
        }
    }

    fn check_spheres(&self, radius_m: f64, spacing_m: f64) -> Result<(), Refusal> {
        let mm = |m: f64| m * 1.0e3;
        if spacing_m < 2.0 * radius_m {
            return Err(Refusal::parameter(format!(
                "`tool_spacing_mm` is {:.4} mm, but spheres of radius {:.4} mm (`tool_radius_mm`) need at \
                 least {:.4} mm, their diameter: reduce the radius, or increase the spacing",
                mm(spacing_m),
                mm(radius_m),
                mm(2.0 * radius_m)
            )));
        }
        match self.body {
            Body::HalfSpace | Body::Beam { .. } => Ok(()),
            Body::Block(Size { half_x_m, half_y_m, .. }) => {
                let least_m = half_x_m.min(half_y_m);
                // With four spheres the farthest centre is that far along an axis; with three a little farther.
                if 0.6 * spacing_m <= least_m {
                    return Ok(());
                }
                Err(Refusal::parameter(format!(
                    "`tool_spacing_mm` is {:.4} mm, but may be at most {:.4} mm for this face: reduce the \
                     spacing, or increase `size_x_mm` and `size_y_mm`",
                    mm(spacing_m),
                    below_mm(least_m / 0.6)
                )))
            }
            Body::Cylinder { .. } | Body::File { .. } => Err(Refusal::unsupported(
                "several spheres are only for a block or a half-space: omit `tool_count`, or choose another `body`",
            )),
        }
    }
}

/// Returns a limit in mm, rounded down to four digits: the stated value is permitted.
fn below_mm(limit_m: f64) -> f64 {
    (limit_m * 1.0e7 + 1.0e-6).floor() * 1.0e-4
}
