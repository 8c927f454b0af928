//! How far a build has come.

use std::sync::atomic::{AtomicUsize, Ordering};

/// Counts triangles whose part of the tree is built.
pub struct Progress<'a> {
    report: &'a (dyn Fn(f64) + Sync),
    done: AtomicUsize,
    total: usize,
}

impl<'a> Progress<'a> {
    pub fn new(total: usize, report: &'a (dyn Fn(f64) + Sync)) -> Self {
        Self { report, done: AtomicUsize::new(0), total }
    }

    /// Adds finished triangles: once for a whole subtree, so that this stays cheap.
    pub fn add(&self, triangles: usize) {
        let done = self.done.fetch_add(triangles, Ordering::Relaxed) + triangles;
        self.reach(done as f64 / self.total as f64);
    }

    /// Reports a part of the whole build.
    pub fn reach(&self, part: f64) {
        (self.report)(part.clamp(0.0, 1.0));
    }
}
