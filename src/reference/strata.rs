//! Jittered strata. Twin of shaders/shared/strata.glsl, which says why they look like this.

use std::ops::Range;

use glam::Vec2;

use super::Inputs;
use super::arith::{reciprocal, reciprocal_sqrt};
use super::rng::{pcg4d, unit_floats};
use crate::layout::KEY_STRATA;

/// A cell of the unit square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stratum {
    /// Cells of this half, those in rows before this one, those of this row, the place in it.
    pub count: u32,
    pub first: u32,
    pub columns: u32,
    pub column: u32,
    /// 1 / columns.
    pub width: f32,
}

/// Rows for so many cells: r with (2 r - 1)^2 <= count < (2 r + 1)^2.
pub fn strata_rows(count: u32) -> u32 {
    let size = count as f32;
    let guess = 0.5 * (size * reciprocal_sqrt(size)) + 0.5;
    let mut rows = (guess as u32).max(1);
    if (2 * rows - 1) * (2 * rows - 1) > count {
        rows -= 1;
    }
    if (2 * rows + 1) * (2 * rows + 1) <= count {
        rows += 1;
    }
    rows
}

/// The cell of the sample at `place` of a set of `samples`.
pub fn stratum_of(place: u32, samples: u32) -> Stratum {
    let fewer = samples >> 1;
    let odd = samples & 1;
    let rows = strata_rows(fewer + odd);
    let narrow = fewer / rows;
    let wide_width = reciprocal((narrow + 1) as f32);
    let narrow_width = reciprocal(narrow.max(1) as f32);

    let count = (fewer + if place & 1 == 0 { odd } else { 0 }).max(1);
    let cell = place >> 1;
    let wide_cells = (count - narrow * rows) * (narrow + 1);
    let wide = cell < wide_cells;
    let columns = if wide { narrow + 1 } else { narrow };
    let width = if wide { wide_width } else { narrow_width };
    let among = if wide { cell } else { cell - wide_cells };
    let row = among as f32 * width;
    let mut column = among.wrapping_sub((row as u32).wrapping_mul(columns)) as i32;
    if column < 0 {
        column += columns as i32;
    }
    if column >= columns as i32 {
        column -= columns as i32;
    }
    let column = column as u32;
    Stratum { count, first: cell - column, columns, column, width }
}

/// The point of a cell for a jitter in [0, 1)^2.
pub fn point_in(stratum: &Stratum, jitter: Vec2) -> Vec2 {
    let share = reciprocal(stratum.count as f32);
    let u = Vec2::new(
        (stratum.first as f32 + stratum.columns as f32 * jitter.x) * share,
        (stratum.column as f32 + jitter.y) * stratum.width,
    );
    u.min(Vec2::splat(1.0 - f32::EPSILON / 2.0))
}

pub fn strata_numbers(inputs: &Inputs, pixel: u32, sample: u32, set: &Range<u32>) -> Vec2 {
    let samples = (set.end - set.start).max(1);
    let [x, y, ..] = pcg4d([pixel, sample, KEY_STRATA, inputs.frame.seed]);
    point_in(&stratum_of(sample.wrapping_sub(set.start), samples), unit_floats([x, y]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_a_quarter_of_the_columns() {
        let squares = |r: u64| (2 * r - 1) * (2 * r - 1);
        let odd = (1..=23_170u64).flat_map(|r| [squares(r) - 1, squares(r), squares(r) + 1]);
        for count in (1..5000).chain(odd).chain([1 << 24, (1 << 24) + 1, 1 << 31]).filter(|&n| n > 0) {
            let rows = u64::from(strata_rows(count as u32));
            assert!(squares(rows) <= count && count < squares(rows + 1), "{count}: {rows}");
        }
    }

    /// The cells of each half, in order: rows that fill the square, columns that fill each row, all areas equal.
    fn tiles_the_square(samples: u32) {
        for half in 0..samples.min(2) {
            let cells: Vec<Stratum> =
                (half..samples).step_by(2).map(|place| stratum_of(place, samples)).collect();
            let count = cells.len() as u32;
            let (mut done, mut rows) = (0, 0);
            while done < count {
                let columns = cells[done as usize].columns;
                for column in 0..columns {
                    let Stratum { width, .. } = cells[done as usize + column as usize];
                    let expected = Stratum { count, first: done, columns, column, width };
                    assert_eq!(cells[(done + column) as usize], expected, "{samples} samples, half {half}");
                    assert!((width * columns as f32 - 1.0).abs() < 4.0 * f32::EPSILON);
                }
                // A row is columns / count high and a cell 1 / columns wide.
                done += columns;
                rows += 1;
                assert!(columns.abs_diff(cells[0].columns) <= 1);
            }
            assert_eq!(done, count, "{samples} samples");
            assert_eq!(rows, strata_rows(samples.div_ceil(2)), "{samples} samples");
        }
    }

    #[test]
    fn cells_of_equal_area_tile_the_square() {
        (1..700).chain([4096, 4097, 65_535, 1 << 20, (1 << 20) + 1]).for_each(tiles_the_square);
    }

    /// Places of a set that is too long to be walked.
    #[test]
    fn cells_of_long_sets_are_found() {
        let samples = u32::MAX;
        let rows = strata_rows(1 << 31);
        let narrow = (samples >> 1) / rows;
        for step in 0..100_000u32 {
            let place = step * 42_949;
            let stratum = stratum_of(place, samples);
            let cell = place >> 1;
            let wide_cells = (stratum.count - narrow * rows) * (narrow + 1);
            let (columns, column) = if cell < wide_cells {
                (narrow + 1, cell % (narrow + 1))
            } else {
                (narrow, (cell - wide_cells) % narrow)
            };
            let found = (stratum.columns, stratum.column, stratum.first);
            assert_eq!(found, (columns, column, cell - column), "{place}");
        }
    }

    #[test]
    fn points_stay_in_their_cells() {
        let last = 1.0 - f32::EPSILON / 2.0;
        for samples in (1..200).chain([1 << 16, (1 << 24) + 1, 1 << 31]) {
            for step in 0..samples.min(400) {
                let place = (u64::from(step) * u64::from(samples) / u64::from(samples.min(400))) as u32;
                let stratum = stratum_of(place, samples);
                let slack = 8.0 * f64::from(f32::EPSILON);
                for jitter in [Vec2::ZERO, Vec2::splat(0.5), Vec2::splat(last)] {
                    let u = point_in(&stratum, jitter);
                    assert!(u.min_element() >= 0.0 && u.max_element() <= last, "{stratum:?}: {u}");
                    let inside = |u: f32, low: u32, size: u32, all: u32| {
                        let [low, high] = [low, low + size].map(|at| f64::from(at) / f64::from(all));
                        f64::from(u) >= low - slack && f64::from(u) <= high + slack
                    };
                    let Stratum { count, first, columns, column, .. } = stratum;
                    assert!(inside(u.x, first, columns, count), "{stratum:?}: {u}");
                    assert!(inside(u.y, column, 1, columns), "{stratum:?}: {u}");
                }
            }
        }
    }
}
