//! Files: every format, every defect, and bytes that are no mesh.

use crate::shapes::{Numbers, cuboid, icosphere};
use flotor_hal::DVec3;
use flotor_surface::files::read as read_soup;
use flotor_surface::object::{Object, Reading, Unfit, Unit, read};
use flotor_surface::soup::Soup;
use std::fmt::Write as _;

const READING: Reading =
    Reading { unit: Unit::Metre, scale: 1.0, edge_angle_rad: std::f64::consts::FRAC_PI_6 };

fn stl(soup: &Soup) -> Vec<u8> {
    let mut bytes = b"solid of a binary file".to_vec();
    bytes.resize(80, b' ');
    bytes.extend((soup.triangles.len() as u32).to_le_bytes());
    for triangle in &soup.triangles {
        bytes.extend([0; 12]);
        for x in triangle.iter().flat_map(|corner| soup.points[*corner as usize]) {
            bytes.extend((x as f32).to_le_bytes());
        }
        bytes.extend([0; 2]);
    }
    bytes
}

fn stl_text(soup: &Soup) -> Vec<u8> {
    let mut text = "solid part\n".to_owned();
    for triangle in &soup.triangles {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in triangle.map(|corner| soup.points[corner as usize]) {
            writeln!(text, "vertex {x} {y} {z}").unwrap();
        }
        text += "endloop\nendfacet\n";
    }
    (text + "endsolid part\n").into_bytes()
}

fn obj(soup: &Soup) -> Vec<u8> {
    let mut text = "# a mesh\no part\n".to_owned();
    for [x, y, z] in &soup.points {
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    for (i, [a, b, c]) in soup.triangles.iter().enumerate() {
        if i % 2 == 0 {
            writeln!(text, "f {}/1/1 {}//2 {}", a + 1, b + 1, c + 1).unwrap();
        } else {
            let count = soup.points.len() as i64;
            writeln!(
                text,
                "f {} {} \\\n{}",
                i64::from(*a) - count,
                i64::from(*b) - count,
                i64::from(*c) - count
            )
            .unwrap();
        }
    }
    text.into_bytes()
}

fn ply(soup: &Soup, format: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\r\nformat {format} 1.0\r\ncomment made here\r\nelement vertex {}\r\nproperty uchar red\r\nproperty double x\r\n\
         property float64 y\r\nproperty double z\r\nelement face {}\r\nproperty list uchar int vertex_indices\r\nend_header\r\n",
        soup.points.len(),
        soup.triangles.len()
    )
    .into_bytes();
    let is_big = format == "binary_big_endian";
    for point in &soup.points {
        if format == "ascii" {
            bytes.extend(format!("7 {} {} {}\n", point[0], point[1], point[2]).bytes());
            continue;
        }
        bytes.push(7);
        point.iter().for_each(|x| bytes.extend(if is_big { x.to_be_bytes() } else { x.to_le_bytes() }));
    }
    for t in &soup.triangles {
        if format == "ascii" {
            bytes.extend(format!("3 {} {} {}\n", t[0], t[1], t[2]).bytes());
            continue;
        }
        bytes.push(3);
        t.iter().for_each(|c| bytes.extend(if is_big { c.to_be_bytes() } else { c.to_le_bytes() }));
    }
    bytes
}

fn glb(soup: &Soup, node: &str) -> Vec<u8> {
    let mut binary = Vec::new();
    soup.triangles.as_flattened().iter().for_each(|c| binary.extend(c.to_le_bytes()));
    let first = binary.len();
    soup.points.iter().flatten().for_each(|x| binary.extend((*x as f32).to_le_bytes()));
    let mut json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{{"mesh":0,"name":"part"{node}}}],
        "materials":[{{"name":"wood"}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":1}},"indices":0,"material":0}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5125,"count":{},"type":"SCALAR"}},
        {{"bufferView":1,"componentType":5126,"count":{},"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteOffset":0,"byteLength":{first}}},{{"buffer":0,"byteOffset":{first},"byteLength":{}}}],
        "buffers":[{{"byteLength":{}}}]}}"#,
        3 * soup.triangles.len(),
        soup.points.len(),
        binary.len() - first,
        binary.len()
    )
    .into_bytes();
    json.resize(json.len().div_ceil(4) * 4, b' ');
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(((28 + json.len() + binary.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(0x4e4f_534a_u32, json), (0x004e_4942, binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind.to_le_bytes());
        bytes.extend(chunk);
    }
    bytes
}

/// The soup in every encoding, with the name of the file.
fn encodings(soup: &Soup) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("m.stl", stl(soup)),
        ("m.STL", stl_text(soup)),
        ("m.obj", obj(soup)),
        ("m.ply", ply(soup, "ascii")),
        ("m.ply", ply(soup, "binary_little_endian")),
        ("m.ply", ply(soup, "binary_big_endian")),
        ("m.glb", glb(soup, "")),
    ]
}

#[test]
fn every_format_gives_the_same_object() {
    for (name, bytes) in encodings(&icosphere(0.02, 2)) {
        let object = read(name, bytes, &READING).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(object.surface.count(), 320, "{name}");
        assert!(!object.surface.has_borders(), "{name}");
        let [low, high] = object.surface.box_m();
        assert!((high - low - 0.04).abs().max_element() < 1.0e-3, "{name}");
    }
}

#[test]
fn nodes_of_a_scene_place_their_meshes() {
    let node = r#","translation":[1.0,0.0,0.0],"scale":[1.0,1.0,-2.0]"#;
    let object = read("m.glb", glb(&cuboid(DVec3::ZERO, DVec3::ONE, 1), node), &READING).expect("a mesh");
    assert_eq!(object.surface.box_m(), [DVec3::new(1.0, 0.0, -2.0), DVec3::new(2.0, 1.0, 0.0)]);
    assert_eq!(object.names, ["wood"]);
    assert!(object.remarks.iter().all(|remark| !remark.contains("reversed")), "{:?}", object.remarks);
}

/// Outcome of a defect.
enum Told {
    /// Felt, with a remark that has these words.
    Healed(&'static str),
    /// Felt as it is.
    Felt,
    /// Refused with these words.
    Refused(&'static str),
}

fn soup_of(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Soup {
    Soup { points: points.to_vec(), triangles: triangles.to_vec(), ..Soup::default() }
}

/// The table of defects: what is wrong, the soup, what becomes of it.
fn defects() -> Vec<(&'static str, Soup, Told)> {
    let cube = || cuboid(DVec3::ZERO, DVec3::splat(0.02), 2);
    let ball = || icosphere(0.02, 2);
    let mut rows = vec![("whole", ball(), Told::Felt)];
    let mut with = |what, mut soup: Soup, change: &dyn Fn(&mut Soup), told| {
        change(&mut soup);
        rows.push((what, soup, told));
    };
    with("a face twice", ball(), &|s| s.triangles.push(s.triangles[5]), Told::Healed("duplicate"));
    with(
        "a face twice, turned in its corners",
        ball(),
        &|s| {
            let [a, b, c] = s.triangles[5];
            s.triangles.push([b, c, a]);
        },
        Told::Healed("duplicate"),
    );
    with(
        "two corners of one point",
        ball(),
        &|s| s.triangles.push([3, 3, 7]),
        Told::Healed("corners coincide"),
    );
    with(
        "three corners of one point",
        ball(),
        &|s| s.triangles.push([3, 3, 3]),
        Told::Healed("corners coincide"),
    );
    with("a hole", ball(), &|s| s.triangles.truncate(s.triangles.len() - 1), Told::Healed("open"));
    with("a face the wrong way round", ball(), &|s| s.triangles[9].swap(0, 1), Told::Healed("reversed"));
    with(
        "all faces the wrong way round",
        ball(),
        &|s| s.triangles.iter_mut().for_each(|t| t.swap(0, 1)),
        Told::Healed("reversed"),
    );
    with(
        "half of the faces the wrong way round",
        cube(),
        &|s| s.triangles.iter_mut().step_by(2).for_each(|t| t.swap(0, 1)),
        Told::Healed("reversed"),
    );
    with(
        "loose faces",
        ball(),
        &|s| {
            let loose: Vec<[f64; 3]> =
                s.triangles.as_flattened().iter().map(|c| s.points[*c as usize]).collect();
            s.triangles = (0..s.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            s.points = loose;
        },
        Told::Felt,
    );
    with(
        "gaps of rounding",
        cube(),
        &|s| {
            let loose: Vec<[f64; 3]> = s
                .triangles
                .as_flattened()
                .iter()
                .enumerate()
                .map(|(i, c)| s.points[*c as usize].map(|x| x + 1.0e-9 * (i % 7) as f64))
                .collect();
            s.triangles = (0..s.triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
            s.points = loose;
        },
        Told::Healed("merged over gaps"),
    );
    with("points of no face", ball(), &|s| s.points.push([9.0, 9.0, 9.0]), Told::Felt);
    with(
        "a second ball inside",
        ball(),
        &|s| {
            let (inner, first) = (icosphere(0.01, 1), s.points.len() as u32);
            s.points.extend(inner.points);
            s.triangles.extend(inner.triangles.iter().map(|t| t.map(|c| c + first)));
        },
        Told::Felt,
    );
    with(
        "an edge of three faces",
        cube(),
        &|s| {
            let [a, b, _] = s.triangles[0];
            s.points.push([0.05, 0.05, 0.05]);
            s.triangles.push([a, b, s.points.len() as u32 - 1]);
        },
        Told::Healed("three or more"),
    );
    rows.push((
        "a sheet",
        soup_of(&[[0.0; 3], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0]], &[[0, 1, 2]]),
        Told::Healed("open"),
    ));
    rows.push((
        "a face without area",
        soup_of(&[[0.0; 3], [0.1, 0.0, 0.0], [0.2, 0.0, 0.0]], &[[0, 1, 2]]),
        Told::Refused("no face"),
    ));
    rows.push((
        "a sliver on an edge",
        soup_of(
            &[[0.0; 3], [0.2, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, -0.1, 0.0], [0.05, 0.1, 0.0]],
            &[[0, 1, 2], [1, 0, 3], [0, 2, 4]],
        ),
        Told::Healed("without area"),
    ));
    rows.push(("a strip of one side", moebius(), Told::Refused("not orientable")));
    let mut crossed = cube();
    let (other, first) =
        (cuboid(DVec3::splat(0.005), DVec3::new(0.012, 0.011, 0.03), 1), crossed.points.len() as u32);
    crossed.points.extend(other.points);
    crossed.triangles.extend(other.triangles.iter().map(|t| t.map(|c| c + first)));
    rows.push(("two bodies through each other", crossed, Told::Healed("intersect, the first at")));
    rows.push((
        "too large",
        soup_of(&[[0.0; 3], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]], &[[0, 1, 2]]),
        Told::Refused("the limit of 4 m"),
    ));
    rows
}

fn moebius() -> Soup {
    let n = 24;
    let points = (0..n).flat_map(|i| {
        let angle = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
        [-0.004, 0.004].map(|w| {
            let out = 0.02 + w * (0.5 * angle).cos();
            [out * angle.cos(), out * angle.sin(), w * (0.5 * angle).sin()]
        })
    });
    let at = |i: u32, side: u32| if i < n as u32 { 2 * i + side } else { 1 - side };
    let triangles = (0..n as u32)
        .flat_map(|i| [[at(i, 0), at(i + 1, 0), at(i + 1, 1)], [at(i, 0), at(i + 1, 1), at(i, 1)]]);
    Soup { points: points.collect(), triangles: triangles.collect(), ..Soup::default() }
}

fn outcome(name: &str, bytes: Vec<u8>) -> Result<Object, String> {
    read(name, bytes, &READING).map_err(|error: Unfit| error.to_string())
}

#[test]
fn a_defect_is_healed_or_refused_as_the_table_says() {
    let mut count = 0;
    for (what, soup, told) in defects() {
        // As binary STL, OBJ, and binary PLY: with loose and with shared points, in binary32 and in binary64.
        for (name, bytes) in
            [("m.stl", stl(&soup)), ("m.obj", obj(&soup)), ("m.ply", ply(&soup, "binary_little_endian"))]
        {
            count += 1;
            match (outcome(name, bytes), &told) {
                (Ok(object), Told::Healed(words)) => {
                    assert!(
                        object.remarks.iter().any(|remark| remark.contains(words)),
                        "{what}, {name}: {:?}",
                        object.remarks
                    );
                }
                (Ok(object), Told::Felt) => assert!(object.surface.count() > 0, "{what}"),
                (Err(error), Told::Refused(words)) => {
                    assert!(error.contains(words), "{what}, {name}: {error}")
                }
                (Ok(_), Told::Refused(_)) => panic!("{what}, {name}: not refused"),
                (Err(error), _) => panic!("{what}, {name}: {error}"),
            }
        }
    }
    println!("{count} files");
}

#[test]
fn a_refusal_names_the_place() {
    let ball = icosphere(0.02, 1);
    for (name, bytes, words) in [
        ("m.stl", stl(&ball)[..200].to_vec(), "byte 80"),
        ("m.stl", b"solid x\nvertex 0 0\n".to_vec(), "line 2"),
        ("m.stl", b"solid x\nfacet\nfrog\n".to_vec(), "line 3"),
        ("m.obj", b"v 0 0 0\nf 1 2 3\n".to_vec(), "line 2"),
        ("m.obj", b"v 0 nan 0\n".to_vec(), "line 1"),
        ("m.obj", b"v 0 1\n".to_vec(), "line 1"),
        ("m.obj", b"".to_vec(), "no triangle"),
        (
            "m.ply",
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n".to_vec(),
            "x, y and z",
        ),
        ("m.ply", b"ply\nformat ascii 1.0\nelement vertex x\n".to_vec(), "line 3"),
        ("m.ply", ply(&ball, "ascii")[..400].to_vec(), "line"),
        ("m.ply", ply(&ball, "binary_big_endian")[..400].to_vec(), "byte 400"),
        ("m.glb", glb(&ball, "")[..400].to_vec(), "byte 400"),
        ("m.glb", b"glTF\x01\0\0\0\0\0\0\0".to_vec(), "version 1"),
        ("m.xyz", b"1 2 3".to_vec(), "format is unknown"),
    ] {
        let error = read_soup(name, bytes).expect_err(name).to_string();
        assert!(error.contains(words), "{name}: {error}");
    }
    let huge = b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    assert!(read_soup("m.ply", huge.to_vec()).is_err());
}

#[test]
fn a_mutated_file_is_read_or_refused() {
    let is_full = std::env::var("FLOTOR_TEST_SIZE").is_ok_and(|size| size == "full");
    let count = if is_full { 100_000 } else { 500 };
    let mut numbers = Numbers(41);
    for (name, bytes) in encodings(&icosphere(0.02, 0)) {
        for _ in 0..count {
            let mut mutated = bytes.clone();
            for _ in 0..=(numbers.next() * 4.0) as usize {
                let at = (numbers.next() * mutated.len() as f64) as usize;
                match (numbers.next() * 4.0) as usize {
                    0 => mutated[at] ^= 1 << (numbers.next() * 8.0) as usize,
                    1 => mutated[at] = (numbers.next() * 256.0) as u8,
                    2 => mutated.truncate(at.max(1)),
                    _ => mutated.insert(at, b"0-e/ \n\xff"[(numbers.next() * 7.0) as usize]),
                }
            }
            if let Ok(object) = read(name, mutated, &Reading { unit: Unit::Auto, ..READING }) {
                let [low, high] = object.surface.box_m();
                assert!(low.is_finite() && high.is_finite());
                let found = object.surface.nearest(DVec3::ZERO, f64::INFINITY, |_| true);
                assert!(found.is_none_or(|place| place.foot.point_m.is_finite()));
            }
        }
    }
}

#[test]
fn a_unit_is_guessed_and_told() {
    let ball = |scale: f64| {
        let mut soup = icosphere(0.02, 1);
        soup.points.iter_mut().flatten().for_each(|x| *x *= scale);
        obj(&soup)
    };
    let auto = Reading { unit: Unit::Auto, ..READING };
    let size_mm = |bytes, reading: &Reading| {
        let object = read("m.obj", bytes, reading).expect("a mesh");
        let [low, high] = object.surface.box_m();
        ((high - low).x * 1.0e3, object.remarks)
    };
    let (in_m, remarks) = size_mm(ball(1.0), &auto);
    let (in_mm, _) = size_mm(ball(1000.0), &auto);
    assert!((in_m - in_mm).abs() < 1.0e-6 && remarks[0].contains("assumed to be m;"), "{in_m} {in_mm}");
    let inch = Reading { unit: Unit::Inch, ..READING };
    assert!((size_mm(ball(1.0), &inch).0 - 0.0254 * in_m).abs() < 1.0e-6);
}

#[test]
fn a_cavity_below_an_edge_of_the_outer_faces_stays_a_cavity() {
    // The first corner of the cavity lies below diagonals and below an edge between two squares.
    for (low, high) in [
        (DVec3::splat(-0.005), DVec3::splat(0.005)),
        (DVec3::new(0.0, 0.0, -0.005), DVec3::splat(0.005)),
        (DVec3::new(0.0, -0.003, -0.005), DVec3::splat(0.005)),
    ] {
        let mut soup = cuboid(DVec3::splat(-0.01), DVec3::splat(0.01), 2);
        let first = soup.points.len() as u32;
        let cavity = cuboid(low, high, 1);
        soup.points.extend(cavity.points);
        soup.triangles.extend(cavity.triangles.iter().map(|[a, b, c]| [a + first, c + first, b + first]));
        let object = read("m.obj", obj(&soup), &READING).expect("a mesh");
        assert!(object.remarks.iter().all(|remark| !remark.contains("reversed")), "{:?}", object.remarks);
    }
}
