//! The device layer's own watchfulness: what the other tests rely on must be able to fail.

use cousu::vk::{Access, Adapter, Batch, Buffer, BufferUse, Device, DeviceKind, Hazard, Instance};

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
