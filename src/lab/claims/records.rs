//! Records whose host side lies otherwise than the shader reads it.

use super::scenes::method;
use super::{Evidence, FIGURES, Lab, Verdict};
use crate::bvh::Builder;
use crate::error::Result;
use crate::lab::figure::Figure;
use crate::layout::{HitRecord, NO_HIT, Triangle};
use crate::render::choices::{Method, Preset};
use crate::render::plan::{Plan, Tuning};
use crate::render::raylist::{Query, RayLists};
use crate::render::seeds::hash;

/// Nearly all, of the hits.
const NEARLY_ALL: f64 = 0.9;
/// A distance that differs by this part is another one.
const OTHER_DISTANCE: f32 = 1e-3;

/// Triangles one behind the other as C++ lays out three vectors of three floats: 36 bytes each where the shader reads
/// 48. Zeros fill the rest of the array, so that all that is read is there.
fn packed_tightly(triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes: Vec<u8> = Vec::with_capacity(size_of_val(triangles));
    for triangle in triangles {
        for vector in [triangle.a, triangle.ab, triangle.ac] {
            bytes.extend(vector.iter().flat_map(|component| component.to_ne_bytes()));
        }
    }
    bytes.resize(size_of_val(triangles), 0);
    bytes
}

/// Camera rays on the Cornell box, with the triangle array right and packed tightly. Brute force: its loop runs over
/// the triangles' number, whatever they hold, where a tree's links could run in circles.
pub fn misaligned(lab: &Lab<'_>) -> Result<Evidence> {
    let geometry = lab.geometry(&lab.cornell, Preset::Auto, Builder::Midpoint)?;
    let plan = || lab.plan(&lab.cornell, &geometry, &method(Preset::Auto, Method::Brute));
    let right = plan()?;
    let triangles = Some(packed_tightly(&geometry.triangles));
    let wrong = Plan { tuning: Tuning { triangles, ..Tuning::default() }, ..plan()? };
    let rays = RayLists::new(lab.device, &right)?.camera_rays()?;
    let hits = RayLists::new(lab.device, &right)?.trace(Query::Closest, &rays)?;
    let shifted = RayLists::new(lab.device, &wrong)?.trace(Query::Closest, &rays)?;
    let (mut hit, mut other, mut lost, mut out_of_nothing) = (0u32, 0u32, 0u32, 0u32);
    for (ray, (right, wrong)) in rays.iter().zip(hits.iter().zip(&shifted)) {
        if ray.t_max < 0.0 {
            continue;
        }
        match (right.index, wrong.index) {
            (NO_HIT, NO_HIT) => {}
            (NO_HIT, _) => out_of_nothing += 1,
            _ => {
                hit += 1;
                lost += u32::from(wrong.index == NO_HIT);
                other += u32::from(wrong.index != NO_HIT && differs(right, wrong));
            }
        }
    }
    let share = f64::from(lost + other) / f64::from(hit.max(1));
    let measured = format!(
        "with triangles of 36 bytes where the shader reads 48, {:.1}% of {hit} hits on cornell are wrong: {lost} are lost, \
         {other} are others; {out_of_nothing} rays that met nothing now hit",
        share * 100.0
    );
    let colour = |hits: &[HitRecord], x: u32, y: u32| match hits[right.tiles.number(x, y) as usize].index {
        NO_HIT => [0.0; 3],
        index => [0, 1, 2].map(|channel| hash(3 * index + channel, 1) as f32 / u32::MAX as f32),
    };
    let panels: [&dyn Fn(u32, u32) -> [f32; 3]; 2] =
        [&|x, y| colour(&hits, x, y), &|x, y| colour(&shifted, x, y)];
    Ok(Evidence::new(Verdict::of(share > NEARLY_ALL), measured)
        .number("share_wrong", share)
        .number("hits", hit)
        .number("lost", lost)
        .number("others", other)
        .number("out_of_nothing", out_of_nothing)
        .figure(Figure::beside(FIGURES[1], lab.size, &panels)))
}

fn differs(right: &HitRecord, wrong: &HitRecord) -> bool {
    let near = (right.t - wrong.t).abs() <= OTHER_DISTANCE * right.t.abs();
    right.index != wrong.index || !near
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tight_triangles_lie_behind_each_other_in_an_array_of_full_length() {
        let triangle = Triangle { a: [1.0; 3], ab: [2.0; 3], ac: [3.0; 3], ..Triangle::default() };
        let bytes = packed_tightly(&[triangle; 4]);
        assert_eq!(bytes.len(), 4 * 48);
        let words: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes);
        assert_eq!(words[9..18], [1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0, 3.0]);
        assert!(words[36..].iter().all(|word| *word == 0.0));
    }
}
