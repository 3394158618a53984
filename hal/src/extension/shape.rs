//! Extension `flotor.shape/1`: shape of a body that is not slender, for visualisation.
//!
//! Primitives (plane, sphere, box, cylinder) for rigid bodies and for the tool, and one triangle surface with normals
//! and one scalar per vertex, whose name and unit are declared. As with a centreline, an observer creates its own
//! instance of the model and queries the instance at its own rate; the servo loop never calls this extension.

use crate::abi::instance::fill;
use crate::abi::interface::table;
use crate::abi::layout::layout;
use crate::abi::{Instance, ModelAdapter, Str};
use crate::{DVec3, ForceModel, Input, Pose};
use std::ptr::null;

/// Form of a [`Primitive`]. In C, a `uint32_t` with these values.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Rectangle normal to the z axis of the pose; the solid is on the side of negative z.
    Plane = 0,
    /// A ball.
    Sphere = 1,
    /// A box with sides along the axes of the pose.
    Box = 2,
    /// A round cylinder about the z axis of the pose.
    Cylinder = 3,
}

/// Role of a [`Primitive`]: touched body or tool. In C, a `uint32_t` with these values.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Body that the tool touches.
    Body = 0,
    /// Tool in the hand.
    Tool = 1,
}

/// Body of a simple form. 88 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
#[must_use]
pub struct Primitive {
    /// Code of a [`Form`].
    form: u32,
    /// Code of a [`Part`].
    part: u32,
    /// Centre (m, model frame) and orientation.
    pose: Pose,
    /// Half extents along the axes of the pose, m.
    half_sides_m: [f64; 3],
}

impl Primitive {
    /// Builds a body from its half extents: of a plane only the first two count, of a sphere each is the radius, of a
    /// cylinder the first two are the radius and the third is half the height.
    pub const fn new(form: Form, part: Part, pose: Pose, half_sides_m: [f64; 3]) -> Self {
        Self { form: form as u32, part: part as u32, pose, half_sides_m }
    }

    /// Builds a sphere with its centre at the position of `pose`.
    pub const fn sphere(part: Part, pose: Pose, radius_m: f64) -> Self {
        Self::new(Form::Sphere, part, pose, [radius_m; 3])
    }

    /// Returns the form; `None` for a form of a later contract.
    #[must_use]
    pub const fn form(&self) -> Option<Form> {
        match self.form {
            0 => Some(Form::Plane),
            1 => Some(Form::Sphere),
            2 => Some(Form::Box),
            3 => Some(Form::Cylinder),
            _ => None,
        }
    }

    /// Returns the role; an unknown code counts as a body.
    #[must_use]
    pub const fn part(&self) -> Part {
        if self.part == Part::Tool as u32 { Part::Tool } else { Part::Body }
    }

    /// Returns the centre (m, model frame) and the orientation.
    pub const fn pose(&self) -> Pose {
        self.pose
    }

    /// Returns the half extents along the axes of the pose, m.
    #[must_use]
    pub const fn half_sides_m(&self) -> [f64; 3] {
        self.half_sides_m
    }
}

/// Vertex of the surface. 56 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct SurfaceVertex {
    /// Position, m, model frame.
    pub position_m: [f64; 3],
    /// Outward unit normal.
    pub normal: [f64; 3],
    /// Value of the scalar field at this vertex, in the unit of [`ScalarField`]; 0 without a field.
    pub value: f64,
}

/// Visible sides of a surface. In C, a `uint32_t` with these values.
#[repr(u32)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sides {
    /// Outside only: the surface encloses a body.
    #[default]
    Outer = 0,
    /// Both sides: a sheet.
    Both = 1,
}

/// Name and unit of the vertex values of a surface. 32 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ScalarField {
    name: Str,
    unit: Str,
}

impl ScalarField {
    /// No field: the vertex values are not displayed.
    pub const NONE: Self = Self::new("", "");

    /// Declares a field by display name and unit, such as "contact pressure" and "kPa".
    #[must_use]
    pub const fn new(name: &'static str, unit: &'static str) -> Self {
        Self { name: Str::new(name), unit: Str::new(unit) }
    }

    /// Returns the name; empty without a field.
    #[must_use]
    pub const fn name(&self) -> &str {
        self.name.as_str()
    }

    /// Returns the unit; empty for a dimensionless number.
    #[must_use]
    pub const fn unit(&self) -> &str {
        self.unit.as_str()
    }
}

impl Default for ScalarField {
    fn default() -> Self {
        Self::NONE
    }
}

impl PartialEq for ScalarField {
    fn eq(&self, other: &Self) -> bool {
        (self.name(), self.unit()) == (other.name(), other.unit())
    }
}

/// Triangle mesh with normals and one scalar per vertex; empty if the model has no surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surface {
    /// Vertices of the triangles.
    pub vertices: Vec<SurfaceVertex>,
    /// Indices of three vertices each, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Visible sides.
    pub sides: Sides,
    /// Name and unit of the vertex values.
    pub field: ScalarField,
}

impl Surface {
    /// Computes the vertex normals as means of the adjacent triangles' normals, weighted by area; zero for a vertex without a
    /// triangle. Not real-time.
    ///
    /// # Panics
    /// If a triangle has a vertex index out of range.
    pub fn set_normals(&mut self) {
        let Self { vertices, triangles, .. } = self;
        vertices.iter_mut().for_each(|vertex| vertex.normal = [0.0; 3]);
        for triangle in triangles.iter() {
            let [a, b, c] = triangle.map(|corner| DVec3::from_array(vertices[corner as usize].position_m));
            let twice_area = (b - a).cross(c - a);
            for corner in triangle {
                let normal = &mut vertices[*corner as usize].normal;
                *normal = (DVec3::from_array(*normal) + twice_area).to_array();
            }
        }
        for vertex in vertices {
            vertex.normal = DVec3::from_array(vertex.normal).normalize_or_zero().to_array();
        }
    }
}

/// Visible shape of a model at a pose of the handle, in the model frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Bodies of simple form, and the tool.
    pub primitives: Vec<Primitive>,
    /// Deformable surface.
    pub surface: Surface,
}

/// Force model with a shape of any form. Not real-time.
///
/// ```
/// # use flotor_hal::*;
/// # struct Foam { depth_m: f64, look: Shape }
/// # impl ForceModel for Foam {
/// #     const INFO: ModelInfo = ModelInfo::new("foam", "Foam", "A soft ball");
/// #     fn create(_: &Settings<'_>) -> Result<Self, Refusal> {
/// #         Ok(Self { depth_m: 0.0, look: Shape::default() })
/// #     }
/// #     fn step(&mut self, _: &Input) -> Output { Wrench::ZERO.into() }
/// # }
/// /// A ball, and the tool in the hand: `export_model!(Foam, shape)`.
/// impl ShapeModel for Foam {
///     fn shape(&mut self, input: &Input) -> &Shape {
///         let ball = Pose::new(DVec3::Z * -0.012, DQuat::IDENTITY);
///         self.look.primitives.clear();
///         self.look.primitives.push(Primitive::sphere(Part::Body, ball, 0.01));
///         self.look.primitives.push(Primitive::sphere(Part::Tool, input.pose, 0.001));
///         &self.look
///     }
/// }
/// # let mut foam = Foam { depth_m: 0.0, look: Shape::default() };
/// let shape = foam.shape(&Input::at_rest(Pose::HOME));
/// assert_eq!(shape.primitives[1].pose(), Pose::HOME);
/// ```
pub trait ShapeModel: ForceModel {
    /// Returns the shape with the handle at an input, with the current parameters. The model stores the shape until the
    /// next call, so that repeated calls need not allocate. A model with a history returns its equilibrium for a handle
    /// held at the input.
    fn shape(&mut self, input: &Input) -> &Shape;
}

/// View of a [`Shape`] at the plugin boundary: the plugin's own memory, valid until the next call of the instance. 88 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ShapeView {
    /// Bodies of simple form, and the tool; like `vertices` and `triangles`, may be null if empty.
    pub primitives: *const Primitive,
    /// Vertices of the surface.
    pub vertices: *const SurfaceVertex,
    /// Triangles of the surface: indices of vertices, counter-clockwise seen from outside.
    pub triangles: *const [u32; 3],
    /// Number of primitives.
    pub primitive_count: u32,
    /// Number of vertices.
    pub vertex_count: u32,
    /// Number of triangles.
    pub triangle_count: u32,
    /// Code of [`Sides`].
    pub sides: u32,
    /// Name and unit of the vertex values; the texts are constant.
    pub field: ScalarField,
}

/// Function table `flotor.shape/1`: see [`ShapeModel`]. Not real-time.
#[repr(C)]
#[derive(Clone, Copy)]
#[cfg_attr(feature = "layout-proof", derive(abi_stable::StableAbi))]
pub struct ShapeTable {
    /// Size of this table in the plugin's build, bytes.
    pub size: u32,
    /// Reserved, 0.
    pub reserved: u32,
    /// Writes the shape at an input; returns a [`crate::abi::CallStatus`] code.
    pub shape:
        Option<unsafe extern "C" fn(instance: Instance, input: *const Input, out: *mut ShapeView) -> u32>,
}

layout! {
    Primitive { form, part, pose, half_sides_m }
    SurfaceVertex { position_m, normal, value }
    ScalarField { name, unit }
    ShapeView { primitives, vertices, triangles, primitive_count, vertex_count, triangle_count, sides, field }
    ShapeTable { size, reserved, shape }
}

impl ShapeView {
    /// Returns the view of a shape without any part.
    #[must_use]
    pub const fn empty() -> Self {
        Self {
            primitives: null(),
            vertices: null(),
            triangles: null(),
            primitive_count: 0,
            vertex_count: 0,
            triangle_count: 0,
            sides: Sides::Outer as u32,
            field: ScalarField::NONE,
        }
    }

    /// Returns the view of a shape, valid as long as the shape is not changed.
    fn of(shape: &Shape) -> Self {
        let Shape { primitives, surface: Surface { vertices, triangles, sides, field } } = shape;
        // No shape within the limits has more; a host rejects a saturated count as too large.
        let count = |length: usize| u32::try_from(length).unwrap_or(u32::MAX);
        Self {
            primitives: primitives.as_ptr(),
            vertices: vertices.as_ptr(),
            triangles: triangles.as_ptr(),
            primitive_count: count(primitives.len()),
            vertex_count: count(vertices.len()),
            triangle_count: count(triangles.len()),
            sides: *sides as u32,
            field: *field,
        }
    }

    /// Copies the shape of a plugin, without [`Shape::check`]. Not real-time.
    ///
    /// # Errors
    /// [`InvalidShape`] if a list is too long, or null or misaligned although its length is not 0, or if a text of the
    /// field is too long.
    ///
    /// # Safety
    /// Each list is null or has the declared number of initialised values, and stays valid during the call.
    pub unsafe fn copied(&self) -> Result<Shape, InvalidShape> {
        if [self.field.name, self.field.unit].iter().any(|text| text.bytes() > MOST_TEXT_BYTES) {
            return Err(InvalidShape::Text);
        }
        // SAFETY: by the contract of this function.
        unsafe {
            Ok(Shape {
                primitives: list("primitives", self.primitives, self.primitive_count)?,
                surface: Surface {
                    vertices: list("vertices", self.vertices, self.vertex_count)?,
                    triangles: list("triangles", self.triangles, self.triangle_count)?,
                    sides: if self.sides == Sides::Both as u32 { Sides::Both } else { Sides::Outer },
                    field: self.field,
                },
            })
        }
    }
}

/// Copies a plugin's list.
///
/// # Safety
/// `first` is null or points at `count` initialised values.
unsafe fn list<T: Copy>(name: &'static str, first: *const T, count: u32) -> Result<Vec<T>, InvalidShape> {
    match count {
        0 => Ok(Vec::new()),
        MOST.. => Err(InvalidShape::TooLarge(name)),
        _ if first.is_null() || !first.is_aligned() => Err(InvalidShape::Missing(name)),
        // SAFETY: by the contract of this function; not null and aligned, as was seen above.
        _ => Ok(unsafe { std::slice::from_raw_parts(first, count as usize) }.to_vec()),
    }
}

unsafe extern "C" fn shape<M: ShapeModel>(
    instance: Instance,
    input: *const Input,
    out: *mut ShapeView,
) -> u32 {
    // SAFETY: the contract of every table call. What `out` points at belongs to the model, which keeps it until the next call.
    unsafe { fill::<ModelAdapter<M>, _>(instance, out, |model| Ok(ShapeView::of(model.shape(&*input)))) }
}

table!(ShapeTable: "flotor.shape/1", M: [ShapeModel] {
    reserved: 0,
    shape: Some(shape::<M>),
});

/// Reason why a model's shape is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InvalidShape {
    /// The model has no shape, or failed.
    Failed,
    /// 2^20 or more elements of a list: vertices, triangles or primitives.
    TooLarge(&'static str),
    /// Neither a primitive nor a triangle.
    Empty,
    /// Null or misaligned pointer to a list that is not empty: vertices, triangles or primitives.
    Missing(&'static str),
    /// Triangle, by its index, with a vertex index out of range.
    Corner(usize),
    /// Primitive, by its index, with a number that is not finite, or a negative side.
    Primitive(usize),
    /// Vertex, by its index, with a number that is not finite.
    Vertex(usize),
    /// Name or unit of the field that is too long.
    Text,
}

impl std::fmt::Display for InvalidShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Failed => f.write_str("the model has no shape, or returned an error instead of its shape"),
            Self::TooLarge(list) => write!(f, "the shape has 1048576 or more {list}; return fewer"),
            Self::Empty => f.write_str("the shape has no primitive and no triangle; return at least one"),
            Self::Missing(list) => write!(f, "the list of {list} is null or misaligned, but not empty"),
            Self::Corner(at) => write!(f, "triangle {at} (from 0) has an index beyond the list of vertices"),
            Self::Primitive(at) => {
                write!(f, "primitive {at} (from 0) has `half_sides_m` < 0, or a number that is not finite")
            }
            Self::Vertex(at) => write!(f, "vertex {at} (from 0) has a number that is not finite"),
            Self::Text => f.write_str("the name or the unit of the field is longer than 64 bytes"),
        }
    }
}

impl std::error::Error for InvalidShape {}

/// Exclusive limit on the number of vertices, triangles or primitives.
const MOST: u32 = 1 << 20;
/// Maximum length of a name or unit, bytes.
const MOST_TEXT_BYTES: usize = 64;

impl Shape {
    /// Checks that the shape is not empty, its numbers are finite, no side is negative and no index is out of range. Not
    /// real-time.
    ///
    /// # Errors
    /// [`InvalidShape`] if the shape is empty or has an invalid number or index.
    pub fn check(&self) -> Result<(), InvalidShape> {
        let Surface { vertices, triangles, .. } = &self.surface;
        if self.primitives.is_empty() && triangles.is_empty() {
            return Err(InvalidShape::Empty);
        }
        let is_finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
        let primitive = self.primitives.iter().position(|primitive| {
            let sides = &primitive.half_sides_m;
            !(primitive.pose.is_finite() && is_finite(sides) && sides.iter().all(|side| *side >= 0.0))
        });
        let vertex = vertices.iter().position(|vertex| {
            !(is_finite(&vertex.position_m) && is_finite(&vertex.normal) && vertex.value.is_finite())
        });
        let corner = triangles.as_flattened().iter().position(|corner| *corner as usize >= vertices.len());
        let wrong = primitive.map(InvalidShape::Primitive).or(vertex.map(InvalidShape::Vertex));
        wrong.or(corner.map(|corner| InvalidShape::Corner(corner / 3))).map_or(Ok(()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheet() -> Shape {
        let vertex =
            |x: f64, y: f64| SurfaceVertex { position_m: [x, y, 0.0], normal: [0.0, 0.0, 1.0], value: 1.0 };
        let surface = Surface {
            vertices: vec![vertex(0.0, 0.0), vertex(1.0, 0.0), vertex(0.0, 1.0)],
            triangles: vec![[0, 1, 2]],
            sides: Sides::Both,
            field: ScalarField::new("height", "mm"),
        };
        Shape { primitives: vec![Primitive::sphere(Part::Tool, Pose::HOME, 1.0)], surface }
    }

    #[test]
    fn what_no_picture_can_show_is_no_shape() {
        assert_eq!(sheet().check(), Ok(()));
        assert_eq!(Shape::default().check(), Err(InvalidShape::Empty));
        let mut beyond = sheet();
        beyond.surface.triangles[0][1] = 3;
        assert_eq!(beyond.check(), Err(InvalidShape::Corner(0)));
        let mut odd = sheet();
        odd.surface.vertices[2].value = f64::NAN;
        assert_eq!(odd.check(), Err(InvalidShape::Vertex(2)));
        for radius_m in [-1.0, f64::INFINITY] {
            let mut odd = sheet();
            odd.primitives[0] = Primitive::sphere(Part::Body, Pose::HOME, radius_m);
            assert_eq!(odd.check(), Err(InvalidShape::Primitive(0)));
        }
    }

    #[test]
    fn the_normals_of_a_corner_are_those_of_the_triangles_about_it() {
        // A roof of two squares' halves, at right angles along the y axis.
        let at = |position_m| SurfaceVertex { position_m, ..SurfaceVertex::default() };
        let vertices =
            vec![at([0.0; 3]), at([0.0, 1.0, 0.0]), at([1.0, 0.0, 0.0]), at([0.0, 0.0, -1.0]), at([5.0; 3])];
        let mut surface = Surface { vertices, triangles: vec![[0, 2, 1], [0, 1, 3]], ..Surface::default() };
        surface.set_normals();
        let ridge = -std::f64::consts::FRAC_1_SQRT_2;
        assert_eq!(surface.vertices[2].normal, [0.0, 0.0, 1.0]);
        assert!((surface.vertices[0].normal[0] - ridge).abs() < 1.0e-15, "{:?}", surface.vertices[0]);
        assert_eq!(surface.vertices[4].normal, [0.0; 3], "a corner of no triangle has none");
    }

    #[test]
    fn a_primitive_of_a_later_contract_is_one_of_no_known_form() {
        let later = Primitive { form: 9, part: 9, ..Primitive::sphere(Part::Tool, Pose::HOME, 1.0) };
        assert_eq!((later.form(), later.part()), (None, Part::Body));
    }

    #[test]
    fn a_list_that_is_not_there_is_not_read() {
        // SAFETY: null, or a list of its length.
        unsafe {
            assert_eq!(list::<f64>("numbers", null(), 0), Ok(Vec::new()));
            assert_eq!(list::<f64>("numbers", null(), 1), Err(InvalidShape::Missing("numbers")));
            assert_eq!(list::<f64>("numbers", null(), MOST), Err(InvalidShape::TooLarge("numbers")));
            assert_eq!(list("numbers", [1.0, 2.0].as_ptr(), 2), Ok(vec![1.0, 2.0]));
        }
    }
}
