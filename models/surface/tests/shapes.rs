//! Meshes by formulas.

use flotor_hal::{DVec3, math};
use flotor_surface::normals::Normals;
use flotor_surface::soup::Soup;
use flotor_surface::surface::Surface;
use flotor_surface::topology::connect;
use flotor_surface::weld::weld;
use std::collections::BTreeMap;

/// Returns points and triangles as a soup in metres.
pub(crate) fn soup(points: &[DVec3], triangles: Vec<[u32; 3]>) -> Soup {
    Soup { points: points.iter().map(|p| p.to_array()).collect(), triangles, ..Soup::default() }
}

/// Returns the smooth surface of a soup in metres.
pub(crate) fn surface(soup: Soup, edge_angle_deg: f64) -> Surface {
    let (mut mesh, _) = weld(soup, 1.0);
    let topology = connect(&mut mesh).expect("two sides");
    let normals = Normals::new(&mesh, &topology, edge_angle_deg.to_radians());
    Surface::new(&mesh, &topology, &normals)
}

/// Rounds the points to binary32, as an STL file has them in millimetres.
pub(crate) fn as_stl(mut soup: Soup) -> Soup {
    #[allow(clippy::cast_possible_truncation)]
    for p in &mut soup.points {
        *p = p.map(|x| f64::from((x * 1.0e3) as f32) * 1.0e-3);
    }
    soup
}

/// Icosahedron, each face split into four `level` times, on a sphere.
pub(crate) fn icosphere(radius_m: f64, level: u32) -> Soup {
    let g = (1.0 + 5.0_f64.sqrt()) * 0.5;
    let mut points: Vec<DVec3> = [
        [-1.0, g, 0.0],
        [1.0, g, 0.0],
        [-1.0, -g, 0.0],
        [1.0, -g, 0.0],
        [0.0, -1.0, g],
        [0.0, 1.0, g],
        [0.0, -1.0, -g],
        [0.0, 1.0, -g],
        [g, 0.0, -1.0],
        [g, 0.0, 1.0],
        [-g, 0.0, -1.0],
        [-g, 0.0, 1.0],
    ]
    .iter()
    .map(|p| DVec3::from_array(*p).normalize())
    .collect();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    for _ in 0..level {
        let mut middles = BTreeMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .iter()
            .flat_map(|&[a, b, c]| {
                let (p, q, r) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, p, r], [p, b, q], [r, q, c], [p, q, r]]
            })
            .collect();
    }
    soup(&points.iter().map(|p| *p * radius_m).collect::<Vec<_>>(), triangles)
}

/// Closed grid over two angles, `point(u, v)` with both from 0 to 1.
pub(crate) fn ring_grid(n: u32, m: u32, point: impl Fn(f64, f64) -> DVec3) -> Soup {
    let points: Vec<DVec3> =
        (0..n * m).map(|i| point(f64::from(i / m) / f64::from(n), f64::from(i % m) / f64::from(m))).collect();
    let at = |i: u32, j: u32| (i % n) * m + j % m;
    let triangles = (0..n * m)
        .flat_map(|k| {
            let (i, j) = (k / m, k % m);
            [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
        })
        .collect();
    soup(&points, triangles)
}

/// Torus about z.
pub(crate) fn torus(big_m: f64, small_m: f64, n: u32, m: u32) -> Soup {
    ring_grid(n, m, |u, v| {
        let (su, cu) = math::sin_cos(u * std::f64::consts::TAU);
        let (sv, cv) = math::sin_cos(v * std::f64::consts::TAU);
        let out = big_m + small_m * cv;
        DVec3::new(out * cu, out * su, small_m * sv)
    })
}

/// Globe of rings and meridians with a radius by direction.
pub(crate) fn globe(rings: u32, meridians: u32, radius_m: impl Fn(DVec3) -> f64) -> Soup {
    let direction = |i: u32, j: u32| {
        let (s, c) = math::sin_cos(f64::from(i) / f64::from(rings) * std::f64::consts::PI);
        let (sp, cp) = math::sin_cos(f64::from(j) / f64::from(meridians) * std::f64::consts::TAU);
        DVec3::new(s * cp, s * sp, c)
    };
    let mut points = vec![DVec3::Z * radius_m(DVec3::Z), -DVec3::Z * radius_m(-DVec3::Z)];
    for i in 1..rings {
        for j in 0..meridians {
            let d = direction(i, j);
            points.push(d * radius_m(d));
        }
    }
    let at = |i: u32, j: u32| match i {
        0 => 0,
        i if i == rings => 1,
        i => 2 + (i - 1) * meridians + j % meridians,
    };
    let mut triangles = Vec::new();
    for i in 0..rings {
        for j in 0..meridians {
            if i + 1 < rings {
                triangles.push([at(i, j), at(i + 1, j), at(i + 1, j + 1)]);
            }
            if i > 0 {
                triangles.push([at(i, j), at(i + 1, j + 1), at(i, j + 1)]);
            }
        }
    }
    soup(&points, triangles)
}

/// Box between two corners, each side of `n` by `n` squares of two triangles.
pub(crate) fn cuboid(low: DVec3, high: DVec3, n: u32) -> Soup {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for (side, from) in [(0, low), (1, high)] {
            let (a, b) = ((axis + 1) % 3, (axis + 2) % 3);
            let first = points.len() as u32;
            for i in 0..=n {
                for j in 0..=n {
                    let mut p = from;
                    p[a] = low[a] + (high[a] - low[a]) * f64::from(i) / f64::from(n);
                    p[b] = low[b] + (high[b] - low[b]) * f64::from(j) / f64::from(n);
                    points.push(p);
                }
            }
            for i in 0..n {
                for j in 0..n {
                    let at = |i: u32, j: u32| first + i * (n + 1) + j;
                    let mut square = [
                        [at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                        [at(i, j), at(i + 1, j + 1), at(i, j + 1)],
                    ];
                    if side == 0 {
                        square.iter_mut().for_each(|t| t.swap(1, 2));
                    }
                    triangles.extend(square);
                }
            }
        }
    }
    soup(&points, triangles)
}

/// Sheet over a square of 20 mm, `n` cells to a side.
pub(crate) fn sheet(n: u32, height_m: impl Fn(f64, f64) -> f64) -> Soup {
    let x = |i: u32| 0.02 * (f64::from(i) / f64::from(n) - 0.5);
    let points: Vec<DVec3> = (0..=n)
        .flat_map(|i| (0..=n).map(move |j| (i, j)))
        .map(|(i, j)| DVec3::new(x(i), x(j), height_m(x(i), x(j))))
        .collect();
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let cells = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let triangles = cells.flat_map(|(i, j)| {
        [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]
    });
    soup(&points, triangles.collect())
}

/// Both soups in one.
pub(crate) fn soup_of_both(mut a: Soup, b: Soup) -> Soup {
    let first = a.points.len() as u32;
    a.points.extend(b.points);
    a.triangles.extend(b.triangles.iter().map(|t| t.map(|c| c + first)));
    a
}

/// Small generator of numbers from 0 to 1 (Marsaglia 2003, xorshift).
pub(crate) struct Numbers(pub(crate) u64);

impl Numbers {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let d = DVec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
            let length = d.length();
            if length > 0.1 && length < 1.0 {
                return d / length;
            }
        }
    }
}
