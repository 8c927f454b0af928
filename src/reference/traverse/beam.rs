//! What many rays have in common. Twin of shaders/traverse/beam.glsl, whose products and sums a GPU may fuse.

use glam::Vec3;

/// Farther than any scene.
const NOWHERE: f32 = 1e30;
/// Stands for a direction's component of 0, on the side that lets more through.
const LEAST_COMPONENT: f32 = 1e-20;

/// Starts and directions of rays lie in these boxes.
pub struct Beam {
    pub starts: [Vec3; 2],
    pub directions: [Vec3; 2],
}

impl Beam {
    /// Of rays by their starts and directions.
    pub fn of(rays: &[(Vec3, Vec3)]) -> Self {
        let bounds = |points: &dyn Fn(&(Vec3, Vec3)) -> Vec3| {
            let points = || rays.iter().map(points);
            [points().fold(Vec3::INFINITY, Vec3::min), points().fold(Vec3::NEG_INFINITY, Vec3::max)]
        };
        Self { starts: bounds(&|ray| ray.0), directions: bounds(&|ray| ray.1) }
    }

    /// Whether some ray of the beam may meet the box.
    pub fn meets(&self, [low, high]: [Vec3; 2]) -> bool {
        let (mut enter, mut leave) = (0.0f32, NOWHERE);
        for axis in 0..3 {
            let without_zero = |d: f32, stand_in: f32| if d.abs() < LEAST_COMPONENT { stand_in } else { d };
            let slowest = without_zero(self.directions[0][axis], -LEAST_COMPONENT);
            let fastest = without_zero(self.directions[1][axis], LEAST_COMPONENT);
            let below = (high[axis] - self.starts[0][axis]) * (1.0 / slowest);
            let above = (low[axis] - self.starts[1][axis]) * (1.0 / fastest);
            if slowest > 0.0 {
                leave = leave.min(below);
            } else {
                enter = enter.max(below);
            }
            if fastest > 0.0 {
                enter = enter.max(above);
            } else {
                leave = leave.min(above);
            }
        }
        enter <= leave
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack;
    use crate::reference::ray::Ray;
    use crate::reference::slabs::{meets_box, slabs_of};
    use crate::reference::testing::Random;

    /// No box is left out that a ray meets by the robust slab test, from near or far and whatever the length of its direction, if it is grown as
    /// faces' boxes are; and most are left out that none meets.
    #[test]
    fn a_beam_meets_what_its_rays_meet() {
        let mut random = Random::new(5);
        let (mut met, mut left_out, mut in_vain) = (0, 0, 0);
        for round in 0..270_000 {
            let far = if round % 4 == 0 { 100.0 } else { 1.0 };
            let start = random.point() * far;
            let spread = 10f32.powf(-6.0 * random.unit());
            let mut towards = match far > 1.0 {
                true => (random.point() - start).normalize_or(Vec3::X),
                false => random.direction(),
            };
            if round % 3 == 0 {
                towards[random.below(3) as usize] = 0.0;
            }
            let length = 10f32.powf(3.0 * random.signed());
            let rays: Vec<_> = (0..1 + random.below(6))
                .map(|_| {
                    (
                        start + random.point() * spread * 0.1,
                        (towards + random.point() * spread).normalize_or(Vec3::X) * length,
                    )
                })
                .collect();
            let size = 10f32.powf(-4.0 * random.unit());
            let along = towards * (random.unit() + if far > 1.0 { start.length() - 0.5 } else { 0.0 })
                + random.point() * spread.max(size);
            let low = (start + along).clamp(Vec3::splat(-1.0), Vec3::splat(1.0));
            let mut high = (low + (random.point() * size).abs()).min(Vec3::ONE);
            if round % 5 == 0 {
                high[random.below(3) as usize] = low[0];
                high = high.max(low);
            }
            let reach = rays.iter().map(|ray| ray.0.abs().max_element()).fold(1.0, f32::max);
            let pad = pack::beam_pad(0.0, 1.0, f64::from(reach));
            let hit = rays.iter().any(|&(origin, direction)| {
                let ray = Ray { origin, direction, t_max: f32::MAX };
                meets_box(&slabs_of(&ray, true), low, high, f32::MAX)
            });
            let may = Beam::of(&rays).meets([low - pad, high + pad]);
            assert!(may || !hit, "round {round}: {rays:?} {low} {high}");
            // From far away growth hides what is small.
            let counts = u32::from(far == 1.0);
            met += counts * u32::from(hit);
            left_out += counts * u32::from(!may);
            in_vain += counts * u32::from(may && !hit);
        }
        assert!(met > 10_000 && left_out > 100_000 && in_vain < 20_000, "{met} {left_out} {in_vain}");
    }
}
