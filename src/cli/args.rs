//! Arguments that several commands share, and how their values are read.

use std::time::Duration;

use clap::Args;
use glam::DVec3;

use crate::bvh::Builder;
use crate::error::{Error, Result};
use crate::render::choices::{
    Accessor, Accumulator, Intersector, Method, Offset, Passes, Preset, Sampler, Slabs, Wishes,
};
use crate::scene::Scene;
use crate::scene::camera::{Camera, DEFAULT_FOV};

/// Choices of a render.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Choices")]
pub struct ChoiceArguments {
    /// A bundle of choices; the options below change single ones
    #[arg(long, value_enum, default_value = "auto")]
    pub preset: Preset,
    /// How a ray finds triangles: brute, stackN (such as stack16 or stack64), threaded (or cousu), single-push, ordered,
    /// entry, packet, postponed, wide, bundle
    #[arg(long, value_name = "METHOD")]
    pub method: Option<Method>,
    /// How the tree is made
    #[arg(long, value_enum)]
    pub builder: Option<Builder>,
    /// How the work is cut into kernels
    #[arg(long, value_enum)]
    pub passes: Option<Passes>,
    /// Where random numbers come from
    #[arg(long, value_enum)]
    pub sampler: Option<Sampler>,
    /// How a pixel's rays are added up
    #[arg(long, value_enum)]
    pub accumulator: Option<Accumulator>,
    /// How an ambient ray leaves its surface
    #[arg(long, value_enum)]
    pub offset: Option<Offset>,
    /// The test of a ray against a triangle
    #[arg(long, value_enum)]
    pub intersector: Option<Intersector>,
    /// The test of a ray against a box
    #[arg(long, value_enum)]
    pub slabs: Option<Slabs>,
    /// How kernels read geometry; with address, those that cannot read so take ssbo
    #[arg(long, value_enum)]
    pub accessor: Option<Accessor>,
    /// Let an undersized stack drop what does not fit, and count the rays that it touches
    #[arg(long)]
    pub allow_overflow: bool,
}

impl ChoiceArguments {
    pub fn wishes(&self) -> Wishes {
        Wishes {
            preset: Some(self.preset),
            method: self.method,
            builder: self.builder,
            passes: self.passes,
            sampler: self.sampler,
            accumulator: self.accumulator,
            offset: self.offset,
            intersector: self.intersector,
            slabs: self.slabs,
            accessor: self.accessor,
            ..Wishes::default()
        }
    }
}

/// The camera of a render.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Camera")]
pub struct CameraArguments {
    /// Where the eye is, units of the file
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true)]
    pub eye: Option<[f64; 3]>,
    /// What the eye looks at [default: the centre of the scene]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, requires = "eye")]
    pub target: Option<[f64; 3]>,
    /// What is up [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, requires = "eye")]
    pub up: Option<[f64; 3]>,
    /// Vertical angle in degrees [default: 45]
    #[arg(long, value_name = "DEG", requires = "eye")]
    pub fov: Option<f64>,
    /// The original's orbiter about the scene's centre, degrees [default: 20,140; cornell: 0,0; the original: 0,180]
    #[arg(long, value_name = "RX,RY", value_parser = angles, allow_hyphen_values = true, conflicts_with = "eye")]
    pub orbit: Option<[f64; 2]>,
}

impl CameraArguments {
    /// The camera asked for, or the default of scene and preset.
    pub fn camera(&self, scene: &Scene, preset: Preset) -> Result<Camera> {
        if let Some([rx, ry]) = self.orbit {
            return Ok(Camera::Orbit { rx, ry });
        }
        let Some(eye) = self.eye else {
            return Ok(match preset {
                Preset::Original | Preset::OriginalUnbiased => Camera::Orbit { rx: 0.0, ry: 180.0 },
                Preset::Auto => Camera::default_for(&scene.path),
            });
        };
        let target = self.target.unwrap_or(scene.bounds.center().to_array());
        let up = self.up.unwrap_or([0.0, 1.0, 0.0]);
        let fov = self.fov.unwrap_or(DEFAULT_FOV);
        let forward = DVec3::from(target) - DVec3::from(eye);
        if forward.length() == 0.0 {
            return Err(Error::usage("--eye and --target are the same point: move one of them."));
        }
        if forward.cross(DVec3::from(up)).length() <= 1e-9 * forward.length() * DVec3::from(up).length() {
            return Err(Error::usage(
                "--up must not be zero nor along the view: choose another direction, such as 0,0,1.",
            ));
        }
        if !(fov > 0.0 && fov < 180.0) {
            return Err(Error::usage(format!(
                "--fov {fov} is no angle of view: choose one between 0 and 180 degrees."
            )));
        }
        Ok(Camera::Pinhole { eye, target, up, fov })
    }
}

/// `WxH`, both at least 1.
pub fn size(text: &str) -> std::result::Result<(u32, u32), String> {
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)))
        .filter(|(width, height)| *width >= 1 && *height >= 1)
        .ok_or_else(|| "give width and height in pixels, such as 1024x640".to_string())
}

/// A positive length.
pub fn distance(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(distance) if distance > 0.0 && f64::is_finite(distance) => Ok(distance),
        _ => Err("give a positive length, such as 0.5".to_string()),
    }
}

/// A positive error of values in [0, 1].
pub fn error(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(error) if error > 0.0 && error < 1.0 => Ok(error),
        _ => Err("give an error between 0 and 1, such as 0.01".to_string()),
    }
}

/// A positive time.
pub fn seconds(text: &str) -> std::result::Result<Duration, String> {
    let time = text.parse().ok().and_then(|seconds| Duration::try_from_secs_f64(seconds).ok());
    match time {
        Some(time) if !time.is_zero() => Ok(time),
        _ => Err("give a time in seconds, such as 2.5".to_string()),
    }
}

fn vector(text: &str) -> std::result::Result<[f64; 3], String> {
    numbers(text).ok_or_else(|| "give three numbers, such as 0,1.5,-3".to_string())
}

/// `RX,RY` in degrees.
pub fn angles(text: &str) -> std::result::Result<[f64; 2], String> {
    numbers(text).ok_or_else(|| "give two angles in degrees, such as 20,140".to_string())
}

/// Exactly N finite numbers, separated by commas.
fn numbers<const N: usize>(text: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok().filter(|number: &f64| number.is_finite()))
        .collect();
    numbers?.try_into().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_vectors_are_read_strictly() {
        assert_eq!(size("1024x640"), Ok((1024, 640)));
        for wrong in ["", "0x5", "5", "5x", "-1x5", "5x5x5", "1.5x2", "99999999999x1"] {
            assert!(size(wrong).is_err(), "{wrong}");
        }
        assert_eq!(vector("-1, 2.5,3e2"), Ok([-1.0, 2.5, 300.0]));
        for wrong in ["1,2", "1,2,3,4", "1,nan,2", "a,b,c", "", "1,,2"] {
            assert!(vector(wrong).is_err(), "{wrong}");
        }
    }
}
