//! Running means that go on after the camera has moved.

use crate::error::Result;
use crate::render::picture::{Accumulated, Picture};
use crate::render::plan::Plan;
use crate::render::repeat::Repeated;
use crate::render::stage::Stage;
use crate::vk::Device;

/// The picture after `frames` frames of one plan and as many of another whose frames go on with the first's means: a move of
/// the camera without a reset. The second plan's samples must begin where the first's frames end.
pub fn without_reset(device: &Device, first: &Plan<'_>, second: &Plan<'_>, frames: u32) -> Result<Picture> {
    let before = Stage::new(device, first)?;
    run(&before, frames)?;
    let mut stage = Stage::new(device, second)?;
    stage.take_means_of(before);
    run(&stage, frames)?;
    Ok(Picture::new(second.tiles, &Accumulated::Means(stage.means()?.unwrap_or_default())))
}

fn run(stage: &Stage<'_>, frames: u32) -> Result<()> {
    let mut repeated = Repeated::new(stage)?;
    for _ in 0..frames {
        repeated.frame()?;
    }
    Ok(())
}
