//! The open rows of the reference tables, at the standard resolution. Bounds are those the tables' makers set.

use crate::printed::assert_chapter_prints;
use crate::table::{Row, rows};
use flotor_hal::{DQuat, DVec3, Demand, Wrench, orientation_from_rotation_vector};
use flotor_solid::description::{Body, Description, Tool};
use flotor_solid::half_space::HalfSpace;
use flotor_solid::law::Law;
use flotor_solid::punch::{Bond, Outline};
use flotor_solid::remainder::{Face, Remainder, Resolution, Size};
use flotor_solid::table::Table;
use std::f64::consts::TAU;

const STANDARD: Resolution = Resolution::STANDARD;
const CUBE: Size = Size { half_x_m: 0.04, half_y_m: 0.04, height_m: 0.08 };

fn block(row: &Row) -> Size {
    let side: Vec<f64> =
        row.text("block_mm").split('x').map(|mm| mm.parse::<f64>().expect("a side") * 1.0e-3).collect();
    Size { half_x_m: 0.5 * side[0], half_y_m: 0.5 * side[1], height_m: side[2] }
}

fn solve(body: Body, tool: Tool, poisson_ratio: f64) -> Law {
    Description { body, tool, poisson_ratio, resolution: STANDARD }.solve().expect("a solid").0
}

/// Errors of force and of torque over an arm, relative to both together.
fn errors(law: &Law, row: &Row, arm_m: f64) -> (f64, f64) {
    let Law::Bonded(patch) = law else { panic!("a rigid patch") };
    let rotation = orientation_from_rotation_vector(row.vector(["rx_rad", "ry_rad", "rz_rad"]));
    let (wrench, energy_j) = patch.answer(row.vector(["x_m", "y_m", "z_m"]), rotation, Demand::ALL);
    let modulus = row.number("E_pa");
    let (force, torque) = (row.vector(["fx_n", "fy_n", "fz_n"]), row.vector(["tx_nm", "ty_nm", "tz_nm"]));
    let size = force.length() + torque.length() / arm_m;
    let wrench = Wrench::new(wrench.force() * modulus, wrench.torque() * modulus);
    let f = (wrench.force() - force).length() / size;
    let m = (wrench.torque() - torque).length() / arm_m / size;
    println!(
        "{} force {f:.4} torque {m:.4} energy {:+.4}",
        row.text("id"),
        energy_j * modulus / row.number("energy_j") - 1.0
    );
    (f, m)
}

/// Largest errors of a table.
#[derive(Clone, Copy, Default)]
struct Largest {
    force: f64,
    torque: f64,
}

impl Largest {
    fn add(&mut self, (force, torque): (f64, f64)) {
        *self = Self { force: self.force.max(force), torque: self.torque.max(torque) };
    }

    /// Holds the chapter to a row.
    fn assert_printed(self, table: &str, bound: &str) {
        let force = format!(" {:.2} % ", 100.0 * self.force);
        let torque =
            if self.torque > 0.0 { format!(" {:.2} % ", 100.0 * self.torque) } else { " ".to_owned() };
        assert_chapter_prints("solid.md", &format!("| {table} |{force}|{torque}| {bound} |"));
    }
}

#[test]
fn a_plate_at_the_end_of_a_beam() {
    let mut largest = Largest::default();
    for nu in [0.3, 0.45] {
        let law = solve(Body::Beam { size_m: [0.2, 0.04, 0.04] }, Tool::Plate, nu);
        for row in rows("solid/a_cantilever_plate.csv").iter().filter(|row| row.number("nu") == nu) {
            let (f, m) = errors(&law, row, 0.02);
            largest.add((f, m));
            assert!(f < 0.02 && m < 0.02, "{}: {f} {m}", row.text("id"));
        }
    }
    largest.assert_printed("plate on a beam", "2 %");
}

#[test]
fn a_punch_on_a_block() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let round = Outline::Round { radius_m: 0.005 };
    let square = Outline::Square { half_m: 0.01 };
    for (name, bounds, file, outline, arm_m, torque_bound) in [
        ("round punch on a block", "3 %, 7 %", "c_punch.csv", round, 0.005, 0.07),
        ("square punch on a block", "3 %, 6 %", "d_torque.csv", square, 0.01, 0.06),
    ] {
        let mut largest = Largest::default();
        let mut solved: Option<(Size, f64, Bond, Law)> = None;
        for row in &rows(&format!("solid/{file}")) {
            let (size, nu) = (block(row), row.number("nu"));
            let frictionless = row.text("category") == "punch_frictionless";
            let bond = if frictionless { Bond::Frictionless } else { Bond::Bonded };
            if !solved.as_ref().is_some_and(|(s, n, b, _)| *s == size && *n == nu && *b == bond) {
                solved = Some((size, nu, bond, solve(Body::Block(size), Tool::Punch { outline, bond }, nu)));
            }
            let law = &solved.as_ref().expect("just solved").3;
            let (f, m) = errors(law, row, arm_m);
            largest.add((f, m));
            assert!(f < 0.03 && m < torque_bound, "{}: {f} {m}", row.text("id"));
        }
        largest.assert_printed(name, bounds);
    }
}

#[test]
fn a_sphere_on_a_block() {
    if crate::leaves_out_long_tests() {
        return;
    }
    // Each takes some seconds to prepare: quick size has one.
    let is_full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
    let [mut shallow, mut deep] = [Largest::default(); 2];
    for nu in [0.3, 0.45] {
        for radius_m in [0.005, 0.0127] {
            if !is_full && (nu, radius_m) != (0.3, 0.0127) {
                continue;
            }
            let law = solve(Body::Block(CUBE), Tool::Sphere { radius_m }, nu);
            let Law::Sphere(atlas) = law else { panic!("a sphere") };
            let table = rows("solid/b_block_sphere.csv");
            for row in table.iter().filter(|row| row.number("nu") == nu && row.number("radius_m") == radius_m)
            {
                let answer = atlas.answer(row.vector(["cx_m", "cy_m", "cz_m"]).to_array());
                let modulus = row.number("E_pa");
                let force = DVec3::from_array(answer.energy.slope) * -modulus;
                let truth = row.vector(["fx_n", "fy_n", "fz_n"]);
                let error = (force - truth).length() / truth.length();
                let energy = answer.energy.value * modulus / row.number("energy_j") - 1.0;
                println!("{} force {error:.4} energy {energy:+.4}", row.text("id"));
                let is_deep = row.text("category").ends_with("deep");
                let (bound, largest) = if is_deep { (0.05, &mut deep) } else { (0.03, &mut shallow) };
                largest.add((error, 0.0));
                assert!(error < bound, "{}: {error}", row.text("id"));
            }
        }
    }
    if is_full {
        let sphere =
            "sphere on a block: `centre`, `q34` (three quarters of the way to a side), `edge`, `side`";
        shallow.assert_printed(sphere, "3 %");
        deep.assert_printed("the same at a depth of 1.2 radii", "5 %");
    }
}

/// Displacement of the top face under an even load on a disc, at points and distances of the table.
#[test]
fn a_loaded_disc_on_a_block() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let corners: Vec<[f64; 2]> = (0..64)
        .map(|k| {
            let angle = std::f64::consts::TAU * f64::from(k) / 64.0;
            // A polygon with the area of the disc.
            let radius = 0.005 * (std::f64::consts::TAU / 64.0 / (std::f64::consts::TAU / 64.0).sin()).sqrt();
            [radius * angle.cos(), radius * angle.sin()]
        })
        .collect();
    let area = std::f64::consts::PI * 0.005 * 0.005;
    let mut solved: Option<(Size, HalfSpace, Remainder)> = None;
    let mut largest = Largest::default();
    for row in rows("solid/c_surface.csv").iter().filter(|row| row.text("at") != "mean") {
        let solid = HalfSpace { youngs_modulus_pa: row.number("E_pa"), poisson_ratio: row.number("nu") };
        let distance = row.text("at").parse::<f64>().unwrap_or(0.0) * 1.0e-3;
        let at = [0.8 * distance, 0.6 * distance];
        let seen: Vec<[f64; 2]> = corners.iter().map(|c| [c[0] - at[0], c[1] - at[1]]).collect();
        let size = block(row);
        if !solved.as_ref().is_some_and(|(s, h, _)| *s == size && *h == solid) {
            let remainder = Remainder::new(size, solid, STANDARD.fineness()).expect("a solid");
            solved = Some((size, solid, remainder));
        }
        let remainder = &solved.as_ref().expect("just solved").2;
        // The remainder of the disc is that of its middle: smooth over forty millimetres and more.
        let nodes = [0.0, 0.6 * distance.max(0.001), 0.8 * distance.max(0.001)];
        let table = Table::new(remainder, Face::Top, [&nodes, &nodes]);
        let smooth = table.among(&[[0.0; 2], at])[2][2][2];
        let uz_m = (solid.polygon(&seen)[2][2] / area + smooth) * row.number("patch_force_n");
        let error = uz_m / row.number("uz_m") - 1.0;
        largest.add((error.abs(), 0.0));
        println!("{} {error:+.4}", row.text("id"));
        let bound = if distance >= 0.01 { 0.01 } else { 0.02 };
        assert!(error.abs() < bound, "{}: {error}", row.text("id"));
    }
    largest.assert_printed("displacement beside a loaded disc", "1 to 2 %");
}

/// What linear tetrahedra on 99 corners make of the same beam: the tip of the cantilever moves by half.
#[test]
fn linear_tetrahedra_are_half_as_soft() {
    let body = Body::Beam { size_m: [0.2, 0.04, 0.04] };
    let description = |tool| Description { body, tool, poisson_ratio: 0.3, resolution: STANDARD };
    let tip = |tool| {
        let (Law::Bonded(patch), error) = description(tool).solve().expect("a solid") else {
            panic!("a rigid patch")
        };
        // Force and torque of a deflection along z and of a small rotation about y; no torque on the tip.
        let small = 1.0e-6;
        let at =
            |z: f64, angle: f64| patch.answer(DVec3::Z * z, DQuat::from_rotation_y(angle), Demand::ALL).0;
        let (moved, turned) = (at(small, 0.0), at(0.0, small));
        let softened = turned.force().z * moved.torque().y / turned.torque().y;
        (small / (softened - moved.force().z), error)
    };
    let ((linear, error), (quadratic, _)) = (tip(Tool::LinearPlate), tip(Tool::Plate));
    println!("tip: {:.3} of the quadratic one's, estimated {error:.3}", linear / quadratic);
    // -49.3 % for six tetrahedra a cell, by another program on the same grid with an even load; the plate stiffens it a little.
    assert!((linear / quadratic - 0.507).abs() < 0.03, "{linear} {quadratic}");
    assert!(error > 0.2, "{error}");
}

/// Poses of `flotor bench` in 30 s: the hand 4 mm below home.
fn poses_of_the_bench() -> impl Iterator<Item = (DVec3, DQuat)> {
    let sines = |time_s: f64, size: DVec3, rate_hz: DVec3| size * (rate_hz * TAU * time_s).map(f64::sin);
    (0..30_000).map(move |tick| {
        let time_s = f64::from(tick) * 1.0e-3;
        let swing_m = sines(time_s, DVec3::new(1.5e-3, 1.2e-3, 3.0e-3), DVec3::new(1.37, 2.11, 1.03));
        let turn_rad = sines(time_s, DVec3::new(0.030, 0.025, 0.035), DVec3::new(1.71, 2.53, 2.97));
        (swing_m - DVec3::Z * 4.0e-3, orientation_from_rotation_vector(turn_rad))
    })
}

/// The errors that `flotor bench` prints of a plate on a beam, against finite elements of another program on the same elements
/// (`tests/generators/beam.py`).
#[test]
fn errors_against_the_finest_beam_are_those_of_an_independent_program() {
    if crate::leaves_out_long_tests() {
        return;
    }
    let body = Body::Beam { size_m: [0.2, 0.04, 0.04] };
    let patch = |tool, resolution| {
        let description = Description { body, tool, poisson_ratio: 0.3, resolution };
        let Ok((Law::Bonded(patch), _)) = description.solve() else { panic!("a rigid patch") };
        patch
    };
    let (modulus_pa, fine) = (1.0e4, patch(Tool::Plate, Resolution::FINE));
    let table = rows("solid/bench_beam.csv");
    assert_eq!(table.len(), 3);
    for row in &table {
        let case = match row.text("case") {
            "quick" => patch(Tool::Plate, Resolution::QUICK),
            "standard" => patch(Tool::Plate, STANDARD),
            _ => patch(Tool::LinearPlate, STANDARD),
        };
        let (mut largest, mut squares) = ([0.0_f64; 2], [0.0; 2]);
        for (position_m, orientation) in poses_of_the_bench() {
            let [own, best] =
                [&case, &fine].map(|patch| patch.answer(position_m, orientation, Demand::ALL).0);
            let off = [(own.force() - best.force()).length(), (own.torque() - best.torque()).length()];
            for ((largest, squares), off) in largest.iter_mut().zip(&mut squares).zip(off) {
                *largest = largest.max(off * modulus_pa);
                *squares += (off * modulus_pa).powi(2);
            }
        }
        let rms = squares.map(|sum: f64| (sum / 30_000.0).sqrt());
        let columns = ["force_max_n", "force_rms_n", "torque_max_nm", "torque_rms_nm"];
        for (column, found) in columns.into_iter().zip([largest[0], rms[0], largest[1], rms[1]]) {
            // The same elements have the same solution. The table has five digits; a difference of two stiffnesses that agree to 1e-4
            // loses four of sixteen.
            let expected = row.number(column);
            assert!(
                (found / expected - 1.0).abs() < 1.0e-3,
                "{} {column}: {found}, not {expected}",
                row.text("case")
            );
        }
    }
}
