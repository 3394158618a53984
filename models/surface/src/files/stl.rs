//! STL: triangle soup, as text or in binary32. A binary file may begin with `solid` as well, so its length decides.

use super::bytes::{Cursor, Order, Scalar};
use super::{NOT_FINITE, Problem, is_usable, next_index, text};
use crate::soup::Soup;

/// Length of the header, bytes: a title and the number of triangles.
const HEAD: usize = 84;
/// Size of a triangle, bytes: a normal, three corners, two bytes of attributes.
const FACET: usize = 50;

fn count(bytes: &[u8]) -> Option<usize> {
    let count: [u8; 4] = bytes.get(80..HEAD)?.try_into().ok()?;
    usize::try_from(u32::from_le_bytes(count)).ok()
}

/// Returns true for a file whose length is that of a binary STL file.
pub(super) fn is_binary(bytes: &[u8]) -> bool {
    count(bytes).and_then(|count| count.checked_mul(FACET)).is_some_and(|size| bytes.len() == HEAD + size)
}

/// Reads a file.
pub(super) fn read(bytes: Vec<u8>) -> Result<Soup, Problem> {
    if is_binary(&bytes) {
        return binary(&bytes);
    }
    if bytes.trim_ascii_start().starts_with(b"solid") && !bytes.iter().take(1024).any(|byte| *byte == 0) {
        return read_text(&text(bytes)?);
    }
    match count(&bytes) {
        Some(count) => Err(Problem::byte(
            80,
            format!(
                "the header gives {count} triangles, but the file has {} bytes instead of {}; copy or export \
                 the file again",
                bytes.len(),
                HEAD as u64 + FACET as u64 * count as u64
            ),
        )),
        None => Err(Problem::file(
            "this is not an STL file: it is shorter than 84 bytes and does not begin with `solid`; name another file",
        )),
    }
}

fn binary(bytes: &[u8]) -> Result<Soup, Problem> {
    let count = (bytes.len() - HEAD) / FACET;
    let mut soup = Soup { points: Vec::with_capacity(3 * count), ..Soup::default() };
    soup.triangles.reserve_exact(count);
    for i in 0..count {
        let mut cursor = Cursor::new(bytes, HEAD + FACET * i + 12, Order::Little);
        let first = next_index(soup.points.len() + 3, super::At::Byte(cursor.at))? - 3;
        for _ in 0..3 {
            let at = cursor.at;
            let mut point = [0.0; 3];
            for x in &mut point {
                *x = cursor.number(Scalar::F32)?;
            }
            if !point.iter().all(|x| is_usable(*x)) {
                return Err(Problem::byte(at, NOT_FINITE));
            }
            soup.points.push(point);
        }
        soup.triangles.push([first, first + 1, first + 2]);
    }
    Ok(soup)
}

fn read_text(text: &str) -> Result<Soup, Problem> {
    let mut soup = Soup::default();
    let (mut group, mut corners) = (0, 0);
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("solid") => group = soup.group(&words.collect::<Vec<_>>().join(" ")),
            Some("vertex") => {
                let mut point = [0.0; 3];
                for x in &mut point {
                    let word = words.next().and_then(|word| word.parse().ok());
                    *x = word.ok_or_else(|| {
                        Problem::line(
                            number,
                            "a corner is `vertex X Y Z` with three numbers; export the mesh again",
                        )
                    })?;
                }
                if !point.iter().all(|x| is_usable(*x)) {
                    return Err(Problem::line(number, NOT_FINITE));
                }
                soup.points.push(point);
                corners += 1;
            }
            Some("endloop") => {
                if corners != 3 {
                    return Err(Problem::line(
                        number,
                        format!("a facet has {corners} corners instead of 3; export the mesh again"),
                    ));
                }
                let last = next_index(soup.points.len(), super::At::Line(number))?;
                soup.triangles.push([last - 3, last - 2, last - 1]);
                soup.groups.push(group);
                corners = 0;
            }
            Some("facet" | "outer" | "endfacet" | "endsolid" | "color") | None => {}
            Some(other) => {
                let other: String = other.chars().take(20).flat_map(char::escape_debug).collect();
                return Err(Problem::line(
                    number,
                    format!("`{other}` is not an STL keyword; export the mesh again"),
                ));
            }
        }
    }
    if corners != 0 {
        return Err(Problem::file("the file ends in the middle of a facet; copy or export the file again"));
    }
    Ok(soup)
}
