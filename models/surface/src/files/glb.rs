//! Binary glTF 2.0: triangles of all meshes, transformed by the nodes of the scene, in metres.

use super::bytes::{Cursor, Order, Scalar};
use super::{At, NOT_FINITE, Problem, is_usable, next_index};
use crate::soup::Soup;
use flotor_hal::glam::{DMat4, DQuat, DVec3};
use serde_json::Value;

/// Maximum depth of nested nodes.
const DEEPEST: usize = 64;
/// Maximum number of triangles of all mesh instances: a small file can repeat one mesh many times.
const MOST_PLACED: usize = 20_000_000;

/// Types of the JSON chunk and of the binary chunk.
const JSON: u32 = 0x4e4f_534a;
const BINARY: u32 = 0x004e_4942;

struct Glb<'a> {
    json: Value,
    binary: &'a [u8],
    /// Offset of the binary chunk in the file.
    start: usize,
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Soup, Problem> {
    let glb = Glb::open(bytes)?;
    let mut soup = Soup { metres: Some(1.0), ..Soup::default() };
    let extensions = glb.list(&glb.json, "extensionsRequired");
    if let Some(name) = extensions
        .iter()
        .filter_map(Value::as_str)
        .find(|name| name.contains("draco") || name.contains("meshopt") || name.contains("quantization"))
    {
        return Err(Problem::file(format!(
            "the mesh uses `{name}`, which is not supported; export the mesh without compression"
        )));
    }
    let scene = glb.json.get("scene").and_then(Value::as_u64).unwrap_or(0);
    let scenes = glb.list(&glb.json, "scenes");
    let roots: Vec<usize> = match usize::try_from(scene).ok().and_then(|scene| scenes.get(scene)) {
        Some(scene) => indices(scene, "nodes"),
        None => (0..glb.list(&glb.json, "nodes").len()).collect(),
    };
    for root in roots {
        glb.node(root, DMat4::IDENTITY, 0, &mut soup)?;
    }
    Ok(soup)
}

fn indices(value: &Value, key: &str) -> Vec<usize> {
    let list = value.get(key).and_then(Value::as_array);
    list.into_iter().flatten().filter_map(|one| usize::try_from(one.as_u64()?).ok()).collect()
}

fn index(value: &Value, key: &str) -> Option<usize> {
    value.get(key).and_then(Value::as_u64).and_then(|one| usize::try_from(one).ok())
}

fn numbers<const N: usize>(value: &Value, key: &str) -> Option<[f64; N]> {
    let list: Vec<f64> = value.get(key)?.as_array()?.iter().filter_map(Value::as_f64).collect();
    list.try_into().ok()
}

/// Returns the transform of a node to its parent.
fn placement(node: &Value) -> DMat4 {
    if let Some(columns) = numbers::<16>(node, "matrix") {
        return DMat4::from_cols_array(&columns);
    }
    let turn = numbers(node, "rotation").map_or(DQuat::IDENTITY, DQuat::from_array);
    let scale = numbers(node, "scale").map_or(DVec3::ONE, DVec3::from_array);
    let shift = numbers(node, "translation").map_or(DVec3::ZERO, DVec3::from_array);
    DMat4::from_scale_rotation_translation(scale, turn, shift)
}

impl<'a> Glb<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, Problem> {
        let mut cursor = Cursor::new(bytes, 4, Order::Little);
        let version = cursor.index(Scalar::U32)?;
        if version != 2 {
            return Err(Problem::byte(
                4,
                format!("glTF version {version} is not supported; export version 2"),
            ));
        }
        cursor.skip(4)?;
        let (mut json, mut binary, mut start) = (None, &bytes[..0], 0);
        while cursor.at < bytes.len() {
            let at = cursor.at;
            let length = cursor.index(Scalar::U32)?;
            let kind = cursor.index(Scalar::U32)?;
            let from = cursor.at;
            cursor.skip(length)?;
            let chunk = &bytes[from..cursor.at];
            if kind == JSON as usize && json.is_none() {
                json = Some(serde_json::from_slice(chunk).map_err(|error| {
                    Problem::byte(
                        at,
                        format!("the JSON of the file is malformed ({error}); export the mesh again"),
                    )
                })?);
            } else if kind == BINARY as usize && start == 0 {
                (binary, start) = (chunk, from);
            }
        }
        let json =
            json.ok_or_else(|| Problem::byte(12, "the file has no JSON chunk; export the mesh again"))?;
        Ok(Self { json, binary, start })
    }

    fn list<'b>(&'b self, value: &'b Value, key: &str) -> &'b [Value] {
        value.get(key).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    fn node(&self, number: usize, parent: DMat4, depth: usize, soup: &mut Soup) -> Result<(), Problem> {
        let missing = || {
            Problem::file(format!("node {number} is missing or its own descendant; export the mesh again"))
        };
        if depth > DEEPEST {
            return Err(missing());
        }
        let node = self.list(&self.json, "nodes").get(number).ok_or_else(missing)?;
        let place = parent * placement(node);
        if let Some(mesh) = index(node, "mesh") {
            let name = node.get("name").and_then(Value::as_str).unwrap_or_default();
            self.mesh(mesh, name, place, soup)?;
        }
        for child in indices(node, "children") {
            self.node(child, place, depth + 1, soup)?;
        }
        Ok(())
    }

    fn mesh(&self, number: usize, name: &str, place: DMat4, soup: &mut Soup) -> Result<(), Problem> {
        let wrong = |problem: &str| Problem::file(format!("mesh {number}: {problem}; export the mesh again"));
        let mesh = self.list(&self.json, "meshes").get(number).ok_or_else(|| wrong("it is missing"))?;
        for primitive in self.list(mesh, "primitives") {
            if index(primitive, "mode").unwrap_or(4) != 4 {
                continue; // points and lines have nothing to touch; strips are rare
            }
            let material = index(primitive, "material")
                .and_then(|material| self.list(&self.json, "materials").get(material))
                .and_then(|material| material.get("name")?.as_str());
            let group = soup.group(material.unwrap_or(name));
            let positions = primitive.get("attributes").and_then(|all| index(all, "POSITION"));
            let positions = positions.ok_or_else(|| wrong("a part has no positions"))?;
            let first = soup.points.len();
            self.read(positions, 3, |row| {
                let p = place.transform_point3(DVec3::new(row[0], row[1], row[2]));
                if !p.to_array().iter().all(|x| is_usable(*x)) {
                    return Err(NOT_FINITE);
                }
                soup.points.push(p.to_array());
                Ok(())
            })?;
            let count = soup.points.len() - first;
            let mut corners = Vec::new();
            match index(primitive, "indices") {
                Some(accessor) => self.read(accessor, 1, |row| {
                    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // checked
                    let corner = row[0] as usize;
                    if row[0] < 0.0 || corner >= count {
                        return Err("a triangle has the index of a missing vertex; export the mesh again");
                    }
                    corners.push(first + corner);
                    Ok(())
                })?,
                None => corners.extend(first..first + count),
            }
            if soup.triangles.len() + corners.len() / 3 > MOST_PLACED {
                return Err(Problem::file(
                    "the nodes of the file repeat its meshes too often; reduce the mesh or its instances",
                ));
            }
            let is_mirrored = place.determinant() < 0.0;
            for corner in corners.as_chunks::<3>().0 {
                let [a, b, c] = *corner;
                let mut triangle = [a, b, c].map(|corner| next_index(corner, At::File)).into_iter();
                let mut next = || triangle.next().unwrap_or(Ok(0));
                let (a, b, c) = (next()?, next()?, next()?);
                soup.triangles.push(if is_mirrored { [a, c, b] } else { [a, b, c] });
                soup.groups.push(group);
            }
        }
        Ok(())
    }

    /// Reads the rows of an accessor with `width` numbers each.
    fn read(
        &self,
        accessor: usize,
        width: usize,
        mut row: impl FnMut([f64; 3]) -> Result<(), &'static str>,
    ) -> Result<(), Problem> {
        let wrong =
            |problem: &str| Problem::file(format!("accessor {accessor}: {problem}; export the mesh again"));
        let one = self.list(&self.json, "accessors").get(accessor).ok_or_else(|| wrong("it is missing"))?;
        if one.get("sparse").is_some() {
            return Err(wrong("sparse data are not supported"));
        }
        let scalar = match index(one, "componentType") {
            Some(5121) => Scalar::U8,
            Some(5123) => Scalar::U16,
            Some(5125) => Scalar::U32,
            Some(5126) => Scalar::F32,
            _ => return Err(wrong("its component type is not supported")),
        };
        let kind = one.get("type").and_then(Value::as_str).unwrap_or_default();
        if kind != if width == 3 { "VEC3" } else { "SCALAR" } {
            return Err(wrong("it has the wrong number of components"));
        }
        let rows = index(one, "count").ok_or_else(|| wrong("it has no count"))?;
        let view = index(one, "bufferView").and_then(|view| self.list(&self.json, "bufferViews").get(view));
        let view = view.ok_or_else(|| wrong("it has no data"))?;
        if index(view, "buffer").unwrap_or(0) != 0 {
            return Err(wrong("its data are in another file"));
        }
        let offset =
            index(one, "byteOffset").unwrap_or(0).checked_add(index(view, "byteOffset").unwrap_or(0));
        let offset = offset.ok_or_else(|| wrong("its data lie outside the file"))?;
        let size = scalar.bytes() * width;
        let stride = index(view, "byteStride").filter(|stride| *stride > 0).unwrap_or(size);
        for i in 0..rows {
            let at = i.checked_mul(stride).and_then(|shift| shift.checked_add(offset));
            let at = at.ok_or_else(|| wrong("its data lie outside the file"))?;
            let mut cursor = Cursor::new(self.binary, at, Order::Little);
            let mut numbers = [0.0; 3];
            for x in numbers.iter_mut().take(width) {
                *x = cursor.number(scalar).map_err(|_| wrong("its data lie outside the file"))?;
            }
            row(numbers).map_err(|problem| Problem::byte(self.start + at, problem))?;
        }
        Ok(())
    }
}
