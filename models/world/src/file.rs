//! File of a world: bodies, joints, tool and gravity, in TOML, checked.

use crate::form::Form;
use flotor_hal::{DVec3, Pose, TextProblem, orientation_from_rotation_vector};
use serde::Deserialize;
use std::ops::Range;
use toml::Spanned;

/// Initial state of a world.
#[derive(Clone, Debug, PartialEq)]
pub struct World {
    /// Gravitational acceleration, downwards, m/s².
    pub gravity_m_per_s2: f64,
    /// Tool in the hand.
    pub tool: Tool,
    /// Bodies, at least one.
    pub bodies: Vec<Body>,
    /// Joints.
    pub joints: Vec<Joint>,
}

/// Tool in the hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tool {
    /// Form, never a plane.
    pub form: Form,
    /// Pose of the form in the frame of the handle.
    pub place: Pose,
    /// Coefficient of friction; in a contact the mean of both sides counts.
    pub friction: f64,
}

/// Body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// Name.
    pub name: String,
    /// Parts, at least one.
    pub parts: Vec<Part>,
    /// Mass, kg; `None` for a body that never moves.
    pub mass_kg: Option<f64>,
    /// Initial pose.
    pub pose: Pose,
    /// Coefficient of friction; in a contact the mean of both sides counts.
    pub friction: f64,
}

/// Part of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Form.
    pub form: Form,
    /// Pose in the frame of the body.
    pub place: Pose,
}

/// Joint between two bodies, or between a body and the world.
#[derive(Clone, Debug, PartialEq)]
pub struct Joint {
    /// Kind.
    pub kind: Kind,
    /// Index of the body.
    pub body: usize,
    /// Index of the other body; `None`: the world.
    pub to: Option<usize>,
    /// Unit axis at the start.
    pub axis: DVec3,
    /// Point of the axis at the start, m.
    pub at_m: DVec3,
    /// Least and largest displacement, m or rad; 0 at the start.
    pub stops: Option<[f64; 2]>,
    /// Dry friction, N or N·m.
    pub friction: f64,
}

/// Kind of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Slides along its axis.
    Slide,
    /// Turns about its axis.
    Hinge,
}

// ---------------------------------------------------------------- as it is written

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WorldEntry {
    #[serde(default = "earth")]
    gravity_m_per_s2: Spanned<f64>,
    tool: Spanned<ToolEntry>,
    #[serde(default)]
    body: Vec<Spanned<BodyEntry>>,
    #[serde(default)]
    joint: Vec<Spanned<JointEntry>>,
}

fn earth() -> Spanned<f64> {
    Spanned::new(0..0, 9.81)
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FormName {
    Plane,
    Ball,
    Box,
    Capsule,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ToolEntry {
    shape: FormName,
    size_mm: Option<[f64; 3]>,
    radius_mm: Option<f64>,
    length_mm: Option<f64>,
    #[serde(default)]
    position_mm: [f64; 3],
    #[serde(default)]
    rotation_deg: [f64; 3],
    #[serde(default)]
    friction: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BodyEntry {
    name: String,
    shape: Option<FormName>,
    size_mm: Option<[f64; 3]>,
    radius_mm: Option<f64>,
    length_mm: Option<f64>,
    #[serde(default)]
    part: Vec<Spanned<PartEntry>>,
    mass_g: Option<f64>,
    #[serde(default)]
    fixed: bool,
    #[serde(default)]
    position_mm: [f64; 3],
    #[serde(default)]
    rotation_deg: [f64; 3],
    #[serde(default = "some_friction")]
    friction: f64,
}

fn some_friction() -> f64 {
    0.5
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartEntry {
    shape: FormName,
    size_mm: Option<[f64; 3]>,
    radius_mm: Option<f64>,
    length_mm: Option<f64>,
    #[serde(default)]
    position_mm: [f64; 3],
    #[serde(default)]
    rotation_deg: [f64; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JointEntry {
    kind: Kind,
    body: String,
    to: Option<String>,
    axis: [f64; 3],
    #[serde(default)]
    at_mm: [f64; 3],
    stops_mm: Option<[f64; 2]>,
    stops_deg: Option<[f64; 2]>,
    friction_n: Option<f64>,
    friction_nmm: Option<f64>,
}

// ---------------------------------------------------------------- checks

/// Largest place and size, mm.
const LARGEST_MM: f64 = 1.0e4;
/// Smallest size, mm.
const SMALLEST_MM: f64 = 0.1;
/// Most bodies of a world, and most parts of a body.
const MOST: usize = 1000;

/// Reads a world. Not real-time.
///
/// # Errors
/// A [`TextProblem`] with the line: malformed TOML, an unknown key, a value out of range, a body that is not there.
pub fn parse(text: &str) -> Result<World, TextProblem> {
    let line_of = |span: Range<usize>| 1 + text.get(..span.start).unwrap_or_default().matches('\n').count();
    let entry: WorldEntry = toml::from_str(text)
        .map_err(|error| TextProblem::at(error.span().map_or(1, line_of), error.message()))?;
    let gravity = entry.gravity_m_per_s2;
    let line = line_of(gravity.span());
    let gravity_m_per_s2 = number("gravity_m_per_s2", *gravity.get_ref(), 0.0, 100.0)
        .map_err(|problem| TextProblem::at(line, problem))?;
    let line = line_of(entry.tool.span());
    let tool = tool(entry.tool.get_ref()).map_err(|problem| TextProblem::at(line, problem))?;
    if entry.body.is_empty() || entry.body.len() > MOST {
        let problem = format!("a world has 1 to {MOST} bodies, this one {}: add [[body]]", entry.body.len());
        return Err(TextProblem::of_file(problem));
    }
    let mut bodies: Vec<Body> = Vec::with_capacity(entry.body.len());
    for entry in &entry.body {
        let line = line_of(entry.span());
        let body = body(entry.get_ref(), &line_of)
            .map_err(|(inner, problem)| TextProblem::at(inner.unwrap_or(line), problem))?;
        if bodies.iter().any(|other| other.name == body.name) {
            let problem = format!("another body is named `{}`; give each its own `name`", body.name);
            return Err(TextProblem::at(line, problem));
        }
        bodies.push(body);
    }
    let mut joints = Vec::with_capacity(entry.joint.len());
    for entry in &entry.joint {
        let line = line_of(entry.span());
        joints.push(joint(entry.get_ref(), &bodies).map_err(|problem| TextProblem::at(line, problem))?);
    }
    Ok(World { gravity_m_per_s2, tool, bodies, joints })
}

fn tool(entry: &ToolEntry) -> Result<Tool, String> {
    let ToolEntry { shape, size_mm, radius_mm, length_mm, .. } = *entry;
    if matches!(shape, FormName::Plane) {
        return Err("a tool cannot be a plane; write shape = \"ball\", \"capsule\" or \"box\"".to_owned());
    }
    Ok(Tool {
        form: form(shape, Sizes { size_mm, radius_mm, length_mm })?,
        place: pose(entry.position_mm, entry.rotation_deg)?,
        friction: number("friction", entry.friction, 0.0, 10.0)?,
    })
}

/// Reads a body; an error has the line of a part if it is there.
fn body(entry: &BodyEntry, line_of: &dyn Fn(Range<usize>) -> usize) -> Result<Body, (Option<usize>, String)> {
    let BodyEntry { size_mm, radius_mm, length_mm, .. } = *entry;
    let sizes = Sizes { size_mm, radius_mm, length_mm };
    let mut parts = Vec::with_capacity(entry.part.len().min(MOST) + 1);
    match entry.shape {
        Some(shape) => parts.push(Part { form: form(shape, sizes).map_err(here)?, place: Pose::HOME }),
        None if sizes.is_some() => return Err(here("the body has a size but no shape; add `shape`")),
        None => {}
    }
    for entry in entry.part.iter().take(MOST) {
        let read = |part: &PartEntry| {
            let PartEntry { shape, size_mm, radius_mm, length_mm, .. } = *part;
            let form = form(shape, Sizes { size_mm, radius_mm, length_mm })?;
            Ok(Part { form, place: pose(part.position_mm, part.rotation_deg)? })
        };
        let part = read(entry.get_ref()).map_err(|problem| (Some(line_of(entry.span())), problem))?;
        parts.push(part);
    }
    if parts.is_empty() {
        return Err(here(
            "the body has neither a shape nor parts; add `shape`, or [[body.part]] with a `shape` each",
        ));
    }
    let has_plane = parts.iter().any(|part| part.form == Form::Plane);
    let mass_kg = match (entry.fixed, entry.mass_g) {
        (true, None) => None,
        (true, Some(_)) => return Err(here("a fixed body has no mass: remove `mass_g`, or `fixed`")),
        (false, None) => return Err(here("a body that moves has a mass: add `mass_g`, or `fixed = true`")),
        (false, Some(_)) if has_plane => return Err(here("a plane does not move: add `fixed = true`")),
        (false, Some(mass_g)) => Some(number("mass_g", mass_g, 0.1, 1.0e5).map_err(here)? * 1.0e-3),
    };
    Ok(Body {
        name: entry.name.clone(),
        parts,
        mass_kg,
        pose: pose(entry.position_mm, entry.rotation_deg).map_err(here)?,
        friction: number("friction", entry.friction, 0.0, 10.0).map_err(here)?,
    })
}

fn here(problem: impl Into<String>) -> (Option<usize>, String) {
    (None, problem.into())
}

fn joint(entry: &JointEntry, bodies: &[Body]) -> Result<Joint, String> {
    let find = |name: &str| {
        bodies.iter().position(|body| body.name == name).ok_or_else(|| {
            let names: Vec<String> = bodies.iter().map(|body| format!("`{}`", body.name)).take(12).collect();
            format!("no body is named `{name}`; the bodies are {}", names.join(", "))
        })
    };
    let body = find(&entry.body)?;
    let to = entry.to.as_deref().map(find).transpose()?;
    if to == Some(body) {
        return Err("a joint is between two bodies: change `to`, or remove it for the world".to_owned());
    }
    let moves = |index: usize| bodies[index].mass_kg.is_some();
    if !moves(body) && !to.is_some_and(moves) {
        return Err(format!("neither end of the joint moves; give `{}` a mass", entry.body));
    }
    let axis = vector("axis", entry.axis, 1.0e6)?
        .try_normalize()
        .ok_or("the axis has no direction; write axis = [1, 0, 0]")?;
    let (stops, friction) = match entry.kind {
        Kind::Slide if entry.stops_deg.is_some() => return Err(other_unit("slide", "stops_mm", "stops_deg")),
        Kind::Slide if entry.friction_nmm.is_some() => {
            return Err(other_unit("slide", "friction_n", "friction_nmm"));
        }
        Kind::Hinge if entry.stops_mm.is_some() => return Err(other_unit("hinge", "stops_deg", "stops_mm")),
        Kind::Hinge if entry.friction_n.is_some() => {
            return Err(other_unit("hinge", "friction_nmm", "friction_n"));
        }
        Kind::Slide => (
            stops("stops_mm", entry.stops_mm, LARGEST_MM, 1.0e-3)?,
            number("friction_n", entry.friction_n.unwrap_or(0.0), 0.0, 1.0e3)?,
        ),
        Kind::Hinge => (
            stops("stops_deg", entry.stops_deg, 179.0, 1.0_f64.to_radians())?,
            number("friction_nmm", entry.friction_nmm.unwrap_or(0.0), 0.0, 1.0e5)? * 1.0e-3,
        ),
    };
    let at_m = vector("at_mm", entry.at_mm, LARGEST_MM)? * 1.0e-3;
    Ok(Joint { kind: entry.kind, body, to, axis, at_m, stops, friction })
}

fn other_unit(kind: &str, right: &str, wrong: &str) -> String {
    format!("`{wrong}` does not apply to a {kind}; write `{right}`")
}

fn stops(key: &str, stops: Option<[f64; 2]>, most: f64, unit: f64) -> Result<Option<[f64; 2]>, String> {
    let Some([least, largest]) = stops else { return Ok(None) };
    let (least, largest) = (number(key, least, -most, 0.0)?, number(key, largest, 0.0, most)?);
    if least < largest {
        return Ok(Some([least * unit, largest * unit]));
    }
    Err(format!("`{key}` must be a range about 0, where the joint starts: [-10, 20]"))
}

/// Sizes of a form, as far as they are written.
#[derive(Clone, Copy)]
struct Sizes {
    size_mm: Option<[f64; 3]>,
    radius_mm: Option<f64>,
    length_mm: Option<f64>,
}

impl Sizes {
    fn is_some(&self) -> bool {
        self.size_mm.is_some() || self.radius_mm.is_some() || self.length_mm.is_some()
    }
}

fn form(name: FormName, sizes: Sizes) -> Result<Form, String> {
    let half_m = |key: &str, size_mm: f64| {
        number(key, size_mm, SMALLEST_MM, LARGEST_MM).map(|size_mm| 0.5e-3 * size_mm)
    };
    match (name, sizes.size_mm, sizes.radius_mm, sizes.length_mm) {
        (FormName::Plane, None, None, None) => Ok(Form::Plane),
        (FormName::Ball, None, Some(radius_mm), None) => {
            Ok(Form::Ball { radius_m: 2.0 * half_m("radius_mm", radius_mm)? })
        }
        (FormName::Box, Some([x, y, z]), None, None) => {
            let key = "size_mm";
            Ok(Form::Box { half_m: [half_m(key, x)?, half_m(key, y)?, half_m(key, z)?] })
        }
        (FormName::Capsule, None, Some(radius_mm), Some(length_mm)) => {
            let radius_m = 2.0 * half_m("radius_mm", radius_mm)?;
            Ok(Form::Capsule { radius_m, half_m: half_m("length_mm", length_mm)? })
        }
        (FormName::Plane, ..) => Err("a plane has no size; remove the sizes".to_owned()),
        (FormName::Ball, ..) => Err("a ball has a `radius_mm` and no other size".to_owned()),
        (FormName::Box, ..) => Err("a box has a `size_mm`, [x, y, z], and no other size".to_owned()),
        (FormName::Capsule, ..) => Err("a capsule has a `radius_mm`, and a `length_mm` between the centres \
                                        of its ends, and no other size"
            .to_owned()),
    }
}

fn pose(position_mm: [f64; 3], rotation_deg: [f64; 3]) -> Result<Pose, String> {
    let turn = vector("rotation_deg", rotation_deg, 360.0)? * 1.0_f64.to_radians();
    Ok(Pose::new(
        vector("position_mm", position_mm, LARGEST_MM)? * 1.0e-3,
        orientation_from_rotation_vector(turn),
    ))
}

fn vector(key: &str, [x, y, z]: [f64; 3], most: f64) -> Result<DVec3, String> {
    let number = |value| number(key, value, -most, most);
    Ok(DVec3::new(number(x)?, number(y)?, number(z)?))
}

fn number(key: &str, value: f64, least: f64, most: f64) -> Result<f64, String> {
    if (least..=most).contains(&value) {
        return Ok(value);
    }
    Err(format!("`{key}` is {value}, but must be {least} to {most}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIGHT: &str = "[tool]\nshape = \"ball\"\nradius_mm = 5\n[[body]]\nname = \"a\"\nshape = \"box\"\n\
                         size_mm = [10, 20, 30]\nmass_g = 100\n[[joint]]\nkind = \"slide\"\nbody = \"a\"\n\
                         axis = [2, 0, 0]\nstops_mm = [-1, 2]\nfriction_n = 3\n";

    #[test]
    fn a_world_is_read_in_si() {
        let world = parse(RIGHT).expect("it is right");
        assert_eq!(world.gravity_m_per_s2, 9.81);
        assert_eq!(world.tool.form, Form::Ball { radius_m: 0.005 });
        assert_eq!(world.bodies[0].parts[0].form, Form::Box { half_m: [0.005, 0.01, 0.015] });
        assert_eq!(world.bodies[0].mass_kg, Some(0.1));
        let joint = &world.joints[0];
        assert_eq!((joint.axis, joint.stops, joint.friction), (DVec3::X, Some([-0.001, 0.002]), 3.0));
    }

    #[test]
    fn a_mistake_has_its_line_and_a_remedy() {
        for (from, to, line, word) in [
            ("radius_mm = 5", "radius_mm = 0", 1, "radius_mm"),
            ("radius_mm = 5", "radius_mm = nan", 1, "radius_mm"),
            ("shape = \"ball\"", "shape = \"plane\"", 1, "a plane"),
            ("mass_g = 100", "", 4, "mass_g"),
            ("mass_g = 100", "mass_g = 100\nfixed = true", 4, "fixed"),
            ("mass_g = 100", "mass = 100", 8, "unknown field `mass`"),
            ("body = \"a\"", "body = \"b\"", 9, "`a`"),
            ("axis = [2, 0, 0]", "axis = [0, 0, 0]", 9, "axis"),
            ("stops_mm = [-1, 2]", "stops_mm = [1, 2]", 9, "stops_mm"),
            ("friction_n = 3", "friction_nmm = 3", 9, "friction_n"),
            ("size_mm = [10, 20, 30]", "radius_mm = 10", 4, "size_mm"),
            ("size_mm = [10, 20, 30]", "size_mm = [10, 20", 8, "comma"),
        ] {
            let error = parse(&RIGHT.replacen(from, to, 1)).expect_err(to);
            assert!(error.problem.contains(word), "{to}: {}", error.problem);
            assert_eq!(error.line, line, "{to}: {}", error.problem);
        }
        assert!(
            parse("[tool]\nshape = \"ball\"\nradius_mm = 5\n")
                .expect_err("no body")
                .problem
                .contains("[[body]]")
        );
    }
}
