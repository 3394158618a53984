//! Triangles as a file has them: points without units, faces without neighbours, groups by name.

/// Loose triangles of a file.
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
    /// Unit of the file, if its format says it: GLB is in metres.
    pub metres: Option<f64>,
}

/// Largest number of triangles: twenty times the largest mesh of the tests, at 300 bytes each.
pub const MOST_TRIANGLES: usize = 20_000_000;
/// Largest coordinate in the unit of the file, beyond any object that is touched.
pub const LARGEST: f64 = 1.0e9;

impl Soup {
    /// Returns the number of a group, adding it if it is new; the last number for more than 65 535 groups.
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
