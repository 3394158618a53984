//! Surface of the undeformed body as triangles for pictures, fine near the tool.
//!
//! Each face has its own corners, so that edges are rendered sharp. Not real-time.

use crate::half_space::arsinh;
use crate::mesh::{Facet, Mesh};
use flotor_hal::glam::DVec2;
use flotor_hal::{DVec3, math};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Triangle mesh, counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
#[must_use]
pub struct Skin {
    /// Undeformed positions of the corners, m.
    pub places_m: Vec<DVec3>,
    /// Corner indices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Region in which a surface is divided finely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focus {
    /// Centre, m.
    pub at_m: DVec3,
    /// Width of the region, m.
    pub width_m: f64,
}

/// Rings and sectors of a disc.
const RINGS: usize = 32;
const SECTORS: usize = 48;
/// Number of levels of a cylinder's side.
const LEVELS: usize = 12;

impl Focus {
    /// Returns borders of `count` steps from `low` to `high`, about `width / 10` wide at the focus, growing away from it.
    fn steps(self, axis: usize, low: f64, high: f64, count: usize) -> Vec<f64> {
        let at = self.at_m.to_array()[axis].clamp(low, high);
        let stretch = |x: f64| arsinh((x - at) / self.width_m);
        let (from, to) = (stretch(low), stretch(high));
        let mut steps: Vec<f64> = (0..=count)
            .map(|i| at + self.width_m * math::sinh(from + (to - from) * i as f64 / count as f64))
            .collect();
        (steps[0], steps[count]) = (low, high);
        steps
    }
}

impl Skin {
    /// Triangulates top and sides of a block with the middle of its top at the origin; `steps`: numbers of steps along
    /// x, y, z.
    pub fn block(half_m: [f64; 2], height_m: f64, focus: Focus, steps: [usize; 3]) -> Self {
        let [half_x, half_y] = half_m;
        let x = focus.steps(0, -half_x, half_x, steps[0]);
        let y = focus.steps(1, -half_y, half_y, steps[1]);
        let z = focus.steps(2, -height_m, 0.0, steps[2]);
        Self::boxed(&x, &y, &z, &[Face::Top, Face::Left, Face::Right, Face::Front, Face::Back])
    }

    /// Triangulates the given faces of a box on the grid lines `x`, `y`, `z` (m, ascending); the box spans the first to
    /// the last line of each.
    pub fn boxed(x: &[f64], y: &[f64], z: &[f64], faces: &[Face]) -> Self {
        let mut skin = Self::default();
        let last = |steps: &[f64]| steps.last().copied().unwrap_or_default();
        for face in faces {
            match face {
                Face::Top => skin.lattice(y, x, |y, x| DVec3::new(x, y, last(z))),
                Face::Bottom => skin.lattice(x, y, |x, y| DVec3::new(x, y, z[0])),
                Face::Right => skin.lattice(z, y, |z, y| DVec3::new(last(x), y, z)),
                Face::Left => skin.lattice(y, z, |y, z| DVec3::new(x[0], y, z)),
                Face::Back => skin.lattice(x, z, |x, z| DVec3::new(x, last(y), z)),
                Face::Front => skin.lattice(z, x, |z, x| DVec3::new(x, y[0], z)),
            }
        }
        skin
    }

    /// Adds a lattice of quads; the direction along a row, then across rows, turns left seen from outside.
    fn lattice(&mut self, rows: &[f64], columns: &[f64], place: impl Fn(f64, f64) -> DVec3) {
        let first = self.places_m.len();
        self.places_m.extend(
            rows.iter()
                .flat_map(|&row| columns.iter().map(move |&c| (row, c)))
                .map(|(row, column)| place(row, column)),
        );
        self.quads(first, rows.len(), columns.len(), columns.len() - 1);
    }

    /// Adds triangles between rows of `columns` corners each, `steps` quads in a row: as many as corners if a row is closed.
    #[allow(clippy::cast_possible_truncation)] // some thousand corners
    fn quads(&mut self, first: usize, rows: usize, columns: usize, steps: usize) {
        for row in 0..rows.saturating_sub(1) {
            for step in 0..steps {
                let corner = |row: usize, step: usize| (first + row * columns + step % columns) as u32;
                let [a, b, c, d] = [
                    corner(row, step),
                    corner(row, step + 1),
                    corner(row + 1, step + 1),
                    corner(row + 1, step),
                ];
                self.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
    }

    /// Triangulates a disc about the origin: lines from the focus to evenly spaced points of the rim, divided at
    /// growing distances.
    pub fn disc(radius_m: f64, focus: Focus) -> Self {
        /// Largest distance of the focus from the centre, in radii.
        const MOST: f64 = 0.97;
        let middle_m = focus.at_m.truncate().clamp_length_max(MOST * radius_m);
        let width = focus.width_m / radius_m;
        let end = arsinh(1.0 / width);
        let mut skin = Self::default();
        for ring in 0..=RINGS {
            // Rows run inwards: along one, then across, is a left turn seen from above.
            let share = width * math::sinh(end * (RINGS - ring) as f64 / RINGS as f64);
            skin.places_m.extend((0..SECTORS).map(|sector| {
                let (sine, cosine) = math::sin_cos(TAU * sector as f64 / SECTORS as f64);
                middle_m.lerp(DVec2::new(cosine, sine) * radius_m, share).extend(0.0)
            }));
        }
        skin.quads(0, RINGS + 1, SECTORS, SECTORS);
        skin
    }

    /// Triangulates top and side of a round cylinder with the middle of its top at the origin.
    pub fn cylinder(radius_m: f64, height_m: f64, focus: Focus) -> Self {
        let mut skin = Self::disc(radius_m, focus);
        let rim: Vec<DVec3> = skin.places_m[..SECTORS].to_vec();
        let first = skin.places_m.len();
        let levels = focus.steps(2, -height_m, 0.0, LEVELS);
        for &z in &levels {
            skin.places_m.extend(rim.iter().map(|place| place.with_z(z)));
        }
        skin.quads(first, levels.len(), SECTORS, SECTORS);
        skin
    }

    /// Triangulates the touched and the free surface of a mesh, which meet in a sharp edge; also returns the node of each corner.
    pub fn of_mesh(mesh: &Mesh) -> (Self, Vec<usize>) {
        let (mut skin, mut nodes) = (Self::default(), Vec::new());
        for facets in [&mesh.touched, &mesh.free] {
            let mut corners: BTreeMap<usize, u32> = BTreeMap::new();
            for [a, b, c] in facets.iter().flat_map(pieces) {
                let triangle = [a, b, c].map(|node| {
                    *corners.entry(node).or_insert_with(|| {
                        nodes.push(node);
                        u32::try_from(nodes.len() - 1).unwrap_or(u32::MAX)
                    })
                });
                skin.triangles.push(triangle);
            }
        }
        skin.places_m = nodes.iter().map(|&node| DVec3::from_array(mesh.nodes_m[node])).collect();
        (skin, nodes)
    }
}

/// Face of a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// Upper face, with the normal along z.
    Top,
    /// Lower face, with the normal along -z.
    Bottom,
    /// Right face, with the normal along x.
    Right,
    /// Left face, with the normal along -x.
    Left,
    /// Back face, with the normal along y.
    Back,
    /// Front face, with the normal along -y.
    Front,
}

/// Splits a facet into triangles between its corners and the middles of its edges.
fn pieces(facet: &Facet) -> Vec<[usize; 3]> {
    let (count, node) = (facet.corners, |k: usize| facet.nodes[k]);
    let middle = |k: usize| node(count + k);
    let mut triangles: Vec<[usize; 3]> =
        (0..count).map(|k| [node(k), middle(k), middle((k + count - 1) % count)]).collect();
    triangles.extend((1..count - 1).map(|k| [middle(0), middle(k), middle(k + 1)]));
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOCUS: Focus = Focus { at_m: DVec3::new(0.03, -0.01, 0.0), width_m: 2.0e-3 };

    /// Volume between the origin and the triangles, six times; and the area.
    fn sizes(skin: &Skin) -> (f64, f64) {
        skin.triangles.iter().fold((0.0, 0.0), |(volume, area), triangle| {
            let [a, b, c] = triangle.map(|corner| skin.places_m[corner as usize]);
            (volume + a.cross(b).dot(c) / 6.0, area + 0.5 * (b - a).cross(c - a).length())
        })
    }

    #[test]
    fn every_triangle_faces_outwards_and_none_is_missing() {
        let block = Skin::block([0.04, 0.03], 0.05, FOCUS, [32, 32, 11]);
        let (volume, area) = sizes(&block);
        // From the origin, which lies in the top face, the volume is that of the four pyramids below the sides.
        let inside = 2.0 * (0.08 * 0.05 * 0.03 + 0.06 * 0.05 * 0.04) / 3.0;
        assert!((volume / inside - 1.0).abs() < 1.0e-12, "{volume} {inside}");
        assert!((area - (0.08 * 0.06 + 2.0 * 0.05 * (0.08 + 0.06))).abs() < 1.0e-12, "{area}");
        assert!(block.triangles.len() <= 5_000, "{}", block.triangles.len());

        let cylinder = Skin::cylinder(0.04, 0.05, FOCUS);
        let (volume, area) = sizes(&cylinder);
        let (round, side) = (TAU * 0.5 * 0.04 * 0.04, TAU * 0.04 * 0.05);
        // A polygon of 48 sides instead of the circle: a third of a hundredth of its area.
        assert!((area / (round + side) - 1.0).abs() < 0.003, "{area}");
        assert!((volume / (side * 0.04 / 3.0) - 1.0).abs() < 0.003, "{volume}");
        assert!(cylinder.triangles.len() <= 5_000, "{}", cylinder.triangles.len());
    }

    #[test]
    fn corners_are_close_to_each_other_at_the_focus() {
        for skin in [Skin::block([0.04; 2], 0.08, FOCUS, [32, 32, 11]), Skin::cylinder(0.04, 0.08, FOCUS)] {
            let near = skin.places_m.iter().filter(|place| place.distance(FOCUS.at_m) < FOCUS.width_m);
            // An even grid of as many corners has three there.
            assert!(near.count() > 20);
        }
    }

    #[test]
    fn a_mesh_keeps_its_surface() {
        let mesh = Mesh::cylinder(0.02, 0.03, 2).expect("a cylinder");
        let (skin, nodes) = Skin::of_mesh(&mesh);
        assert_eq!(skin.places_m.len(), nodes.len());
        let (_, area) = sizes(&skin);
        let round = TAU * (0.5 * 0.02 * 0.02 + 0.02 * 0.03);
        assert!((area / round - 1.0).abs() < 0.02, "{area} {round}");
    }
}
