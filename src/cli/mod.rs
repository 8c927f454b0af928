//! The command line: one thin file a command.

mod args;
mod bench;
mod chart;
mod chart_run;
mod claims;
mod compare;
mod devices;
mod doctor;
mod inspect;
mod plan;
mod progress;
mod render;
mod scaling;
mod scene;
mod session;
mod stability;

use std::io::{self, Write};

use clap::{Parser, Subcommand};

use crate::error::{Error, Result};

#[derive(Parser)]
#[command(name = "cousu", version, about = "Ambient light of triangle scenes by Vulkan compute.")]
#[command(arg_required_else_help = true, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Render the ambient light of a scene.
    Render(Box<render::Arguments>),
    /// Run the same frames on OpenGL and on Vulkan, side by side: images and times.
    Compare(Box<compare::Arguments>),
    /// Measure every method on scenes, frame by frame in turn: GPU times, the report's Table 1.
    Bench(Box<bench::Arguments>),
    /// Chart speed against accuracy: errors of pictures over the GPU time that they take.
    Chart(Box<chart::Arguments>),
    /// Show where each method fails, how badly, and which one does not.
    Stability(Box<stability::Arguments>),
    /// Test each statement of the report that cousu grew from on this device: holds or does not hold.
    Claims(Box<claims::Arguments>),
    /// List the Vulkan devices, best first.
    Devices,
    /// Tell what is there, what is missing and how to get it.
    Doctor,
    /// Tell what is in a scene file: dropped, degenerate, NaN, with line numbers.
    Inspect(inspect::Arguments),
    /// Tell what `render` would choose on this device, and why.
    Plan(plan::Arguments),
    /// Write a procedural scene.
    Scene(scene::Arguments),
}

/// Runs the command of the process's arguments; prints what went wrong and returns the exit code.
pub fn run() -> u8 {
    match dispatch() {
        Ok(()) => 0,
        Err(error) => {
            tell(&format!("cousu: {error}"));
            error.exit_code()
        }
    }
}

fn dispatch() -> Result<()> {
    match Cli::parse().command {
        Command::Render(arguments) => render::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Bench(arguments) => bench::run(&arguments),
        Command::Chart(arguments) => chart::run(&arguments),
        Command::Stability(arguments) => stability::run(&arguments),
        Command::Claims(arguments) => claims::run(&arguments),
        Command::Devices => devices::run(),
        Command::Doctor => doctor::run(),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Plan(arguments) => plan::run(&arguments),
        Command::Scene(arguments) => scene::run(&arguments),
    }
}

/// Tells something on the standard error, as far as that can be written.
fn tell(text: &str) {
    let _ = writeln!(io::stderr(), "{text}");
}

/// Prints a result. A reader that has gone away (`cousu devices | head -1`) is no error.
fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => Err(Error::other(format!(
            "The standard output could not be written ({error}): redirect it elsewhere."
        ))),
        _ => Ok(()),
    }
}
