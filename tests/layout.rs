//! The shared records: what the host writes is what the shaders take apart, bit for bit.

mod common;

use cousu::kernels::find_kernel;
use cousu::layout::{BINDING_FRAME, BINDING_HITS, BINDING_NODES, Frame, RECORDS, Range};
use cousu::vk::{Batch, Binding, Buffer, BufferUse, Pipeline};

/// Words that no float conversion may touch: NaNs with payloads, denormals, infinities and random bits.
fn random_words(count: usize) -> Vec<u32> {
    let special = [0x7fc0_dead, 0xffa0_0001, 1, 0x8000_0000, 0x7f80_0000, 0x007f_ffff, u32::MAX, 0];
    (0..count)
        .map(|i| match i % 3 {
            0 => special[i / 3 % special.len()],
            _ => cousu::render::seeds::hash(i as u32, 99),
        })
        .collect()
}

#[test]
fn records_are_unpacked_bit_for_bit() {
    common::with_device(|device| {
        for (kernel, usage) in [
            ("records/ssbo", BufferUse::Storage),
            ("records/address", BufferUse::Addressed),
            ("records/texel", BufferUse::Texels),
        ] {
            let pipeline =
                Pipeline::new(device, find_kernel(kernel).unwrap(), &[], size_of::<Range>() as u32).unwrap();
            for (kind, record) in RECORDS.iter().enumerate() {
                let count = 1000u32;
                let words = random_words(count as usize * record.size / 4);
                let content: &[u8] = bytemuck::cast_slice(&words);
                let from = Buffer::with_content(device, "records", usage, content).unwrap();
                let address = from.address().unwrap_or(0);
                let [nodes_low, nodes_high] = [address as u32, (address >> 32) as u32];
                let frame = Frame { nodes_low, nodes_high, ..Frame::default() };
                let frame = Buffer::uniform(device, "frame", bytemuck::bytes_of(&frame)).unwrap();
                let to = Buffer::new(device, "copies", BufferUse::Storage, content.len() as u64).unwrap();
                let source = match usage {
                    BufferUse::Texels => Binding::Texels(&from),
                    _ => Binding::Buffer(&from),
                };
                let bound = pipeline
                    .bind(&[
                        (BINDING_FRAME, Binding::Buffer(&frame)),
                        (BINDING_NODES, source),
                        (BINDING_HITS, Binding::Buffer(&to)),
                    ])
                    .unwrap();
                let range = Range { pixel_end: count, stage: kind as u32, ..Range::default() };
                let mut batch = Batch::new(device, 1).unwrap();
                let groups = [count.div_ceil(64), 1, 1];
                batch.dispatch(&bound, bytemuck::bytes_of(&range), groups, record.name);
                batch.submit().unwrap();
                batch.wait().unwrap();
                let copied: Vec<u32> = bytemuck::pod_collect_to_vec(&to.read(device).unwrap());
                assert_eq!(copied, words, "{kernel} {}", record.name);
            }
        }
    });
}
