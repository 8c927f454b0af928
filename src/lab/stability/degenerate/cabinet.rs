//! Triangles as nobody wants them, a kind beside the other in one scene, and rays aimed at them.

use glam::DVec3;

use crate::lab::scenes::scene_of;
use crate::layout::RayRecord;
use crate::render::seeds::hash;
use crate::scene::camera::Camera;
use crate::scene::condition::Placement;
use crate::scene::rays::FileRay;
use crate::scene::{Mesh, Scene};

/// Random numbers by their place.
#[derive(Clone, Copy)]
pub struct Numbers {
    seed: u32,
    next: u32,
}

impl Numbers {
    pub fn new(seed: u32) -> Self {
        Self { seed, next: 0 }
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.next += 1;
        f64::from(hash(self.next, self.seed)) / 2f64.powi(32)
    }

    /// In [-1, 1).
    fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    fn point(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    fn direction(&mut self) -> DVec3 {
        self.point().normalize_or(DVec3::Y)
    }
}

type Corners = [DVec3; 3];

/// Triangles within [-1, 1]^3.
pub struct Kind {
    pub name: &'static str,
    make: fn(&mut Numbers) -> Vec<Corners>,
}

pub const KINDS: [Kind; 6] = [
    Kind { name: "zero area", make: zero_area },
    Kind { name: "needles", make: needles },
    Kind { name: "duplicated", make: duplicated },
    Kind { name: "coplanar", make: coplanar },
    Kind { name: "overlapping", make: |numbers| soup(numbers, 60) },
    Kind { name: "tiny", make: tiny },
];

fn soup(numbers: &mut Numbers, count: usize) -> Vec<Corners> {
    (0..count).map(|_| [numbers.point(), numbers.point(), numbers.point()]).collect()
}

/// Points, lines whose two or three corners meet, and lines of three corners, among a few triangles.
fn zero_area(numbers: &mut Numbers) -> Vec<Corners> {
    let mut all = soup(numbers, 6);
    for _ in 0..6 {
        let [a, b] = [numbers.point(), numbers.point()];
        all.extend([[a, a, a], [a, a, b], [a, b, a], [a, b, b], [a, b, a + (b - a) * 2.0], [a, a, b]]);
    }
    all
}

/// Of one length, and 10 to 10^8 times as long as wide.
fn needles(numbers: &mut Numbers) -> Vec<Corners> {
    (0..64)
        .map(|i| {
            let along = if i % 2 == 0 { numbers.direction() } else { DVec3::X };
            let across = along.cross(numbers.direction()) * 10f64.powi(-1 - i / 8);
            let middle = numbers.point() * 0.5;
            [middle - along * 0.5, middle + along * 0.5, middle + along * numbers.signed() * 0.5 + across]
        })
        .collect()
}

/// Each seven times: four times the same, turned twice, and wound the other way.
fn duplicated(numbers: &mut Numbers) -> Vec<Corners> {
    let of_one =
        |[a, b, c]: Corners| [[a, b, c], [a, b, c], [b, c, a], [a, b, c], [c, a, b], [a, c, b], [a, b, c]];
    soup(numbers, 12).into_iter().flat_map(of_one).collect()
}

/// In a plane along the axes and in one askew.
fn coplanar(numbers: &mut Numbers) -> Vec<Corners> {
    let normal = DVec3::new(0.3, 0.8, -0.5).normalize();
    let flat = |point: DVec3, normal: DVec3| point - normal * point.dot(normal);
    let mut all = soup(numbers, 80);
    for (i, corners) in all.iter_mut().enumerate() {
        *corners = corners.map(|corner| flat(corner, if i % 2 == 0 { normal } else { DVec3::Y }));
    }
    all
}

/// From a hundredth of the scene's size to a millionth.
fn tiny(numbers: &mut Numbers) -> Vec<Corners> {
    (0..60)
        .map(|i| {
            let (at, size) = (numbers.point(), 10f64.powf(-1.0 - f64::from(i) / 12.0));
            [at, at + numbers.point() * size, at + numbers.point() * size]
        })
        .collect()
}

/// Every kind in a place of its own.
pub struct Cabinet {
    pub scene: Scene,
    /// Of each kind, in the order of the file.
    corners: Vec<Vec<Corners>>,
}

/// From the middle of a kind's place to that of the next.
const SPACING: f64 = 2.5;

/// Fills the picture with all of it.
pub const VIEW: Camera =
    Camera::Pinhole { eye: [2.5, 5.5, 7.0], target: [2.5, 0.0, 1.3], up: [0.0, 1.0, 0.0], fov: 40.0 };

impl Cabinet {
    pub fn new(seed: u32, scale: f64) -> Self {
        let corners: Vec<Vec<Corners>> = KINDS
            .iter()
            .enumerate()
            .map(|(place, kind)| {
                let at = DVec3::new((place % 3) as f64, 0.0, (place / 3) as f64) * SPACING;
                let made = (kind.make)(&mut Numbers::new(seed ^ place as u32));
                made.iter().map(|corners| corners.map(|corner| (corner + at) * scale)).collect()
            })
            .collect();
        Self { scene: scene_of("cabinet", mesh_of(corners.iter().flatten())), corners }
    }

    /// Rays at triangles of a kind, at points inside, on edges, at corners and beside them; some along an axis, and some
    /// in the triangle's plane or next to it.
    pub fn rays(&self, kind: usize, count: usize, seed: u32, placement: &Placement) -> Vec<RayRecord> {
        let mut numbers = Numbers::new(hash(seed, kind as u32));
        let targets = &self.corners[kind];
        (0..count)
            .map(|_| {
                let target = targets[numbers.below(targets.len())];
                aimed(&mut numbers, target).placed(placement)
            })
            .collect()
    }
}

/// Triangles that share no corner.
pub fn mesh_of<'a>(triangles: impl Iterator<Item = &'a Corners>) -> Mesh {
    let positions: Vec<DVec3> = triangles.flatten().copied().collect();
    let triangles = (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Mesh { positions, triangles }
}

pub fn aimed(numbers: &mut Numbers, [a, b, c]: Corners) -> FileRay {
    let (u, v) = match numbers.below(6) {
        0 => (0.0, numbers.unit()),
        1 => (numbers.unit(), 0.0),
        2 => [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)][numbers.below(3)],
        3 => (numbers.signed(), numbers.signed()),
        _ => {
            let (u, v) = (numbers.unit(), numbers.unit());
            if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) }
        }
    };
    let (ab, ac) = (b - a, c - a);
    let point = a + ab * u + ac * v;
    let size = ab.length().max(ac.length());
    let direction = match numbers.below(6) {
        0 => [DVec3::X, DVec3::Y, DVec3::NEG_Z][numbers.below(3)],
        1 => {
            let tilt = 0.5f64.powi(numbers.below(40) as i32);
            let in_plane = (ab * numbers.signed() + ac * numbers.signed()).normalize_or(DVec3::X);
            in_plane + ab.cross(ac).normalize_or(DVec3::Y) * tilt
        }
        2 => ab.normalize_or(DVec3::X),
        _ => numbers.direction(),
    };
    let origin = point - direction * (size * (0.1 + 4.0 * numbers.unit()));
    FileRay { origin, direction: direction.as_vec3().as_dvec3(), t_max: f64::INFINITY }
}
