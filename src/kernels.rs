//! The rows of `shaders/kernels.txt`, compiled: SPIR-V for Vulkan, and the same text for OpenGL drivers.

use crate::error::{Error, Result};

/// What a binding of a kernel shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptorKind {
    UniformBuffer,
    StorageBuffer,
    StorageImage,
    UniformTexelBuffer,
}

/// How the nodes that a kernel reads are laid out: which of the tree's arrays it is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeLayout {
    /// It reads none.
    None,
    /// A box a node ([`crate::layout::Node`]).
    Single,
    Threaded,
    /// The original's threaded node.
    Threaded48,
    /// The boxes of both children.
    Pair,
    /// The same by their centres.
    Centred,
    /// The same in less room: what kernels for `Centred` are given where caches count for more than operations.
    Compact,
    /// Eight compressed children.
    Wide,
    /// Four children.
    Quad,
    /// No tree: triangles alone or in pairs ([`crate::layout::Face`]).
    Faces,
}

/// A row of `shaders/kernels.txt`.
#[derive(Debug)]
pub struct Kernel {
    pub name: &'static str,
    pub spirv: &'static [u8],
    /// GLSL for OpenGL 4.3; specialization constants stand in it as `SPECIALIZED(id)`. Empty where the kernel
    /// needs what OpenGL 4.3 does not have.
    pub glsl: &'static str,
    /// Bindings of set 0 that the kernel uses.
    pub bindings: &'static [(u32, DescriptorKind)],
    pub nodes: NodeLayout,
    /// Classes of subgroup operations that it uses: basic, vote, arithmetic, ballot, shuffle, quad.
    pub subgroup: &'static [&'static str],
    /// Whether it reads geometry by the buffers' device addresses.
    pub by_address: bool,
}

include!(concat!(env!("OUT_DIR"), "/kernels.rs"));

/// The kernel of this name in [`KERNELS`].
pub fn find_kernel(name: &str) -> Result<&'static Kernel> {
    KERNELS.iter().find(|kernel| kernel.name == name).ok_or_else(|| {
        Error::usage(format!(
            "There is no kernel for {name}: choose another combination of method, accumulator and accessor."
        ))
    })
}
