//! Boxes and planes to put scenes together from.

use glam::DVec3;

use crate::scene::Mesh;
use crate::scene::camera::Camera;

type Point = [f64; 3];

/// Two triangles on the corners `a`, `b`, `c`, `d` in this order.
pub(super) type Quad = [Point; 4];

/// A mesh in the making.
#[derive(Default)]
pub(super) struct Shapes(Mesh);

impl Shapes {
    pub(super) fn mesh(self) -> Mesh {
        self.0
    }

    pub(super) fn triangle(&mut self, corners: [Point; 3]) {
        let first = self.0.positions.len() as u32;
        self.0.positions.extend(corners.map(DVec3::from));
        self.0.triangles.push([first, first + 1, first + 2]);
    }

    /// Seen from where its corners run counter-clockwise.
    pub(super) fn quad(&mut self, [a, b, c, d]: Quad) {
        let first = self.0.positions.len() as u32;
        self.0.positions.extend([a, b, c, d].map(DVec3::from));
        self.0.triangles.extend([[first, first + 1, first + 2], [first + 2, first + 3, first]]);
    }

    /// Seen from the other side.
    pub(super) fn inner_quad(&mut self, [a, b, c, d]: Quad) {
        self.quad([d, c, b, a]);
    }

    /// To be seen from outside.
    pub(super) fn outer_box(&mut self, low: Point, high: Point) {
        faces(low, high).into_iter().for_each(|face| self.quad(face));
    }

    /// To be seen from inside.
    pub(super) fn inner_box(&mut self, low: Point, high: Point) {
        faces(low, high).into_iter().for_each(|face| self.inner_quad(face));
    }
}

/// The sides of a box, counter-clockwise seen from outside: -x, +x, -y, +y, -z, +z.
pub(super) fn faces([x0, y0, z0]: Point, [x1, y1, z1]: Point) -> [Quad; 6] {
    [
        [[x0, y0, z0], [x0, y0, z1], [x0, y1, z1], [x0, y1, z0]],
        [[x1, y0, z1], [x1, y0, z0], [x1, y1, z0], [x1, y1, z1]],
        [[x0, y0, z0], [x1, y0, z0], [x1, y0, z1], [x0, y0, z1]],
        [[x0, y1, z1], [x1, y1, z1], [x1, y1, z0], [x0, y1, z0]],
        [[x1, y0, z0], [x0, y0, z0], [x0, y1, z0], [x1, y1, z0]],
        [[x0, y0, z1], [x1, y0, z1], [x1, y1, z1], [x0, y1, z1]],
    ]
}

/// A floor with two blocks and a triangle askew, on coordinates that 32-bit floats hold exactly at a scale of 1.
pub(super) fn yard(shift: Point, scale: f64) -> Mesh {
    let mut shapes = Shapes::default();
    shapes.quad([[-2.0, 0.0, 2.0], [2.0, 0.0, 2.0], [2.0, 0.0, -2.0], [-2.0, 0.0, -2.0]]);
    shapes.outer_box([-1.5, 0.0, -1.0], [-0.5, 1.0, 0.0]);
    shapes.outer_box([0.5, 0.0, -0.5], [1.0, 2.0, 0.5]);
    shapes.triangle(ASKEW);
    let mut mesh = shapes.mesh();
    mesh.positions.iter_mut().for_each(|position| *position = *position * scale + DVec3::from(shift));
    mesh
}

/// Corners of the yard's triangle askew.
pub(super) const ASKEW: [Point; 3] = [[-1.5, 0.125, 0.75], [0.0, 0.25, 1.5], [-0.25, 1.125, 0.5]];

/// A camera whose rays stay near where it looks, however wide or tall the picture is.
pub(super) fn framed(eye: Point, target: Point, (width, height): (u32, u32)) -> Camera {
    let aspect = f64::from(width) / f64::from(height);
    let fov = 2.0 * (0.2f64.min(0.2 / aspect)).atan().to_degrees();
    Camera::Pinhole { eye, target, up: [0.0, 1.0, 0.0], fov }
}

/// The same on the yard, of whose blocks it sees some.
pub(super) fn yard_framed(size: (u32, u32)) -> Camera {
    framed([8.0, 4.0, 7.0], [0.0, 0.75, 0.0], size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_look_outwards() {
        let centre = DVec3::new(0.5, 2.0, -1.0);
        for face in faces([0.0, 1.0, -3.0], [1.0, 3.0, 1.0]) {
            let [a, b, c, d] = face.map(DVec3::from);
            let normal = (b - a).cross(c - a);
            assert!(normal.length() > 0.0 && normal.dot(a - centre) > 0.0, "{face:?}");
            assert!((c - a).cross(d - a).dot(normal) > 0.0, "{face:?}");
        }
    }
}
