//! Ground of the scene: a grid that fades out, and soft shadows, as visual cues for height and depth.
//!
//! Grid and surface are static; only the shadows change from frame to frame.

use super::{Color, MM_PER_M, Mesh, Vertex};
use flotor_hal::DVec3;
use flotor_hal::glam::DVec2;
use std::f64::consts::TAU;

/// Round patch of the plane `z = height_m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ground {
    /// Height of the plane, m.
    pub height_m: f64,
    /// Radius at which the ground has faded out, m.
    pub radius_m: f64,
    /// Distance between grid lines, m.
    pub spacing_m: f64,
    /// Colour of the surface in the middle.
    pub surface: Color,
    /// Colour of the lines.
    pub line: Color,
}

/// Soft dark spot on the ground.
#[derive(Clone, Copy, Debug)]
pub struct Shadow {
    /// Centre, m.
    pub center_m: DVec2,
    /// Radius at which two thirds of the strength are lost, m; the shadow ends at twice this radius.
    pub radius_m: f64,
    /// Darkness of the centre, 0 to 1.
    pub strength: f64,
}

/// Numbers of rings and sectors of the surface: fine enough for soft shadows.
const RINGS: usize = 48;
const SECTORS: usize = 96;
/// Half the width of a grid line, as a fraction of the line distance.
const LINE_HALF_WIDTH: f64 = 0.012;
/// Height of the lines above the surface, as a fraction of the line distance, so that they are drawn in front.
const LINE_LIFT: f64 = 0.002;

impl Ground {
    /// Adds surface and grid lines, without shadows. The ground must be the first part of the mesh: bodies cover it, and
    /// [`Ground::shade`] darkens the first vertices.
    pub fn append(&self, mesh: &mut Mesh) {
        self.surface(mesh);
        self.lines(mesh);
    }

    /// Darkens the vertices of the surface, which [`Ground::append`] has added at the start of `corners`, by the shadows; replaces
    /// earlier shadows.
    pub fn shade(&self, corners: &mut [Vertex], shadows: &[Shadow]) {
        for corner in corners.iter_mut().take((RINGS + 1) * (SECTORS + 1)) {
            let [x_mm, y_mm, _] = corner.position_mm.map(f64::from);
            let at_m = DVec2::new(x_mm, y_mm) / MM_PER_M;
            let light = shadows.iter().fold(1.0, |light, shadow| light * (1.0 - shadow.at(at_m)));
            let [r, g, b, _] = darker(self.surface, light);
            corner.color = [r, g, b, corner.color[3]];
        }
    }

    fn fade(&self, at: DVec2) -> f64 {
        let x = (1.0 - at.length() / self.radius_m).clamp(0.0, 1.0);
        x * x * (3.0 - 2.0 * x)
    }

    fn surface(&self, mesh: &mut Mesh) {
        mesh.sheet(RINGS + 1, |mesh, k| {
            // Denser in the middle, where the shadows are.
            let radius_m = self.radius_m * (k as f64 / RINGS as f64).powf(1.6);
            let corner = |i: usize| {
                let at = DVec2::from_angle(TAU * i as f64 / SECTORS as f64) * radius_m;
                let color = with_opacity(self.surface, self.fade(at));
                mesh.vertex(at.extend(self.height_m), DVec3::ZERO, color)
            };
            (0..=SECTORS).map(corner).collect::<Vec<u32>>()
        });
    }

    #[allow(clippy::cast_possible_truncation)] // a few dozen lines
    fn lines(&self, mesh: &mut Mesh) {
        const PIECES: usize = 24;
        let count = (self.radius_m / self.spacing_m) as i32;
        let height_m = self.height_m + LINE_LIFT * self.spacing_m;
        let half_m = LINE_HALF_WIDTH * self.spacing_m;
        for across_x in [true, false] {
            for line in -count..=count {
                let offset_m = f64::from(line) * self.spacing_m;
                let reach_m = (self.radius_m.powi(2) - offset_m.powi(2)).max(0.0).sqrt();
                mesh.sheet(PIECES + 1, |mesh, piece| {
                    let along_m = reach_m * (2.0 * piece as f64 / PIECES as f64 - 1.0);
                    let at = |side: f64| {
                        let (u, v) = (along_m, offset_m + side * half_m);
                        if across_x { DVec2::new(u, v) } else { DVec2::new(-v, u) }
                    };
                    let color = with_opacity(self.line, self.fade(at(0.0)));
                    [-1.0, 1.0].map(|side| mesh.vertex(at(side).extend(height_m), DVec3::ZERO, color))
                });
            }
        }
    }
}

impl Shadow {
    /// Returns the darkness at a point: `strength (1 - x/4)^4` of the squared distance x in radii, close to `exp(-x)`, 0 from two radii on.
    fn at(&self, point_m: DVec2) -> f64 {
        let left = 1.0 - 0.25 * point_m.distance_squared(self.center_m) / (self.radius_m * self.radius_m);
        let square = left.max(0.0) * left.max(0.0);
        self.strength * square * square
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a part of 255
fn darker(color: Color, light: f64) -> Color {
    let [r, g, b, a] = color;
    let [r, g, b] = [r, g, b].map(|part| (f64::from(part) * light.clamp(0.0, 1.0)) as u8);
    [r, g, b, a]
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a part of 255
fn with_opacity(color: Color, opacity: f64) -> Color {
    let [r, g, b, a] = color;
    [r, g, b, (f64::from(a) * opacity.clamp(0.0, 1.0)) as u8]
}
