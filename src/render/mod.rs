//! A render as plain data (which kernel, which buffers, which pixels and samples) and its execution.

mod adaptive;
pub mod auto;
mod band;
pub mod builder;
mod check;
pub mod choices;
pub mod clock;
pub mod execute;
pub mod frames;
pub mod geometry;
pub mod passes;
pub mod picture;
pub mod plan;
pub mod preview;
pub mod raylist;
pub mod repeat;
pub mod retrace;
pub mod rounds;
pub mod schedule;
pub mod seeds;
pub mod spans;
pub mod specialize;
pub mod stage;
pub mod tally;
pub mod tiles;
pub mod twin;
pub mod work;
