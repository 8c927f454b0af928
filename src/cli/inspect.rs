//! `cousu inspect`.

use std::path::PathBuf;

use clap::Args;

use super::session;
use crate::error::Result;
use crate::render::choices::Wishes;
use crate::scene::{Scene, digits};

#[derive(Args)]
pub struct Arguments {
    /// The scene, a Wavefront OBJ file
    scene: PathBuf,
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let scene = Scene::load(&arguments.scene)?;
    let report = &scene.report;
    let (min, max) = (scene.bounds.min, scene.bounds.max);
    let mut text = format!("{}\n", scene.path);
    text += &format!(
        "file        {} bytes, {} lines, {} vertices, {} faces ({} of them polygons), {} groups\n",
        report.bytes, report.lines, report.vertices, report.faces, report.polygons, report.groups
    );
    text += &format!("triangles   {} (hash {:016x})\n", scene.mesh.triangles.len(), scene.hash);
    text += &format!("box         ({}, {}, {}) to ({}, {}, {})\n", min.x, min.y, min.z, max.x, max.y, max.z);
    text += &format!("diagonal    {}\n", scene.bounds.diagonal());
    if !report.missing_materials.is_empty() {
        text += &format!("materials   missing and not needed: {}\n", report.missing_materials.join(", "));
    }
    if report.dropped.is_empty() {
        text += "dropped     nothing\n";
    } else {
        text += &format!("dropped     {}\n", report.dropped);
    }
    // For few samples: nothing is tried.
    let geometry = session::geometry(&scene, &Wishes { samples: Some(1), ..Wishes::default() })?;
    if geometry.without_area > 0 {
        text += &format!(
            "too thin    {} triangles, whose area 32-bit floats do not see\n",
            geometry.without_area
        );
    }
    if geometry.copies > 0 {
        text += &format!(
            "copies      {} triangles with the corners of another, left out: no ray tells them apart\n",
            geometry.copies
        );
    }
    for warning in digits::warnings(&scene.mesh) {
        text += &format!("digits      {warning}\n");
    }
    text += &format!(
        "tree        {}: {} nodes, {} levels, a stack of up to {} entries",
        geometry.builder.name(),
        geometry.tree.nodes.len(),
        geometry.tree.depth(),
        geometry.stack_bound
    );
    super::print(&text)
}
