//! Lists of rays from files, in units of the scene's file.

use std::path::Path;

use glam::DVec3;

use super::condition::Placement;
use crate::error::{Error, Result};
use crate::layout::RayRecord;

/// A ray of a list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FileRay {
    pub origin: DVec3,
    /// Of any length but 0.
    pub direction: DVec3,
    /// Where the ray ends, in lengths of its direction; may be infinite.
    pub t_max: f64,
}

/// Numbers of a binary record, 32-bit floats, little-endian.
const NUMBERS: usize = 7;

impl FileRay {
    /// As the device gets it: the direction as it is, so that `t_max` scales as lengths do.
    pub fn placed(&self, placement: &Placement) -> RayRecord {
        RayRecord {
            origin: placement.point(self.origin).as_vec3().to_array(),
            t_max: (placement.length(self.t_max) as f32).min(f32::MAX),
            direction: self.direction.as_vec3().to_array(),
            weight: 1.0,
        }
    }

    /// Origin, direction and, if there is a seventh, the end.
    fn of(numbers: &[f64]) -> std::result::Result<Self, String> {
        let ([ox, oy, oz, dx, dy, dz] | [ox, oy, oz, dx, dy, dz, _]) = *numbers else {
            return Err(format!("it has {} numbers instead of 6 or {NUMBERS}", numbers.len()));
        };
        let (origin, direction) = (DVec3::new(ox, oy, oz), DVec3::new(dx, dy, dz));
        let t_max = numbers.get(6).copied().unwrap_or(f64::INFINITY);
        let length = direction.as_vec3().length();
        if !origin.as_vec3().is_finite() || !length.is_finite() {
            return Err("its origin and direction must be finite".into());
        }
        if length < f32::MIN_POSITIVE {
            return Err("its direction has no length".into());
        }
        if t_max.is_nan() || t_max <= 0.0 {
            return Err("it must end after it begins (tmax above 0)".into());
        }
        Ok(Self { origin, direction, t_max })
    }
}

/// Reads rays: records of seven 32-bit floats, little-endian, where the name ends in .bin; otherwise lines
/// `ox oy oz dx dy dz [tmax]`, and comments after #.
pub fn load(path: &Path) -> Result<Vec<FileRay>> {
    let shown = path.display();
    let bytes = std::fs::read(path).map_err(|error| {
        Error::input(format!("{shown} could not be read ({error}): name a file of rays."))
    })?;
    let binary = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("bin"));
    let rays = if binary { from_records(&bytes) } else { from_lines(&String::from_utf8_lossy(&bytes)) };
    let rays = rays.map_err(|wrong| Error::input(format!("{shown}, {wrong}: correct or remove it.")))?;
    if rays.is_empty() {
        return Err(Error::input(format!(
            "{shown} holds no rays: write one a line, ox oy oz dx dy dz [tmax]."
        )));
    }
    Ok(rays)
}

fn from_lines(text: &str) -> std::result::Result<Vec<FileRay>, String> {
    let mut rays = Vec::new();
    for (place, line) in text.lines().enumerate() {
        let words = line.split('#').next().unwrap_or("").split_whitespace();
        let numbers: std::result::Result<Vec<f64>, String> =
            words.map(|word| word.parse().map_err(|_| format!("{word:?} is no number"))).collect();
        match numbers {
            Ok(numbers) if numbers.is_empty() => continue,
            numbers => rays.push(
                numbers
                    .and_then(|numbers| FileRay::of(&numbers))
                    .map_err(|why| format!("line {} is no ray ({why})", place + 1))?,
            ),
        }
    }
    Ok(rays)
}

fn from_records(bytes: &[u8]) -> std::result::Result<Vec<FileRay>, String> {
    let record = NUMBERS * size_of::<f32>();
    if !bytes.len().is_multiple_of(record) {
        return Err(format!(
            "whose {} bytes are no multiple of {record}, is no list of records",
            bytes.len()
        ));
    }
    let ray = |(place, record): (usize, &[u8])| {
        let numbers: Vec<f64> = record
            .chunks_exact(4)
            .map(|word| f64::from(f32::from_le_bytes([word[0], word[1], word[2], word[3]])))
            .collect();
        FileRay::of(&numbers).map_err(|why| format!("record {} is no ray ({why})", place + 1))
    };
    bytes.chunks_exact(record).enumerate().map(ray).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_rays_and_bad_ones_are_named() {
        let rays = from_lines("# mine\n0 1 2 0 0 -1\n\n1 1 1 3 0 0 2.5 # short\n").unwrap();
        assert_eq!(rays.len(), 2);
        assert_eq!(rays[0].t_max, f64::INFINITY);
        assert_eq!((rays[1].direction, rays[1].t_max), (DVec3::new(3.0, 0.0, 0.0), 2.5));
        for (wrong, word) in [
            ("0 0 0 1 0", "5 numbers"),
            ("0 0 0 0 0 0", "no length"),
            ("0 0 nan 1 0 0", "finite"),
            ("0 0 0 1 0 0 0", "tmax"),
            ("0 0 0 1 x 0", "\"x\" is no number"),
        ] {
            let said = from_lines(&format!("0 0 0 1 0 0\n{wrong}\n")).unwrap_err();
            assert!(said.contains("line 2") && said.contains(word), "{said}");
        }
    }

    #[test]
    fn records_are_the_same_rays() {
        let bytes: Vec<u8> =
            [0f32, 1.0, 2.0, 0.0, 0.0, -1.0, f32::INFINITY].iter().flat_map(|n| n.to_le_bytes()).collect();
        assert_eq!(from_records(&bytes), from_lines("0 1 2 0 0 -1 inf"));
        assert!(from_records(&bytes[1..]).unwrap_err().contains("27 bytes"));
        assert!(from_records(&[0; 28]).unwrap_err().contains("record 1"));
    }

    #[test]
    fn a_placed_ray_meets_what_it_met() {
        let placement = Placement { center: DVec3::new(10.0, 0.0, 0.0), scale: 0.25 };
        let ray =
            FileRay { origin: DVec3::new(14.0, 4.0, 0.0), direction: DVec3::new(0.0, -2.0, 0.0), t_max: 8.0 };
        let placed = ray.placed(&placement);
        assert_eq!((placed.origin, placed.direction, placed.t_max), ([1.0, 1.0, 0.0], [0.0, -2.0, 0.0], 2.0));
        assert_eq!(FileRay { t_max: f64::INFINITY, ..ray }.placed(&placement).t_max, f32::MAX);
    }
}
