//! When the parts of a render happened, for a timeline.

use std::time::Instant;

use crate::layout::Range;
use crate::vk::Finished;

/// A part of the host's work.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    pub name: &'static str,
    pub begin: Instant,
    pub end: Instant,
    /// On a second thread, beside what the first one does.
    pub beside: bool,
}

impl Span {
    /// What a second thread did from `begin` until now.
    pub fn beside(name: &'static str, begin: Instant) -> Self {
        Self { name, begin, end: Instant::now(), beside: true }
    }
}

/// A submit: what was asked of the device and when it was done.
#[derive(Clone, Debug)]
pub struct Submit {
    /// One for each dispatch.
    pub ranges: Vec<Range>,
    /// Rays that came to their end.
    pub rays: u64,
    pub finished: Finished,
}

/// All of them.
#[derive(Clone, Debug)]
pub struct Spans {
    /// Where the timeline begins.
    pub origin: Instant,
    pub phases: Vec<Span>,
    pub submits: Vec<Submit>,
}

impl Spans {
    pub fn new(origin: Instant) -> Self {
        Self { origin, phases: Vec::new(), submits: Vec::new() }
    }

    /// Notes that a phase ends now.
    pub fn phase(&mut self, name: &'static str, begin: Instant) {
        self.phases.push(Span { name, begin, end: Instant::now(), beside: false });
    }
}
