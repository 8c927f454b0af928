//! `cousu scene`.

use std::path::PathBuf;

use clap::Args;

use crate::error::{Error, Result};
use crate::report::atomic::Output;
use crate::scene::procedural::{self, Request};

#[derive(Args)]
#[command(after_help = scenes())]
pub struct Arguments {
    /// Name of the scene
    name: String,
    /// How many triangles to make, within 5% [default: the scene's own]
    #[arg(long, value_name = "N")]
    triangles: Option<u64>,
    /// Seed of the scenes with chance in them
    #[arg(long, value_name = "N", default_value = "0")]
    seed: u32,
    /// Where the OBJ goes
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

fn scenes() -> String {
    let lines: Vec<String> = procedural::KINDS
        .iter()
        .map(|kind| format!("  {:10} {} ({} triangles)", kind.name, kind.summary, kind.default_triangles))
        .collect();
    format!("Scenes:\n{}", lines.join("\n"))
}

pub fn run(arguments: &Arguments) -> Result<()> {
    let Some(kind) = procedural::find(&arguments.name) else {
        let names: Vec<&str> = procedural::KINDS.iter().map(|kind| kind.name).collect();
        return Err(Error::usage(format!(
            "There is no scene {:?}: choose one of {}.",
            arguments.name,
            names.join(", ")
        )));
    };
    let output = Output::claim(&arguments.output)?;
    let mesh = (kind.generate)(&Request { triangles: arguments.triangles, seed: arguments.seed })?;
    let triangles = mesh.triangles.len();
    let header = format!("{}: {}, {triangles} triangles, seed {}", kind.name, kind.summary, arguments.seed);
    output.write(|mut out| procedural::write_obj(&mesh, &header, &mut out))?;
    super::print(&format!("{}: {triangles} triangles", arguments.output.display()))
}
