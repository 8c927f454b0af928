//! Nothing but a link line: see `build.rs`.
