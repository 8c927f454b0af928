//! The numbering of pixels: tile by tile, row by row within a tile, the last tiles reaching out of the
//! image. Where a pixel has several camera rays, number p + j P is ray j of pixel p, P the number of pixels. Twin of `pixel_position` in `shaders/shared/camera.glsl`.

use crate::layout::{TILE_SIDE, WORKGROUP_SIZE};

/// The tiles of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tiles {
    pub width: u32,
    pub height: u32,
    /// Camera rays of a pixel.
    pub jitters: u32,
}

impl Tiles {
    fn in_row(&self) -> u32 {
        self.width.div_ceil(TILE_SIDE)
    }

    /// Numbers of all pixels, those beyond the image included: a multiple of the workgroup's size.
    pub fn padded_pixels(&self) -> u64 {
        u64::from(self.in_row()) * u64::from(self.height.div_ceil(TILE_SIDE)) * u64::from(WORKGROUP_SIZE)
    }

    /// Numbers of all pixels' camera rays.
    pub fn numbers(&self) -> u64 {
        self.padded_pixels() * u64::from(self.jitters)
    }

    /// Column and row of a pixel; may lie beyond the image.
    pub fn position(&self, pixel: u32) -> (u32, u32) {
        // Fits, since pixel does.
        let pixel = (u64::from(pixel) % self.padded_pixels()) as u32;
        let (tile, place) = (pixel / WORKGROUP_SIZE, pixel % WORKGROUP_SIZE);
        (
            tile % self.in_row() * TILE_SIDE + place % TILE_SIDE,
            tile / self.in_row() * TILE_SIDE + place / TILE_SIDE,
        )
    }

    /// The number of the first camera ray of the pixel at this column and row.
    pub fn number(&self, x: u32, y: u32) -> u32 {
        let tile = y / TILE_SIDE * self.in_row() + x / TILE_SIDE;
        tile * WORKGROUP_SIZE + y % TILE_SIDE * TILE_SIDE + x % TILE_SIDE
    }

    /// How many of the pixels from `begin` to `end` (multiples of the workgroup's size) are in the image.
    pub fn inside(&self, begin: u32, end: u32) -> u64 {
        (begin / WORKGROUP_SIZE..end / WORKGROUP_SIZE)
            .map(|tile| {
                let (x, y) = self.position(tile * WORKGROUP_SIZE);
                let wide = self.width.saturating_sub(x).min(TILE_SIDE);
                let high = self.height.saturating_sub(y).min(TILE_SIDE);
                u64::from(wide * high)
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_positions_are_inverse_and_complete() {
        for (width, height) in [(1, 1), (7, 13), (8, 8), (9, 16), (65, 3)] {
            let tiles = Tiles { width, height, jitters: 1 };
            let padded = tiles.padded_pixels() as u32;
            let mut inside = 0;
            for pixel in 0..padded {
                let (x, y) = tiles.position(pixel);
                assert_eq!(tiles.number(x, y), pixel);
                inside += u64::from(x < width && y < height);
            }
            assert_eq!(inside, u64::from(width) * u64::from(height));
            assert_eq!(tiles.inside(0, padded), inside);
            assert_eq!(tiles.inside(0, 64) + tiles.inside(64, padded), inside);
            let jittered = Tiles { jitters: 3, ..tiles };
            assert_eq!(jittered.inside(0, jittered.numbers() as u32), 3 * inside);
            assert_eq!(jittered.position(2 * padded + padded / 2), tiles.position(padded / 2));
        }
    }
}
