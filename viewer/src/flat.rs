//! CPU rasteriser of the interface: egui's triangles, textured and blended, with the same bits on every machine.

use egui::epaint::{ImageDelta, Primitive, Vertex};
use egui::{
    ClippedPrimitive, Color32, ColorImage, ImageData, Pos2, Rect, TextureId, TextureOptions, TexturesDelta,
};
use std::collections::BTreeMap;

/// Rasteriser of an interface, with its textures.
#[derive(Default)]
pub struct FlatRasterizer {
    textures: BTreeMap<TextureId, (ColorImage, TextureOptions)>,
}

impl FlatRasterizer {
    /// Applies the texture changes of a frame and clears them.
    pub fn update(&mut self, delta: &mut TexturesDelta) {
        // Each image has its own id, so the order makes no difference.
        #[allow(clippy::iter_over_hash_type)]
        for (id, images) in &delta.set {
            for image in images {
                self.set(*id, image);
            }
        }
        self.textures.retain(|id, _| !delta.free.contains(id));
        delta.clear();
    }

    fn set(
        &mut self,
        id: TextureId,
        ImageDelta { image: ImageData::Color(image), options, pos }: &ImageDelta,
    ) {
        match (pos, self.textures.get_mut(&id)) {
            (Some([left, top]), Some((texture, _))) => {
                let [width, height] = image.size;
                for row in 0..height {
                    let from = row * width;
                    let to = (top + row) * texture.size[0] + left;
                    if let (Some(source), Some(target)) =
                        (image.pixels.get(from..from + width), texture.pixels.get_mut(to..to + width))
                    {
                        target.copy_from_slice(source);
                    }
                }
            }
            _ => {
                self.textures.insert(id, (image.as_ref().clone(), *options));
            }
        }
    }

    /// Draws the triangles of a frame over a background; returns a picture of `size_px`.
    #[must_use]
    pub fn draw(
        &self,
        primitives: &[ClippedPrimitive],
        size_px: [usize; 2],
        pixels_per_point: f32,
        background: Color32,
    ) -> ColorImage {
        let mut image = ColorImage::filled(size_px, background);
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            // A callback draws on a GPU; this interface has none.
            let Primitive::Mesh(mesh) = primitive else { continue };
            let Some((texture, options)) = self.textures.get(&mesh.texture_id) else { continue };
            let smooth = options.magnification == egui::TextureFilter::Linear;
            let clip = *clip_rect * pixels_per_point;
            for triangle in mesh.indices.chunks_exact(3) {
                let corners = [0, 1, 2].map(|k| {
                    let mut corner = mesh.vertices[triangle[k] as usize];
                    corner.pos = (corner.pos.to_vec2() * pixels_per_point).to_pos2();
                    corner
                });
                fill(&mut image, clip, corners, |uv| sample(texture, uv, smooth));
            }
        }
        image
    }
}

/// Fills the pixels whose centres are inside a triangle; pixels on a common edge belong to one of its two triangles.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // pixels
fn fill(image: &mut ColorImage, clip: Rect, corners: [Vertex; 3], texel: impl Fn(Pos2) -> [f32; 4]) {
    let edge = |a: Pos2, b: Pos2, p: Pos2| {
        let [[ax, ay], [bx, by], [px, py]] = [a, b, p].map(|at| [f64::from(at.x), f64::from(at.y)]);
        (bx - ax) * (py - ay) - (by - ay) * (px - ax)
    };
    let [a, mut b, mut c] = corners;
    if edge(a.pos, b.pos, c.pos) < 0.0 {
        std::mem::swap(&mut b, &mut c);
    }
    let area = edge(a.pos, b.pos, c.pos);
    if area.is_nan() || area <= 0.0 {
        return;
    }
    let bounds = Rect::from_points(&[a.pos, b.pos, c.pos]).intersect(clip);
    let [width, height] = image.size;
    let range = |low: f32, high: f32, limit: usize| {
        let start = (low - 0.5).ceil().max(0.0) as usize;
        let end = ((high + 0.5).floor().max(0.0) as usize).min(limit);
        start..end
    };
    // Top-left rule: a pixel on an edge belongs to the triangle with this edge at its top or left.
    let owns = |from: Pos2, to: Pos2| to.y < from.y || (to.y == from.y && to.x > from.x);
    let (own_a, own_b, own_c) = (owns(b.pos, c.pos), owns(c.pos, a.pos), owns(a.pos, b.pos));
    let same_color = a.color == b.color && b.color == c.color;
    for y in range(bounds.top(), bounds.bottom(), height) {
        if !clip_contains(clip.top(), clip.bottom(), y) {
            continue;
        }
        for x in range(bounds.left(), bounds.right(), width) {
            let at = Pos2::new(x as f32 + 0.5, y as f32 + 0.5);
            let [wa, wb, wc] = [edge(b.pos, c.pos, at), edge(c.pos, a.pos, at), edge(a.pos, b.pos, at)];
            let inside = |weight: f64, own: bool| weight > 0.0 || (weight == 0.0 && own);
            let covered = inside(wa, own_a) && inside(wb, own_b) && inside(wc, own_c);
            if !covered || !clip_contains(clip.left(), clip.right(), x) {
                continue;
            }
            let [wa, wb, wc] = [wa, wb, wc].map(|weight| (weight / area) as f32);
            let color = if same_color {
                a.color.to_array().map(f32::from)
            } else {
                let parts = [a.color, b.color, c.color].map(|color| color.to_array().map(f32::from));
                std::array::from_fn(|k| wa * parts[0][k] + wb * parts[1][k] + wc * parts[2][k])
            };
            let uv =
                Pos2::new(wa * a.uv.x + wb * b.uv.x + wc * c.uv.x, wa * a.uv.y + wb * b.uv.y + wc * c.uv.y);
            let texel = texel(uv);
            let source: [f32; 4] = std::array::from_fn(|k| color[k] * texel[k] / 255.0);
            let pixel = &mut image.pixels[y * width + x];
            let under = pixel.to_array().map(f32::from);
            let [r, g, b, a] = std::array::from_fn(|k| {
                (source[k] + under[k] * (1.0 - source[3] / 255.0) + 0.5).min(255.0) as u8
            });
            *pixel = Color32::from_rgba_premultiplied(r, g, b, a);
        }
    }
}

/// Returns whether the centre of a pixel lies in the range from `low`, included, to `high`, excluded.
fn clip_contains(low: f32, high: f32, pixel: usize) -> bool {
    let middle = pixel as f32 + 0.5;
    middle >= low && middle < high
}

/// Returns the colour of a texture at `uv`, premultiplied, 0 to 255.
#[allow(clippy::cast_possible_truncation, clippy::cast_possible_wrap, clippy::cast_sign_loss)]
fn sample(texture: &ColorImage, uv: Pos2, smooth: bool) -> [f32; 4] {
    let [width, height] = texture.size;
    let texel = |x: isize, y: isize| {
        let x = x.clamp(0, width as isize - 1) as usize;
        let y = y.clamp(0, height as isize - 1) as usize;
        texture.pixels[y * width + x].to_array().map(f32::from)
    };
    let (x, y) = (uv.x * width as f32, uv.y * height as f32);
    if !smooth {
        return texel(x.floor() as isize, y.floor() as isize);
    }
    let (x, y) = (x - 0.5, y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (u, v) = (x - left, y - top);
    let (left, top) = (left as isize, top as isize);
    let [a, b] = [texel(left, top), texel(left + 1, top)];
    let [c, d] = [texel(left, top + 1), texel(left + 1, top + 1)];
    std::array::from_fn(|k| {
        let (above, below) = (a[k] + u * (b[k] - a[k]), c[k] + u * (d[k] - c[k]));
        above + v * (below - above)
    })
}
