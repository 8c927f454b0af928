//! Frames on OpenGL.

use super::{Frames, check, groups_of, range_of};
use crate::error::{Error, Result};
use crate::gl::{Buffer, BufferTarget, Clock, Context, Image, Program, TimerKind};
use crate::layout::{self, Counters};
use crate::render::choices::Accumulator;
use crate::render::plan::Plan;
use crate::render::seeds::lcg_seeds;
use crate::render::tally::Totals;

/// Workgroups that every OpenGL 4.3 takes in one dispatch.
const MOST_GROUPS: u32 = 65_535;

/// What the frames of a plan work on.
pub struct OpenGlFrames<'a> {
    plan: &'a Plan<'a>,
    program: Program,
    clock: Clock,
    seeds: Buffer,
    range: Buffer,
    counters: Buffer,
    image: Image,
    _inputs: [Buffer; 4],
}

impl<'a> OpenGlFrames<'a> {
    /// The plan's accumulator must be an image and its accessor the storage buffer, as in the original.
    pub fn new(context: &Context, plan: &'a Plan<'a>) -> Result<Self> {
        if plan.kernel().glsl.is_empty() {
            return Err(Error::usage(format!(
                "{} needs subgroup operations, which OpenGL 4.3 does not have: choose other --methods.",
                plan.settings.method
            )));
        }
        let storage = |content: &[u8]| Buffer::new(context, BufferTarget::Storage, content);
        let uniform = |content: &[u8]| Buffer::new(context, BufferTarget::Uniform, content);
        let inputs = [
            uniform(bytemuck::bytes_of(&plan.frame))?,
            storage(&plan.node_bytes())?,
            storage(plan.triangle_bytes())?,
            storage(&[0; 32])?,
        ];
        let bindings =
            [layout::BINDING_FRAME, layout::BINDING_NODES, layout::BINDING_TRIANGLES, layout::BINDING_CARRY];
        for (buffer, binding) in inputs.iter().zip(bindings) {
            buffer.bind(binding);
        }
        let frames = Self {
            program: Program::new(context, plan.kernel(), &plan.constants)?,
            clock: Clock::new(context),
            seeds: storage(&[0; 16])?,
            range: uniform(bytemuck::bytes_of(&range_of(plan, 0)))?,
            counters: storage(&zero_counters())?,
            image: Image::new(context, plan.settings.accumulator == Accumulator::Rgba8, plan.job.size)?,
            plan,
            _inputs: inputs,
        };
        frames.write_seeds();
        frames.seeds.bind(layout::BINDING_SEEDS);
        frames.range.bind(layout::BINDING_RANGE);
        frames.counters.bind(layout::BINDING_COUNTERS);
        frames.image.bind(layout::BINDING_IMAGE);
        Ok(frames)
    }

    /// What times the frames.
    pub fn timer(&self) -> TimerKind {
        self.clock.kind()
    }

    fn write_seeds(&self) {
        let states = lcg_seeds(0, self.plan.tiles.padded_pixels() as u32, self.plan.job.seed);
        self.seeds.write(bytemuck::cast_slice(&states));
    }
}

fn zero_counters() -> Vec<u8> {
    vec![0; layout::COUNTER_SLOTS as usize * size_of::<Counters>()]
}

impl Frames for OpenGlFrames<'_> {
    fn frame(&mut self, number: u32) -> Result<f64> {
        self.range.write(bytemuck::bytes_of(&range_of(self.plan, number)));
        self.counters.write(&zero_counters());
        let elapsed = self.program.dispatch(groups_of(self.plan, MOST_GROUPS)?);
        check(self.plan, &Totals::of(&bytemuck::pod_collect_to_vec::<u8, Counters>(&self.counters.read()?)))?;
        Ok(self.clock.read(elapsed))
    }

    fn restart(&mut self) -> Result<()> {
        self.image.clear();
        self.write_seeds();
        Ok(())
    }

    fn image(&mut self) -> Result<Vec<[f32; 4]>> {
        Ok(self.image.read())
    }
}
