//! Results as files: one output format a file.

pub mod atomic;
pub mod bench;
pub mod exr;
pub mod heatmap;
pub mod manifest;
pub mod png;
pub mod record;
pub mod trace;
