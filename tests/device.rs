//! The device layer's own watchfulness: what the other tests rely on must be able to fail.

mod common;

use std::time::Instant;

use cousu::kernels::find_kernel;
use cousu::layout::{BINDING_HITS, CLOCK_GROUPS, CLOCK_STEPS, WORKGROUP_SIZE};
use cousu::render::clock::ClockProbe;
use cousu::vk::{
    Access, Adapter, Batch, Binding, Buffer, BufferUse, Calibration, Device, DeviceKind, Hazard, Instance,
    Pipeline,
};

fn open() -> (Instance, Device) {
    let instance = Instance::new(true).expect("Vulkan with the validation layer");
    let adapters = instance.adapters().expect("a list of devices");
    let device = Device::open(&instance, Adapter::choose(&adapters, None).unwrap()).unwrap();
    (instance, device)
}

#[test]
fn a_leaked_allocation_is_named() {
    let (_instance, device) = open();
    let kept = Buffer::new(&device, "kept", BufferUse::Storage, 64).unwrap();
    std::mem::forget(Buffer::new(&device, "leaked", BufferUse::Storage, 64).unwrap());
    drop(kept);
    assert_eq!(device.allocations(), ["leaked"]);
}

/// Two copies into one buffer, with and without the barrier between them: synchronization validation must
/// see the difference.
#[test]
fn a_missing_barrier_is_noticed() {
    for with_barrier in [true, false] {
        let (instance, device) = open();
        let from = Buffer::new(&device, "from", BufferUse::Storage, 256).unwrap();
        let to = Buffer::new(&device, "to", BufferUse::Storage, 256).unwrap();
        let mut batch = Batch::new(&device, 0).unwrap();
        batch.copy(&from, &to, 0, 256);
        if with_barrier {
            batch.barrier(&[Hazard::Buffer(&to, Access::TransferWrite, Access::TransferWrite)]);
        }
        batch.copy(&from, &to, 0, 256);
        batch.submit().unwrap();
        batch.wait().unwrap();
        let messages = instance.messages();
        assert_eq!(messages.is_empty(), with_barrier, "{messages:?}");
        assert!(with_barrier || messages[0].contains("SYNC-HAZARD-WRITE"), "{messages:?}");
    }
}

#[test]
fn devices_come_best_first_and_are_chosen_by_number_or_name() {
    let (instance, _device) = open();
    let adapters = instance.adapters().unwrap();
    assert!(adapters.windows(2).all(|pair| pair[0].kind <= pair[1].kind));
    assert!(DeviceKind::Discrete < DeviceKind::Integrated && DeviceKind::Integrated < DeviceKind::Cpu);
    let name = |wanted| Adapter::choose(&adapters, wanted).map(|adapter| adapter.name.clone()).ok();
    let first = adapters[0].name.clone();
    assert_eq!(name(Some("0")), Some(first.clone()));
    let part = first[1..6].to_uppercase();
    assert_eq!(name(Some(&part)), Some(first));
    assert_eq!(name(Some("no such device")), None);
}

/// What an invocation of the clock probe computes.
fn probe_step(invocation: u32) -> u32 {
    (0..CLOCK_STEPS).fold(invocation, |state, _| {
        let state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        state ^ state >> 16
    })
}

#[test]
fn the_clock_probe_does_all_its_work_and_tells_its_time() {
    common::with_device(|device| {
        let probe = ClockProbe::new(device).unwrap();
        let times: Vec<f64> = (0..3).map(|_| probe.measure().unwrap()).collect();
        assert!(times.iter().all(|&ms| ms > 0.0 && ms < 60e3), "{times:?}");
        let results = probe.results().unwrap();
        let count = CLOCK_GROUPS * WORKGROUP_SIZE;
        assert_eq!(results.len(), count as usize);
        for invocation in [0, 1, 777, count - 1] {
            assert_eq!(results[invocation as usize], probe_step(invocation));
        }
    });
}

/// The second device that raises the clock comes and goes while the first one works.
#[test]
fn the_clock_is_raised_beside_work() {
    common::with_device(|device| {
        let probe = ClockProbe::new(device).unwrap();
        std::thread::scope(|scope| {
            let raising = scope.spawn(|| (0..4).for_each(|_| device.raise_clock()));
            probe.measure().unwrap();
            while !raising.is_finished() {
                probe.measure().unwrap();
            }
        });
        let results = probe.results().unwrap();
        for invocation in [0, 1, 777, CLOCK_GROUPS * WORKGROUP_SIZE - 1] {
            assert_eq!(results[invocation as usize], probe_step(invocation));
        }
    });
}

/// A kernel writes 1 word an invocation, so the words that are not 0 tell how many workgroups ran.
#[test]
fn indirect_dispatches_read_their_workgroups_from_a_buffer() {
    common::with_device(|device| {
        let pipeline = Pipeline::new(device, find_kernel("clock/probe").unwrap(), &[], 0).unwrap();
        let results = Buffer::with_content(device, "results", BufferUse::Storage, &[0; 4 * 64 * 8]).unwrap();
        let bound = pipeline.bind(&[(BINDING_HITS, Binding::Buffer(&results))]).unwrap();
        let numbers: [u32; 7] = [9, 9, 9, 9, 3, 1, 1];
        let from =
            Buffer::with_content(device, "numbers", BufferUse::Storage, bytemuck::cast_slice(&numbers))
                .unwrap();
        let groups = Buffer::new(device, "groups", BufferUse::Indirect, from.bytes()).unwrap();
        let mut batch = Batch::new(device, 1).unwrap();
        batch.copy(&from, &groups, 0, from.bytes());
        batch.barrier(&[Hazard::Buffer(&groups, Access::TransferWrite, Access::IndirectRead)]);
        for offset in [2, 20, u64::MAX] {
            assert!(batch.dispatch_indirect(&bound, &[], &groups, offset, "outside").is_err(), "{offset}");
        }
        assert!(batch.dispatch_indirect(&bound, &[], &from, 16, "not made for it").is_err());
        batch.dispatch_indirect(&bound, &[], &groups, 16, "probe").unwrap();
        batch.submit().unwrap();
        let finished = batch.wait().unwrap();
        assert_eq!(finished.timings.len(), 1);
        let words: Vec<u32> = bytemuck::pod_collect_to_vec(&results.read(device).unwrap());
        let expected: Vec<u32> = (0..64 * 8).map(|i| if i < 3 * 64 { probe_step(i) } else { 0 }).collect();
        assert!(words == expected);
    });
}

/// Registers and the like are there where the device tells them, and asking does no harm where it doesn't.
#[test]
fn statistics_are_told_only_by_kernels_that_were_made_for_it() {
    common::with_device(|device| {
        let kernel = find_kernel("clock/probe").unwrap();
        assert_eq!(Pipeline::new(device, kernel, &[], 0).unwrap().statistics().unwrap(), None);
        let pipeline = Pipeline::with_statistics(device, kernel, &[], 0).unwrap();
        let statistics = pipeline.statistics().unwrap();
        let offered = device.adapter().features.contains(&("pipeline statistics", true));
        assert_eq!(statistics.is_some(), offered);
        assert!(statistics.is_none_or(|statistics| !statistics.raw.is_empty()));
    });
}

#[test]
fn device_times_lie_between_the_hosts() {
    common::with_device(|device| {
        let offered = device.adapter().features.contains(&("calibrated timestamps", true));
        let calibration = Calibration::new(device).unwrap();
        assert_eq!(calibration.is_some(), offered && device.adapter().timestamps.is_some());
        let Some(mut calibration) = calibration else { return };
        let origin = Instant::now();
        let pipeline = Pipeline::new(device, find_kernel("clock/probe").unwrap(), &[], 0).unwrap();
        let results = Buffer::new(device, "results", BufferUse::Storage, 4 * 64 * 64).unwrap();
        let bound = pipeline.bind(&[(BINDING_HITS, Binding::Buffer(&results))]).unwrap();
        let mut batch = Batch::new(device, 1).unwrap();
        batch.dispatch(&bound, &[], [64, 1, 1], "probe");
        batch.submit().unwrap();
        let finished = batch.wait().unwrap();
        calibration.again(device).unwrap();
        let timing = &finished.timings[0];
        let place = |ns: Option<u64>| calibration.host_ns(ns.unwrap(), origin);
        let (start, end) = (place(timing.start_ns), place(timing.end_ns));
        let slack = 1e6 + calibration.deviation_ns() as f64;
        let host = |moment: Instant| (moment - origin).as_secs_f64() * 1e9;
        assert!(host(finished.host.submit) - slack <= start, "{start} {:?}", finished.host);
        assert!(start <= end && end <= host(finished.host.waited) + slack, "{end} {:?}", finished.host);
        assert!((timing.gpu_ms.unwrap() - (end - start) * 1e-6).abs() < 1e-3);
    });
}
