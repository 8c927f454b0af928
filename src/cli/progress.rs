//! How far a render or the building of a tree is: a bar on a terminal, a line now and then elsewhere.

use std::io::IsTerminal;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::render::rounds::Goal;
use crate::render::tally::Progress;

/// Steps of the bar.
const STEPS: u64 = 10_000;
/// Between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

pub struct Meter {
    goal: Goal,
    bar: Option<ProgressBar>,
    started: Instant,
    last_line: Instant,
}

impl Meter {
    pub fn new(goal: Goal) -> Self {
        let bar = std::io::stderr().is_terminal().then(new_bar);
        Self { goal, bar, started: Instant::now(), last_line: Instant::now() }
    }

    pub fn observe(&mut self, progress: &Progress) {
        let rate = if progress.gpu_ms > 0.0 { progress.rays as f64 / progress.gpu_ms * 1e-3 } else { 0.0 };
        let error = match (self.goal, progress.rmse) {
            (Goal::Rmse(goal), Some(rmse)) => format!(", error {rmse:.2e} of {goal:.2e}"),
            (_, Some(rmse)) => format!(", error {rmse:.2e}"),
            _ => String::new(),
        };
        match &self.bar {
            Some(bar) => {
                bar.set_position((progress.done * STEPS as f64) as u64);
                bar.set_message(format!("{rate:.1} Mrays/s{error}"));
            }
            None if self.last_line.elapsed() >= LINE_EVERY => {
                self.last_line = Instant::now();
                let elapsed = self.started.elapsed().as_secs_f64();
                let left = elapsed * (1.0 - progress.done) / progress.done.max(1e-6);
                super::tell(&format!(
                    "{:.0}% done, {rate:.1} Mrays/s{error}, {left:.0} s left",
                    progress.done * 100.0
                ));
            }
            None => {}
        }
    }

    pub fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}

/// How far a benchmark is with the rows of a view.
pub struct RowMeter {
    scene: String,
    bar: Option<ProgressBar>,
    last_line: Instant,
}

impl RowMeter {
    pub fn new() -> Self {
        Self { scene: String::new(), bar: None, last_line: Instant::now() }
    }

    pub fn scene(&mut self, name: &str) {
        self.scene = name.to_string();
    }

    /// `done` rows of `all` are through; `what` is at hand.
    pub fn observe(&mut self, what: &str, done: usize, all: usize) {
        if std::io::stderr().is_terminal() {
            let bar = self.bar.get_or_insert_with(|| {
                let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr());
                if let Ok(style) = ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}") {
                    bar.set_style(style);
                }
                bar
            });
            bar.set_length(all as u64);
            bar.set_position(done as u64);
            bar.set_message(format!("{}: {what}", self.scene));
        } else if self.last_line.elapsed() >= LINE_EVERY {
            self.last_line = Instant::now();
            super::tell(&format!("{}: {done} of {all} rows done ({what})", self.scene));
        }
    }

    /// Takes the bar away, so that text can be printed.
    pub fn clear(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

fn new_bar() -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(STEPS), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3}% {msg}, {eta} left") {
        bar.set_style(style);
    }
    bar
}

/// The tree of a scene: silent if it is built fast, with a bar or lines if not.
pub struct BuildMeter {
    started: Instant,
    shown: Mutex<Shown>,
}

/// What is on the screen.
struct Shown {
    bar: Option<ProgressBar>,
    last_line: Instant,
}

/// Builds that are done sooner show nothing.
const SILENT: Duration = Duration::from_secs(1);

impl BuildMeter {
    pub fn new() -> Self {
        let started = Instant::now();
        Self { started, shown: Mutex::new(Shown { bar: None, last_line: started }) }
    }

    /// `done` in [0, 1], from any thread. Whoever finds another at it goes on without waiting.
    pub fn observe(&self, done: f64) {
        if self.started.elapsed() < SILENT {
            return;
        }
        let Ok(mut shown) = self.shown.try_lock() else { return };
        if std::io::stderr().is_terminal() {
            let bar = shown.bar.get_or_insert_with(new_bar);
            bar.set_message("building the tree");
            bar.set_position((done * STEPS as f64) as u64);
        } else if shown.last_line.elapsed() >= LINE_EVERY {
            shown.last_line = Instant::now();
            super::tell(&format!("{:.0}% of the tree built", done * 100.0));
        }
    }

    pub fn finish(self) {
        if let Some(bar) = self.shown.into_inner().unwrap_or_else(PoisonError::into_inner).bar {
            bar.finish_and_clear();
        }
    }
}
