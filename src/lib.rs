//! cousu: the ambient light of triangle scenes by Vulkan compute, and a laboratory that measures every
//! way to traverse a triangle tree. ARCHITECTURE.md tells how the modules hang together.

pub mod bvh;
pub mod cache;
pub mod cli;
pub mod error;
pub mod gl;
pub mod kernels;
pub mod lab;
pub mod layout;
mod names;
pub mod pack;
pub mod reference;
pub mod render;
pub mod report;
pub mod scene;
pub mod vk;
