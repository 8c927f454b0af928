//! How fast a device runs at the moment: the time of a fixed amount of arithmetic. A later measurement that is
//! longer than the shortest one tells that the device's clock fell, or that something else was at work on it.

use std::time::Instant;

use crate::error::Result;
use crate::kernels::find_kernel;
use crate::layout::{BINDING_HITS, CLOCK_GROUPS, WORKGROUP_SIZE};
use crate::vk::{Access, Batch, Binding, Buffer, BufferUse, Device, Hazard, Pipeline};

/// The probe, ready on a device.
pub struct ClockProbe<'a> {
    device: &'a Device,
    pipeline: Pipeline,
    results: Buffer,
}

impl<'a> ClockProbe<'a> {
    pub fn new(device: &'a Device) -> Result<Self> {
        let bytes = u64::from(CLOCK_GROUPS) * u64::from(WORKGROUP_SIZE) * size_of::<u32>() as u64;
        Ok(Self {
            pipeline: Pipeline::new(device, find_kernel("clock/probe")?, &[], 0)?,
            results: Buffer::new(device, "clock results", BufferUse::Storage, bytes)?,
            device,
        })
    }

    /// Device time of the probe, ms; the host's waiting time on a device without timestamps. The first one or two
    /// after a pause also show how the device wakes up.
    pub fn measure(&self) -> Result<f64> {
        self.measure_in_a_row(1)
    }

    /// Mean time of so many probes that follow one another without a pause, ms: a device that waits for the host in
    /// between may keep its clock low.
    pub fn measure_in_a_row(&self, probes: u32) -> Result<f64> {
        let kernel = self.pipeline.bind(&[(BINDING_HITS, Binding::Buffer(&self.results))])?;
        let probes = probes.max(1);
        let mut batch = Batch::new(self.device, probes)?;
        for _ in 0..probes {
            batch.barrier(&[Hazard::Buffer(&self.results, Access::ShaderWrite, Access::ShaderWrite)]);
            batch.dispatch(&kernel, &[], [CLOCK_GROUPS, 1, 1], kernel.name());
        }
        let start = Instant::now();
        batch.submit()?;
        let finished = batch.wait()?;
        let wall_ms = start.elapsed().as_secs_f64() * 1e3;
        let device_ms: Option<f64> = finished.timings.iter().map(|timing| timing.gpu_ms).sum();
        Ok(device_ms.unwrap_or(wall_ms) / f64::from(probes))
    }

    /// What the last measurement computed, one word an invocation.
    pub fn results(&self) -> Result<Vec<u32>> {
        Ok(bytemuck::pod_collect_to_vec(&self.results.read(self.device)?))
    }
}
