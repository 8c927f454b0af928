//! The shaders' twin on the CPU, file for file, and [`exact`] brute force in f64: what tests compare a
//! device with. Each f32 operation is rounded by itself in the order of the shaders' text, so that a device
//! which divides and rounds as IEEE 754 says gives the same bits.

pub mod accumulate;
pub mod arith;
pub mod camera;
pub mod exact;
pub mod intersect;
pub mod offset;
pub mod philox;
pub mod ray;
pub mod rng;
pub mod samplers;
pub mod sampling;
pub mod slabs;
pub mod sobol;
pub mod strata;
pub mod surface;
pub mod traverse;
pub mod watertight;

#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use crate::layout::{
    CentredNode, Corners, Count, Frame, HitRecord, NO_HIT, Node, PairNode, QuadNode, RayRecord, SAMPLER_LCG,
    ThreadedNode, Triangle, WideNode,
};
use crate::pack::NodeArrays;
use ray::{Hit, Ray, no_hit};
use samplers::{pcg_numbers, sample_numbers};
use surface::{ambient_ray, original_weight, surface_at, surface_nowhere};

/// How a ray finds triangles: shaders/traverse/.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traversal {
    Brute,
    /// With a stack of `size` entries.
    Stack {
        size: u32,
    },
    Threaded,
    SinglePush,
    Ordered,
    Entry,
    Packet,
    Postponed,
    Wide,
    Bundle,
}

/// What kernels are specialized for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choices {
    pub traversal: Traversal,
    /// The original's intersector, ties, box ranges, unturned normals and wasted rays.
    pub original: bool,
    pub robust_slabs: bool,
    /// Triangles are met by their corners, watertight.
    pub watertight: bool,
    /// No triangle is missed that the exact ray meets.
    pub conservative: bool,
    /// One of the `SAMPLER_` constants of `layout`.
    pub sampler: u32,
    /// Normals face the camera.
    pub facing: bool,
    /// Ambient rays start some ulps off their surface, not the frame's offset.
    pub ulp_offset: bool,
}

/// Everything a kernel is given: packed arrays as on the device, all in scene units.
#[derive(Clone, Copy, Debug)]
pub struct Inputs<'a> {
    pub frame: &'a Frame,
    /// In the order of the tree's leaves.
    pub triangles: &'a [Triangle],
    /// The same triangles by their corners, where the intersector is watertight; may be empty otherwise.
    pub corners: &'a [Corners],
    /// The tree in every layout; [`Traversal::Brute`] leaves it alone.
    pub tree: &'a NodeArrays,
    pub choices: Choices,
}

impl Inputs<'_> {
    pub fn load_triangle(&self, index: u32) -> &Triangle {
        &self.triangles[index as usize]
    }

    pub fn load_node(&self, index: i32) -> &Node {
        &self.tree.single[index as usize]
    }

    pub fn load_threaded(&self, index: i32) -> &ThreadedNode {
        &self.tree.threaded[index as usize]
    }

    pub fn load_pair(&self, index: i32) -> &PairNode {
        &self.tree.pair[index as usize]
    }

    /// With boxes grown for the fused test.
    pub fn load_grown(&self, index: i32) -> &CentredNode {
        &self.tree.grown[index as usize]
    }

    pub fn load_wide(&self, index: i32) -> &WideNode {
        &self.tree.wide[index as usize]
    }

    pub fn load_quad(&self, index: i32) -> &QuadNode {
        &self.tree.quad[index as usize]
    }
}

/// What a render did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// Ambient rays of these samples, one element per pixel number (tile by tile, out to the ends of the
    /// last tiles), as in the device's buffer.
    pub counts: Vec<Count>,
    /// Camera rays traced: one per pixel of the image.
    pub primary_rays: u64,
    pub primary_hits: u64,
    /// Ambient rays of the pixels that hit.
    pub ambient_rays: u64,
    /// Rays (of both kinds) that dropped a node for want of stack.
    pub overflowed: u64,
}

/// All of a pixel, as in shaders/ambient.comp.glsl.
#[derive(Clone, Copy, Debug, Default)]
struct PixelWork {
    /// Whether there was anything to do.
    works: bool,
    hit: bool,
    escaped: [u32; 2],
    traced: [u32; 2],
    sum: f32,
    lcg_state: u32,
    overflowed: u32,
}

/// Twin of ambient.comp.glsl with ACCUMULATE_COUNT, for a buffer whose pixels come to samples.start next (the
/// frame's sample_base and what they have traced); the outcome has only what is added. `seeds`: states of
/// `lcg` by pixel number, stepped (without them every pixel starts at 0).
pub fn render_counts(inputs: &Inputs, samples: Range<u32>, seeds: Option<&mut [u32]>) -> Outcome {
    outcome(&render_pixels(inputs, &samples, seeds))
}

/// Twin of ambient.comp.glsl with ACCUMULATE_IMAGE. `image`: rows from the top, width x height elements of
/// (mean, mean, mean, 1 where the pixel hit), holding the mean of samples 0..samples.start; it is left
/// alone where a pixel hits nothing, but for the original. `eight_bit`: the image keeps 8 bits a channel.
pub fn render_means(
    inputs: &Inputs,
    image: &mut [[f32; 4]],
    samples: Range<u32>,
    seeds: Option<&mut [u32]>,
    eight_bit: bool,
) -> Outcome {
    let works = render_pixels(inputs, &samples, seeds);
    for (pixel, work) in works.iter().enumerate() {
        if work.works && (work.hit || inputs.choices.original) {
            let [x, y] = camera::pixel_position(inputs.frame, pixel as u32);
            let texel = &mut image[(y * inputs.frame.width + x) as usize];
            let mean = accumulate::new_mean(texel[0], work.sum, &samples);
            let alpha = if work.traced[0] + work.traced[1] > 0 { 1.0 } else { 0.0 };
            *texel = [mean, mean, mean, alpha];
            if eight_bit {
                *texel = texel.map(accumulate::eight_bits);
            }
        }
    }
    outcome(&works)
}

fn render_pixels(inputs: &Inputs, samples: &Range<u32>, seeds: Option<&mut [u32]>) -> Vec<PixelWork> {
    let pixels = 0..camera::pixel_count(inputs.frame);
    let states = seeds.as_deref();
    let works: Vec<PixelWork> = pixels
        .into_par_iter()
        .map(|pixel| {
            let state = states.map_or(0, |states| states[pixel as usize]);
            render_pixel(inputs, pixel, samples, state)
        })
        .collect();
    if let Some(seeds) = seeds {
        for (seed, work) in seeds.iter_mut().zip(&works) {
            *seed = work.lcg_state;
        }
    }
    works
}

fn render_pixel(inputs: &Inputs, pixel: u32, samples: &Range<u32>, lcg_state: u32) -> PixelWork {
    let mut work = PixelWork { lcg_state, ..PixelWork::default() };
    let position = camera::pixel_position(inputs.frame, pixel);
    work.works = camera::inside_image(inputs.frame, position) && !samples.is_empty();
    if work.works {
        let ray = camera::camera_ray(inputs.frame, pixel);
        let (hit, overflowed) = traverse::closest_hit(inputs, &ray, no_hit(ray.t_max));
        work.overflowed += u32::from(overflowed);
        // The original's far plane is at 1, its near plane at 0.
        let within = !inputs.choices.original || (hit.t > 0.0 && hit.t < 1.0);
        work.hit = hit.index != NO_HIT && within;
        if work.hit || inputs.choices.original {
            trace_ambient(inputs, pixel, samples, &ray, &hit, &mut work);
        }
    }
    work
}

fn trace_ambient(
    inputs: &Inputs,
    pixel: u32,
    samples: &Range<u32>,
    primary_ray: &Ray,
    primary_hit: &Hit,
    work: &mut PixelWork,
) {
    let surface = if work.hit { surface_at(inputs, primary_ray, primary_hit) } else { surface_nowhere() };
    for sample in samples.clone() {
        let u = sample_numbers(inputs, pixel, sample, samples, &mut work.lcg_state);
        let ray = ambient_ray(inputs, &surface, u);
        let original = inputs.choices.original;
        let weight = if original { original_weight(&surface, ray.direction, u) } else { 1.0 };
        let (occluded, overflowed) = traverse::any_hit(inputs, &ray);
        work.overflowed += u32::from(overflowed);
        if work.hit {
            let half = (sample & 1) as usize;
            work.traced[half] += 1;
            if !occluded {
                work.escaped[half] += 1;
                work.sum += weight;
            }
        }
    }
}

fn outcome(works: &[PixelWork]) -> Outcome {
    let mut outcome = Outcome::default();
    for work in works {
        outcome.counts.push(accumulate::add_samples(Count::default(), work.escaped, work.traced));
        outcome.primary_rays += u64::from(work.works);
        outcome.primary_hits += u64::from(work.hit);
        outcome.ambient_rays += u64::from(work.traced[0]) + u64::from(work.traced[1]);
        outcome.overflowed += u64::from(work.overflowed);
    }
    outcome
}

/// Twin of camera_rays.comp.glsl: the camera ray of each pixel number; beyond the image, rays that meet
/// nothing.
pub fn camera_rays(inputs: &Inputs) -> Vec<RayRecord> {
    let record = |pixel| {
        let position = camera::pixel_position(inputs.frame, pixel);
        let ray = camera::camera_ray(inputs.frame, pixel);
        let t_max = if camera::inside_image(inputs.frame, position) { ray.t_max } else { -1.0 };
        Ray { t_max, ..ray }.record()
    };
    (0..camera::pixel_count(inputs.frame)).into_par_iter().map(record).collect()
}

/// Twin of ambient_rays.comp.glsl: the ambient ray number `sample` of each pixel whose camera ray hit
/// (`hits` by pixel number), from `pcg` in place of `lcg`; in place of the others, rays that meet nothing. The samples of
/// `set` are one set of strata.
pub fn ambient_rays(inputs: &Inputs, hits: &[HitRecord], sample: u32, set: &Range<u32>) -> Vec<RayRecord> {
    let numbers = |pixel| match inputs.choices.sampler {
        SAMPLER_LCG => pcg_numbers(inputs, pixel, sample),
        _ => sample_numbers(inputs, pixel, sample, set, &mut 0),
    };
    let record = |(pixel, record): (usize, &HitRecord)| {
        if record.index == NO_HIT {
            return Ray { origin: Vec3::ZERO, direction: Vec3::Z, t_max: -1.0 }.record();
        }
        let pixel = pixel as u32;
        let hit = Hit { t: record.t, u: record.u, v: record.v, index: record.index, id: 0 };
        let surface = surface_at(inputs, &camera::camera_ray(inputs.frame, pixel), &hit);
        ambient_ray(inputs, &surface, numbers(pixel)).record()
    };
    hits.par_iter().enumerate().map(record).collect()
}

/// Twin of trace.comp.glsl, STAGE_CLOSEST: t is the ray's t_max where it escapes.
pub fn trace_closest(inputs: &Inputs, rays: &[RayRecord]) -> Vec<HitRecord> {
    let trace = |record: &RayRecord| {
        let ray = Ray::of_record(record);
        traverse::closest_hit(inputs, &ray, no_hit(ray.t_max)).0.record()
    };
    rays.par_iter().map(trace).collect()
}

/// Twin of trace.comp.glsl, STAGE_ANY: of a hit nothing but its existence is known, index 0.
pub fn trace_any(inputs: &Inputs, rays: &[RayRecord]) -> Vec<HitRecord> {
    let trace = |record: &RayRecord| {
        let (occluded, _) = traverse::any_hit(inputs, &Ray::of_record(record));
        HitRecord { index: if occluded { 0 } else { NO_HIT }, ..HitRecord::default() }
    };
    rays.par_iter().map(trace).collect()
}
