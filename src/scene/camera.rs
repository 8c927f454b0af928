//! Cameras, in the units of the file.

use glam::{DMat3, DVec3};

use super::Bounds;
use super::condition::Placement;

/// Where the picture is taken from.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Camera {
    /// A pinhole at `eye`; `fov` is the vertical angle in degrees.
    Pinhole { eye: [f64; 3], target: [f64; 3], up: [f64; 3], fov: f64 },
    /// The original's orbiter about the centre of the scene's box, one diagonal away; angles in degrees.
    Orbit { rx: f64, ry: f64 },
}

/// Vertical angle of the orbiter and default of the pinhole, degrees.
pub const DEFAULT_FOV: f64 = 45.0;

/// How camera rays start and end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayModel {
    /// From the eye through pixel centres, without end.
    Eye,
    /// The original's: from the near to the far plane, through pixel corners.
    NearToFar,
    /// The same through pixel centres.
    CentredNearToFar,
    /// The original's first form: from depth 0 to 1 of OpenGL's clip space, which begins at -1, through pixel
    /// centres.
    MiddleToFar,
}

/// Camera rays as linear functions of the raster position (x to the right, y down, in pixels), in device
/// units: origin + x origin_dx + y origin_dy, and likewise the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayFan {
    pub origin: [DVec3; 3],
    pub direction: [DVec3; 3],
    /// Longest ray, in units of its direction.
    pub t_max: f64,
    /// Added to a pixel's column and row.
    pub pixel_shift: f64,
}

/// Eye and axes of a camera.
struct View {
    eye: DVec3,
    right: DVec3,
    up: DVec3,
    forward: DVec3,
    /// Tangent of half the vertical angle.
    tangent: f64,
}

impl Camera {
    /// The view of a scene that nobody chose one for; cornell is looked into.
    pub fn default_for(path: &str) -> Self {
        let stem = std::path::Path::new(path).file_stem().and_then(|stem| stem.to_str());
        match stem {
            Some("cornell") => Self::Orbit { rx: 0.0, ry: 0.0 },
            _ => Self::Orbit { rx: 20.0, ry: 140.0 },
        }
    }

    fn view(&self, bounds: &Bounds) -> View {
        match *self {
            Self::Pinhole { eye, target, up, fov } => {
                let eye = DVec3::from(eye);
                let forward = (DVec3::from(target) - eye).normalize();
                let right = forward.cross(DVec3::from(up)).normalize();
                let tangent = (fov.to_radians() * 0.5).tan();
                View { eye, right, up: right.cross(forward), forward, tangent }
            }
            Self::Orbit { rx, ry } => {
                let turned =
                    DMat3::from_rotation_x(rx.to_radians()) * DMat3::from_rotation_y(ry.to_radians());
                let axes = turned.transpose();
                View {
                    eye: bounds.center() + axes.z_axis * bounds.diagonal(),
                    right: axes.x_axis,
                    up: axes.y_axis,
                    forward: -axes.z_axis,
                    tangent: (DEFAULT_FOV.to_radians() * 0.5).tan(),
                }
            }
        }
    }

    /// The rays of a picture of `width` x `height` pixels.
    pub fn rays(&self, bounds: &Bounds, placement: &Placement, size: (u32, u32), model: RayModel) -> RayFan {
        let view = self.view(bounds);
        let (width, height) = (f64::from(size.0), f64::from(size.1));
        // Directions of unit depth: at the raster's origin (top left), and their change per pixel.
        let dx = view.right * (2.0 * view.tangent * width / height / width);
        let dy = view.up * (-2.0 * view.tangent / height);
        let corner = view.forward - dx * (width * 0.5) - dy * (height * 0.5);
        let scale = placement.scale;
        let (near, far) = original_planes(bounds);
        let from_to = |corner: DVec3, start: f64, end: f64, pixel_shift: f64| RayFan {
            origin: [
                placement.point(view.eye) + corner * start * scale,
                dx * start * scale,
                dy * start * scale,
            ],
            direction: [corner, dx, dy].map(|part| part * (end - start) * scale),
            t_max: 1.0,
            pixel_shift,
        };
        match model {
            RayModel::Eye => RayFan {
                origin: [placement.point(view.eye), DVec3::ZERO, DVec3::ZERO],
                direction: [corner, dx, dy],
                t_max: f64::from(f32::MAX),
                pixel_shift: 0.5,
            },
            // The original counts rows from the bottom and takes a pixel's lower left corner, so row y of
            // the picture lies at raster height y + 1.
            RayModel::NearToFar => from_to(corner + dy, near, far, 0.0),
            RayModel::CentredNearToFar => from_to(corner, near, far, 0.5),
            RayModel::MiddleToFar => from_to(corner, 2.0 * near * far / (near + far), far, 0.5),
        }
    }
}

/// The original's near and far plane, which mix frames: d = |c - (0, 0, s)| is the distance of the
/// scene's centre from an eye that has not turned and orbits the origin.
fn original_planes(bounds: &Bounds) -> (f64, f64) {
    let diagonal = bounds.diagonal();
    let distance = (bounds.center() - DVec3::new(0.0, 0.0, diagonal)).length();
    ((distance - diagonal).max(0.1), (distance + diagonal).max(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: Bounds = Bounds { min: DVec3::new(-1.0, 0.0, -1.0), max: DVec3::new(1.0, 2.0, 1.0) };

    fn ray(fan: &RayFan, x: f64, y: f64) -> (DVec3, DVec3) {
        let at = |parts: &[DVec3; 3]| parts[0] + parts[1] * x + parts[2] * y;
        (at(&fan.origin), at(&fan.direction))
    }

    #[test]
    fn orbit_zero_looks_along_minus_z_from_one_diagonal() {
        let camera = Camera::Orbit { rx: 0.0, ry: 0.0 };
        let fan = camera.rays(&BOUNDS, &Placement::IDENTITY, (200, 100), RayModel::Eye);
        let (origin, middle) = ray(&fan, 100.0, 50.0);
        assert!((origin - DVec3::new(0.0, 1.0, 12f64.sqrt())).length() < 1e-12);
        assert!((middle.normalize() - DVec3::NEG_Z).length() < 1e-12);
        let (_, top_left) = ray(&fan, 0.0, 0.0);
        assert!(top_left.x < 0.0 && top_left.y > 0.0, "row 0 is at the top: {top_left}");
        assert!((top_left.y - 22.5f64.to_radians().tan()).abs() < 1e-12);
    }

    #[test]
    fn orbit_ry_180_sees_the_other_side_and_rx_looks_from_above() {
        let behind = Camera::Orbit { rx: 0.0, ry: 180.0 }.view(&BOUNDS);
        assert!(behind.eye.z < -3.0 && behind.forward.z > 0.999);
        let above = Camera::Orbit { rx: 20.0, ry: 0.0 }.view(&BOUNDS);
        assert!(above.eye.y > 1.0 && above.forward.y < 0.0);
    }

    #[test]
    fn the_originals_rays_span_near_to_far_at_t_0_to_1() {
        let camera = Camera::Orbit { rx: 0.0, ry: 0.0 };
        let fan = camera.rays(&BOUNDS, &Placement::IDENTITY, (64, 64), RayModel::NearToFar);
        let (near, far) = original_planes(&BOUNDS);
        let eye_z = 12f64.sqrt();
        let (origin, direction) = ray(&fan, 32.0, 31.0);
        assert!((origin.z - (eye_z - near)).abs() < 1e-9, "{origin}");
        assert!(((origin + direction).z - (eye_z - far)).abs() < 1e-9);
    }

    #[test]
    fn a_pinhole_equals_the_orbit_that_it_copies() {
        let orbit = Camera::Orbit { rx: 30.0, ry: 70.0 };
        let view = orbit.view(&BOUNDS);
        let pinhole = Camera::Pinhole {
            eye: view.eye.to_array(),
            target: BOUNDS.center().to_array(),
            up: [0.0, 1.0, 0.0],
            fov: DEFAULT_FOV,
        };
        let placement = Placement::conditioned(&BOUNDS);
        let (a, b) = (
            orbit.rays(&BOUNDS, &placement, (320, 200), RayModel::Eye),
            pinhole.rays(&BOUNDS, &placement, (320, 200), RayModel::Eye),
        );
        for (a, b) in a.direction.iter().zip(&b.direction) {
            assert!((*a - *b).length() < 1e-9);
        }
    }
}
