//! The proxy against an exhaustive search over all patches, for poses reached from outside.
//!
//! The proxy must be at the free place nearest to the tool. Where it is not, the nearest place must be unreachable: the reference
//! then follows the path of the tool.

use crate::contact::{Hand, material};
use crate::exhaustive::Patches;
use crate::shapes::{Numbers, cuboid, globe, sheet, soup, soup_of_both, surface, torus};
use flotor_hal::{DVec3, math};
use flotor_surface::soup::Soup;
use flotor_surface::surface::Surface;

/// Largest difference, m: the bound of the search.
const SAME_M: f64 = 1.0e-9;

/// Body between a polygon in x and z, and y from `-half_m` to `half_m`, in `n` parts; fans about the
/// first corner, which sees all others, close the ends.
fn prism(profile: &[DVec3], half_m: f64, n: u32) -> Soup {
    let count = profile.len() as u32;
    let points: Vec<DVec3> = (0..=n)
        .flat_map(|j| {
            let y = half_m * (2.0 * f64::from(j) / f64::from(n) - 1.0);
            profile.iter().map(move |p| p.with_y(y))
        })
        .collect();
    let at = |i: u32, j: u32| i % count + j * count;
    let mut triangles: Vec<[u32; 3]> = Vec::new();
    for i in 0..count {
        for j in 0..n {
            triangles.push([at(i, j), at(i, j + 1), at(i + 1, j + 1)]);
            triangles.push([at(i, j), at(i + 1, j + 1), at(i + 1, j)]);
        }
    }
    for i in 1..count - 1 {
        triangles.push([at(0, 0), at(i, 0), at(i + 1, 0)]);
        triangles.push([at(0, n), at(i + 1, n), at(i, n)]);
    }
    soup(&points, triangles)
}

/// Cone of `n` sides with its tip at the origin, downwards.
fn cone(n: u32, radius_m: f64, height_m: f64) -> Soup {
    let mut points = vec![DVec3::ZERO, DVec3::Z * -height_m];
    points.extend((0..n).map(|i| {
        let (s, c) = math::sin_cos(f64::from(i) / f64::from(n) * std::f64::consts::TAU);
        DVec3::new(radius_m * c, radius_m * s, -height_m)
    }));
    let at = |i: u32| 2 + i % n;
    soup(&points, (0..n).flat_map(|i| [[0, at(i), at(i + 1)], [1, at(i + 1), at(i)]]).collect())
}

/// Profile of a block with a V-shaped groove from the top, `half_m` wide to each side and as deep as that times `slope`.
fn grooved(half_m: f64, slope: f64) -> Vec<DVec3> {
    let corner = |x: f64, z: f64| DVec3::new(x, 0.0, z);
    let wall = |share: f64, side: f64| corner(side * share * half_m, (share - 1.0) * half_m * slope);
    let outer = [
        wall(1.0, -1.0),
        corner(-0.012, 0.0),
        corner(-0.012, -0.012),
        corner(0.012, -0.012),
        corner(0.012, 0.0),
        wall(1.0, 1.0),
    ];
    // Most patches at the bottom.
    let (left, right) = ([0.0, 0.15, 0.3, 0.5], [0.5, 0.3, 0.15]);
    let left = left.map(|share| wall(share, -1.0));
    left.into_iter().chain(outer).chain(right.map(|share| wall(share, 1.0))).collect()
}

/// Counts of a shape.
#[derive(Default)]
struct Count {
    poses: usize,
    contacts: usize,
    several: usize,
    points: usize,
    followed: usize,
    wrong: usize,
    worst_m: f64,
    worst_point_m: f64,
}

fn compare(name: &str, surface: &Surface, deepest_m: f64, poses: usize, seed: u64) -> Count {
    let patches = Patches::new(surface);
    let mut numbers = Numbers(seed);
    let mut count = Count::default();
    while count.poses < poses {
        let radius_m = [0.0, 2.0e-5, 5.0e-4, 2.0e-3][(numbers.next() * 4.0) as usize];
        let patch = &surface.patches()[(numbers.next() * surface.count() as f64) as usize];
        let (a, b) = (numbers.next(), numbers.next());
        let at = if a + b > 1.0 { [1.0 - a, 1.0 - b, a + b - 1.0] } else { [a, b, 1.0 - a - b] };
        let (point_m, normal) = (patch.point_m(at), patch.normal(at));
        let beside = |numbers: &mut Numbers, far_m: f64| numbers.direction() * (far_m * numbers.next());
        let start_m = point_m + normal * (radius_m + 2.0e-3) + beside(&mut numbers, 1.5e-3);
        let end_m = point_m + normal * (radius_m - deepest_m * numbers.next()) + beside(&mut numbers, 5.0e-4);
        let is_rim = surface.has_borders() && point_m.x.abs().max(point_m.y.abs()) > 6.5e-3;
        if is_rim || !patches.is_free(start_m, radius_m) || patches.is_inside(start_m) {
            continue;
        }
        count.poses += 1;
        let mut hand = Hand::new(surface, material(0.0, 0.0), radius_m, start_m);
        let answer = hand.slowly_to(end_m);
        let proxy_m = hand.proxy_m();
        count.contacts += usize::from(answer.contacts > 0);
        count.several += usize::from(answer.contacts > 1);
        let (nearest_m, is_clear) = patches.nearest(end_m, radius_m, proxy_m);
        let misses = |q_m: DVec3| ((q_m - end_m).length() - (proxy_m - end_m).length()).abs();
        let mut miss_m = misses(nearest_m);
        if miss_m <= SAME_M {
            if is_clear {
                count.points += 1;
                count.worst_point_m = count.worst_point_m.max((nearest_m - proxy_m).length());
            }
        } else {
            count.followed += 1;
            miss_m = misses(patches.followed(start_m, end_m, radius_m));
        }
        let is_free = patches.is_free(proxy_m, radius_m);
        count.worst_m = count.worst_m.max(miss_m);
        if miss_m > SAME_M || !is_free || !answer.is_settled {
            count.wrong += 1;
            if count.wrong <= 8 {
                println!(
                    "{name}: pose {} radius {radius_m:e} from {start_m} to {end_m}: proxy {proxy_m} depth {:e} contacts {} \
                     settled {} free {is_free}; nearest {nearest_m} at {:e}, followed {:e} off by {miss_m:e}",
                    count.poses,
                    answer.depth_m,
                    answer.contacts,
                    answer.is_settled,
                    (nearest_m - end_m).length(),
                    (patches.followed(start_m, end_m, radius_m) - end_m).length(),
                );
            }
        }
    }
    println!(
        "{name}: {} poses, {} in contact, {} with several contacts, {} where the nearest place is not reachable; depth differs by {:e} m, \
         the point by {:e} m in {} poses; {} wrong",
        count.poses,
        count.contacts,
        count.several,
        count.followed,
        count.worst_m,
        count.worst_point_m,
        count.points,
        count.wrong
    );
    count
}

#[test]
fn the_proxy_is_where_a_search_of_all_patches_finds_it() {
    let size = std::env::var("FLOTOR_TEST_SIZE").unwrap_or_default();
    let poses = match size.as_str() {
        "full" => 8_400, // 1e5 in all
        "daily" => 300,
        _ => 60,
    };
    let plate = DVec3::new(0.01, 0.01, 1.0e-4);
    let half = DVec3::splat(0.01);
    let bumpy =
        |d: DVec3| 0.02 + 6.0e-4 * math::sin(12.0 * d.x) * math::sin(12.0 * d.y) * math::sin(12.0 * d.z);
    let shapes: [(&str, Soup, f64); 12] = [
        ("plane", sheet(6, |_, _| 0.0), 1.5e-3),
        (
            "edge",
            prism(&[DVec3::new(-0.01, 0.0, -0.01), DVec3::new(0.01, 0.0, -0.01), DVec3::ZERO], 0.01, 4),
            1.5e-3,
        ),
        ("vertex", cuboid(-half, half, 3), 1.5e-3),
        ("needle", cone(7, 1.0e-3, 0.02), 1.0e-3),
        ("saddle", sheet(20, |x, y| (x * x - y * y) / 0.03), 1.5e-3),
        ("groove", prism(&grooved(4.0e-3, 1.0), 0.01, 4), 1.5e-3),
        ("narrow groove", prism(&grooved(1.0e-3, 4.0), 0.01, 3), 1.5e-3),
        ("thin plate", cuboid(-plate, plate, 4), 1.5e-3),
        (
            "coincident faces",
            soup_of_both(cuboid(-half, half.with_x(0.0), 2), cuboid(-half.with_x(0.0), half, 2)),
            1.5e-3,
        ),
        (
            "coincident faces of two grids",
            soup_of_both(cuboid(-half, half.with_x(0.0), 2), cuboid(-half.with_x(0.0), half, 3)),
            1.5e-3,
        ),
        ("bumpy sphere", globe(48, 96, bumpy), 1.0e-3),
        ("torus", torus(0.02, 0.008, 48, 24), 1.5e-3),
    ];
    let mut wrong = 0;
    for (number, (name, soup, deepest_m)) in shapes.into_iter().enumerate() {
        let count = compare(name, &surface(soup, 30.0), deepest_m, poses, 101 + number as u64);
        wrong += count.wrong + usize::from(count.worst_point_m > SAME_M);
    }
    assert_eq!(wrong, 0);
}
