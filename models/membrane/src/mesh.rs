//! What is linked to what: sheets, chains, and the edges of a mesh file. Not real-time.

use flotor_hal::{DVec3, TextProblem};
use std::collections::BTreeSet;

/// A spring between two masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The mass with the smaller number, and the other.
    pub ends: [usize; 2],
    /// Length without force, m.
    pub rest_m: f64,
    /// Stiffness, N/m.
    pub stiffness_n_per_m: f64,
}

/// Masses and springs before anything moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Where each mass starts, m.
    pub positions_m: Vec<DVec3>,
    /// Each mass, kg; 0 for one that is held where it is.
    pub masses_kg: Vec<f64>,
    /// The springs.
    pub links: Vec<Link>,
    /// Triangles of masses, for a drawing.
    pub triangles: Vec<[u32; 3]>,
}

/// What a sheet is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Masses along a side, 3 and more; those of the border are held.
    pub nodes_per_side: usize,
    /// Length of a side, m.
    pub side_m: f64,
    /// Mass of the whole sheet, kg.
    pub mass_kg: f64,
    /// Stiffness of a spring, N/m.
    pub stiffness_n_per_m: f64,
    /// Length of a spring over its length without force; 1 is a slack sheet.
    pub stretch: f64,
}

impl Mesh {
    /// A square sheet at height 0 with its middle at the origin: each mass is linked to its four neighbours, which is
    /// the five-point Laplacian of a membrane under the tension `stiffness (spacing - rest)` over a spacing.
    #[must_use]
    pub fn sheet(sheet: &Sheet) -> Self {
        let n = sheet.nodes_per_side;
        let spacing_m = sheet.side_m / (n - 1) as f64;
        let node_kg = sheet.mass_kg / ((n - 1) * (n - 1)) as f64;
        let rest_m = spacing_m / sheet.stretch;
        let mut mesh = Self::default();
        for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
            let place = |index: usize| index as f64 * spacing_m - 0.5 * sheet.side_m;
            let held = [0, n - 1].contains(&row) || [0, n - 1].contains(&column);
            mesh.positions_m.push(DVec3::new(place(column), place(row), 0.0));
            mesh.masses_kg.push(if held { 0.0 } else { node_kg });
            let node = row * n + column;
            if column + 1 < n && row + 1 < n {
                mesh.face(&[node, node + 1, node + n + 1, node + n]);
            }
            // Springs along the border would join two masses that are held: they do nothing.
            if column + 1 < n && ![0, n - 1].contains(&row) {
                mesh.links.push(Link {
                    ends: [node, node + 1],
                    rest_m,
                    stiffness_n_per_m: sheet.stiffness_n_per_m,
                });
            }
            if row + 1 < n && ![0, n - 1].contains(&column) {
                mesh.links.push(Link {
                    ends: [node, node + n],
                    rest_m,
                    stiffness_n_per_m: sheet.stiffness_n_per_m,
                });
            }
        }
        mesh
    }

    /// A chain of `links` equal springs along x between two held ends `span_m` apart, at height 0. `length_m` is its
    /// length without force, `axial_n` the force that would double it, `mass_kg` its mass, half a link's at each end.
    #[must_use]
    pub fn chain(links: usize, span_m: f64, length_m: f64, axial_n: f64, mass_kg: f64) -> Self {
        let rest_m = length_m / links as f64;
        let mut mesh = Self::default();
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

    /// The edges of a Wavefront OBJ file (`v`, `f`, `l` lines; metres, z up) as springs at `stretch` times their length
    /// without force. Edges of one face only are the border; their ends are held. The mass is shared out evenly.
    ///
    /// # Errors
    /// The line that is wrong.
    pub fn from_obj(
        text: &str,
        mass_kg: f64,
        stiffness_n_per_m: f64,
        stretch: f64,
    ) -> Result<Self, TextProblem> {
        let mut mesh = Self::default();
        let mut edges: Vec<[usize; 2]> = Vec::new();
        for (line, text) in text.lines().enumerate().map(|(index, text)| (index + 1, text)) {
            let mut words = text.split_whitespace();
            match words.next() {
                Some("v") => {
                    // `nan` and `inf` are numbers to the parser, but no places.
                    let finite = |word: &str| word.parse::<f64>().ok().filter(|number| number.is_finite());
                    let numbers: Vec<f64> = words.take(3).filter_map(finite).collect();
                    let [x, y, z] = numbers[..] else {
                        return Err(TextProblem::at(line, "a vertex is `v X Y Z`, three finite numbers"));
                    };
                    mesh.positions_m.push(DVec3::new(x, y, z));
                }
                Some(kind @ ("f" | "l")) => {
                    let corners = words.map(|word| corner(word, mesh.positions_m.len()));
                    let corners = corners.collect::<Option<Vec<usize>>>();
                    let corners = corners.filter(|corners| corners.len() >= 2).ok_or_else(|| {
                        let problem =
                            format!("`{kind}` takes two and more numbers of vertices that stand above it");
                        TextProblem::at(line, problem)
                    })?;
                    edges.extend(corners.windows(2).map(|pair| [pair[0], pair[1]]));
                    if let (true, [first, .., last]) = (kind == "f", &corners[..]) {
                        edges.push([*last, *first]);
                        mesh.face(&corners);
                    }
                }
                _ => {} // normals, texture, groups, comments: not ours
            }
        }
        let mut edges: Vec<[usize; 2]> = edges.into_iter().map(|[a, b]| [a.min(b), a.max(b)]).collect();
        edges.sort_unstable();
        let border: BTreeSet<usize> =
            edges.chunk_by(|a, b| a == b).filter(|same| same.len() == 1).flat_map(|same| same[0]).collect();
        edges.dedup();
        if edges.is_empty() || border.len() == mesh.positions_m.len() {
            let problem = "there is nothing in it that could move: no mass inside a border of edges";
            return Err(TextProblem::of_file(problem));
        }
        let node_kg = mass_kg / (mesh.positions_m.len() - border.len()) as f64;
        mesh.masses_kg = (0..mesh.positions_m.len())
            .map(|node| if border.contains(&node) { 0.0 } else { node_kg })
            .collect();
        for [a, b] in edges {
            let rest_m = mesh.positions_m[a].distance(mesh.positions_m[b]) / stretch;
            mesh.links.push(Link { ends: [a, b], rest_m, stiffness_n_per_m });
        }
        Ok(mesh)
    }

    /// Adds a polygon to the drawing.
    fn face(&mut self, corners: &[usize]) {
        let place = |corner: usize| u32::try_from(corner).unwrap_or(u32::MAX);
        if let [first, rest @ ..] = corners {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]].map(place)));
        }
    }

    /// The longest spring as it starts, m.
    #[must_use]
    pub fn coarseness_m(&self) -> f64 {
        let length_m = |link: &Link| self.positions_m[link.ends[0]].distance(self.positions_m[link.ends[1]]);
        self.links.iter().map(length_m).fold(0.0, f64::max)
    }
}

/// `7`, `7/1/3` or `-1`: the number of a vertex, from 1 on or from the last one back.
fn corner(word: &str, vertices: usize) -> Option<usize> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let count = i64::try_from(vertices).ok()?;
    let index = if number < 0 { count + number } else { number - 1 };
    usize::try_from(index).ok().filter(|index| *index < vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_has_its_border_held_and_the_right_mass() {
        let sheet =
            Sheet { nodes_per_side: 5, side_m: 0.04, mass_kg: 0.016, stiffness_n_per_m: 1.0, stretch: 1.25 };
        let mesh = Mesh::sheet(&sheet);
        assert_eq!(mesh.masses_kg.iter().filter(|mass| **mass == 0.0).count(), 16);
        assert!((mesh.masses_kg.iter().sum::<f64>() - 0.009).abs() < 1.0e-15); // nine of sixteen cells' worth
        assert_eq!(mesh.links.len(), 2 * 3 * 4);
        assert!(mesh.links.iter().all(|link| (link.rest_m - 0.008).abs() < 1.0e-15));
    }

    #[test]
    fn a_mesh_file_gives_each_edge_once_and_holds_its_border() {
        // A square of four triangles around a vertex in the middle.
        let text = "# a comment\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 0\nvn 0 0 1\n\
                    f 1/1 2/2 5/3\nf 2 3 5\nf 3 4 -1\nf 4 1 5\n";
        let mesh = Mesh::from_obj(text, 0.1, 10.0, 1.0).unwrap();
        assert_eq!((mesh.positions_m.len(), mesh.links.len()), (5, 8));
        assert_eq!(mesh.masses_kg, [0.0, 0.0, 0.0, 0.0, 0.1]);
        assert!((mesh.coarseness_m() - 2.0).abs() < 1.0e-15);
    }

    #[test]
    fn a_broken_mesh_file_names_the_line() {
        let error = |text: &str| Mesh::from_obj(text, 1.0, 1.0, 1.0).unwrap_err().in_file("m");
        assert!(error("v 0 0\n").starts_with("m:1: a vertex"));
        for vertex in ["v nan 0 0", "v 0 inf 0", "v 0 0 -inf", "v 1e999 0 0"] {
            let text = format!("v 0 0 0\n{vertex}\nv 0 1 0\n");
            assert!(error(&text).starts_with("m:2: a vertex"), "{vertex}");
        }
        assert!(error("v 0 0 0\nf 1 2 3\n").starts_with("m:2: `f`"));
        assert!(error("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").starts_with("m: there is nothing"));
        assert!(error("").starts_with("m: there is nothing"));
    }
}
