//! Pictures that show what an experiment is about.

use crate::render::picture::Picture;

/// A picture that shows what an experiment is about.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// What its file is called, without ending.
    pub name: String,
    pub width: u32,
    pub height: u32,
    /// Linear red, green and blue in [0, 1], row by row from the top.
    pub pixels: Vec<[f32; 3]>,
}

/// Failing pixels.
const MARK: [f32; 3] = [1.0, 0.0, 0.0];
/// The gap between two pictures.
const GAP: u32 = 4;

impl Figure {
    /// A failure beside the survivor, both in grey; the pixels in which the first fails are red. Small pictures are
    /// enlarged.
    pub fn of_failure(
        name: impl Into<String>,
        failing: &Picture,
        survivor: &Picture,
        fails: &[bool],
    ) -> Self {
        let (width, height) = (failing.width, failing.height);
        let side = (320 / width.max(1)).clamp(1, 16);
        let grey = |picture: &Picture, place: usize| [picture.light.get(place).copied().unwrap_or(0.0); 3];
        let place = |x: u32, y: u32| (y / side) as usize * width as usize + (x / side) as usize;
        let wide = width * side;
        let mut pixels = Vec::new();
        for y in 0..height * side {
            pixels.extend((0..wide).map(|x| {
                let place = place(x, y);
                if fails.get(place) == Some(&true) { MARK } else { grey(failing, place) }
            }));
            pixels.extend((0..GAP).map(|_| [1.0; 3]));
            pixels.extend((0..wide).map(|x| grey(survivor, place(x, y))));
        }
        Self { name: name.into(), width: 2 * wide + GAP, height: height * side, pixels }
    }

    /// Pictures of one size side by side.
    pub fn beside(
        name: impl Into<String>,
        (width, height): (u32, u32),
        panels: &[&dyn Fn(u32, u32) -> [f32; 3]],
    ) -> Self {
        let mut pixels = Vec::with_capacity(panels.len() * width as usize * height as usize);
        for y in 0..height {
            for panel in panels {
                pixels.extend((0..width).map(|x| panel(x, y)));
            }
        }
        Self { name: name.into(), width: width * panels.len() as u32, height, pixels }
    }
}
