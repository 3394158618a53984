//! The smooth surface: order of its error, continuous normals, planes.

use crate::shapes::{Numbers, as_stl, cuboid, globe, icosphere, surface, torus};
use flotor_hal::DVec3;
use flotor_surface::surface::Surface;

const EVERYWHERE: f64 = f64::INFINITY;

/// Largest errors of position (m) and normal (rad) against a truth, over random places.
fn errors(surface: &Surface, truth: impl Fn(DVec3) -> (f64, DVec3)) -> (f64, f64) {
    let mut numbers = Numbers(7);
    (0..20_000).fold((0.0_f64, 0.0_f64), |(far, bent), _| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let patch = &surface.patches()[(numbers.next() * surface.count() as f64) as usize];
        let (a, b) = (numbers.next(), numbers.next());
        let at = if a + b > 1.0 { [1.0 - a, 1.0 - b, a + b - 1.0] } else { [a, b, 1.0 - a - b] };
        let (miss, normal) = truth(patch.point_m(at));
        (far.max(miss.abs()), bent.max(patch.normal(at).cross(normal).length()))
    })
}

#[test]
fn a_sphere_of_triangles_is_a_sphere() {
    let radius_m = 0.02;
    let sphere = |p: DVec3| (p.length() - radius_m, p.normalize());
    let found: Vec<(f64, f64)> =
        [2, 3, 4, 5].map(|level| errors(&surface(as_stl(icosphere(radius_m, level)), 30.0), sphere)).to_vec();
    println!("sphere {found:?}");
    let globe = errors(&surface(globe(32, 64, |_| radius_m), 30.0), sphere);
    println!("globe {globe:?}");
    assert!(found[1].0 < 5.0e-6 && found[1].1 < 0.0174 && found[3].0 < 5.0e-7);
}

#[test]
fn a_torus_of_triangles_is_a_torus() {
    let truth = |p: DVec3| {
        let ring = p.with_z(0.0).normalize() * 0.02;
        ((p - ring).length() - 0.008, (p - ring).normalize())
    };
    let found: Vec<(f64, f64)> =
        [16, 32, 64, 128].map(|n| errors(&surface(torus(0.02, 0.008, 2 * n, n), 30.0), truth)).to_vec();
    println!("torus {found:?}");
    assert!(found[2].0 < found[1].0 / 4.0);
}

#[test]
fn normals_are_continuous_over_edges() {
    let bumpy =
        |d: DVec3| 0.02 + 0.001 * (flotor_hal::math::sin(5.0 * d.x + 1.0) * flotor_hal::math::sin(6.0 * d.y));
    let surface = surface(globe(24, 48, bumpy), 60.0);
    let mut largest = 0.0_f64;
    for t in 0..surface.count() {
        for edge in 0..3 {
            let Some((other, there)) = surface.neighbour(t, edge) else { panic!("closed") };
            for s in [0.1, 0.37, 0.8] {
                let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
                (a[edge], a[(edge + 1) % 3]) = (1.0 - s, s);
                (b[there], b[(there + 1) % 3]) = (s, 1.0 - s);
                let (p, q) = (&surface.patches()[t], &surface.patches()[other]);
                assert!((p.point_m(a) - q.point_m(b)).length() < 1.0e-15);
                largest = largest.max(p.normal(a).cross(q.normal(b)).length());
            }
        }
    }
    println!("normals differ by {largest:e}");
    // Displacements are stored in binary32: 6e-8 of the slope of a displacement.
    assert!(largest < 1.0e-6, "{largest}");
}

#[test]
fn a_box_is_flat() {
    let surface = surface(cuboid(DVec3::new(-0.01, -0.02, 0.0), DVec3::new(0.03, 0.01, 0.005), 3), 30.0);
    for patch in surface.patches() {
        for at in [[0.2, 0.3, 0.5], [0.5, 0.5, 0.0], [0.9, 0.05, 0.05]] {
            let flat = patch.corners().iter().zip(at).map(|(p, x)| *p * x).sum::<DVec3>();
            assert!((patch.point_m(at) - flat).length() < 1.0e-17);
        }
    }
}

#[test]
fn the_search_finds_the_nearest_of_all_patches() {
    let surface = surface(torus(0.02, 0.008, 48, 24), 30.0);
    let mut numbers = Numbers(3);
    for _ in 0..300 {
        let c = numbers.direction() * 0.03 * numbers.next();
        let found = surface.nearest(c, EVERYWHERE, |_| true).expect("a surface");
        let best =
            surface.patches().iter().map(|patch| patch.nearest(c).distance_m).fold(EVERYWHERE, f64::min);
        assert!((found.foot.distance_m - best).abs() < 1.0e-12, "{c} {} {best}", found.foot.distance_m);
    }
}

/// Cylinder about z with flat ends: `n` strips of `m` squares, and fans as ends.
fn cylinder(radius_m: f64, height_m: f64, n: u32, m: u32) -> flotor_surface::soup::Soup {
    let mut points = vec![DVec3::ZERO, DVec3::Z * height_m];
    for j in 0..=m {
        for i in 0..n {
            let (s, c) = flotor_hal::math::sin_cos(f64::from(i) / f64::from(n) * std::f64::consts::TAU);
            points.push(DVec3::new(radius_m * c, radius_m * s, height_m * f64::from(j) / f64::from(m)));
        }
    }
    let at = |i: u32, j: u32| 2 + j * n + i % n;
    let mut triangles = Vec::new();
    for i in 0..n {
        triangles.push([0, at(i + 1, 0), at(i, 0)]);
        triangles.push([1, at(i, m), at(i + 1, m)]);
        for j in 0..m {
            triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    crate::shapes::soup(&points, triangles)
}

#[test]
fn a_cylinder_is_round_with_flat_ends_and_a_round_rim() {
    for (n, m) in [(24, 1), (24, 20), (48, 3)] {
        let surface = surface(cylinder(0.01, 0.03, n, m), 30.0);
        let is_end = |p: DVec3| p.z < 1.0e-12 || p.z > 0.03 - 1.0e-12;
        let truth = |p: DVec3| {
            let out = p.with_z(0.0);
            if is_end(p) && out.length() < 0.0099 {
                return (0.0, DVec3::Z);
            }
            (out.length() - 0.01, out.normalize())
        };
        let mut worst = 0.0_f64;
        for patch in surface.patches() {
            for at in [[0.3, 0.3, 0.4], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.8, 0.1, 0.1]] {
                let p = patch.point_m(at);
                let is_of_end = patch.flat_normal().z.abs() > 0.5;
                if is_of_end {
                    assert!(is_end(p) && p.with_z(0.0).length() < 0.01 + 1.0e-6, "{p}");
                } else {
                    worst = worst.max(truth(p).0.abs());
                }
            }
        }
        println!("cylinder {n} {m}: {worst:e} m");
        // The facets of 24 strips lie 86 um under the cylinder: forty times as far.
        assert!(worst < 2.0e-6, "{n} {m}: {worst}");
    }
}

#[test]
fn a_plane_beside_a_curve_stays_a_plane() {
    // Slab whose long sides are half cylinders of 12 strips each.
    let mut profile: Vec<DVec3> = Vec::new();
    for (side, from) in [(1.0, -0.5), (-1.0, 0.5)] {
        for i in 0..=12 {
            let (s, c) = flotor_hal::math::sin_cos((from + f64::from(i) / 12.0) * std::f64::consts::PI);
            profile.push(DVec3::new(side * 0.01 + 0.002 * c, 0.0, 0.002 * s));
        }
    }
    let n = profile.len() as u32;
    let mut points = profile.clone();
    points.extend(profile.iter().map(|p| *p + DVec3::Y * 0.03));
    let at = |i: u32, j: u32| i % n + j * n;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for i in 0..n {
        triangles.push([at(i, 0), at(i, 1), at(i + 1, 1)]);
        triangles.push([at(i, 0), at(i + 1, 1), at(i + 1, 0)]);
    }
    for i in 1..n - 1 {
        triangles.push([at(0, 0), at(i, 0), at(i + 1, 0)]);
        triangles.push([at(0, 1), at(i + 1, 1), at(i, 1)]);
    }
    let surface = surface(crate::shapes::soup(&points, triangles), 30.0);
    let mut count = 0;
    for patch in surface.patches().iter().filter(|patch| patch.flat_normal().z.abs() > 0.9999) {
        for at in [[0.3, 0.3, 0.4], [0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]] {
            let p = patch.point_m(at);
            if p.x.abs() < 0.0099 {
                count += 1;
                assert!((p.z.abs() - 0.002).abs() < 1.0e-9, "{p}");
            }
        }
    }
    assert!(count >= 8, "{count}");
}
