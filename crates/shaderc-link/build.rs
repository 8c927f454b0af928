//! Adds the libraries that Debian 12's `libshaderc.a` needs but does not name.
//!
//! Debian ships shaderc's "combined" archive as a stub: it holds shaderc alone, and linking it leaves
//! every glslang and SPIRV-Tools symbol undefined. Where that archive is a full one (a vendor's
//! SDK, other distributions), this crate must add nothing, or symbols would be defined twice.

use std::path::{Path, PathBuf};

/// In link order: a library comes before those it needs.
const LIBRARIES: [&str; 9] = [
    "glslang",
    "MachineIndependent",
    "GenericCodeGen",
    "OSDependent",
    "OGLCompiler",
    "HLSL",
    "SPIRV",
    "SPIRV-Tools-opt",
    "SPIRV-Tools",
];

/// A full combined archive weighs tens of megabytes; Debian's stub 0.2 MB.
const STUB_BYTES: u64 = 2 << 20;

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=SHADERC_LIB_DIR");
    if std::env::var_os("SHADERC_LIB_DIR").is_some() {
        return;
    }
    let Some(folder) = stub_folder() else { return };
    println!("cargo:rustc-link-search=native={}", folder.display());
    for library in LIBRARIES {
        if folder.join(format!("lib{library}.a")).exists() {
            println!("cargo:rustc-link-lib=static:-bundle={library}");
        }
    }
    println!("cargo:rustc-link-lib=dylib=stdc++");
}

/// The folder that holds Debian's stub beside the glslang archives, if this system has it.
fn stub_folder() -> Option<PathBuf> {
    let triplet = match std::env::var("CARGO_CFG_TARGET_ARCH").ok()?.as_str() {
        "x86_64" => "x86_64-linux-gnu",
        "aarch64" => "aarch64-linux-gnu",
        _ => return None,
    };
    let folder = Path::new("/usr/lib").join(triplet);
    let combined = folder.join("libshaderc_combined.a");
    let is_stub = combined.metadata().is_ok_and(|file| file.len() < STUB_BYTES);
    (is_stub && folder.join("libglslang.a").exists()).then_some(folder)
}
