//! Triangle soup: the triangles of a file, without unit and without connectivity.

/// Triangle soup of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Soup {
    /// Points in the unit of the file, finite.
    pub points: Vec<[f64; 3]>,
    /// Corners of each triangle.
    pub triangles: Vec<[u32; 3]>,
    /// Group of each triangle; empty for a file without groups.
    pub groups: Vec<u16>,
    /// Names of the groups.
    pub names: Vec<String>,
    /// Length of the unit of the file, m, if the format defines it (GLB: 1).
    pub metres: Option<f64>,
}

/// Maximum number of triangles: twenty times the largest mesh of the tests; 300 bytes each.
pub const MOST_TRIANGLES: usize = 20_000_000;
/// Maximum coordinate in the unit of the file, beyond any real object.
pub const LARGEST: f64 = 1.0e9;

impl Soup {
    /// Returns the index of a group, and adds the group if it is new; groups beyond 65 535 share the last index.
    pub(crate) fn group(&mut self, name: &str) -> u16 {
        let found = self.names.iter().rposition(|other| other == name);
        let index = found.unwrap_or_else(|| {
            if self.names.len() < usize::from(u16::MAX) {
                self.names.push(name.to_owned());
            }
            self.names.len() - 1
        });
        u16::try_from(index).unwrap_or(u16::MAX)
    }

    /// Adds a polygon as a fan of triangles about its first corner.
    pub(crate) fn push_polygon(&mut self, corners: &[u32], group: u16) {
        for pair in corners.windows(2).skip(1) {
            self.triangles.push([corners[0], pair[0], pair[1]]);
            self.groups.push(group);
        }
    }
}
