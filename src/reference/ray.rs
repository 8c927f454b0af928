//! A ray under way and what it has met. Twin of shaders/shared/ray.glsl.

use glam::Vec3;

use crate::layout::{HitRecord, NO_HIT, RayRecord};

/// Points are origin + t direction, 0 < t <= t_max; scene units, t in units of the direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    pub origin: Vec3,
    pub direction: Vec3,
    pub t_max: f32,
}

impl Ray {
    pub fn of_record(record: &RayRecord) -> Self {
        Self { origin: record.origin.into(), direction: record.direction.into(), t_max: record.t_max }
    }

    pub fn record(&self) -> RayRecord {
        RayRecord {
            origin: self.origin.to_array(),
            t_max: self.t_max,
            direction: self.direction.to_array(),
            weight: 1.0,
        }
    }
}

/// Closest hit so far. Index: place in the triangle array, `NO_HIT` if none; id: what decides a tie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    pub t: f32,
    pub u: f32,
    pub v: f32,
    pub index: u32,
    pub id: u32,
}

impl Hit {
    pub fn record(&self) -> HitRecord {
        HitRecord { t: self.t, u: self.u, v: self.v, index: self.index }
    }
}

pub fn no_hit(t_max: f32) -> Hit {
    Hit { t: t_max, u: 0.0, v: 0.0, index: NO_HIT, id: NO_HIT }
}
