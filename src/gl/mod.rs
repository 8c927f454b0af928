//! A headless OpenGL context and the little of OpenGL that the original used: compute programs, storage
//! buffers, an image, a timer. It knows nothing of rays or trees.

mod compute;
mod context;
mod raster;

pub use compute::{Buffer, BufferTarget, Clock, Elapsed, Image, Program, TimerKind};
pub use context::{Context, Preference};
pub use raster::Raster;
