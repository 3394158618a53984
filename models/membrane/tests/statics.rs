//! Networks at rest against closed forms: the elastic catenary, the sheet under its weight; and how the error falls with
//! the distance of masses.

use crate::printed::assert_chapter_prints;
use flotor_hal::DVec3;
use flotor_membrane::mesh::{Link, Mesh, Sheet};
use flotor_membrane::network::{Network, Surroundings};
use std::f64::consts::PI;

/// Comes to rest: fast first, then with ever less drag to let the last slow swing go.
fn at_rest(mesh: &Mesh, gravity_m_per_s2: f64, damping_per_s: f64) -> Network {
    let surroundings = Surroundings { gravity_m_per_s2, damping_per_s, contact_n_per_m: 0.0 };
    let mut network = Network::new(mesh, surroundings);
    assert!(network.come_to_rest(2_000_000), "it does not come to rest");
    network
}

/// Holds the chapter to a row: a case, its masses, and these errors to so many digits of a per cent.
fn assert_book_has(case: &str, errors: &[f64], digits: usize) {
    let errors: Vec<String> = errors.iter().map(|error| format!("{:.digits$} %", 100.0 * error)).collect();
    assert_chapter_prints("membrane.md", &format!("| {case} | {} |", errors.join(", ")));
}

/// Compares errors with those of Newton's method on networks of its own (`tests/generators/statics.py`).
fn assert_newton_finds(case: &str, errors: &[f64], tolerance: f64) {
    let table = include_str!("../../../tests/data/cases/membrane_statics.csv");
    let of_case = table.lines().filter(|line| line.starts_with(case));
    let expected: Vec<f64> = of_case.filter_map(|line| line.rsplit(',').next()?.parse().ok()).collect();
    assert_eq!(expected.len(), errors.len());
    for (found, expected) in errors.iter().zip(expected) {
        assert!((found - expected).abs() < tolerance, "{case}: {found}, not {expected}");
    }
}

/// Depth of the middle of an elastic cable below its ends, m (Irvine 1981, Cable Structures, chapter 1): span `l`, unstrained
/// length `s`, weight `w` and stiffness `ea`. The horizontal force follows from the span by bisection.
fn catenary_sag_m(l: f64, s: f64, w: f64, ea: f64) -> f64 {
    let span = |h: f64| 2.0 * (h / w * s * (w / (2.0 * h)).asinh() + 0.5 * h * s / ea);
    let (mut low, mut high) = (1.0e-6 * w, 1.0e6 * w);
    for _ in 0..200 {
        let between = (low * high).sqrt();
        if span(between) < l { low = between } else { high = between }
    }
    let h = low;
    h * s / w * ((1.0 + (w / (2.0 * h)).powi(2)).sqrt() - 1.0) + w * s / (8.0 * ea)
}

/// Chain of `links` equal springs along x between two fixed ends `span_m` apart, at height 0. `length_m`: rest length;
/// `axial_n`: force that would double the length; `mass_kg`: total mass, half a link's at each end.
fn chain(links: usize, span_m: f64, length_m: f64, axial_n: f64, mass_kg: f64) -> Mesh {
    let rest_m = length_m / links as f64;
    let mut mesh = Mesh::default();
    for node in 0..=links {
        let x_m = span_m * (node as f64 / links as f64 - 0.5);
        let held = node == 0 || node == links;
        mesh.positions_m.push(DVec3::X * x_m);
        mesh.masses_kg.push(if held { 0.0 } else { mass_kg / links as f64 });
        if node > 0 {
            mesh.links.push(Link { ends: [node - 1, node], rest_m, stiffness_n_per_m: axial_n / rest_m });
        }
    }
    mesh
}

#[test]
fn a_hanging_chain_is_the_elastic_catenary_and_its_error_falls_with_the_square_of_its_links() {
    // A metre and a fifth of cable, 60 g, over a metre; a hundred newtons would stretch it to double.
    let (span_m, length_m, mass_kg, axial_n) = (1.0, 1.2, 0.06, 100.0);
    let weight_n = mass_kg * 9.806_65;
    let exact_m = catenary_sag_m(span_m, length_m, weight_n, axial_n);
    let errors: Vec<f64> = [16, 32, 64]
        .map(|links| {
            let mesh = chain(links, span_m, length_m, axial_n, mass_kg);
            let network = at_rest(&mesh, 9.806_65, 20.0);
            let sag_m = -network.positions_m().get(links / 2).z;
            (sag_m / exact_m - 1.0).abs()
        })
        .to_vec();
    assert_book_has("chain, elastic catenary (Irvine 1981) | 16, 32, 64 links", &errors, 3);
    // Masses below 1 µm/s are inactive: the slowest swing, of some 5 rad/s, then has 0.2 µm, of a sag of 0.3 m.
    assert_newton_finds("chain", &errors, 1.0e-6);
    assert!(errors[2] < 1.0e-3, "{errors:?}");
    for pair in errors.windows(2) {
        // Second order: a quarter with twice the links, and terms of fourth order beside it.
        assert!((pair[0] / pair[1] - 4.0).abs() < 0.4, "{errors:?}");
    }
}

/// Depth of the middle of a square membrane under a uniform load, in units of `p a^2 / S`: the series of the Poisson problem
/// (Timoshenko and Goodier, Theory of Elasticity, soap-film analogy), 0.0736713...
fn square_sag() -> f64 {
    let odd = |i: u32| f64::from(2 * i + 1);
    let term = |i: u32| {
        let n = odd(i);
        let sign = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * (1.0 - 1.0 / (0.5 * n * PI).cosh()) / n.powi(3)
    };
    4.0 / PI.powi(3) * (0..2000).map(term).sum::<f64>()
}

#[test]
fn the_series_of_the_square_is_the_published_number() {
    assert!((square_sag() - 0.073_671_3).abs() < 1.0e-7, "{}", square_sag());
}

#[test]
fn a_stretched_square_sags_as_a_membrane_and_its_error_falls_with_the_square_of_the_distance() {
    let errors: Vec<f64> = [9, 17, 33]
        .map(|nodes_per_side| {
            let sheet =
                Sheet { nodes_per_side, side_m: 0.1, mass_kg: 0.01, stiffness_n_per_m: 200.0, stretch: 1.25 };
            let mesh = Mesh::sheet(&sheet);
            // Tension over a spacing: k (h - l0) / h. Little gravity, so that sagging adds no tension of its own: the sheet
            // goes down by a thousandth of its side, and its tension rises by the square of that.
            let tension_n_per_m = 200.0 * (1.0 - 1.0 / 1.25);
            let gravity_m_per_s2 = 0.01 * 0.1 * tension_n_per_m / (0.01 * square_sag()) * 0.1;
            let exact_m = square_sag() * 0.01 * gravity_m_per_s2 / tension_n_per_m;
            let network = at_rest(&mesh, gravity_m_per_s2, 60.0);
            let middle = nodes_per_side * nodes_per_side / 2;
            let sag_m = -network.positions_m().get(middle).z;
            (sag_m / exact_m - 1.0).abs()
        })
        .to_vec();
    assert_book_has("square under its weight, Poisson series | 9², 17², 33²", &errors, 2);
    // Likewise: a swing of 281 rad/s then has 3.6 nm, of a sag of 0.1 mm.
    assert_newton_finds("square", &errors, 3.6e-5);
    assert!(errors[2] < 1.0e-3, "{errors:?}");
    for pair in errors.windows(2) {
        assert!((pair[0] / pair[1] - 4.0).abs() < 0.4, "{errors:?}");
    }
}

#[test]
fn a_sheet_without_gravity_is_at_rest_as_it_is() {
    let sheet =
        Sheet { nodes_per_side: 17, side_m: 0.04, mass_kg: 0.01, stiffness_n_per_m: 200.0, stretch: 1.25 };
    let mesh = Mesh::sheet(&sheet);
    let network = at_rest(&mesh, 0.0, 10.0);
    for (index, start) in mesh.positions_m.iter().enumerate() {
        // Opposite springs pull alike but for rounding of lengths of 4 cm.
        assert!((network.positions_m().get(index) - *start).length() < 1.0e-14);
    }
    assert_eq!(network.active_nodes(), 0);
}
