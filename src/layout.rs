//! The one definition of every record, binding and constant that shaders and host share.
//!
//! `build.rs` includes this file and writes the GLSL side from [`RECORDS`] and [`CONSTANTS`]: structs,
//! unpackers for each accessor, `#define`s. Records are whole 16-byte words, and a field never
//! straddles two of them, so that one layout serves std140, std430, push constants and texel buffers.

/// A field of a record: its name, its GLSL type and its offset in bytes.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    pub name: &'static str,
    pub glsl: &'static str,
    pub offset: usize,
}

/// A record as the shaders see it.
#[derive(Clone, Copy, Debug)]
pub struct Record {
    pub name: &'static str,
    pub size: usize,
    pub fields: &'static [Field],
}

macro_rules! host_type {
    (vec3) => {
        [f32; 3]
    };
    (float) => {
        f32
    };
    (uint) => {
        u32
    };
    (int) => {
        i32
    };
}

macro_rules! records {
    ($($(#[$doc:meta])* $name:ident { $($(#[$fdoc:meta])* $field:ident: $kind:ident,)* })*) => {
        $(
            $(#[$doc])*
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Default, PartialEq)]
            pub struct $name { $($(#[$fdoc])* pub $field: host_type!($kind),)* }
            // SAFETY: repr(C), every field is made of 4-byte numbers, and the assertion below leaves no
            // room for padding, so any bytes are a valid value and every byte is initialised.
            unsafe impl bytemuck::Zeroable for $name {}
            unsafe impl bytemuck::Pod for $name {}
            const _: () = {
                assert!(size_of::<$name>() == 0 $(+ size_of::<host_type!($kind)>())*);
                assert!(size_of::<$name>() % 16 == 0);
            };
        )*
        /// Every record, in the order of their definition.
        pub const RECORDS: &[Record] = &[$(Record {
            name: stringify!($name),
            size: size_of::<$name>(),
            fields: &[$(Field {
                name: stringify!($field),
                glsl: stringify!($kind),
                offset: std::mem::offset_of!($name, $field),
            },)*],
        },)*];
    };
}

macro_rules! constants {
    ($($(#[$doc:meta])* $name:ident = $value:expr;)*) => {
        $($(#[$doc])* pub const $name: u32 = $value;)*
        /// Every shared constant with its value, for the GLSL side.
        pub const CONSTANTS: &[(&str, u32)] = &[$((stringify!($name), $name),)*];
    };
}

records! {
    /// A triangle for the Möller–Trumbore intersector: corner and two edges, scene units.
    Triangle {
        a: vec3,
        /// Position of the triangle in the file: what a hit reports, and what decides a tie.
        id: uint,
        ab: vec3,
        /// Sum of the sizes of the components of `ab`, or more.
        ab_sum: float,
        ac: vec3,
        ac_sum: float,
    }
    /// A triangle for the watertight intersector: its corners, scene units, and as for [`Triangle`] its place in the file.
    Corners {
        a: vec3,
        id: uint,
        b: vec3,
        pad0: uint,
        c: vec3,
        pad1: uint,
    }
    /// A node of a binary tree in post-order (root last). A leaf stores `-1 - first` in `left` and
    /// `-1 - last` in `right`, both in the order of the triangle array.
    Node {
        pmin: vec3,
        left: int,
        pmax: vec3,
        right: int,
    }
    /// A node of the threaded tree in its own compact form: after a hit go to `index - 1`, otherwise
    /// to `skip` (-1 at the end). `leaf` is 0 inside the tree; a leaf stores
    /// `-1 - (first * LEAF_LIMIT + count - 1)` there.
    ThreadedNode {
        pmin: vec3,
        skip: int,
        pmax: vec3,
        leaf: int,
    }
    /// The threaded node of the original: a [`Node`] and one more word.
    ThreadedNode48 {
        pmin: vec3,
        left: int,
        pmax: vec3,
        right: int,
        pad: vec3,
        skip: int,
    }
    /// An inner node with the boxes of both its children, each with a reference: a node (0 is the root), or a
    /// leaf as in [`ThreadedNode`]. A lone leaf is a node that names it twice, once with a box out of reach.
    PairNode {
        left_min: vec3,
        left: int,
        left_max: vec3,
        right: int,
        right_min: vec3,
        pad0: uint,
        right_max: vec3,
        pad1: uint,
    }
    /// The same with each box as its centre and half its size, grown for a test in fewer operations. In every axis the box
    /// reaches from centre - half to centre + half.
    CentredNode {
        left_center: vec3,
        left: int,
        left_half: vec3,
        right: int,
        right_center: vec3,
        pad0: uint,
        right_half: vec3,
        pad1: uint,
    }
    /// The same in three quarters of the room: three halves share two words, 20 bits of x and 21 of y and z, so that each takes a shift
    /// or two to read (see `packed_halves` of src/pack.rs).
    CompactNode {
        left_center: vec3,
        left: int,
        right_center: vec3,
        right: int,
        left_half_xz: uint,
        left_half_yz: uint,
        right_half_xz: uint,
        right_half_yz: uint,
    }
    /// Eight children with boxes of 8 bits a side. Along axis k of scale s = 2^(byte k of `scales` - 127) a side of
    /// slot i is origin + s q, where q is byte i mod 4 of the word of slots 0 to 3, or of 4 to 7. Byte 3 of `scales`
    /// has bit i set where slot i is filled, with a reference as in [`PairNode`].
    WideNode {
        origin: vec3,
        scales: uint,
        min_x0: uint,
        min_x4: uint,
        min_y0: uint,
        min_y4: uint,
        min_z0: uint,
        min_z4: uint,
        max_x0: uint,
        max_x4: uint,
        max_y0: uint,
        max_y4: uint,
        max_z0: uint,
        max_z4: uint,
        child0: int,
        child1: int,
        child2: int,
        child3: int,
        child4: int,
        child5: int,
        child6: int,
        child7: int,
    }
    /// A triangle, or two that make a flat convex quadrilateral: the box around it, grown by what the test of shaders/traverse/beam.glsl may err;
    /// their places in the array, `second` with [`FACE_TURNED`] where they are wound unlike, the same as `first` where there is no other; the
    /// triangles' planes and the edges' functions (see shaders/traverse/edges.glsl). The array begins with a record of how many faces there
    /// are, and how many of them have four edges.
    Face {
        min: vec3,
        first: uint,
        max: vec3,
        second: uint,
        normal0: vec3,
        offset0: float,
        normal1: vec3,
        offset1: float,
        along_a: vec3,
        moment_ax: float,
        along_b: vec3,
        moment_ay: float,
        along_c: vec3,
        moment_az: float,
        along_d: vec3,
        moment_bx: float,
        moment_by: float,
        moment_bz: float,
        moment_cx: float,
        moment_cy: float,
        moment_cz: float,
        moment_dx: float,
        moment_dy: float,
        moment_dz: float,
    }
    /// Four children with their boxes, side by side: min_x0 to min_x3 are one word. A reference is that of a node or of a leaf, as
    /// in [`PairNode`]. An empty slot repeats the first one's reference, with a box out of reach.
    QuadNode {
        min_x0: float,
        min_x1: float,
        min_x2: float,
        min_x3: float,
        max_x0: float,
        max_x1: float,
        max_x2: float,
        max_x3: float,
        min_y0: float,
        min_y1: float,
        min_y2: float,
        min_y3: float,
        max_y0: float,
        max_y1: float,
        max_y2: float,
        max_y3: float,
        min_z0: float,
        min_z1: float,
        min_z2: float,
        min_z3: float,
        max_z0: float,
        max_z1: float,
        max_z2: float,
        max_z3: float,
        child0: int,
        child1: int,
        child2: int,
        child3: int,
        pad0: uint,
        pad1: uint,
        pad2: uint,
        pad3: uint,
    }
    /// What stays the same for all dispatches of a render.
    Frame {
        /// Camera ray of raster position (x, y): origin + x origin_dx + y origin_dy, and likewise its
        /// direction (not normalised).
        origin: vec3,
        /// Longest camera ray, in units of its direction.
        camera_t_max: float,
        origin_dx: vec3,
        width: uint,
        origin_dy: vec3,
        height: uint,
        direction: vec3,
        /// Distance from the surface, along the normal, at which ambient rays start; scene units.
        offset: float,
        direction_dx: vec3,
        /// Longest ambient ray, scene units.
        ambient_t_max: float,
        direction_dy: vec3,
        seed: uint,
        node_count: uint,
        triangle_count: uint,
        /// Raster position of a pixel: its column and row plus this.
        pixel_shift: float,
        /// By how much robust slabs grow a box on every side, scene units.
        box_pad: float,
        /// The first sample of the render: counts hold those from here on.
        sample_base: uint,
        /// Camera rays of a pixel: number p + j `pixels` is ray j of pixel p.
        jitters: uint,
        /// Pixel numbers of the picture, those beyond its edges included.
        pixels: uint,
        /// Largest coordinate of the scene.
        largest: float,
        /// Device addresses of nodes and triangles, each in two halves; 0 where the device has none.
        nodes_low: uint,
        nodes_high: uint,
        triangles_low: uint,
        triangles_high: uint,
    }
    /// The work of one dispatch (push constants): pixels x samples x triangles.
    Range {
        pixel_begin: uint,
        pixel_end: uint,
        sample_begin: uint,
        sample_end: uint,
        triangle_begin: uint,
        triangle_end: uint,
        /// The pixel that element 0 of the per-pixel buffers belongs to.
        pixel_base: uint,
        /// One of the `STAGE_` constants.
        stage: uint,
        /// Samples of an invocation, where a pixel has several.
        block: uint,
        /// How far the elements of two blocks of one pixel are apart in the buffers that hold them.
        stride: uint,
        /// Samples from here to `set_end` are one set, in the strata or the order of which they are taken (`SAMPLER_STRATA`, `SAMPLER_SOBOL`).
        set_begin: uint,
        set_end: uint,
    }
    /// A pixel of the list of those whose camera ray hit and that have samples to do.
    Listed {
        pixel: uint,
        /// Samples of the range that are done already.
        skip: uint,
        /// Its `Budget`, where each pixel has its own number of samples.
        begin: uint,
        end: uint,
    }
    /// The samples that a pixel gets in one go; they are one set of strata.
    Budget {
        begin: uint,
        end: uint,
        pad0: uint,
        pad1: uint,
    }
    /// How long the list is, and the workgroups of the indirect dispatches over it: each block of samples, and
    /// each pixel.
    ListArguments {
        blocks_x: uint,
        blocks_y: uint,
        blocks_z: uint,
        count: uint,
        pixels_x: uint,
        pixels_y: uint,
        pixels_z: uint,
        pad0: uint,
    }
    /// What an invocation did of its block of a pixel's samples: the first `finished` of them.
    Partial {
        escaped0: uint,
        escaped1: uint,
        finished: uint,
        /// Weights of the escaped rays.
        sum: float,
    }
    /// Rays of a pixel that escaped and that were traced, for each of two halves with independent
    /// random numbers: sample i belongs to half i mod 2.
    Count {
        escaped0: uint,
        traced0: uint,
        escaped1: uint,
        traced1: uint,
    }
    /// A pixel's state between two dispatches that each test a part of the triangles.
    Carry {
        t: float,
        u: float,
        v: float,
        /// Place in the triangle array; `NO_HIT` if none yet.
        index: uint,
        id: uint,
        /// 1 once the ambient ray under way has met a triangle.
        occluded: uint,
        pad0: uint,
        pad1: uint,
    }
    /// A ray of a list.
    RayRecord {
        origin: vec3,
        /// Negative where there is no ray.
        t_max: float,
        direction: vec3,
        /// What it counts if it escapes.
        weight: float,
    }
    /// The answer to a ray: distance in units of its direction, barycentric coordinates of the second
    /// and third corner, and the place in the triangle array (`NO_HIT` where it escaped).
    HitRecord {
        t: float,
        u: float,
        v: float,
        index: uint,
    }
    /// What the traversals of a pixel's rays cost, from the kernels that count it.
    Work {
        closest_visits: uint,
        closest_tests: uint,
        /// Visits and tests of the subgroup that this invocation counted for all.
        closest_group_steps: uint,
        subgroup_size: uint,
        any_visits: uint,
        any_tests: uint,
        any_group_steps: uint,
        pad: uint,
    }
    /// What a slot of workgroups did: compared with what was asked for after every submit.
    Counters {
        primary_asked: uint,
        primary_finished: uint,
        ambient_asked: uint,
        ambient_finished: uint,
        overflowed: uint,
        /// Escaped rays, where an experiment adds each of them here.
        escaped: uint,
        pad1: uint,
        pad2: uint,
    }
}

impl Triangle {
    pub fn new(a: [f32; 3], id: u32, ab: [f32; 3], ac: [f32; 3]) -> Self {
        // Two additions round by no more than 2^-23 together.
        let sum = |v: [f32; 3]| (v[0].abs() + v[1].abs() + v[2].abs()) * (1.0 + 2.0 * f32::EPSILON);
        Self { a, id, ab, ab_sum: sum(ab), ac, ac_sum: sum(ac) }
    }
}

constants! {
    /// Descriptor bindings, all of set 0.
    BINDING_FRAME = 0;
    BINDING_NODES = 1;
    BINDING_TRIANGLES = 2;
    BINDING_COUNTS = 3;
    BINDING_IMAGE = 4;
    BINDING_SEEDS = 5;
    BINDING_CARRY = 6;
    BINDING_COUNTERS = 7;
    BINDING_RAYS = 8;
    BINDING_HITS = 9;
    /// The range of a dispatch, where it is a uniform block (OpenGL).
    BINDING_RANGE = 10;
    BINDING_WORK = 11;
    BINDING_LIST = 12;
    BINDING_ARGUMENTS = 13;
    BINDING_PARTIALS = 14;
    BINDING_ANSWERS = 15;
    BINDING_BUDGETS = 16;

    /// Specialization constants.
    SPEC_STACK_SIZE = 0;
    SPEC_SAMPLER = 1;
    SPEC_ORIGINAL = 2;
    SPEC_ROBUST_SLABS = 3;
    SPEC_LEAF_SIZE = 4;
    SPEC_STACK_ROOM = 5;
    /// Normals face the camera.
    SPEC_FACING = 6;
    /// Random numbers begin again after so many samples; 0: never.
    SPEC_REPEAT = 7;
    /// A pixel has several camera rays.
    SPEC_JITTERED = 8;
    /// Ambient rays start some ulps off their surface, not `Frame::offset`.
    SPEC_ULP_OFFSET = 9;
    /// Each pixel has its own number of samples.
    SPEC_BUDGETS = 10;
    /// A pixel whose camera ray hits nothing is passed over from then on (`MISSED`).
    SPEC_MARKS_MISSES = 11;
    /// Triangles are kept by their corners and met by the watertight intersector.
    SPEC_WATERTIGHT = 12;
    /// Möller and Trumbore, but no triangle is missed that the exact ray meets.
    SPEC_CONSERVATIVE = 13;
    /// Lanes that share a listed pixel's samples.
    SPEC_SAMPLE_LANES = 14;
    /// Ambient rays may have an end.
    SPEC_BOUNDED = 15;
    /// Bits of the cells in whose order `sobol` takes each set of samples.
    SPEC_CELLS = 16;
    /// Nodes by their centres are compact ones.
    SPEC_COMPACT = 17;
    /// The driver may leave a loop before its condition fails.
    SPEC_LEAVES_LOOPS = 18;

    /// Bits of the cells of a set of 64 samples or more.
    SOBOL_CELL_BITS = 5;
    /// A value of `SPEC_CELLS`: sets are not all one net each, so each is looked at.
    ANY_CELLS = 6;

    /// Values of `SPEC_SAMPLER`.
    SAMPLER_LCG = 0;
    SAMPLER_PCG = 1;
    SAMPLER_SOBOL = 2;
    SAMPLER_STRATA = 3;
    SAMPLER_PHILOX = 4;

    /// Third words of `pcg4d`: no two purposes get the same numbers (0 is `pcg`'s).
    KEY_SOBOL = 0x736f_626c;
    KEY_STRATA = 0x7374_7261;
    KEY_CAMERA = 0x6361_6d65;

    /// Values of `Range::stage`: closest hit and ambient rays, or one of them.
    STAGE_BOTH = 0;
    STAGE_CLOSEST = 1;
    STAGE_ANY = 2;

    /// A workgroup is a tile of 8x8 pixels; pixels are numbered tile by tile.
    TILE_SIDE = 8;
    WORKGROUP_SIZE = 64;

    /// Pixels of a workgroup of the list: whole tiles.
    LIST_SIZE = 256;
    /// Places of words that are written by their number.
    COUNTER_WORDS = 8;
    COUNTED_WORDS = 5;
    OVERFLOWED_WORD = 4;
    ESCAPED_WORD = 5;
    ARGUMENT_WORDS = 7;
    BLOCKS_Z_WORD = 2;
    /// A bit for each of the list's sizes that workgroups add to: blocks_x, count and pixels_x.
    ADDED_WORDS = 0x19;
    /// In a face's second triangle: it is wound unlike the first.
    FACE_TURNED = 0x8000_0000;

    /// Counters are spread over this many slots, so that workgroups seldom meet on one.
    COUNTER_SLOTS = 64;

    /// Ambient rays that the original traces for each pixel and frame.
    FRAME_SAMPLES = 4;

    /// Most triangles in a leaf of the threaded tree.
    LEAF_LIMIT = 8;
    /// Its logarithm.
    LEAF_BITS = 3;

    /// 16-byte words of a wide node, and the first one that holds references.
    WIDE_WORDS = 6;
    /// Most entry points of a workgroup, a bit each of a word.
    ENTRIES = 32;
    WIDE_CHILD_WORD = 4;

    /// 16-byte words of a quad node, and the one that holds its references.
    QUAD_WORDS = 8;
    QUAD_CHILD_WORD = 6;

    /// Triangles that fit the uniform buffer of the original's first form.
    UNIFORM_TRIANGLES = 1024;

    /// Steps of an invocation of the clock probe: under the shortest limit on loops that a driver has.
    CLOCK_STEPS = 4096;
    /// Its workgroups: enough to fill large GPUs.
    CLOCK_GROUPS = 1024;

    /// No triangle.
    NO_HIT = 0xffff_ffff;
    /// No answer: the ray did not come to its end.
    UNFINISHED = 0xffff_fffe;
    /// In `Count::escaped0` of a pixel that traced nothing: its camera ray hits nothing either.
    MISSED = 0xffff_ffff;
}

const _: () = {
    assert!(size_of::<WideNode>() == 16 * WIDE_WORDS as usize);
    assert!(std::mem::offset_of!(WideNode, child0) == 16 * WIDE_CHILD_WORD as usize);
    assert!(size_of::<QuadNode>() == 16 * QUAD_WORDS as usize);
    assert!(std::mem::offset_of!(QuadNode, child0) == 16 * QUAD_CHILD_WORD as usize);
};

const _: () = {
    use std::mem::offset_of;
    assert!(size_of::<Counters>() == 4 * COUNTER_WORDS as usize);
    assert!(
        offset_of!(Counters, overflowed) == 4 * OVERFLOWED_WORD as usize
            && COUNTED_WORDS == OVERFLOWED_WORD + 1
    );
    assert!(offset_of!(Counters, escaped) == 4 * ESCAPED_WORD as usize);
    assert!(offset_of!(ListArguments, pixels_z) == 4 * (ARGUMENT_WORDS as usize - 1));
    assert!(offset_of!(ListArguments, blocks_z) == 4 * BLOCKS_Z_WORD as usize);
    let added = [
        offset_of!(ListArguments, blocks_x),
        offset_of!(ListArguments, count),
        offset_of!(ListArguments, pixels_x),
    ];
    assert!(ADDED_WORDS == 1 << (added[0] / 4) | 1 << (added[1] / 4) | 1 << (added[2] / 4));
};
