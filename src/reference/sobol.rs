//! Owen-scrambled Sobol points, two dimensions. Twin of shaders/shared/sobol.glsl, which says why they look like this.

use std::ops::Range;

use glam::Vec2;

use super::Inputs;
use super::rng::{pcg4d, unit_floats};
use crate::layout::{KEY_SOBOL, SOBOL_CELL_BITS};

/// The index times Pascal's triangle modulo 2: the second dimension, its digits in reverse.
pub fn pascal_product(mut index: u32) -> u32 {
    index ^= (index >> 1) & 0x5555_5555;
    index ^= (index >> 2) & 0x3333_3333;
    index ^= (index >> 4) & 0x0f0f_0f0f;
    index ^= (index >> 8) & 0x00ff_00ff;
    index ^ (index >> 16)
}

/// Nested uniform scrambling of reversed digits: Owen (1995), Laine and Karras (2011), Burley (2020), Vegdahl (2021).
pub fn owen_scramble(mut digits: u32, seed: u32) -> u32 {
    digits ^= digits.wrapping_mul(0x3d20_adea);
    digits = digits.wrapping_add(seed);
    digits = digits.wrapping_mul((seed >> 16) | 1);
    digits ^= digits.wrapping_mul(0x0552_6c56);
    digits ^ digits.wrapping_mul(0x53a2_2864)
}

pub fn sobol_bits(index: u32, seeds: [u32; 2]) -> [u32; 2] {
    [
        owen_scramble(index, seeds[0]).reverse_bits(),
        owen_scramble(pascal_product(index), seeds[1]).reverse_bits(),
    ]
}

/// The largest net of 2^bits indices, from a multiple of that on, around this one in the set.
fn net_bits(index: u32, set: &Range<u32>) -> u32 {
    let bits = (index ^ set.end).ilog2();
    if set.start == 0 { bits } else { bits.min((index ^ (set.start - 1)).ilog2()) }
}

/// The first digits that scrambling turns into those of the cell.
fn unscrambled(cell: [u32; 2], seeds: [u32; 2]) -> [u32; 2] {
    let mut digits = [0, 0];
    for digit in 0..3 {
        for dimension in 0..2 {
            let turned = owen_scramble(digits[dimension], seeds[dimension]);
            digits[dimension] |= (turned ^ cell[dimension]) & (1 << digit);
        }
    }
    digits
}

/// The index of point `place` of a net of 2^bits points from `first` on, cell by cell of a grid of 4 x 8, or of as many cells as
/// points.
pub fn sobol_index(first: u32, place: u32, bits: u32, seeds: [u32; 2]) -> u32 {
    let cell_bits = bits.min(SOBOL_CELL_BITS);
    let inner = bits - cell_bits;
    let cell = place >> inner << (SOBOL_CELL_BITS - cell_bits);
    let digits = [cell >> 3 & 1 | cell & 2, cell >> 4 | cell >> 1 & 2 | cell << 2 & 4];
    let wanted = unscrambled(digits, seeds);
    let low = wanted[0] & ((1 << (cell_bits / 2)) - 1);
    let index = first + ((place & ((1 << inner) - 1)) << cell_bits) + low;
    let missing = pascal_product(index) ^ wanted[1];
    let digit = [missing & 1, missing >> 1 & 1, missing >> 2 & 1];
    index
        + match cell_bits {
            0 => 0,
            1 => digit[0],
            2 => digit[0] << 1,
            3 => digit[1] << 1 | (digit[0] ^ digit[1]) << 2,
            4 => digit[1] << 3 | (digit[0] ^ digit[1]) << 2,
            _ => digit[1] << 3 | (digit[2] ^ digit[1]) << 2 | (digit[0] ^ digit[2]) << 4,
        }
}

/// A pixel has two sequences under seeds of their own, one for each half of its samples.
pub fn sobol_numbers(inputs: &Inputs, pixel: u32, sample: u32, set: &Range<u32>) -> Vec2 {
    let [x, y, z, w] = pcg4d([pixel, 0, KEY_SOBOL, inputs.frame.seed]).map(|word| word.rotate_left(16));
    let seeds = if sample & 1 == 0 { [x, y] } else { [z, w] };
    let late = 1 - (sample & 1);
    let index = sample >> 1;
    let in_half = |sample: u32| (sample >> 1) + (sample & late);
    let bits = net_bits(index, &(in_half(set.start)..in_half(set.end)));
    let place = index & ((1 << bits) - 1);
    let index = sobol_index(index - place, place, bits, seeds);
    unit_floats(sobol_bits(index, seeds))
}

#[cfg(test)]
mod tests {
    use sobol_burley::parts::{owen_scramble_rev, sobol_rev};

    use super::*;
    use crate::reference::testing::Random;

    /// The parts of an implementation by others, which knows the first 2^16 indices: its direction numbers come from Joe
    /// and Kuo's table.
    #[test]
    fn the_first_indices_are_another_implementations() {
        let mut random = Random::new(50);
        let seeds = [random.bits(), random.bits()];
        for index in 0..1u32 << 16 {
            let expected = [0, 1].map(|dimension| {
                let digits = sobol_rev(index.reverse_bits(), dimension);
                owen_scramble_rev(digits, seeds[dimension as usize]).reverse_bits()
            });
            assert_eq!(sobol_bits(index, seeds), expected, "index {index}");
        }
        for _ in 0..100_000 {
            let (digits, seed) = (random.bits(), random.bits());
            assert_eq!(owen_scramble(digits, seed), owen_scramble_rev(digits, seed));
        }
    }

    /// Any index, against the sum over its bits j of binomial(j, r) modulo 2, from Pascal's own recurrence.
    #[test]
    fn the_second_dimension_is_pascals_triangle() {
        let mut triangle = [[0u32; 32]; 32];
        for j in 0..32 {
            triangle[j][0] = 1;
            for r in 1..=j {
                triangle[j][r] = (triangle[j - 1][r - 1] + triangle[j - 1][r]) & 1;
            }
        }
        let mut random = Random::new(51);
        for _ in 0..10_000 {
            let index = random.bits() >> random.below(32);
            let digit = |r: usize| (0..32).map(|j| (index >> j & 1) * triangle[j][r]).sum::<u32>() & 1;
            let expected = (0..32).map(|r| digit(r) << r).sum::<u32>();
            assert_eq!(pascal_product(index), expected, "index {index:#x}");
        }
    }

    /// What makes it nested: the digits of two numbers are turned alike down to the first in which they differ, and whether
    /// the next one is turned is as good as independent between them.
    #[test]
    fn a_digit_is_turned_by_those_above_it() {
        let mut random = Random::new(52);
        for depth in 0..24 {
            let mut unlike = 0;
            let count = 20_000;
            for _ in 0..count {
                let (digits, seed) = (random.bits(), random.bits());
                let other = digits ^ (1 << depth);
                let turned = owen_scramble(digits, seed) ^ digits;
                let turned_other = owen_scramble(other, seed) ^ other;
                assert_eq!((turned ^ turned_other) & ((2 << depth) - 1), 0, "as far as digit {depth}");
                unlike += (turned ^ turned_other) >> (depth + 1) & 1;
            }
            let off = (f64::from(unlike) / f64::from(count) - 0.5).abs();
            assert!(off < 0.05, "the digit after {depth} is unlike by {off} too often or too seldom");
        }
    }

    /// Every elementary interval of area 2^-m holds one of 2^m points: whole prefixes and later stretches.
    fn is_a_net(first: u32, m: u32, seeds: [u32; 2]) {
        let points: Vec<[u32; 2]> = (0..1u32 << m).map(|i| sobol_bits(first + i, seeds)).collect();
        let mut seen = vec![0u32; points.len()];
        for along in 0..=m {
            for [x, y] in &points {
                let cell =
                    (u64::from(*x) >> (32 - along) << (m - along)) | (u64::from(*y) >> (32 - (m - along)));
                assert!(seen[cell as usize] <= along, "two points of {first} + 2^{m} in one interval");
                seen[cell as usize] += 1;
            }
        }
        assert!(seen.iter().all(|&times| times == m + 1), "2^{m} points from {first} on");
    }

    #[test]
    fn every_prefix_of_a_power_of_two_is_a_net() {
        let mut random = Random::new(53);
        for m in 0..=18 {
            for _ in 0..if m < 12 { 8 } else { 1 } {
                is_a_net(0, m, [random.bits(), random.bits()]);
            }
        }
    }

    /// Beyond the indices that the other implementation knows, and up to the last that a pixel's half can have.
    #[test]
    fn later_stretches_are_nets_too() {
        let mut random = Random::new(54);
        for (first, m) in [(1 << 16, 16), (3 << 20, 12), (1 << 29, 12), ((1 << 30) - (1 << 14), 14)] {
            is_a_net(first, m, [random.bits(), random.bits()]);
        }
    }

    /// Each point once, and in the same cell for all seeds.
    #[test]
    fn a_net_can_be_taken_cell_by_cell() {
        let mut random = Random::new(55);
        let nets = [
            (0, 0),
            (7, 0),
            (6, 1),
            (12, 2),
            (8, 3),
            (48, 4),
            (0, 5),
            (32, 5),
            (0, 6),
            (3 << 9, 9),
            (1 << 20, 12),
        ];
        for (first, bits) in nets {
            let cell_bits = bits.min(SOBOL_CELL_BITS);
            for _ in 0..20 {
                let seeds = [random.bits(), random.bits()];
                let mut seen = vec![false; 1 << bits];
                for place in 0..1u32 << bits {
                    let index = sobol_index(first, place, bits, seeds);
                    assert!(!std::mem::replace(&mut seen[(index - first) as usize], true), "{index} twice");
                    let [x, y] = sobol_bits(index, seeds);
                    // From the first digits on, one of y and one of x in turn.
                    let digit = |word: u32, number: u32| word >> (31 - number) & 1;
                    let cell = [digit(y, 0), digit(x, 0), digit(y, 1), digit(x, 1), digit(y, 2)];
                    let cell = cell[..cell_bits as usize].iter().fold(0, |cell, digit| cell << 1 | digit);
                    assert_eq!(cell, place >> (bits - cell_bits), "{first} {bits} {place}");
                }
            }
        }
    }

    /// The nets of a set are its own, follow on one another and could not be larger.
    #[test]
    fn a_set_is_cut_into_its_largest_nets() {
        for begin in 0..70 {
            for end in begin + 1..140 {
                let mut index = begin;
                while index < end {
                    let bits = net_bits(index, &(begin..end));
                    let size = 1 << bits;
                    assert_eq!(index % size, 0, "{begin} to {end}");
                    assert!(index + size <= end, "{begin} to {end}");
                    assert!(index % (2 * size) != 0 || index + 2 * size > end, "{begin} to {end}: {index}");
                    assert!((index..index + size).all(|other| net_bits(other, &(begin..end)) == bits));
                    index += size;
                }
            }
        }
    }
}
