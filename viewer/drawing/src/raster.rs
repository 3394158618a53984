//! CPU rasteriser of the 3D view: depth buffer, lighting per vertex, supersampling.

use crate::camera::Camera;
use crate::geometry::{Mesh, Vertex};
use crate::light;
use flotor_hal::DVec3;
use flotor_hal::glam::{DMat4, Vec2};

/// Picture in 8-bit RGB, row by row from the top.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Three bytes per pixel.
    pub rgb: Vec<u8>,
}

/// Vertical colour gradient of the background, sRGB.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Backdrop {
    /// Colour at the top.
    pub top: [u8; 3],
    /// Colour at the bottom.
    pub bottom: [u8; 3],
}

/// Camera, background and size of a picture.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Camera from which the scene is seen.
    pub camera: &'a Camera,
    /// Colours of the background.
    pub backdrop: Backdrop,
    /// Width and height, pixels.
    pub size: [usize; 2],
}

/// Rasteriser; its buffers are reused from frame to frame.
#[derive(Debug, Default)]
pub struct Rasterizer {
    color: Vec<[u8; 3]>,
    depth: Vec<f32>,
    corners: Vec<Corner>,
}

/// Vertex projected to the screen.
#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Position in samples from the upper left; NaN if nearer than the near plane.
    at: Vec2,
    depth: f32,
    lit: [f32; 3],
    opacity: f32,
}

impl Rasterizer {
    /// Draws a mesh with `samples` × `samples` samples per pixel (supersampling).
    ///
    /// Skips triangles that face away from the eye, or have a vertex nearer than the near plane.
    pub fn draw(&mut self, mesh: &Mesh, view: &View<'_>, samples: usize) -> Image {
        let [width, height] = view.size.map(|length| length.max(1) * samples);
        self.begin(view.backdrop, [width, height]);
        self.project(mesh, view.camera, [width, height]);
        for triangle in mesh.indices.chunks_exact(3) {
            let corner = |index: u32| self.corners.get(index as usize).copied();
            if let [Some(a), Some(b), Some(c)] =
                [corner(triangle[0]), corner(triangle[1]), corner(triangle[2])]
            {
                self.triangle([a, b, c], [width, height]);
            }
        }
        self.resolve([width / samples, height / samples], samples)
    }

    fn begin(&mut self, backdrop: Backdrop, [width, height]: [usize; 2]) {
        self.depth.clear();
        self.depth.resize(width * height, f32::INFINITY);
        self.color.clear();
        for y in 0..height {
            let part = y as f32 / height as f32;
            let row = mix(backdrop.top, backdrop.bottom.map(f32::from), part);
            self.color.resize((y + 1) * width, row);
        }
    }

    #[allow(clippy::cast_possible_truncation)] // pixels
    fn project(&mut self, mesh: &Mesh, camera: &Camera, [width, height]: [usize; 2]) {
        let (w, h) = (width as f64, height as f64);
        let projection = camera.projection(w / h);
        let eye_mm = camera.eye_mm();
        self.corners.clear();
        self.corners.extend(mesh.vertices.iter().map(|vertex| corner(vertex, &projection, eye_mm, w, h)));
    }

    /// Fills the samples whose centres are inside a triangle; skips a triangle whose vertices are not counter-clockwise, because it
    /// faces away from the eye.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
    fn triangle(&mut self, [a, b, c]: [Corner; 3], [width, height]: [usize; 2]) {
        // Twice the signed area; y runs down, so the area of a triangle that faces the eye is negative. The comparison is false for NaN.
        let area = (b.at - a.at).perp_dot(c.at - a.at);
        let faces_us = area < -1.0e-9;
        if !faces_us {
            return;
        }
        let low = a.at.min(b.at).min(c.at).max(Vec2::ZERO);
        let high = a.at.max(b.at).max(c.at).min(Vec2::new(width as f32, height as f32));
        let (x0, x1) = ((low.x - 0.5).ceil().max(0.0) as usize, (high.x + 0.5).floor().max(0.0) as usize);
        let (y0, y1) = ((low.y - 0.5).ceil().max(0.0) as usize, (high.y + 0.5).floor().max(0.0) as usize);
        let inverse = 1.0 / area;
        let (step_b, step_c) = ((a.at.y - c.at.y) * inverse, (b.at.y - a.at.y) * inverse);
        for y in y0..y1.min(height) {
            let start = Vec2::new(x0 as f32 + 0.5, y as f32 + 0.5) - a.at;
            let mut of_b = start.perp_dot(c.at - a.at) * inverse;
            let mut of_c = (b.at - a.at).perp_dot(start) * inverse;
            let row = y * width;
            for sample in row + x0..row + x1.min(width) {
                let of_a = 1.0 - of_b - of_c;
                if of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0 {
                    let depth = of_a * a.depth + of_b * b.depth + of_c * c.depth;
                    if depth < self.depth[sample] {
                        let of =
                            |part: fn(&Corner) -> f32| of_a * part(&a) + of_b * part(&b) + of_c * part(&c);
                        let lit: [f32; 3] =
                            std::array::from_fn(|k| of_a * a.lit[k] + of_b * b.lit[k] + of_c * c.lit[k]);
                        self.depth[sample] = depth;
                        self.color[sample] = mix(self.color[sample], lit, of(|corner| corner.opacity));
                    }
                }
                of_b -= step_b;
                of_c -= step_c;
            }
        }
    }

    #[allow(clippy::cast_possible_truncation)] // a mean of bytes is a byte
    fn resolve(&self, [width, height]: [usize; 2], samples: usize) -> Image {
        let count = (samples * samples) as u32;
        let mut rgb = Vec::with_capacity(3 * width * height);
        for y in 0..height {
            for x in 0..width {
                let mut sum = [count / 2; 3];
                for row in 0..samples {
                    let first = (y * samples + row) * width * samples + x * samples;
                    for color in &self.color[first..first + samples] {
                        (0..3).for_each(|k| sum[k] += u32::from(color[k]));
                    }
                }
                rgb.extend(sum.map(|part| (part / count) as u8));
            }
        }
        Image { size: [width, height], rgb }
    }
}

#[allow(clippy::cast_possible_truncation)] // f32 is enough on a screen
fn corner(vertex: &Vertex, projection: &DMat4, eye_mm: DVec3, width: f64, height: f64) -> Corner {
    let position_mm = DVec3::from_array(vertex.position_mm.map(f64::from));
    let clip = *projection * position_mm.extend(1.0);
    let visible = clip.z > 0.0 && clip.w > 0.0;
    let at = if visible {
        Vec2::new(
            ((0.5 + 0.5 * clip.x / clip.w) * width) as f32,
            ((0.5 - 0.5 * clip.y / clip.w) * height) as f32,
        )
    } else {
        Vec2::NAN
    };
    Corner {
        at,
        depth: (clip.z / clip.w) as f32,
        lit: light::shade(vertex, eye_mm).map(|part| part as f32 * 255.0),
        opacity: f32::from(vertex.color[3]) / 255.0,
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to a byte
fn mix(under: [u8; 3], over: [f32; 3], opacity: f32) -> [u8; 3] {
    std::array::from_fn(|k| {
        let under = f32::from(under[k]);
        (under + (over[k] - under) * opacity + 0.5).clamp(0.0, 255.0) as u8
    })
}
