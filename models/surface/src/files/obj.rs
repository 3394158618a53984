//! Wavefront OBJ: `v` and `f`; groups by the most recent of `usemtl`, `g` and `o`.

use super::{At, NOT_FINITE, Problem, is_usable, next_index, text};
use crate::soup::Soup;

/// Reads a file.
pub(super) fn read(bytes: Vec<u8>) -> Result<Soup, Problem> {
    let text = text(bytes)?;
    let mut soup = Soup::default();
    let mut group = None;
    let mut corners = Vec::new();
    let mut continued = String::new();
    for (index, line) in text.lines().enumerate() {
        let number = index + 1;
        if let Some(begun) = line.trim_end().strip_suffix('\\') {
            continued.push_str(begun);
            continued.push(' ');
            continue;
        }
        let whole = if continued.is_empty() {
            line
        } else {
            continued.push_str(line);
            &continued
        };
        let mut words = whole.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let mut point = [0.0; 3];
                for x in &mut point {
                    let word = words.next().and_then(|word| word.parse().ok());
                    *x = word.ok_or_else(|| {
                        Problem::line(
                            number,
                            "a vertex is `v X Y Z` with three numbers; export the mesh again",
                        )
                    })?;
                }
                if !point.iter().all(|x| is_usable(*x)) {
                    return Err(Problem::line(number, NOT_FINITE));
                }
                next_index(soup.points.len(), At::Line(number))?;
                soup.points.push(point);
            }
            Some("f") => {
                corners.clear();
                for word in words {
                    corners.push(corner(word, soup.points.len()).ok_or_else(|| {
                        let word: String = word.chars().take(20).flat_map(char::escape_debug).collect();
                        Problem::line(
                            number,
                            format!("a face has the vertex `{word}`, but the file has {} vertices up to this line; export the mesh again", soup.points.len()),
                        )
                    })?);
                }
                if corners.len() < 3 {
                    return Err(Problem::line(
                        number,
                        "a face needs three or more vertices; export the mesh again",
                    ));
                }
                let group = *group.get_or_insert_with(|| soup.group(""));
                soup.push_polygon(&corners, group);
            }
            Some("usemtl" | "g" | "o") => group = Some(soup.group(&words.collect::<Vec<_>>().join(" "))),
            // Curves, texture and display attributes have no triangles.
            _ => {}
        }
        continued.clear();
    }
    Ok(soup)
}

/// Parses a reference to a vertex (`7`, `7/1/3`, `-1`).
fn corner(word: &str, count: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let count = i64::try_from(count).ok()?;
    let index = if number < 0 { count.checked_add(number)? } else { number.checked_sub(1)? };
    if index < 0 || index >= count { None } else { u32::try_from(index).ok() }
}
