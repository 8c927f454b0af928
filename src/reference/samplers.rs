//! The pair of random numbers of a pixel's sample. Twin of shaders/shared/samplers.glsl.

use std::ops::Range;

use glam::Vec2;

use super::Inputs;
use super::philox::philox_numbers;
use super::rng::{lcg_float, lcg_step, pcg4d, unit_floats};
use super::sobol::sobol_numbers;
use super::strata::strata_numbers;
use crate::layout::{SAMPLER_LCG, SAMPLER_PHILOX, SAMPLER_SOBOL, SAMPLER_STRATA};

pub fn pcg_numbers(inputs: &Inputs, pixel: u32, sample: u32) -> Vec2 {
    let [x, y, ..] = pcg4d([pixel, sample, 0, inputs.frame.seed]);
    unit_floats([x, y])
}

/// `lcg` steps the state it is given, the others leave it alone. The samples of `set` are one set of strata.
pub fn sample_numbers(
    inputs: &Inputs,
    pixel: u32,
    sample: u32,
    set: &Range<u32>,
    lcg_state: &mut u32,
) -> Vec2 {
    match inputs.choices.sampler {
        SAMPLER_LCG => {
            let first = lcg_step(*lcg_state);
            *lcg_state = lcg_step(first);
            Vec2::new(lcg_float(first), lcg_float(*lcg_state))
        }
        SAMPLER_SOBOL => sobol_numbers(inputs, pixel, sample, set),
        SAMPLER_STRATA => strata_numbers(inputs, pixel, sample, set),
        SAMPLER_PHILOX => philox_numbers(inputs, pixel, sample),
        _ => pcg_numbers(inputs, pixel, sample),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{SAMPLER_PCG, Triangle};
    use crate::reference::testing::Scene;

    #[test]
    fn lcg_takes_two_numbers_a_sample_and_the_others_none() {
        let triangle = Triangle { ab: [1.0, 0.0, 0.0], ac: [0.0, 1.0, 0.0], ..Triangle::default() };
        let scene = Scene::of(vec![triangle]);
        let mut inputs = scene.inputs();
        let mut seen = Vec::new();
        for sampler in [SAMPLER_PCG, SAMPLER_SOBOL, SAMPLER_STRATA, SAMPLER_PHILOX] {
            inputs.choices.sampler = sampler;
            let mut state = 77;
            let u = sample_numbers(&inputs, 3, 4, &(0..8), &mut state);
            assert_eq!(state, 77, "sampler {sampler}");
            assert!(!seen.contains(&u), "sampler {sampler} is another one");
            seen.push(u);
        }
        assert_eq!(seen[0], pcg_numbers(&inputs, 3, 4));
        inputs.choices.sampler = SAMPLER_LCG;
        let mut state = 77;
        let u = sample_numbers(&inputs, 3, 4, &(0..8), &mut state);
        assert_eq!(state, lcg_step(lcg_step(77)));
        assert_eq!(u, Vec2::new(lcg_float(lcg_step(77)), lcg_float(state)));
    }
}
