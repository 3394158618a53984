//! Triangle meshes, in the layout of the GPU and the CPU rasteriser.

use flotor_hal::DVec3;

/// Millimetres per metre. Pictures are in millimetres, so that `f32` coordinates are near one.
pub const MM_PER_M: f64 = 1.0e3;

/// Vertex of a triangle, 28 bytes.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Vertex {
    /// Position, mm, in the frame of the scene (z up).
    pub position_mm: [f32; 3],
    /// Unit normal; zero for an unlit surface.
    pub normal: [f32; 3],
    /// Colour and opacity, sRGB.
    pub color: Color,
}

/// Colour and opacity, sRGB, straight alpha.
pub type Color = [u8; 4];

/// List of triangles, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices of the triangles.
    pub vertices: Vec<Vertex>,
    /// Three indices per triangle.
    pub indices: Vec<u32>,
}

impl Mesh {
    /// Removes all triangles and keeps the allocated memory.
    pub fn clear(&mut self) {
        self.vertices.clear();
        self.indices.clear();
    }

    /// Adds a vertex at a position, m, and returns its index.
    #[allow(clippy::cast_possible_truncation)] // a picture needs no more than f32, and no more than 2^32 vertices
    pub fn vertex(&mut self, position_m: DVec3, normal: DVec3, color: Color) -> u32 {
        let index = self.vertices.len() as u32;
        let position_mm = (position_m * MM_PER_M).as_vec3().to_array();
        self.vertices.push(Vertex { position_mm, normal: normal.as_vec3().to_array(), color });
        index
    }

    /// Adds the triangle `a b c`, counter-clockwise seen from outside.
    pub fn triangle(&mut self, a: u32, b: u32, c: u32) {
        self.indices.extend_from_slice(&[a, b, c]);
    }

    /// Adds the quad `a b c d`, counter-clockwise seen from outside, as two triangles.
    pub fn quad(&mut self, a: u32, b: u32, c: u32, d: u32) {
        self.indices.extend_from_slice(&[a, b, c, a, c, d]);
    }

    /// Adds a surface of `rows` rows of vertices: `row` adds a row and returns its indices; quads join each row to the previous row.
    pub fn sheet<Row: AsRef<[u32]>>(&mut self, rows: usize, row: impl Fn(&mut Self, usize) -> Row) {
        let mut last: Option<Row> = None;
        for number in 0..rows {
            let row = row(self, number);
            let before = last.iter().flat_map(|last| last.as_ref().windows(2));
            for (near, far) in before.zip(row.as_ref().windows(2)) {
                self.quad(near[0], far[0], far[1], near[1]);
            }
            last = Some(row);
        }
    }
}
