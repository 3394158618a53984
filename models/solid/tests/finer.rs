//! The law of a sphere on a block beside single contacts that are solved anew: finer elements, finer cells, a table of its own
//! about the place. What is left are the errors of the law's splines, grids and cells.

use crate::contact::Numbers;
use flotor_hal::DVec3;
use flotor_solid::description::{Body, Description, Tool};
use flotor_solid::half_space::HalfSpace;
use flotor_solid::law::Law;
use flotor_solid::remainder::{Face, Fineness, Remainder, Resolution, Size};
use flotor_solid::sphere::{Contact, Patch, Problem};
use flotor_solid::table::Table;

/// Finer than any resolution of the plugin.
const FINENESS: Fineness = Fineness { across: 5, high: 6, order: 4 };
const RINGS: i32 = 10;

struct Bench {
    size: Size,
    radius_m: f64,
    remainder: Remainder,
    patch: Patch,
}

impl Bench {
    /// What the block adds to a half-space around a place, as far as a contact reaches.
    fn table(&self, face: Face, place_m: [f64; 2]) -> Table {
        let [p, q, _] = face.axes();
        let half = [self.size.half_x_m, self.size.half_y_m];
        let reach_m = 1.2 * self.radius_m;
        let nodes = [0, 1].map(|k| {
            let (low, high) = match [p, q][k] {
                2 => (-self.size.height_m, 0.0),
                axis => (-half[axis], half[axis]),
            };
            let around = (-4..=4).map(|i| (place_m[k] + reach_m * f64::from(i) / 4.0).clamp(low, high));
            let mut nodes: Vec<f64> = around.map(|x| if [p, q][k] == 2 { x } else { x.abs() }).collect();
            nodes.sort_by(f64::total_cmp);
            // Cubics through points that are nearly one would be rough.
            nodes.dedup_by(|a, b| (*a - *b).abs() < 0.1 * reach_m);
            nodes
        });
        Table::new(&self.remainder, face, [&nodes[0], &nodes[1]])
    }

    /// Force on the sphere, N, that touches a face at a place, for a modulus of one; `None` if the contact has snapped through.
    fn force_n(&self, face: Face, place_m: [f64; 2], table: &Table, depth_m: f64) -> Option<DVec3> {
        let [p, q, w] = face.axes();
        let half = [self.size.half_x_m, self.size.half_y_m];
        let inside = |axis: usize, x: f64| {
            if axis < 2 { x.abs() <= half[axis] } else { -self.size.height_m <= x && x <= 0.0 }
        };
        let mut before: Option<Contact> = None;
        for step in 1..=8 {
            let root = (depth_m / self.radius_m).sqrt() * f64::from(step) / 8.0;
            let now_m = self.radius_m * root * root;
            let cell_m = 1.25 * (self.radius_m * now_m).sqrt()
                / (1.0 + 0.12 * now_m / self.radius_m)
                / f64::from(RINGS);
            let points: Vec<[f64; 2]> = self
                .patch
                .points_m(cell_m)
                .iter()
                .map(|at| [at[0] + place_m[0], at[1] + place_m[1]])
                .collect();
            let on_face: Vec<bool> = points.iter().map(|at| inside(p, at[0]) && inside(q, at[1])).collect();
            let smooth = table.among(&points);
            let problem = Problem {
                radius_m: self.radius_m,
                depth_m: now_m,
                cell_m,
                on_face: &on_face,
                smooth: &smooth,
            };
            before = Some(self.patch.solve(&problem, before.as_ref()).ok()?);
        }
        let local = before?.force_n;
        let mut force = [0.0; 3];
        (force[p], force[q], force[w]) = (local[0], local[1], local[2]);
        Some(DVec3::from_array(force))
    }
}

/// Error that the book states for places nearer than half a radius to two edges.
const NEAR_TWO_EDGES: f64 = 0.25;

/// Rows of the kinds of the reference tables at other places, depths, ratios and sizes: the bound of those tables. Besides, places
/// near a corner, and so near that the book states another error.
#[test]
fn other_places_depths_and_bodies() {
    if !std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full") {
        return;
    }
    let cube = Size { half_x_m: 0.04, half_y_m: 0.04, height_m: 0.08 };
    let slab = Size { half_x_m: 0.05, half_y_m: 0.03, height_m: 0.03 };
    let mut numbers = Numbers(7);
    for (size, poisson_ratio, radius_m) in [(cube, 0.3, 0.005), (cube, 0.45, 0.0127), (slab, 0.4, 0.008)] {
        let solid = HalfSpace { youngs_modulus_pa: 1.0, poisson_ratio };
        let description = Description {
            body: Body::Block(size),
            tool: Tool::Sphere { radius_m },
            poisson_ratio,
            resolution: Resolution::STANDARD,
        };
        let Law::Sphere(atlas) = description.solve().expect("a solid").0 else { panic!("a sphere") };
        let bench = Bench {
            size,
            radius_m,
            remainder: Remainder::new(size, solid, FINENESS).expect("a solid"),
            patch: Patch::new(&solid, RINGS),
        };
        let rounding_m = (0.02 * (2.0 * size.half_y_m).min(size.height_m)).min(0.25 * radius_m);
        for kind in ["centre", "q34", "edge", "side", "corner", "two edges"] {
            let (mut worst, mut compared) = ((0.0, String::new()), 0);
            let mut near = |about: f64, by: f64| numbers.between(about - by, about + by);
            let half_m = [size.half_x_m, size.half_y_m];
            let (face, place_m) = match kind {
                "centre" => (Face::Top, [0.0, 0.0]),
                "q34" => (Face::Top, [near(0.75 * size.half_x_m, 0.001), near(0.0, 0.0015)]),
                "edge" => (Face::Top, [size.half_x_m - near(0.007, 0.0005), near(0.0, 0.015)]),
                "corner" => (Face::Top, half_m.map(|half_m| half_m - near(0.007, 0.0005))),
                // Just outside what the rounding of the edges changes.
                "two edges" => (Face::SideX, [size.half_y_m - 2.1 * rounding_m, -3.5 * rounding_m]),
                _ => (Face::SideX, [near(0.0, 0.010), -near(0.025, 0.002).min(0.7 * size.height_m)]),
            };
            let table = bench.table(face, place_m);
            for depth_m in [0.0005, 0.001, 0.002, 0.003, 0.006, 0.008, 0.012] {
                if depth_m > 1.2 * radius_m {
                    continue;
                }
                let Some(truth) = bench.force_n(face, place_m, &table, depth_m) else {
                    println!("{kind} {depth_m}: snapped through");
                    continue;
                };
                let mut centre = face.point_m(size, place_m);
                centre[face.axes()[2]] += radius_m - depth_m;
                let answer = atlas.answer(centre);
                let force = -DVec3::from_array(answer.energy.slope);
                compared += 1;
                let error = (force - truth).length() / truth.length();
                println!("  {kind} {place_m:?} {depth_m}: {error:.4}");
                let bound = match kind {
                    "two edges" => NEAR_TWO_EDGES,
                    _ if depth_m >= radius_m => 0.05,
                    _ => 0.03,
                };
                if error / bound > worst.0 {
                    worst = (error / bound, format!("{place_m:?} {depth_m}: {error:.4}"));
                }
            }
            println!(
                "nu {poisson_ratio} R {radius_m} {size:?} {kind}: worst {} of its bound, {}",
                worst.0, worst.1
            );
            assert!(compared >= 4 && worst.0 < 1.0, "{kind} {compared} {}", worst.1);
        }
    }
}
