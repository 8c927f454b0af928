//! Digits that a file no longer has, because whoever wrote it kept too few of them so far from the origin, and details
//! that 32-bit floats cannot hold beside the rest of the scene.
//!
//! A coordinate that is rounded to a grid tells of it in two ways: every value of its axis lies on the grid, and some use
//! its last place. A house in whole metres is on a grid as well, but on none that a writer of numbers makes where it
//! stands.

use super::Mesh;
use super::condition::Placement;

/// Fewer steps than this across the scene are too few.
const FEWEST_STEPS: f64 = 4096.0;
/// Edges shorter than this many steps have lost their direction.
const SHORT: f64 = 4.0;
/// Part of all edges that may be as short: from cut digits, and where they stand in the file.
const FEW: f64 = 0.01;
const VERY_FEW: f64 = 0.001;

/// Ways to write a number that keep too few digits of some.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Writer {
    /// In 64-bit floats.
    Double,
    /// In 32-bit floats, in decimals that give the same float again, all of them, or six behind the point.
    Float,
    /// With six digits (%g).
    SixDigits,
    /// With six digits behind the point (%f).
    SixDecimals,
}

const WRITERS: [Writer; 4] = [Writer::SixDecimals, Writer::SixDigits, Writer::Float, Writer::Double];

/// Of the values of an axis the largest, whose last place is the coarsest.
fn last_place(largest: f64, digits_per: f64, digits: i32) -> f64 {
    let place = largest.log(digits_per).floor() as i32 - digits + 1;
    digits_per.powi(place)
}

impl Writer {
    /// From one value to the next where coordinates are as large as this.
    fn step(self, largest: f64) -> f64 {
        match self {
            Self::Double => last_place(largest, 2.0, 53),
            Self::Float => last_place(largest, 2.0, 24),
            Self::SixDigits => last_place(largest, 10.0, 6),
            Self::SixDecimals => 1e-6,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Double => "64-bit floats",
            Self::Float => "32-bit floats",
            Self::SixDigits => "six digits",
            Self::SixDecimals => "six decimals",
        }
    }

    /// Whether it may have written this number.
    fn writes(self, x: f64) -> bool {
        let reads_back = |text: String| text.parse() == Ok(x);
        let float = x as f32;
        match self {
            Self::Double => true,
            Self::Float => {
                f64::from(float) == x
                    || reads_back(float.to_string())
                    || reads_back(format!("{float:.8e}"))
                    || reads_back(format!("{float:.6}"))
            }
            Self::SixDigits => reads_back(format!("{x:.5e}")),
            Self::SixDecimals => reads_back(format!("{x:.6}")),
        }
    }

    /// Whether the number has a digit in the last place.
    fn uses_last_place(self, x: f64) -> bool {
        let differs = |text: String| text.parse() != Ok(x);
        match self {
            Self::Double => x.to_bits() & 1 == 1,
            Self::Float => (x as f32).to_bits() & 1 == 1,
            Self::SixDigits => differs(format!("{x:.4e}")),
            Self::SixDecimals => differs(format!("{x:.5}")),
        }
    }
}

/// What is to be said of the digits of a mesh's coordinates; nothing if they carry it.
pub fn warnings(mesh: &Mesh) -> Vec<String> {
    let lengths: Vec<f64> = edges(mesh).collect();
    let mut said: Vec<String> = (0..3).filter_map(|axis| of_axis(mesh, &lengths, axis)).collect();
    said.extend(of_details(mesh, &lengths));
    said
}

/// Lengths of the triangles' edges, those of no length left out.
fn edges(mesh: &Mesh) -> impl Iterator<Item = f64> {
    mesh.triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|ends| {
            let [a, b] = ends.map(|corner| mesh.positions[corner as usize]);
            (b - a).length()
        })
        .filter(|length| *length > 0.0)
}

/// Part of the edges that are shorter than this.
fn part_below(lengths: &[f64], limit: f64) -> f64 {
    lengths.iter().filter(|length| **length < limit).count() as f64 / lengths.len().max(1) as f64
}

fn of_axis(mesh: &Mesh, lengths: &[f64], axis: usize) -> Option<String> {
    let bounds = mesh.bounds();
    let extent = (bounds.max - bounds.min).max_element();
    let values = || mesh.positions.iter().map(|position| position[axis]);
    let largest = values().fold(0.0, |largest: f64, x| largest.max(x.abs()));
    // Where the axis holds nothing but zeros there is nothing to lose.
    if largest == 0.0 || bounds.min[axis] == bounds.max[axis] {
        return None;
    }
    let is_large = |x: f64| x.abs() > 0.25 * largest;
    let all_large = values().all(is_large);
    // Small values of a float have smaller steps, so there nothing is known of edges.
    let short_edges = |writer: Writer| match writer == Writer::SixDecimals || all_large {
        true => part_below(lengths, SHORT * writer.step(largest)),
        false => 0.0,
    };
    let wrote = |writer: &Writer| {
        let too_coarse = extent < FEWEST_STEPS * writer.step(largest) || short_edges(*writer) > FEW;
        too_coarse
            && values().all(|x| writer.writes(x))
            && values().any(|x| is_large(x) && writer.uses_last_place(x))
    };
    let writer = WRITERS.into_iter().find(wrote)?;
    let (step, short) = (writer.step(largest), short_edges(writer));
    let also = if short > FEW {
        format!(" and {:.0}% of the edges are shorter than {SHORT} of them", (short * 100.0).ceil())
    } else {
        String::new()
    };
    Some(format!(
        "{} is written in steps of {step:.2e} ({}), of which {:.0} make the scene's width{also}: what was smaller is gone; \
         write it with more digits or nearer to the origin",
        ["x", "y", "z"][axis],
        writer.name(),
        extent / step,
    ))
}

/// Edges that are next to nothing beside the scene.
fn of_details(mesh: &Mesh, lengths: &[f64]) -> Option<String> {
    let placement = Placement::conditioned(&mesh.bounds());
    let limit = SHORT * f64::from(f32::EPSILON) * 0.5 / placement.scale;
    let part = part_below(lengths, limit);
    (part > VERY_FEW).then(|| {
        format!(
            "{} of {} edges are shorter than {limit:.2e}, {SHORT} steps of 32-bit floats in a scene of this width: what they \
             bound has lost its shape; render it by itself",
            (part * lengths.len() as f64).round(),
            lengths.len()
        )
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::obj;
    use crate::scene::procedural::{KINDS, Request, find};

    fn moved(mesh: &Mesh, scale: f64, shift: f64, write: impl Fn(f64) -> f64) -> Mesh {
        let width = (mesh.bounds().max - mesh.bounds().min).max_element();
        let point = |p: &DVec3| ((*p + shift * width) * scale).to_array().map(&write).into();
        Mesh { positions: mesh.positions.iter().map(point).collect(), ..mesh.clone() }
    }

    fn procedural(name: &str, triangles: Option<u64>) -> Mesh {
        (find(name).unwrap().generate)(&Request { triangles, seed: 0 }).unwrap()
    }

    /// Who wrote it, scale, shift, and what became of a number.
    type Cut = (&'static str, f64, f64, fn(f64) -> f64);

    const DOUBLES: fn(f64) -> f64 = |x| x;
    const FLOATS: fn(f64) -> f64 = |x| f64::from(x as f32);

    fn decimals(text: String) -> f64 {
        text.parse().unwrap()
    }

    /// Scenes as they are made, and anything that keeps its digits however far away it lies.
    #[test]
    fn nothing_is_said_of_what_has_its_digits() {
        for kind in KINDS {
            let triangles = (kind.default_triangles > 100_000).then_some(100_000);
            let mesh = (kind.generate)(&Request { triangles, seed: 0 }).unwrap();
            assert_eq!(warnings(&mesh), Vec::<String>::new(), "{}", kind.name);
        }
        for asset in ["assets/cornell.obj", "assets/maison.obj"] {
            assert_eq!(warnings(&obj::load(asset.as_ref()).unwrap().mesh), Vec::<String>::new(), "{asset}");
        }
        for name in ["cornell", "maison"] {
            let mesh = procedural(name, None);
            for scale in [1e-6, 1e-3, 1.0, 1e3, 1e6] {
                for shift in [0.0, 1.0, 1e2, 1e4, 1e6] {
                    let far = moved(&mesh, scale, shift, DOUBLES);
                    assert_eq!(warnings(&far), Vec::<String>::new(), "{name} x {scale} + {shift}");
                }
                for write in [FLOATS, |x| decimals(format!("{x:.5e}"))] {
                    let near = moved(&mesh, scale, 0.0, write);
                    assert_eq!(warnings(&near), Vec::<String>::new(), "{name} x {scale}");
                }
            }
        }
        let cube = |at: f64| Mesh {
            positions: [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]]
                .map(|p| DVec3::from(p) + at)
                .into(),
            triangles: vec![[0, 1, 2]],
        };
        for at in [0.0, 1e3, 1e6] {
            assert_eq!(warnings(&cube(at)), Vec::<String>::new(), "whole numbers at {at}");
        }
    }

    #[test]
    fn digits_that_a_writer_cut_are_named() {
        let cut: [Cut; 6] = [
            ("32-bit floats", 1.0, 1e4, FLOATS),
            ("32-bit floats", 1e-6, 1e6, FLOATS),
            ("32-bit floats", 1.0, 1e6, |x| decimals((x as f32).to_string())),
            ("six digits", 1.0, 1e3, |x| decimals(format!("{x:.5e}"))),
            ("six decimals", 1e-4, 0.0, |x| decimals(format!("{x:.6}"))),
            ("64-bit floats", 1.0, 1e13, DOUBLES),
        ];
        for name in ["cornell", "maison"] {
            let mesh = procedural(name, None);
            for (writer, scale, shift, write) in cut {
                let scale = if name == "maison" && writer == "six decimals" { scale * 0.01 } else { scale };
                let said = warnings(&moved(&mesh, scale, shift, write));
                let of_axes = said.iter().filter(|said| said.contains("is written in steps of"));
                assert_eq!(of_axes.count(), 3, "{name} x {scale} + {shift}: {said:?}");
                assert!(said.iter().all(|said| said.contains(writer)), "{said:?}");
            }
        }
        let said = warnings(&moved(&procedural("cornell", None), 1.0, 1e6, FLOATS));
        assert!(
            said[0].starts_with("x is written in steps of 1.25e-1 (32-bit floats), of which 16 "),
            "{said:?}"
        );
    }

    #[test]
    fn details_too_small_for_floats_are_counted() {
        let mut mesh = procedural("cornell", None);
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([DVec3::X, DVec3::X + DVec3::Y * 1e-8, DVec3::X + DVec3::Z * 1e-8]);
        mesh.triangles.push([first, first + 1, first + 2]);
        let said = warnings(&mesh);
        assert_eq!(said.len(), 1);
        assert!(said[0].starts_with("3 of 99 edges are shorter than 4.77e-7"), "{said:?}");
    }
}
