//! Placement of a model: at one position, at several, or at all points of a grid.

use super::reader::{SceneError, Section};

/// Largest number of positions of one model: each has an instance of the model, with its own memory.
const MAX_PLACES: usize = 1_000_000;
/// Largest coordinate of a position, mm: a larger value indicates a wrong unit.
const FARTHEST_MM: f64 = 1.0e4;

/// Reads the positions of a model in the device frame and returns them in m: `position_mm` alone, or `positions_mm` or a `grid`
/// relative to `position_mm`.
pub(super) fn read(mapping: &mut Section<'_>) -> Result<Vec<[f64; 3]>, SceneError> {
    let centre_mm = mapping.three("position_mm", -FARTHEST_MM..=FARTHEST_MM)?.unwrap_or_default();
    let list = mapping.take("positions_mm");
    let grid = mapping.section("grid")?;
    let places_mm = match (list, grid) {
        (None, None) => vec![[0.0; 3]],
        (Some(list), None) => list.points(-FARTHEST_MM..=FARTHEST_MM, 1..=MAX_PLACES)?,
        (None, Some(grid)) => points_of(grid)?,
        (Some(list), Some(_)) => {
            return Err(list.problem("a model has both `positions_mm` and `grid`; remove one of them"));
        }
    };
    let from_centre =
        |place_mm: [f64; 3]| std::array::from_fn(|axis| (centre_mm[axis] + place_mm[axis]) * 1.0e-3);
    Ok(places_mm.into_iter().map(from_centre).collect())
}

/// Reads a grid and returns its points relative to its centre, mm; x varies fastest.
fn points_of(mut grid: Section<'_>) -> Result<Vec<[f64; 3]>, SceneError> {
    let count_value = grid.require("count")?;
    let too_many = count_value
        .problem(format!("the grid has more than {MAX_PLACES} points, the maximum; reduce `count`"));
    let not_whole = count_value.problem("`count` must be a whole number of 1 or more, or three of them");
    let counts = count_value.three(1.0..=MAX_PLACES as f64)?;
    let spacing_mm = grid.require("spacing_mm")?.three(0.0..=FARTHEST_MM)?;
    grid.finish()?;
    if counts.iter().any(|count| count.fract() != 0.0) {
        return Err(not_whole);
    }
    if counts.iter().product::<f64>() > MAX_PLACES as f64 {
        return Err(too_many);
    }
    let along = |axis: usize| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // whole, and at most a million
        let count = counts[axis] as u32;
        (0..count).map(move |index| (f64::from(index) - 0.5 * f64::from(count - 1)) * spacing_mm[axis])
    };
    Ok(along(2).flat_map(|z| along(1).flat_map(move |y| along(0).map(move |x| [x, y, z]))).collect())
}
