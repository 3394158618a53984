//! PLY (Turk 1994): text, and binary with either byte order; vertices with `x`, `y`, `z`, faces with a list of vertices.

use super::bytes::{Cursor, Order, Scalar};
use super::{At, NOT_FINITE, Problem, is_usable, next_index, text};
use crate::soup::Soup;

/// Property of an element.
struct Property {
    name: String,
    /// Type of the count before a list; `None` for a single number.
    count: Option<Scalar>,
    scalar: Scalar,
}

/// Element of the file with its number of rows.
struct Element {
    name: String,
    rows: usize,
    properties: Vec<Property>,
}

enum Encoding {
    Text,
    Binary(Order),
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// First byte of the data; below, its first line.
    data: usize,
    line: usize,
}

fn scalar(word: &str) -> Option<Scalar> {
    Some(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}

/// Maximum length of a header line, bytes.
const LONGEST: usize = 1024;

fn header(bytes: &[u8]) -> Result<Header, Problem> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let (mut at, mut line) = (0, 0);
    loop {
        line += 1;
        let wrong = |problem: &str| Problem::line(line, problem);
        let rest = bytes.get(at..).unwrap_or_default();
        let length = rest.iter().take(LONGEST).position(|byte| *byte == b'\n' || *byte == b'\r');
        let length =
            length.ok_or_else(|| wrong("the header has no `end_header`; copy or export the file again"))?;
        let text = std::str::from_utf8(&rest[..length])
            .map_err(|_| wrong("the header is not text; export the mesh again"))?;
        at += length + if rest[length..].starts_with(b"\r\n") { 2 } else { 1 };
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words[..] {
            ["format", "ascii", _] => encoding = Some(Encoding::Text),
            ["format", "binary_little_endian", _] => encoding = Some(Encoding::Binary(Order::Little)),
            ["format", "binary_big_endian", _] => encoding = Some(Encoding::Binary(Order::Big)),
            ["element", name, rows] => {
                let rows = rows
                    .parse()
                    .map_err(|_| wrong("the number of rows is not a whole number; export the mesh again"))?;
                elements.push(Element { name: name.to_owned(), rows, properties: Vec::new() });
            }
            ["property", ref kind @ .., name] => {
                let parsed = match *kind {
                    [one] => scalar(one).map(|scalar| (None, scalar)),
                    ["list", count, one] => {
                        scalar(count).zip(scalar(one)).map(|(count, one)| (Some(count), one))
                    }
                    _ => None,
                };
                let (count, scalar) = parsed
                    .ok_or_else(|| wrong("the type of the property is unknown; export the mesh again"))?;
                let element = elements
                    .last_mut()
                    .ok_or_else(|| wrong("a property precedes the first element; export the mesh again"))?;
                element.properties.push(Property { name: name.to_owned(), count, scalar });
            }
            ["end_header"] => break,
            ["ply"] | ["comment", ..] | ["obj_info", ..] | [] => {}
            _ => return Err(wrong("the line does not belong to a PLY header; export the mesh again")),
        }
    }
    let encoding = encoding
        .ok_or_else(|| Problem::line(line, "the header has no supported `format`; export the mesh again"))?;
    Ok(Header { encoding, elements, data: at, line })
}

/// Source of the numbers of the data.
enum Source<'a> {
    Text { words: std::str::SplitAsciiWhitespace<'a>, row: usize },
    Binary(Cursor<'a>),
}

impl Source<'_> {
    fn at(&self) -> At {
        match self {
            Self::Text { row, .. } => At::Line(*row),
            Self::Binary(cursor) => At::Byte(cursor.at),
        }
    }

    fn wrong(&self, problem: &str) -> Problem {
        Problem { at: self.at(), problem: problem.to_owned() }
    }

    fn number(&mut self, scalar: Scalar) -> Result<f64, Problem> {
        match self {
            Self::Binary(cursor) => cursor.number(scalar),
            Self::Text { words, .. } => {
                let word = words.next();
                let number = word.and_then(|word| word.parse().ok());
                number.ok_or_else(|| {
                    self.wrong("a number is missing or malformed here; copy or export the file again")
                })
            }
        }
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
    fn index(&mut self, scalar: Scalar) -> Result<usize, Problem> {
        if let Self::Binary(cursor) = self {
            return cursor.index(scalar);
        }
        let number = self.number(scalar)?;
        let is_index = (0.0..4.0e9).contains(&number) && number.fract() == 0.0;
        if is_index {
            Ok(number as usize)
        } else {
            Err(self.wrong("a whole number is expected here; export the mesh again"))
        }
    }
}

/// Reads a file.
pub(super) fn read(bytes: Vec<u8>) -> Result<Soup, Problem> {
    let header = header(&bytes)?;
    let owned;
    let mut source = match header.encoding {
        Encoding::Binary(order) => Source::Binary(Cursor::new(&bytes, header.data, order)),
        Encoding::Text => {
            owned = text(bytes.get(header.data..).unwrap_or_default().to_vec())?;
            Source::Text { words: owned.split_ascii_whitespace(), row: header.line }
        }
    };
    let mut soup = Soup::default();
    let mut corners = Vec::new();
    for element in &header.elements {
        let place = |name: &str| element.properties.iter().position(|p| p.name == name && p.count.is_none());
        let axes = [place("x"), place("y"), place("z")];
        let is_vertex = element.name == "vertex";
        if is_vertex && axes.iter().any(Option::is_none) {
            return Err(Problem::file("the vertices lack the properties x, y and z; export the mesh again"));
        }
        if element.properties.is_empty() {
            continue;
        }
        for _ in 0..element.rows {
            if let Source::Text { row, .. } = &mut source {
                *row += 1;
            }
            let mut point = [0.0; 3];
            for (number, property) in element.properties.iter().enumerate() {
                let Some(count) = property.count else {
                    let value = source.number(property.scalar)?;
                    if let Some(axis) =
                        axes.iter().position(|axis| *axis == Some(number)).filter(|_| is_vertex)
                    {
                        point[axis] = value;
                    }
                    continue;
                };
                let is_face = element.name == "face"
                    && matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
                corners.clear();
                for _ in 0..source.index(count)? {
                    if !is_face {
                        source.number(property.scalar)?;
                        continue;
                    }
                    let index = source.index(property.scalar)?;
                    if index >= soup.points.len() {
                        return Err(source.wrong(&format!(
                            "a face names vertex {index}, but there are {}; export the mesh again",
                            soup.points.len()
                        )));
                    }
                    corners.push(next_index(index, source.at())?);
                }
                if is_face && corners.len() >= 3 {
                    soup.push_polygon(&corners, 0);
                }
            }
            if is_vertex {
                if !point.iter().all(|x| is_usable(*x)) {
                    return Err(source.wrong(NOT_FINITE));
                }
                next_index(soup.points.len(), source.at())?;
                soup.points.push(point);
            }
        }
    }
    Ok(soup)
}
