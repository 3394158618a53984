//! Which models can act where the handle is: a uniform grid over the regions they have declared.
//!
//! A model declares where it can act ([`flotor_hal::ActivityRegion`]); elsewhere its wrench is zero and it is not
//! stepped. The grid is built before the loop starts, over the box around all regions, with cells about twice the size
//! of a usual region, so that a region lies in a few cells and a cell holds a few regions. A tick looks up one cell
//! and compares the handle with the boxes of the objects in it; what lies elsewhere costs nothing.
//!
//! Objects do not move (their mapping is fixed); a live parameter may change a region, and then the object is looked
//! at in every tick from there on ([`BroadPhase::watch_always`]).
//!
//! Source: C. Ericson, "Real-Time Collision Detection", 2005, section 7.1 (uniform grids, cells as one array).

use flotor_hal::{DVec3, math};

/// Cells an object's box may lie in before it is looked at in every tick instead.
const MOST_CELLS_OF_AN_OBJECT: usize = 64;
/// Cells along an axis at most: a grid of this many is 8 MB.
const MOST_CELLS_OF_AN_AXIS: f64 = 128.0;
/// Side of a cell over the median side of the boxes.
const CELL_OVER_BOX: f64 = 2.0;

/// A box in the device frame that holds an object's region, m. Single precision, rounded outwards: 24 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    low_m: [f32; 3],
    high_m: [f32; 3],
}

impl Bounds {
    /// A box about `center_m` with these half sides or a little longer: two steps of single precision also cover what
    /// the way here, in double precision, has rounded.
    pub(super) fn about(center_m: DVec3, half_sides_m: DVec3) -> Self {
        let (low, high) = (center_m - half_sides_m, center_m + half_sides_m);
        #[allow(clippy::cast_possible_truncation)] // to the nearest, then outwards
        let [low_m, high_m] = [low, high].map(|corner| corner.to_array().map(|value| value as f32));
        let (down, up) = (|v: f32| v.next_down().next_down(), |v: f32| v.next_up().next_up());
        Self { low_m: low_m.map(down), high_m: high_m.map(up) }
    }

    /// The box that holds both. Real-time: bounded, no allocation.
    pub(super) fn with(self, other: Self) -> Self {
        let pairs = |[ax, ay, az]: [f32; 3], [bx, by, bz]: [f32; 3], pick: fn(f32, f32) -> f32| {
            [pick(ax, bx), pick(ay, by), pick(az, bz)]
        };
        Self {
            low_m: pairs(self.low_m, other.low_m, f32::min),
            high_m: pairs(self.high_m, other.high_m, f32::max),
        }
    }

    /// True if the handle is inside. Real-time: bounded, no allocation.
    #[inline]
    pub(super) fn contains(&self, position_m: DVec3) -> bool {
        let [low, high] = [self.low_m, self.high_m].map(|corner| DVec3::from_array(corner.map(f64::from)));
        low.cmple(position_m).all() && position_m.cmple(high).all()
    }

    fn low(&self) -> DVec3 {
        DVec3::from_array(self.low_m.map(f64::from))
    }

    fn high(&self) -> DVec3 {
        DVec3::from_array(self.high_m.map(f64::from))
    }
}

/// Objects by where they are. All memory is allocated when it is built.
pub(super) struct BroadPhase {
    /// Box of each object; `None` for one that may act anywhere.
    bounds: Box<[Option<Bounds>]>,
    /// Objects to look at in every tick, in order; never more than there are.
    always: Vec<u32>,
    /// No object has a box, as in most scenes: each is near wherever the handle is.
    is_boundless: bool,
    grid: Grid,
}

struct Grid {
    origin_m: DVec3,
    /// Cells per metre, along each axis.
    per_m: DVec3,
    cells: [usize; 3],
    /// Where each cell's objects begin in `objects`; one more than there are cells.
    starts: Box<[u32]>,
    /// Objects of each cell, in order.
    objects: Box<[u32]>,
}

impl BroadPhase {
    /// Sorts objects, each with the box it can act in, or none if that is everywhere. Not real-time.
    pub(super) fn new(bounds: Vec<Option<Bounds>>) -> Self {
        let boxed: Vec<(u32, Bounds)> =
            (0..).zip(&bounds).filter_map(|(object, bounds)| Some((object, (*bounds)?))).collect();
        let mut grid = Grid::over(&boxed);
        let (large, small): (Vec<_>, Vec<_>) = boxed
            .into_iter()
            .partition(|(_, bounds)| grid.cells_of(bounds).count() > MOST_CELLS_OF_AN_OBJECT);
        grid.fill(&small);
        let mut always = Vec::with_capacity(bounds.len());
        always.extend((0..).zip(&bounds).filter(|(_, bounds)| bounds.is_none()).map(|(object, _)| object));
        always.extend(large.iter().map(|(object, _)| *object));
        always.sort_unstable();
        let is_boundless = bounds.iter().all(Option::is_none);
        Self { bounds: bounds.into(), always, is_boundless, grid }
    }

    /// Shows `meet` those of all `objects` that can act with the handle at `position_m`, in order of their numbers.
    ///
    /// Real-time: bounded by the objects that are near or may act anywhere; no allocation.
    #[inline(always)] // as `Layer::step`
    pub(super) fn for_each_near<T>(
        &self,
        objects: &mut [T],
        position_m: &[f64; 3],
        mut meet: impl FnMut(&mut T),
    ) {
        if self.is_boundless {
            for object in objects {
                meet(object);
            }
            return;
        }
        for index in self.near(position_m) {
            if let Some(object) = objects.get_mut(index) {
                meet(object);
            }
        }
    }

    /// Numbers of the objects that can act with the handle at `position_m`, in order.
    ///
    /// Real-time: bounded by the objects that are near or may act anywhere; no allocation.
    #[inline]
    fn near<'a>(&'a self, position_m: &'a [f64; 3]) -> Near<'a> {
        // Where no object has a place of its own there is no cell to look for.
        let in_cell =
            if self.grid.objects.is_empty() { &[] } else { self.grid.cell(DVec3::from_array(*position_m)) };
        Near { bounds: &self.bounds, in_cell, always: &self.always, position_m }
    }

    /// A live parameter has changed where an object can act: it is looked at in every tick from now on.
    ///
    /// Real-time: bounded by the number of objects, no allocation.
    pub(super) fn watch_always(&mut self, object: usize, bounds: Option<Bounds>) {
        let (Some(place), Ok(number)) = (self.bounds.get_mut(object), u32::try_from(object)) else { return };
        *place = bounds;
        self.is_boundless &= bounds.is_none();
        if let Err(at) = self.always.binary_search(&number) {
            self.always.insert(at, number); // there is room: the list never holds an object twice
        }
    }

    /// The box any object can act in; `None` if one can act everywhere, or there is none.
    ///
    /// Real-time: bounded by the number of objects, no allocation.
    pub(super) fn hull(&self) -> Option<Bounds> {
        let mut boxes = self.bounds.iter().copied();
        let first = boxes.next().flatten()?;
        boxes.try_fold(first, |hull, bounds| Some(hull.with(bounds?)))
    }

    /// The box an object can act in; `None` if that is everywhere. Real-time: bounded, no allocation.
    pub(super) fn bounds(&self, object: usize) -> Option<Bounds> {
        self.bounds.get(object).copied().flatten()
    }

    /// Bytes that ticks may touch for each object, sleeping or not.
    #[cfg(test)]
    fn hot_bytes_per_object(&self) -> f64 {
        let Grid { starts, objects, .. } = &self.grid;
        let bytes = size_of_val(&*self.bounds)
            + self.always.capacity() * size_of::<u32>()
            + size_of_val(&**starts)
            + size_of_val(&**objects);
        #[allow(clippy::cast_precision_loss)] // a report
        let per_object = bytes as f64 / self.bounds.len().max(1) as f64;
        per_object
    }
}

/// Numbers of the objects that can act where the handle is: see [`BroadPhase::near`].
struct Near<'a> {
    bounds: &'a [Option<Bounds>],
    /// Those of the cell, and those that are always looked at, not looked at yet.
    in_cell: &'a [u32],
    always: &'a [u32],
    position_m: &'a [f64; 3],
}

impl Near<'_> {
    /// The smaller number first, and one that is in both lists once: sums do not depend on who sleeps.
    #[inline]
    fn next_to_look_at(&mut self) -> Option<u32> {
        let (cell, always) = (self.in_cell.split_first(), self.always.split_first());
        let (number, in_cell, always) = match (cell, always) {
            (None, None) => return None,
            (None, Some((number, rest))) => (number, self.in_cell, rest),
            (Some((number, rest)), None) => (number, rest, self.always),
            (Some((a, rest)), Some((b, _))) if a < b => (a, rest, self.always),
            (Some((a, _)), Some((b, rest))) if a > b => (b, self.in_cell, rest),
            (Some((number, rest)), Some((_, other_rest))) => (number, rest, other_rest),
        };
        (self.in_cell, self.always) = (in_cell, always);
        Some(*number)
    }
}

impl Iterator for Near<'_> {
    type Item = usize;

    /// The next one whose box holds the handle, or that has none.
    #[inline(never)] // registers of its own: those who are shown the objects have none left
    fn next(&mut self) -> Option<usize> {
        while let Some(object) = self.next_to_look_at() {
            let object = object as usize;
            match self.bounds.get(object) {
                Some(Some(bounds)) if !bounds.contains(DVec3::from_array(*self.position_m)) => {}
                _ => return Some(object),
            }
        }
        None
    }
}

impl Grid {
    /// A grid without objects over all boxes. Not real-time.
    #[allow(clippy::indexing_slicing)] // three axes
    fn over(boxed: &[(u32, Bounds)]) -> Self {
        let empty = Self {
            origin_m: DVec3::ZERO,
            per_m: DVec3::ZERO,
            cells: [0; 3],
            starts: Box::new([0]),
            objects: Box::new([]),
        };
        let Some((_, first)) = boxed.first() else { return empty };
        let corners = |(low, high): (DVec3, DVec3), (_, bounds): &(u32, Bounds)| {
            (low.min(bounds.low()), high.max(bounds.high()))
        };
        let (low, high) = boxed.iter().fold((first.low(), first.high()), corners);
        let median = |axis: usize| {
            let mut sides: Vec<f64> =
                boxed.iter().map(|(_, bounds)| (bounds.high() - bounds.low()).to_array()[axis]).collect();
            sides.sort_by(f64::total_cmp);
            sides[sides.len() / 2]
        };
        #[allow(clippy::cast_precision_loss)] // a number of objects
        let most = MOST_CELLS_OF_AN_AXIS.min(math::cbrt(boxed.len() as f64).ceil() * 2.0);
        let mut cells = [1; 3];
        let mut per_m = DVec3::ZERO;
        for (axis, extent) in (high - low).to_array().into_iter().enumerate() {
            let wanted = (extent / (CELL_OVER_BOX * median(axis))).floor();
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // clamped to 1..=128
            let count = if wanted.is_finite() { wanted.clamp(1.0, most) as usize } else { 1 };
            cells[axis] = count;
            #[allow(clippy::cast_precision_loss)] // at most 128
            let per = count as f64 / extent;
            per_m[axis] = if per.is_finite() { per } else { 0.0 };
        }
        Self { origin_m: low, per_m, cells, ..empty }
    }

    /// Puts the objects in, in order of their numbers. Not real-time.
    #[allow(clippy::indexing_slicing)] // the cells of a box are cells of the grid
    fn fill(&mut self, boxed: &[(u32, Bounds)]) {
        let [x, y, z] = self.cells;
        let mut in_cell = vec![Vec::new(); x * y * z];
        for (object, bounds) in boxed {
            for cell in self.cells_of(bounds).collect::<Vec<_>>() {
                in_cell[cell].push(*object);
            }
        }
        let mut starts = vec![0_u32];
        for objects in &in_cell {
            let end = starts.last().copied().unwrap_or(0) + u32::try_from(objects.len()).unwrap_or(u32::MAX);
            starts.push(end);
        }
        self.starts = starts.into();
        self.objects = in_cell.concat().into();
    }

    /// Numbers of the cells a box lies in. Not real-time.
    fn cells_of(&self, bounds: &Bounds) -> impl Iterator<Item = usize> + use<> {
        let [_, y_cells, z_cells] = self.cells;
        let [[x0, y0, z0], [x1, y1, z1]] =
            [bounds.low(), bounds.high()].map(|corner| self.coordinates(corner));
        (x0..=x1).flat_map(move |x| {
            (y0..=y1).flat_map(move |y| (z0..=z1).map(move |z| (x * y_cells + y) * z_cells + z))
        })
    }

    /// Which cell a position is in along each axis; outside the grid, the nearest.
    #[inline]
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // `as` takes NaN and below 0 to 0
    fn coordinates(&self, position_m: DVec3) -> [usize; 3] {
        let [x, y, z] = ((position_m - self.origin_m) * self.per_m).to_array().map(|cell| cell as usize);
        let [x_cells, y_cells, z_cells] = self.cells.map(|cells| cells.saturating_sub(1));
        [x.min(x_cells), y.min(y_cells), z.min(z_cells)]
    }

    /// The objects of the cell at a position. Outside the grid the nearest cell: its objects' boxes are then compared.
    #[inline]
    fn cell(&self, position_m: DVec3) -> &[u32] {
        let [_, y_cells, z_cells] = self.cells;
        let [x, y, z] = self.coordinates(position_m);
        let cell = (x * y_cells + y) * z_cells + z;
        let (Some(start), Some(end)) = (self.starts.get(cell), self.starts.get(cell + 1)) else { return &[] };
        self.objects.get(*start as usize..*end as usize).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// SplitMix64 (Steele, Lea, Flood 2014) as numbers in -1..1.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = *state;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        #[allow(clippy::cast_precision_loss)] // a random number
        let part = (word ^ (word >> 31)) as f64 / u64::MAX as f64;
        2.0 * part - 1.0
    }

    fn random_point(state: &mut u64) -> DVec3 {
        DVec3::new(random(state), random(state), random(state))
    }

    fn near(phase: &BroadPhase, position_m: DVec3) -> Vec<usize> {
        let mut objects: Vec<usize> = (0..phase.bounds.len()).collect();
        let mut met = Vec::new();
        phase.for_each_near(&mut objects, &position_m.to_array(), |object| met.push(*object));
        met
    }

    /// Boxes of all sizes, some objects without one, and what comparing with each of them finds.
    #[test]
    fn it_finds_what_comparing_with_every_box_finds_in_order() {
        let mut state = 7;
        for (objects, size) in [(0, 0.1), (1, 0.1), (3, 2.0), (500, 0.01), (500, 0.3), (2000, 0.0)] {
            let bounds: Vec<Option<Bounds>> = (0..objects)
                .map(|object| {
                    let half = DVec3::splat(size) * random_point(&mut state).abs();
                    (object % 97 != 5).then(|| Bounds::about(random_point(&mut state), half))
                })
                .collect();
            let phase = BroadPhase::new(bounds.clone());
            let mut any = 0;
            for _ in 0..2000 {
                let at = 1.3 * random_point(&mut state);
                let inside = |(_, bounds): &(usize, &Option<Bounds>)| bounds.is_none_or(|b| b.contains(at));
                let expected: Vec<usize> =
                    bounds.iter().enumerate().filter(inside).map(|(object, _)| object).collect();
                any += expected.len();
                assert_eq!(near(&phase, at), expected, "{objects} objects of {size} at {at}");
            }
            assert!(any > 0 || objects < 2 || size == 0.0);
        }
    }

    #[test]
    fn a_box_is_rounded_outwards() {
        let mut state = 3;
        for _ in 0..1000 {
            let (center, half) = (random_point(&mut state), random_point(&mut state).abs());
            let bounds = Bounds::about(center, half);
            assert!(bounds.contains(center - half) && bounds.contains(center + half));
        }
    }

    #[test]
    fn a_handle_that_is_nowhere_wakes_only_what_acts_anywhere() {
        let bounds = vec![Some(Bounds::about(DVec3::ZERO, DVec3::ONE)), None];
        assert_eq!(near(&BroadPhase::new(bounds), DVec3::NAN), [1]);
    }

    #[test]
    fn without_boxes_all_are_near_wherever_the_handle_is_until_one_gets_a_box() {
        let mut phase = BroadPhase::new(vec![None; 3]);
        assert_eq!(near(&phase, DVec3::NAN), [0, 1, 2]);
        phase.watch_always(1, Some(Bounds::about(DVec3::ZERO, DVec3::ONE)));
        assert_eq!(near(&phase, DVec3::X * 5.0), [0, 2]);
    }

    #[test]
    fn an_object_that_has_grown_is_found_where_it_is_now() {
        let object = |x| Some(Bounds::about(DVec3::X * x, DVec3::splat(0.1)));
        let mut phase = BroadPhase::new((0..20).map(|index| object(f64::from(index))).collect());
        assert_eq!(near(&phase, DVec3::X * 5.5), [] as [usize; 0]);
        for _ in 0..3 {
            phase.watch_always(5, Some(Bounds::about(DVec3::X * 5.0, DVec3::splat(0.6))));
        }
        phase.watch_always(7, None);
        assert_eq!(near(&phase, DVec3::X * 5.5), [5, 7]);
        assert_eq!(near(&phase, DVec3::X * 5.0), [5, 7]);
    }

    #[test]
    fn ten_thousand_objects_side_by_side_take_less_than_64_bytes_each() {
        let at = |index: u32| {
            DVec3::new(f64::from(index % 22), f64::from(index / 22 % 22), f64::from(index / 484)) * 1.0e-3
        };
        let phase =
            BroadPhase::new((0..10_000).map(|i| Some(Bounds::about(at(i), DVec3::splat(0.45e-3)))).collect());
        let bytes = phase.hot_bytes_per_object();
        assert!(bytes <= 64.0, "{bytes}");
        let most = phase.grid.starts.windows(2).map(|pair| pair[1] - pair[0]).max();
        assert!(most <= Some(27), "a cell holds {most:?} objects");
    }
}
