//! Bounding-volume tree of the patches: eight children per node, packed bottom-up over patches sorted along Hilbert's curve.
//!
//! No pointers: the children of node `i` of a level are nodes `8 i` to `8 i + 7` of the level below, and of the lowest level patches.
//! The two lowest levels have discs, the others boxes, in binary32; distances are computed in binary32, with a margin.

mod boxes;
mod discs;
mod hilbert;

use crate::parallel::fill;
use boxes::Boxes;
pub(crate) use discs::Disc;
use discs::Discs;
use flotor_hal::DVec3;
pub(crate) use hilbert::hilbert_order;

/// Number of children of a node.
const WIDTH: usize = 8;
/// Number of levels with discs.
const DISC_LEVELS: usize = 2;
/// Maximum number of levels: eight to this power exceeds the maximum number of patches.
const MOST_LEVELS: usize = 10;
/// Size of the stack of a traversal.
const STACK: usize = WIDTH * MOST_LEVELS;
/// Relative rounding error of a few operations in binary32: eight units in the last place.
const ROUNDING: f32 = 1.0e-6;

#[allow(clippy::cast_possible_truncation)] // rounded outwards
fn below(x: f64) -> f32 {
    (x as f32).next_down()
}

#[allow(clippy::cast_possible_truncation)] // rounded outwards
fn above(x: f64) -> f32 {
    (x as f32).next_up()
}

#[allow(clippy::cast_possible_truncation)] // margins cover it
fn narrow(v: DVec3) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

/// Tree over numbered items.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Tree {
    /// Discs of the items, and of eight of them.
    discs: [Vec<Discs>; DISC_LEVELS],
    /// Levels of boxes, from the lowest to the root; none for a few items.
    boxes: Vec<Vec<Boxes>>,
    count: usize,
    /// Rounding error of a coordinate near the items in binary32, m.
    rounding_m: f32,
}

impl Tree {
    /// Packs `count` items with their discs and boxes (lower and upper corner, m) in their order. Not real-time.
    #[must_use]
    pub(crate) fn new(
        count: usize,
        disc: impl Fn(usize) -> Disc + Sync,
        box_m: impl Fn(usize) -> [DVec3; 2] + Sync,
    ) -> Self {
        let mut discs: [Vec<Discs>; DISC_LEVELS] = Default::default();
        let mut below = count;
        for level in 0..DISC_LEVELS {
            let (lower, upper) = discs.split_at_mut(level);
            let child = |i: usize| match lower.last() {
                Some(lower) => lower[i].disc(),
                None => Some(disc(i)),
            };
            upper[0] = vec![Discs::EMPTY; below.div_ceil(WIDTH)];
            fill(&mut upper[0], |node| Discs::of(WIDTH * node..below.min(WIDTH * (node + 1)), child));
            below = upper[0].len();
        }
        let mut lowest = vec![Boxes::EMPTY; below.div_ceil(WIDTH)];
        // Number of items below one box of the lowest level of boxes.
        let share = [WIDTH; DISC_LEVELS].iter().product::<usize>();
        fill(&mut lowest, |node| {
            let mut boxes = Boxes::EMPTY;
            for item in WIDTH * share * node..count.min(WIDTH * share * (node + 1)) {
                boxes.widen(item / share % WIDTH, box_m(item));
            }
            boxes
        });
        let mut boxes = vec![lowest];
        while boxes.last().is_some_and(|level| level.len() > 1) {
            let level = &boxes[boxes.len() - 1];
            let mut up = vec![Boxes::EMPTY; level.len().div_ceil(WIDTH)];
            for (i, node) in level.iter().enumerate() {
                up[i / WIDTH].widen(i % WIDTH, node.all_m());
            }
            boxes.push(up);
        }
        let root = boxes.last().and_then(|root| root.first()).map(Boxes::all_m);
        let largest = root.map_or(0.0, |[low, high]| low.abs().max(high.abs()).max_element());
        Self { discs, boxes, count, rounding_m: above(largest * 2.4e-7) }
    }

    /// Returns the memory of the tree, bytes.
    #[must_use]
    pub(crate) fn bytes(&self) -> usize {
        let boxes: usize = self.boxes.iter().map(Vec::len).sum();
        let discs: usize = self.discs.iter().map(Vec::len).sum();
        boxes * size_of::<Boxes>() + discs * size_of::<Discs>()
    }

    /// Returns the index of the root's level.
    fn top(&self) -> u32 {
        u32::try_from(DISC_LEVELS + self.boxes.len()).unwrap_or(0) - 1
    }

    /// Returns a lower bound of the squared distance of a point to each child of a node.
    #[inline]
    fn squares(&self, level: u32, index: u32, c: [f32; 3]) -> [f32; WIDTH] {
        let (level, index) = (level as usize, index as usize);
        match self.discs.get(level) {
            Some(discs) => discs[index].squares(c),
            None => self.boxes[level - DISC_LEVELS][index].squares(c),
        }
    }

    /// Visits the items that may be nearer to `c_m` than the bound, approximately nearest first; `visit` returns the new bound,
    /// m. Real-time: bounded, no allocation.
    pub(crate) fn nearest(&self, c_m: DVec3, bound_m: f64, mut visit: impl FnMut(usize) -> f64) {
        let c = narrow(c_m);
        let limit = |bound_m: f64| {
            let bound = above(bound_m) + self.rounding_m;
            bound * bound * (1.0 + 4.0 * ROUNDING)
        };
        if self.count == 0 || bound_m < 0.0 {
            return;
        }
        let mut most = limit(bound_m);
        let mut stack = [(0_u32, 0_u32, 0.0_f32); STACK];
        stack[0] = (self.top(), 0, 0.0);
        let mut used = 1;
        while used > 0 {
            used -= 1;
            let (level, index, square) = stack[used];
            if square > most {
                continue;
            }
            let squares = self.squares(level, index, c);
            let base = used;
            for child in 0..WIDTH {
                if squares[child] > most {
                    continue;
                }
                #[allow(clippy::cast_possible_truncation)] // 0 to 7
                let item = index * WIDTH as u32 + child as u32;
                if level == 0 {
                    if (item as usize) < self.count {
                        most = most.min(limit(visit(item as usize)));
                    }
                } else if used < STACK {
                    // Push the farthest first, so that the nearest is popped first.
                    let mut place = used;
                    while place > base && stack[place - 1].2 < squares[child] {
                        stack[place] = stack[place - 1];
                        place -= 1;
                    }
                    stack[place] = (level - 1, item, squares[child]);
                    used += 1;
                }
            }
        }
    }

    /// Visits the items with an index of at least `first` that may overlap the bounding box of a segment. Real-time: bounded, no
    /// allocation.
    pub(crate) fn along(&self, from_m: DVec3, to_m: DVec3, first: usize, mut visit: impl FnMut(usize)) {
        if self.count == 0 {
            return;
        }
        let low = narrow(from_m.min(to_m)).map(|x| x - self.rounding_m);
        let high = narrow(from_m.max(to_m)).map(|x| x + self.rounding_m);
        let mut stack = [(0_u32, 0_u32); STACK];
        stack[0].0 = self.top();
        let mut used = 1;
        while used > 0 {
            used -= 1;
            let (level, index) = stack[used];
            let meets = match self.discs.get(level as usize) {
                Some(discs) => discs[index as usize].meets(low, high),
                None => self.boxes[level as usize - DISC_LEVELS][index as usize].meets(low, high),
            };
            // Number of items below one child.
            let share = WIDTH.pow(level);
            for child in (0..WIDTH).filter(|child| meets[*child]) {
                #[allow(clippy::cast_possible_truncation)] // 0 to 7
                let item = index * WIDTH as u32 + child as u32;
                if (item as usize + 1) * share <= first {
                    continue;
                }
                if level == 0 {
                    if (item as usize) < self.count {
                        visit(item as usize);
                    }
                } else if used < STACK {
                    stack[used] = (level - 1, item);
                    used += 1;
                }
            }
        }
    }
}
