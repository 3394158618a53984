//! Bodies of any shape: elements, their outer surface, and its fixed and touched parts.

use crate::cells::{Geometry, Kind};
use crate::dissection::Assembly;
use crate::grid::Lame;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Element of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Element {
    /// Shape of the element: tetrahedron or brick.
    pub kind: Kind,
    /// Indices of the nodes, in the order of [`Kind`].
    pub nodes: Vec<usize>,
    /// Number of the element in the file.
    pub tag: usize,
    /// Index of the physical volume in [`Parts::regions`].
    pub region: usize,
}

/// Face of an element that no other element shares.
#[derive(Clone, Debug, PartialEq)]
pub struct Facet {
    /// Number of corners, three or four.
    pub corners: usize,
    /// Indices of the nodes: corners, counterclockwise seen from outside, then the middles of the edges.
    pub nodes: Vec<usize>,
}

/// Contents of a mesh before validation.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parts {
    /// Positions of the nodes, m.
    pub nodes_m: Vec<[f64; 3]>,
    /// Volume elements.
    pub elements: Vec<Element>,
    /// Corners of the faces of each named surface, by name.
    pub surfaces: BTreeMap<String, Vec<Vec<usize>>>,
    /// Corners of all faces in the file.
    pub faces: Vec<Vec<usize>>,
    /// Names of the physical volumes; the first, empty, is that of elements without a volume.
    pub regions: Vec<String>,
}

/// Validated mesh of a body; the origin is the middle of the touched face.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Positions of the nodes, m.
    pub nodes_m: Vec<[f64; 3]>,
    /// Volume elements.
    pub elements: Vec<Element>,
    /// For each node, true if the node does not move.
    pub fixed: Vec<bool>,
    /// Touched part of the surface.
    pub touched: Vec<Facet>,
    /// Part of the surface that is neither touched nor fixed.
    pub free: Vec<Facet>,
    /// Names of the physical volumes.
    pub regions: Vec<String>,
}

/// Reason why a mesh is invalid.
#[derive(Clone, Debug, PartialEq)]
pub enum MeshError {
    /// No element has a volume.
    NoVolume {
        /// Middle of an edge that an odd number of faces share, m; `None` if the surface is closed.
        open_m: Option<[f64; 3]>,
    },
    /// An element is inverted or folded.
    Inverted {
        /// Number of the element in the file.
        tag: usize,
        /// Smallest Jacobian determinant of the element, m³.
        jacobian_m3: f64,
    },
    /// Three elements share a face, or a face of four corners meets two faces of three corners.
    Overlap {
        /// Number of one of the elements.
        tag: usize,
    },
    /// Two nodes are at the same position: the body has a crack.
    Twins {
        /// Position, m.
        at_m: [f64; 3],
    },
    /// No surface has this name.
    NoSurface {
        /// Role of the surface, `fixed` or `touched`.
        role: &'static str,
        /// Requested name.
        name: String,
        /// Names in the file.
        names: Vec<String>,
    },
    /// A face of a named surface is not on the outer surface of the elements.
    NotOnSurface {
        /// Name of the surface.
        name: String,
        /// Middle of the face, m.
        at_m: [f64; 3],
    },
    /// A part of the body is not connected to the fixed surface.
    Loose {
        /// Number of an element of the part.
        tag: usize,
    },
    /// The fixed and the touched surface have the same name.
    SameName {
        /// Name of both surfaces.
        name: String,
    },
    /// The fixed and the touched surface share a node.
    Shared {
        /// Name of the fixed surface.
        fixed: String,
        /// Name of the touched surface.
        touched: String,
        /// Position of a shared node, m.
        at_m: [f64; 3],
    },
    /// The longest side is zero or above 10 m, or a coordinate is not finite.
    Extent {
        /// Longest side, m; NaN if a coordinate is not finite.
        extent_m: f64,
    },
}

impl fmt::Display for MeshError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mm =
            |at: &[f64; 3]| format!("({:.3}, {:.3}, {:.3}) mm", at[0] * 1.0e3, at[1] * 1.0e3, at[2] * 1.0e3);
        match self {
            Self::NoVolume { open_m: Some(at) } => write!(
                f,
                "the mesh has an open surface and no volume: the surface ends at {}; close the surface, and mesh \
                 the volume (`gmsh -3 -order 2`)",
                mm(at)
            ),
            Self::NoVolume { open_m: None } => {
                write!(
                    f,
                    "no element has a volume: mesh the volume (`gmsh -3 -order 2`), and give the volume a physical group"
                )
            }
            Self::Inverted { tag, jacobian_m3 } => write!(
                f,
                "element {tag} is inverted or folded (Jacobian determinant {jacobian_m3:.3e} m³): correct the order \
                 of its nodes, or bend its curved edges less"
            ),
            Self::Overlap { tag } => {
                write!(
                    f,
                    "the faces of element {tag} do not match the faces of its neighbours: elements overlap or \
                     differ in kind there; mesh the body again"
                )
            }
            Self::Twins { at_m } => {
                write!(
                    f,
                    "two nodes coincide at {}, so the body has a crack there; merge the nodes (`Coherence \
                     Mesh;` in Gmsh)",
                    mm(at_m)
                )
            }
            Self::NoSurface { role, name, names } => {
                let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
                let (what, parameter) = if *role == "fixed" {
                    ("no fixed nodes", "fixed_face")
                } else {
                    ("nothing to touch", "touched_face")
                };
                write!(
                    f,
                    "{what}: no physical surface has the name \"{name}\" (physical surfaces: {known}); rename a \
                     surface, or set `{parameter}`"
                )
            }
            Self::NotOnSurface { name, at_m } => write!(
                f,
                "the surface \"{name}\" is not on the border of the elements at {}; add the missing elements, or \
                 choose a surface on the border",
                mm(at_m)
            ),
            Self::Loose { tag } => {
                write!(
                    f,
                    "element {tag} is not connected to the fixed face; join this part of the body to the rest, or add \
                     a face of the part to the surface of `fixed_face`"
                )
            }
            Self::SameName { name } => write!(
                f,
                "`fixed_face` and `touched_face` are both \"{name}\"; name two surfaces with a gap between them"
            ),
            Self::Shared { fixed, touched, at_m } => write!(
                f,
                "the surfaces \"{fixed}\" (`fixed_face`) and \"{touched}\" (`touched_face`) share a node at {}; leave a \
                 gap between them, or choose other surfaces",
                mm(at_m)
            ),
            Self::Extent { extent_m } => write!(
                f,
                "the longest side of the mesh is {extent_m} m, but must be above 0 and at most 10 m: coordinates are \
                 finite numbers in metres (`unit = \"mm\"`: in millimetres)"
            ),
        }
    }
}

fn middle(nodes_m: &[[f64; 3]], of: &[usize]) -> [f64; 3] {
    [0, 1, 2].map(|k| of.iter().map(|&node| nodes_m[node][k]).sum::<f64>() / of.len() as f64)
}

fn sorted(corners: &[usize]) -> Vec<usize> {
    let mut key = corners.to_vec();
    key.sort_unstable();
    key
}

/// Returns the middle of an edge that an odd number of faces share, m; `None` for a closed surface.
fn open_edge(nodes_m: &[[f64; 3]], faces: &[Vec<usize>]) -> Option<[f64; 3]> {
    let mut edges: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
    for face in faces {
        for (i, &from) in face.iter().enumerate() {
            *edges.entry(sorted(&[from, face[(i + 1) % face.len()]])).or_default() += 1;
        }
    }
    edges.iter().find(|(_, count)| **count % 2 == 1).map(|(edge, _)| middle(nodes_m, edge))
}

impl Mesh {
    /// Validates a mesh and moves the origin to the middle of the touched surface; the names select the fixed and the touched
    /// surface. Not real-time.
    ///
    /// # Errors
    /// A [`MeshError`] that names the place and the remedy.
    pub fn new(parts: Parts, fixed_name: &str, touched_name: &str) -> Result<Self, MeshError> {
        let mut mesh = Self::in_place(parts, fixed_name, Some(touched_name))?;
        let (mut area, mut centre) = (0.0, [0.0; 3]);
        for facet in &mesh.touched {
            for point in facet.points(&mesh.nodes_m) {
                let size = point.normal_m2.iter().map(|c| c * c).sum::<f64>().sqrt();
                area += size;
                centre.iter_mut().zip(point.position_m).for_each(|(sum, c)| *sum += size * c);
            }
        }
        for node in &mut mesh.nodes_m {
            node.iter_mut().zip(centre).for_each(|(x, c)| *x -= c / area);
        }
        Ok(mesh)
    }

    /// Validates a mesh and keeps its coordinates; without `touched_name` all of the surface is touched that is not fixed. Not
    /// real-time.
    ///
    /// # Errors
    /// A [`MeshError`] that names the place and the remedy.
    pub fn in_place(parts: Parts, fixed_name: &str, touched_name: Option<&str>) -> Result<Self, MeshError> {
        let Parts { nodes_m, elements, surfaces, faces, regions } = parts;
        if elements.is_empty() {
            return Err(MeshError::NoVolume { open_m: open_edge(&nodes_m, &faces) });
        }
        check_places(&nodes_m, &elements)?;
        for element in &elements {
            check_element(&nodes_m, element)?;
        }
        if touched_name == Some(fixed_name) {
            return Err(MeshError::SameName { name: fixed_name.to_owned() });
        }
        let shared = |node: usize| MeshError::Shared {
            fixed: fixed_name.to_owned(),
            touched: touched_name.unwrap_or_default().to_owned(),
            at_m: nodes_m[node],
        };
        let faces_of = |name: &str| {
            surfaces.get(name).into_iter().flatten().map(|face| sorted(face)).collect::<BTreeSet<_>>()
        };
        let both = touched_name.map(|name| &faces_of(fixed_name) & &faces_of(name)).unwrap_or_default();
        if let Some(&node) = both.iter().flatten().next() {
            return Err(shared(node));
        }
        let mut border = border(&elements)?;
        let mut take = |role: &'static str, name: &str| -> Result<Vec<Facet>, MeshError> {
            let found =
                surfaces.get(name).filter(|faces| !faces.is_empty()).ok_or_else(|| MeshError::NoSurface {
                    role,
                    name: name.to_owned(),
                    names: surfaces.keys().cloned().collect(),
                })?;
            let unique: BTreeSet<Vec<usize>> = found.iter().map(|corners| sorted(corners)).collect();
            unique
                .into_iter()
                .map(|corners| {
                    let at_m = middle(&nodes_m, &corners);
                    border
                        .remove(&corners)
                        .ok_or_else(|| MeshError::NotOnSurface { name: name.to_owned(), at_m })
                })
                .collect()
        };
        let clamped = take("fixed", fixed_name)?;
        let touched = touched_name.map_or(Ok(Vec::new()), |name| take("touched", name))?;
        let mut fixed = vec![false; nodes_m.len()];
        clamped.iter().flat_map(|facet| &facet.nodes).for_each(|&node| fixed[node] = true);
        if let Some(&node) = touched.iter().flat_map(|facet| &facet.nodes).find(|&&node| fixed[node]) {
            return Err(shared(node));
        }
        check_held(&elements, &fixed)?;
        let free: Vec<Facet> = border.into_values().collect();
        let (touched, free) = if touched_name.is_some() { (touched, free) } else { (free, Vec::new()) };
        Ok(Self { nodes_m, elements, fixed, touched, free, regions })
    }
}

fn check_places(nodes_m: &[[f64; 3]], elements: &[Element]) -> Result<(), MeshError> {
    let used: BTreeSet<usize> = elements.iter().flat_map(|element| element.nodes.iter().copied()).collect();
    let side = |k: usize| {
        let (low, high) = used
            .iter()
            .map(|&node| nodes_m[node][k])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
        high - low
    };
    let is_finite = used.iter().all(|&node| nodes_m[node].iter().all(|c| c.is_finite()));
    let extent_m = if is_finite { side(0).max(side(1)).max(side(2)) } else { f64::NAN };
    if !(extent_m > 0.0 && extent_m <= 10.0) {
        return Err(MeshError::Extent { extent_m });
    }
    // After sorting along x, nodes at one position are neighbours within a billionth of the body's size.
    let near = 1.0e-9 * extent_m;
    let mut order: Vec<usize> = used.into_iter().collect();
    order.sort_by(|&a, &b| nodes_m[a][0].total_cmp(&nodes_m[b][0]));
    for (i, &a) in order.iter().enumerate() {
        for &b in order[i + 1..].iter().take_while(|&&b| nodes_m[b][0] - nodes_m[a][0] <= near) {
            if (1..3).all(|k| (nodes_m[a][k] - nodes_m[b][k]).abs() <= near) {
                return Err(MeshError::Twins { at_m: nodes_m[a] });
            }
        }
    }
    Ok(())
}

/// Checks that the volume is positive at the quadrature points and at the corners.
fn check_element(nodes_m: &[[f64; 3]], element: &Element) -> Result<(), MeshError> {
    let places: Vec<[f64; 3]> = element.nodes.iter().map(|&node| nodes_m[node]).collect();
    let geometry = Geometry { kind: element.kind, nodes_m: &places };
    let points = element.kind.rule().into_iter().map(|(at, _)| at).chain(element.kind.corner_places());
    let worst = points
        .map(|at| geometry.slopes(at).1)
        .fold(f64::INFINITY, |least, j| if j < least { j } else { least });
    if worst > 0.0 { Ok(()) } else { Err(MeshError::Inverted { tag: element.tag, jacobian_m3: worst }) }
}

/// Returns the faces that only one element has, by their sorted corners.
fn border(elements: &[Element]) -> Result<BTreeMap<Vec<usize>, Facet>, MeshError> {
    let mut all: BTreeMap<Vec<usize>, (usize, Facet)> = BTreeMap::new();
    let mut tags: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
    for element in elements {
        for face in 0..element.kind.faces().len() {
            let nodes: Vec<usize> =
                element.kind.face_nodes(face).into_iter().map(|local| element.nodes[local]).collect();
            let corners = element.kind.faces()[face].len();
            let key = sorted(&nodes[..corners]);
            tags.insert(key.clone(), element.tag);
            let entry = all.entry(key).or_insert((0, Facet { corners, nodes }));
            entry.0 += 1;
            if entry.0 > 2 {
                return Err(MeshError::Overlap { tag: element.tag });
            }
        }
    }
    let single: BTreeMap<Vec<usize>, Facet> =
        all.into_iter().filter(|(_, (count, _))| *count == 1).map(|(key, (_, facet))| (key, facet)).collect();
    // Detect a square that two triangles cover from the other side.
    for (key, facet) in single.iter().filter(|(_, facet)| facet.corners == 4) {
        for left_out in 0..4 {
            let mut triangle = key.clone();
            triangle.remove(left_out);
            if facet.corners == 4 && single.contains_key(&triangle) {
                return Err(MeshError::Overlap { tag: tags[key] });
            }
        }
    }
    Ok(single)
}

/// Checks that every element is connected to a fixed node.
fn check_held(elements: &[Element], fixed: &[bool]) -> Result<(), MeshError> {
    let mut around: Vec<Vec<usize>> = vec![Vec::new(); fixed.len()];
    for (index, element) in elements.iter().enumerate() {
        element.nodes.iter().for_each(|&node| around[node].push(index));
    }
    let mut held: Vec<bool> = elements.iter().map(|e| e.nodes.iter().any(|&node| fixed[node])).collect();
    let mut next: Vec<usize> = (0..elements.len()).filter(|&index| held[index]).collect();
    while let Some(index) = next.pop() {
        for &node in &elements[index].nodes {
            for &other in &around[node] {
                if !held[other] {
                    held[other] = true;
                    next.push(other);
                }
            }
        }
    }
    held.iter()
        .position(|held| !held)
        .map_or(Ok(()), |index| Err(MeshError::Loose { tag: elements[index].tag }))
}

/// Stiffness of a mesh of one material, as an [`Assembly`].
#[derive(Clone, Copy, Debug)]
pub struct MeshStiffness<'a> {
    /// Mesh of the body.
    pub mesh: &'a Mesh,
    /// Lamé's constants of the material.
    pub lame: Lame,
}

impl Assembly for MeshStiffness<'_> {
    fn node_count(&self) -> usize {
        self.mesh.nodes_m.len()
    }

    fn element_count(&self) -> usize {
        self.mesh.elements.len()
    }

    fn nodes(&self, element: usize) -> Vec<usize> {
        self.mesh.elements[element].nodes.clone()
    }

    fn stiffness(&self, element: usize) -> Vec<f64> {
        let Element { kind, nodes, .. } = &self.mesh.elements[element];
        let places: Vec<[f64; 3]> = nodes.iter().map(|&node| self.mesh.nodes_m[node]).collect();
        Geometry { kind: *kind, nodes_m: &places }.stiffness(self.lame)
    }

    /// Cuts across the longest side of the bounding box of the elements' middles.
    fn halves(&self, mut elements: Vec<usize>) -> [Vec<usize>; 2] {
        let at = |element: usize, axis: usize| {
            middle(&self.mesh.nodes_m, &self.mesh.elements[element].nodes)[axis]
        };
        let side = |axis: usize| {
            let all = || elements.iter().map(|&element| at(element, axis));
            all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
        };
        let sides = [side(0), side(1), side(2)];
        let longest = (0..3).fold(0, |best, axis| if sides[axis] > sides[best] { axis } else { best });
        elements.sort_by(|&a, &b| at(a, longest).total_cmp(&at(b, longest)).then(a.cmp(&b)));
        let upper = elements.split_off(elements.len() / 2);
        [elements, upper]
    }
}
