//! A ball against curved bodies, grooves and lumps: one place solved directly on a refined mesh, against the open rows.

use crate::leaves_out_long_tests;
use crate::table::{Row, rows};
use flotor_solid::condensation::Condensation;
use flotor_solid::gmsh;
use flotor_solid::grid::Lame;
use flotor_solid::mesh::Mesh;
use flotor_solid::refinement::{Grading, Refinement};
use flotor_solid::touch::{Touch, Zone};

/// A mesh of the test data: `dome`, `groove` or `lump`, with 8, 10 and 16 mm elements, as Gmsh writes them.
pub(crate) fn mesh(name: &str) -> Mesh {
    let path = format!("{}/tests/data/{name}.msh", env!("CARGO_MANIFEST_DIR"));
    let text = gmsh::to_text(&std::fs::read(path).expect("a file")).expect("a binary mesh");
    Mesh::in_place(gmsh::read(&text).expect("a mesh"), "fixed", None).expect("a body")
}

/// The body of a row, its lump `factor` as stiff.
pub(crate) fn body(name: &str, poisson_ratio: f64, factor: f64) -> Condensation {
    let mesh = mesh(name);
    let base = Refinement::new(&mesh).expect("tetrahedra");
    let material = |region: &String| Lame::new(if region == "lump" { factor } else { 1.0 }, poisson_ratio);
    let materials = mesh.regions.iter().map(material).collect();
    let regions = mesh.elements.iter().map(|element| element.region).collect();
    Condensation::new(base, materials, regions).expect("positive definite")
}

/// Solves for a row; `points_m`: where the mesh is refined.
fn solve(body: &Condensation, row: &Row, points_m: Vec<[f64; 3]>) -> Touch {
    let radius_m = row.number("radius_m");
    let reach_m = (radius_m * row.number("depth_m")).sqrt();
    let centre_m = row.vector(["cx_m", "cy_m", "cz_m"]).to_array();
    // A contact with an edge is smaller than one with a plane.
    let least_m = if points_m.len() > 1 { 0.3 } else { 0.6 } * reach_m;
    let grading = Grading { points_m, least_m, grade: 0.7 };
    let zone = Zone::new(body, &grading, &[centre_m], radius_m).expect("positive definite");
    zone.solve(centre_m, radius_m, &Touch::default()).expect("a contact")
}

/// The vector error of the force, and the relative error of the energy.
fn errors(row: &Row, touch: &Touch) -> (f64, f64) {
    let modulus = row.number("E_pa");
    let exact = row.vector(["fx_n", "fy_n", "fz_n"]);
    let force = flotor_hal::DVec3::from_array(touch.force_n) * modulus;
    let errors =
        ((force - exact).length() / exact.length(), touch.energy_j * modulus / row.number("energy_j") - 1.0);
    println!("{} force {:.4} energy {:+.4} cells {}", row.text("id"), errors.0, errors.1, touch.cells);
    errors
}

/// The rows of a table with one of these ids.
fn some(file: &str, ids: &[&str]) -> Vec<Row> {
    let found: Vec<Row> = rows(file).into_iter().filter(|row| ids.contains(&row.text("id"))).collect();
    assert_eq!(found.len(), ids.len());
    found
}

/// The place of a row: below the centre along the normal.
fn place(row: &Row) -> Vec<[f64; 3]> {
    let below = row.number("radius_m") - row.number("depth_m");
    let normal = row.vector(["nx", "ny", "nz"]);
    vec![(row.vector(["cx_m", "cy_m", "cz_m"]) - normal * below).to_array()]
}

/// The bound is that of the tables, 4 %, on meshes of twice their elements.
#[test]
fn a_dome_and_a_groove_answer_as_the_tables_say() {
    let dome = body("dome", 0.3, 1.0);
    for row in some("solid/g_dome.csv", &["g004", "g012", "g028", "g036"]) {
        let (force, energy) = errors(&row, &solve(&dome, &row, place(&row)));
        assert!(force < 0.04 && energy.abs() < 0.04, "{force} {energy}");
    }
    if leaves_out_long_tests() {
        return;
    }
    let groove = body("groove", 0.3, 1.0);
    let lips = vec![[0.01, 0.0, 0.0], [-0.01, 0.0, 0.0]];
    for row in some("solid/h_concave.csv", &["h004", "h008", "h012"]) {
        let points = if row.text("id") == "h004" { place(&row) } else { lips.clone() };
        let (force, energy) = errors(&row, &solve(&groove, &row, points));
        assert!(force < 0.04 && energy.abs() < 0.04, "{force} {energy}");
    }
}

/// The bound of the contrast is a tenth of the lump's contribution: the errors of the mesh cancel in the ratio.
#[test]
fn a_lump_is_felt_as_much_as_it_is_there() {
    if leaves_out_long_tests() {
        return;
    }
    let [with, without] = [10.0, 1.0].map(|factor| body("lump", 0.3, factor));
    for (row, plain) in
        some("solid/f_contrast.csv", &["fc012"]).iter().zip(&some("solid/f_inclusion.csv", &["f024"]))
    {
        let solved = [&with, &without].map(|body| solve(body, plain, place(plain)));
        assert!(errors(plain, &solved[1]).0 < 0.03);
        let ratio = solved[0].force_n[2] / solved[1].force_n[2];
        let exact = row.number("ratio_fz");
        println!("ratio {ratio:.4} instead of {exact:.4}");
        assert!((ratio - exact).abs() < (0.1 * (exact - 1.0)).max(0.01), "{ratio} {exact}");
    }
}

/// Halving elements changes neither the volume nor the shape of a curved body.
#[test]
fn a_refined_mesh_fills_the_same_volume_and_has_no_hanging_nodes() {
    let mesh = mesh("dome");
    let volume = |all: &Refinement| -> f64 {
        let each = all.elements().map(|(_, nodes)| {
            let places = nodes.map(|node| all.nodes_m[node as usize]);
            let geometry = flotor_solid::cells::Geometry {
                kind: flotor_solid::cells::Kind::Tetrahedron,
                nodes_m: &places,
            };
            geometry.kind.rule().iter().map(|(at, weight)| weight * geometry.slopes(*at).1).sum::<f64>()
        });
        each.sum()
    };
    let base = Refinement::new(&mesh).expect("tetrahedra");
    let mut fine = base.clone();
    fine.refine(&Grading { points_m: vec![[0.0; 3]], least_m: 2.0e-3, grade: 0.5 });
    let (before, after) = (base.elements().count(), fine.elements().count());
    assert!(after > 2 * before, "{before} {after}");
    assert!((volume(&fine) / volume(&base) - 1.0).abs() < 1.0e-12);
    // Every touched corner edge belongs to two touched faces, or the surface ends there at the fixed face.
    let mut edges = std::collections::BTreeMap::<[u32; 2], usize>::new();
    for face in fine.elements().flat_map(|(leaf, _)| fine.touched(leaf)) {
        for k in 0..3 {
            let [a, b] = [face[k], face[(k + 1) % 3]];
            *edges.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    assert!(
        edges
            .iter()
            .all(|(edge, n)| *n == 2 || *n == 1 && edge.iter().all(|node| fine.fixed[*node as usize]))
    );
}

#[test]
fn a_binary_mesh_that_is_cut_anywhere_is_an_error() {
    let bytes = std::fs::read(format!("{}/tests/data/dome.msh", env!("CARGO_MANIFEST_DIR"))).expect("a file");
    for end in [20, 60, 500, 5_000, bytes.len() / 2, bytes.len() - 20] {
        let read = gmsh::to_text(&bytes[..end]).and_then(|text| gmsh::read(&text));
        assert!(read.is_err(), "cut at {end}");
    }
}
