//! First states of the lcg.

/// Hash of an index and a seed (Wellons' lowbias32 over both, 2018).
pub fn hash(index: u32, seed: u32) -> u32 {
    let mut x = index.wrapping_mul(0x9e37_79b9) ^ seed.wrapping_mul(0x85eb_ca6b).rotate_left(16);
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// States for the pixels from `begin` to `end`, by pixel number: 31 bits each. (The original took them
/// from the operating system.)
pub fn lcg_seeds(begin: u32, end: u32, seed: u32) -> Vec<u32> {
    (begin..end).map(|pixel| hash(pixel, seed) >> 1).collect()
}
