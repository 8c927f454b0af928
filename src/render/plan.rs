//! What a render does, before any device is touched: kernel, constants, frame, work.

use crate::error::{Error, Result};
use crate::kernels::{Kernel, NodeLayout, find_kernel};
use crate::layout::{self, Corners, Frame};
use crate::pack;
use crate::render::auto::Decision;
use crate::render::check::{check_brute, check_frame, check_job};
use crate::render::choices::{
    Accessor, Accumulator, Intersector, Method, Offset, Passes, Preset, Sampler, Settings, Slabs, Wishes,
};
use crate::render::geometry::Geometry;
use crate::render::rounds::Goal;
use crate::render::specialize;
use crate::render::tiles::Tiles;
use crate::scene::Scene;
use crate::scene::camera::{Camera, RayModel};
use crate::vk::Limits;

/// What is asked for beside the choices.
#[derive(Clone, Debug)]
pub struct Job {
    pub camera: Camera,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Ambient rays of each camera ray: samples `begin` to `end` of its sequence.
    pub samples: std::ops::Range<u32>,
    pub seed: u32,
    /// Occluders farther away than this do not count; units of the file.
    pub max_distance: Option<f64>,
    /// Camera rays of a pixel.
    pub jitters: u32,
    /// Each camera ray gets as many samples as its error asks for, and all together as many as without.
    pub adaptive: bool,
    /// When it ends, `samples` at the latest.
    pub goal: Goal,
    /// Samples of a dispatch, where the scheduler should not choose (tests).
    pub block: Option<u32>,
}

impl Job {
    /// With what the job tells of the rays to come.
    pub fn wishes(&self, wishes: &Wishes) -> Wishes {
        let samples = (self.goal == Goal::Samples).then_some(self.samples.len() as u32);
        Wishes { samples, bounded: self.max_distance.is_some(), ..*wishes }
    }

    pub fn tiles(&self) -> Tiles {
        Tiles { width: self.size.0, height: self.size.1, jitters: self.jitters }
    }
}

/// What an experiment changes in how a plan is carried out. Renders leave it alone.
#[derive(Clone, Debug, Default)]
pub struct Tuning {
    /// Samples of an invocation of `split`, at least; otherwise the kind of device decides.
    pub block: Option<u32>,
    /// The host waits for each dispatch before it hands over the next.
    pub waits_between: bool,
    /// Bytes in the place of the triangle array, at least as many.
    pub triangles: Option<Vec<u8>>,
    /// Nothing is cut for the driver's limit on loops, and rays that did not come to their end are left out: what a
    /// renderer does that knows of neither.
    pub unguarded: bool,
}

/// Plain data that an executor turns into pixels.
#[derive(Clone)]
pub struct Plan<'a> {
    pub job: Job,
    pub settings: Settings,
    pub tiles: Tiles,
    pub frame: Frame,
    /// The largest coordinate that a ray's origin may have, device units: boxes are grown for that (see [`Self::with_reach`]).
    pub reach: f64,
    /// The same of any-hit rays, which in a render start at surfaces, not at the eye.
    pub any_reach: f64,
    /// Rows of `kernels.txt`, in the order of [`Passes`]' steps.
    pub kernels: Vec<&'static Kernel>,
    /// Specialization constants: (id, value).
    pub constants: Vec<(u32, u32)>,
    /// How those kernels read geometry that can (see [`kernel_by`]).
    pub accessor: Accessor,
    pub geometry: &'a Geometry,
    /// The triangles as the watertight intersector takes them, where it is chosen.
    pub corners: Option<&'a [Corners]>,
    /// The triangles' faces, where a kernel reads faces and the intersector allows them; otherwise their number is 0.
    pub faces: Option<Vec<pack::Pair>>,
    pub tuning: Tuning,
}

/// The original's fixed offset along the normal, units of the file.
const FIXED_OFFSET: f64 = 0.01;
/// The scaled offset as a part of the scene's diagonal.
const SCALED_OFFSET: f64 = 1e-4;
/// The original's longest ambient ray, units of the file.
const ORIGINAL_LIMIT: f64 = 1000.0;

impl<'a> Plan<'a> {
    /// Puts a plan together; refuses what the choices or the device's limits rule out.
    pub fn new(
        job: Job,
        scene: &Scene,
        geometry: &'a Geometry,
        decision: &Decision,
        limits: &Limits,
    ) -> Result<Self> {
        let settings = decision.settings;
        check_job(&job, &settings, limits)?;
        let original = settings.preset.is_original();
        let kernels = kernels_of(&settings, decision.accessor)?;
        let tiles = job.tiles();
        let frame = frame(&job, &settings, scene, geometry);
        if !original {
            check_frame(&frame)?;
        }
        check_brute(&settings, &frame, limits)?;
        let plan = Self {
            reach: reach_of(&frame),
            any_reach: surface_reach(&frame),
            frame,
            accessor: accessor_of(&kernels, decision.accessor),
            kernels,
            constants: specialize::constants(&job, &settings, geometry, decision, &frame),
            job,
            settings,
            tiles,
            geometry,
            corners: (settings.intersector == Intersector::Watertight).then(|| geometry.corners(&scene.mesh)),
            tuning: Tuning::default(),
            faces: None,
        };
        let reads_faces = plan.node_layout() == NodeLayout::Faces
            && plan.settings.intersector == Intersector::Conservative
            && plan.settings.slabs == Slabs::Robust
            && !original
            && geometry.triangles.len() <= pack::MOST_FACES;
        let plan = Self { faces: reads_faces.then(|| pack::pairs(geometry.corners(&scene.mesh))), ..plan };
        let plan = if plan.finds_edges() { plan.with_constant(layout::SPEC_SAMPLE_LANES, 1) } else { plan };
        plan.check_buffers(scene, limits)?;
        Ok(plan)
    }

    /// For rays that start farther away than those of the plan's own render, lists of them: no coordinate of an origin
    /// exceeds `reach`, device units. The watertight intersector, methods that fuse boxes (of rays that ask for any hit) and faces need to know.
    pub fn with_reach(mut self, reach: f64, any_hits: bool) -> Self {
        if any_hits {
            self.any_reach = self.any_reach.max(reach);
        }
        if reach > self.reach {
            self.reach = reach;
            if self.corners.is_some() {
                self.frame.box_pad = pack::watertight_pad(self.frame.largest, reach);
            }
        }
        self
    }

    /// Refuses rays whose hits the boxes could lose; those that ask for any hit, or for the closest.
    pub fn check_reach(&self, reach: f64, any_hits: bool) -> Result<()> {
        // Origins are sums that round; the pad has room for that.
        let mut made_for = f64::INFINITY;
        if self.corners.is_some() {
            made_for = self.reach;
        }
        if any_hits && self.settings.method.fuses_boxes() {
            made_for = made_for.min(self.any_reach);
        }
        if reach <= made_for * (1.0 + 1e-6) {
            return Ok(());
        }
        Err(Error::other(format!(
            "Rays start {reach:e} device units from the scene's centre along an axis, and the plan was made for {:e} at most.",
            made_for
        )))
    }

    /// Rays of an invocation that share their way through the tree.
    pub fn rays_together(&self) -> u32 {
        // What steps a state or weighs its rays takes one after the other.
        let one_by_one = self.settings.sampler == Sampler::Lcg || self.settings.preset.is_original();
        if one_by_one { 1 } else { self.settings.method.rays_together() }
    }

    /// By how much the boxes of faces are grown, and how far a start may lie from a corner along an axis.
    pub fn face_measures(&self) -> Option<(f32, f64)> {
        let Frame { box_pad, largest, .. } = self.frame;
        let pad = pack::beam_pad(box_pad, largest, self.reach.max(self.any_reach));
        self.faces.as_ref().map(|_| (pad, f64::from(largest) + self.any_reach))
    }

    /// Whether the edges of faces are found for many rays at a time.
    pub fn finds_edges(&self) -> bool {
        self.faces.is_some() && self.frame.ambient_t_max == f32::MAX && self.settings.sampler != Sampler::Lcg
    }

    /// Invocations that share a pixel's samples.
    pub fn sample_lanes(&self) -> u32 {
        self.constants.iter().find(|(id, _)| *id == layout::SPEC_SAMPLE_LANES).map_or(1, |(_, lanes)| *lanes)
    }

    /// Another job of the same picture: other samples, another number of camera rays a pixel, or as many samples for all.
    pub fn with_job(mut self, job: Job) -> Self {
        self.frame = Frame { sample_base: job.samples.start, jitters: job.jitters, ..self.frame };
        self.tiles = job.tiles();
        let constants = specialize::constants_of_job(&job, &self.settings);
        self.job = job;
        constants.into_iter().fold(self, |plan, (id, value)| plan.with_constant(id, value))
    }

    /// With another value of a specialization constant.
    pub fn with_constant(mut self, id: u32, value: u32) -> Self {
        self.constants.retain(|(known, _)| *known != id);
        self.constants.push((id, value));
        self
    }

    /// `split` whose ambient kernel is that of this name and adds to the pixels' counts by itself, so that nothing is
    /// left to resolve. Only for `count`.
    pub fn with_adding_kernel(mut self, name: &str) -> Result<Self> {
        let kernel = find_kernel(name)?;
        match (self.settings.passes, self.settings.accumulator, &self.kernels[..]) {
            (Passes::Split, Accumulator::Count, &[primary, list, ..]) => {
                self.kernels = vec![primary, list, kernel];
                Ok(self.with_constant(layout::SPEC_SAMPLE_LANES, 1))
            }
            _ => {
                Err(Error::other(format!("{name} works with --passes split and --accumulator count alone.")))
            }
        }
    }

    /// Whether pixels whose rays did not all come to their end can be taken up again: their counts must tell which
    /// sample comes next.
    pub fn resumes(&self) -> bool {
        let adds_anywhere = self.settings.passes == Passes::Split && self.kernels.len() == 3;
        self.settings.accumulator == Accumulator::Count && !adds_anywhere
    }

    /// Whether pixels whose camera ray hits nothing are passed over by all dispatches but the first. The original went
    /// on with them, and running means have no room for the mark.
    pub fn marks_misses(&self) -> bool {
        let counts = self.settings.accumulator == Accumulator::Count;
        counts
            && !self.settings.preset.is_original()
            && self.constants.contains(&(layout::SPEC_MARKS_MISSES, 1))
    }

    pub fn brute(&self) -> bool {
        self.settings.method == Method::Brute
    }

    /// Whether nodes and triangles are texel buffers.
    pub fn texels(&self) -> bool {
        self.accessor == Accessor::TexelBuffer
    }

    /// The accessor's name in `kernels.txt`.
    pub fn accessor_name(&self) -> &'static str {
        self.accessor.name()
    }

    /// The triangles as the kernel reads them.
    pub fn triangle_bytes(&self) -> &[u8] {
        let own = match self.corners {
            Some(corners) => bytemuck::cast_slice(corners),
            None => bytemuck::cast_slice(&self.geometry.triangles),
        };
        self.tuning.triangles.as_deref().filter(|other| other.len() >= own.len()).unwrap_or(own)
    }

    /// The tree's nodes as the kernel reads them, bytes; for `brute`, which reads none, the faces, or a word.
    pub fn node_bytes(&self) -> Vec<u8> {
        if let (Some(pairs), Some((pad, size))) = (&self.faces, self.face_measures()) {
            return bytemuck::cast_slice(&pack::faces(pairs, &self.geometry.triangles, pad, size)).to_vec();
        }
        pack::node_bytes(self.node_layout(), &self.geometry.tree, self.geometry.collapsed(), self.node_pad())
    }

    /// Bytes of what [`Self::node_bytes`] gives, or more.
    pub fn node_array_bytes(&self) -> u64 {
        if let Some(pairs) = &self.faces {
            return (pairs.len() as u64 + 1) * size_of::<layout::Face>() as u64;
        }
        pack::node_array_bytes(self.node_layout(), &self.geometry.tree, self.geometry.collapsed())
    }

    /// How the kernels that traverse want the tree.
    pub fn node_layout(&self) -> NodeLayout {
        let mut layouts = self.kernels.iter().map(|kernel| kernel.nodes);
        match layouts.find(|layout| *layout != NodeLayout::None) {
            Some(NodeLayout::Centred) if self.constants.contains(&(layout::SPEC_COMPACT, 1)) => {
                NodeLayout::Compact
            }
            layout => layout.unwrap_or(NodeLayout::None),
        }
    }

    /// Whether its kernels write what each pixel's rays cost.
    pub fn counts_work(&self) -> bool {
        let writes =
            |kernel: &&Kernel| kernel.bindings.iter().any(|(binding, _)| *binding == layout::BINDING_WORK);
        self.kernels.iter().any(writes)
    }

    /// The kernel that a single pass consists of.
    pub fn kernel(&self) -> &'static Kernel {
        self.kernels[0]
    }

    /// Entries that a ray's stack can need; 0 without a stack.
    pub fn stack_bound(&self) -> u32 {
        self.geometry.stack_bound_of(self.settings.method)
    }

    /// By how much the boxes of nodes are grown on every side, device units.
    pub fn node_pad(&self) -> f32 {
        match (self.settings.method, self.settings.slabs) {
            (method, _) if method.fuses_boxes() => {
                pack::grown_pad(self.frame.box_pad, self.frame.largest, self.any_reach)
            }
            (_, Slabs::Robust) => self.frame.box_pad,
            (_, Slabs::Plain) => 0.0,
        }
    }

    fn check_buffers(&self, scene: &Scene, limits: &Limits) -> Result<()> {
        let node_bytes = self.node_array_bytes();
        let triangle_bytes = self.triangle_bytes().len() as u64;
        let limit = if self.texels() { limits.texel_elements * 16 } else { limits.storage_buffer_bytes };
        let largest = node_bytes.max(triangle_bytes);
        if largest > limit {
            return Err(Error::input(format!(
                "{} has {} triangles, which take a buffer of {} MB where this device reads at most {} MB with {}: \
                 choose another --method or device, or a smaller scene.",
                scene.path,
                self.geometry.triangles.len(),
                largest / 1_000_000,
                limit / 1_000_000,
                self.settings.method
            )));
        }
        Ok(())
    }
}

/// The file in shaders/traverse/ and node layout of these choices, as in the names of kernels.
pub fn traversal_name(settings: &Settings) -> &'static str {
    let of_original = settings.preset.is_original() && settings.method == Method::Threaded;
    if of_original { "threaded48" } else { settings.method.family() }
}

/// The row of `kernels.txt` with this name and accessor. Rows by address are there only where they pay (each costs
/// time to build): without one, the kernel is that of storage buffers. Both may read the same buffers, so that the
/// kernels of one plan may differ in it.
pub fn kernel_by(name: &str, accessor: Accessor) -> Result<&'static Kernel> {
    let row = |accessor: Accessor| find_kernel(&format!("{name}/{accessor}"));
    match accessor {
        Accessor::Address => row(accessor).or_else(|_| row(Accessor::StorageBuffer)),
        Accessor::StorageBuffer | Accessor::TexelBuffer => row(accessor),
    }
}

/// The accessor that `kernels` have, which [`kernel_by`] found for this one: storage buffers if none reads by address.
pub fn accessor_of(kernels: &[&Kernel], accessor: Accessor) -> Accessor {
    match accessor {
        Accessor::Address if !kernels.iter().any(|kernel| kernel.by_address) => Accessor::StorageBuffer,
        _ => accessor,
    }
}

/// The rows of `kernels.txt` for these choices, in the order of the steps that `passes.rs` records.
pub fn kernels_of(settings: &Settings, accessor: Accessor) -> Result<Vec<&'static Kernel>> {
    let (traversal, sum) = (traversal_name(settings), settings.accumulator);
    let reading = |name: String| kernel_by(&name, accessor);
    Ok(match settings.passes {
        Passes::Single => vec![reading(format!("ambient/{traversal}/{sum}"))?],
        Passes::Split => vec![
            reading(format!("primary/{traversal}"))?,
            find_kernel(&format!("list/{sum}"))?,
            reading(format!("ambient_list/{traversal}"))?,
            find_kernel(&format!("resolve/{sum}"))?,
        ],
        Passes::Staged => vec![
            find_kernel("rays/camera")?,
            reading(format!("trace/{traversal}"))?,
            find_kernel(&format!("list/{sum}"))?,
            reading("rays/listed".into())?,
            reading(format!("trace/{traversal}"))?,
            find_kernel(&format!("resolve/answers/{sum}"))?,
        ],
    })
}

fn frame(job: &Job, settings: &Settings, scene: &Scene, geometry: &Geometry) -> Frame {
    let model = match settings.preset {
        Preset::Auto => RayModel::Eye,
        Preset::Original => RayModel::NearToFar,
        Preset::OriginalUnbiased => RayModel::CentredNearToFar,
    };
    frame_of(job, settings, scene, geometry, model)
}

/// The largest coordinate of a point that a render's rays start from: the eye, or a point moved off its surface (by
/// 2^-15 of the largest coordinate, if by ulps: twice that is granted).
fn reach_of(frame: &Frame) -> f64 {
    let most = |v: [f32; 3]| f64::from(glam::Vec3::from(v).abs().max_element());
    let eye = most(frame.origin)
        + most(frame.origin_dx) * f64::from(frame.width)
        + most(frame.origin_dy) * f64::from(frame.height);
    eye.max(surface_reach(frame))
}

/// The same of rays that start at surfaces.
fn surface_reach(frame: &Frame) -> f64 {
    f64::from(frame.largest) * (1.0 + 2f64.powi(-14)) + f64::from(frame.offset)
}

/// The frame of a render whose camera rays follow `model`.
pub fn frame_of(
    job: &Job,
    settings: &Settings,
    scene: &Scene,
    geometry: &Geometry,
    model: RayModel,
) -> Frame {
    let original = settings.preset.is_original();
    let placement = &geometry.placement;
    let rays = job.camera.rays(&scene.bounds, placement, job.size, model);
    let offset = match settings.offset {
        Offset::Fixed => FIXED_OFFSET,
        Offset::Scaled => SCALED_OFFSET * scene.bounds.diagonal(),
        Offset::Ulp => 0.0,
    };
    let longest = match job.max_distance {
        Some(distance) if original => Some(distance.min(ORIGINAL_LIMIT)),
        None if original => Some(ORIGINAL_LIMIT),
        distance => distance,
    };
    let vector = |v: glam::DVec3| v.as_vec3().to_array();
    let mut frame = Frame {
        origin: vector(rays.origin[0]),
        camera_t_max: rays.t_max as f32,
        origin_dx: vector(rays.origin[1]),
        width: job.size.0,
        origin_dy: vector(rays.origin[2]),
        height: job.size.1,
        direction: vector(rays.direction[0]),
        offset: placement.length(offset) as f32,
        direction_dx: vector(rays.direction[1]),
        ambient_t_max: longest.map_or(f32::MAX, |longest| placement.length(longest) as f32),
        direction_dy: vector(rays.direction[2]),
        seed: job.seed,
        node_count: geometry.tree.nodes.len() as u32,
        triangle_count: geometry.triangles.len() as u32,
        pixel_shift: rays.pixel_shift as f32,
        box_pad: geometry.box_pad,
        sample_base: job.samples.start,
        jitters: job.jitters,
        pixels: job.tiles().padded_pixels() as u32,
        largest: geometry.largest(),
        // The stage fills in addresses.
        ..Frame::default()
    };
    if settings.intersector == Intersector::Watertight {
        frame.box_pad = pack::watertight_pad(frame.largest, reach_of(&frame));
    }
    frame
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kernels_without_a_row_by_address_read_storage_buffers() {
        let named = |name| kernel_by(name, Accessor::Address).map(|kernel| kernel.name);
        assert_eq!(named("ambient_list/entry").unwrap(), "ambient_list/entry/address");
        assert_eq!(named("ambient/wide/count").unwrap(), "ambient/wide/count/address");
        for stem in ["ambient/wide/rgba8", "trace/entry", "primary/threaded", "work/brute", "rays/listed"] {
            assert_eq!(named(stem).unwrap(), format!("{stem}/ssbo"));
        }
        assert!(named("primary/none").is_err());
        assert!(kernel_by("ambient/threaded48/count", Accessor::TexelBuffer).is_err(), "no other for texels");
        let found = ["trace/entry", "primary/entry"].map(|name| kernel_by(name, Accessor::Address).unwrap());
        assert_eq!(accessor_of(&found, Accessor::Address), Accessor::Address);
        assert_eq!(accessor_of(&found[..1], Accessor::Address), Accessor::StorageBuffer);
        assert_eq!(accessor_of(&found[..1], Accessor::TexelBuffer), Accessor::TexelBuffer);
    }
}
