//! One sheet as programs export it: vertices split, permuted or unused, triangles apart, turned over or twice. The network is
//! the same to the bit, or the file is refused with the place.

use flotor_membrane::mesh::Mesh;
use std::fmt::Write;

/// Vertices along a side.
const SIDE: usize = 9;

/// Coordinates of a vertex of the sheet, which is not flat, in mm.
fn coordinates(row: usize, column: usize) -> String {
    let bump = (row * (SIDE - 1 - row) * column * (SIDE - 1 - column)) as f64;
    format!("{:.6} {:.6} {:.6}", column as f64 * 0.005 - 0.02, row as f64 * 0.005 - 0.02, bump * 1.0e-5)
}

/// A vertex by its row and column.
type Place = (usize, usize);

/// Triangles of the sheet.
fn triangles() -> Vec<[Place; 3]> {
    let cells = (0..SIDE - 1).flat_map(|row| (0..SIDE - 1).map(move |column| (row, column)));
    cells
        .flat_map(|(r, c)| [[(r, c), (r, c + 1), (r + 1, c + 1)], [(r, c), (r + 1, c + 1), (r + 1, c)]])
        .collect()
}

/// Text with each place once, numbered by `number` (a permutation from 0), and these faces.
fn text(number: impl Fn(Place) -> usize, faces: &[[Place; 3]]) -> String {
    let mut vertices = vec![String::new(); SIDE * SIDE];
    for (row, column) in (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column))) {
        vertices[number((row, column))] = format!("v {}\n", coordinates(row, column));
    }
    let mut text = vertices.concat();
    for face in faces {
        let [a, b, c] = face.map(|place| number(place) + 1);
        writeln!(text, "f {a} {b} {c}").expect("a String takes any text");
    }
    text
}

fn in_rows((row, column): Place) -> usize {
    row * SIDE + column
}

/// Text in which each triangle has vertices of its own.
fn unwelded() -> String {
    let mut text = "o sheet\nvn 0 0 1\n".to_owned();
    for face in triangles() {
        for (row, column) in face {
            writeln!(text, "v {}", coordinates(row, column)).expect("a String takes any text");
        }
        text.push_str("f -3//1 -2//1 -1//1\n");
    }
    text
}

/// Text in which two halves have the vertices between them twice, as along a seam of the texture.
fn split_at_a_seam() -> String {
    let mut text = text(in_rows, &[]);
    (0..SIDE)
        .for_each(|row| writeln!(text, "v {}", coordinates(row, SIDE / 2)).expect("a String takes any text"));
    text.push_str("vt 0 0\n");
    for face in triangles() {
        let is_right = face.iter().any(|(_, column)| *column > SIDE / 2);
        let [a, b, c] = face.map(|(row, column)| match is_right && column == SIDE / 2 {
            true => SIDE * SIDE + row + 1,
            false => in_rows((row, column)) + 1,
        });
        writeln!(text, "f {a}/1 {b}/1 {c}/1").expect("a String takes any text");
    }
    text
}

fn network(text: &str) -> Mesh {
    let mesh =
        Mesh::from_obj(text, 0.02, 200.0, 1.25).unwrap_or_else(|wrong| panic!("{}", wrong.in_file("m")));
    Mesh { triangles: Vec::new(), ..mesh }
}

#[test]
fn one_sheet_is_one_network_however_it_was_exported() {
    let sheet = text(in_rows, &triangles());
    let expected = network(&sheet);
    let inside = (SIDE - 2) * (SIDE - 2);
    assert_eq!(expected.masses_kg.iter().filter(|mass| **mass > 0.0).count(), inside);
    assert_eq!(expected.links.len(), 3 * (SIDE - 1) * (SIDE - 1) + 2 * (SIDE - 1));

    let turned = |face: [Place; 3]| [face[0], face[2], face[1]];
    let alternating = triangles().into_iter().enumerate();
    let alternating = alternating.map(|(index, face)| if index % 3 == 0 { turned(face) } else { face });
    let twice: Vec<_> = triangles().into_iter().flat_map(|face| [face, turned(face)]).collect();
    let backwards: Vec<_> = triangles().into_iter().rev().collect();
    let stray = format!("{}v 1 2 3\nv -7 0 0\n", text(in_rows, &triangles()));
    let border: String = (1..SIDE).map(|column| format!("l {column} {}\n", column + 1)).collect();
    let exported = [
        ("columns first", text(|(row, column)| column * SIDE + row, &triangles())),
        // 32 and 81 have no common factor.
        ("permuted", text(|place| in_rows(place) * 32 % (SIDE * SIDE), &backwards)),
        ("unwelded triangles", unwelded()),
        ("split at a seam", split_at_a_seam()),
        ("turned over", text(in_rows, &alternating.collect::<Vec<_>>())),
        ("both sides", text(in_rows, &twice)),
        ("vertices without a face", stray),
        ("faces without an area", format!("{sheet}f 1 2 2\nf 5 5 5\n")),
        ("lines along the border", format!("{sheet}{border}")),
        ("foreign line ends", sheet.replace('\n', "\r\n")),
        ("negative zero", sheet.replace(" 0.000000", " -0.000000")),
    ];
    for (habit, text) in &exported {
        assert!(network(text) == expected, "{habit}: another network");
    }
}

#[test]
fn rounding_of_single_precision_splits_nothing() {
    let expected = network(&text(in_rows, &triangles()));
    // Every second triangle rounds its last digit up.
    let mut text = String::new();
    for (index, face) in triangles().into_iter().enumerate() {
        for (row, column) in face {
            let [x, y, z]: [f64; 3] = std::array::from_fn(|axis| {
                let word = coordinates(row, column).split(' ').nth(axis).expect("three").parse::<f64>();
                word.expect("a number") + if index % 2 == 0 { 1.0e-8 } else { 0.0 }
            });
            writeln!(text, "v {x:.8} {y:.8} {z:.8}").expect("a String takes any text");
        }
        text.push_str("f -3 -2 -1\n");
    }
    let mesh = network(&text);
    assert_eq!((mesh.masses_kg.len(), mesh.links.len()), (expected.masses_kg.len(), expected.links.len()));
    let total_kg = |mesh: &Mesh| mesh.masses_kg.iter().sum::<f64>();
    assert_eq!(total_kg(&mesh).to_bits(), total_kg(&expected).to_bits());
}

#[test]
fn a_border_that_is_no_border_is_refused_with_the_place() {
    let error = |text: &str| Mesh::from_obj(text, 0.02, 200.0, 1.25).unwrap_err().in_file("m");
    // A seam with a gap of a two-thousandth of an edge, as after rounding to four digits: only the copy moves.
    let mut seen = 0;
    let moved: String = split_at_a_seam()
        .lines()
        .map(|line| {
            seen += usize::from(line.starts_with("v 0.000000 0.005000 "));
            let is_copy = seen == 2 && line.starts_with("v 0.000000 0.005000 ");
            let moved = if is_copy { line.replace("0.005000", "0.0050025") } else { line.to_owned() };
            moved + "\n"
        })
        .collect();
    assert_eq!(seen, 2);
    assert!(error(&moved).starts_with("m: at (0.000, 5.00"), "{}", error(&moved));
    // A corner in the middle of another face's edge.
    let t_junction =
        "v 0 0 0\nv 2 0 0\nv 1 1 0\nv 1 0 0\nv 0 -1 0\nv 2 -1 0\nf 1 2 3\nf 1 4 5\nf 4 2 6\nf 4 5 6\n";
    assert!(error(t_junction).starts_with("m: at (1000.000, 0.000, 0.000) mm"), "{}", error(t_junction));
}
