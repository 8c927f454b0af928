//! From the file's units to the numbers that the device computes with.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::{Bounds, Mesh};
use crate::layout::{Corners, Triangle};

/// How a scene was moved and scaled: device = (file - center) * scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub center: DVec3,
    /// A power of two, so that scaling rounds nothing.
    pub scale: f64,
}

impl Placement {
    /// The file's own units.
    pub const IDENTITY: Self = Self { center: DVec3::ZERO, scale: 1.0 };

    /// Puts the scene's box around the origin, its longest half side in (1/2, 1]: so that f32, whose
    /// digits lie densest there, keeps as many digits of the file as it can.
    pub fn conditioned(bounds: &Bounds) -> Self {
        let half = ((bounds.max - bounds.min) * 0.5).max_element();
        let exponent = if half > 0.0 && half.is_finite() { -half.log2().ceil() } else { 0.0 };
        Self { center: bounds.center(), scale: exponent.clamp(-1000.0, 1000.0).exp2() }
    }

    pub fn point(&self, p: DVec3) -> DVec3 {
        (p - self.center) * self.scale
    }

    /// A length.
    pub fn length(&self, length: f64) -> f64 {
        length * self.scale
    }
}

/// The scene's triangles in device units, in the order of the file.
pub fn place(mesh: &Mesh, placement: &Placement) -> Vec<Triangle> {
    let positions: Vec<Vec3> = mesh.positions.par_iter().map(|&p| placement.point(p).as_vec3()).collect();
    let corner = |index: u32| positions[index as usize];
    mesh.triangles
        .par_iter()
        .enumerate()
        .map(|(id, &[a, b, c])| {
            // Differences of the rounded corners, so that triangles which share a corner agree on it.
            let [ab, ac] = [b, c].map(|end| (corner(end) - corner(a)).to_array());
            Triangle::new(corner(a).to_array(), id as u32, ab, ac)
        })
        .collect()
}

/// The same triangles by their corners, in the order of `ids` (places in the file).
pub fn place_corners(
    mesh: &Mesh,
    placement: &Placement,
    ids: impl IndexedParallelIterator<Item = u32>,
) -> Vec<Corners> {
    ids.map(|id| {
        let [a, b, c] = corners_of(mesh, placement, id);
        Corners { a, id, b, pad0: 0, c, pad1: 0 }
    })
    .collect()
}

/// The corners of a triangle (its place in the file) in device units.
pub fn corners_of(mesh: &Mesh, placement: &Placement, id: u32) -> [[f32; 3]; 3] {
    mesh.triangles[id as usize]
        .map(|index| placement.point(mesh.positions[index as usize]).as_vec3().to_array())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditioning_centres_and_scales_by_a_power_of_two() {
        let bounds = Bounds { min: DVec3::new(99.0, 1.0, 0.0), max: DVec3::new(105.0, 2.0, 0.5) };
        let placement = Placement::conditioned(&bounds);
        assert_eq!(placement.scale, 0.25);
        assert_eq!(placement.point(bounds.max), DVec3::new(0.75, 0.125, 0.0625));
        assert_eq!(placement.point(bounds.min), -placement.point(bounds.max));
    }

    #[test]
    fn a_scene_far_away_keeps_its_digits() {
        let far = DVec3::splat(1e6);
        let positions = vec![far, far + DVec3::X * 1e-3, far + DVec3::Y * 1e-3];
        let mesh = Mesh { positions, triangles: vec![[0, 1, 2]] };
        let triangle = place(&mesh, &Placement::conditioned(&mesh.bounds()))[0];
        assert!((triangle.ab[0] / triangle.ac[1] - 1.0).abs() < 1e-6, "{triangle:?}");
    }
}
