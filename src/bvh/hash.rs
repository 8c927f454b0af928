//! Pseudo-random numbers that are a function of their place.

/// 64 bits of a number: the finaliser of SplitMix64 (Steele, Lea and Flood, 2014) but for its last shift.
pub fn mixed(seed: u64) -> u64 {
    let z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb)
}

/// In [0, 1): the `dimension`th number (below 256) of a point, by its own number.
pub fn unit(number: u64, dimension: u64) -> f64 {
    (mixed(number << 8 | dimension) >> 11) as f64 * 2f64.powi(-53)
}
