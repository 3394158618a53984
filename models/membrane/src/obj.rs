//! Reader of Wavefront OBJ files: vertices, faces and lines. Not real-time.

use flotor_hal::{DVec3, TextProblem};

/// Largest number of vertices read: 40 000 masses, each written once for each of its six triangles.
const MOST_VERTICES: usize = 240_000;

/// Ignored statements: normals, texture, points, groups, materials, display.
const UNUSED: [&str; 15] = [
    "vn", "vt", "vp", "p", "o", "g", "s", "mg", "mtllib", "usemtl", "usemap", "bevel", "lod", "c_interp",
    "d_interp",
];

/// Content of an OBJ file (`v`, `f` and `l`; metres, z up).
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Obj {
    /// Positions of the vertices, m.
    pub(crate) vertices_m: Vec<DVec3>,
    /// Corners of each face, as indices of vertices.
    pub(crate) faces: Vec<Vec<usize>>,
    /// Ends of each segment of the lines, as indices of vertices.
    pub(crate) segments: Vec<[usize; 2]>,
}

impl Obj {
    /// Parses the text of a file.
    ///
    /// # Errors
    /// A [`TextProblem`]: a malformed line, more than [`MOST_VERTICES`] vertices, no face, or an STL file.
    pub(crate) fn read(text: &str) -> Result<Self, TextProblem> {
        let head = text.trim_start();
        if head.starts_with("solid") && head.contains("facet") {
            return Err(TextProblem::at(1, "this is an STL file; export the mesh as Wavefront OBJ"));
        }
        let mut obj = Self::default();
        let mut lines = text.lines().enumerate().map(|(index, text)| (index + 1, text));
        while let Some((line, first)) = lines.next() {
            let mut text = first.trim_end().to_owned();
            while let Some(begun) = text.strip_suffix('\\') {
                let (_, next) = lines.next().ok_or_else(|| {
                    TextProblem::at(
                        line,
                        "the file ends after a `\\`, in the middle of a line; export the mesh again",
                    )
                })?;
                text = format!("{begun} {}", next.trim_end());
            }
            obj.read_line(&text).map_err(|problem| TextProblem::at(line, problem))?;
        }
        if obj.faces.is_empty() {
            let problem = "the file has no face (`f`); export the mesh as Wavefront OBJ, with faces";
            return Err(TextProblem::of_file(problem));
        }
        Ok(obj)
    }

    fn read_line(&mut self, text: &str) -> Result<(), String> {
        let mut words = text.split_whitespace();
        match words.next() {
            Some("v") => {
                // Reject `nan` and `inf`, which Rust parses as numbers.
                let finite = |word: &str| word.parse::<f64>().ok().filter(|number| number.is_finite());
                let numbers: Vec<f64> = words.take(3).filter_map(finite).collect();
                let [x, y, z] = numbers[..] else {
                    return Err("a vertex must be `v X Y Z` with three finite numbers".to_owned());
                };
                if self.vertices_m.len() >= MOST_VERTICES {
                    return Err(format!("there are more than {MOST_VERTICES} vertices; use a coarser mesh"));
                }
                self.vertices_m.push(DVec3::new(x, y, z));
            }
            Some(kind @ ("f" | "l")) => {
                let corners = words.map(|word| corner(word, self.vertices_m.len()));
                let corners = corners.collect::<Option<Vec<usize>>>();
                let (least, word) = if kind == "f" { (3, "three") } else { (2, "two") };
                let corners = corners.filter(|corners| corners.len() >= least).ok_or_else(|| {
                    format!("`{kind}` must have the numbers of {word} or more vertices of earlier lines; export the mesh again")
                })?;
                match kind {
                    "f" => self.faces.push(corners),
                    _ => self.segments.extend(corners.windows(2).map(|pair| [pair[0], pair[1]])),
                }
            }
            Some(other) if !other.starts_with('#') && !UNUSED.contains(&other) => {
                let other: String = other.chars().take(20).flat_map(char::escape_debug).collect();
                return Err(format!(
                    "`{other}` is not a Wavefront OBJ statement for polygon meshes; export a polygon mesh \
                     (`v`, `f`), or remove the line"
                ));
            }
            _ => {}
        }
        Ok(())
    }
}

/// Parses a vertex reference (`7`, `7/1/3` or `-1`) and returns the index of the vertex, from 0. Positive numbers count from the
/// first vertex (1), negative ones back from the last (-1). `None` for an invalid or out-of-range reference.
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
    fn a_line_may_continue_on_the_next() {
        let obj = Obj::read("v 0 0 0\nv 1 0 \\\n0\nv 0 1 0\nf 1 \\\r\n 2 \\\n 3\n").unwrap();
        assert_eq!(obj.vertices_m, [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!(obj.faces, [vec![0, 1, 2]]);
        let error = Obj::read("v 0 0 0\nf 1 1 \\").unwrap_err();
        assert_eq!(error.line, 2);
    }

    #[test]
    fn an_error_names_the_line_or_the_format() {
        let error = |text: &str| Obj::read(text).unwrap_err().in_file("m");
        assert!(error("v 0 0\n").starts_with("m:1: a vertex"));
        for vertex in ["v nan 0 0", "v 0 inf 0", "v 0 0 -inf", "v 1e999 0 0", "v 0,5 0 0"] {
            let text = format!("v 0 0 0\n{vertex}\nv 0 1 0\n");
            assert!(error(&text).starts_with("m:2: a vertex"), "{vertex}");
        }
        assert!(error("v 0 0 0\nf 1 2 3\n").starts_with("m:2: `f`"));
        assert!(error("").starts_with("m: the file has no face"));
        assert!(error("v 0 0 0\nv 1 0 0\nf 1 2\n").starts_with("m:3: `f` must have the numbers of three"));
        assert!(error("v 0 0 0\n0 0 0\n").starts_with("m:2: `0` is not a Wavefront OBJ statement"));
        let stl = "solid sheet\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n";
        assert_eq!(error(stl), "m:1: this is an STL file; export the mesh as Wavefront OBJ");
    }
}
