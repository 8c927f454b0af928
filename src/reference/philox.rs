//! Philox2x32-10 of Salmon et al., "Parallel Random Numbers: As Easy as 1, 2, 3" (2011), which passes every test of
//! BigCrush. Twin of shaders/shared/philox.glsl.

use glam::Vec2;

use super::Inputs;
use super::rng::unit_floats;

/// Two words for each counter and key.
pub fn philox2x32(mut counter: [u32; 2], mut key: u32) -> [u32; 2] {
    for _ in 0..10 {
        let product = u64::from(counter[0]) * 0xd256_d193;
        counter = [(product >> 32) as u32 ^ key ^ counter[1], product as u32];
        key = key.wrapping_add(0x9e37_79b9);
    }
    counter
}

pub fn philox_numbers(inputs: &Inputs, pixel: u32, sample: u32) -> Vec2 {
    unit_floats(philox2x32([pixel, sample], inputs.frame.seed))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The authors' own (Random123, `kat_vectors`): zeros, ones, and digits of pi.
    #[test]
    fn philox_gives_the_published_answers() {
        for (counter, key, answer) in [
            ([0, 0], 0, [0xff1d_ae59, 0x6cd1_0df2]),
            ([u32::MAX, u32::MAX], u32::MAX, [0x2c3f_628b, 0xab4f_d7ad]),
            ([0x243f_6a88, 0x85a3_08d3], 0x1319_8a2e, [0xdd7c_e038, 0xf62a_4c12]),
        ] {
            assert_eq!(philox2x32(counter, key), answer, "{counter:x?} {key:x}");
        }
    }
}
