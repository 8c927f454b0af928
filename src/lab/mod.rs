//! Experiments, one a file. They see plans and records, never a handle of an API.

pub mod bench;
pub mod chart;
pub mod claims;
pub mod compare;
pub mod figure;
pub mod ghosts;
pub mod interleave;
pub mod scaling;
pub mod scenes;
pub mod stability;
pub mod statistics;
