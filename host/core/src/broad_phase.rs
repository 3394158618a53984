//! Broad phase: finds the models that can act at the handle, with a uniform grid over their active regions.
//!
//! A model declares its active region ([`flotor_hal::ActiveRegion`]); elsewhere the wrench of the model is zero, and the model is
//! not stepped. The grid is built before the loop starts, over the bounding box of all regions, with cells about twice the median
//! size of a region, so that a region lies in a few cells and a cell holds a few regions. A tick looks up one cell and compares the
//! handle with the boxes of the objects in it; objects elsewhere cost nothing.
//!
//! Objects do not move (their mapping is fixed); an object whose region is changed by a live parameter is checked in every tick
//! from then on ([`BroadPhase::watch_always`]).
//!
//! Source: C. Ericson, "Real-Time Collision Detection", 2005, section 7.1 (uniform grids).

use flotor_hal::{DVec3, math};

/// Maximum number of cells that an object's box may overlap; a larger object is checked in every tick instead.
const MAX_CELLS_OF_AN_OBJECT: usize = 64;
/// Maximum number of cells along an axis.
const MAX_CELLS_OF_AN_AXIS: f64 = 128.0;
/// Ratio of a cell's side to the median side of the boxes.
const CELL_OVER_BOX: f64 = 2.0;
/// Margin of a box around its region, m: larger than the rounding of the mapping from the model's frame.
const ROUNDING_M: f64 = 1.0e-9;

/// Axis-aligned box in the device frame around an object's region, m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    low_m: DVec3,
    high_m: DVec3,
}

impl Bounds {
    /// Creates a box about `center_m` with half extents `half_sides_m` and a margin for rounding.
    pub fn about(center_m: DVec3, half_sides_m: DVec3) -> Self {
        let half_sides_m = half_sides_m + ROUNDING_M;
        Self { low_m: center_m - half_sides_m, high_m: center_m + half_sides_m }
    }

    /// Returns the bounding box of both boxes. Real-time: bounded, no allocation.
    pub fn with(self, other: Self) -> Self {
        Self { low_m: self.low_m.min(other.low_m), high_m: self.high_m.max(other.high_m) }
    }

    /// Returns true if the handle is inside. Real-time: bounded, no allocation.
    #[inline]
    pub fn contains(&self, position_m: DVec3) -> bool {
        self.low_m.cmple(position_m).all() && position_m.cmple(self.high_m).all()
    }
}

/// Lookup of the objects that can act at a position. Allocates at construction only.
pub struct BroadPhase {
    /// Box of each object; `None` for an object that can act anywhere.
    bounds: Box<[Option<Bounds>]>,
    /// Objects to check in every tick, in order, without duplicates.
    always: Vec<u32>,
    grid: Grid,
}

/// Uniform grid with the objects of each cell.
struct Grid {
    origin_m: DVec3,
    /// Cells per metre, along each axis.
    per_m: DVec3,
    /// Cells along each axis.
    counts: [usize; 3],
    /// Numbers of the objects in each cell, ascending; empty if all cells are empty.
    objects: Box<[Box<[u32]>]>,
}

impl BroadPhase {
    /// Sorts objects into the grid; `bounds` has the box in which each object can act, `None` for everywhere. Not real-time.
    #[allow(clippy::indexing_slicing)] // the cells of a box are cells of the grid
    pub fn new(bounds: Vec<Option<Bounds>>) -> Self {
        let boxed: Vec<Bounds> = bounds.iter().copied().flatten().collect();
        let mut grid = Grid::over(&boxed);
        let mut always = Vec::with_capacity(bounds.len());
        let mut in_cells = vec![Vec::<u32>::new(); grid.counts.iter().product()];
        for (object, bounds) in (0..).zip(&bounds) {
            match bounds {
                Some(bounds) if grid.cells_of(bounds).count() <= MAX_CELLS_OF_AN_OBJECT => {
                    grid.cells_of(bounds).for_each(|cell| in_cells[cell].push(object));
                }
                _ => always.push(object),
            }
        }
        if in_cells.iter().any(|objects| !objects.is_empty()) {
            grid.objects = in_cells.into_iter().map(Vec::into_boxed_slice).collect();
        }
        Self { bounds: bounds.into(), always, grid }
    }

    /// Calls `meet` for each of `objects` that can act on the handle at `position_m`, in order of their numbers: sums do not depend
    /// on inactive objects.
    ///
    /// Real-time: bounded by the objects that are near or may act anywhere; no allocation.
    #[inline]
    pub fn for_each_near<T>(&self, objects: &mut [T], position_m: DVec3, mut meet: impl FnMut(&mut T)) {
        let (mut in_cell, mut always) = (self.grid.objects_at(position_m), &*self.always);
        loop {
            let number = match (in_cell, always) {
                ([], []) => return,
                ([], [number, rest @ ..]) => {
                    always = rest;
                    *number
                }
                ([number, rest @ ..], []) => {
                    in_cell = rest;
                    *number
                }
                ([a, after_a @ ..], [b, after_b @ ..]) => {
                    // An object that is always checked may be in the cell, too.
                    in_cell = if a <= b { after_a } else { in_cell };
                    always = if b <= a { after_b } else { always };
                    *a.min(b)
                }
            };
            let is_near = self.bounds(number as usize).is_none_or(|bounds| bounds.contains(position_m));
            if let Some(object) = objects.get_mut(number as usize)
                && is_near
            {
                meet(object);
            }
        }
    }

    /// Replaces the box of an object after a live parameter has changed it; the object is checked in every tick from now on.
    ///
    /// Real-time: bounded by the number of objects, no allocation.
    pub fn watch_always(&mut self, object: usize, bounds: Option<Bounds>) {
        let (Some(place), Ok(number)) = (self.bounds.get_mut(object), u32::try_from(object)) else { return };
        *place = bounds;
        if let Err(at) = self.always.binary_search(&number) {
            self.always.insert(at, number); // there is room: the list never holds an object twice
        }
    }

    /// Returns the bounding box of all objects' boxes; `None` if an object can act everywhere, or there is no object.
    ///
    /// Real-time: bounded by the number of objects, no allocation.
    pub fn hull(&self) -> Option<Bounds> {
        let mut boxes = self.bounds.iter().copied();
        let first = boxes.next().flatten()?;
        boxes.try_fold(first, |hull, bounds| Some(hull.with(bounds?)))
    }

    /// Returns the box in which an object can act; `None` for everywhere. Real-time: bounded, no allocation.
    pub fn bounds(&self, object: usize) -> Option<Bounds> {
        self.bounds.get(object).copied().flatten()
    }
}

impl Grid {
    /// Creates a grid over all boxes, without objects. Not real-time.
    #[allow(clippy::indexing_slicing)] // three axes
    fn over(boxed: &[Bounds]) -> Self {
        let hull = boxed.iter().copied().reduce(Bounds::with);
        let hull = hull.unwrap_or(Bounds { low_m: DVec3::ZERO, high_m: DVec3::ZERO });
        let extent_m = (hull.high_m - hull.low_m).to_array();
        let most = MAX_CELLS_OF_AN_AXIS.min(math::cbrt(boxed.len() as f64).ceil() * 2.0);
        let counts = [0, 1, 2].map(|axis| {
            let mut sides_m: Vec<f64> =
                boxed.iter().map(|bounds| (bounds.high_m - bounds.low_m)[axis]).collect();
            sides_m.sort_by(f64::total_cmp);
            let median_m = sides_m.get(sides_m.len() / 2).copied().unwrap_or(f64::INFINITY);
            let wanted = (extent_m[axis] / (CELL_OVER_BOX * median_m)).floor();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to 1..=128
            let count = if wanted.is_finite() { wanted.clamp(1.0, most.max(1.0)) as usize } else { 1 };
            count
        });
        let per_m = [0, 1, 2].map(|axis| {
            let per_m = counts[axis] as f64 / extent_m[axis];
            if per_m.is_finite() { per_m } else { 0.0 }
        });
        Self { origin_m: hull.low_m, per_m: DVec3::from_array(per_m), counts, objects: Box::default() }
    }

    /// Returns the numbers of the cells that a box overlaps. Not real-time.
    fn cells_of(&self, bounds: &Bounds) -> impl Iterator<Item = usize> + use<> {
        let [_, y_cells, z_cells] = self.counts;
        let [[x0, y0, z0], [x1, y1, z1]] =
            [bounds.low_m, bounds.high_m].map(|corner| self.coordinates(corner));
        (x0..=x1).flat_map(move |x| {
            (y0..=y1).flat_map(move |y| (z0..=z1).map(move |z| (x * y_cells + y) * z_cells + z))
        })
    }

    /// Returns the cell of a position along each axis; the nearest one outside the grid.
    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` takes NaN and below 0 to 0
    fn coordinates(&self, position_m: DVec3) -> [usize; 3] {
        let [x, y, z] = ((position_m - self.origin_m) * self.per_m).to_array().map(|cell| cell as usize);
        let [x_cells, y_cells, z_cells] = self.counts;
        [x.min(x_cells - 1), y.min(y_cells - 1), z.min(z_cells - 1)]
    }

    /// Returns the objects of the cell at a position, or of the nearest cell: the objects' boxes are then compared.
    #[inline]
    fn objects_at(&self, position_m: DVec3) -> &[u32] {
        if self.objects.is_empty() {
            return &[];
        }
        let [_, y_cells, z_cells] = self.counts;
        let [x, y, z] = self.coordinates(position_m);
        self.objects.get((x * y_cells + y) * z_cells + z).map_or(&[], |objects| objects)
    }
}

#[cfg(test)]
mod tests;
