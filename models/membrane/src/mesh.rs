//! Masses and their links: sheets, and the edges of a mesh file. Not real-time.

use crate::obj::Obj;
use crate::topology::{Topology, in_mm};
use flotor_hal::{DVec3, TextProblem};

/// Spring between two masses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Indices of the two masses, the smaller first.
    pub ends: [usize; 2],
    /// Rest length, m.
    pub rest_m: f64,
    /// Stiffness, N/m.
    pub stiffness_n_per_m: f64,
}

/// Masses and springs in their initial state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Initial position of each mass, m.
    pub positions_m: Vec<DVec3>,
    /// Mass at each node, kg; 0 for a fixed node.
    pub masses_kg: Vec<f64>,
    /// Springs between the masses.
    pub links: Vec<Link>,
    /// Triangles for drawing, as indices of masses.
    pub triangles: Vec<[u32; 3]>,
}

/// Parameters of a sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// Number of masses along a side, at least 3; the masses on the border are fixed.
    pub nodes_per_side: usize,
    /// Length of a side, m.
    pub side_m: f64,
    /// Mass of the whole sheet, kg; each free mass has the mass of one cell.
    pub mass_kg: f64,
    /// Stiffness of a spring, N/m.
    pub stiffness_n_per_m: f64,
    /// Ratio of the initial length of a spring to its rest length; 1 for a sheet without tension.
    pub stretch: f64,
}

impl Mesh {
    /// Builds a square sheet at height 0 with its middle at the origin. Each free mass is linked to its four neighbours: the
    /// five-point Laplacian of a membrane under the tension `stiffness (spacing - rest)` per spacing.
    #[must_use]
    pub fn sheet(sheet: &Sheet) -> Self {
        let n = sheet.nodes_per_side;
        let spacing_m = sheet.side_m / (n - 1) as f64;
        let node_kg = sheet.mass_kg / ((n - 1) * (n - 1)) as f64;
        let rest_m = spacing_m / sheet.stretch;
        let link = |ends| Link { ends, rest_m, stiffness_n_per_m: sheet.stiffness_n_per_m };
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
            // Omit springs along the border: they would join two fixed masses.
            if column + 1 < n && ![0, n - 1].contains(&row) {
                mesh.links.push(link([node, node + 1]));
            }
            if row + 1 < n && ![0, n - 1].contains(&column) {
                mesh.links.push(link([node, node + n]));
            }
        }
        mesh
    }

    /// Builds a network from the edges of a Wavefront OBJ file (`v`, `f`, `l` lines; metres, z up): springs at `stretch` times
    /// their rest length. Edges of one face only are the border; their ends are fixed. The free masses are equal.
    ///
    /// # Errors
    /// A [`TextProblem`]: a malformed line, no face, too many vertices, a vertex of the border on an edge of the border that
    /// does not end there, a part without a fixed border, or no free mass.
    pub fn from_obj(
        text: &str,
        mass_kg: f64,
        stiffness_n_per_m: f64,
        stretch: f64,
    ) -> Result<Self, TextProblem> {
        let topology = Topology::of(&Obj::read(text)?)?;
        let border = topology.border();
        if let Some(at_m) = topology.part_without(&border) {
            let problem = format!(
                "the part at {} has no fixed border: each of its edges has two faces or none; leave a border open",
                in_mm(at_m)
            );
            return Err(TextProblem::of_file(problem));
        }
        let Topology { places_m: positions_m, faces, edges } = topology;
        if border.len() == positions_m.len() {
            let problem =
                "no mass can move, because every vertex is on the border; add vertices inside the border";
            return Err(TextProblem::of_file(problem));
        }
        let node_kg = mass_kg / (positions_m.len() - border.len()) as f64;
        let mass_kg = |node| if border.contains(&node) { 0.0 } else { node_kg };
        let links = edges.into_keys().map(|[a, b]| {
            let rest_m = positions_m[a].distance(positions_m[b]) / stretch;
            Link { ends: [a, b], rest_m, stiffness_n_per_m }
        });
        let mut mesh = Self {
            links: links.collect(),
            masses_kg: (0..positions_m.len()).map(mass_kg).collect(),
            positions_m,
            triangles: Vec::new(),
        };
        faces.iter().for_each(|corners| mesh.face(corners));
        Ok(mesh)
    }

    /// Adds a polygon to the drawing, as triangles.
    fn face(&mut self, corners: &[usize]) {
        let place = |corner: usize| u32::try_from(corner).unwrap_or(u32::MAX);
        if let [first, rest @ ..] = corners {
            self.triangles.extend(rest.windows(2).map(|pair| [*first, pair[0], pair[1]].map(place)));
        }
    }

    /// Returns the initial length of the longest spring, m.
    #[must_use]
    pub fn coarseness_m(&self) -> f64 {
        let length_m = |link: &Link| self.positions_m[link.ends[0]].distance(self.positions_m[link.ends[1]]);
        self.links.iter().map(length_m).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of four triangles around a vertex in the middle.
    const SQUARE: &str = "# a comment\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv 0 0 0\nvn 0 0 1\n\
                          f 1/1 2/2 5/3\nf 2 3 5\nf 3 4 -1\nf 4 1 5\n";

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
        let mesh = Mesh::from_obj(SQUARE, 0.1, 10.0, 1.0).unwrap();
        assert_eq!((mesh.positions_m.len(), mesh.links.len()), (5, 8));
        assert_eq!(mesh.masses_kg, [0.0, 0.0, 0.1, 0.0, 0.0]);
        assert!((mesh.coarseness_m() - 2.0).abs() < 1.0e-15);
    }

    #[test]
    fn a_mesh_that_nothing_holds_is_refused_with_the_place() {
        let error = |text: &str| Mesh::from_obj(text, 1.0, 1.0, 1.0).unwrap_err().in_file("m");
        assert!(error("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").starts_with("m: no mass can move"));
        let tetrahedron = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";
        assert!(
            error(tetrahedron).starts_with("m: the part at (0.000, 0.000, 0.000) mm has no fixed border")
        );
        let beside = format!(
            "{SQUARE}v 9 0 0\nv 10 0 0\nv 9 1 0\nv 9 0 1\nf -4 -3 -2\nf -4 -3 -1\nf -4 -2 -1\nf -3 -2 -1\n"
        );
        assert!(error(&beside).starts_with("m: the part at (9000.000, 0.000, 0.000) mm has no fixed border"));
    }
}
