//! Camera rays. Twin of shaders/shared/camera.glsl.

use glam::{Vec2, Vec3};

use super::ray::Ray;
use super::rng::{pcg4d, unit_floats};
use super::sobol::sobol_bits;
use crate::layout::{Frame, KEY_CAMERA, TILE_SIDE, WORKGROUP_SIZE};

/// Pixels of all tiles that the image touches, times the camera rays of each: the length of per-pixel buffers.
pub fn pixel_count(frame: &Frame) -> u32 {
    frame.width.div_ceil(TILE_SIDE) * frame.height.div_ceil(TILE_SIDE) * WORKGROUP_SIZE * frame.jitters.max(1)
}

/// Column and row of a pixel. Pixels are numbered tile by tile (8x8), row by row within a tile; the last
/// tiles may reach out of the image.
pub fn pixel_position(frame: &Frame, pixel: u32) -> [u32; 2] {
    let pixel = if frame.jitters > 1 { pixel % frame.pixels } else { pixel };
    let tiles_in_row = frame.width.div_ceil(TILE_SIDE);
    let tile = pixel / WORKGROUP_SIZE;
    let place = pixel % WORKGROUP_SIZE;
    [
        (tile % tiles_in_row) * TILE_SIDE + place % TILE_SIDE,
        (tile / tiles_in_row) * TILE_SIDE + place / TILE_SIDE,
    ]
}

pub fn inside_image(frame: &Frame, position: [u32; 2]) -> bool {
    position[0] < frame.width && position[1] < frame.height
}

/// Where in its pixel a camera ray goes through: at one place, or, where there are several, at points of a scrambled
/// (0, 2)-sequence, each pixel's own.
pub fn pixel_place(frame: &Frame, pixel: u32) -> Vec2 {
    if frame.jitters <= 1 {
        return Vec2::splat(frame.pixel_shift);
    }
    let [x, y, ..] = pcg4d([pixel % frame.pixels, 0, KEY_CAMERA, frame.seed]);
    unit_floats(sobol_bits(pixel / frame.pixels, [x, y]))
}

pub fn camera_ray(frame: &Frame, pixel: u32) -> Ray {
    let [column, row] = pixel_position(frame, pixel);
    let place = pixel_place(frame, pixel);
    let (x, y) = (column as f32 + place.x, row as f32 + place.y);
    let along = |start: [f32; 3], dx: [f32; 3], dy: [f32; 3]| {
        Vec3::from(start) + x * Vec3::from(dx) + y * Vec3::from(dy)
    };
    Ray {
        origin: along(frame.origin, frame.origin_dx, frame.origin_dy),
        direction: along(frame.direction, frame.direction_dx, frame.direction_dy),
        t_max: frame.camera_t_max,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_one_number() {
        let frame = Frame { width: 19, height: 10, ..Frame::default() };
        assert_eq!(pixel_count(&frame), 3 * 2 * 64);
        let mut seen = vec![0; 24 * 16];
        for pixel in 0..pixel_count(&frame) {
            let [x, y] = pixel_position(&frame, pixel);
            seen[(y * 24 + x) as usize] += 1;
        }
        assert!(seen.iter().all(|&times| times == 1));
        assert_eq!(pixel_position(&frame, 64 + 9), [9, 1]);
        let inside = (0..pixel_count(&frame)).filter(|&p| inside_image(&frame, pixel_position(&frame, p)));
        assert_eq!(inside.count(), 190);
    }

    #[test]
    fn rays_are_linear_in_the_raster_position() {
        let frame = Frame {
            origin: [1.0, 2.0, 3.0],
            origin_dx: [0.0, 0.0, 1.0],
            direction: [0.0, 0.0, -1.0],
            direction_dx: [0.5, 0.0, 0.0],
            direction_dy: [0.0, -0.25, 0.0],
            pixel_shift: 0.5,
            width: 8,
            height: 8,
            camera_t_max: 7.0,
            ..Frame::default()
        };
        let ray = camera_ray(&frame, 59);
        assert_eq!(ray.origin, Vec3::new(1.0, 2.0, 6.5));
        assert_eq!(ray.direction, Vec3::new(1.75, -1.875, -1.0));
        assert_eq!(ray.t_max, 7.0);
    }
}
