//! Mesh of a round cylinder: bricks whose edges follow the rim.

use crate::cells::Kind;
use crate::grid::graded;
use crate::mesh::{Element, Mesh, MeshError, Parts};
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

impl Mesh {
    /// Meshes a round cylinder with its fixed bottom below and the middle of its touched top at the origin. The bricks
    /// follow the rim; in the middle there is a square of `m` times `m` bricks. Lengths in m. Not real-time.
    ///
    /// # Errors
    /// [`MeshError::Inverted`] if the numbers do not describe a cylinder, [`MeshError::Extent`] for a side of more than 10 m.
    pub fn cylinder(radius_m: f64, height_m: f64, m: usize) -> Result<Self, MeshError> {
        let half = 0.45 * radius_m;
        // Positions are indexed by twice their number, so that middles of edges have whole indices too.
        let line = |i: usize| half * (i as f64 / m as f64 - 1.0);
        let around = |t: usize| {
            let (side, along) = (t / (2 * m) % 4, t % (2 * m));
            let (a, b) = (line(along), half);
            match side {
                0 => [a, -b],
                1 => [b, a],
                2 => [-a, b],
                _ => [-b, -a],
            }
        };
        let rings = m.div_ceil(2) + 1;
        let shares = graded(1.0, 0.0, rings, 1.35);
        let heights = graded(0.0, -height_m, m + 1, 1.35);
        let between = |borders: &[f64], i: usize| 0.5 * (borders[i / 2] + borders[i.div_ceil(2)]);
        // Each coordinate of a brick's 20 nodes is -1, 0 or 1: border before the brick, middle, border after.
        let index = |coordinate: f64, brick: usize| match coordinate {
            c if c < -0.5 => 2 * brick,
            c if c > 0.5 => 2 * brick + 2,
            _ => 2 * brick + 1,
        };
        let ring = |r: usize, t: usize| {
            let share = between(&shares, r);
            let turn = PI * (t as f64 / (4 * m) as f64 - 0.75);
            let (sine, cosine) = flotor_hal::math::sin_cos(turn);
            let square = around(t % (8 * m));
            [
                square[0] * (1.0 - share) + share * radius_m * cosine,
                square[1] * (1.0 - share) + share * radius_m * sine,
            ]
        };
        let mut builder =
            Gatherer { parts: Parts::default(), found: BTreeMap::new(), unit_m: 1.0e-7 * radius_m };
        for layer in 0..=m {
            let high = |k: f64| between(&heights, index(k, layer));
            for j in 0..m {
                for i in 0..m {
                    builder.brick(&|at| [line(index(at[0], i)), line(index(at[1], j)), high(at[2])]);
                }
            }
            for t in 0..4 * m {
                for r in 0..rings {
                    builder.brick(&|at| {
                        let [x, y] = ring(index(at[0], r), index(at[1], t));
                        [x, y, high(at[2])]
                    });
                }
            }
        }
        let parts = builder.into_parts(|z| {
            if z > -1.0e-6 * height_m {
                Some("touched")
            } else {
                (z < -height_m * (1.0 - 1.0e-6)).then_some("fixed")
            }
        });
        Self::new(parts, "fixed", "touched")
    }
}

/// Collects bricks and merges nodes at equal positions.
struct Gatherer {
    parts: Parts,
    found: BTreeMap<[i64; 3], usize>,
    unit_m: f64,
}

impl Gatherer {
    /// Adds one brick, with its new nodes; `place` maps the coordinates of its reference nodes to positions, m.
    fn brick(&mut self, place: &dyn Fn([f64; 3]) -> [f64; 3]) {
        let nodes = Kind::Brick.node_places().into_iter().map(|at| self.node(place(at))).collect();
        let tag = self.parts.elements.len() + 1;
        self.parts.elements.push(Element { kind: Kind::Brick, nodes, tag, region: 0 });
    }

    #[allow(clippy::cast_possible_truncation)] // 1e7 units to a radius
    fn node(&mut self, at: [f64; 3]) -> usize {
        // Offset the rounding, so that rounding errors do not separate equal positions.
        let key = at.map(|c| (c / self.unit_m + 0.237).floor() as i64);
        let nodes_m = &mut self.parts.nodes_m;
        *self.found.entry(key).or_insert_with(|| {
            nodes_m.push(at);
            nodes_m.len() - 1
        })
    }

    /// Returns the parts, with the faces all of whose corners lie at a named height.
    fn into_parts(mut self, name: impl Fn(f64) -> Option<&'static str>) -> Parts {
        for element in &self.parts.elements {
            for face in element.kind.faces() {
                let corners: Vec<usize> = face.iter().map(|&k| element.nodes[k]).collect();
                let names: BTreeSet<_> =
                    corners.iter().map(|&node| name(self.parts.nodes_m[node][2])).collect();
                if let (1, Some(Some(name))) = (names.len(), names.first()) {
                    self.parts.surfaces.entry((*name).to_owned()).or_default().push(corners);
                }
            }
        }
        self.parts
    }
}
