//! Reader for Gmsh's mesh format 4.1, text and binary: nodes, 10-node tetrahedra, 20-node bricks, named surfaces and volumes.
//! Not real-time.
//!
//! The format is described in Gmsh's manual, "MSH file format". Elements of other kinds are rejected; points and curves
//! are skipped. Every error contains the line number. Binary sections are rewritten as text, which is then read: one reader.

use crate::cells::Kind;
use crate::mesh::{Element, Parts};
use std::collections::BTreeMap;
use std::fmt;
use std::str::{FromStr, SplitAsciiWhitespace};

/// Error of a file that is not a supported mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FormatError {
    /// Line of the file, from 1.
    pub line: usize,
    /// Description of the problem and its remedy.
    pub problem: String,
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}: {}", self.line, self.problem)
    }
}

/// Maximum number of nodes and of elements: 40 000 nodes take about a gigabyte and some minutes of preparation.
const MOST: usize = 40_000;

/// Line reader of a file.
struct Lines<'a> {
    all: std::iter::Enumerate<std::str::Lines<'a>>,
    line: usize,
}

impl<'a> Lines<'a> {
    fn next(&mut self) -> Option<&'a str> {
        let (index, text) = self.all.next()?;
        self.line = index + 1;
        Some(text.trim())
    }

    fn fail<T>(&self, problem: impl Into<String>) -> Result<T, FormatError> {
        Err(FormatError { line: self.line, problem: problem.into() })
    }

    fn words(&mut self) -> Result<Words<'a>, FormatError> {
        match self.next() {
            Some(text) => Ok(Words { words: text.split_ascii_whitespace(), line: self.line }),
            None => self.fail("the file ends here, in the middle of a section; export the mesh again"),
        }
    }
}

/// Word reader of a line.
struct Words<'a> {
    words: SplitAsciiWhitespace<'a>,
    line: usize,
}

impl Words<'_> {
    fn number<T: FromStr>(&mut self) -> Result<T, FormatError> {
        let word = self.words.next();
        word.and_then(|word| word.parse().ok()).ok_or_else(|| FormatError {
            line: self.line,
            problem: match word {
                Some(word) => format!("a number is expected instead of `{word}`; export the mesh again"),
                None => "a number is missing; export the mesh again".to_owned(),
            },
        })
    }

    fn count(&mut self) -> Result<usize, FormatError> {
        self.count_after(0)
    }

    /// Reads a number of entries; `others`: entries of the same kind so far, counted against [`MOST`].
    fn count_after(&mut self, others: usize) -> Result<usize, FormatError> {
        let count: usize = self.number()?;
        if others.saturating_add(count) > MOST {
            let problem = format!(
                "{count} more entries exceed the limit of {MOST} nodes or elements: use a coarser mesh"
            );
            return Err(FormatError { line: self.line, problem });
        }
        Ok(count)
    }

    fn skip(&mut self, count: usize) -> Result<(), FormatError> {
        (0..count).try_for_each(|_| self.number::<f64>().map(|_| ()))
    }
}

#[derive(Default)]
struct Reader {
    /// Names of physical groups, by dimension and tag.
    names: BTreeMap<(usize, i64), String>,
    /// Tags of the physical groups of a surface or volume, by its dimension and tag.
    groups: BTreeMap<(usize, i64), Vec<i64>>,
    /// Indices of the nodes, by tag.
    numbers: BTreeMap<usize, usize>,
    parts: Parts,
    has_format: bool,
}

/// Parses the text of a mesh file; coordinates in metres.
///
/// # Errors
/// A [`FormatError`] with the line number: another format, a malformed section, an element of another kind or with an unknown
/// node, or more nodes or elements than 40 000.
pub fn read(text: &str) -> Result<Parts, FormatError> {
    let mut lines = Lines { all: text.lines().enumerate(), line: 1 };
    let mut reader = Reader::default();
    while let Some(line) = lines.next() {
        let Some(section) = line.strip_prefix('$') else {
            if line.is_empty() {
                continue;
            }
            return lines.fail(
                "a section is expected here: this is not a Gmsh mesh; export the mesh in Gmsh format 4.1, as text",
            );
        };
        if !reader.has_format && section != "MeshFormat" && section != "Comments" {
            return lines.fail("`$MeshFormat` is missing before this section; export the mesh again");
        }
        match section {
            "MeshFormat" => reader.format(&mut lines)?,
            "PhysicalNames" => reader.names(&mut lines)?,
            "Entities" => reader.entities(&mut lines)?,
            "Nodes" => reader.nodes(&mut lines)?,
            "Elements" => reader.elements(&mut lines)?,
            _ => {}
        }
        let end = format!("$End{section}");
        let is_known = matches!(section, "MeshFormat" | "PhysicalNames" | "Entities" | "Nodes" | "Elements");
        loop {
            match lines.next() {
                Some(line) if line == end => break,
                Some(line) if is_known && !line.is_empty() => {
                    return lines.fail(format!("`{end}` is expected here; export the mesh again"));
                }
                Some(_) => {}
                None => return lines.fail(format!("the file ends without `{end}`; export the mesh again")),
            }
        }
    }
    if !reader.has_format {
        return lines.fail("`$MeshFormat` is missing; export the mesh in Gmsh format 4.1, as text");
    }
    Ok(reader.parts)
}

impl Reader {
    fn format(&mut self, lines: &mut Lines<'_>) -> Result<(), FormatError> {
        let mut words = lines.words()?;
        let version: f64 = words.number()?;
        let is_binary = words.number::<u8>()? != 0;
        if !(4.1..4.2).contains(&version) {
            return lines.fail(format!(
                "format {version} is not supported: write format 4.1 (`gmsh -format msh41`, or `Mesh.MshFileVersion = 4.1`)"
            ));
        }
        if is_binary {
            return lines.fail("the file is binary but was changed as text: export the mesh again");
        }
        self.has_format = true;
        Ok(())
    }

    fn names(&mut self, lines: &mut Lines<'_>) -> Result<(), FormatError> {
        for _ in 0..lines.words()?.count()? {
            let mut words = lines.words()?;
            let (dimension, tag): (usize, i64) = (words.number()?, words.number()?);
            let name = words.words.collect::<Vec<_>>().join(" ");
            self.names.insert((dimension, tag), name.trim_matches('"').to_owned());
        }
        Ok(())
    }

    fn entities(&mut self, lines: &mut Lines<'_>) -> Result<(), FormatError> {
        let mut words = lines.words()?;
        let counts: [usize; 4] = [words.count()?, words.count()?, words.count()?, words.count()?];
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let mut words = lines.words()?;
                let tag: i64 = words.number()?;
                words.skip(if dimension == 0 { 3 } else { 6 })?;
                let groups = (0..words.count()?).map(|_| words.number()).collect::<Result<Vec<i64>, _>>()?;
                self.groups.insert((dimension, tag), groups);
            }
        }
        Ok(())
    }

    fn nodes(&mut self, lines: &mut Lines<'_>) -> Result<(), FormatError> {
        let mut words = lines.words()?;
        let blocks = words.count()?;
        words.count()?;
        for _ in 0..blocks {
            let mut words = lines.words()?;
            words.skip(3)?;
            let count = words.count_after(self.parts.nodes_m.len())?;
            let tags =
                (0..count).map(|_| lines.words()?.number()).collect::<Result<Vec<usize>, FormatError>>()?;
            for tag in tags {
                let mut words = lines.words()?;
                let position = [words.number()?, words.number()?, words.number()?];
                if self.numbers.insert(tag, self.parts.nodes_m.len()).is_some() {
                    return lines.fail(format!("node {tag} is given twice; remove one"));
                }
                self.parts.nodes_m.push(position);
            }
        }
        Ok(())
    }

    fn elements(&mut self, lines: &mut Lines<'_>) -> Result<(), FormatError> {
        let mut words = lines.words()?;
        let blocks = words.count()?;
        words.count()?;
        for _ in 0..blocks {
            let mut words = lines.words()?;
            words.skip(1)?;
            let (entity, kind): (i64, u32) = (words.number()?, words.number()?);
            let count = words.count_after(self.parts.elements.len() + self.parts.faces.len())?;
            let nodes = match kind {
                9 => 6,
                11 => 10,
                16 => 8,
                17 => 20,
                2..=7 => {
                    return lines.fail(
                        "linear elements are 20 to 50 % too stiff: write quadratic ones (`gmsh -order 2`, or `Mesh.ElementOrder = 2`)",
                    );
                }
                10 | 12 => {
                    return lines
                        .fail("bricks of 27 nodes are not supported: write bricks of 20 nodes (`Mesh.SecondOrderIncomplete = 1`)");
                }
                1 | 8 | 15 => 0, // lines and points
                _ => {
                    return lines.fail(format!(
                        "elements of Gmsh's type {kind} are not supported: use tetrahedra of 10 nodes (type 11) and \
                         bricks of 20 nodes (type 17)"
                    ));
                }
            };
            for _ in 0..count {
                let mut words = lines.words()?;
                if nodes == 0 {
                    continue;
                }
                let tag: usize = words.number()?;
                let mut found = Vec::with_capacity(nodes);
                for _ in 0..nodes {
                    let node: usize = words.number()?;
                    match self.numbers.get(&node) {
                        Some(&number) => found.push(number),
                        None => {
                            return lines
                                .fail(format!("element {tag} has a node {node} that is not in `$Nodes`; export the mesh again"));
                        }
                    }
                }
                self.add(entity, kind, tag, found);
            }
        }
        Ok(())
    }

    /// Returns the names of the physical groups of a surface or volume; a group without a name is named by its number.
    fn names_of(&self, dimension: usize, entity: i64) -> Vec<String> {
        let groups = self.groups.get(&(dimension, entity)).into_iter().flatten();
        // The sign is the orientation.
        let named = |group: &i64| {
            let tag = i64::try_from(group.unsigned_abs()).ok();
            let name = tag.and_then(|tag| self.names.get(&(dimension, tag))).cloned();
            name.unwrap_or_else(|| group.unsigned_abs().to_string())
        };
        groups.map(named).collect()
    }

    fn add(&mut self, entity: i64, kind: u32, tag: usize, mut nodes: Vec<usize>) {
        let volume = match kind {
            11 => Some(Kind::Tetrahedron),
            17 => Some(Kind::Brick),
            _ => None,
        };
        if let Some(kind) = volume {
            let name = self.names_of(3, entity).into_iter().next().unwrap_or_default();
            let known = self.parts.regions.iter().position(|other| *other == name);
            let region = known.unwrap_or_else(|| {
                self.parts.regions.push(name);
                self.parts.regions.len() - 1
            });
            self.parts.elements.push(Element { kind, nodes, tag, region });
            return;
        }
        nodes.truncate(if kind == 9 { 3 } else { 4 });
        for name in self.names_of(2, entity) {
            self.parts.surfaces.entry(name).or_default().push(nodes.clone());
        }
        self.parts.faces.push(nodes);
    }
}

/// Binary sections of a file, rewritten as text.
struct Binary<'a> {
    rest: &'a [u8],
    text: String,
}

/// Numbers of nodes of Gmsh's element types, from type 1; 0: not known here.
const NODES: [usize; 17] = [2, 3, 4, 4, 8, 6, 5, 3, 6, 9, 10, 27, 0, 0, 1, 8, 20];

impl<'a> Binary<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (front, rest) = self.rest.split_at_checked(count)?;
        self.rest = rest;
        Some(front)
    }

    fn line(&mut self) -> Option<&'a [u8]> {
        let end = self.rest.iter().position(|byte| *byte == b'\n')?;
        self.take(end + 1)
    }

    /// Rewrites numbers: `i` of four bytes, `u` and `f` of eight. Returns the last whole one.
    fn words(&mut self, kind: char, count: usize) -> Option<usize> {
        use fmt::Write as _;
        let mut last = 0;
        for _ in 0..count {
            let _ = match kind {
                'i' => {
                    let value = i32::from_le_bytes(self.take(4)?.try_into().ok()?);
                    last = usize::try_from(value).unwrap_or_default();
                    write!(self.text, "{value} ")
                }
                'f' => {
                    let value = f64::from_le_bytes(self.take(8)?.try_into().ok()?);
                    write!(self.text, "{value:e} ")
                }
                _ => {
                    last = usize::try_from(u64::from_le_bytes(self.take(8)?.try_into().ok()?)).ok()?;
                    write!(self.text, "{last} ")
                }
            };
        }
        Some(last)
    }

    fn entities(&mut self) -> Option<()> {
        let counts = [self.words('u', 1)?, self.words('u', 1)?, self.words('u', 1)?, self.words('u', 1)?];
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                self.text.push('\n');
                self.words('i', 1)?;
                self.words('f', if dimension == 0 { 3 } else { 6 })?;
                for _ in 0..if dimension == 0 { 1 } else { 2 } {
                    let tags = self.words('u', 1)?;
                    self.words('i', tags)?;
                }
            }
        }
        Some(())
    }

    /// Rewrites the blocks of nodes or of elements.
    fn blocks(&mut self, are_nodes: bool) -> Option<()> {
        let blocks = self.words('u', 1)?;
        self.words('u', 3)?;
        for _ in 0..blocks {
            self.text.push('\n');
            let dimension = self.words('i', 1)?;
            self.words('i', 1)?;
            let kind = self.words('i', 1)?;
            let count = self.words('u', 1)?;
            let nodes = if are_nodes { 0 } else { *NODES.get(kind.checked_sub(1)?).filter(|n| **n > 0)? };
            for _ in 0..count {
                self.text.push('\n');
                self.words('u', 1 + nodes)?;
            }
            for _ in 0..if are_nodes { count } else { 0 } {
                self.text.push('\n');
                self.words('f', if kind == 0 { 3 } else { 3 + dimension })?;
            }
        }
        Some(())
    }

    /// Rewrites the next section; `None` if it ends too early, or has elements of an unknown kind.
    fn section(&mut self) -> Option<()> {
        let name = std::str::from_utf8(self.line()?).ok()?.trim_end();
        self.text += name;
        self.text.push('\n');
        match name {
            "$MeshFormat" => {
                let words = std::str::from_utf8(self.line()?).ok()?;
                self.text += &words.replacen(" 1 ", " 0 ", 1);
                // The number one, as this machine would write it.
                if self.take(4)? != [1, 0, 0, 0] {
                    return None;
                }
            }
            "$Entities" => self.entities()?,
            "$Nodes" | "$Elements" => self.blocks(name == "$Nodes")?,
            _ => {
                let end = self.rest.windows(5).position(|w| w == b"\n$End")?;
                let text = String::from_utf8_lossy(self.take(end)?);
                self.text += &text;
            }
        }
        self.line()?;
        self.text.push('\n');
        let end = std::str::from_utf8(self.line()?).ok()?;
        self.text += end;
        Some(())
    }
}

/// Returns the text of a binary file; a text file as it is.
///
/// # Errors
/// A [`FormatError`] for a binary file that ends too early, or that is not for this kind of processor.
pub fn to_text(bytes: &[u8]) -> Result<String, FormatError> {
    let is_binary = bytes.starts_with(b"$MeshFormat") && {
        let format = bytes.split(|byte| *byte == b'\n').nth(1).unwrap_or_default();
        std::str::from_utf8(format).is_ok_and(|line| line.split_ascii_whitespace().nth(1) == Some("1"))
    };
    if !is_binary {
        return Ok(String::from_utf8_lossy(bytes).into_owned());
    }
    let mut binary = Binary { rest: bytes, text: String::new() };
    while !binary.rest.is_empty() {
        binary.section().ok_or_else(|| FormatError {
            line: 1 + binary.text.lines().count(),
            problem: "the binary mesh ends here, or is not of little-endian numbers, or has elements of an unknown kind: \
                      export the mesh again, as text if need be (`Mesh.Binary = 0`)"
                .to_owned(),
        })?;
    }
    Ok(binary.text)
}
