//! A headless OpenGL context and the little of OpenGL that the original used: compute programs, storage
//! buffers, an image, a timer. It knows nothing of rays or trees.

mod compute;
mod context;

pub use compute::{Buffer, BufferTarget, Elapsed, Image, Program, TimerKind};
pub use context::{Context, Preference};
