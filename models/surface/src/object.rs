//! Conversion of a mesh file to a surface: unit, repair, and rejection of unsuitable meshes.

use crate::check::{Crossings, crossings};
use crate::files::{self, Problem};
use crate::normals::Normals;
use crate::soup::Soup;
use crate::surface::Surface;
use crate::topology::{OneSided, connect};
use crate::weld::{Welded, diagonal_m, weld};
use flotor_hal::DVec3;
use std::fmt;

/// Unit of the coordinates of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Guessed from format and size.
    Auto,
    /// Metres.
    Metre,
    /// Millimetres.
    Millimetre,
    /// Inches.
    Inch,
}

/// Import options of a mesh file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Unit of the coordinates.
    pub unit: Unit,
    /// Scale factor of the size.
    pub scale: f64,
    /// Angle between two faces above which their common edge is sharp, rad.
    pub edge_angle_rad: f64,
}

/// Surface of a file, with the remarks of the import.
#[derive(Clone, Debug, Default)]
pub struct Object {
    /// Smooth surface.
    pub surface: Surface,
    /// Names of the groups.
    pub names: Vec<String>,
    /// Guesses and repairs of the import, one sentence each.
    pub remarks: Vec<String>,
}

/// Reason why a mesh is rejected.
#[derive(Clone, Debug, PartialEq)]
pub enum Unfit {
    /// The file cannot be read.
    File(Problem),
    /// The surface is not orientable; position of the edge, m.
    OneSided(DVec3),
    /// No triangle of the mesh has an area.
    Empty,
    /// The object is too large for the workspace; its diagonal, m.
    TooLarge(f64),
}

/// Largest diagonal of an object, m: one metre of workspace to each side.
const LARGEST_M: f64 = 4.0;
/// Extent of a mesh above which its unit is guessed as millimetres: no object touched by hand is larger than this in metres.
const METRES_UP_TO: f64 = 3.0;

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(problem) => problem.fmt(f),
            Self::OneSided(at) => write!(
                f,
                "the surface is not orientable, like a Moebius strip: faces of opposite orientation meet at ({:.6} {:.6} {:.6}) m; \
                 cut the surface there, or remove the strip",
                at.x, at.y, at.z
            ),
            Self::Empty => f.write_str("no face of the mesh has an area; export the mesh again"),
            Self::TooLarge(size_m) => write!(
                f,
                "the object is {size_m:.3} m large (diagonal), above the limit of {LARGEST_M} m; set `unit` or `scale`"
            ),
        }
    }
}

impl From<Problem> for Unfit {
    fn from(problem: Problem) -> Self {
        Self::File(problem)
    }
}

/// Builds an object from the bytes of a file named `name`. Not real-time.
///
/// # Errors
/// [`Unfit`] with the place and the remedy.
pub fn read(name: &str, bytes: Vec<u8>, reading: &Reading) -> Result<Object, Unfit> {
    build(files::read(name, bytes)?, reading)
}

/// Builds an object from the triangles of a file. Not real-time.
///
/// # Errors
/// [`Unfit`] with the place and the remedy.
pub fn build(mut soup: Soup, reading: &Reading) -> Result<Object, Unfit> {
    let names = std::mem::take(&mut soup.names);
    let (metres, remark) = metres(&soup.points, soup.metres, reading.unit);
    let mut remarks: Vec<String> = remark.into_iter().collect();
    let (mut mesh, welded) = weld(soup, metres * reading.scale);
    if mesh.triangles.is_empty() {
        return Err(Unfit::Empty);
    }
    let size_m = diagonal_m(&mesh.points_m);
    if size_m > LARGEST_M {
        return Err(Unfit::TooLarge(size_m));
    }
    let topology = connect(&mut mesh).map_err(|OneSided(at_m)| Unfit::OneSided(at_m))?;
    describe(&welded, &mut remarks);
    let mut count = |number: usize, what: &str| {
        if number > 0 {
            remarks.push(format!("{number} {what}"));
        }
    };
    count(topology.turned, "faces reversed to the orientation of their neighbours");
    count(topology.crowded_edges, "edges with three or more faces, assigned to the bodies between the faces");
    let open = topology.components.iter().filter(|component| !component.is_closed).count();
    count(open, "open parts, which can be touched from both sides");
    let normals = Normals::new(&mesh, &topology, reading.edge_angle_rad);
    let surface = Surface::new(&mesh, &topology, &normals);
    let Crossings { count, first_m } = crossings(&surface);
    if let Some(at) = first_m {
        remarks.push(format!(
            "{count} pairs of faces intersect, the first at ({:.6} {:.6} {:.6}) m: a ball may be held on the \
             wrong face there; repair the mesh",
            at.x, at.y, at.z
        ));
    }
    Ok(Object { surface, names, remarks })
}

fn describe(welded: &Welded, remarks: &mut Vec<String>) {
    for (number, what) in [
        (welded.collapsed, "faces removed because two of their corners coincide"),
        (welded.doubled, "duplicate faces removed"),
        (welded.flipped, "faces without area removed"),
        (welded.closed, "points of borders merged over gaps of rounding errors"),
        (welded.unresolved, "points merged because their edge is too short for binary32"),
    ] {
        if number > 0 {
            remarks.push(format!("{number} {what}"));
        }
    }
}

/// Returns the length of a unit of the file, m, and a remark if it is a guess.
fn metres(points: &[[f64; 3]], of_format: Option<f64>, unit: Unit) -> (f64, Option<String>) {
    match unit {
        Unit::Metre => (1.0, None),
        Unit::Millimetre => (1.0e-3, None),
        Unit::Inch => (0.0254, None),
        Unit::Auto => {
            if let Some(metres) = of_format {
                return (metres, None);
            }
            let mut ends = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
            for point in points {
                for axis in 0..3 {
                    ends[0][axis] = ends[0][axis].min(point[axis]);
                    ends[1][axis] = ends[1][axis].max(point[axis]);
                }
            }
            let size = (0..3).map(|axis| ends[1][axis] - ends[0][axis]).fold(0.0, f64::max);
            let (metres, word) = if size > METRES_UP_TO { (1.0e-3, "mm") } else { (1.0, "m") };
            let remark = format!(
                "the file has no unit and is {size:.6} large: the unit is assumed to be {word}; set `unit` if this is wrong"
            );
            (metres, Some(remark))
        }
    }
}
