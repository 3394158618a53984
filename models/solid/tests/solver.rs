//! The solver of finite elements: patch test, beams, faces.

use crate::table::rows;
use flotor_solid::basis::gauss;
use flotor_solid::dissection::{GridStiffness, Stiffness, subtract_forces};
use flotor_solid::grid::{Grid, Lame};

/// Displacements of the outside prescribed as a linear field: the inside follows exactly.
#[test]
fn a_linear_field_on_the_outside_continues_inside() {
    let grid = Grid::new([vec![0.0, 0.1, 0.35, 0.5], vec![-0.2, 0.0, 0.3], vec![1.0, 1.3, 1.4, 1.8, 2.0]], 2);
    let lame = Lame::new(1.0e4, 0.45);
    let along = grid.nodes_along();
    let gradient = [[0.01, 0.02, -0.03], [0.005, -0.02, 0.04], [0.03, 0.01, 0.02]];
    let exact = |node: usize, i: usize| {
        let x = grid.position_m(node);
        0.2 + (0..3).map(|j| gradient[i][j] * x[j]).sum::<f64>()
    };
    let outside = |node: usize| {
        let index = grid.index(node);
        (0..3).any(|axis| index[axis] == 0 || index[axis] == along[axis] - 1)
    };
    let count = grid.node_count();
    let assembly = GridStiffness::new(&grid, lame);
    let stiffness = Stiffness::new(&assembly, (0..count).map(|node| [outside(node); 3]).collect()).unwrap();
    let mut prescribed = vec![0.0; 3 * count];
    for node in (0..count).filter(|&node| outside(node)) {
        for i in 0..3 {
            prescribed[3 * node + i] = exact(node, i);
        }
    }
    let mut u = vec![0.0; 3 * count];
    subtract_forces(&assembly, &prescribed, &mut u, 1);
    stiffness.solve(&mut u, 1);
    for node in (0..count).filter(|&node| !outside(node)) {
        for i in 0..3 {
            // The bound; condition 1e4 at nu 0.45 leaves 1e-12.
            let error = (u[3 * node + i] - exact(node, i)).abs();
            assert!(error < 1.0e-10, "{error:e}");
        }
    }
}

/// A cantilever on ten by two by two quadratic elements (99 corners), under end forces and couples spread over its end face:
/// mean displacement and work-conjugate mean rotation.
#[test]
fn a_beam_of_few_elements_bends_as_it_should() {
    let (length, side) = (0.2, 0.04);
    let even = |from: f64, to: f64, count: u32| -> Vec<f64> {
        (0..=count).map(|i| from + (to - from) * f64::from(i) / f64::from(count)).collect()
    };
    let cross = even(-0.5 * side, 0.5 * side, 2);
    let grid = Grid::new([even(-length, 0.0, 10), cross.clone(), cross], 2);
    let count = grid.node_count();
    let last = grid.nodes_along()[0] - 1;
    let fixed: Vec<[bool; 3]> = (0..count).map(|node| [grid.index(node)[0] == 0; 3]).collect();
    let (area, second) = (side * side, side.powi(4) / 12.0);
    let columns = ["fx_n", "fy_n", "fz_n", "tx_nm", "ty_nm", "tz_nm"];
    let rule = gauss(4);
    // Weights of the nodes of the end face in an integral over it, of a function of y and z.
    let spread = |function: &dyn Fn(f64, f64) -> [f64; 3]| {
        let mut forces = vec![0.0; 3 * count];
        for (ey, ez) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            for (u, wu) in rule.points.iter().zip(&rule.weights) {
                for (v, wv) in rule.points.iter().zip(&rule.weights) {
                    let half = 0.25 * side;
                    let y = -0.5 * side + half * (2.0 * f64::from(ey) + 1.0 + u);
                    let z = -0.5 * side + half * (2.0 * f64::from(ez) + 1.0 + v);
                    let sample = grid.sample([0.0, y, z]);
                    let value = function(y, z);
                    for (node, share) in sample.nodes.iter().zip(&sample.shares) {
                        for i in 0..3 {
                            forces[3 * node + i] += wu * wv * half * half * share * value[i];
                        }
                    }
                }
            }
        }
        forces
    };
    let modes: [&dyn Fn(f64, f64) -> [f64; 3]; 6] = [
        &|_, _| [1.0 / area, 0.0, 0.0],
        &|_, _| [0.0, 1.0 / area, 0.0],
        &|_, _| [0.0, 0.0, 1.0 / area],
        &|y, z| [0.0, -z / (2.0 * second), y / (2.0 * second)],
        &|_, z| [z / second, 0.0, 0.0],
        &|y, _| [-y / second, 0.0, 0.0],
    ];
    let loads: Vec<Vec<f64>> = modes.iter().map(|mode| spread(mode)).collect();
    assert!((0..count).filter(|&node| grid.index(node)[0] == last).count() == 25);
    for row in rows("solid/a_cantilever_load.csv") {
        let lame = Lame::new(row.number("E_pa"), row.number("nu"));
        let stiffness = Stiffness::new(&GridStiffness::new(&grid, lame), fixed.clone()).unwrap();
        let mut u = vec![0.0; 3 * count];
        for (load, column) in loads.iter().zip(columns) {
            u.iter_mut().zip(load).for_each(|(sum, f)| *sum += row.number(column) * f);
        }
        stiffness.solve(&mut u, 1);
        let answer: Vec<f64> =
            loads.iter().map(|load| load.iter().zip(&u).map(|(f, u)| f * u).sum()).collect();
        let truth =
            ["ux_m", "uy_m", "uz_m", "thx_rad", "thy_rad", "thz_rad"].map(|column| row.number(column));
        let error = |range: std::ops::Range<usize>| {
            let size = truth[range.clone()].iter().map(|t| t * t).sum::<f64>().sqrt();
            let miss = range.map(|i| (answer[i] - truth[i]).powi(2)).sum::<f64>().sqrt();
            if size > 0.0 { miss / size } else { 0.0 }
        };
        let (translation, rotation) = (error(0..3), error(3..6));
        println!("{} translation {translation:.4} rotation {rotation:.4}", row.text("id"));
        let bound = if row.number("nu") < 0.4 { 0.02 } else { 0.04 };
        assert!(translation < bound && rotation < bound, "{}: {translation} {rotation}", row.text("id"));
    }
}
